//! Beams, cut into pieces.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use crate::host::{Medium, Rng, Scene};
use crate::math::{Bounds, Ray, float};
use crate::path::Settings;
use crate::photon::{self, Event};
use crate::sampling::{Generator, uniform};
use crate::spectrum::Spectrum;
use crate::transmittance::segments;
use crate::world::World;

/// Below this share of a beam's power at its start, roulette ends it with probability one half.
const ROULETTE_BELOW: f32 = 0.05;

/// Pieces of one beam at most: endless beams in fog without end stop there.
const MAX_PIECES: u32 = 1 << 16;

/// A straight part of a beam along which power falls by one exponential.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Piece {
    /// Where it starts (m).
    pub origin: Vec3,
    /// How long it is (m).
    pub length: f32,
    /// Where light flies (unit).
    pub direction: Vec3,
    /// How often its light was scattered before.
    pub scatterings: u32,
    /// Power (W) at its start, of all light that one path stands for.
    pub power: Spectrum,
    /// Extinction (m⁻¹) by which power falls along it: `power · e^{−rate·l}`.
    pub rate: Spectrum,
    /// Radius (m) of its blur, which carries its light.
    pub radius: f32,
    /// Nothing; it fills 64 bytes.
    pub padding: u32,
}

impl Piece {
    /// Where it ends (m).
    ///
    /// ```
    /// # use fogbow::{beams::Piece, math::Vec3};
    /// let piece = Piece { origin: Vec3::X, length: 2.0, direction: Vec3::Z, ..Piece::default() };
    /// assert_eq!(piece.end(), Vec3::new(1.0, 0.0, 2.0));
    /// ```
    #[inline]
    #[must_use]
    pub fn end(&self) -> Vec3 {
        self.origin + self.direction * self.length
    }

    /// Gives it the radius (m) that `radius` tells for the points along it, cut into parts where that changes
    /// by more than half, but not shorter than they are wide.
    ///
    /// Kernels belong to beams, not to eye rays: so all light of a beam stays in the picture, however radii change.
    ///
    /// ```
    /// # use fogbow::{beams::Piece, math::Vec3, spectrum::Spectrum};
    /// let beam = Piece { length: 1.0, direction: Vec3::X, power: Spectrum::ONE, ..Piece::default() };
    /// let mut parts = Vec::new();
    /// beam.widened(&|point: Vec3| if point.x < 0.5 { 0.01 } else { 0.1 }, &mut |part| parts.push(part));
    /// assert!(parts.len() > 1 && parts.first().unwrap().radius == 0.01 && parts.last().unwrap().radius == 0.1);
    /// assert!((parts.iter().map(|part| part.length).sum::<f32>() - 1.0).abs() < 1e-6);
    /// ```
    pub fn widened(self, radius: &impl Fn(Vec3) -> f32, keep: &mut impl FnMut(Self)) {
        let ends = (radius(self.origin), radius(self.end()));
        self.widened_between(ends, radius, keep);
    }

    /// Keeps a piece that is wider than `radius` (m) with a probability `q`, and its power over `q` then: roulette, by
    /// which the expected light stays exactly the same. `u` is a uniform number in [0, 1).
    ///
    /// ```text
    /// q = √(radius / r),    r the piece's own radius
    /// ```
    ///
    /// A piece crosses eye rays in proportion to `r`, and each crossing costs the same. Many crossings are of one path,
    /// whose light varies together: fewer of them are hardly noisier. The root is fogbow's own choice, by measurement.
    ///
    /// ```
    /// # use fogbow::{beams::Piece, spectrum::Spectrum};
    /// let wide = Piece { radius: 0.4, power: Spectrum::ONE, ..Piece::default() };
    /// assert_eq!(wide.thinned(0.5, 0.99), Some(wide));
    /// assert_eq!(wide.thinned(0.1, 0.6), None);
    /// assert!((wide.thinned(0.1, 0.4).unwrap().power[0] - 2.0).abs() < 1e-6);
    /// ```
    #[inline]
    #[must_use]
    pub fn thinned(self, radius: f32, u: f32) -> Option<Self> {
        if self.radius <= radius {
            return Some(self);
        }
        let kept = float::sqrt(radius / self.radius);
        (u < kept).then(|| Self { power: self.power * (1.0 / kept), ..self })
    }

    fn widened_between(self, ends: (f32, f32), radius: &impl Fn(Vec3) -> f32, keep: &mut impl FnMut(Self)) {
        let half = 0.5 * self.length;
        let middle = radius(self.origin + self.direction * half);
        let (low, high) = (middle.min(ends.0).min(ends.1), middle.max(ends.0).max(ends.1));
        if high > 1.5 * low && half > low {
            let first = Self { length: half, ..self };
            let power = self.power * (self.rate * half).transmitted();
            let second = Self { origin: first.end(), length: self.length - half, power, ..self };
            first.widened_between((ends.0, middle), radius, keep);
            second.widened_between((middle, ends.1), radius, keep);
        } else {
            keep(Self { radius: middle, ..self });
        }
    }
}

