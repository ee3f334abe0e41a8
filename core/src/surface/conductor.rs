//! Metals: complex Fresnel reflectance for each channel, smooth or rough.

use glam::{Vec2, Vec3};

use super::SurfaceSample;
use super::microfacet::{GRAZING, Roughness};
use super::specular::mirrored;
use crate::math::float;
use crate::spectrum::Spectrum;

/// What light finds at a metal: a complex index of refraction per channel, over that of the medium outside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Conductor {
    /// Real part `n` (≥ 0).
    pub eta: Spectrum,
    /// Imaginary part `k` (≥ 0).
    pub k: Spectrum,
    /// Factor on reflected light, 1 for what is physical.
    pub reflectance: Spectrum,
}

impl Conductor {
    /// Reflects all light at all angles: `n = 0`, `k = 1`.
    ///
    /// ```
    /// # use fogbow::{spectrum::Spectrum, surface::Conductor};
    /// let mirror = Conductor::mirror(Spectrum::splat(0.9));
    /// assert_eq!((mirror.fresnel(1.0), mirror.fresnel(0.2)), (Spectrum::splat(0.9), Spectrum::splat(0.9)));
    /// ```
    #[must_use]
    pub const fn mirror(reflectance: Spectrum) -> Self {
        Self { eta: Spectrum::ZERO, k: Spectrum::ONE, reflectance }
    }

    /// Share of unpolarised light that is reflected, at an angle of incidence with `cosine` (Born and Wolf, § 14.2; Möller
    /// 1988), times [`Conductor::reflectance`].
    ///
    /// ```
    /// # use fogbow::{spectrum::Spectrum, surface::Conductor};
    /// let gold = Conductor { eta: Spectrum::new(0.14, 0.37, 1.44), k: Spectrum::new(3.98, 2.38, 1.60), reflectance: Spectrum::ONE };
    /// let [r, g, b] = gold.fresnel(1.0).0;   // ((n − 1)² + k²) / ((n + 1)² + k²)
    /// assert!((r - 0.9673).abs() < 1e-3 && (g - 0.8037).abs() < 1e-3 && (b - 0.3234).abs() < 1e-3);
    /// assert!((gold.fresnel(0.0)[1] - 1.0).abs() < 1e-6);   // along the surface everything is
    /// ```
    #[inline]
    #[must_use]
    pub fn fresnel(&self, cosine: f32) -> Spectrum {
        let cosine = cosine.clamp(0.0, 1.0);
        self.eta.zip(self.k, |eta, k| reflected(cosine, eta, k)) * self.reflectance
    }
}

#[inline]
fn reflected(cos: f32, eta: f32, k: f32) -> f32 {
    let cos2 = cos * cos;
    let sin2 = 1.0 - cos2;
    // a² + b² and a of the complex cosine inside, times the index.
    let real = eta * eta - k * k - sin2;
    let product = 2.0 * eta * k;
    let square = float::sqrt(real * real + product * product);
    let a = float::safe_sqrt(0.5 * (square + real));
    let (sum, mixed) = (square + cos2, 2.0 * cos * a);
    // Both are 0 only where there is no interface, along it.
    if !(sum + mixed > 0.0) {
        return 1.0;
    }
    let perpendicular = (sum - mixed) / (sum + mixed);
    let (sum, mixed) = (square * cos2 + sin2 * sin2, mixed * sin2);
    let ratio = if sum + mixed > 0.0 { (sum - mixed) / (sum + mixed) } else { 1.0 };
    (0.5 * perpendicular * (1.0 + ratio)).clamp(0.0, 1.0)
}

/// A metal of small facets that reflect once: light that would meet several is lost (Walter et al. 2007; Heitz 2014).
///
/// ```text
/// f = F(ω_h) D(ω_h) G(ω_i, ω_o) / (4 cos θ_i cos θ_o)
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RoughConductor {
    /// What the facets are made of.
    pub conductor: Conductor,
    /// How they lie.
    pub roughness: Roughness,
}

impl RoughConductor {
    #[inline]
    pub(super) fn value(&self, eye: Vec3, light: Vec3) -> Spectrum {
        match reflection(&self.roughness, eye, light) {
            Some((m, value)) => self.conductor.fresnel(eye.dot(m)) * value,
            None => Spectrum::ZERO,
        }
    }

    #[inline]
    pub(super) fn pdf(&self, eye: Vec3, light: Vec3) -> f32 {
        reflection_pdf(&self.roughness, eye, light)
    }

    #[inline]
    pub(super) fn sample(&self, eye: Vec3, u: Vec2) -> Option<SurfaceSample> {
        let rough = &self.roughness;
        let m = rough.sample(eye, u);
        let to_light = mirrored(eye, m);
        if !(to_light.z > GRAZING && eye.z > GRAZING) {
            return None;
        }
        let seen = rough.masking(to_light, m) * rough.misfit(eye);
        let pdf = rough.pdf(eye, m) / (4.0 * eye.dot(m));
        let weight = self.conductor.fresnel(eye.dot(m)) * seen;
        (pdf > 0.0 && !weight.is_black()).then_some(SurfaceSample { to_light, weight, pdf })
    }
}

/// The half vector of two directions above a surface, and `D G / (4 cos θ_i cos θ_o)` (sr⁻¹).
#[inline]
pub(super) fn reflection(rough: &Roughness, eye: Vec3, light: Vec3) -> Option<(Vec3, f32)> {
    if !(eye.z > GRAZING && light.z > GRAZING) {
        return None;
    }
    let m = (eye + light).try_normalize()?;
    let shadowing = rough.masking(eye, m) * rough.masking(light, m);
    Some((m, rough.density(m) * shadowing / (4.0 * eye.z * light.z)))
}

/// Density (sr⁻¹) of light mirrored by facets as `eye`, above the surface, sees them.
#[inline]
pub(super) fn reflection_pdf(rough: &Roughness, eye: Vec3, light: Vec3) -> f32 {
    if !(eye.z > GRAZING && light.z > GRAZING) {
        return 0.0;
    }
    (eye + light).try_normalize().map_or(0.0, |m| rough.pdf(eye, m) / (4.0 * eye.dot(m)))
}
