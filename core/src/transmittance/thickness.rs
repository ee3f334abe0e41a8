//! Optical thickness and its two gradients: Jarosz et al. 2008, Eq. 16–22, with the factor
//! `(1 − t)` written out and the terms of the faces added (sheet § 1.4).
//!
//! Departs from the paper: segments on which the medium is constant are integrated in closed form
//! and only what lies between them is marched; a face that the segment crosses has a term of its
//! own, without which light from outside a medium has a wrong gradient and a sun none.

use glam::Vec3;

use super::marching_segments;
use crate::host::Medium;
use crate::math::quadrature::GAUSS_8;
use crate::math::{Ray, float};
use crate::spectrum::{Gradient, Spectrum};

/// Smallest `|m·u|` in the term of a face: at grazing crossings it has no bound.
const MIN_FACE_COSINE: f32 = 1e-3;

/// Most samples on one part between constant segments: beyond, a step is far below what `f32`
/// positions resolve, and a mistaken step length must not hang the host.
const MAX_SAMPLES: u32 = 1 << 16;

/// Free paths of a step of some length, by the bound of extinction. Larger: noise of `τ`, of its gradients and of where light collides, and what is seen through
/// dense smoke is too bright; smaller: time.
const FREE_PATHS: f32 = 1.0;

/// Free paths of a step from which on ends are sampled, too. Larger: light that gets into clouds from outside is too bright; smaller: two look-ups more for each ray
/// through thin smoke, for which nobody can tell.
const THICK: f32 = 0.5;

/// Part of a step by which samples for the ends of a part lie within it: at faces rounding takes it to either side.
const HAIR: f32 = 1e-3;

/// Segments after which a changing part is marched, so that an endless one can end where nothing is seen
/// through it.
const MAX_JOINED: usize = 256;

/// How finely a part of a ray where extinction changes is sampled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Steps {
    /// Steps of at most this length (m), and of at most a free path where fog is densest: `N = max(1, ⌈part · max(1/length, σₜ)⌉)`, `σₜ` (m⁻¹) a
    /// bound of extinction. Where a step of this length would be more than half a free path, both ends of the part are sampled, too.
    Length(f32),
    /// This many steps per part, whatever its length: the choice for finite differences. A part ends
    /// after 256 segments of the medium at the latest.
    Count(u32),
    /// This many panels of 8 Gauss–Legendre nodes per part; the offset is not used. For smooth media
    /// as good as exact.
    Gauss(u32),
}

/// How to march: steps, and the offset within them.
///
/// ```
/// # use fogbow::transmittance::thickness::{Marching, Steps};
/// let marching = Marching::new(0.1, 0.3);
/// assert_eq!((marching.steps, marching.offset), (Steps::Length(0.1), 0.3));
/// assert_eq!(marching.at(0.7), Marching { offset: 0.7, ..marching });
/// assert_eq!(Marching::midpoints(8), Marching { steps: Steps::Count(8), offset: 0.5 });
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Marching {
    /// How fine.
    pub steps: Steps,
    /// Where in each step the sample lies, in [0, 1): one random number per ray makes `τ` and its
    /// gradients unbiased; ½ is the midpoint rule.
    pub offset: f32,
}

impl Marching {
    /// Steps of at most `length` (m), see [`Steps::Length`], with a random `offset` in [0, 1).
    #[inline]
    #[must_use]
    pub const fn new(length: f32, offset: f32) -> Self {
        Self { steps: Steps::Length(length), offset }
    }

    /// A fixed number of steps per part, sampled in their middle.
    #[inline]
    #[must_use]
    pub const fn midpoints(count: u32) -> Self {
        Self { steps: Steps::Count(count), offset: 0.5 }
    }

    /// The same steps with another offset.
    #[inline]
    #[must_use]
    pub const fn at(self, offset: f32) -> Self {
        Self { offset, ..self }
    }

