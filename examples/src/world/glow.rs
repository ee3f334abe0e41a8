//! Pictures that lights show: textures drawn on grids, of which points are chosen by brightness.

use fogbow::light::{LightError, LightImage, PictureLight, Projector, Throw};
use fogbow::math::{Mat3, Vec2, Vec3};
use fogbow::spectrum::Spectrum;

use crate::mesh::{Mesh, has_area};
use crate::scene_file::{Emitter, Geometry, Shape};
use crate::texture::{Place, Texture};
use crate::transform::{Transform, to_vec3};

/// Texels along a side at least, where a texture is not even: steps between fewer show.
const LEAST: f32 = 128.0;

/// Texels along a side at most; of finer textures there are means.
const MOST: f32 = 2048.0;

/// The same for a triangle of a mesh, …
const MOST_OF_TRIANGLE: f32 = 512.0;

/// … and for all of one mesh together.
const MOST_OF_MESH: f32 = 4e6;

/// A picture with the tables to draw from it, and where it shines, if it has a surface.
#[derive(Debug)]
pub(super) struct Glow {
    width: usize,
    is_smooth: bool,
    texels: Vec<Spectrum>,
    weights: Vec<f32>,
    column: Vec<f32>,
    /// A corner and two edges.
    place: [Vec3; 3],
    is_triangle: bool,
}

impl Glow {
    /// Of `value(at)` on the unit square, the mean of `fine`² places in each texel.
    fn draw([width, height]: [usize; 2], fine: usize, is_smooth: bool, value: impl Fn(Vec2) -> Spectrum) -> Self {
        let along =
            |at: usize, part: usize, count: usize| (at as f32 + (part as f32 + 0.5) / fine as f32) / count as f32;
        let texel = |x: usize, y: usize| {
            let parts = (0..fine).flat_map(|j| (0..fine).map(move |i| (i, j)));
            let sum: Spectrum = parts.map(|(i, j)| value(Vec2::new(along(x, i, width), along(y, j, height)))).sum();
            // Neither negative nor endless light.
            Spectrum(sum.0.map(|c| if c > 0.0 && c < f32::INFINITY { c / (fine * fine) as f32 } else { 0.0 }))
        };
        let texels: Vec<_> =
            (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| texel(x, y)).collect();
        let (weights, column) = (vec![0.0; texels.len()], vec![0.0; height]);
        Self { width, is_smooth, texels, weights, column, place: [Vec3::ZERO; 3], is_triangle: false }
    }

    /// Of a texture on the unit square of its coordinates.
    fn of_square(texture: &Texture, place: impl Fn(Vec2) -> Place<'static>) -> Self {
        let ([across, down], is_smooth) = detail(texture);
        let side = |detail: f32| {
            let most = detail.ceil().max(1.0);
            if most == 1.0 || most >= LEAST { most.min(MOST) } else { most * (LEAST / most).ceil() }
        };
        let (width, height) = (side(across), side(down));
        let fine = (across / width).max(down / height).ceil().clamp(1.0, 4.0);
        Self::draw([width as usize, height as usize], fine as usize, is_smooth, |at| texture.at(&place(at)))
    }

    pub(super) fn bytes(&self) -> usize {
        size_of_val(&*self.texels) + size_of_val(&*self.weights) + size_of_val(&*self.column)
    }

    fn image(&mut self) -> Result<LightImage<'_>, LightError> {
        LightImage::new(self.width, &self.texels, &mut self.weights, &mut self.column, self.is_smooth)
    }

    pub(super) fn light(&mut self) -> Result<PictureLight<'_>, LightError> {
        let (place, is_triangle) = (self.place, self.is_triangle);
        PictureLight::new(place, is_triangle, self.image()?)
    }

    /// The light of an [`Emitter::Projector`].
    pub(super) fn projector(&mut self, emitter: &Emitter) -> Result<Projector<'_>, LightError> {
        let Emitter::Projector { to_world, half, cone, .. } = emitter else { return Err(LightError::Geometry) };
        let [x, y, z, position] = [0, 1, 2, 3].map(|i| to_vec3(to_world.column(i)));
        let throw = cone.map_or(Throw::Screen, |[beam, cutoff]| Throw::Spot {
            beam: beam.to_radians() as f32,
            cutoff: cutoff.to_radians() as f32,
        });
        let half = Vec2::from_array(half.map(|c| c as f32));
        Projector::new(position, Mat3::from_cols(x, y, z), half, throw, self.image()?)
    }
}

/// Cells of a texture across a unit of each coordinate, and whether it is continuous.
fn detail(texture: &Texture) -> ([f32; 2], bool) {
    match texture {
        Texture::Constant(_) => ([1.0; 2], false),
        Texture::Bitmap { picture, is_smooth, to_uv, .. } => {
            let size = [picture.width as f32, picture.height as f32];
            let crossed = |i: usize| to_uv.rows[0][i].abs() * size[0] + to_uv.rows[1][i].abs() * size[1];
            ([crossed(0), crossed(1)], *is_smooth)
        }
        Texture::Checkerboard { parts, to_uv } => {
            let crossed = |i: usize| 2.0 * (to_uv.rows[0][i].abs() + to_uv.rows[1][i].abs());
            let inner = [&parts[0], &parts[1]].map(|part| detail(part).0);
            ([0, 1].map(|i| crossed(i).max(inner[0][i]).max(inner[1][i])), false)
        }
        Texture::Attribute { .. } => ([16.0; 2], false),
        Texture::Grid { .. } => ([LEAST; 2], true),
        Texture::Scaled(inner, _) => detail(inner),
    }
}

