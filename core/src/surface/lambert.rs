//! Ideal diffuse reflection (Lambert 1760): `f = ρ/π`.

use glam::{Vec2, Vec3};

use super::SurfaceSample;
use crate::math::{Frame, float::PI};
use crate::sampling::warp::{cosine_hemisphere, cosine_hemisphere_pdf};
use crate::spectrum::Spectrum;

/// `ρ/π` (sr⁻¹).
#[inline]
#[must_use]
pub fn value(reflectance: Spectrum) -> Spectrum {
    reflectance * (1.0 / PI)
}

/// Density (sr⁻¹) of [`sample`]: `cos/π`.
#[inline]
#[must_use]
pub fn pdf(cosine: f32) -> f32 {
    cosine_hemisphere_pdf(cosine)
}

/// Draws a direction in proportion to its cosine; `None` for a black surface.
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
