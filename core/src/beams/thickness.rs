//! Optical thickness along an eye ray, for many points of it.

use crate::host::{Medium, Rng};
use crate::math::Ray;
use crate::sampling::uniform;
use crate::spectrum::Spectrum;
use crate::transmittance::segments;

/// Parts that an eye ray is divided into at most. Larger: more stack (28 bytes each). Smaller: coarser steps
/// through grids of more cells.
const PARTS: usize = 256;

/// Segments above which their borders are not followed.
const MAX_SEGMENTS: usize = 96;

/// Segments looked at: a ray without end through a medium without end stops there.
const MOST: usize = 1 << 14;

#[derive(Debug, Clone, Copy)]
struct Part {
    from: f32,
    thickness: Spectrum,
    /// Extinction (m⁻¹) from here on.
    slope: Spectrum,
}

/// `τ(t)` of a ray, linear in parts: exact along constant segments, marched through others in steps of the
/// medium's resolution from a jittered point each, which makes `τ` unbiased and `e^−τ` nearly so.
#[derive(Debug)]
pub(super) struct Thickness {
    parts: heapless::Vec<Part, PARTS>,
    last: Spectrum,
}

impl Thickness {
    pub(super) fn new(medium: &(impl Medium + ?Sized), ray: &Ray, rng: &mut (impl Rng + ?Sized)) -> Self {
        let offset = uniform(rng);
        let mut found = Self { parts: heapless::Vec::new(), last: Spectrum::ZERO };
        let (mut varying, mut count) = (0.0_f32, 0);
        let (mut first, mut end_of_medium) = (f32::INFINITY, 0.0_f32);
        for (from, segment) in segments(medium, ray).take(MOST) {
            let (to, low, high) = (segment.until, segment.minorant, segment.majorant);
            count += 1;
            if low != high {
                varying += to - from;
            }
            if high.max_element() > 0.0 {
                first = first.min(from);
                end_of_medium = to;
            }
        }
        if count > MAX_SEGMENTS || !varying.is_finite() {
            // Too many to follow: even steps from the first to the last, as far as that is finite.
            let last =
                if end_of_medium.is_finite() { end_of_medium } else { first + PARTS as f32 * medium.resolution() };
            if first < last {
                found.march(medium, ray, (first, last), PARTS - 1, offset);
                found.push(last, Spectrum::ZERO);
            }
            return found;
        }
        let room = (PARTS - count) as f32;
        // Every segment may round its number of steps up by one, for which `count` more are kept.
        let step = medium.resolution().max(varying / (room - count as f32).max(1.0));
        for (from, segment) in segments(medium, ray).take(MOST) {
            let (to, low, high) = (segment.until, segment.minorant, segment.majorant);
            if low == high {
                found.push(from, low);
                if to.is_finite() {
                    found.advance(low * (to - from));
                }
            } else {
                let steps = ((to - from) / step) as usize + 1;
                found.march(medium, ray, (from, to), steps, offset);
            }
        }
        found
    }

    fn march(&mut self, medium: &(impl Medium + ?Sized), ray: &Ray, (from, to): (f32, f32), steps: usize, offset: f32) {
        let width = (to - from) / steps as f32;
        for i in 0..steps {
            let start = from + i as f32 * width;
            let slope = medium.extinction(ray.at(start + offset * width));
            self.push(start, slope);
            self.advance(slope * width);
        }
    }

    fn push(&mut self, from: f32, slope: Spectrum) {
        // Room is reckoned with beforehand; without it, the last slope goes on.
        let _ = self.parts.push(Part { from, thickness: self.last, slope });
    }

    fn advance(&mut self, thickness: Spectrum) {
        self.last += thickness;
    }

    /// Optical thickness from the ray's origin to `distance` (m), which is finite.
    #[inline]
    pub(super) fn at(&self, distance: f32) -> Spectrum {
        let after = self.parts.partition_point(|part| part.from <= distance);
        match after.checked_sub(1).and_then(|i| self.parts.get(i)) {
            Some(part) => part.thickness + part.slope * (distance - part.from),
            None => Spectrum::ZERO,
        }
    }
}
