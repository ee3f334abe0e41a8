//! Directions and points from uniform numbers. Local directions have their axis along +z.

use glam::{Vec2, Vec3};

use crate::math::float::{self, INV_FOUR_PI, PI};

/// Unit vector with the given cosine to +z and azimuth `2π·u`.
///
/// `sine` is an argument because callers know it without cancellation.
#[inline]
#[must_use]
pub fn spherical(cosine: f32, sine: f32, u: f32) -> Vec3 {
    let (s, c) = float::sin_cos(2.0 * PI * u);
    Vec3::new(sine * c, sine * s, cosine)
}

/// A direction uniform over the sphere.
#[inline]
#[must_use]
pub fn uniform_sphere(u: Vec2) -> Vec3 {
    let cosine = 1.0 - 2.0 * u.x;
    spherical(cosine, 2.0 * float::safe_sqrt(u.x * (1.0 - u.x)), u.y)
}

/// Density (sr⁻¹) of [`uniform_sphere`].
#[inline]
#[must_use]
pub fn uniform_sphere_pdf() -> f32 {
    INV_FOUR_PI
}

/// A direction in the upper hemisphere with density proportional to its cosine.
#[inline]
#[must_use]
pub fn cosine_hemisphere(u: Vec2) -> Vec3 {
    spherical(float::safe_sqrt(1.0 - u.x), float::sqrt(u.x), u.y)
}

/// Density (sr⁻¹) of [`cosine_hemisphere`].
#[inline]
#[must_use]
pub fn cosine_hemisphere_pdf(cosine: f32) -> f32 {
    cosine.max(0.0) / PI
}

/// A direction in the upper hemisphere with density proportional to `cosⁿ`.
#[inline]
#[must_use]
pub fn cosine_power(u: Vec2, exponent: f32) -> Vec3 {
    let cosine = float::powf(1.0 - u.x, 1.0 / (exponent + 1.0));
    spherical(cosine, float::safe_sqrt((1.0 - cosine) * (1.0 + cosine)), u.y)
}

/// Density (sr⁻¹) of [`cosine_power`].
#[inline]
#[must_use]
pub fn cosine_power_pdf(cosine: f32, exponent: f32) -> f32 {
    if cosine <= 0.0 { 0.0 } else { (exponent + 1.0) / (2.0 * PI) * float::powf(cosine, exponent) }
}

/// A direction uniform within a cone around +z; `one_minus_cos` is `1 − cos` of its half angle,
/// which narrow cones know without cancellation.
#[inline]
#[must_use]
pub fn uniform_cone(u: Vec2, one_minus_cos: f32) -> Vec3 {
    let below = u.x * one_minus_cos;
    spherical(1.0 - below, float::safe_sqrt(below * (2.0 - below)), u.y)
}

/// Density (sr⁻¹) of [`uniform_cone`] inside the cone.
#[inline]
#[must_use]
pub fn uniform_cone_pdf(one_minus_cos: f32) -> f32 {
    1.0 / (2.0 * PI * one_minus_cos)
}

/// Barycentric coordinates `(b₁, b₂)` of a uniform point in a triangle, without a fold
/// (Heitz 2019); area density 1 / area.
#[inline]
#[must_use]
pub fn uniform_triangle(u: Vec2) -> Vec2 {
    if u.y > u.x {
        let x = u.x * 0.5;
        Vec2::new(x, u.y - x)
    } else {
        let y = u.y * 0.5;
        Vec2::new(u.x - y, y)
    }
}
