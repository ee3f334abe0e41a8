//! Distances between collisions.

use crate::host::{Medium, Properties, Rng};
use crate::math::{Ray, float};
use crate::sampling::{Generator, distance::exponential};
use crate::spectrum::Spectrum;
use crate::transmittance::marched::march;
use crate::transmittance::thickness::{Marching, Thickness, optical_thickness_with_gradients};
use crate::transmittance::tracking;

/// Extinction at a collision drawn from marched thickness counts as at most so many times what was marched there. Where
/// steps resolve the medium the two are alike; at the edge of a cloud, in next to vacuum as marched, a collision happens once in
/// millions of walks and would weigh as much as hundreds of thousands: a record that has it is a ball of light.
const MOST_MISSED: f32 = 32.0;

/// How the lengths of a walk's segments are drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Lengths {
    /// Delta tracking: in proportion to transmittance times extinction, whatever the medium.
    Tracking,
    /// Drawn from the thickness that is marched for gradients anyway: every length follows from one number, and
    /// there is no bias but that of marching, and that no extinction counts as more than 32 times what was marched.
    /// Where extinction is coloured, as [`Lengths::Tracking`].
    Marched,
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
pub struct Collision {
    /// Where on the ray (m).
    pub distance: f32,
    /// Properties there.
    pub properties: Properties,
    /// Transmittance over the density of the distance (m).
    pub factor: Spectrum,
    /// Thickness up to it, with gradients.
    pub thickness: Thickness,
}

/// The flight along a segment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flown {
    /// Where it ended; `None` if light gets through.
    pub collision: Option<Collision>,
    /// Thickness of the whole segment, if asked for.
    pub whole: Option<Thickness>,
    /// What light that gets through weighs: transmittance of the segment over the probability of that.
    pub passed: Spectrum,
}

/// How a segment is flown along.
pub(super) struct Flying {
    pub(super) lengths: Lengths,
    pub(super) marching: Marching,
    /// Whether the thickness of the whole ray is wanted.
    pub(super) to_end: bool,
}

/// The next collision on `ray`, decided by `u`. `throughput` weighs the channels.
#[inline]
pub(super) fn fly(
    ray: &Ray,
    medium: &(impl Medium + ?Sized),
    flying: &Flying,
    throughput: Spectrum,
    u: f32,
    rng: &mut Generator,
) -> Flown {
    let &Flying { lengths, marching, to_end } = flying;
    if lengths == Lengths::Marched && medium.is_grey() {
        let marched = march(ray, medium, marching, u, to_end);
        let collision = marched.collision.map(|drawn| {
            let properties = medium.properties(ray.at(drawn.distance));
            let factor = drawn.factor.min(MOST_MISSED / properties.extinction()[0]);
            Collision {
                distance: drawn.distance,
                properties,
                factor: Spectrum::splat(factor),
                thickness: drawn.thickness,
            }
        });
        return Flown { collision, whole: marched.whole, passed: Spectrum::ONE };
    }
    let whole = to_end.then(|| optical_thickness_with_gradients(ray, medium, marching));
    let thickness = |distance| optical_thickness_with_gradients(&ray.with_length(distance), medium, marching);
    if let Lengths::Exponential { floor } = lengths {
        let bound = medium.majorant_segment(ray, 0.0).majorant.max_element();
        let rate = medium.extinction(ray.origin).mean().max(floor * bound);
        // From vacuum there is no rate to go by; tracking crosses it.
        if rate > 0.0 {
            let distance = exponential(u, rate);
            if !(distance < ray.length) {
                let passed = thickness(ray.length).value.transmitted() / float::exp(-rate * ray.length);
                return Flown { collision: None, whole, passed };
            }
            let pdf = rate * float::exp(-rate * distance);
            let thickness = thickness(distance);
            let factor = thickness.value.transmitted() / pdf;
            let properties = medium.properties(ray.at(distance));
            let collision = Collision { distance, properties, factor, thickness };
            // Never: uniform numbers of 24 bits reach 17 free paths at most, where the density is 10⁻⁸ of the rate.
            return Flown { collision: factor.is_finite().then_some(collision), whole, passed: Spectrum::ZERO };
        }
    }
    let flown = tracking::flight(medium, ray, throughput, u, rng);
    let collision = flown.collision.map(|properties| Collision {
        distance: flown.distance,
        properties,
        factor: flown.weight.ratio(properties.extinction()),
        thickness: thickness(flown.distance),
    });
    Flown { collision, whole, passed: flown.weight }
}

/// A generator of the walk's own: its length is unknown, and the host's sequence keeps its alignment.
pub(super) fn own(rng: &mut (impl Rng + ?Sized)) -> Generator {
    Generator::child(rng)
}
