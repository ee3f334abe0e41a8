//! Rays towards lights.

use glam::Vec3;

use crate::light::{Falloff, Source};
use crate::math::Ray;

/// Shadow rays end this share of their length before the light, so that its own surface casts no
/// shadow; smaller than this, rounding in the host's intersection tests shows.
const SHADOW_MARGIN: f32 = 1e-4;

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