    /// Calls `visit(distance, weight, is_end)` for the samples of a part in which extinction (m⁻¹) is `densest` at most, one after the other, until it says that nothing is
    /// seen any more; the weights sum to its length. Where a step is thick, the first and the last are for its ends: what a sum is off by because all samples lie as far from
    /// the middle of their steps is `l (u − ½) (σ(until) − σ(from))` in the first order, `l` a step and `u` the offset, and taken away.
    #[inline]
    pub(super) fn samples(
        &self,
        (from, until, densest): (f32, f32, f32),
        mut visit: impl FnMut(f32, f32, bool) -> bool,
    ) {
        let extent = until - from;
        let (count, is_thick) = match self.steps {
            // A length that is not positive gives NaN or ∞; both end at the maximum or at 1.
            Steps::Length(length) => {
                (libm::ceilf(extent / length.min(FREE_PATHS / densest)) as u32, length * densest > THICK)
            }
            Steps::Count(count) | Steps::Gauss(count) => (count, false),
        };
        let count = count.clamp(1, MAX_SAMPLES);
        let step = extent / count as f32;
        let (tilt, hair) = (step * (self.offset - 0.5), HAIR * step);
        if is_thick {
            visit(from + hair, tilt, true);
        }
        for j in 0..count {
            if let Steps::Gauss(_) = self.steps {
                for (node, weight) in GAUSS_8 {
                    visit(from + (j as f32 + node) * step, weight * step, false);
                }
            } else if visit(from + (j as f32 + self.offset) * step, step, false) {
                return;
            }
        }
        if is_thick {
            visit(until - hair, -tilt, true);
        }
    }
}

/// Optical thickness with its gradients (m⁻¹) with respect to the origin of the ray.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Thickness {
    /// `τ`.
    pub value: Spectrum,
    /// `∇τ` with the far end held fixed: single scattering.
    pub gradient_fixed: Gradient,
    /// `∇τ` when the whole segment is translated: multiple scattering, and light from infinity.
    pub gradient_joint: Gradient,
}

/// Transmittance with its gradients (m⁻¹) with respect to the origin of the ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transmittance {
    /// `T = e^{−τ}`.
    pub value: Spectrum,
    /// `∇T` with the far end held fixed.
    pub gradient_fixed: Gradient,
    /// `∇T` when the whole segment is translated.
    pub gradient_joint: Gradient,
}

impl Thickness {
    /// That of a medium with `factor` times the extinction.
    pub(crate) fn scaled(&self, factor: f32) -> Self {
        Self {
            value: self.value * factor,
            gradient_fixed: self.gradient_fixed * factor,
            gradient_joint: self.gradient_joint * factor,
        }
    }

    /// `T = e^{−τ}`, `∇T = −T ∇τ`; where `τ` exceeds [`OPAQUE`](crate::math::float::OPAQUE) all three are 0.
    ///
    /// ```
    /// # use fogbow::{math::Vec3, spectrum::{Gradient, Spectrum}, transmittance::thickness::Thickness};
    /// let slope = Gradient::outer(Spectrum::splat(3.0), Vec3::X);
    /// let thickness = Thickness { value: Spectrum::splat(2.0), gradient_fixed: slope, gradient_joint: slope };
    /// let through = thickness.transmittance();
    /// assert!((through.value[0] - (-2.0_f32).exp()).abs() < 1e-6);
    /// assert_eq!(through.gradient_fixed.x, through.value * -3.0);   // ∇T = −T ∇τ
    /// ```
    #[inline]
    #[must_use]
    pub fn transmittance(&self) -> Transmittance {
        let value = self.value.transmitted();
        // 0 · ∞ must not become NaN behind an endless medium.
        let slope = |g: Spectrum| g.zip(value, |g, t| if t == 0.0 { 0.0 } else { -t * g });
        let gradient = |g: &Gradient| Gradient { x: slope(g.x), y: slope(g.y), z: slope(g.z) };
        Transmittance {
            value,
            gradient_fixed: gradient(&self.gradient_fixed),
            gradient_joint: gradient(&self.gradient_joint),
        }
    }
}

/// A part of a ray on which the medium is either constant or to be marched.
pub(super) enum Part {
    /// Extinction (m⁻¹) from one distance (m) to another.
    Constant { extinction: Spectrum, from: f32, until: f32 },
    /// With a bound of extinction.
    Changing { from: f32, until: f32, densest: f32 },
    /// Extinction without end: channels that are not 0 are opaque.
    Endless { extinction: Spectrum, from: f32 },
}

/// Most segments asked for where a medium ends.
const MOST_TO_END: usize = 8;

/// `ray`, cut off where the medium ends for good if it has no end itself; whole where that is not found soon.
pub(crate) fn until_the_end(ray: &Ray, medium: &(impl Medium + ?Sized)) -> Ray {
    if ray.length.is_infinite() {
        for (from, segment) in marching_segments(medium, ray).take(MOST_TO_END) {
            if segment.until.is_infinite() && segment.majorant.is_black() {
                return ray.with_length(from);
            }
        }
    }
    *ray
}

