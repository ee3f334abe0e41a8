//! Lights without extent. Radiant intensity is in W/sr.

use glam::Vec3;

use super::LightError;
use super::geometry::{Falloff, Source, spot};
use crate::math::float::{self, PI};
use crate::math::{Ray, quadrature};
use crate::spectrum::Spectrum;

fn check(position: Vec3, axis: Vec3, intensity: Spectrum) -> Result<Vec3, LightError> {
    if !position.is_finite() {
        return Err(LightError::Geometry);
    }
    if !intensity.is_valid() {
        return Err(LightError::Emission);
    }
    axis.try_normalize().ok_or(LightError::Geometry)
}

fn inverse_square(position: Vec3, from: Vec3) -> f32 {
    // The light itself must not become infinitely important; nor may a length be one that a world in other units has.
    1.0 / position.distance_squared(from).max(1e-30)
}

/// A light that shines the same in all directions.
///
/// ```
/// # use fogbow::{light::PointLight, math::{Vec3, float::PI}, spectrum::Spectrum};
/// let bulb = PointLight::from_flux(Vec3::ZERO, Spectrum::splat(4.0 * PI)).unwrap();
/// let same = PointLight::new(Vec3::ZERO, Spectrum::ONE).unwrap();
/// assert!((bulb.intensity[0] - same.intensity[0]).abs() < 1e-6);   // flux spread over 4π
/// assert_eq!(same.source().incident(2.0 * Vec3::X).unwrap().irradiance[0], 0.25);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointLight {
    /// Where (m).
    pub position: Vec3,
    /// Radiant intensity (W/sr).
    pub intensity: Spectrum,
}

impl PointLight {
    /// From radiant intensity (W/sr).
    ///
    /// # Errors
    /// Values that are not finite, or a negative intensity.
    pub fn new(position: Vec3, intensity: Spectrum) -> Result<Self, LightError> {
        check(position, Vec3::Z, intensity)?;
        Ok(Self { position, intensity })
    }

    /// From radiant flux (W): `I = Φ/(4π)`.
    ///
    /// # Errors
    /// As [`PointLight::new`].
    pub fn from_flux(position: Vec3, flux: Spectrum) -> Result<Self, LightError> {
        Self::new(position, flux * float::INV_FOUR_PI)
    }

    /// The light as a [`Source`].
    #[inline]
    #[must_use]
    pub fn source(&self) -> Source {
        Source { position: self.position, normal: Vec3::Z, weight: self.intensity, falloff: Falloff::Uniform }
    }

    pub(super) fn importance(&self, from: Vec3) -> f32 {
        self.intensity.mean() * inverse_square(self.position, from)
    }
}

/// A light with a `cosˢ` lobe around its axis.
///
/// ```
/// # use fogbow::{light::{LightError, PhongLight}, math::Vec3, spectrum::Spectrum};
/// let lamp = PhongLight::from_flux(Vec3::ZERO, Vec3::Z, 8.0, Spectrum::splat(60.0)).unwrap();
/// assert!((lamp.power()[0] - 60.0).abs() < 1e-4);
/// let aside = lamp.source().incident(Vec3::new(0.6, 0.0, 0.8)).unwrap();
/// assert!((aside.irradiance[0] / lamp.intensity[0] - 0.8_f32.powi(8)).abs() < 1e-6);   // cosˢ at one metre
/// assert_eq!(PhongLight::new(Vec3::ZERO, Vec3::Z, 0.5, Spectrum::ONE), Err(LightError::Exponent));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhongLight {
    /// Where (m).
    pub position: Vec3,
    /// Axis of the lobe (unit).
    pub axis: Vec3,
    /// Exponent `s`: 0 or at least 1.
    pub exponent: f32,
    /// Radiant intensity on the axis (W/sr).
    pub intensity: Spectrum,
}

