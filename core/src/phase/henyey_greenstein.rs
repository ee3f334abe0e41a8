//! Henyey and Greenstein 1941; Jarosz et al. 2008, Eq. 41 and 44 (whose ∇p has the wrong sign:
//! sheet § 1.3).

use super::{CosineSample, Deflection};
use crate::math::float::{self, PI};

/// Henyey–Greenstein phase function (sr⁻¹).
///
/// `cos_theta` is the cosine of the deflection angle (1 is straight on);
/// `g`, in (−1, 1), is the mean of that cosine.
///
/// ```text
/// p(cos θ) = (1 − g²) / (4π (1 + g² − 2 g cos θ)^(3/2))
/// ```
///
/// Integrates to 1 over the sphere. Reference: Henyey and Greenstein 1941.
///
/// ```
/// # use fogbow::phase::henyey_greenstein;
/// let forward = henyey_greenstein(1.0, 0.5);
/// let backward = henyey_greenstein(-1.0, 0.5);
/// assert!((forward / backward - 27.0).abs() < 1e-4);   // ((1 + g) / (1 − g))³
/// ```
#[inline]
#[must_use]
pub fn henyey_greenstein(cos_theta: f32, g: f32) -> f32 {
    value(Deflection::from_cos(cos_theta), g)
}

/// `D = 1 + g² − 2 g cos θ`, without cancellation near the peak.
#[inline]
pub(super) fn denominator(deflection: Deflection, g: f32) -> f32 {
    let to_peak = if g > 0.0 { deflection.one_minus_cos } else { deflection.one_plus_cos };
    let rest = 1.0 - g.abs();
    rest * rest + 2.0 * g.abs() * to_peak
}

/// [`henyey_greenstein`] for a deflection that knows its distance from the peak.
#[inline]
#[must_use]
pub fn value(deflection: Deflection, g: f32) -> f32 {
    debug_assert!(g.abs() < 1.0, "g = {g} is outside (-1, 1)");
    let d = denominator(deflection, g);
    (1.0 - g) * (1.0 + g) / (4.0 * PI * d * float::sqrt(d))
}

/// `dp / d cos θ = 3 g p / D` (sr⁻¹).
#[inline]
#[must_use]
pub fn derivative(deflection: Deflection, g: f32) -> f32 {
    3.0 * g * value(deflection, g) / denominator(deflection, g)
}

/// `d²p / d(cos θ)² = 15 g² p / D²` (sr⁻¹).
#[inline]
#[must_use]
pub fn second_derivative(deflection: Deflection, g: f32) -> f32 {
    let slope = g / denominator(deflection, g);
    15.0 * slope * slope * value(deflection, g)
}

/// Draws a cosine with density [`value`] from the uniform number `u`; `u = 0` gives −1.
///
/// ```text
/// e = 1 − g + 2 g u,   1 + c = 2(1+g)² u (1 − g(1−u)) / e²,   1 − c = 2(1−g)² (1−u)(1 + g u) / e²
/// ```
///
/// No division by `g`: exact for `g = 0` and near ±1 (sheet § 1.3).
#[inline]
#[must_use]
pub fn sample(u: f32, g: f32) -> CosineSample {
    let v = 1.0 - u;
    let (below, above) = (1.0 - g, 1.0 + g);
    // e, 1 − g(1−u) and 1 + g u, none of which may cancel: next to ±1 a rounded 1 − u would show.
    let (e, near, far) = if g >= 0.0 {
        (below + 2.0 * g * u, below + g * u, 1.0 + g * u)
    } else {
        (above - 2.0 * g * v, 1.0 - g * v, above - g * v)
    };
    let (below_e, above_e) = (below / e, above / e);
    let inverse = 1.0 / (below * above);
    CosineSample::from_poles(
        2.0 * below_e * below_e * v * far,
        2.0 * above_e * above_e * u * near,
        e * inverse * e * inverse * e / (4.0 * PI),
    )
}

/// Legendre moment `f_l = gˡ`.
#[must_use]
pub fn moment(g: f32, degree: usize) -> f32 {
    (0..degree).fold(1.0, |power, _| power * g)
}
