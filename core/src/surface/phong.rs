//! Phong lobe in its energy-normalised form (Lafortune and Willems 1994):
//! `f = (n + 2)/(2π) cosⁿ α`, `α` the angle to the mirror direction.

use glam::{Vec2, Vec3};

use super::specular::mirrored;
use crate::math::{Frame, float, float::PI};
use crate::sampling::warp::{cosine_power, cosine_power_pdf};
use crate::spectrum::Spectrum;

/// Value (sr⁻¹) of the lobe with specular albedo 1 at normal incidence.
///
/// ```
/// # use fogbow::{math::{Vec3, float::PI, quadrature::integrate}, surface::phong};
/// // Seen from above all light is reflected: ∫ f cos dω = 1.
/// let towards = |cos: f32| Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
/// let reflected = 2.0 * PI * integrate(0.0, 1.0, |cos| cos * phong::value(Vec3::Z, Vec3::Z, towards(cos), 6.0));
/// assert!((reflected - 1.0).abs() < 1e-5);
/// ```
#[inline]
#[must_use]
pub fn value(normal: Vec3, to_eye: Vec3, to_light: Vec3, exponent: f32) -> f32 {
    let cosine = mirrored(to_eye, normal).dot(to_light).clamp(0.0, 1.0);
    if cosine <= 0.0 { 0.0 } else { (exponent + 2.0) / (2.0 * PI) * float::powf(cosine, exponent) }
}

/// Density (sr⁻¹) of [`sample`].
///
/// ```
/// # use fogbow::{math::{Vec3, float::PI}, surface::phong};
/// let (to_eye, mirrored) = (Vec3::new(0.6, 0.0, 0.8), Vec3::new(-0.6, 0.0, 0.8));
/// assert!((phong::pdf(Vec3::Z, to_eye, mirrored, 20.0) - 21.0 / (2.0 * PI)).abs() < 1e-4);   // (n + 1)/2π at its top
/// ```
#[inline]
#[must_use]
pub fn pdf(normal: Vec3, to_eye: Vec3, to_light: Vec3, exponent: f32) -> f32 {
    cosine_power_pdf(mirrored(to_eye, normal).dot(to_light).min(1.0), exponent)
}

/// Draws a direction in proportion to `cosⁿ` around the mirror direction; it may point below the
/// surface, where nothing is reflected.
///
/// ```
/// # use fogbow::{math::{Vec2, Vec3}, surface::phong};
/// let (to_eye, mirrored) = (Vec3::new(0.6, 0.0, 0.8), Vec3::new(-0.6, 0.0, 0.8));
/// let to_light = phong::sample(Vec3::Z, to_eye, 1e6, Vec2::new(0.3, 0.6));
/// assert!((to_light - mirrored).length() < 1e-2);   // large exponents are nearly a mirror
/// ```
#[inline]
#[must_use]
pub fn sample(normal: Vec3, to_eye: Vec3, exponent: f32, u: Vec2) -> Vec3 {
    Frame::around(mirrored(to_eye, normal)).to_world(cosine_power(u, exponent)).normalize()
}

/// Probability of sampling the lobe rather than the base: its share of the albedo.
///
/// ```
/// # use fogbow::{spectrum::Spectrum, surface::phong::lobe_share};
/// assert!((lobe_share(Spectrum::splat(0.3), Spectrum::splat(0.1)) - 0.25).abs() < 1e-6);
/// assert_eq!(lobe_share(Spectrum::ZERO, Spectrum::ZERO), 0.0);
/// ```
#[inline]
#[must_use]
pub fn lobe_share(diffuse: Spectrum, specular: Spectrum) -> f32 {
    let (d, s) = (diffuse.mean(), specular.mean());
    if s <= 0.0 { 0.0 } else { s / (d + s) }
}
