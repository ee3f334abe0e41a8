//! The closed set of simple phase functions.

use super::{CosineSample, Deflection, draine, henyey_greenstein, rayleigh, schlick};
use crate::math::digits::Digits;
use crate::math::float::INV_FOUR_PI;

/// Largest |g| or |k| accepted: above, the peak `(1+g)/(4π(1−g)²)` leaves what `f32` can do.
pub const MAX_ANISOTROPY: f32 = 1.0 - 1.0 / 65_536.0;

/// A simple phase function.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Lobe {
    /// The same in all directions: `1/(4π)`.
    Isotropic,
    /// Henyey–Greenstein; `g` in (−1, 1), forward for `g > 0`.
    HenyeyGreenstein {
        /// Mean cosine of the deflection.
        g: f32,
    },
    /// Schlick; `k` in (−1, 1), forward for `k > 0`.
    Schlick {
        /// Elongation; `1.55 g − 0.55 g³` comes near Henyey–Greenstein.
        k: f32,
    },
    /// Rayleigh.
    Rayleigh,
    /// Draine; `g` in (−1, 1), `alpha` ≥ 0.
    Draine {
        /// As in Henyey–Greenstein.
        g: f32,
        /// Strength of the `cos² θ` factor.
        alpha: f32,
    },
}

/// A parameter outside its range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LobeError {
    /// `g` or `k` must lie in (−1, 1), with 2⁻¹⁶ to spare.
    Anisotropy(f32),
    /// `alpha` must be finite and not negative.
    Alpha(f32),
    /// A droplet's diameter (µm) must lie in [5, 50].
    Diameter(f32),
}

impl core::fmt::Display for LobeError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Anisotropy(g) => write!(f, "anisotropy {} is outside (-1, 1)", Digits(*g)),
            Self::Alpha(a) => write!(f, "alpha {} is negative or not finite", Digits(*a)),
            Self::Diameter(d) => write!(f, "droplet diameter {} µm is outside [5, 50]", Digits(*d)),
        }
    }
}

impl core::error::Error for LobeError {}

impl Lobe {
    /// Whether the parameters lie in their ranges.
    ///
    /// # Errors
    /// The parameter that does not.
    ///
    /// ```
    /// # use fogbow::phase::{Lobe, LobeError};
    /// assert!(Lobe::HenyeyGreenstein { g: 0.9 }.check().is_ok());
    /// assert_eq!(Lobe::HenyeyGreenstein { g: 1.0 }.check(), Err(LobeError::Anisotropy(1.0)));
    /// ```
    pub fn check(self) -> Result<Self, LobeError> {
        match self {
            Self::HenyeyGreenstein { g: a } | Self::Schlick { k: a } | Self::Draine { g: a, .. }
                if !(a.abs() <= MAX_ANISOTROPY) =>
            {
                Err(LobeError::Anisotropy(a))
            }
            Self::Draine { alpha, .. } if !(alpha >= 0.0 && alpha.is_finite()) => Err(LobeError::Alpha(alpha)),
            _ => Ok(self),
        }
    }

    /// Value (sr⁻¹); also the density of [`Lobe::sample`].
    ///
    /// ```
    /// # use fogbow::phase::{Deflection, Lobe};
    /// let fog = Lobe::HenyeyGreenstein { g: 0.5 };
    /// assert!(fog.value(Deflection::from_cos(1.0)) > fog.value(Deflection::from_cos(0.0)));
    /// ```
    #[inline]
    #[must_use]
    pub fn value(&self, deflection: Deflection) -> f32 {
        match *self {
            Self::Isotropic => INV_FOUR_PI,
            Self::HenyeyGreenstein { g } => henyey_greenstein::value(deflection, g),
            Self::Schlick { k } => schlick::value(deflection, k),
            Self::Rayleigh => rayleigh::value(deflection),
            Self::Draine { g, alpha } => draine::value(deflection, g, alpha),
        }
    }