impl PhongLight {
    /// From radiant intensity on the axis (W/sr).
    ///
    /// # Errors
    /// Values that are not finite, an axis without length, an exponent between 0 and 1.
    pub fn new(position: Vec3, axis: Vec3, exponent: f32, intensity: Spectrum) -> Result<Self, LightError> {
        let axis = check(position, axis, intensity)?;
        if !(exponent == 0.0 || (exponent >= 1.0 && exponent.is_finite())) {
            return Err(LightError::Exponent);
        }
        Ok(Self { position, axis, exponent, intensity })
    }

    /// From radiant flux (W): `I₀ = Φ (s + 1)/(2π)`.
    ///
    /// # Errors
    /// As [`PhongLight::new`].
    pub fn from_flux(position: Vec3, axis: Vec3, exponent: f32, flux: Spectrum) -> Result<Self, LightError> {
        Self::new(position, axis, exponent, flux * ((exponent + 1.0) / (2.0 * PI)))
    }

    /// Radiant power (W).
    #[must_use]
    pub fn power(&self) -> Spectrum {
        self.intensity * (2.0 * PI / (self.exponent + 1.0))
    }

    /// The light as a [`Source`].
    #[inline]
    #[must_use]
    pub fn source(&self) -> Source {
        let falloff = Falloff::Phong { exponent: self.exponent };
        Source { position: self.position, normal: self.axis, weight: self.intensity, falloff }
    }

    pub(super) fn importance(&self, from: Vec3) -> f32 {
        if self.axis.dot(from - self.position) <= 0.0 {
            return 0.0;
        }
        self.intensity.mean() * inverse_square(self.position, from)
    }
}

/// A cone of light with a soft border.
///
/// ```
/// # use fogbow::{light::SpotLight, math::{Vec3, float::PI}, spectrum::Spectrum};
/// let spot = SpotLight::new(Vec3::ZERO, Vec3::Z, PI / 3.0, PI / 3.0, Spectrum::ONE).unwrap();
/// assert!((spot.power()[0] - PI).abs() < 1e-5);   // 2π (1 − cos 60°) steradians
/// assert!(spot.source().incident(Vec3::Z).is_some() && spot.source().incident(Vec3::X).is_none());
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpotLight {
    /// Where (m).
    pub position: Vec3,
    /// Axis of the cone (unit).
    pub axis: Vec3,
    /// Half angle within which intensity is full (rad). Private, as the other: what is known of the cone goes with both.
    beam: f32,
    /// Half angle at which light ends (rad).
    cutoff: f32,
    /// Radiant intensity on the axis (W/sr).
    pub intensity: Spectrum,
    /// Cosine a little beyond the cut-off, so that rounding cannot hide a point that is still lit.
    outer_cosine: f32,
    /// Power per intensity (sr): a quadrature, which every photon would do again.
    solid_angle: f32,
}

impl SpotLight {
    /// From radiant intensity on the axis (W/sr) and half angles (rad).
    ///
    /// # Errors
    /// Values that are not finite, an axis without length, or angles out of order.
    pub fn new(position: Vec3, axis: Vec3, beam: f32, cutoff: f32, intensity: Spectrum) -> Result<Self, LightError> {
        let axis = check(position, axis, intensity)?;
        // NaN fails every comparison.
        if !(beam >= 0.0 && beam <= cutoff && cutoff > 0.0 && cutoff <= PI + 1e-6) {
            return Err(LightError::Cone);
        }
        let outer_cosine = libm::cosf((cutoff + 1e-3).min(PI)) - 1e-6;
        let cutoff = cutoff.min(PI);
        let full = 1.0 - libm::cosf(beam);
        let border = quadrature::integrate(beam, cutoff, |a| spot(libm::cosf(a), beam, cutoff) * libm::sinf(a));
        let solid_angle = 2.0 * PI * (full + border);
        Ok(Self { position, axis, beam, cutoff, intensity, outer_cosine, solid_angle })
    }

