//! Rayleigh scattering by molecules: sheet § 1.3.

use super::{CosineSample, Deflection};
use crate::math::float::{self, PI};

/// Rayleigh phase function (sr⁻¹).
///
/// ```text
/// p(cos θ) = 3 (1 + cos² θ) / (16π)
/// ```
///
/// ```
/// # use fogbow::phase::{rayleigh, Deflection};
/// let sideways = rayleigh::value(Deflection::from_cos(0.0));
/// assert!((rayleigh::value(Deflection::from_cos(1.0)) / sideways - 2.0).abs() < 1e-6);
/// ```
#[inline]
#[must_use]
pub fn value(deflection: Deflection) -> f32 {
    3.0 / (16.0 * PI) * (1.0 + deflection.cos * deflection.cos)
}

/// `dp / d cos θ = 3 cos θ / (8π)` (sr⁻¹).
///
/// ```
/// # use fogbow::phase::{rayleigh, Deflection};
/// let [before, at, after] = [0.3, 0.4, 0.5].map(Deflection::from_cos);
/// let difference = (rayleigh::value(after) - rayleigh::value(before)) / 0.2;   // exact for a parabola
/// assert!((rayleigh::derivative(at) - difference).abs() < 1e-6);
/// ```
#[inline]
#[must_use]
pub fn derivative(deflection: Deflection) -> f32 {
    3.0 / (8.0 * PI) * deflection.cos
}

/// `d²p / d(cos θ)² = 3 / (8π)` (sr⁻¹).
pub const SECOND_DERIVATIVE: f32 = 3.0 / (8.0 * PI);

/// Draws a cosine with density [`value`] from the uniform number `u`; `u = 0` gives −1.
///
/// Inverts `c³ + 3c = 4(2u − 1)` by Cardano's formula, in the form that does not cancel.
///
/// ```
/// # use fogbow::phase::rayleigh;
/// let cosines = (0..1000).map(|i| rayleigh::sample((i as f32 + 0.5) / 1000.0).deflection.cos);
/// let square = cosines.map(|cos| cos * cos).sum::<f32>() / 1000.0;
/// assert!((square - 0.4).abs() < 1e-4);   // ∫ p cos² dω = 2/5; 1/3 if it were isotropic
/// ```
#[inline]
#[must_use]
pub fn sample(u: f32) -> CosineSample {
    let half = 2.0 * (2.0 * u - 1.0).abs();
    let root = float::cbrt(half + float::sqrt(half * half + 1.0));
    let magnitude = (root - 1.0 / root).min(1.0);
    let deflection = Deflection::from_cos(magnitude.copysign(u - 0.5));
    CosineSample { deflection, pdf: value(deflection) }
}

/// Legendre moments `f_0 = 1`, `f_2 = 1/10`, all others 0.
///
/// ```
/// # use fogbow::phase::rayleigh::moment;
/// assert_eq!([0, 1, 2, 3].map(moment), [1.0, 0.0, 0.1, 0.0]);
/// ```
#[must_use]
pub fn moment(degree: usize) -> f32 {
    match degree {
        0 => 1.0,
        2 => 0.1,
        _ => 0.0,
    }
}
