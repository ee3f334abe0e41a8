//! Free flights and transmittance by null collisions.
//!
//! Delta tracking (Woodcock et al. 1965) and residual ratio tracking (Novák et al. 2014) over the
//! bounds that [`Medium::majorant_segment`] gives; coloured extinction by one-sample multiple importance
//! sampling over the channels (Wilkie et al. 2014; Miller et al. 2019). On constant segments both
//! turn into closed forms without a special case.

use super::segments;
use crate::host::{Medium, Properties, Rng};
use crate::math::{Ray, float};
use crate::sampling::{Generator, uniform};
use crate::spectrum::Spectrum;

/// Most tentative collisions within one segment: bounds so loose that a walk takes more move it less
/// than `f32` positions resolve.
const MAX_COLLISIONS: u32 = 1 << 22;

/// Tentative collisions expected at least on a segment of an emissive medium: where there is light
/// but hardly extinction, collisions alone would never see it.
const EMISSION_SAMPLES: f32 = 2.0;

/// Bounds (m⁻¹) down to this are vacuum: on segments without end, all that is no extinction at all
/// but marks emission, which would be infinitely bright there.
#[inline]
fn vacuum_bound(end: f32) -> f32 {
    if end.is_finite() { 0.0 } else { 1e-30 }
}

/// Least bound (m⁻¹) for tentative collisions on a segment.
#[inline]
fn floor_of(is_emissive: bool, length: f32) -> f32 {
    if is_emissive { (EMISSION_SAMPLES / length).min(1e30) } else { 0.0 }
}

/// A flight through a medium up to its next collision.
#[derive(Debug, Clone, Copy)]
pub struct Flight {
    /// Where it ended (m): at the collision, or at the ray's length.
    pub distance: f32,
    /// Properties at the collision; `None` if the ray's end was reached.
    pub collision: Option<Properties>,
    /// Transmittance (times extinction, for a collision) over density: 1 in grey media. The albedo
    /// is not in it.
    pub weight: Spectrum,
    /// Light emitted along the way (W·m⁻²·sr⁻¹), an unbiased estimate of `∫ T ε dt`.
    pub emission: Spectrum,
    /// Where the medium began and ended along the flight (m); equal if there was none.
    pub span: (f32, f32),
}

impl Flight {
    /// The flight to the end of `ray` as if there were no medium.
    ///
    /// ```
    /// # use fogbow::{math::{Ray, Vec3}, spectrum::Spectrum, transmittance::Flight};
    /// let clear = Flight::through(&Ray::between(Vec3::ZERO, 2.0 * Vec3::X));
    /// assert!(clear.collision.is_none() && clear.distance == 2.0 && clear.weight == Spectrum::ONE);
    /// ```
    #[inline]
    #[must_use]
    pub fn through(ray: &Ray) -> Self {
        let (distance, weight, emission) = (ray.length, Spectrum::ONE, Spectrum::ZERO);
        Self { distance, collision: None, weight, emission, span: (distance, distance) }
    }
}

/// Flies along `ray` until a collision or the ray's end.
///
/// `throughput` weighs the channels where extinction is coloured; `u` decides the first tentative
/// collision, so that stratified numbers keep their strata; later ones draw from `rng`.
///
/// ```
/// # use fogbow::{math::*, medium::Homogeneous, phase::Lobe, sampling::Generator, spectrum::Spectrum};
/// # use fogbow::transmittance::flight;
/// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::splat(2.0), Lobe::Isotropic)?;
/// let ray = Ray::new(Vec3::ZERO, Vec3::X);
/// let flown = flight(&fog, &ray, Spectrum::ONE, 0.5, &mut Generator::new(1));
/// assert!((flown.distance - 0.5 * core::f32::consts::LN_2).abs() < 1e-6);   // the median
/// # Ok::<(), fogbow::medium::MediumError>(())
/// ```
#[inline]
pub fn flight(medium: &(impl Medium + ?Sized), ray: &Ray, throughput: Spectrum, u: f32, rng: &mut Generator) -> Flight {
    if medium.is_grey() { grey(medium, ray, u, rng) } else { coloured(medium, ray, throughput, u, rng) }
}

/// Optical thickness of an exponential step. `1 − u` is exact for the multiples of 2⁻²⁴ that uniform
/// numbers are, so the plain logarithm is as good as `ln_1p` here, and twice as fast.
#[inline]
fn step(u: f32) -> f32 {
    -float::ln(1.0 - u)
}

/// Bookkeeping of the part of a ray that holds a medium.
struct Span(Option<(f32, f32)>);

impl Span {
    #[inline]
    fn extend(&mut self, from: f32, to: f32) {
        let start = self.0.map_or(from, |s| s.0);
        self.0 = Some((start, to));
    }

    #[inline]
    fn finish(self, end: f32) -> (f32, f32) {
        self.0.unwrap_or((end, end))
    }
}

