//! Mirrors and smooth dielectrics: reflection, Snell's law, Fresnel's equations.

use glam::Vec3;

use super::SurfaceSample;
use crate::math::float;
use crate::spectrum::Spectrum;

/// The mirror image of `direction` (leaving the surface) about `normal`.
///
/// ```
/// # use fogbow::{math::Vec3, surface::specular::mirrored};
/// assert!((mirrored(Vec3::new(0.6, 0.0, 0.8), Vec3::Z) - Vec3::new(-0.6, 0.0, 0.8)).length() < 1e-6);
/// ```
#[inline]
#[must_use]
pub fn mirrored(direction: Vec3, normal: Vec3) -> Vec3 {
    normal * (2.0 * normal.dot(direction)) - direction
}

/// Refraction of light at a smooth interface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Refraction {
    /// Share of power reflected, in [0, 1]; 1 in total reflection.
    pub reflectance: f32,
    /// Direction that leaves on the far side; `None` in total reflection.
    pub transmitted: Option<Vec3>,
    /// Index of refraction on the far side over the one on the near side.
    pub relative_eta: f32,
}

/// Fresnel reflectance (unpolarised) and refracted direction for light that leaves towards
/// `direction`; `eta` is the index behind `normal` over the one before it.
///
/// ```
/// # use fogbow::{math::Vec3, surface::specular::refract};
/// let head_on = refract(Vec3::Z, Vec3::Z, 1.5);
/// assert!((head_on.reflectance - 0.04).abs() < 1e-6);   // ((n − 1) / (n + 1))²
/// ```
#[inline]
#[must_use]
pub fn refract(direction: Vec3, normal: Vec3, eta: f32) -> Refraction {
    let signed = normal.dot(direction).clamp(-1.0, 1.0);
    let (relative_eta, facing) = if signed >= 0.0 { (eta, normal) } else { (1.0 / eta, -normal) };
    let cos_i = signed.abs();
    let sin2_t = (1.0 - cos_i) * (1.0 + cos_i) / (relative_eta * relative_eta);
    if sin2_t >= 1.0 {
        return Refraction { reflectance: 1.0, transmitted: None, relative_eta };
    }
    let cos_t = float::sqrt(1.0 - sin2_t);
    let parallel = (relative_eta * cos_i - cos_t) / (relative_eta * cos_i + cos_t);
    let perpendicular = (cos_i - relative_eta * cos_t) / (cos_i + relative_eta * cos_t);
    let reflectance = (0.5 * (parallel * parallel + perpendicular * perpendicular)).min(1.0);
    let transmitted = ((facing * cos_i - direction) / relative_eta - facing * cos_t).normalize();
    Refraction { reflectance, transmitted: Some(transmitted), relative_eta }
}

/// Chooses reflection or refraction with Fresnel's probability.
///
/// The weight of refraction holds the factor `1/η²` by which radiance changes as its cone of
/// directions widens or narrows; it cancels when the path comes out again.
///
/// ```
/// # use fogbow::{math::Vec3, spectrum::Spectrum, surface::specular::sample_dielectric};
/// let one = Spectrum::ONE;
/// let through = |to_eye| sample_dielectric(Vec3::Z, to_eye, 1.5, one, one, 0.5).unwrap();
/// let (into, out) = (through(Vec3::Z), through(Vec3::NEG_Z));
/// assert_eq!((into.to_light, out.to_light), (Vec3::NEG_Z, Vec3::Z));   // head on: straight through
/// assert!(((into.weight * out.weight)[0] - 1.0).abs() < 1e-6);   // 1/η² on the way in, η² on the way out
/// ```
#[inline]
#[must_use]
pub fn sample_dielectric(
    normal: Vec3,
    to_eye: Vec3,
    eta: f32,
    reflectance: Spectrum,
    transmittance: Spectrum,
    choice: f32,
) -> Option<SurfaceSample> {
    let refraction = refract(to_eye, normal, eta);
    let (to_light, weight) = match refraction.transmitted {
        Some(transmitted) if choice >= refraction.reflectance => {
            (transmitted, transmittance / (refraction.relative_eta * refraction.relative_eta))
        }
        _ => (mirrored(to_eye, normal), reflectance),
    };
    (!weight.is_black()).then_some(SurfaceSample { to_light, weight, pdf: 0.0 })
}
