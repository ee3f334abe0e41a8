//! What part of a picture's light each kind brings, and how coarse it may be for that.
//!
//! Where a kind brings a tenth of the light, an error of a fifth of it is one of a fiftieth of the picture. So before records are made, eye rays
//! sample all light without any records, walks ending in the cells that photons have lit, and by what they find each kind is made for an error of its own. Where it brings more than
//! usual in a region of the picture its records reach less far there.
//!
//! ```text
//! s = L_k/√(L² + (0.1 L̄)²)                       share of a kind in a region: light of the kind, and all that is scattered, along its rays; L̄ is that of the picture
//! c = usual/√⟨s²⟩ in [1, 8]                       how many times the error asked for the kind may have of its own light (decision 71)
//! R′/R = √(min(c, c_r)/c),  c_r = usual/(2 max s) in [1, 8]      radius of a record that covers such regions (decision 122)
//! ```

use super::asked::Asked;
use super::kind::Kind;
use super::noise::{Glance, REGIONS, region_of, regions_in};
use super::presets::{MOST_COARSER, USUAL_SHARES};
use crate::math::float;

/// Rays that sample all light. Fewer: shares are told by chance; more: time.
pub(super) const RAYS: u32 = 1024;

/// Scatterings of the paths that these follow where nothing is cached: light that has been reflected more often is weak, or has been scattered
/// by the medium as well, which cells know.
pub(super) const SCATTERINGS: u32 = 32;

/// How many times what a kind brings in a region counts there. More: records for what nobody sees; fewer: dark regions turn out too bright, for it is there that extrapolation is
/// wrong by more than elsewhere.
const STRICTER: f32 = 2.0;

/// Light (of the mean of a picture) that is added to that of each region, in squares.
const DARK: f64 = 0.1;

/// The kinds that a picture is read from.
const KINDS: usize = Kind::FINAL.len();

/// What part of the light each kind brings, in the order of [`Kind::FINAL`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Shares {
    /// In each region of the picture, by which shares are told: single rays are noise.
    regions: [[f32; KINDS]; REGIONS],
    /// In all of it: root of the mean square over regions.
    pub(super) picture: [f64; KINDS],
}

impl Shares {
    /// As if each kind brought everything: none may be coarse.
    pub(super) const UNKNOWN: Self = Self { regions: [[1.0; KINDS]; REGIONS], picture: [1.0; KINDS] };

    /// By what the first eye rays of a view have found.
    pub(super) fn new(glances: &[Glance]) -> Self {
        let mut regions = [[0.0; KINDS + 2]; REGIONS];
        for (glance, number) in glances.iter().zip(0..) {
            let (kinds, all) = glance.light();
            let sums = regions[region_of(Asked::at(number))].iter_mut();
            sums.zip(kinds.into_iter().chain([all, 1.0])).for_each(|(sum, light)| *sum += f64::from(light));
        }
        let [all, rays] = [KINDS, KINDS + 1].map(|i| regions.iter().map(|region| region[i]).sum::<f64>());
        let dark = DARK * all / rays;
        let (mut shares, mut seen) = (Self { picture: [0.0; KINDS], ..Self::UNKNOWN }, 0.0);
        for (region, shares_there) in regions.iter().zip(&mut shares.regions) {
            seen += f64::min(region[KINDS + 1], 1.0);
            let light = libm::hypot(region[KINDS], dark * region[KINDS + 1]);
            for (k, share) in shares_there.iter_mut().enumerate() {
                // Written so that no light at all is no share of it.
                let found = if light > 0.0 { region[k] / light } else { 0.0 };
                shares.picture[k] += found * found;
                *share = found as f32;
            }
        }
        shares.picture = shares.picture.map(|squares| libm::sqrt(squares / f64::max(seen, 1.0)));
        shares
    }

    /// How many times the error asked for each kind may have of its own light, in the order of [`Kind::ALL`]. What lights others must be as good as
    /// the best of these.
    pub(super) fn coarser(&self) -> [f32; Kind::COUNT] {
        let mut all = [1.0; Kind::COUNT];
        for (factor, (share, usual)) in all.iter_mut().zip(self.picture.into_iter().zip(USUAL_SHARES)) {
            *factor = times(usual / share);
        }
        let lit = [Kind::Surface, Kind::Multiple, Kind::Irradiance].map(|kind| all[kind as usize]);
        all[Kind::CoarseIrradiance as usize] = lit.into_iter().fold(f32::INFINITY, f32::min);
        all
    }

