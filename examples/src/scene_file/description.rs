//! What a scene file says, before anything is built from it.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use fogbow::phase::Phase;
use fogbow::spectrum::Spectrum;

use super::material::Material;
use crate::filter::Filter;
use crate::mesh::Mesh;
use crate::picture::Picture;
use crate::texture::{Texture, Wrap};
use crate::transform::{Transform, to_array, to_vec3};
use crate::vdb::BrickStorage;
use crate::volume::{Colours, Volume};
use crate::world::Body;

/// A scene as its file describes it: checked, with all files it names loaded.
#[derive(Debug, Clone)]
pub struct SceneFile {
    /// The file itself.
    pub file: PathBuf,
    /// How paths end.
    pub integrator: Integrator,
    /// The camera and its film.
    pub sensor: Sensor,
    /// Media, each in its containers.
    pub media: Vec<MediumDescription>,
    /// Surfaces. Shapes that only hold a medium are not among them.
    pub shapes: Vec<Shape>,
    /// Lights without a surface.
    pub emitters: Vec<Emitter>,
}

/// `<integrator>`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Integrator {
    /// Scattering events plus one, as Mitsuba counts; `None` is without limit.
    pub max_depth: Option<u32>,
    /// Depth from which Russian roulette may end a path.
    pub rr_depth: u32,
    /// Whether camera rays pass through area lights and do not see the background.
    pub hide_emitters: bool,
}

impl Default for Integrator {
    /// Mitsuba's `path` as it stands where a scene names no integrator.
    fn default() -> Self {
        Self { max_depth: None, rr_depth: 5, hide_emitters: false }
    }
}

/// Which way across the film the field of view is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FovAxis {
    /// The width.
    X,
    /// The height.
    Y,
    /// The shorter side.
    Smaller,
    /// The longer side.
    Larger,
    /// Corner to corner.
    Diagonal,
}

/// How rays leave a camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projection {
    /// From a point: `perspective`.
    Pinhole,
    /// From a lens: `thinlens`.
    Lens {
        /// Radius of the lens (m).
        radius: f64,
        /// Distance (m) along the axis of what is sharp.
        focus: f64,
    },
    /// All in one direction, from the image of `[−1, 1]²` under `to_world`: `orthographic`.
    Parallel,
}

/// `<sensor>` with its film and sampler.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sensor {
    /// How rays leave.
    pub projection: Projection,
    /// What part of the film is seen, as shares of its width and height from the upper left: two corners. The whole film is
    /// from 0 to 1; a shifted principal point lies beyond.
    pub window: [[f64; 2]; 2],
    /// How samples count for pixels.
    pub filter: Filter,
    /// Full angle of view (degrees), in (0, 180).
    pub fov: f64,
    /// Across which the angle is measured.
    pub fov_axis: FovAxis,
    /// Distance (m) along the axis where rays start.
    pub near: f64,
    /// Distance (m) along the axis where rays would end; never within the scene.
    pub far: f64,
    /// Rigid, or scaled where the projection is parallel; local +z looks forward, +y up, +x left.
    pub to_world: Transform,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Samples per pixel.
    pub samples: u32,
}

impl Default for Sensor {
    /// What Mitsuba takes for what is not said of a `perspective`.
    fn default() -> Self {
        Self {
            projection: Projection::Pinhole,
            window: [[0.0; 2], [1.0; 2]],
            filter: Filter::USUAL,
            // 50 mm on a film of 36 mm × 24 mm.
            fov: 2.0 * (36.0_f64.hypot(24.0) / 100.0).atan().to_degrees(),
            fov_axis: FovAxis::Diagonal,
            near: 1e-2,
            far: 1e4,
            to_world: Transform::IDENTITY,
            width: 768,
            height: 576,
            samples: 4,
        }
    }
}

/// A medium and where it fills space.
#[derive(Debug, Clone)]
pub struct MediumDescription {
    /// Its id in the file.
    pub id: String,
    /// What it is made of.
    pub matter: Matter,
    /// Where it is.
    pub places: Vec<Place>,
    /// Both corners (m) of a box beyond which nothing of it is, wherever its places reach.
    pub limits: Option<[[f64; 3]; 2]>,
    /// Radiance (W·m⁻²·sr⁻¹) with which it glows where nothing is seen through it: emission over absorption. Not of coloured matter.
    pub glow: Spectrum,
    /// What it glows with besides, by its temperature.
    pub heat: Option<Heat>,
}

