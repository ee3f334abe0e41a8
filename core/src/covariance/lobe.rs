//! The spectral covariance of phase functions: Belcour et al. 2014, Eq. 13–14.

use super::matrix::LIMIT;
use super::operators::PER_HESSIAN;
use crate::math::{Symmetric2, float};
use crate::phase::{Deflection, Phase};

/// Relative second derivatives (rad⁻²) of a phase function around a deflection: in the plane of scattering
/// and across it.
///
/// ```text
/// h₁₁ = (p″ sin²α − p′ cos α)/p,   h₂₂ = −p′ cos α/p          (derivatives by cos α)
/// ```
///
/// B Eq. 13–14, whose print has both signs turned. Mixtures count with the mean of their channels.
///
/// ```
/// # use fogbow::{covariance::phase_hessian, phase::{Deflection, Lobe, Phase}};
/// let fog = Phase::from(Lobe::HenyeyGreenstein { g: 0.5 });
/// let (h11, h22) = phase_hessian(&fog, Deflection::from_cos(1.0));
/// assert!((h11 + 6.0).abs() < 1e-5 && h11 == h22);   // −3g/(1 − g)² at the peak
/// ```
#[inline]
#[must_use]
pub fn phase_hessian(phase: &Phase, deflection: Deflection) -> (f32, f32) {
    let value = phase.value(deflection).mean();
    if !(value > 0.0) {
        return (0.0, 0.0);
    }
    let slope = phase.derivative(deflection).mean() / value;
    let second = phase.second_derivative(deflection).mean() / value;
    let sin2 = deflection.one_minus_cos * deflection.one_plus_cos;
    let across = -slope * deflection.cos;
    (second * sin2 + across, across)
}

/// Angular covariance `σ_ρ = diag(|h₁₁|, |h₂₂|)/(4π²)` (cycles²/rad²) of a phase function around a deflection;
/// see [`phase_hessian`].
///
/// Where `h₁₁` changes its sign, between peak and tail, no angular frequency passes: an artefact of a local
/// model, kept as it is.
///
/// ```
/// # use fogbow::{covariance::phase_covariance, math::float::PI, phase::{Deflection, Lobe, Phase}};
/// let straight = Deflection::from_cos(1.0);
/// let fog = phase_covariance(&Phase::from(Lobe::HenyeyGreenstein { g: 0.5 }), straight);
/// assert!((fog.xx - 6.0 / (4.0 * PI * PI)).abs() < 1e-6);   // 3g/(1 − g)² at the peak
/// assert_eq!(phase_covariance(&Phase::ISOTROPIC, straight).trace(), 0.0);   // nothing of directions is left
/// ```
#[inline]
#[must_use]
pub fn phase_covariance(phase: &Phase, deflection: Deflection) -> Symmetric2 {
    let (h11, h22) = phase_hessian(phase, deflection);
    let variance = |h: f32| float::min(h.abs() * PER_HESSIAN, LIMIT);
    Symmetric2::diagonal(variance(h11), variance(h22))
}
