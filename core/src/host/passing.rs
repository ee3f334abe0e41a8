//! Rays that leave surfaces, and pass those that light does not notice.
//!
//! It lies beneath [`crate::world`], where hosts find it, because the default of [`Scene::is_blocked`] needs it.

use glam::Vec3;

use super::{Hit, Scene};
use crate::math::Ray;
use crate::surface::Surface;

/// Rays leave a surface this far above it, relative to the size of the coordinates: 64 roundings.
const OFFSET: f32 = 64.0 * f32::EPSILON;

/// Null interfaces that a ray passes at most; behind the last of them it ends as at a black wall.
///
/// A guard against scenes that find one interface again and again. What a ray can tell apart along its way is not many
/// times more.
pub const MAX_INTERFACES: u32 = 1 << 16;

/// Where a ray towards `direction` starts (m) that leaves the surface with `normal` at `point`: moved off it to that
/// side, so that the ray does not meet it again. `distance` (m) is the length of the ray that found the point, 0 if none
/// did: its rounding is in the point.
///
/// ```
/// # use fogbow::{math::Vec3, world::leave};
/// let above = leave(Vec3::X * 4.0, Vec3::Z, Vec3::Z, 0.0);
/// assert!(above.z > 0.0 && above.z < 1e-4);
/// assert!(leave(Vec3::X * 4.0, Vec3::Z, Vec3::NEG_Z, 0.0).z < 0.0);
/// ```
#[doc(alias("offset", "shadow acne", "self-intersection", "epsilon"))]
#[inline]
#[must_use]
pub fn leave(point: Vec3, normal: Vec3, direction: Vec3, distance: f32) -> Vec3 {
    let size = point.abs().max_element().max(distance) * OFFSET;
    point + normal * size.copysign(normal.dot(direction))
}

/// What is left of `ray` behind the surface it met at `hit`, which it passes.
///
/// ```
/// # use fogbow::{host::Hit, math::{Ray, Vec3}, surface::Surface, world::beyond};
/// let ray = Ray::new(Vec3::ZERO, Vec3::X).with_length(5.0);
/// let sheet = Hit { distance: 2.0, normal: Vec3::NEG_X, shading: Vec3::NEG_X, surface: Surface::Null, light: None };
/// let rest = beyond(&ray, &sheet);
/// assert!(rest.origin.x > 2.0 && rest.origin.x < 2.001 && rest.length == 3.0);
/// ```
#[inline]
#[must_use]
pub fn beyond(ray: &Ray, hit: &Hit) -> Ray {
    let origin = leave(ray.at(hit.distance), hit.normal, ray.direction, hit.distance);
    Ray { origin, direction: ray.direction, length: ray.length - hit.distance }
}

/// The nearest surface along `ray` that is no null interface, at its distance from the ray's origin: what blocks the ray.
///
/// However many null interfaces there are before it, the answer is that of the scene without them. Only where more than
/// [`MAX_INTERFACES`] are met does the ray end at the last of them, which is black then.
///
/// ```
/// # use fogbow::{host::{Hit, Scene}, math::{Ray, Vec3}, surface::Surface, world::nearest_surface};
/// /// A black wall at x = 2 behind an interface at x = 1.
/// struct Wall;
/// impl Scene for Wall {
///     fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
///         let (x, surface) = if ray.origin.x < 1.0 { (1.0, Surface::Null) } else { (2.0, Surface::BLACK) };
///         let distance = (x - ray.origin.x) / ray.direction.x;
///         (distance > 0.0 && distance < ray.length).then_some(Hit { distance, normal: Vec3::NEG_X, shading: Vec3::NEG_X, surface, light: None })
///     }
/// }
/// let ray = Ray::new(Vec3::ZERO, Vec3::X);
/// assert!((nearest_surface(&ray, &Wall).unwrap().distance - 2.0).abs() < 1e-6);
/// assert!(Wall.is_blocked(&ray) && !Wall.is_blocked(&ray.with_length(1.9)));
/// ```
#[doc(alias("intersect", "ray cast", "trace ray"))]
#[must_use]
pub fn nearest_surface(ray: &Ray, scene: &(impl Scene + ?Sized)) -> Option<Hit> {
    // Of the ray, where its rest starts; that lies a little beside the ray, but no farther with each interface.
    let (mut rest, mut start) = (*ray, 0.0);
    for interfaces in 0..=MAX_INTERFACES {
        let hit = scene.closest_hit(&rest)?;
        let found = Hit { distance: start + hit.distance, ..hit };
        if hit.surface != Surface::Null {
            return Some(found);
        }
        if interfaces == MAX_INTERFACES {
            return Some(Hit { surface: Surface::BLACK, light: None, ..found });
        }
        rest = beyond(ray, &found);
        start = (rest.origin - ray.origin).dot(ray.direction);
        rest.length = ray.length - start;
        if !(rest.length > 0.0) {
            break;
        }
    }
    None
}
