//! The phase function a medium carries: one lobe, or a coloured mixture of several.

use glam::{Vec2, Vec3};

use super::{Deflection, Lobe, LobeError, deflection_gradient, draine};
use crate::math::{Frame, float::PI};
use crate::sampling::discrete;
use crate::spectrum::{Gradient, Spectrum};

/// Most lobes a mixture holds: two overlapping fogs of two lobes each.
pub const MAX_LOBES: usize = 4;

/// A phase function: a mixture of up to [`MAX_LOBES`] lobes with coloured weights that sum to 1 in
/// every channel.
///
/// Coloured, because where media overlap each scatters its own colours: `Σ σₛᵢ pᵢ / Σ σₛᵢ`.
///
/// ```
/// # use fogbow::phase::{Deflection, Lobe, Phase};
/// let haze = Phase::from(Lobe::HenyeyGreenstein { g: 0.7 });
/// assert_eq!(haze.mean_cosine()[0], 0.7);
/// let cloud = Phase::droplets(20.0).unwrap();
/// assert!(cloud.value(Deflection::from_cos(1.0))[0] > 100.0);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Phase {
    lobes: [Lobe; MAX_LOBES],
    weights: [Spectrum; MAX_LOBES],
    count: usize,
}

/// A mixture would need more than [`MAX_LOBES`] different lobes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TooManyLobes;

impl core::fmt::Display for TooManyLobes {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "a mixture holds at most {MAX_LOBES} different lobes")
    }
}

impl core::error::Error for TooManyLobes {}

/// A direction drawn from a phase function.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhaseSample {
    /// Where the traced path goes on (unit); it receives light from there.
    pub to_light: Vec3,
    /// Value over density: 1 for a mixture without colours.
    pub weight: Spectrum,
    /// Density (sr⁻¹).
    pub pdf: f32,
}

impl From<Lobe> for Phase {
    #[inline]
    fn from(lobe: Lobe) -> Self {
        let mut weights = [Spectrum::ZERO; MAX_LOBES];
        weights[0] = Spectrum::ONE;
        Self { lobes: [lobe; MAX_LOBES], weights, count: 1 }
    }
}

impl Phase {
    /// Isotropic scattering.
    pub const ISOTROPIC: Self = Self {
        lobes: [Lobe::Isotropic; MAX_LOBES],
        weights: [Spectrum::ONE, Spectrum::ZERO, Spectrum::ZERO, Spectrum::ZERO],
        count: 1,
    };

    /// Whether light is scattered alike in all directions.
    ///
    /// ```
    /// # use fogbow::phase::{Lobe, Phase};
    /// assert!(Phase::ISOTROPIC.is_isotropic() && !Phase::from(Lobe::Rayleigh).is_isotropic());
    /// ```
    #[inline]
    #[must_use]
    pub fn is_isotropic(&self) -> bool {
        self.lobes[..self.count].iter().all(|lobe| *lobe == Lobe::Isotropic)
    }

    /// Fog or cloud of water droplets of `diameter` (µm, in [5, 50]): the blend of
    /// Henyey–Greenstein and Draine fitted by Jendersie and d'Eon 2023.
    ///
    /// # Errors
    /// [`LobeError::Diameter`] outside the range of the fit.
    pub fn droplets(diameter: f32) -> Result<Self, LobeError> {
        if !(5.0..=50.0).contains(&diameter) {
            return Err(LobeError::Diameter(diameter));
        }
        let fit = draine::droplets(diameter);
        let mut phase = Self::from(Lobe::HenyeyGreenstein { g: fit.g_hg });
        phase.lobes[1] = Lobe::Draine { g: fit.g_draine, alpha: fit.alpha };
        phase.weights[0] = Spectrum::splat(1.0 - fit.weight_draine);
        phase.weights[1] = Spectrum::splat(fit.weight_draine);
        phase.count = 2;
        Ok(phase)
    }