    /// The radius of a record over what its kind allows, which is made `coarser` times as coarsely: what reaches into regions in which the kind brings more than
    /// usual is as fine as the one asks in which it brings most. `film` is what the record covers of the film, from two coordinates to two.
    pub(super) fn finer(&self, kind: Kind, coarser: f32, film: [f32; 4]) -> f32 {
        let Some(usual) = USUAL_SHARES.get(kind as usize) else { return 1.0 };
        let most = regions_in(film).map(|region| self.regions[region][kind as usize]).fold(0.0, f32::max);
        float::sqrt(times(usual / f64::from(STRICTER * most)).min(coarser) / coarser)
    }
}

/// How many times the error asked for a kind may have whose usual share of the light is so many times what it brings: where it brings nothing, as many as may be.
#[expect(clippy::manual_clamp, reason = "of what is no number it makes none, where this makes 1")]
fn times(factor: f64) -> f32 {
    factor.max(1.0).min(MOST_COARSER) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cache::CachedRadiance;
    use crate::spectrum::Spectrum;

    fn shares_of(light: impl Fn([f32; 2]) -> [f32; 3]) -> Shares {
        let glances: [_; RAYS as usize] = core::array::from_fn(|number| {
            let [medium_single, medium_multiple, emitted] = light(Asked::at(number as u32)).map(Spectrum::splat);
            let seen = CachedRadiance { medium_single, medium_multiple, emitted, ..CachedRadiance::default() };
            Glance::scattered(&seen)
        });
        Shares::new(&glances)
    }

    #[test]
    fn what_a_kind_brings_is_told_over_the_light_of_regions() {
        let [single, surface, multiple, _] = shares_of(|_| [0.9, 0.1, 0.0]).picture;
        assert!((single - 0.9).abs() < 0.01 && surface == 0.0 && (multiple - 0.1).abs() < 0.001);
        // In an eighth of the picture it is all there is.
        let [.., multiple, _] = shares_of(|at| if at[0] < 0.125 { [0.0, 1.0, 0.0] } else { [1.0, 0.0, 0.0] }).picture;
        assert!((multiple / 0.125_f64.sqrt() - 1.0).abs() < 0.02, "{multiple}");
        // Lamps that are seen hide nothing of what is around them.
        let [.., multiple, _] = shares_of(|at| [0.9, 0.1, if at[0] < 0.01 { 1e4 } else { 0.0 }]).picture;
        assert!((multiple - 0.1).abs() < 0.001, "{multiple}");
        assert_eq!(shares_of(|_| [0.0; 3]).picture, [0.0; KINDS]);
    }

    #[test]
    fn kinds_that_bring_little_may_be_coarse() {
        let usual = USUAL_SHARES;
        let coarser = |picture| Shares { picture, ..Shares::UNKNOWN }.coarser();
        assert_eq!(coarser(usual), [1.0; Kind::COUNT]);
        let [single, surface, multiple, irradiance, coarse] = coarser([usual[0], usual[1] / 3.0, usual[2] / 2.0, 0.0]);
        assert_eq!((single, surface, multiple, irradiance, coarse), (1.0, 3.0, 2.0, MOST_COARSER as f32, 2.0));
        assert_eq!(coarser([1.0, f64::NAN, 1.0, 1.0]), [1.0; Kind::COUNT]);
    }

    /// Light scattered often is hardly any, but for a dark region in which it is a half.
    #[test]
    fn what_reaches_into_a_region_where_its_kind_matters_is_as_fine_as_that_asks() {
        let is_dark = |at: [f32; 2]| at.iter().all(|x| (0.5..0.625).contains(x));
        let shares = shares_of(|at| if is_dark(at) { [0.1, 0.1, 0.0] } else { [1.0, 0.001, 0.0] });
        let coarser = shares.coarser();
        let finer = |kind: Kind, film| shares.finer(kind, coarser[kind as usize], film);
        assert!(coarser[Kind::Multiple as usize] > 5.0, "{coarser:?}");
        assert_eq!(finer(Kind::Multiple, [0.0, 0.0, 0.4, 0.9]), 1.0);
        // Twice what it brings there is more than usual: as fine as was asked for.
        for film in [[0.55; 4], [0.0, 0.5, 0.51, 0.52], [0.0, 0.0, 1.0, 1.0]] {
            let asked = finer(Kind::Multiple, film) * coarser[Kind::Multiple as usize].sqrt();
            assert!((asked - 1.0).abs() < 1e-6, "{asked}");
        }
        assert_eq!(finer(Kind::CoarseIrradiance, [0.55; 4]), 1.0);
        for kind in Kind::ALL {
            assert_eq!(Shares::UNKNOWN.finer(kind, 1.0, [0.0, 0.0, 1.0, 1.0]), 1.0);
        }
    }
}