/// Cuts a beam along `reach`, whose power is `power` (W) at its start, into pieces where there is a medium.
///
/// Residual ratio tracking (Novák et al. 2014) with the minorant as control: pieces follow the minorant's
/// exponential and end at tentative collisions, where power is multiplied by `1 − (σₜ − σ_min)/(σ_max − σ_min)`.
/// The expected power at every point is the exact one; in constant media every power is. Pieces longer than
/// `longest` (m) are cut, so that boxes around them fit; what is weak ends by roulette. [`Piece::scatterings`] is left
/// at 0, for the caller to fill in.
///
/// ```
/// # use fogbow::{beams, math::*, medium::Homogeneous, phase::Lobe, sampling::Generator, spectrum::Spectrum};
/// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::splat(0.5), Lobe::Isotropic)?;
/// let (reach, mut found) = (Ray::between(Vec3::ZERO, Vec3::Z), Vec::new());
/// beams::pieces(&fog, &reach, Spectrum::ONE, 0.75, &mut Generator::new(1), &mut |piece| found.push(piece));
/// assert_eq!((found.len(), found[0].length, found[1].length), (2, 0.75, 0.25));
/// assert!((found[1].power[0] - (-0.375f32).exp()).abs() < 1e-6);
/// # Ok::<(), fogbow::medium::MediumError>(())
/// ```
pub fn pieces(
    medium: &(impl Medium + ?Sized),
    reach: &Ray,
    power: Spectrum,
    longest: f32,
    rng: &mut Generator,
    keep: &mut impl FnMut(Piece),
) {
    let weak = ROULETTE_BELOW * power.max_element();
    let mut power = power;
    let mut left = MAX_PIECES;
    for (from, segment) in segments(medium, reach) {
        if segment.majorant.max_element() <= 0.0 {
            continue;
        }
        let (low, range) = (segment.minorant, (segment.majorant - segment.minorant).max_element());
        let (mut t, end) = (from, segment.until);
        while t < end {
            if left == 0 {
                return;
            }
            let step = if range > 0.0 { -float::ln(1.0 - uniform(rng)) / range } else { f32::INFINITY };
            let tentative = t + step;
            let next = tentative.min(end);
            loop {
                let until = (t + longest).min(next);
                let length = until - t;
                if length > 0.0 {
                    let (origin, direction) = (reach.at(t), reach.direction);
                    keep(Piece { origin, length, direction, power, rate: low, ..Piece::default() });
                    power *= (low * length).transmitted();
                }
                left = left.saturating_sub(1);
                // A step too small for the distance so far is one to the end.
                t = if until > t { until } else { next };
                if power.max_element() < weak {
                    if uniform(rng) < 0.5 {
                        return;
                    }
                    power *= 2.0;
                }
                if !(t < next) || left == 0 {
                    break;
                }
            }
            if tentative < end {
                power *= Spectrum::ONE - (medium.extinction(reach.at(t)) - low) / range;
                if !(power.max_element() > 0.0) {
                    return;
                }
            }
        }
    }
}

/// Sends one photon from the lights ([`photon::trace`](photon::trace())) and gives the pieces of its beams to
/// `keep`: of every flight the whole way to the surface ahead, also where the photon collides before, because
/// beams hold the probability of getting there in their power. Takes one path; [`Beams::build`]
/// is told how many there were.
///
/// Light of a beam is scattered once more on its way to the eye, so [`Settings::max_scatterings`] bounds
/// what eyes see.
///
/// ```
/// # use fogbow::{beams, host::Empty, light::{Light, PointLight}, math::*, medium::Homogeneous, phase::Lobe};
/// # use fogbow::{path::Settings, sampling::Generator, spectrum::Spectrum, world::World};
/// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Lobe::Isotropic)?;
/// let lamps = [Light::Point(PointLight::from_flux(Vec3::ZERO, Spectrum::ONE)?)];
/// let world = World { medium: &fog, scene: &Empty, lights: (&lamps).into() };
/// let bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
/// let settings = Settings { max_scatterings: 2, ..Settings::default() };
/// let mut most = 0;
/// beams::shoot(&world, &bounds, &settings, 0.5, &mut Generator::new(1), &mut |piece| most = most.max(piece.scatterings));
/// assert_eq!(most, 1);
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
///
/// [`Beams::build`]: super::Beams::build
pub fn shoot<M: Medium + ?Sized, S: Scene + ?Sized>(
    world: &World<'_, M, S>,
    bounds: &Bounds,
    settings: &Settings,
    longest: f32,
    rng: &mut (impl Rng + ?Sized),
    keep: &mut impl FnMut(Piece),
) {
    let mut child = Generator::child(rng);
    let mut scatterings = 0;
    photon::trace(world, bounds, settings, rng, &mut |event| match *event {
        Event::Emitted { .. } => scatterings = 0,
        Event::Flew { reach, power, .. } => {
            pieces(world.medium, reach, power, longest, &mut child, &mut |piece| keep(Piece { scatterings, ..piece }));
        }
        Event::Collided { .. } | Event::Met { .. } => scatterings += 1,
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_piece_is_plain_data_of_64_bytes() {
        assert_eq!((size_of::<Piece>(), align_of::<Piece>()), (64, 4));
        let piece = Piece { length: 2.0, direction: Vec3::Y, ..Piece::default() };
        let bytes: &[u8] = bytemuck::bytes_of(&piece);
        assert_eq!(*bytemuck::from_bytes::<Piece>(bytes), piece);
        assert_eq!(piece.end(), Vec3::Y * 2.0);
    }
}
