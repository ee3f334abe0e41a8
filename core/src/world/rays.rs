//! Rays from surface to surface, and towards lights.

use glam::Vec3;

use crate::host::{Hit, Scene};
use crate::light::{Falloff, Source};
use crate::math::Ray;
use crate::surface::Surface;

/// Rays leave a surface this far above it, relative to the size of the coordinates: 64 roundings.
const OFFSET: f32 = 64.0 * f32::EPSILON;

/// Shadow rays end this share of their length before the light, so that its own surface casts no
/// shadow; smaller than this, rounding in the host's intersection tests shows.
const SHADOW_MARGIN: f32 = 1e-4;

/// Null interfaces passed by one ray; a handful of nested ones is a lot.
const MAX_INTERFACES: usize = 64;

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

/// The part of the `way` to a point of light along which surfaces cast a shadow: all but its end, where the
/// light's own surface lies.
///
/// ```
/// # use fogbow::{math::{Ray, Vec3}, world::short_of_end};
/// let way = Ray::between(Vec3::ZERO, Vec3::X * 2.0);
/// let shadow = short_of_end(&way);
/// assert!(shadow.length < 2.0 && shadow.length > 1.999);
/// ```
#[inline]
#[must_use]
pub fn short_of_end(way: &Ray) -> Ray {
    way.with_length(way.length * (1.0 - SHADOW_MARGIN))
}

/// The ray that asks whether `source` is hidden from `point`.
///
/// ```
/// # use fogbow::{light::PointLight, math::Vec3, spectrum::Spectrum, world::shadow_ray};
/// let lamp = PointLight::new(Vec3::X * 2.0, Spectrum::ONE).unwrap().source();
/// let ray = shadow_ray(Vec3::ZERO, &lamp);
/// assert!(ray.length < 2.0 && ray.length > 1.999);   // not into the lamp's own housing
/// ```
#[doc(alias("visibility", "occlusion"))]
#[inline]
#[must_use]
pub fn shadow_ray(point: Vec3, source: &Source) -> Ray {
    if source.falloff == Falloff::Distant {
        return Ray { origin: point, direction: -source.normal, length: f32::INFINITY };
    }
    short_of_end(&Ray::between(point, source.position))
}

/// The nearest surface along `ray` that is no null interface, at its distance from the ray's origin.
#[must_use]
pub fn nearest_surface(ray: &Ray, scene: &(impl Scene + ?Sized)) -> Option<Hit> {
    let mut passed = 0.0;
    for _ in 0..MAX_INTERFACES {
        let rest = Ray { origin: ray.at(passed), direction: ray.direction, length: ray.length - passed };
        let hit = scene.closest_hit(&rest)?;
        let distance = passed + hit.distance;
        if hit.surface != Surface::Null {
            return Some(Hit { distance, ..hit });
        }
        passed = distance + 1e-4 * hit.distance.max(1e-3);
    }
    None
}
