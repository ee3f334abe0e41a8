//! Draine's phase function (Draine 2003) and the fit to fog and clouds built from it
//! (Jendersie and d'Eon 2023, "An Approximate Mie Scattering Function for Fog and Cloud
//! Rendering"): sheet § 1.3.

use super::henyey_greenstein::{self, denominator};
use super::{CosineSample, Deflection};
use crate::math::float;

/// `1 + α(1 + 2g²)/3`: what normalises the factor `1 + α cos² θ`.
#[inline]
fn norm(g: f32, alpha: f32) -> f32 {
    1.0 + alpha * (1.0 + 2.0 * g * g) / 3.0
}

/// Draine phase function (sr⁻¹); `g` in (−1, 1), `alpha` ≥ 0.
///
/// ```text
/// p(cos θ) = HG(cos θ; g) (1 + α cos² θ) / (1 + α (1 + 2g²)/3)
/// ```
///
/// `alpha = 0` is Henyey–Greenstein; `g = 0, alpha = 1` is Rayleigh.
///
/// ```
/// # use fogbow::phase::{draine, rayleigh, Deflection};
/// let cos = Deflection::from_cos(0.3);
/// assert!((draine::value(cos, 0.0, 1.0) - rayleigh::value(cos)).abs() < 1e-7);
/// ```
#[inline]
#[must_use]
pub fn value(deflection: Deflection, g: f32, alpha: f32) -> f32 {
    let c = deflection.cos;
    henyey_greenstein::value(deflection, g) * (1.0 + alpha * c * c) / norm(g, alpha)
}

/// `dp / d cos θ = p (3g/D + 2αc/(1 + αc²))` (sr⁻¹).
///
/// ```
/// # use fogbow::phase::{draine, rayleigh, Deflection};
/// let sideways = Deflection::from_cos(0.3);
/// let (slope, rayleigh) = (draine::derivative(sideways, 0.0, 1.0), rayleigh::derivative(sideways));
/// assert!((slope - rayleigh).abs() < 1e-7);   // Rayleigh where g = 0 and α = 1
/// ```
#[inline]
#[must_use]
pub fn derivative(deflection: Deflection, g: f32, alpha: f32) -> f32 {
    let c = deflection.cos;
    let slope = 3.0 * g / denominator(deflection, g) + 2.0 * alpha * c / (1.0 + alpha * c * c);
    value(deflection, g, alpha) * slope
}

/// `d²p / d(cos θ)² = p (15g²/D² + (12αgc/D + 2α)/(1 + αc²))` (sr⁻¹).
///
/// ```
/// # use fogbow::phase::{draine, henyey_greenstein, Deflection};
/// let sideways = Deflection::from_cos(0.3);
/// let draine = draine::second_derivative(sideways, 0.5, 0.0);
/// assert!((draine - henyey_greenstein::second_derivative(sideways, 0.5)).abs() < 1e-6);   // Henyey–Greenstein where α = 0
/// ```
#[inline]
#[must_use]
pub fn second_derivative(deflection: Deflection, g: f32, alpha: f32) -> f32 {
    let c = deflection.cos;
    let slope = g / denominator(deflection, g);
    let factor = alpha * (2.0 + 12.0 * slope * c) / (1.0 + alpha * c * c);
    value(deflection, g, alpha) * (15.0 * slope * slope + factor)
}

/// Share of the cumulative distribution below the cosine `c` (`f64`: its terms cancel).
///
/// With `s = √D`, `c = (1 + g² − s²)/(2g)`, the integral of `HG·(1 + αc²)` over the azimuth is
/// elementary in `s`.
fn cumulative(c: f64, g: f64, alpha: f64) -> f64 {
    let norm = 1.0 + alpha * (1.0 + 2.0 * g * g) / 3.0;
    if g.abs() < 1e-3 {
        // Series to second order in g: p ∝ (1 + 3gc + g²(15c² − 3)/2 − g²)(1 + αc²).
        let primitive = |c: f64| {
            let even = 1.0 - 2.5 * g * g;
            even * c
                + 1.5 * g * c * c
                + (7.5 * g * g + alpha * even) * c.powi3() / 3.0
                + 0.75 * alpha * g * c.powi4()
                + 1.5 * alpha * g * g * c.powi5()
        };
        return (primitive(c) - primitive(-1.0)) / (2.0 * norm);
    }
    let q = 1.0 + g * g;
    // ∫ (1−g²)/2 D^{−3/2}(1+αc²) dc with dc = −s ds/g: −(1−g²)/(2g) ∫ s⁻² (1 + α(q−s²)²/(4g²)) ds.
    let primitive = |s: f64| -1.0 / s + alpha / (4.0 * g * g) * (-q * q / s - 2.0 * q * s + s * s * s / 3.0);
    let s = libm::sqrt((q - 2.0 * g * c).max(0.0));
    let start = 1.0 + g; // √D at c = −1
    (1.0 - g * g) / (2.0 * g) * (primitive(start) - primitive(s)) / norm
}