/// Splits a ray at the medium's constant segments; what lies between two of them is one part, or
/// several where it is long. Stops as soon as `visit(part, is_endless)` says so: on endless and very long rays, where nothing
/// is seen beyond. What lies behind the most [`segments`](super::segments()) there may be counts as vacuum.
#[inline]
pub(super) fn for_each_part(ray: &Ray, medium: &(impl Medium + ?Sized), mut visit: impl FnMut(Part, bool) -> bool) {
    let (mut end, mut changing_from, mut joined, mut densest) = (0.0_f32, None, 0, 0.0_f32);
    for (visited, (from, segment)) in marching_segments(medium, ray).enumerate() {
        let is_endless = ray.length.is_infinite() || visited > 16 * MAX_JOINED;
        let until = segment.until;
        let is_changing = until.is_finite() && !segment.is_constant();
        if !is_changing || joined >= MAX_JOINED {
            if let Some(start) = changing_from.take()
                && visit(Part::Changing { from: start, until: from, densest }, is_endless)
            {
                return;
            }
            (joined, densest) = (0, 0.0);
        }
        if until.is_infinite() {
            visit(Part::Endless { extinction: segment.majorant, from }, true);
            return;
        }
        if is_changing {
            changing_from = changing_from.or(Some(from));
            joined += 1;
            densest = densest.max(segment.majorant.max_element());
        } else if !segment.majorant.is_black()
            && visit(Part::Constant { extinction: segment.majorant, from, until }, is_endless)
        {
            return;
        }
        end = until;
    }
    if let Some(from) = changing_from {
        visit(Part::Changing { from, until: end, densest }, false);
    }
}

/// Whether nothing is seen through a thickness.
#[inline]
pub(super) fn is_opaque(thickness: Spectrum) -> bool {
    thickness.min_element() > float::OPAQUE
}

#[inline]
pub(super) fn endless(extinction: Spectrum) -> Spectrum {
    extinction.map(|c| if c > 0.0 { f32::INFINITY } else { 0.0 })
}

/// Optical thickness along `ray`.
///
/// ```text
/// τ = ∫ σₜ ds,   marched where extinction changes, at (j + ξ)/N
/// ```
///
/// Exact on constant segments; elsewhere unbiased for a random offset. A ray that never leaves
/// the medium is infinitely thick in the channels where its last segment may be anything but vacuum;
/// where extinction changes, and where bounds have no last segment (noise), the sum ends once every channel exceeds
/// [`OPAQUE`](crate::math::float::OPAQUE), or after 65536 segments.
/// 0 for a ray without length. Source: Jarosz et al. 2008, Eq. 16 and 21.
///
/// ```
/// # use fogbow::{math::{Ray, Vec3}, medium::Homogeneous, phase::Lobe, spectrum::Spectrum};
/// # use fogbow::transmittance::thickness::{Marching, optical_thickness};
/// let fog = Homogeneous::new(Spectrum::splat(0.1), Spectrum::splat(0.4), Lobe::Isotropic).unwrap();
/// let ray = Ray::between(Vec3::ZERO, Vec3::new(0.0, 0.0, 4.0));
/// assert_eq!(optical_thickness(&ray, &fog, Marching::new(0.1, 0.5))[0], 2.0);
/// ```
#[must_use]
pub fn optical_thickness(ray: &Ray, medium: &(impl Medium + ?Sized), marching: Marching) -> Spectrum {
    let mut value = Spectrum::ZERO;
    for_each_part(ray, medium, |part, is_endless| {
        match part {
            Part::Constant { extinction, from, until } => value += extinction * (until - from),
            Part::Changing { from, until, densest } => {
                marching.samples((from, until, densest), |t, weight, _| {
                    value += medium.extinction(ray.at(t)) * weight;
                    is_opaque(value)
                });
            }
            Part::Endless { extinction, .. } => value += endless(extinction),
        }
        is_endless && is_opaque(value)
    });
    value.max(Spectrum::ZERO)
}

