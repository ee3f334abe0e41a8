//! Phong lobe in its energy-normalised form (Lafortune and Willems 1994):
//! `f = (n + 2)/(2π) cosⁿ α`, `α` the angle to the mirror direction.

use glam::{Vec2, Vec3};

use super::specular::mirrored;
use crate::math::{Frame, float, float::PI};
use crate::sampling::warp::{cosine_power, cosine_power_pdf};
use crate::spectrum::Spectrum;

/// Value (sr⁻¹) of the lobe with specular albedo 1 at normal incidence.
#[inline]
#[must_use]
pub fn value(normal: Vec3, to_eye: Vec3, to_light: Vec3, exponent: f32) -> f32 {
    let cosine = mirrored(to_eye, normal).dot(to_light).clamp(0.0, 1.0);
    if cosine <= 0.0 { 0.0 } else { (exponent + 2.0) / (2.0 * PI) * float::powf(cosine, exponent) }
}

/// Density (sr⁻¹) of [`sample`].
#[inline]
#[must_use]
pub fn pdf(normal: Vec3, to_eye: Vec3, to_light: Vec3, exponent: f32) -> f32 {
    cosine_power_pdf(mirrored(to_eye, normal).dot(to_light).min(1.0), exponent)
}

/// Draws a direction in proportion to `cosⁿ` around the mirror direction; it may point below the
/// surface, where nothing is reflected.
#[inline]
#[must_use]
pub fn sample(normal: Vec3, to_eye: Vec3, exponent: f32, u: Vec2) -> Vec3 {
    Frame::around(mirrored(to_eye, normal)).to_world(cosine_power(u, exponent)).normalize()
}

/// Probability of sampling the lobe rather than the base: its share of the albedo.
#[inline]
#[must_use]
pub fn lobe_share(diffuse: Spectrum, specular: Spectrum) -> f32 {
    let (d, s) = (diffuse.mean(), specular.mean());
    if s <= 0.0 { 0.0 } else { s / (d + s) }
}