/// Temperatures, and how they glow.
#[derive(Debug, Clone)]
pub struct Heat {
    /// Numbers on a grid.
    pub bricks: Arc<BrickStorage>,
    /// From the unit cube `[0, 1]³` of the bricks' box to the world.
    pub to_world: Transform,
    /// A number is `(number − offset) · scale` kelvin.
    pub offset: f32,
    /// Kelvin to a number.
    pub scale: f32,
    /// Radiance (W·m⁻²·sr⁻¹) at temperatures that are evenly spaced from 0 to `hottest`.
    pub colours: Arc<[Spectrum]>,
    /// Kelvin.
    pub hottest: f32,
}

impl Heat {
    /// Radiance (W·m⁻²·sr⁻¹) of a place with this number, between the colours; 0 below 100 K.
    #[must_use]
    pub fn radiance(&self, number: f32) -> Spectrum {
        let kelvin = ((number - self.offset) * self.scale).min(self.hottest);
        let last = self.colours.len().saturating_sub(1);
        if !(kelvin > 100.0) || last == 0 {
            return Spectrum::ZERO;
        }
        let at = kelvin / self.hottest * last as f32;
        let low = (at as usize).min(last - 1);
        let share = at - low as f32;
        self.colours[low] * (1.0 - share) + self.colours[low + 1] * share
    }
}

/// What a medium is made of.
#[derive(Debug, Clone)]
pub enum Matter {
    /// The same everywhere.
    Homogeneous {
        /// σₐ (m⁻¹).
        absorption: Spectrum,
        /// σₛ (m⁻¹).
        scattering: Spectrum,
        /// Angular law.
        phase: Phase,
    },
    /// Density on a voxel grid.
    Grid {
        /// The densities.
        volume: Arc<Volume>,
        /// From the unit cube `[0, 1]³` of the grid to the world.
        to_world: Transform,
        /// σₐ (m⁻¹) at density 1.
        absorption: Spectrum,
        /// σₛ (m⁻¹) at density 1.
        scattering: Spectrum,
        /// Angular law.
        phase: Phase,
    },
    /// Extinction and albedo that vary in colour.
    Coloured {
        /// σₜ (m⁻¹), but for the factor.
        extinction: Field,
        /// σₛ/σₜ, within [0, 1].
        albedo: Field,
        /// Factor on extinction.
        scale: f32,
        /// Angular law.
        phase: Phase,
    },
    /// Density on a sparse voxel grid.
    Sparse {
        /// The densities.
        bricks: Arc<BrickStorage>,
        /// From the unit cube `[0, 1]³` of the bricks' box to the world.
        to_world: Transform,
        /// σₐ (m⁻¹) at density 1.
        absorption: Spectrum,
        /// σₛ (m⁻¹) at density 1.
        scattering: Spectrum,
        /// Angular law.
        phase: Phase,
    },
}

impl Matter {
    /// The largest extinction (m⁻¹) of any channel, anywhere.
    #[must_use]
    pub fn densest(&self) -> f32 {
        let (extinction, density) = match self {
            Self::Homogeneous { absorption, scattering, .. } => (*absorption + *scattering, 1.0),
            Self::Grid { volume, absorption, scattering, .. } => (*absorption + *scattering, volume.max()),
            Self::Sparse { bricks, absorption, scattering, .. } => (*absorption + *scattering, bricks.max()),
            Self::Coloured { extinction: Field::Constant(extinction), scale, .. } => (*extinction, *scale),
            Self::Coloured { extinction: Field::Grid { colours, .. }, scale, .. } => (Spectrum(colours.most()), *scale),
        };
        extinction.max_element() * density
    }
}

impl MediumDescription {
    /// The box (m) around it: both corners.
    #[must_use]
    pub fn bounds(&self) -> [[f64; 3]; 2] {
        let mut all = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        for [low, high] in self.places.iter().map(|place| place.container.bounds()) {
            for axis in 0..3 {
                all[0][axis] = all[0][axis].min(low[axis]);
                all[1][axis] = all[1][axis].max(high[axis]);
            }
        }
        all
    }