    /// Derivative of the value with respect to `cos θ` (sr⁻¹).
    ///
    /// ```
    /// # use fogbow::phase::{Deflection, Lobe};
    /// let sideways = Deflection::from_cos(0.0);
    /// assert_eq!((Lobe::Isotropic.derivative(sideways), Lobe::Rayleigh.derivative(sideways)), (0.0, 0.0));
    /// assert!(Lobe::HenyeyGreenstein { g: 0.5 }.derivative(sideways) > 0.0);   // more light straight on
    /// ```
    #[inline]
    #[must_use]
    pub fn derivative(&self, deflection: Deflection) -> f32 {
        match *self {
            Self::Isotropic => 0.0,
            Self::HenyeyGreenstein { g } => henyey_greenstein::derivative(deflection, g),
            Self::Schlick { k } => schlick::derivative(deflection, k),
            Self::Rayleigh => rayleigh::derivative(deflection),
            Self::Draine { g, alpha } => draine::derivative(deflection, g, alpha),
        }
    }

    /// Second derivative of the value with respect to `cos θ` (sr⁻¹).
    ///
    /// ```
    /// # use fogbow::phase::{Deflection, Lobe};
    /// let [back, forward] = [-0.5, 0.5].map(Deflection::from_cos);
    /// let curve = Lobe::Rayleigh.second_derivative(forward);   // a parabola over cos θ: the same everywhere
    /// assert!((Lobe::Rayleigh.derivative(forward) - Lobe::Rayleigh.derivative(back) - curve).abs() < 1e-7);
    /// ```
    #[inline]
    #[must_use]
    pub fn second_derivative(&self, deflection: Deflection) -> f32 {
        match *self {
            Self::Isotropic => 0.0,
            Self::HenyeyGreenstein { g } => henyey_greenstein::second_derivative(deflection, g),
            Self::Schlick { k } => schlick::second_derivative(deflection, k),
            Self::Rayleigh => rayleigh::SECOND_DERIVATIVE,
            Self::Draine { g, alpha } => draine::second_derivative(deflection, g, alpha),
        }
    }

    /// Draws a cosine with density [`Lobe::value`].
    ///
    /// ```
    /// # use fogbow::phase::Lobe;
    /// let fog = Lobe::HenyeyGreenstein { g: 0.9 };
    /// let sample = fog.sample(0.5);
    /// assert!(sample.deflection.cos > 0.97);   // half of the light is turned by less than 14°
    /// assert!((sample.pdf / fog.value(sample.deflection) - 1.0).abs() < 1e-4);
    /// ```
    #[inline]
    #[must_use]
    pub fn sample(&self, u: f32) -> CosineSample {
        match *self {
            Self::Isotropic => CosineSample::from_poles(2.0 * (1.0 - u), 2.0 * u, INV_FOUR_PI),
            Self::HenyeyGreenstein { g } => henyey_greenstein::sample(u, g),
            Self::Schlick { k } => schlick::sample(u, k),
            Self::Rayleigh => rayleigh::sample(u),
            Self::Draine { g, alpha } => draine::sample(u, g, alpha),
        }
    }

    /// Legendre moment `f_l = 2π ∫ p(c) P_l(c) dc`: `f_0 = 1`, `f_1` the mean cosine.
    ///
    /// ```
    /// # use fogbow::phase::Lobe;
    /// let g = 0.5;
    /// let moments = [0, 1, 2].map(|degree| Lobe::HenyeyGreenstein { g }.moment(degree));
    /// assert_eq!(moments, [1.0, g, g * g]);
    /// ```
    #[must_use]
    pub fn moment(&self, degree: usize) -> f32 {
        match *self {
            Self::Isotropic => f32::from(u8::from(degree == 0)),
            Self::HenyeyGreenstein { g } => henyey_greenstein::moment(g, degree),
            Self::Schlick { k } => schlick::moment(k, degree),
            Self::Rayleigh => rayleigh::moment(degree),
            Self::Draine { g, alpha } => draine::moment(g, alpha, degree),
        }
    }
}