    /// The mixture of phase functions, each with the scattering coefficient (m⁻¹) it acts with.
    /// Equal lobes are merged; nothing that scatters gives [`Phase::ISOTROPIC`].
    ///
    /// # Errors
    /// [`TooManyLobes`] if more than [`MAX_LOBES`] different lobes scatter.
    ///
    /// ```
    /// # use fogbow::{phase::{Lobe, Phase}, spectrum::Spectrum};
    /// let (red, blue) = (Spectrum::new(1.0, 0.0, 0.0), Spectrum::new(0.0, 0.0, 1.0));
    /// let forward = Phase::from(Lobe::HenyeyGreenstein { g: 0.5 });
    /// let mixed = Phase::mix([(red, forward), (blue, Phase::ISOTROPIC)]).unwrap();
    /// // Nothing scatters green, whose phase function is the mean of the others.
    /// assert_eq!(mixed.mean_cosine(), Spectrum::new(0.5, 0.25, 0.0));
    /// ```
    pub fn mix(parts: impl IntoIterator<Item = (Spectrum, Self)>) -> Result<Self, TooManyLobes> {
        let mut mixed = Self { count: 0, ..Self::ISOTROPIC };
        let mut total = Spectrum::ZERO;
        for (scattering, phase) in parts {
            total += scattering;
            for (lobe, weight) in phase.lobes() {
                let share = scattering * weight;
                if share.is_black() {
                    continue;
                }
                if let Some(i) = mixed.lobes[..mixed.count].iter().position(|l| *l == lobe) {
                    mixed.weights[i] += share;
                } else {
                    let slot = mixed.count;
                    *mixed.lobes.get_mut(slot).ok_or(TooManyLobes)? = lobe;
                    mixed.weights[slot] = share;
                    mixed.count += 1;
                }
            }
        }
        if mixed.count <= 1 {
            return Ok(if mixed.count == 1 { Self::from(mixed.lobes[0]) } else { Self::ISOTROPIC });
        }
        // A channel in which nothing scatters takes the mean of the others: weights must sum to 1 in
        // every channel, or the density of the mean is none.
        let grey = total.mean();
        for weight in &mut mixed.weights[..mixed.count] {
            let mean = weight.mean() / grey;
            *weight = weight.zip(total, |w, t| if t > 0.0 { w / t } else { mean });
        }
        Ok(mixed)
    }

    /// Whether every lobe's parameters lie in their ranges.
    ///
    /// # Errors
    /// The parameter that does not.
    ///
    /// ```
    /// # use fogbow::phase::{Lobe, LobeError, Phase};
    /// assert_eq!(Phase::from(Lobe::Schlick { k: -2.0 }).check(), Err(LobeError::Anisotropy(-2.0)));
    /// ```
    pub fn check(self) -> Result<Self, LobeError> {
        self.lobes().try_for_each(|(lobe, _)| lobe.check().map(drop))?;
        Ok(self)
    }

