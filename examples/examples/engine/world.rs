//! The engine's world: what it would have without any fog, and the fog.

use fogbow::host::{Hit, Scene};
use fogbow::light::{Light, PointLight};
use fogbow::math::{Bounds, Ray, Vec3};
use fogbow::medium::Homogeneous;
use fogbow::phase::Lobe;
use fogbow::spectrum::Spectrum;
use fogbow::surface::Surface;

/// The engine's vectors.
type Vector = [f32; 3];

fn add_scaled(a: Vector, b: Vector, factor: f32) -> Vector {
    core::array::from_fn(|i| a[i] + b[i] * factor)
}

fn dot(a: Vector, b: Vector) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// An endless wall across an axis.
struct Wall {
    axis: usize,
    at: f32,
    colour: Vector,
}

struct Ball {
    centre: Vector,
    radius: f32,
    colour: Vector,
}

/// A room with a ball in it, and the engine's ray caster.
pub(crate) struct Room {
    walls: [Wall; 6],
    ball: Ball,
}

/// Nearer surfaces are the one that the ray starts on.
const NEAREST: f32 = 1e-5;

impl Room {
    fn new() -> Self {
        let (white, red, green) = ([0.7, 0.7, 0.7], [0.6, 0.1, 0.1], [0.1, 0.5, 0.1]);
        let wall = |axis: usize, at: f32, colour: Vector| Wall { axis, at, colour };
        let [left, right] = [wall(0, -1.0, red), wall(0, 1.0, green)];
        let [floor, ceiling] = [wall(1, -1.0, white), wall(1, 1.0, white)];
        let [back, front] = [wall(2, -1.0, white), wall(2, 1.0, white)];
        let ball = Ball { centre: [0.3, -0.6, -0.3], radius: 0.4, colour: [0.3, 0.4, 0.7] };
        Self { walls: [left, right, floor, ceiling, back, front], ball }
    }

    /// Distance, normal and colour of what a ray meets.
    fn cast(&self, origin: Vector, direction: Vector) -> Option<(f32, Vector, Vector)> {
        let mut nearest: Option<(f32, Vector, Vector)> = None;
        let mut meet = |distance: f32, normal: Vector, colour: Vector| {
            if distance > NEAREST && nearest.is_none_or(|(so_far, ..)| distance < so_far) {
                nearest = Some((distance, normal, colour));
            }
        };
        for &Wall { axis, at, colour } in &self.walls {
            let mut normal = [0.0; 3];
            normal[axis] = -direction[axis].signum();
            meet((at - origin[axis]) / direction[axis], normal, colour);
        }
        let Ball { centre, radius, colour } = self.ball;
        let from_centre = add_scaled(origin, centre, -1.0);
        let half = dot(from_centre, direction);
        let root = (half * half - dot(from_centre, from_centre) + radius * radius).sqrt();
        // No root is no number, which is not greater than anything.
        for distance in [-half - root, -half + root] {
            let outwards = add_scaled(from_centre, direction, distance).map(|c| c / radius);
            let side = -dot(outwards, direction).signum();
            meet(distance, outwards.map(|c| c * side), colour);
        }
        nearest
    }
}

impl Scene for Room {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let (distance, normal, colour) = self.cast(ray.origin.into(), ray.direction.into())?;
        let surface = Surface::Lambert { reflectance: Spectrum(colour) };
        (distance < ray.length).then_some(Hit {
            distance,
            normal: normal.into(),
            shading: normal.into(),
            surface,
            light: None,
        })
    }
}

/// What is in the room.
pub(crate) struct Level {
    pub(crate) room: Room,
    pub(crate) fog: Homogeneous,
    pub(crate) lamps: [Light<'static>; 1],
}

pub(crate) fn level() -> Result<Level, Box<dyn core::error::Error>> {
    let fog = Homogeneous::new(Spectrum::splat(0.1), Spectrum::splat(0.5), Lobe::HenyeyGreenstein { g: 0.5 })?;
    let lamp = PointLight::from_flux(Vec3::new(-0.3, 0.5, 0.0), Spectrum::new(30.0, 27.0, 20.0))?;
    Ok(Level { room: Room::new(), fog, lamps: [Light::Point(lamp)] })
}

/// All that can be seen.
pub(crate) const BOUNDS: Bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };

/// Columns and rows of the picture, and samples of a pixel.
pub(crate) const SIZE: [u32; 2] = [16, 16];
pub(crate) const SAMPLES: u32 = 2;

/// Half the height of the picture at a distance of 1.
const HALF: f32 = 0.6;

/// Angular width of a pixel (rad).
pub(crate) const PIXEL: f32 = 2.0 * HALF / SIZE[1] as f32;

/// The ray through a point of the picture.
pub(crate) fn eye_ray([x, y]: [f32; 2]) -> Ray {
    let direction = Vec3::new(HALF * (2.0 * x - 1.0), HALF * (1.0 - 2.0 * y), -1.0);
    Ray::new(Vec3::new(0.0, 0.0, 0.95), direction.normalize())
}