trait Powers {
    fn powi3(self) -> f64;
    fn powi4(self) -> f64;
    fn powi5(self) -> f64;
}
impl Powers for f64 {
    fn powi3(self) -> f64 {
        self * self * self
    }
    fn powi4(self) -> f64 {
        self.powi3() * self
    }
    fn powi5(self) -> f64 {
        self.powi4() * self
    }
}

/// Draws a cosine with density [`value`] from the uniform number `u`; `u = 0` gives −1.
///
/// Safeguarded Newton iteration on the closed-form distribution; at most 60 bisections, about 6
/// steps in practice.
///
/// ```
/// # use fogbow::phase::draine;
/// let cosines = (0..1000).map(|i| draine::sample((i as f32 + 0.5) / 1000.0, 0.5, 2.0).deflection.cos);
/// let mean = cosines.sum::<f32>() / 1000.0;
/// assert!((mean - draine::moment(0.5, 2.0, 1)).abs() < 1e-4);   // the mean cosine is the first moment
/// ```
#[must_use]
pub fn sample(u: f32, g: f32, alpha: f32) -> CosineSample {
    let (target, g64, alpha64) = (f64::from(u), f64::from(g), f64::from(alpha));
    let norm = 1.0 + alpha64 * (1.0 + 2.0 * g64 * g64) / 3.0;
    let density = |c: f64| {
        let d = (1.0 + g64 * g64 - 2.0 * g64 * c).max(1e-300);
        0.5 * (1.0 - g64 * g64) / (d * libm::sqrt(d)) * (1.0 + alpha64 * c * c) / norm
    };
    let (mut low, mut high) = (-1.0_f64, 1.0_f64);
    // The Henyey–Greenstein quantile is a good start: exact for α = 0.
    let mut c = f64::from(henyey_greenstein::sample(u, g).deflection.cos);
    for _ in 0..60 {
        let error = cumulative(c, g64, alpha64) - target;
        if error > 0.0 {
            high = c;
        } else {
            low = c;
        }
        let next = c - error / density(c);
        let next = if next > low && next < high { next } else { 0.5 * (low + high) };
        let step = (next - c).abs();
        c = next;
        if step < 1e-12 {
            break;
        }
    }
    let deflection = Deflection { cos: c as f32, one_minus_cos: (1.0 - c) as f32, one_plus_cos: (1.0 + c) as f32 };
    CosineSample { deflection, pdf: value(deflection, g, alpha) }
}

/// Legendre moment (sheet § 1.3): `f_l = (gˡ + α m_l) / (1 + α(1 + 2g²)/3)`.
///
/// ```
/// # use fogbow::phase::draine::moment;
/// assert!((moment(0.7, 3.0, 0) - 1.0).abs() < 1e-6);   // normalised
/// assert!((moment(0.0, 1.0, 2) - 0.1).abs() < 1e-7);   // Rayleigh
/// ```
#[must_use]
pub fn moment(g: f32, alpha: f32, degree: usize) -> f32 {
    let power = |n: i32| if n < 0 { 0.0 } else { henyey_greenstein::moment(g, n as usize) };
    let l = degree as f32;
    let n = degree as i32;
    let up = (l + 1.0) * (l + 2.0) / ((2.0 * l + 1.0) * (2.0 * l + 3.0)) * power(n + 2);
    let same = (l + 1.0) * (l + 1.0) / ((2.0 * l + 1.0) * (2.0 * l + 3.0))
        + if degree == 0 { 0.0 } else { l * l / ((2.0 * l + 1.0) * (2.0 * l - 1.0)) };
    let down = if degree < 2 { 0.0 } else { l * (l - 1.0) / ((2.0 * l + 1.0) * (2.0 * l - 1.0)) * power(n - 2) };
    (power(n) + alpha * (up + same * power(n) + down)) / norm(g, alpha)
}

/// Parameters of the fit for water droplets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Droplets {
    /// Mean cosine of the Henyey–Greenstein part.
    pub g_hg: f32,
    /// `g` of the Draine part.
    pub g_draine: f32,
    /// `α` of the Draine part.
    pub alpha: f32,
    /// Share of the Draine part.
    pub weight_draine: f32,
}

/// The fit of Jendersie and d'Eon 2023 for droplets of `diameter` (µm), valid in [5, 50].
///
/// ```
/// # use fogbow::phase::draine::droplets;
/// let fog = droplets(20.0);
/// assert!((fog.g_hg - 0.99461).abs() < 1e-5 && (fog.weight_draine - 0.49816).abs() < 1e-5);
/// ```
#[must_use]
pub fn droplets(diameter: f32) -> Droplets {
    let d = diameter;
    Droplets {
        g_hg: float::exp(-0.099_056_7 / (d - 1.671_54)),
        g_draine: float::exp(-2.206_79 / (d + 3.910_29) - 0.428_934),
        alpha: float::exp(3.624_89 - 8.292_88 / (d + 5.528_25)),
        weight_draine: float::exp(-0.599_085 / (d - 0.641_583) - 0.665_888),
    }
}
