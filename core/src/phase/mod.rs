//! Layer 2: phase functions, the angular law of scattering in a medium.
//!
//! `∫ p(cos θ) dω = 1` over the sphere; `cos θ` is the cosine of the deflection: +1 is straight on.
//!
//! | file | holds |
//! |---|---|
//! | [`henyey_greenstein`](mod@henyey_greenstein) | value, derivative, sampling (Jarosz et al. 2008, Eq. 41, 44) |
//! | [`schlick`](mod@schlick) | the same, forward for `k > 0` (Eq. 42, 45) |
//! | [`rayleigh`](mod@rayleigh) | molecules |
//! | [`draine`](mod@draine) | Draine 2003, and the fog and cloud fit of Jendersie and d'Eon 2023 |
//! | `lobe` | [`Lobe`]: the closed set of simple phase functions |
//! | `mixture` | [`Phase`]: one lobe or a coloured mixture of several, what a medium carries |
//! | `words` | lobes as plain numbers, there and back |

pub mod draine;
pub mod henyey_greenstein;
mod lobe;
mod mixture;
pub mod rayleigh;
pub mod schlick;
mod words;

use glam::Vec3;

pub use henyey_greenstein::henyey_greenstein;
pub use lobe::{Lobe, LobeError, MAX_ANISOTROPY};
pub use mixture::{MAX_LOBES, Phase, PhaseSample, TooManyLobes};
pub use schlick::schlick;
pub use words::LOBE_WORDS;

/// The deflection of light at a scattering event: `cos θ` with its distances from both poles,
/// which peaked phase functions need without cancellation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deflection {
    /// `cos θ`, in [−1, 1]; +1 is straight on.
    pub cos: f32,
    /// `1 − cos θ`, in [0, 2].
    pub one_minus_cos: f32,
    /// `1 + cos θ`, in [0, 2].
    pub one_plus_cos: f32,
}

impl Deflection {
    /// From the cosine alone; a cosine outside [−1, 1] is clamped.
    ///
    /// Near ±1 the other two fields carry the cosine's rounding; [`deflection`] does better.
    ///
    /// ```
    /// # use fogbow::phase::Deflection;
    /// let turned = Deflection::from_cos(0.25);
    /// assert_eq!((turned.one_minus_cos, turned.one_plus_cos), (0.75, 1.25));
    /// assert_eq!(Deflection::from_cos(1.000_001).cos, 1.0);
    /// ```
    #[inline]
    #[must_use]
    pub fn from_cos(cos: f32) -> Self {
        let cos = cos.clamp(-1.0, 1.0);
        Self { cos, one_minus_cos: 1.0 - cos, one_plus_cos: 1.0 + cos }
    }
}

/// The deflection between light that comes from `to_light` and leaves towards `to_eye` (unit
/// vectors that leave the point): `cos θ = −to_light · to_eye`.
///
/// ```text
/// 1 − cos θ = |to_light + to_eye|² / 2,   1 + cos θ = |to_light − to_eye|² / 2
/// ```
///
/// ```
/// # use fogbow::{math::Vec3, phase::deflection};
/// assert_eq!(deflection(Vec3::Z, Vec3::NEG_Z).cos, 1.0);   // straight on
/// ```
#[inline]
#[must_use]
pub fn deflection(to_light: Vec3, to_eye: Vec3) -> Deflection {
    let one_minus_cos = ((to_light + to_eye).length_squared() * 0.5).min(2.0);
    let one_plus_cos = ((to_light - to_eye).length_squared() * 0.5).min(2.0);
    Deflection { cos: (0.5 * (one_plus_cos - one_minus_cos)).clamp(-1.0, 1.0), one_minus_cos, one_plus_cos }
}

/// Gradient (m⁻¹) of the deflection's cosine when the point moves and the light, `distance` away,
/// stays.
///
/// ```text
/// ∇ cos θ = (ω − cos θ u) / r,   ω = to_eye, u = −to_light
/// ```
///
/// Jarosz et al. 2008 print its negative in the appendix (sheet § 1.3).
///
/// ```
/// # use fogbow::{math::Vec3, phase::{deflection, deflection_gradient}};
/// let (lamp, to_eye) = (2.0 * Vec3::Z, Vec3::X);
/// let cos = |point: Vec3| deflection((lamp - point).normalize(), to_eye).cos;
/// let gradient = deflection_gradient(Vec3::Z, to_eye, 2.0);
/// assert_eq!(gradient, Vec3::X / 2.0);
/// assert!(((cos(0.01 * Vec3::X) - cos(Vec3::ZERO)) / 0.01 - gradient.x).abs() < 1e-4);
/// ```
#[inline]
#[must_use]
pub fn deflection_gradient(to_light: Vec3, to_eye: Vec3, distance: f32) -> Vec3 {
    (to_eye - to_light * to_light.dot(to_eye)) / distance
}

/// A cosine drawn from a phase function's law, with the sine that goes with it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CosineSample {
    /// Where it points.
    pub deflection: Deflection,
    /// Density over solid angle (sr⁻¹).
    pub pdf: f32,
}

impl CosineSample {
    /// From both distances to the poles, the smaller of which is trusted.
    #[inline]
    #[must_use]
    pub(crate) fn from_poles(one_minus_cos: f32, one_plus_cos: f32, pdf: f32) -> Self {
        let (one_minus_cos, one_plus_cos) = (one_minus_cos.clamp(0.0, 2.0), one_plus_cos.clamp(0.0, 2.0));
        let cos = if one_minus_cos < one_plus_cos { 1.0 - one_minus_cos } else { one_plus_cos - 1.0 };
        Self { deflection: Deflection { cos, one_minus_cos, one_plus_cos }, pdf }
    }

    /// `sin θ`.
    ///
    /// ```
    /// # use fogbow::phase::Lobe;
    /// let sample = Lobe::HenyeyGreenstein { g: 0.9 }.sample(0.7);
    /// assert!((sample.sin().powi(2) + sample.deflection.cos.powi(2) - 1.0).abs() < 1e-6);
    /// ```
    #[inline]
    #[must_use]
    pub fn sin(&self) -> f32 {
        crate::math::float::sqrt(self.deflection.one_minus_cos * self.deflection.one_plus_cos)
    }
}
