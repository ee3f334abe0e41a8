//! Points along an eye ray, as dense as light is scattered there.

use super::EyeRay;
use crate::host::{Medium, Properties};
use crate::math::{Ray, float};
use crate::spectrum::Spectrum;
use crate::transmittance::segments;

/// Most pieces along one ray: a resolution far too fine must not hang the host.
const MAX_PIECES: u32 = 1 << 20;

/// Transmittance at which a ray ends: what lies behind is no thousandth of a thousandth of the image.
const NEGLIGIBLE: f32 = 1e-6;

/// Calls `visit(distance, properties, weight)` at points along `ray` where light is scattered
/// towards its origin; the sum of `weight · σₛ · L_i` over the calls estimates `∫ T σₛ L_i dt`.
///
/// ```text
/// 1 − e^{−τ̄(t_k)} = (k + u)/n,   weight = T(t_k)/(n e^{−τ̄} σ̄),   k = 0, 1, …
/// ```
///
/// `n = density` is the number of points that an opaque ray gets; thin fog gets as many fewer as it
/// shows less, which spends look-ups where they are seen. `τ̄` and `σ̄` are means over the channels.
/// `u`, in [0, 1), shifts the points: uniform, the estimate is unbiased where the medium is constant
/// along segments. Elsewhere it is taken as constant over steps of [`Medium::resolution`], each
/// looked at where `jitter`, in [0, 1), says. Returned are light emitted on the way and the
/// transmittance of the whole ray.
///
/// ```
/// # use fogbow::{march::scattering_points, math::{Ray, Vec3}, medium::Homogeneous, phase::Lobe, spectrum::Spectrum};
/// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Lobe::Isotropic).unwrap();
/// let ray = Ray::new(Vec3::ZERO, Vec3::X).with_length(core::f32::consts::LN_2);
/// let (mut count, mut sum) = (0, 0.0);
/// scattering_points(&ray, &fog, 8.0, 0.5, 0.5, |_, properties, weight| {
///     count += 1;
///     sum += (weight * properties.scattering)[0];   // L_i = 1
/// });
/// assert_eq!(count, 4);                    // half of what is seen is fog
/// assert!((sum - 0.5_f32).abs() < 1e-6);   // 1 − T
/// ```
#[inline]
pub fn scattering_points(
    ray: &Ray,
    medium: &(impl Medium + ?Sized),
    density: f32,
    u: f32,
    jitter: f32,
    mut visit: impl FnMut(f32, &Properties, Spectrum),
) -> EyeRay {
    let spacing = 1.0 / density.max(1e-3);
    // Share of opacity at the next point, and the mean thickness there.
    let mut next = u * spacing;
    let due_at = |share: f32| if share < 1.0 { -float::ln_1p(-share) } else { f32::INFINITY };
    let mut due = due_at(next);
    let mut emitted = Spectrum::ZERO;
    let mut thickness = Spectrum::ZERO;
    let emissive = medium.is_emissive();
    // A resolution of 0, or that is no number, says nothing.
    let resolution = Some(medium.resolution()).filter(|r| *r > 0.0).unwrap_or(f32::INFINITY);
    let mut left = MAX_PIECES;
    for (start, segment) in segments(medium, ray) {
        if segment.majorant.is_black() {
            continue;
        }
        if left == 0 {
            break;
        }
        let until = segment.until;
        // A segment without end that changes: pieces of one free path each.
        let is_endless = until.is_infinite() && !segment.is_constant();
        let count = if is_endless {
            left
        } else if segment.is_constant() {
            1
        } else {
            (libm::ceilf((until - start) / resolution) as u32).clamp(1, left)
        };
        left -= count;
        let mut at = start;
        for i in 0..count {
            let end = if is_endless {
                at + 1.0 / segment.majorant.max_element().max(1e-30)
            } else if i + 1 == count {
                until
            } else {
                start + (until - start) * ((i + 1) as f32 / count as f32)
            };
            let look = if end.is_finite() { at + jitter * (end - at) } else { at };
            let properties = medium.properties(ray.at(look));
            let extinction = properties.extinction();
            let (mean, here) = (extinction.mean(), thickness.mean());
            if mean > 0.0 {
                let there = here + mean * (end - at);
                while due < there {
                    let distance = (at + (due - here) / mean).clamp(at, end);
                    let transmittance = (thickness + extinction * (distance - at)).transmitted();
                    visit(distance, &properties, transmittance * (spacing / ((1.0 - next) * mean)));
                    next += spacing;
                    due = due_at(next);
                }
            }
            if emissive && !properties.emission.is_black() {
                let lengths = extinction.map(|sigma| attenuated_length(sigma, end - at));
                emitted += thickness.transmitted() * properties.emission * lengths;
            }
            thickness += extinction * (end - at);
            // 0 · ∞
            thickness = thickness.map(|t| if t.is_nan() { 0.0 } else { t });
            at = end;
            // The exponential of what is clearly less need not be taken.
            if thickness.min_element() > 13.8 && thickness.transmitted().max_element() < NEGLIGIBLE {
                return EyeRay { radiance: emitted, transmittance: Spectrum::ZERO };
            }
        }
    }
    EyeRay { radiance: emitted, transmittance: thickness.transmitted() }
}

/// `∫₀ᵈ e^{−σt} dt = (1 − e^{−σd})/σ` (m).
#[inline]
pub(crate) fn attenuated_length(extinction: f32, length: f32) -> f32 {
    let a = extinction * length;
    if a < 1e-4 { length * (1.0 - 0.5 * a) } else { -float::exp_m1(-a) / extinction }
}