    /// Half angle within which intensity is full (rad).
    ///
    /// ```
    /// # use fogbow::{light::SpotLight, math::Vec3, spectrum::Spectrum};
    /// let spot = SpotLight::new(Vec3::ZERO, Vec3::Z, 0.2, 0.5, Spectrum::ONE)?;
    /// assert_eq!((spot.beam(), spot.cutoff()), (0.2, 0.5));
    /// # Ok::<(), fogbow::light::LightError>(())
    /// ```
    #[inline]
    #[must_use]
    pub fn beam(&self) -> f32 {
        self.beam
    }

    /// Half angle at which light ends (rad); between both, intensity falls linearly in the angle.
    ///
    /// ```
    /// # use fogbow::{light::SpotLight, math::{Vec3, float::PI}, spectrum::Spectrum};
    /// let spot = SpotLight::new(Vec3::ZERO, Vec3::Z, 0.0, PI, Spectrum::ONE)?;
    /// let sideways = spot.source().incident(Vec3::X).unwrap();
    /// assert!((sideways.irradiance[0] - 0.5).abs() < 1e-6 && spot.cutoff() == PI);
    /// # Ok::<(), fogbow::light::LightError>(())
    /// ```
    #[inline]
    #[must_use]
    pub fn cutoff(&self) -> f32 {
        self.cutoff
    }

    /// Radiant power (W): `2π I ∫ f(γ) sin γ dγ`.
    #[must_use]
    pub fn power(&self) -> Spectrum {
        self.intensity * self.solid_angle
    }

    /// The light as a [`Source`].
    #[inline]
    #[must_use]
    pub fn source(&self) -> Source {
        let falloff = Falloff::Spot { beam: self.beam, cutoff: self.cutoff };
        Source { position: self.position, normal: self.axis, weight: self.intensity, falloff }
    }

    pub(super) fn importance(&self, from: Vec3) -> f32 {
        let to_point = from - self.position;
        if self.axis.dot(to_point) < self.outer_cosine * to_point.length() {
            return 0.0;
        }
        self.intensity.mean() * inverse_square(self.position, from)
    }

    /// The part of a ray that lies in the cone: roots of `(a·x)² = cos² |x|²` along it.
    pub(super) fn lit_interval(&self, ray: &Ray, near: f32, far: f32) -> Option<(f32, f32)> {
        let (o, d, a) = (ray.origin - self.position, ray.direction, self.axis);
        let cos = self.outer_cosine;
        // A cone wider than a hemisphere is no convex body: leave the ray whole.
        if cos <= 1e-3 {
            return Some((near, far));
        }
        let (ad, ao, cos2) = (a.dot(d), a.dot(o), cos * cos);
        let qa = ad * ad - cos2;
        let qb = ad * ao - cos2 * d.dot(o);
        let qc = ao * ao - cos2 * o.dot(o);
        // Nearly parallel to the border: the roots are badly conditioned, the whole ray is right.
        if qa.abs() < 1e-4 {
            return Some((near, far));
        }
        let discriminant = float::difference_of_products(qb, qb, qa, qc);
        if discriminant < 0.0 {
            // Steep rays cross the border twice or run through the apex; flat ones may miss.
            return if qa > 0.0 { Some((near, far)) } else { None };
        }
        let root = float::sqrt(discriminant);
        let q = -(qb + root.copysign(qb));
        let (t0, t1) = if q == 0.0 { (0.0, 0.0) } else { (q / qa, qc / q) };
        let (low, high) = (t0.min(t1), t0.max(t1));
        let (low, high) = if qa < 0.0 {
            // Between the roots the ray is inside one of the two nappes.
            if ao + ad * 0.5 * (low + high) <= 0.0 {
                return None;
            }
            (low, high)
        } else if ad > 0.0 {
            (high, far)
        } else {
            (near, low)
        };
        let (low, high) = (low.max(near), high.min(far));
        (high > low).then_some((low, high))
    }
}
