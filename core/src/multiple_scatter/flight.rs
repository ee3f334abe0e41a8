//! Distances between collisions.

use crate::host::{Medium, Properties, Rng};
use crate::math::{Ray, float};
use crate::sampling::{Generator, distance::exponential};
use crate::spectrum::Spectrum;
use crate::transmittance::thickness::{Marching, transmittance};
use crate::transmittance::tracking;

/// How the lengths of a walk's segments are drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Lengths {
    /// Delta tracking: in proportion to transmittance times extinction, whatever the medium.
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
pub(super) struct Collision {
    /// Where on the ray (m).
    pub distance: f32,
    /// Properties there.
    pub properties: Properties,
    /// Transmittance over the density of the distance (m).
    pub factor: Spectrum,
}

/// The next collision on `ray`, decided by `u`; `None` if light gets through. `throughput` weighs the channels.
#[inline]
pub(super) fn fly(
    ray: &Ray,
    medium: &(impl Medium + ?Sized),
    lengths: Lengths,
    throughput: Spectrum,
    marching: Marching,
    u: f32,
    rng: &mut Generator,
) -> Option<Collision> {
    if let Lengths::Exponential { floor } = lengths {
        let bound = medium.stretch(ray, 0.0).majorant.max_element();
        let rate = medium.extinction(ray.origin).mean().max(floor * bound);
        // From vacuum there is no rate to go by; tracking crosses it.
        if rate > 0.0 {
            let distance = exponential(u, rate);
            if !(distance < ray.length) {
                return None;
            }
            let pdf = rate * float::exp(-rate * distance);
            let factor = transmittance(&ray.with_length(distance), medium, marching) / pdf;
            let properties = medium.properties(ray.at(distance));
            return factor.is_finite().then_some(Collision { distance, properties, factor });
        }
    }
    let flown = tracking::flight(medium, ray, throughput, u, rng);
    let properties = flown.collision?;
    Some(Collision { distance: flown.distance, properties, factor: flown.weight.ratio(properties.extinction()) })
}

/// A generator of the walk's own: its length is unknown, and the host's sequence keeps its alignment.
pub(super) fn own(rng: &mut (impl Rng + ?Sized)) -> Generator {
    Generator::child(rng)
}
