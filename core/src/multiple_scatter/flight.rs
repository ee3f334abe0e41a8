//! Distances between collisions.

use crate::host::{Medium, Rng};
use crate::math::{Ray, float};
use crate::sampling::{distance::exponential, uniform};
use crate::spectrum::Spectrum;
use crate::transmittance::thickness::{Marching, transmittance};

/// Tentative collisions after which a flight is given up: an endless medium whose extinction falls
/// to nothing under a positive majorant would never end it.
const MAX_COLLISIONS: u32 = 1 << 16;

/// How the lengths of a walk's segments are drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Lengths {
    /// Delta tracking: in proportion to transmittance times extinction, whatever the medium. Colours
    /// share a walk by balancing over the channel that leads it (Wilkie et al. 2014).
    Tracking,
    /// `σ̂ e^{−σ̂ r}` with the mean extinction at the start of the segment, and at least `floor` times
    /// the majorant there (J, Eq. 29; sheet § 1.7). Its weights grow where the medium thins out:
    /// relative variance above 10 per bounce. For comparison, and for homogeneous media.
    Exponential {
        /// Share of the majorant, in (0, 1].
        floor: f32,
    },
}

/// A collision.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Flight {
    /// Where on the ray (m).
    pub distance: f32,
    /// Transmittance over the density of the distance (m).
    pub factor: Spectrum,
}

/// The next collision on `ray`; `None` if light gets through.
#[inline]
pub(super) fn fly(
    ray: &Ray,
    medium: &(impl Medium + ?Sized),
    lengths: Lengths,
    marching: Marching,
    rng: &mut (impl Rng + ?Sized),
) -> Option<Flight> {
    if let Lengths::Exponential { floor } = lengths {
        let bound = medium.stretch(ray, 0.0).majorant.max_element();
        let rate = medium.extinction(ray.origin).mean().max(floor * bound);
        // From vacuum there is no rate to go by; tracking crosses it.
        if rate > 0.0 {
            let distance = exponential(uniform(rng), rate);
            if !(distance < ray.length) {
                return None;
            }
            let pdf = rate * float::exp(-rate * distance);
            let factor = transmittance(&ray.with_length(distance), medium, marching) / pdf;
            return factor.is_finite().then_some(Flight { distance, factor });
        }
    }
    track(ray, medium, rng)
}

/// Spectral delta tracking. A random channel leads; `through` is what every channel would have let
/// pass, so that
///
/// ```text
/// T_c/pdf = through_c / mean_c'(through_c' σ_c')
/// ```
///
/// which is 1/σ in a grey medium.
fn track(ray: &Ray, medium: &(impl Medium + ?Sized), rng: &mut (impl Rng + ?Sized)) -> Option<Flight> {
    let leader = ((uniform(rng) * 3.0) as usize).min(2);
    let mut through = Spectrum::ONE;
    let collide = |distance: f32, through: Spectrum, extinction: Spectrum| {
        let pdf = (through * extinction).mean();
        (pdf > 0.0).then(|| Flight { distance, factor: through / pdf })
    };
    let mut at = 0.0;
    let mut left = MAX_COLLISIONS;
    while at < ray.length && left > 0 {
        let stretch = medium.stretch(ray, at);
        left -= 1;
        let until = if stretch.until > at { stretch.until } else { at + medium.resolution().max(at * 1e-6) };
        let until = until.min(ray.length);
        if stretch.is_constant() {
            let distance = at + exponential(uniform(rng), stretch.majorant[leader]);
            let end = distance.min(until);
            if end.is_infinite() {
                return None;
            }
            through *= (stretch.majorant * (end - at)).transmitted();
            if distance < until {
                return collide(distance, through, stretch.majorant);
            }
            at = until;
            continue;
        }
        let bound = stretch.majorant.max_element();
        loop {
            let distance = at + exponential(uniform(rng), bound);
            if !(distance < until) {
                at = until;
                break;
            }
            at = distance;
            let extinction = medium.extinction(ray.at(distance));
            if uniform(rng) * bound < extinction[leader] {
                return collide(distance, through, extinction);
            }
            through *= Spectrum::ONE - extinction.min(stretch.majorant) / bound;
            left -= 1;
            if left == 0 {
                return None;
            }
        }
    }
    None
}
