//! What power photons stand for along a flight.

use crate::host::Medium;
use crate::math::Ray;
use crate::spectrum::Spectrum;
use crate::transmittance::marching_segments;

/// Pieces of a free path of the densest channel. Fewer: power within a piece is off by the 24th part of its square; more: time.
const PER_FREE_PATH: f32 = 4.0;

/// Most pieces of a segment of the medium: a free path far too short must not hang the host.
const MOST: f32 = 1024.0;

/// Calls `visit(from, to, power)` for pieces of the first `distance` (m) of a flight that began with `power` (W), so that over the flights of
/// [`trace()`](super::trace()) sums of `∫ power f dt` estimate `∫ f Φ dV`, `Φ` the fluence (W·m⁻²), in every channel.
///
/// ```text
/// power(t) = p T(t)/P(t),   P(t) = Σ p T(t)/Σ p        sums over the channels
/// ```
///
/// Where extinction is grey that is `p` all along, one piece. Where it is not, a flight is drawn for a channel chosen in proportion to its power `p` at the start, and comes as far as `t` with
/// the probability `P(t)`: as [`flight`](crate::transmittance::flight) weighs collisions (Wilkie et al. 2014). Pieces are a quarter of the least free path long at most (up to 1024 in one of
/// the medium's segments), so that power in the middle of one is that of all of it to 0.3 %. Thickness up to there is exact where extinction is constant; where it changes, pieces are no longer than [`Medium::resolution`]
/// and taken for what their middles are. A piece without end has the power that it begins with: endless flights are to be cut where nobody looks.
///
/// ```
/// # use fogbow::{math::{Ray, Vec3}, medium::Homogeneous, phase::Phase, photon::for_each_piece, spectrum::Spectrum};
/// let red = Homogeneous::new(Spectrum::new(0.0, 1.0, 4.0), Spectrum::ZERO, Phase::ISOTROPIC)?;
/// let mut last = Spectrum::ZERO;
/// for_each_piece(&red, &Ray::new(Vec3::ZERO, Vec3::X), 20.0, Spectrum::ONE, &mut |_, _, power| last = power);
/// assert!((last[0] - 3.0).abs() < 1e-4 && last[2] < 1e-30);   // who comes so far was drawn for red light
/// # Ok::<(), fogbow::medium::MediumError>(())
/// ```
pub fn for_each_piece(
    medium: &(impl Medium + ?Sized),
    reach: &Ray,
    distance: f32,
    power: Spectrum,
    visit: &mut dyn FnMut(f32, f32, Spectrum),
) {
    if medium.is_grey() {
        return visit(0.0, distance, power);
    }
    let mut thickness = Spectrum::ZERO;
    for (from, segment) in marching_segments(medium, &reach.with_length(distance)) {
        let length = segment.until - from;
        if length.is_infinite() || segment.majorant.is_black() {
            visit(from, segment.until, left_of(power, thickness));
            continue;
        }
        let cells = if segment.is_constant() { 0.0 } else { length / medium.resolution() };
        let count = libm::ceilf(cells.max(PER_FREE_PATH * segment.majorant.max_element() * length)).clamp(1.0, MOST);
        let step = length / count;
        for k in 0..count as u32 {
            let begin = from + k as f32 * step;
            let extinction =
                if segment.is_constant() { segment.majorant } else { medium.extinction(reach.at(begin + 0.5 * step)) };
            visit(begin, begin + step, left_of(power, thickness + extinction * (0.5 * step)));
            thickness += extinction * step;
        }
    }
}

/// What a photon stands for behind a thickness.
fn left_of(power: Spectrum, thickness: Spectrum) -> Spectrum {
    // Of what is all opaque, colours still differ.
    let least = power.zip(thickness, |p, t| if p > 0.0 { t } else { f32::INFINITY }).min_element();
    let through = power * (thickness - Spectrum::splat(least)).max(Spectrum::ZERO).transmitted();
    // Neither no power nor endless thickness leaves what is no number.
    let factor = power.mean() / through.mean();
    if factor.is_finite() { through * factor } else { Spectrum::ZERO }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host::{Empty, Properties};
    use crate::light::{Light, PointLight};
    use crate::math::{Bounds, Vec3};
    use crate::medium::Homogeneous;
    use crate::path::Settings;
    use crate::phase::Phase;
    use crate::photon::{Event, trace};
    use crate::sampling::Generator;
    use crate::world::World;

    /// The same fog, but varying as far as anyone can tell.
    struct Varying<'a>(&'a Homogeneous);

    impl Medium for Varying<'_> {
        fn properties(&self, point: Vec3) -> Properties {
            self.0.properties(point)
        }
        fn majorant_segment(&self, _: &Ray, from: f32) -> crate::host::MajorantSegment {
            let until = from + 0.7;
            crate::host::MajorantSegment { until, minorant: Spectrum::ZERO, majorant: Spectrum([0.5, 1.5, 4.0]) }
        }
        fn resolution(&self) -> f32 {
            0.1
        }
        fn is_grey(&self) -> bool {
            false
        }
    }

    /// All that a lamp sends is absorbed in the end: `∫ σₐ Φ dV` is its power, in every channel.
    #[test]
    fn flights_stand_for_what_gets_through_in_every_channel() {
        const PATHS: u32 = 40_000;
        let extinction = Spectrum([0.5, 1.5, 4.0]);
        let fog = Homogeneous::new(extinction * 0.2, extinction * 0.8, Phase::ISOTROPIC).unwrap();
        let flown = |medium: &dyn Medium| {
            let lamp = [Light::Point(PointLight::from_flux(Vec3::ZERO, Spectrum::ONE).unwrap())];
            let world = World { medium, scene: &Empty, lights: (&lamp).into() };
            let bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
            let (mut rng, mut absorbed, mut near) = (Generator::new(1), Spectrum::ZERO, Spectrum::ZERO);
            for _ in 0..PATHS {
                let mut straight = true;
                trace(&world, &bounds, &Settings::default(), &mut rng, &mut |event: &Event<'_>| {
                    let Event::Flew { reach, distance, power } = *event else { return };
                    for_each_piece(medium, reach, distance, power, &mut |from, to, power| {
                        absorbed += power * extinction * (0.2 * (to - from) / PATHS as f32);
                        // Of what comes straight, e^−σ beyond a metre.
                        let length = (to - from.max(1.0)).max(0.0) * f32::from(u8::from(straight));
                        near += power * extinction * (length / PATHS as f32);
                    });
                    straight = false;
                });
            }
            (absorbed, near)
        };
        for (absorbed, beyond) in [flown(&fog), flown(&Varying(&fog))] {
            let expected = extinction.transmitted();
            for channel in 0..3 {
                assert!((absorbed[channel] - 1.0).abs() < 0.02, "{absorbed:?}");
                let off = (beyond[channel] - expected[channel]).abs();
                assert!(off < 0.02 * expected[channel] + 2e-3, "{beyond:?} {expected:?}");
            }
        }
        assert_eq!(left_of(Spectrum::ZERO, extinction), Spectrum::ZERO);
        assert!(left_of(Spectrum::ONE, extinction * 1e9).0 == [3.0, 0.0, 0.0]);
    }
}