    /// Free paths along the longest edge of its box, where it is densest: no ray meets many more.
    #[must_use]
    pub fn thickness(&self) -> f64 {
        let [low, high] = self.bounds();
        (0..3).map(|i| high[i] - low[i]).fold(0.0, f64::max) * f64::from(self.matter.densest())
    }
}

/// A colour that may vary in space.
#[derive(Debug, Clone)]
pub enum Field {
    /// The same everywhere.
    Constant(Spectrum),
    /// On a voxel grid.
    Grid {
        /// Its values.
        colours: Arc<Colours>,
        /// From the unit cube `[0, 1]³` of the grid to the world.
        to_world: Transform,
        /// Beyond the border, half a cell within the cube included.
        wrap: Wrap,
        /// Whether values are interpolated.
        is_smooth: bool,
    },
}

/// A container without its holes.
#[derive(Debug, Clone)]
pub struct Place {
    /// Where the medium is.
    pub container: Container,
    /// Where, within, it is not.
    pub holes: Vec<Container>,
}

/// A closed shape that holds a medium.
#[derive(Debug, Clone)]
pub enum Container {
    /// All of space.
    Everywhere,
    /// What a mesh encloses.
    Body(Arc<Body>),
    /// The image of the cube `[−1, 1]³`.
    Cube(Transform),
    /// A ball.
    Sphere {
        /// Centre (m).
        centre: [f64; 3],
        /// Radius (m).
        radius: f64,
    },
}

impl PartialEq for Container {
    /// Bodies are the same if they are one.
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Everywhere, Self::Everywhere) => true,
            (Self::Body(a), Self::Body(b)) => Arc::ptr_eq(a, b),
            (Self::Cube(a), Self::Cube(b)) => a == b,
            (Self::Sphere { centre, radius }, Self::Sphere { centre: c, radius: r }) => centre == c && radius == r,
            _ => false,
        }
    }
}

impl Container {
    /// Whether a point lies inside.
    #[must_use]
    pub fn contains(&self, point: [f64; 3]) -> bool {
        match self {
            Self::Everywhere => true,
            Self::Body(body) => body.contains(to_vec3(point)),
            Self::Cube(to_world) => {
                to_world.inverse().is_some_and(|to_local| to_local.point(point).iter().all(|c| c.abs() <= 1.0))
            }
            Self::Sphere { centre, radius } => {
                let square: f64 = (0..3).map(|i| (point[i] - centre[i]).powi(2)).sum();
                square <= radius * radius
            }
        }
    }

    /// Its middle (m); a point just inside, of a body of any form.
    #[must_use]
    pub fn centre(&self) -> [f64; 3] {
        match self {
            Self::Everywhere => [0.0; 3],
            Self::Body(body) => body.probes().first().copied().unwrap_or_else(|| to_array(body.bounds().centre())),
            Self::Cube(to_world) => to_world.column(3),
            Self::Sphere { centre, .. } => *centre,
        }
    }

    /// The smallest box around it: both corners (m).
    #[must_use]
    pub fn bounds(&self) -> [[f64; 3]; 2] {
        let reach = match self {
            Self::Everywhere => return [[f64::NEG_INFINITY; 3], [f64::INFINITY; 3]],
            Self::Body(body) => return [body.bounds().min, body.bounds().max].map(to_array),
            Self::Cube(to_world) => to_world.rows.map(|r| r[0].abs() + r[1].abs() + r[2].abs()),
            Self::Sphere { radius, .. } => [*radius; 3],
        };
        let centre = self.centre();
        [[0, 1, 2].map(|i| centre[i] - reach[i]), [0, 1, 2].map(|i| centre[i] + reach[i])]
    }