fn grey(medium: &(impl Medium + ?Sized), ray: &Ray, u: f32, rng: &mut Generator) -> Flight {
    let emissive = medium.is_emissive();
    let mut emission = Spectrum::ZERO;
    let mut span = Span(None);
    // Optical thickness up to the next tentative collision; what a segment does not use up is
    // carried into the next.
    let mut thickness = step(u);
    for (from, segment) in segments(medium, ray) {
        let end = segment.until;
        if segment.majorant[0] > vacuum_bound(end) {
            let bound = float::max(segment.majorant[0], floor_of(emissive, end - from));
            let sure = segment.minorant[0];
            let inverse = 1.0 / bound;
            let mut t = from;
            for _ in 0..MAX_COLLISIONS {
                let length = thickness * inverse;
                if !(t + length < end) {
                    thickness = float::max(thickness - (end - t) * bound, 0.0);
                    break;
                }
                t += length;
                let point = ray.at(t);
                if emissive {
                    emission += medium.properties(point).emission * inverse;
                }
                // Below the minorant a collision is real without a look.
                let level = if sure < bound { uniform(rng) * bound } else { 0.0 };
                if level < sure || level < medium.extinction(point)[0] {
                    let properties = medium.properties(point);
                    span.extend(from, t);
                    return Flight {
                        distance: t,
                        collision: Some(properties),
                        weight: Spectrum::ONE,
                        emission,
                        span: span.finish(t),
                    };
                }
                thickness = step(uniform(rng));
            }
            span.extend(from, end);
        }
    }
    Flight { distance: ray.length, collision: None, weight: Spectrum::ONE, emission, span: span.finish(ray.length) }
}

fn coloured(medium: &(impl Medium + ?Sized), ray: &Ray, throughput: Spectrum, u: f32, rng: &mut Generator) -> Flight {
    let emissive = medium.is_emissive();
    let total = throughput[0] + throughput[1] + throughput[2];
    let share = if total > 0.0 { throughput / total } else { Spectrum::splat(1.0 / 3.0) };
    let mut pick = uniform(rng);
    let channel = (0..3)
        .find(|&c| {
            pick -= share[c];
            pick < 0.0
        })
        .unwrap_or_else(|| (0..3).max_by(|&a, &b| share[a].total_cmp(&share[b])).unwrap_or(0));
    // Density of the flight so far in each channel over that in the chosen one.
    let mut relative = Spectrum::ONE;
    let mixture = |relative: Spectrum| (share * relative).0.iter().sum::<f32>();
    let mut emission = Spectrum::ZERO;
    let mut span = Span(None);
    let mut thickness = step(u);
    for (from, segment) in segments(medium, ray) {
        let end = segment.until;
        if segment.majorant.max_element() > vacuum_bound(end) {
            let floor = floor_of(emissive, end - from);
            let majorant = segment.majorant.map(|c| float::max(c, floor));
            let is_sure = segment.is_constant() && majorant == segment.majorant;
            let bound = majorant[channel];
            let mut t = from;
            for _ in 0..MAX_COLLISIONS {
                let length = if bound > 0.0 { thickness / bound } else { f32::INFINITY };
                let travelled = float::min(length, end - t);
                relative = passed(relative, majorant, channel, travelled);
                if !(t + length < end) {
                    thickness = float::max(thickness - (end - t) * bound, 0.0);
                    break;
                }
                t += length;
                let properties = medium.properties(ray.at(t));
                if emissive {
                    let density = mixture(relative * majorant);
                    emission += properties.emission * relative / density;
                }
                let mut extinction = properties.extinction();
                // At a face the point may be rounded to its other side; what was promised is what counts.
                if is_sure && !(extinction[channel] > 0.0) {
                    extinction = majorant;
                }
                if is_sure || uniform(rng) * bound < extinction[channel] {
                    relative = bounded(relative * (extinction / extinction[channel]));
                    span.extend(from, t);
                    return Flight {
                        distance: t,
                        collision: Some(properties),
                        weight: relative / mixture(relative),
                        emission,
                        span: span.finish(t),
                    };
                }
                let null = (majorant - extinction).max(Spectrum::ZERO);
                relative = bounded(relative * (null / null[channel]));
                thickness = step(uniform(rng));
            }
            span.extend(from, end);
        }
    }
    let weight = relative / mixture(relative);
    Flight { distance: ray.length, collision: None, weight, emission, span: span.finish(ray.length) }
}

/// A ratio of densities too large to matter: the mixture's weight then saturates at 1/share.
#[inline]
fn bounded(relative: Spectrum) -> Spectrum {
    relative.map(|r| float::min(r, 1e30))
}

/// Densities after a step without tentative collision, relative to the chosen channel's.
#[inline]
fn passed(relative: Spectrum, majorant: Spectrum, channel: usize, distance: f32) -> Spectrum {
    if distance.is_infinite() {
        // Only channels without extinction get through to infinity.
        return relative.zip(majorant, |r, m| if m > majorant[channel] { 0.0 } else { r });
    }
    let difference = (majorant - Spectrum::splat(majorant[channel])) * distance;
    // A ratio beyond e⁸⁰ overflows.
    bounded(relative.zip(difference, |r, d| r * float::exp((-d).clamp(-80.0, 80.0))))
}

