//! A medium that is the same everywhere.

use glam::Vec3;

use super::MediumError;
use crate::host::{Gradients, MajorantSegment, Medium, Properties};
use crate::math::Ray;
use crate::phase::Phase;
use crate::spectrum::{Hessian, Spectrum};

/// A medium that is the same everywhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Homogeneous {
    properties: Properties,
}

impl Homogeneous {
    /// From absorption and scattering coefficients (m⁻¹) and a phase function.
    ///
    /// # Errors
    /// Coefficients that are negative or not finite; phase parameters out of range.
    ///
    /// ```
    /// # use fogbow::{medium::Homogeneous, phase::Lobe, spectrum::Spectrum};
    /// let fog = Homogeneous::new(Spectrum::splat(0.1), Spectrum::splat(0.9), Lobe::HenyeyGreenstein { g: 0.7 });
    /// assert!(fog.is_ok());
    /// ```
    pub fn new(absorption: Spectrum, scattering: Spectrum, phase: impl Into<Phase>) -> Result<Self, MediumError> {
        if !(absorption.is_valid() && scattering.is_valid() && (absorption + scattering).is_finite()) {
            return Err(MediumError::Coefficients);
        }
        let phase = phase.into().check()?;
        Ok(Self { properties: Properties { absorption, scattering, emission: Spectrum::ZERO, phase } })
    }

    /// The same medium, emitting `emission` (W·m⁻³·sr⁻¹) in all directions.
    ///
    /// # Errors
    /// Emission that is negative or not finite.
    ///
    /// ```
    /// # use fogbow::{host::Medium, math::Vec3, medium::{Homogeneous, MediumError}, phase::Lobe, spectrum::Spectrum};
    /// let soot = Homogeneous::new(Spectrum::ONE, Spectrum::ZERO, Lobe::Isotropic)?;
    /// let flame = soot.with_emission(Spectrum::splat(10.0))?;
    /// assert!(!soot.is_emissive() && flame.properties(Vec3::ZERO).emission == Spectrum::splat(10.0));
    /// assert_eq!(soot.with_emission(Spectrum::splat(-1.0)), Err(MediumError::Emission));
    /// # Ok::<(), MediumError>(())
    /// ```
    pub fn with_emission(mut self, emission: Spectrum) -> Result<Self, MediumError> {
        if !emission.is_valid() {
            return Err(MediumError::Emission);
        }
        self.properties.emission = emission;
        Ok(self)
    }

    /// Angular law of scattering; the same everywhere.
    ///
    /// ```
    /// # use fogbow::{medium::Homogeneous, phase::Lobe, spectrum::Spectrum};
    /// let haze = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Lobe::HenyeyGreenstein { g: 0.7 })?;
    /// assert_eq!(haze.phase().mean_cosine()[0], 0.7);
    /// # Ok::<(), fogbow::medium::MediumError>(())
    /// ```
    #[inline]
    #[must_use]
    pub fn phase(&self) -> Phase {
        self.properties.phase
    }
}

impl Medium for Homogeneous {
    #[inline]
    fn properties(&self, _: Vec3) -> Properties {
        self.properties
    }
    #[inline]
    fn majorant_segment(&self, _: &Ray, _: f32) -> MajorantSegment {
        let mut extinction = self.properties.extinction();
        if extinction.is_black() && self.is_emissive() {
            // A bound of 0 would promise that nothing glows.
            extinction = Spectrum::splat(f32::MIN_POSITIVE);
        }
        MajorantSegment { until: f32::INFINITY, minorant: extinction, majorant: extinction }
    }
    #[inline]
    fn extinction(&self, _: Vec3) -> Spectrum {
        self.properties.extinction()
    }
    fn gradients(&self, _: Vec3) -> Gradients {
        Gradients::default()
    }
    fn extinction_hessian(&self, _: Vec3) -> Hessian {
        Hessian::ZERO
    }
    fn mean_extinction(&self, _: Vec3, _: f32) -> Spectrum {
        self.properties.extinction()
    }
    fn is_grey(&self) -> bool {
        self.properties.extinction().is_grey()
    }
    fn is_emissive(&self) -> bool {
        !self.properties.emission.is_black()
    }
}