    /// Points just inside its surface.
    #[must_use]
    pub fn probes(&self) -> Vec<[f64; 3]> {
        const INSIDE: f64 = 1.0 - 1e-4;
        match self {
            Self::Everywhere => Vec::new(),
            Self::Body(body) => body.probes(),
            Self::Cube(to_world) => {
                let along = [-1.0, -0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0];
                let pairs = || along.into_iter().flat_map(move |u| along.into_iter().map(move |v| (u, v)));
                let face = |axis: usize, side: f64, (u, v): (f64, f64)| {
                    let mut at = [0.0; 3];
                    (at[axis], at[(axis + 1) % 3], at[(axis + 2) % 3]) = (side, u, v);
                    to_world.point(at.map(|c| c * INSIDE))
                };
                (0..6)
                    .flat_map(|i| pairs().map(move |at| (i / 2, if i % 2 == 0 { -1.0 } else { 1.0 }, at)))
                    .map(|(axis, side, at)| face(axis, side, at))
                    .collect()
            }
            Self::Sphere { centre, radius } => {
                // A spiral by the golden angle.
                let point = |i: u32| {
                    let z = 1.0 - (f64::from(i) + 0.5) / 128.0;
                    let (sin, cos) = (f64::from(i) * 2.399_963_229_728_653).sin_cos();
                    let r = (1.0 - z * z).sqrt();
                    let at = [r * cos, r * sin, z];
                    [0, 1, 2].map(|axis| centre[axis] + radius * INSIDE * at[axis])
                };
                (0..256).map(point).collect()
            }
        }
    }
}

/// A surface of the scene.
#[derive(Debug, Clone)]
pub struct Shape {
    /// Its form.
    pub geometry: Geometry,
    /// Whether normals point inwards.
    pub is_flipped: bool,
    /// What it does to light.
    pub material: Material,
    /// Radiance (W·m⁻²·sr⁻¹) it sends out on the side of its normals.
    pub radiance: Option<Spectrum>,
    /// What that varies by, where it does: a rectangle or a mesh; `radiance` is then its mean.
    pub glow: Option<Arc<Texture>>,
    /// The file that names it, which may be an included one.
    pub file: Arc<Path>,
    /// Line in the file.
    pub line: u32,
}

/// The form of a surface.
#[derive(Debug, Clone)]
pub enum Geometry {
    /// The image of `[−1, 1]²` at z = 0, normal +z.
    Rectangle(Transform),
    /// The image of the unit disc at z = 0, normal +z.
    Disk(Transform),
    /// The surface of the image of `[−1, 1]³`, normals outwards.
    Cube(Transform),
    /// A sphere, normals outwards.
    Sphere {
        /// Centre (m).
        centre: [f64; 3],
        /// Radius (m).
        radius: f64,
        /// Its own axes: texture coordinates go around the third.
        axes: Transform,
    },
    /// The image of the open cylinder around z, of radius 1 from z = 0 to z = 1, normals outwards.
    Cylinder(Transform),
    /// Triangles, already in world space.
    Mesh(Mesh),
}

/// A light without a surface.
#[derive(Debug, Clone)]
pub enum Emitter {
    /// Uniform in all directions.
    Point {
        /// Where (m).
        position: [f64; 3],
        /// W/sr.
        intensity: Spectrum,
    },
    /// A cone.
    Spot {
        /// Where (m).
        position: [f64; 3],
        /// Where it looks.
        axis: [f64; 3],
        /// Half angle of full light (degrees).
        beam: f64,
        /// Half angle where light ends (degrees).
        cutoff: f64,
        /// W/sr on the axis.
        intensity: Spectrum,
    },
    /// A point that throws a picture.
    Projector {
        /// Where, and its axes (unit): along the picture's rows, along its columns, ahead.
        to_world: Transform,
        /// Tangents of half the angles along rows and columns.
        half: [f64; 2],
        /// Half angles (degrees) of full light and where light ends, for a spot; a screen otherwise.
        cone: Option<[f64; 2]>,
        /// The picture, on the unit square.
        texture: Arc<Texture>,
        /// W/sr where the picture is 1: on the axis, or for a screen anywhere on one a metre ahead.
        intensity: Spectrum,
    },
    /// Parallel light.
    Directional {
        /// The way the light travels.
        direction: [f64; 3],
        /// W/m² on a plane across it.
        irradiance: Spectrum,
    },
    /// The same radiance from everywhere.
    Constant {
        /// W·m⁻²·sr⁻¹.
        radiance: Spectrum,
    },
    /// An image around the world.
    Environment {
        /// Radiance, already scaled.
        picture: Picture,
        /// A rotation.
        to_world: Transform,
    },
}