/// Unbiased estimate of the transmittance along `ray`; exact where the medium is constant.
///
/// Residual ratio tracking (Novák et al. 2014) with the minorant as control:
///
/// ```text
/// T = e^{−∫σ_min dt} · Π (1 − (σₜ(t_i) − σ_min)/(σ_max − σ_min))
/// ```
///
/// Where little is left, roulette ends the walk without bias.
///
/// ```
/// # use fogbow::{math::*, medium::Homogeneous, phase::Lobe, sampling::Generator, spectrum::Spectrum};
/// # use fogbow::transmittance::transmittance;
/// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::splat(0.5), Lobe::Isotropic)?;
/// let ray = Ray::between(Vec3::ZERO, Vec3::new(0.0, 2.0, 0.0));
/// let t = transmittance(&fog, &ray, &mut Generator::new(1));
/// assert!((t[0] - (-1.0f32).exp()).abs() < 1e-6);
/// # Ok::<(), fogbow::medium::MediumError>(())
/// ```
#[inline]
pub fn transmittance(medium: &(impl Medium + ?Sized), ray: &Ray, rng: &mut (impl Rng + ?Sized)) -> Spectrum {
    if medium.is_grey() {
        Spectrum::splat(grey_transmittance(medium, ray, rng))
    } else {
        coloured_transmittance(medium, ray, rng)
    }
}

/// Below this, [`transmittance`] plays roulette with survival probability one half.
const ROULETTE_BELOW: f32 = 0.05;

fn grey_transmittance(medium: &(impl Medium + ?Sized), ray: &Ray, rng: &mut (impl Rng + ?Sized)) -> f32 {
    let mut closed = 0.0;
    let mut ratio = 1.0;
    for (from, segment) in segments(medium, ray) {
        let end = segment.until;
        let (low, high) = (segment.minorant[0], segment.majorant[0]);
        if low > 0.0 {
            closed += low * (end - from);
            if closed > float::OPAQUE {
                return 0.0;
            }
        }
        let range = high - low;
        if range > 0.0 {
            let inverse = 1.0 / range;
            let mut t = from;
            for _ in 0..MAX_COLLISIONS {
                t += step(uniform(rng)) * inverse;
                if !(t < end) {
                    break;
                }
                ratio *= 1.0 - (medium.extinction(ray.at(t))[0] - low) * inverse;
                if ratio < ROULETTE_BELOW {
                    if uniform(rng) < 0.5 {
                        return 0.0;
                    }
                    ratio *= 2.0;
                }
            }
        }
    }
    if closed > 0.0 { ratio * float::exp(-closed) } else { ratio }
}

fn coloured_transmittance(medium: &(impl Medium + ?Sized), ray: &Ray, rng: &mut (impl Rng + ?Sized)) -> Spectrum {
    let mut closed = Spectrum::ZERO;
    let mut ratio = Spectrum::ONE;
    for (from, segment) in segments(medium, ray) {
        let end = segment.until;
        let (low, high) = (segment.minorant, segment.majorant);
        // 0 · ∞ in vacuum would be NaN.
        closed += low.map(|c| if c > 0.0 { c * (end - from) } else { 0.0 });
        if closed.min_element() > float::OPAQUE {
            return Spectrum::ZERO;
        }
        let range = (high - low).max_element();
        if range > 0.0 {
            let inverse = 1.0 / range;
            let mut t = from;
            for _ in 0..MAX_COLLISIONS {
                t += step(uniform(rng)) * inverse;
                if !(t < end) {
                    break;
                }
                ratio *= Spectrum::ONE - (medium.extinction(ray.at(t)) - low) * inverse;
                if ratio.max_element() < ROULETTE_BELOW {
                    if uniform(rng) < 0.5 {
                        return Spectrum::ZERO;
                    }
                    ratio *= 2.0;
                }
            }
        }
    }
    ratio * closed.transmitted()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host::MajorantSegment;
    use crate::math::Vec3;

    /// Says that it is even fog and is vacuum where it is looked at: as at a face, where a point is rounded to the other side.
    struct Face;

    const EXTINCTION: Spectrum = Spectrum::new(0.5, 1.0, 2.0);

    impl Medium for Face {
        fn properties(&self, _: Vec3) -> Properties {
            Properties::VACUUM
        }
        fn majorant_segment(&self, _: &Ray, _: f32) -> MajorantSegment {
            MajorantSegment { until: f32::INFINITY, minorant: EXTINCTION, majorant: EXTINCTION }
        }
    }

    #[test]
    fn collisions_on_a_face_weigh_what_those_beside_it_do() {
        let (ray, rng) = (Ray::new(Vec3::ZERO, Vec3::X), &mut Generator::new(1));
        for _ in 0..1000 {
            let u = uniform(rng);
            let flown = flight(&Face, &ray, Spectrum::ONE, u, rng);
            // Transmittance times extinction over its mean, which is the density.
            let here = EXTINCTION * (EXTINCTION * flown.distance).transmitted();
            let expected = here / here.mean();
            assert!(flown.collision.is_some());
            assert!((flown.weight - expected).map(f32::abs).max_element() < 1e-5, "{flown:?} {expected:?}");
        }
    }
}