    /// The lobes and their weights.
    ///
    /// ```
    /// # use fogbow::{phase::Phase, spectrum::Spectrum};
    /// let cloud = Phase::droplets(20.0).unwrap();
    /// let weights: Spectrum = cloud.lobes().map(|(_, weight)| weight).sum();
    /// assert!(cloud.lobes().count() == 2 && (weights[0] - 1.0).abs() < 1e-6);
    /// ```
    pub fn lobes(&self) -> impl Iterator<Item = (Lobe, Spectrum)> + '_ {
        (0..self.count).map(|i| (self.lobes[i], self.weights[i]))
    }

    #[inline]
    fn sum(&self, f: impl Fn(Lobe) -> f32) -> Spectrum {
        if self.count == 1 {
            return Spectrum::splat(f(self.lobes[0]));
        }
        self.lobes().map(|(lobe, weight)| weight * f(lobe)).sum()
    }

    /// Value (sr⁻¹) per channel.
    #[inline]
    #[must_use]
    pub fn value(&self, deflection: Deflection) -> Spectrum {
        self.sum(|lobe| lobe.value(deflection))
    }

    /// Derivative of the value with respect to `cos θ` (sr⁻¹).
    ///
    /// ```
    /// # use fogbow::phase::{Deflection, Phase};
    /// let cloud = Phase::droplets(20.0).unwrap();
    /// assert_eq!(Phase::ISOTROPIC.derivative(Deflection::from_cos(0.5))[0], 0.0);
    /// assert!(cloud.derivative(Deflection::from_cos(0.99))[0] > 0.0);   // towards the peak
    /// assert!(cloud.derivative(Deflection::from_cos(-0.9))[0] < 0.0);   // towards the glory
    /// ```
    #[inline]
    #[must_use]
    pub fn derivative(&self, deflection: Deflection) -> Spectrum {
        self.sum(|lobe| lobe.derivative(deflection))
    }

    /// Second derivative of the value with respect to `cos θ` (sr⁻¹).
    ///
    /// ```
    /// # use fogbow::phase::{Deflection, Phase};
    /// let cloud = Phase::droplets(20.0).unwrap();
    /// let [before, at, after] = [0.29, 0.3, 0.31].map(Deflection::from_cos);
    /// let difference = (cloud.derivative(after)[0] - cloud.derivative(before)[0]) / 0.02;
    /// assert!((cloud.second_derivative(at)[0] / difference - 1.0).abs() < 1e-2);
    /// ```
    #[inline]
    #[must_use]
    pub fn second_derivative(&self, deflection: Deflection) -> Spectrum {
        self.sum(|lobe| lobe.second_derivative(deflection))
    }

    /// Gradient (sr⁻¹ m⁻¹) of the value when the point moves and a light `distance` (m) away stays.
    ///
    /// ```text
    /// ∇p = (dp/dc) (ω − c u) / r
    /// ```
    ///
    /// Source: sheet § 1.3 (Jarosz et al. 2008, Eq. 43–45 with the sign corrected).
    ///
    /// ```
    /// # use fogbow::{math::Vec3, phase::{Lobe, Phase, deflection}};
    /// let (fog, lamp, to_eye) = (Phase::from(Lobe::HenyeyGreenstein { g: 0.5 }), 2.0 * Vec3::Z, Vec3::X);
    /// let value = |point: Vec3| fog.value(deflection((lamp - point).normalize(), to_eye))[0];
    /// let difference = (value(0.01 * Vec3::X) - value(-0.01 * Vec3::X)) / 0.02;
    /// assert!((fog.gradient(Vec3::Z, to_eye, 2.0).x[0] - difference).abs() < 1e-5);
    /// ```
    #[inline]
    #[must_use]
    pub fn gradient(&self, to_light: Vec3, to_eye: Vec3, distance: f32) -> Gradient {
        let derivative = self.derivative(super::deflection(to_light, to_eye));
        Gradient::outer(derivative, deflection_gradient(to_light, to_eye, distance))
    }

    /// Density (sr⁻¹) with which [`Phase::sample`] draws directions: the mixture with grey weights.
    ///
    /// ```
    /// # use fogbow::phase::{Deflection, Phase};
    /// let (cloud, forward) = (Phase::droplets(20.0).unwrap(), Deflection::from_cos(0.9));
    /// assert!((cloud.pdf(forward) / cloud.value(forward)[0] - 1.0).abs() < 1e-6);   // the same without colours
    /// ```
    #[inline]
    #[must_use]
    pub fn pdf(&self, deflection: Deflection) -> f32 {
        if self.count == 1 {
            return self.lobes[0].value(deflection);
        }
        self.lobes().map(|(lobe, weight)| weight.mean() * lobe.value(deflection)).sum()
    }

    /// Draws the direction from which light is received, for light that leaves towards `to_eye`.
    ///
    /// ```
    /// # use fogbow::{math::{Vec2, Vec3}, phase::{Phase, deflection}};
    /// let cloud = Phase::droplets(20.0).unwrap();
    /// let sample = cloud.sample(Vec3::Z, Vec2::new(0.9, 0.2));
    /// assert!(sample.to_light.z < -0.9);   // most light that leaves towards +z comes from below
    /// let value = cloud.value(deflection(sample.to_light, Vec3::Z))[0];
    /// assert!((sample.weight[0] * sample.pdf / value - 1.0).abs() < 1e-3);
    /// ```
    #[must_use]
    pub fn sample(&self, to_eye: Vec3, u: Vec2) -> PhaseSample {
        let (lobe, u_cos) = if self.count == 1 {
            (self.lobes[0], u.x)
        } else {
            let lobes = self.lobes().map(|(lobe, weight)| (weight.mean(), lobe));
            discrete::choose(lobes, u.x).map_or((self.lobes[0], u.x), |(lobe, choice)| (lobe, choice.remainder))
        };
        let cosine = lobe.sample(u_cos);
        let (sin_azimuth, cos_azimuth) = crate::math::float::sin_cos(2.0 * PI * u.y);
        let sin = cosine.sin();
        // Light that goes straight on towards the eye comes from −to_eye.
        let frame = Frame::around(-to_eye);
        let to_light =
            frame.to_world(Vec3::new(sin * cos_azimuth, sin * sin_azimuth, cosine.deflection.cos)).normalize();
        if self.count == 1 {
            return PhaseSample { to_light, weight: Spectrum::ONE, pdf: cosine.pdf };
        }
        let pdf = self.pdf(cosine.deflection);
        PhaseSample { to_light, weight: self.value(cosine.deflection) / pdf, pdf }
    }

    /// Legendre moment `f_l` per channel.
    ///
    /// ```
    /// # use fogbow::{phase::{Lobe, Phase}, spectrum::Spectrum};
    /// let fog = Phase::from(Lobe::HenyeyGreenstein { g: 0.5 });
    /// assert_eq!((fog.moment(0), fog.moment(1)), (Spectrum::ONE, fog.mean_cosine()));
    /// assert_eq!(fog.moment(2), Spectrum::splat(0.25));
    /// ```
    #[must_use]
    pub fn moment(&self, degree: usize) -> Spectrum {
        self.sum(|lobe| lobe.moment(degree))
    }

    /// Mean cosine of the deflection, `f_1`.
    #[must_use]
    pub fn mean_cosine(&self) -> Spectrum {
        self.moment(1)
    }
}