/// [`optical_thickness`] with both gradients, from the same samples.
///
/// ```text
/// fixed far end:  ∇τ = ∫ (1 − s/r) ∇σₜ ds + u τ/r + Σ (1 − sₑ/r) Δσ m/|m·u|
/// joint:          ∇τ = ∫ ∇σₜ ds                   + Σ Δσ m/|m·u|
/// ```
///
/// with `u = −direction`, and the sums over the faces crossed (outward normal `m`, jump `Δσ` along
/// it). For an infinite ray both are the same. Exact on constant segments, else as noisy as the
/// marching; 0 for a ray without length. Sources: Jarosz et al. 2008, Eq. 17–22; faces: sheet § 1.4.
///
/// ```
/// # use fogbow::{math::{Ray, Vec3}, medium::Homogeneous, phase::Lobe, spectrum::{Gradient, Spectrum}};
/// # use fogbow::transmittance::thickness::{Marching, optical_thickness_with_gradients};
/// let fog = Homogeneous::new(Spectrum::splat(0.1), Spectrum::splat(0.4), Lobe::Isotropic).unwrap();
/// let ray = Ray::between(Vec3::ZERO, Vec3::new(0.0, 0.0, 4.0));
/// let thickness = optical_thickness_with_gradients(&ray, &fog, Marching::new(0.1, 0.5));
/// assert_eq!(thickness.gradient_fixed.z[0], -0.5);            // nearer to the far end, less fog
/// assert_eq!(thickness.gradient_joint, Gradient::ZERO);        // the same fog everywhere
/// ```
#[must_use]
pub fn optical_thickness_with_gradients(ray: &Ray, medium: &(impl Medium + ?Sized), marching: Marching) -> Thickness {
    let mut sum = Thickness::default();
    // NaN fails, too.
    if !(ray.length > 0.0) {
        return sum;
    }
    // 0 for an infinite ray: then the far end moves along, as it were.
    let inverse = 1.0 / ray.length;
    for_each_part(ray, medium, |part, is_endless| {
        match part {
            Part::Constant { extinction, from, until } => sum.value += extinction * (until - from),
            Part::Changing { from, until, densest } => marching.samples((from, until, densest), |t, weight, _| {
                let (extinction, gradient) = medium.extinction_with_gradient(ray.at(t));
                sum.value += extinction * weight;
                let slope = gradient * weight;
                sum.gradient_joint += slope;
                sum.gradient_fixed += slope * (1.0 - t * inverse);
                is_opaque(sum.value)
            }),
            Part::Endless { extinction, .. } => sum.value += endless(extinction),
        }
        is_endless && is_opaque(sum.value)
    });
    sum.value = sum.value.max(Spectrum::ZERO);
    if inverse > 0.0 {
        // Scaled before the product, so that tiny lengths do not lose it.
        sum.gradient_fixed += Gradient::outer(sum.value * inverse, -ray.direction);
    }
    medium.faces(ray, &mut |face| {
        let term = face_term(ray.direction, face.normal, face.jump);
        sum.gradient_joint += term;
        sum.gradient_fixed += term * (1.0 - (face.distance * inverse).clamp(0.0, 1.0));
    });
    sum
}

/// `Δσ m / |m·u|`: how much thickness a face brings per metre that the segment moves.
#[inline]
pub(super) fn face_term(direction: Vec3, normal: Vec3, jump: Spectrum) -> Gradient {
    Gradient::outer(jump, normal / normal.dot(direction).abs().max(MIN_FACE_COSINE))
}

/// Transmittance along `ray`: `e^{−τ}`, 0 beyond [`OPAQUE`](crate::math::float::OPAQUE).
///
/// By Jensen's inequality slightly too high in the mean where extinction changes within a step: without ends in the first order of the step by up to
/// `sinh(x/2)/(x/2) − 1` for `x` free paths in it (Euler–Maclaurin), 1 % with [`Steps::Length`] (decisions 89 and 120). Ratio tracking is unbiased.
///
/// ```
/// # use fogbow::{host::Empty, math::{Ray, Vec3}, spectrum::Spectrum};
/// # use fogbow::transmittance::thickness::{Marching, transmittance};
/// let ray = Ray::new(Vec3::ZERO, Vec3::X);
/// assert_eq!(transmittance(&ray, &Empty, Marching::midpoints(8)), Spectrum::ONE);
/// ```
#[must_use]
pub fn transmittance(ray: &Ray, medium: &(impl Medium + ?Sized), marching: Marching) -> Spectrum {
    optical_thickness(ray, medium, marching).transmitted()
}

