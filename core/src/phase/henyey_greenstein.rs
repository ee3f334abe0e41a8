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
///
/// ```
/// # use fogbow::phase::{henyey_greenstein, henyey_greenstein::value, Deflection};
/// let beside = Deflection { cos: 1.0, one_minus_cos: 1e-9, one_plus_cos: 2.0 };
/// let peak = henyey_greenstein(1.0, 0.9999);
/// assert!(value(beside, 0.9999) < 0.8 * peak);   // a cosine rounded to 1 does not know that
/// ```
#[inline]
#[must_use]
pub fn value(deflection: Deflection, g: f32) -> f32 {
    debug_assert!(g.abs() < 1.0, "g = {g} is outside (-1, 1)");
    let d = denominator(deflection, g);
    (1.0 - g) * (1.0 + g) / (4.0 * PI * d * float::sqrt(d))
}

/// `dp / d cos θ = 3 g p / D` (sr⁻¹).
///
/// ```
/// # use fogbow::phase::{henyey_greenstein, henyey_greenstein::derivative, Deflection};
/// let difference = (henyey_greenstein(0.01, 0.5) - henyey_greenstein(-0.01, 0.5)) / 0.02;
/// assert!((derivative(Deflection::from_cos(0.0), 0.5) - difference).abs() < 1e-4);
/// ```
#[inline]
#[must_use]
pub fn derivative(deflection: Deflection, g: f32) -> f32 {
    3.0 * g * value(deflection, g) / denominator(deflection, g)
}

/// `d²p / d(cos θ)² = 15 g² p / D²` (sr⁻¹).
///
/// ```
/// # use fogbow::phase::henyey_greenstein::{derivative, second_derivative};
/// # use fogbow::phase::Deflection;
/// let [before, at, after] = [-0.01, 0.0, 0.01].map(Deflection::from_cos);
/// let difference = (derivative(after, 0.5) - derivative(before, 0.5)) / 0.02;
/// assert!((second_derivative(at, 0.5) - difference).abs() < 1e-4);
/// ```
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
///
/// ```
/// # use fogbow::phase::henyey_greenstein::sample;
/// let mean = (0..1000).map(|i| sample((i as f32 + 0.5) / 1000.0, 0.5).deflection.cos).sum::<f32>() / 1000.0;
/// assert!((mean - 0.5).abs() < 1e-4);   // g is the mean cosine
/// assert_eq!(sample(0.0, 0.5).deflection.cos, -1.0);
/// ```
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
///
/// ```
/// # use fogbow::{math::float::PI, math::quadrature::integrate, phase::{henyey_greenstein, henyey_greenstein::moment}};
/// let second = 2.0 * PI * integrate(-1.0, 1.0, |c| henyey_greenstein(c, 0.3) * (1.5 * c * c - 0.5));   // P₂(c)
/// assert!((moment(0.3, 2) - 0.09).abs() < 1e-7 && (second - 0.09).abs() < 1e-5);
/// ```
#[must_use]
pub fn moment(g: f32, degree: usize) -> f32 {
    (0..degree).fold(1.0, |power, _| power * g)
}
