//! Schlick's approximation (Blasi et al. 1993); Jarosz et al. 2008, Eq. 42 and 45, with the sign
//! turned so that `k > 0` is forward (sheet § 1.3).

use super::{CosineSample, Deflection};
use crate::math::float::{self, PI};

/// Schlick phase function (sr⁻¹), forward for `k > 0`; `k` in (−1, 1).
///
/// ```text
/// p(cos θ) = (1 − k²) / (4π (1 − k cos θ)²)
/// ```
///
/// Integrates to 1 over the sphere. `k = 1.55 g − 0.55 g³` comes near Henyey–Greenstein.
///
/// ```
/// # use fogbow::phase::schlick;
/// assert!((schlick(1.0, 0.5) / schlick(-1.0, 0.5) - 9.0).abs() < 1e-5);   // ((1 + k) / (1 − k))²
/// ```
#[inline]
#[must_use]
pub fn schlick(cos_theta: f32, k: f32) -> f32 {
    value(Deflection::from_cos(cos_theta), k)
}

#[inline]
fn denominator(deflection: Deflection, k: f32) -> f32 {
    let to_peak = if k > 0.0 { deflection.one_minus_cos } else { deflection.one_plus_cos };
    1.0 - k.abs() + k.abs() * to_peak
}

/// [`schlick`] for a deflection that knows its distance from the peak.
///
/// ```
/// # use fogbow::{math::float::PI, phase::schlick::value, phase::Deflection};
/// let peak = Deflection { cos: 1.0, one_minus_cos: 0.0, one_plus_cos: 2.0 };
/// let k = 0.5;
/// assert!((value(peak, k) - (1.0 + k) / (4.0 * PI * (1.0 - k))).abs() < 1e-6);
/// ```
#[inline]
#[must_use]
pub fn value(deflection: Deflection, k: f32) -> f32 {
    debug_assert!(k.abs() < 1.0, "k = {k} is outside (-1, 1)");
    let d = denominator(deflection, k);
    (1.0 - k) * (1.0 + k) / (4.0 * PI * d * d)
}

/// `dp / d cos θ = 2 k p / D` (sr⁻¹).
///
/// ```
/// # use fogbow::phase::{schlick, schlick::derivative, Deflection};
/// let difference = (schlick(0.01, 0.5) - schlick(-0.01, 0.5)) / 0.02;
/// assert!((derivative(Deflection::from_cos(0.0), 0.5) - difference).abs() < 1e-4);
/// ```
#[inline]
#[must_use]
pub fn derivative(deflection: Deflection, k: f32) -> f32 {
    2.0 * k * value(deflection, k) / denominator(deflection, k)
}

/// `d²p / d(cos θ)² = 6 k² p / D²` (sr⁻¹).
///
/// ```
/// # use fogbow::phase::{schlick::{derivative, second_derivative}, Deflection};
/// let [before, at, after] = [-0.01, 0.0, 0.01].map(Deflection::from_cos);
/// let difference = (derivative(after, 0.5) - derivative(before, 0.5)) / 0.02;
/// assert!((second_derivative(at, 0.5) - difference).abs() < 1e-4);
/// ```
#[inline]
#[must_use]
pub fn second_derivative(deflection: Deflection, k: f32) -> f32 {
    let slope = k / denominator(deflection, k);
    6.0 * slope * slope * value(deflection, k)
}

/// Draws a cosine with density [`value`] from the uniform number `u`; `u = 0` gives −1.
///
/// ```text
/// e = 1 − k + 2 k u,   1 + c = 2(1+k) u / e,   1 − c = 2(1−k)(1−u) / e
/// ```
///
/// ```
/// # use fogbow::phase::schlick::{mean_cosine, sample};
/// let mean = (0..1000).map(|i| sample((i as f32 + 0.5) / 1000.0, 0.5).deflection.cos).sum::<f32>() / 1000.0;
/// assert!((mean - mean_cosine(0.5)).abs() < 1e-4);
/// assert_eq!(sample(0.5, 0.0).deflection.cos, 0.0);   // k = 0 is isotropic
/// ```
#[inline]
#[must_use]
pub fn sample(u: f32, k: f32) -> CosineSample {
    let e = if k >= 0.0 { (1.0 - k) + 2.0 * k * u } else { (1.0 + k) - 2.0 * k * (1.0 - u) };
    CosineSample::from_poles(
        2.0 * (1.0 - k) * (1.0 - u) / e,
        2.0 * (1.0 + k) * u / e,
        e * e / (4.0 * PI * (1.0 - k) * (1.0 + k)),
    )
}

/// Legendre moment (sheet § 1.6): the series
///
/// ```text
/// f_l = (1−k²) Σ_{n=l,l+2,…} (n+1) kⁿ n! / ((n−l)!! (n+l+1)!!)
/// ```
///
/// converges for every |k| < 1, more slowly near 1; its closed form cancels for small `k`. The sum
/// stops where the rest no longer shows in an `f32`. Accumulated in `f64`.
///
/// ```
/// # use fogbow::phase::schlick::{mean_cosine, moment};
/// assert_eq!(moment(0.7, 0), 1.0);
/// assert!((moment(0.7, 1) - mean_cosine(0.7)).abs() < 1e-6);   // a sum and a closed form
/// ```
#[must_use]
pub fn moment(k: f32, degree: usize) -> f32 {
    if degree == 0 {
        return 1.0;
    }
    let k = f64::from(k);
    let l = degree as f64;
    // First term, n = l: (l+1) kˡ l! / (2l+1)!!.
    let mut term = 1.0_f64;
    for i in 1..=degree {
        let i = i as f64;
        term *= k * i / (2.0 * i + 1.0);
    }
    let mut n = l;
    let mut sum = 0.0;
    for _ in 0..4_000_000 {
        let whole = (n + 1.0) * term;
        sum += whole;
        // The terms fall at least as k²; what is left is below whole·k²/(1−k²).
        if whole.abs() * k * k <= 1e-9 * sum.abs() * (1.0 - k * k) || whole == 0.0 {
            break;
        }
        // kⁿ n! / ((n−l)!! (n+l+1)!!) from n to n + 2.
        term *= k * k * (n + 1.0) * (n + 2.0) / ((n + 2.0 - l) * (n + l + 3.0));
        n += 2.0;
    }
    ((1.0 - k * k) * sum) as f32
}

/// The Schlick parameter usually matched to a Henyey–Greenstein `g`: `1.55 g − 0.55 g³`.
///
/// ```
/// # use fogbow::phase::schlick::{from_mean_cosine, mean_cosine};
/// for g in [-0.8, 0.2, 0.5, 0.9] {
///     assert!((mean_cosine(from_mean_cosine(g)) - g).abs() < 0.08);   // near, not equal
/// }
/// ```
#[must_use]
pub fn from_mean_cosine(g: f32) -> f32 {
    1.55 * g - 0.55 * g * g * g
}

/// Mean cosine of the deflection: `1/k − (1/k² − 1) atanh k`.
///
/// ```
/// # use fogbow::{math::float::PI, math::quadrature::integrate, phase::schlick, phase::schlick::mean_cosine};
/// let mean = 2.0 * PI * integrate(-1.0, 1.0, |cos| cos * schlick(cos, 0.5));
/// assert!((mean_cosine(0.5) - mean).abs() < 1e-5);
/// ```
#[must_use]
pub fn mean_cosine(k: f32) -> f32 {
    if k.abs() < 0.5 {
        return moment(k, 1);
    }
    1.0 / k - (1.0 / (k * k) - 1.0) * float::atanh(k)
}
