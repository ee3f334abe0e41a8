//! Front-to-back integration.

use glam::Vec3;

use super::points::attenuated_length;
use crate::host::{Medium, Properties};
use crate::math::Ray;
use crate::sampling::distance::truncated_exponential;
use crate::spectrum::Spectrum;
use crate::transmittance::segments;

/// Most steps along one ray: a step function that returns too little must not hang the host.
const MAX_STEPS: u32 = 1 << 20;

/// Transmittance below which an endless medium hides what is left of it.
const NEGLIGIBLE: f32 = 1e-7;

/// Light along an eye ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EyeRay {
    /// Radiance (W·m⁻²·sr⁻¹) scattered and emitted towards the eye by the medium.
    pub radiance: Spectrum,
    /// Transmittance of the whole ray: what lies behind it is multiplied by this and added.
    pub transmittance: Spectrum,
}

/// Integrates in-scattered and emitted light along `ray`, as seen from its origin.
///
/// `step(distance)` is the length (m) of the step that starts at `distance`; `in_scattering(point,
/// to_eye, properties)` is `L_i` (W·m⁻²·sr⁻¹), *without* `σₛ`, asked once per step outside vacuum;
/// `offset`, in [0, 1), places the sample in every step.
///
/// ```text
/// L = Σ T(t_i) (σₛ L_i + ε) (1 − e^{−σₜ Δ_i})/σₜ,   T ← T e^{−σₜ Δ_i}
/// ```
///
/// On constant segments the transmittance is exact and the sample is placed by the truncated
/// exponential law, so that `L_i` alone decides the error; elsewhere the medium is taken as constant
/// within a step. Steps end at the segments' ends and at the end of the ray. Vacuum costs nothing.
/// An endless ray stops where the medium ends or hides the rest.
///
/// ```
/// # use fogbow::{march::eye_ray, math::{Ray, Vec3}, medium::Homogeneous, phase::Lobe, spectrum::Spectrum};
/// let fog = Homogeneous::new(Spectrum::splat(0.5), Spectrum::splat(0.5), Lobe::Isotropic).unwrap();
/// let ray = Ray::new(Vec3::ZERO, Vec3::X).with_length(2.0);
/// let seen = eye_ray(&ray, &fog, |_| 0.3, |_, _, _| Spectrum::ONE, 0.5);
/// assert!((seen.radiance[0] - 0.5 * (1.0 - (-2.0_f32).exp())).abs() < 1e-6);
/// assert!((seen.transmittance[0] - (-2.0_f32).exp()).abs() < 1e-6);
/// ```
pub fn eye_ray(
    ray: &Ray,
    medium: &(impl Medium + ?Sized),
    step: impl FnMut(f32) -> f32,
    mut in_scattering: impl FnMut(Vec3, Vec3, &Properties) -> Spectrum,
    offset: f32,
) -> EyeRay {
    let to_eye = -ray.direction;
    let mut scattered = Spectrum::ZERO;
    let seen = steps(ray, medium, step, offset, |distance, properties, weight| {
        scattered += weight * properties.scattering * in_scattering(ray.at(distance), to_eye, properties);
    });
    EyeRay { radiance: scattered + seen.radiance, ..seen }
}

/// The points of [`eye_ray`]: calls `visit(distance, properties, weight)` once per step where light is scattered;
/// the sum of `weight · σₛ · L_i` over the calls is what is scattered towards the ray's origin.
///
/// Returned are light emitted on the way and the transmittance of the whole ray.
///
/// ```
/// # use fogbow::{march::steps, math::{Ray, Vec3}, medium::Homogeneous, phase::Lobe, spectrum::Spectrum};
/// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Lobe::Isotropic).unwrap();
/// let ray = Ray::new(Vec3::ZERO, Vec3::X).with_length(2.0);
/// let (mut count, mut sum) = (0, 0.0);
/// steps(&ray, &fog, |_| 0.5, 0.5, |_, properties, weight| {
///     count += 1;
///     sum += (weight * properties.scattering)[0];   // L_i = 1
/// });
/// assert!(count == 4 && (sum - (1.0 - (-2.0_f32).exp())).abs() < 1e-6);
/// ```
pub fn steps(
    ray: &Ray,
    medium: &(impl Medium + ?Sized),
    mut step: impl FnMut(f32) -> f32,
    offset: f32,
    mut visit: impl FnMut(f32, &Properties, Spectrum),
) -> EyeRay {
    let mut radiance = Spectrum::ZERO;
    let mut thickness = Spectrum::ZERO;
    let mut left = MAX_STEPS;
    for (entry, segment) in segments(medium, ray) {
        if segment.majorant.is_black() {
            continue;
        }
        let (until, constant) = (segment.until, segment.is_constant());
        let (mut at, before) = (entry, thickness);
        // A host's step of 0 or NaN must still lead on.
        let least = 1e-6 * if until.is_finite() { until - at } else { 1.0 / segment.majorant.max_element() };
        while at < until {
            let transmittance = thickness.transmitted();
            if left == 0 {
                return EyeRay { radiance, transmittance };
            }
            left -= 1;
            if transmittance.max_element() < NEGLIGIBLE && (until.is_infinite() || transmittance.is_black()) {
                return EyeRay { radiance, transmittance: Spectrum::ZERO };
            }
            let wanted = step(at);
            let wanted = if wanted > least { wanted } else { least };
            // What is left over by rounding is no step of its own.
            let end = if at + wanted >= until * (1.0 - 1e-6) { until } else { at + wanted };
            let end = if end.is_finite() { end } else { at + 1.0 / segment.majorant.max_element() };
            let length = end - at;
            if !(length > 0.0) {
                break;
            }
            let (distance, extinction, weight, properties);
            if constant {
                let sample = truncated_exponential(offset, segment.majorant.mean(), length);
                distance = sample.distance;
                properties = medium.properties(ray.at(at + distance));
                extinction = segment.majorant;
                weight = (extinction * distance).transmitted() / sample.pdf;
            } else {
                distance = offset * length;
                properties = medium.properties(ray.at(at + distance));
                extinction = properties.extinction();
                weight = extinction.map(|sigma| attenuated_length(sigma, length));
            }
            radiance += transmittance * weight * properties.emission;
            if !properties.scattering.is_black() {
                visit(at + distance, &properties, transmittance * weight);
            }
            // From the segment's beginning where it can be: the rounding of many steps adds up.
            thickness = if constant { before + extinction * (end - entry) } else { thickness + extinction * length };
            at = end;
        }
    }
    EyeRay { radiance, transmittance: thickness.transmitted() }
}
