//! Ideal diffuse reflection (Lambert 1760): `f = ρ/π`.

use glam::{Vec2, Vec3};

use super::SurfaceSample;
use crate::math::{Frame, float::PI};
use crate::sampling::warp::{cosine_hemisphere, cosine_hemisphere_pdf};
use crate::spectrum::Spectrum;

/// `ρ/π` (sr⁻¹).
///
/// ```
/// # use fogbow::{math::float::PI, spectrum::Spectrum, surface::lambert};
/// let value = lambert::value(Spectrum::splat(0.5))[0];
/// assert!((value * PI - 0.5).abs() < 1e-6);   // ∫ cos dω = π: half of the light is reflected
/// ```
#[inline]
#[must_use]
pub fn value(reflectance: Spectrum) -> Spectrum {
    reflectance * (1.0 / PI)
}

/// Density (sr⁻¹) of [`sample`]: `cos/π`.
///
/// ```
/// # use fogbow::{math::float::PI, math::quadrature::integrate, surface::lambert};
/// assert!((2.0 * PI * integrate(0.0, 1.0, lambert::pdf) - 1.0).abs() < 1e-6);
/// ```
#[inline]
#[must_use]
pub fn pdf(cosine: f32) -> f32 {
    cosine_hemisphere_pdf(cosine)
}

/// Draws a direction in proportion to its cosine; `None` for a black surface.
///
/// ```
/// # use fogbow::{math::{Vec2, Vec3}, spectrum::Spectrum, surface::lambert};
/// let grey = Spectrum::splat(0.5);
/// let sample = lambert::sample(Vec3::Y, grey, Vec2::new(0.3, 0.6)).unwrap();
/// assert_eq!(sample.weight, grey);   // f cos/pdf: no noise but that of directions
/// assert!((sample.pdf - lambert::pdf(sample.to_light.y)).abs() < 1e-6);
/// ```
#[inline]
#[must_use]
pub fn sample(normal: Vec3, reflectance: Spectrum, u: Vec2) -> Option<SurfaceSample> {
    let local = cosine_hemisphere(u);
    if reflectance.is_black() || local.z <= 0.0 {
        return None;
    }
    let to_light = Frame::around(normal).to_world(local).normalize();
    Some(SurfaceSample { to_light, weight: reflectance, pdf: cosine_hemisphere_pdf(local.z) })
}
