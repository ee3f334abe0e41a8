//! The one loop over the majorant segments of a ray.
//!
//! A medium says for any distance which bounds hold from there on, and up to where. Whoever follows a ray asks again
//! and again; whether that advances, how often it may happen and where it ends is settled here.

use crate::host::{MajorantSegment, Medium};
use crate::math::{Ray, float};

/// Most segments of a ray. More: a host's mistake takes longer to end. Fewer: a finite ray through very fine bounds,
/// of which a walk visits some ten thousand at most, counts as vacuum behind the last.
const MAX_SEGMENTS: u32 = 1 << 20;

/// The same on a ray without end, which may lie in a medium without end and mostly without matter.
const MAX_SEGMENTS_ENDLESS: u32 = 1 << 16;

/// Where a medium does not advance, this many steps are taken before they get twice as long.
const MISTAKES_PER_DOUBLING: u32 = 256;

/// The majorant segments of a ray: see [`segments`] and [`marching_segments`].
#[derive(Debug)]
pub struct Segments<'a, M: ?Sized> {
    medium: &'a M,
    ray: &'a Ray,
    at: f32,
    left: u32,
    mistakes: u32,
    is_marching: bool,
}

/// The majorant segments of `ray`, by [`Medium::majorant_segment`], each with the distance (m) at which it begins.
///
/// They join without gaps from 0 to the ray's length, at which the last one is cut. Whatever the medium answers, every
/// segment ends beyond its beginning, and there are at most 2²⁰ of them, 2¹⁶ where the ray has no end. Where the
/// medium does not advance (`until` no number, or not greater than where it was asked), its bounds are taken for a
/// length of [`Medium::resolution`], and for longer and longer ones should it go on like that.
///
/// ```
/// # use fogbow::{math::{Ray, Vec3}, medium::{Homogeneous, Placed, Region}, phase::Phase, spectrum::Spectrum};
/// # use fogbow::transmittance::segments;
/// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::splat(0.5), Phase::ISOTROPIC).unwrap();
/// let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 2.0).unwrap());
/// let ray = Ray::new(Vec3::new(-5.0, 0.0, 0.0), Vec3::X).with_length(6.0);
/// let found: Vec<_> = segments(&ball, &ray).map(|(from, segment)| (from, segment.until, segment.majorant[0])).collect();
/// assert_eq!(found, [(0.0, 3.0, 0.0), (3.0, 6.0, 0.5)]);     // vacuum, then fog up to the end of the ray
/// ```
#[inline]
#[must_use]
#[doc(alias("RayMajorantIterator", "stretches"))]
pub fn segments<'a, M: Medium + ?Sized>(medium: &'a M, ray: &'a Ray) -> Segments<'a, M> {
    let left = if ray.length.is_finite() { MAX_SEGMENTS } else { MAX_SEGMENTS_ENDLESS };
    Segments { medium, ray, at: 0.0, left, mistakes: 0, is_marching: false }
}

/// As [`segments`], by [`Medium::marching_segment`]: where extinction changes, segments are long and bounds may be loose.
///
/// ```
/// # use fogbow::{math::{Ray, Vec3}, medium::{FractalNoise, Noise}, phase::Phase, spectrum::Spectrum};
/// # use fogbow::transmittance::{marching_segments, segments};
/// let cloud = Noise::new(FractalNoise::default(), Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC).unwrap();
/// let ray = Ray::new(Vec3::ZERO, Vec3::X).with_length(4.0);
/// assert!(marching_segments(&cloud, &ray).count() <= segments(&cloud, &ray).count());
/// assert_eq!(marching_segments(&cloud, &ray).last().unwrap().1.until, 4.0);
/// ```
#[inline]
#[must_use]
pub fn marching_segments<'a, M: Medium + ?Sized>(medium: &'a M, ray: &'a Ray) -> Segments<'a, M> {
    Segments { is_marching: true, ..segments(medium, ray) }
}

impl<M: Medium + ?Sized> Segments<'_, M> {
    /// Where a segment that begins at `from` (m) and does not end beyond it is taken to end (m).
    #[cold]
    fn forced(&mut self, from: f32) -> f32 {
        let longer = (self.mistakes / MISTAKES_PER_DOUBLING).min(127);
        self.mistakes += 1;
        // A millionth of a distance is what f32 tells apart; resolutions may be 0 or no numbers.
        let distance = if self.ray.length.is_finite() { self.ray.length } else { from };
        let step = (1e-6 * distance).max(self.medium.resolution()).max(f32::MIN_POSITIVE);
        // The power of two, by its exponent.
        (from + step * f32::from_bits((127 + longer) << 23)).max(from.next_up())
    }
}

impl<M: Medium + ?Sized> Iterator for Segments<'_, M> {
    type Item = (f32, MajorantSegment);

    #[inline(always)]
    fn next(&mut self) -> Option<(f32, MajorantSegment)> {
        let from = self.at;
        // Written so that NaN ends the walk, too.
        if !(from < self.ray.length) || self.left == 0 {
            return None;
        }
        self.left -= 1;
        let mut segment = if self.is_marching {
            self.medium.marching_segment(self.ray, from)
        } else {
            self.medium.majorant_segment(self.ray, from)
        };
        if !(segment.until > from) {
            segment.until = self.forced(from);
        }
        segment.until = float::min(segment.until, self.ray.length);
        self.at = segment.until;
        Some((from, segment))
    }
}
