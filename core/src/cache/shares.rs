//! What part of a picture's light each kind brings, and how coarse it may be for that.
//!
//! Where a kind brings a tenth of the light, an error of a fifth of it is one of a fiftieth of the picture. So before records are made, eye rays
//! sample all light without any records, walks ending in the cells that photons have lit, and by what they find each kind is made for an error of its own.

use super::kind::Kind;
use super::noise::Glance;
use super::presets::{MOST_COARSER, USUAL_SHARES};

/// Rays that sample all light. Fewer: shares are told by chance; more: time.
pub(super) const RAYS: u32 = 1024;

/// Scatterings of the paths that these follow where nothing is cached: light that has been reflected more often is weak, or has been scattered
/// by the medium as well, which cells know.
pub(super) const SCATTERINGS: u32 = 32;

/// Parts of a picture along a side, by which shares are told: single rays are noise, and a kind that brings all light of a small part counts there.
const SIDE: usize = 8;

/// Part of the picture in which a kind brings most.
const TOP: usize = SIDE * SIDE / 10;

/// How much more of the error asked for may be there.
const WORSE: f64 = 2.0;

/// Light (of the mean of a picture) that is added to that of each part, in squares.
const DARK: f64 = 0.1;

/// The kinds that a picture is read from.
const KINDS: usize = Kind::FINAL.len();

/// What part of the light each kind brings where it matters, in the order of [`Kind::FINAL`]: root of the mean square over parts of the
/// picture, or half of what it brings in the tenth of them where it brings most. Each glance comes with where on the film it was.
pub(super) fn shares(glances: impl Iterator<Item = (Glance, [f32; 2])>) -> [f64; KINDS] {
    let mut parts = [[0.0; KINDS + 2]; SIDE * SIDE];
    for (glance, at) in glances {
        let [x, y] = at.map(|x| ((x * SIDE as f32) as usize).min(SIDE - 1));
        let part = &mut parts[y * SIDE + x];
        let (kinds, all) = glance.light();
        part.iter_mut().zip(kinds.into_iter().chain([all, 1.0])).for_each(|(sum, light)| *sum += f64::from(light));
    }
    let [all, rays] = [KINDS, KINDS + 1].map(|i| parts.iter().map(|part| part[i]).sum::<f64>());
    let dark = DARK * all / rays;
    core::array::from_fn(|kind| {
        let share = |part: &[f64; KINDS + 2]| {
            let light = libm::hypot(part[KINDS], dark * part[KINDS + 1]);
            // Written so that no light at all is no share of it.
            if light > 0.0 { part[kind] / light } else { 0.0 }
        };
        let mut shares = parts.map(|part| share(&part));
        shares.sort_unstable_by(f64::total_cmp);
        let seen = parts.iter().filter(|part| part[KINDS + 1] > 0.0).count().max(1);
        let mean = libm::sqrt(shares.iter().map(|share| share * share).sum::<f64>() / seen as f64);
        let top = shares[SIDE * SIDE - TOP..].iter().sum::<f64>() / TOP as f64;
        mean.max(top / WORSE)
    })
}

/// How many times the error asked for each kind may have of its own light, in the order of [`Kind::ALL`], when pictures show such shares of the
/// kinds in [`Kind::FINAL`]. What lights others must be as good as the best of these.
pub(super) fn coarser(shares: [f64; KINDS]) -> [f32; Kind::COUNT] {
    let of = |k: usize| {
        let factor = USUAL_SHARES[k] / shares[k];
        // Written so that what brings nothing is as coarse as may be, and what is no number is not.
        if factor > 1.0 { factor.min(MOST_COARSER) as f32 } else { 1.0 }
    };
    let mut all = [1.0; Kind::COUNT];
    for (k, kind) in Kind::FINAL.into_iter().enumerate() {
        all[kind as usize] = of(k);
    }
    let lit = [Kind::Surface, Kind::Multiple, Kind::Irradiance].map(|kind| all[kind as usize]);
    all[Kind::CoarseIrradiance as usize] = lit.into_iter().fold(f32::INFINITY, f32::min);
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cache::CachedRadiance;
    use crate::cache::asked::Asked;
    use crate::spectrum::Spectrum;

    fn shares_of(light: impl Fn([f32; 2]) -> [f32; 3]) -> [f64; KINDS] {
        shares((0..RAYS).map(|number| {
            let at = Asked::at(number);
            let [medium_single, medium_multiple, emitted] = light(at).map(Spectrum::splat);
            let seen = CachedRadiance { medium_single, medium_multiple, emitted, ..CachedRadiance::default() };
            (Glance::scattered(&seen), at)
        }))
    }

    #[test]
    fn what_matters_in_a_tenth_of_the_picture_counts_there() {
        let [single, surface, multiple, _] = shares_of(|_| [0.9, 0.1, 0.0]);
        assert!((single - 0.9).abs() < 0.01 && surface == 0.0 && (multiple - 0.1).abs() < 0.001);
        // In an eighth of the picture it is all there is.
        let [.., multiple, _] = shares_of(|at| if at[0] < 0.125 { [0.0, 1.0, 0.0] } else { [1.0, 0.0, 0.0] });
        assert!((0.45..0.55).contains(&multiple), "{multiple}");
        // Lamps that are seen hide nothing of what is around them.
        let [.., multiple, _] = shares_of(|at| [0.9, 0.1, if at[0] < 0.01 { 1e4 } else { 0.0 }]);
        assert!((multiple - 0.1).abs() < 0.001, "{multiple}");
    }

    #[test]
    fn kinds_that_bring_little_may_be_coarse() {
        let usual = USUAL_SHARES;
        assert_eq!(coarser(usual), [1.0; Kind::COUNT]);
        let [single, surface, multiple, irradiance, coarse] = coarser([usual[0], usual[1] / 3.0, usual[2] / 2.0, 0.0]);
        assert_eq!((single, surface, multiple, irradiance, coarse), (1.0, 3.0, 2.0, MOST_COARSER as f32, 2.0));
        assert_eq!(coarser([1.0, f64::NAN, 1.0, 1.0]), [1.0; Kind::COUNT]);
    }
}