/// The pictures of a shape that glows: one of a rectangle, one of each triangle that has an area.
pub(super) fn of_shape(shape: &Shape) -> Vec<Glow> {
    match (shape.glow.as_deref(), &shape.geometry) {
        (Some(texture), Geometry::Rectangle(to_world)) => vec![of_rectangle(texture, to_world, shape.is_flipped)],
        (Some(texture), Geometry::Mesh(mesh)) => of_mesh(texture, mesh, shape.is_flipped),
        _ => Vec::new(),
    }
}

fn of_rectangle(texture: &Texture, to_world: &Transform, is_flipped: bool) -> Glow {
    // The image of +z shines, also of a mirror image.
    let is_swapped = (to_world.determinant() < 0.0) != is_flipped;
    let mut glow = Glow::of_square(texture, |at| {
        let uv = if is_swapped { Vec2::new(at.y, at.x) } else { at };
        let point = to_world.point([f64::from(uv.x) * 2.0 - 1.0, f64::from(uv.y) * 2.0 - 1.0, 0.0]);
        Place::plain(to_vec3(point), uv)
    });
    let corner = to_vec3(to_world.point([-1.0, -1.0, 0.0]));
    let (u, v) = (to_vec3(to_world.column(0)) * 2.0, to_vec3(to_world.column(1)) * 2.0);
    glow.place = if is_swapped { [corner, v, u] } else { [corner, u, v] };
    glow
}

fn of_mesh(texture: &Texture, mesh: &Mesh, is_flipped: bool) -> Vec<Glow> {
    let ([across, down], is_smooth) = detail(texture);
    let turned = |[a, b, c]: [u32; 3]| if is_flipped { [a, c, b] } else { [a, b, c] };
    let uvs = |vertices: [u32; 3]| {
        // Where a mesh has none, a triangle's own.
        let of = |i: usize| mesh.texcoords.get(vertices[i] as usize).copied();
        [of(0).unwrap_or(Vec2::ZERO), of(1).unwrap_or(Vec2::X), of(2).unwrap_or(Vec2::Y)]
    };
    let side = |vertices: [u32; 3]| {
        let [a, b, c] = uvs(vertices);
        let crossed = [b - a, c - a, c - b].map(|e| e.x.abs() * across + e.y.abs() * down);
        let most =
            if let Texture::Attribute { .. } = texture { across } else { crossed.into_iter().fold(0.0, f32::max) };
        // A square has an edge somewhere in a texel; pixels have theirs within one.
        let fine = if let Texture::Checkerboard { .. } = texture { 32.0 } else { 4.0 };
        (most * if is_smooth { 2.0 } else { fine }).ceil().clamp(1.0, MOST_OF_TRIANGLE)
    };
    let all = || mesh.triangles.iter().enumerate().filter(|(_, t)| has_area(mesh.corners(**t)));
    let total: f32 = all().map(|(_, triangle)| side(*triangle).powi(2)).sum();
    let shrink = (MOST_OF_MESH / total.max(1.0)).sqrt().min(1.0);
    all()
        .map(|(number, triangle)| {
            let vertices = turned(*triangle);
            let [a, b, c] = mesh.corners(vertices);
            let (uv, n) = (uvs(vertices), (side(vertices) * shrink).ceil().max(1.0) as usize);
            // The middle of a texel on the diagonal is on it.
            let beyond = 1.0 + 0.5 / n as f32;
            let mut glow = Glow::draw([n, n], 1, false, |at| {
                if at.x + at.y > beyond {
                    return Spectrum::ZERO;
                }
                let weights = [(1.0 - at.x - at.y).max(0.0), at.x, at.y];
                let mean = |of: [Vec2; 3]| of[0] * weights[0] + of[1] * weights[1] + of[2] * weights[2];
                let point = a * weights[0] + b * weights[1] + c * weights[2];
                let place =
                    Place { point, uv: mean(uv), attributes: &mesh.attributes, triangle: number, vertices, weights };
                texture.at(&place)
            });
            (glow.place, glow.is_triangle) = ([a, b - a, c - a], true);
            glow
        })
        .collect()
}

/// The picture of an [`Emitter::Projector`].
pub(super) fn of_emitter(emitter: &Emitter) -> Option<Glow> {
    let Emitter::Projector { texture, intensity, .. } = emitter else { return None };
    let shown = Texture::Scaled(texture.clone(), *intensity);
    Some(Glow::of_square(&shown, |at| Place::plain(Vec3::ZERO, at)))
}
