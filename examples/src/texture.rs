//! Textures: values that vary over surfaces.
//!
//! Formulas and conventions are those of Mitsuba 3: texture coordinates `(u, v)` in the unit square cover a picture once, `v`
//! downwards from its first row.

use std::sync::Arc;

use fogbow::math::{Vec2, Vec3};
use fogbow::spectrum::Spectrum;

use crate::mesh::Attribute;
use crate::picture::Picture;
use crate::transform::{Transform, to_array};
use crate::volume::{Values, Volume};

/// Where a texture is asked for a value.
#[derive(Debug, Clone, Copy)]
pub struct Place<'a> {
    /// Point of the surface (m).
    pub point: Vec3,
    /// Texture coordinates.
    pub uv: Vec2,
    /// Attributes of the mesh, if it is one.
    pub attributes: &'a [Attribute],
    /// The triangle of the mesh.
    pub triangle: usize,
    /// Its vertices.
    pub vertices: [u32; 3],
    /// Weights of the vertices; their sum is 1.
    pub weights: [f32; 3],
}

impl Place<'_> {
    /// A place of a surface that is no mesh.
    #[must_use]
    pub fn plain(point: Vec3, uv: Vec2) -> Self {
        Self { point, uv, attributes: &[], triangle: 0, vertices: [0; 3], weights: [0.0; 3] }
    }
}

/// An affine map of texture coordinates: two rows of two factors and an offset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ToUv {
    /// Rows.
    pub rows: [[f32; 3]; 2],
}

impl ToUv {
    /// Leaves coordinates as they are.
    pub const IDENTITY: Self = Self { rows: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] };

    fn apply(&self, uv: Vec2) -> Vec2 {
        Vec2::from_array(self.rows.map(|r| r[0] * uv.x + r[1] * uv.y + r[2]))
    }
}

/// What is beyond the border of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Wrap {
    /// The picture again.
    #[default]
    Repeat,
    /// Its mirror image.
    Mirror,
    /// Its outermost pixels.
    Clamp,
}

impl Wrap {
    /// The index of a pixel or cell among `count`.
    #[must_use]
    pub fn index(self, at: i64, count: usize) -> usize {
        let n = count.max(1) as i64;
        let index = match self {
            Self::Repeat => at.rem_euclid(n),
            Self::Mirror => {
                let at = at.rem_euclid(2 * n);
                if at < n { at } else { 2 * n - 1 - at }
            }
            Self::Clamp => at.clamp(0, n - 1),
        };
        index as usize
    }
}

/// A value that varies over a surface.
#[derive(Debug, Clone, PartialEq)]
pub enum Texture {
    /// The same everywhere.
    Constant(Spectrum),
    /// A picture.
    Bitmap {
        /// Values as they are used: linear, unless they were asked for raw.
        picture: Arc<Picture>,
        /// Beyond its border.
        wrap: Wrap,
        /// Whether values between pixels are interpolated.
        is_smooth: bool,
        /// From the coordinates of the surface to those of the picture.
        to_uv: ToUv,
    },
    /// Squares, two by two in the unit square.
    Checkerboard {
        /// Where both coordinates are in the same half, and where they are not.
        parts: Arc<[Texture; 2]>,
        /// From the coordinates of the surface to those of the board.
        to_uv: ToUv,
    },
    /// Values that come with a mesh.
    Attribute {
        /// Name of the attribute.
        name: String,
        /// Factor on its values.
        scale: f32,
    },
    /// A grid in space.
    Grid {
        /// Its values.
        volume: Arc<Volume>,
        /// From the world to the unit cube of the grid.
        to_local: Transform,
    },
    /// Another, times a factor.
    Scaled(Arc<Texture>, Spectrum),
}

impl Texture {
    /// The value at a place.
    #[must_use]
    pub fn at(&self, place: &Place<'_>) -> Spectrum {
        match self {
            Self::Constant(value) => *value,
            Self::Bitmap { picture, wrap, is_smooth, to_uv } => {
                let uv = to_uv.apply(place.uv);
                if !*is_smooth {
                    let at = uv * Vec2::new(picture.width as f32, picture.height as f32);
                    let is_number = at.is_finite();
                    return if is_number {
                        texel(picture, *wrap, at.x.floor() as i64, at.y.floor() as i64)
                    } else {
                        Spectrum::ZERO
                    };
                }
                let Some(([a, b, c, d], share)) = bilinear(picture, *wrap, uv) else { return Spectrum::ZERO };
                let row = |a: Spectrum, b: Spectrum| a * (1.0 - share.x) + b * share.x;
                row(a, b) * (1.0 - share.y) + row(c, d) * share.y
            }
            Self::Checkerboard { parts, to_uv } => {
                let uv = to_uv.apply(place.uv);
                let is_high = |c: f32| c - c.floor() > 0.5;
                let [same, other] = &**parts;
                if is_high(uv.x) == is_high(uv.y) { same.at(place) } else { other.at(place) }
            }
            Self::Attribute { name, scale } => {
                let Some(attribute) = place.attributes.iter().find(|a| a.name == *name) else { return Spectrum::ZERO };
                let value = if attribute.is_of_triangles() {
                    attribute.at(place.triangle)
                } else {
                    place.vertices.iter().zip(place.weights).map(|(v, w)| attribute.at(*v as usize) * w).sum()
                };
                Spectrum((value * *scale).to_array())
            }
            Self::Grid { volume, to_local } => grid(volume, to_local.point(to_array(place.point))),
            Self::Scaled(inner, factor) => inner.at(place) * *factor,
        }
    }