/// [`transmittance`] with both gradients: `∇T = −T ∇τ`.
///
/// ```
/// # use fogbow::{math::{Ray, Vec3}, medium::Homogeneous, phase::Lobe, spectrum::Spectrum};
/// # use fogbow::transmittance::thickness::{Marching, transmittance_with_gradients};
/// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Lobe::Isotropic).unwrap();
/// let ray = Ray::between(Vec3::ZERO, Vec3::X);
/// let t = transmittance_with_gradients(&ray, &fog, Marching::midpoints(8));
/// assert_eq!(t.gradient_fixed.x, t.value);   // d/dx e^{−(1 − x)}
/// ```
#[must_use]
pub fn transmittance_with_gradients(ray: &Ray, medium: &(impl Medium + ?Sized), marching: Marching) -> Transmittance {
    optical_thickness_with_gradients(ray, medium, marching).transmittance()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host::{MajorantSegment, Properties};
    use crate::transmittance::marched::march;

    /// Fog where x lies between the first two numbers, or the next two.
    struct Slabs([f32; 4]);

    impl Medium for Slabs {
        fn properties(&self, _: Vec3) -> Properties {
            Properties::VACUUM
        }
        fn majorant_segment(&self, ray: &Ray, from: f32) -> MajorantSegment {
            let passed = self.0.iter().filter(|face| **face - ray.origin.x <= from).count();
            let until = self.0.get(passed).map_or(f32::INFINITY, |face| face - ray.origin.x);
            let extinction = Spectrum::splat(if passed % 2 == 1 { 1.0 } else { 0.0 });
            MajorantSegment { until, minorant: extinction, majorant: extinction }
        }
    }

    /// Fog that becomes denser along x, from nothing at 0 to 8 m⁻¹ at 1, like a power of it.
    struct Ramp(f32);

    impl Medium for Ramp {
        fn properties(&self, point: Vec3) -> Properties {
            Properties { absorption: Spectrum::splat(8.0 * libm::powf(point.x, self.0)), ..Properties::VACUUM }
        }
        fn majorant_segment(&self, _: &Ray, _: f32) -> MajorantSegment {
            MajorantSegment { until: 1.0, minorant: Spectrum::ZERO, majorant: Spectrum::splat(8.0) }
        }
    }

    const OUT_OF_IT: Ray = Ray { origin: Vec3::X, direction: Vec3::NEG_X, length: 1.0 };

    fn offsets() -> impl Iterator<Item = f32> {
        (0..64).map(|i| (i as f32 + 0.5) / 64.0)
    }

    /// Steps of a free path would be off by up to half a free path, if ends did not count.
    #[test]
    fn ends_take_away_what_offsets_bring() {
        for length in [0.0626, 0.1, 1.0] {
            for offset in offsets() {
                let marching = Marching { steps: Steps::Length(length), offset };
                let thickness = optical_thickness(&OUT_OF_IT, &Ramp(1.0), marching)[0];
                assert!((thickness - 4.0).abs() <= HAIR, "{length} {offset}: {thickness}");
                let collided = march(&OUT_OF_IT, &Ramp(1.0), marching, 0.5, true);
                assert!((collided.whole.unwrap().value[0] - thickness).abs() < 1e-5);
            }
        }
        let few = Marching { steps: Steps::Count(8), offset: 0.01 };
        assert!((optical_thickness(&OUT_OF_IT, &Ramp(1.0), few)[0] - 4.0).abs() > 0.4);
    }

    /// One step of a metre is off by up to four free paths, and what comes through is 6.8 times too bright.
    #[test]
    fn what_comes_out_of_dense_fog_is_not_too_bright_where_steps_are_long() {
        let through = |steps, power, due: f32| {
            let seen = |offset| transmittance(&OUT_OF_IT, &Ramp(power), Marching { steps, offset })[0];
            offsets().map(seen).sum::<f32>() / 64.0 / (-due).exp()
        };
        for (power, due) in [(1.0, 4.0), (3.0, 2.0), (7.0, 1.0)] {
            let light = through(Steps::Length(1.0), power, due);
            assert!((light - 1.0).abs() < 0.01, "{power}: {light}");
        }
        assert!(through(Steps::Count(1), 1.0, 4.0) > 6.0);
        // Shorter steps are as they were asked for.
        assert_eq!(through(Steps::Length(0.01), 1.0, 4.0), through(Steps::Count(100), 1.0, 4.0));
    }

    #[test]
    fn nothing_is_thinner_than_nothing() {
        // Where all that is not at the end counts as little as it may.
        for offset in offsets() {
            let marching = Marching { steps: Steps::Length(1.0), offset };
            let thickness = optical_thickness(&OUT_OF_IT, &Ramp(80.0), marching)[0];
            assert!((0.0..0.8).contains(&thickness), "{offset}: {thickness}");
        }
    }

    #[test]
    fn endless_rays_end_where_the_medium_does_and_no_others_change() {
        let slabs = Slabs([1.0, 2.0, 3.0, 5.0]);
        let ray = Ray::new(Vec3::ZERO, Vec3::X);
        assert_eq!(until_the_end(&ray, &slabs).length, 5.0);
        assert_eq!(until_the_end(&Ray::new(Vec3::X * 7.0, Vec3::X), &slabs).length, 0.0);
        for length in [1.5, 100.0] {
            assert_eq!(until_the_end(&ray.with_length(length), &slabs).length, length);
        }
        assert_eq!(until_the_end(&ray, &Slabs([1.0, 2.0, 3.0, f32::INFINITY])).length, f32::INFINITY);
    }
}