    /// The value at a place where a number is due, not a colour: the same but for checkerboards, whose two parts Mitsuba 3.9.1
    /// then has the other way round.
    #[must_use]
    pub fn number_at(&self, place: &Place<'_>) -> Spectrum {
        match self {
            Self::Checkerboard { parts, to_uv } => {
                let is_high = |c: f32| c - c.floor() > 0.5;
                let uv = to_uv.apply(place.uv);
                parts[usize::from(is_high(uv.x) == is_high(uv.y))].number_at(place)
            }
            Self::Scaled(inner, factor) => inner.number_at(place) * *factor,
            _ => self.at(place),
        }
    }

    /// A typical value: the mean over its picture, where it has one.
    #[must_use]
    pub fn mean(&self) -> Spectrum {
        match self {
            Self::Constant(value) => *value,
            Self::Bitmap { picture, .. } => {
                let sum =
                    picture.pixels.iter().fold([0.0_f64; 3], |sum, p| [0, 1, 2].map(|i| sum[i] + f64::from(p[i])));
                Spectrum(sum.map(|c| (c / picture.pixels.len().max(1) as f64) as f32))
            }
            Self::Checkerboard { parts, .. } => (parts[0].mean() + parts[1].mean()) * 0.5,
            Self::Attribute { .. } | Self::Grid { .. } => Spectrum::splat(0.5),
            Self::Scaled(inner, factor) => inner.mean() * *factor,
        }
    }

    /// How a bump map `scale · value` rises along both texture coordinates: the gradient of its luminance.
    #[must_use]
    pub fn slope(&self, place: &Place<'_>) -> Vec2 {
        // Of a colour, what the eye sees of it (ITU-R BT.709).
        let luminance = |c: Spectrum| 0.212_671 * c[0] + 0.715_16 * c[1] + 0.072_169 * c[2];
        if let Self::Bitmap { picture, wrap, is_smooth: true, to_uv } = self {
            let Some((texels, share)) = bilinear(picture, *wrap, to_uv.apply(place.uv)) else { return Vec2::ZERO };
            let [a, b, c, d] = texels.map(luminance);
            let x = (b - a) * (1.0 - share.y) + (d - c) * share.y;
            let y = (c - a) * (1.0 - share.x) + (d - b) * share.x;
            let (x, y) = (x * picture.width as f32, y * picture.height as f32);
            let [u, v] = to_uv.rows;
            return Vec2::new(u[0] * x + v[0] * y, u[1] * x + v[1] * y);
        }
        let step = 1e-3;
        let value = |offset: Vec2| luminance(self.at(&Place { uv: place.uv + offset, ..*place }));
        let along = |axis: Vec2| (value(axis * step) - value(axis * -step)) / (2.0 * step);
        Vec2::new(along(Vec2::X), along(Vec2::Y))
    }
}

/// The four pixels around a point, the first row first, and where it lies between them. `None` where it is no number.
fn bilinear(picture: &Picture, wrap: Wrap, uv: Vec2) -> Option<([Spectrum; 4], Vec2)> {
    let at = uv * Vec2::new(picture.width as f32, picture.height as f32) - Vec2::splat(0.5);
    if !at.is_finite() {
        return None;
    }
    let low = at.floor();
    let (x, y) = (low.x as i64, low.y as i64);
    let texels = [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)].map(|(x, y)| texel(picture, wrap, x, y));
    Some((texels, at - low))
}

fn texel(picture: &Picture, wrap: Wrap, x: i64, y: i64) -> Spectrum {
    let (x, y) = (wrap.index(x, picture.width), wrap.index(y, picture.height));
    picture.pixels.get(y * picture.width + x).map_or(Spectrum::ZERO, |p| Spectrum(*p))
}

/// Trilinear between centres of cells, clamped to the border.
fn grid(volume: &Volume, at: [f64; 3]) -> Spectrum {
    let size = volume.size.map(|n| n as usize);
    let mut sum = 0.0;
    for corner in 0..8_u32 {
        let (mut weight, mut cell) = (1.0, [0; 3]);
        for axis in 0..3 {
            let place = at[axis] * size[axis] as f64 - 0.5;
            let (low, is_upper) = (place.floor(), corner >> axis & 1 == 1);
            let share = place - low;
            weight *= if is_upper { share } else { 1.0 - share };
            let index = if is_upper { low + 1.0 } else { low };
            cell[axis] = index.clamp(0.0, (size[axis] - 1) as f64) as usize;
        }
        let index = (cell[2] * size[1] + cell[1]) * size[0] + cell[0];
        let value = match &volume.values {
            Values::F32(values) => values.get(index).copied().unwrap_or(0.0),
            Values::U8(values) => f32::from(values.get(index).copied().unwrap_or(0)) / 255.0,
        };
        sum += weight * f64::from(value);
    }
    Spectrum::splat(sum as f32)
}
