//! What cells of light resolve by direction, and what goes straight on instead.
//!
//! An expansion of degree `L` leaves out the peak of a phase function that scatters sharply forwards. What that scatters counts as not scattered (δ-M; Wiscombe 1977, *The Delta-M
//! Method*), so that walks may end in such cells (decision 92):
//!
//! ```text
//! p = f δ + (p − f δ),   moments p_l − f,   f = p_{L+1}
//! ```

use super::lookup::TURNING_DEGREE;
use crate::multiple_scatter::MOST_STRAIGHT;
use crate::phase::Phase;
use crate::spectrum::Spectrum;

/// Highest degree of a cell's expansion of radiance by direction.
pub(super) const MAX_DEGREE: usize = TURNING_DEGREE;

/// How much of what cells do not resolve by direction may be left where walks end: each scattering blurs it. More: what is scattered
/// sharply forward lands in the wrong place, by some 5 % of a picture at 0.5; less: longer walks, whose every turn is noise.
pub(super) const SHARPEST: f32 = 0.4;

/// The same, by which degrees below the highest are chosen. More: lamps in sharp fog have too bright a glow; less: memory for cells, and photons.
const SHARP: f32 = 0.3;

/// The same as [`SHARP`] for what does not even go straight on, up to which cells have higher degrees, as far as there are any: light that was scattered forward and goes on to the side or
/// back is weak, and what an expansion leaves out is as large there. More: what is lit from behind, or from beside, is some per cent too bright (decision 74), and dark corners of dense fog some per cent too dark
/// (decision 118); less: memory for cells.
const RESOLVED: f32 = 0.05;

/// How much of what counts as going straight on is taken to land in the wrong place (decision 92). More: longer walks; less: lamps in sharp fog have too bright a glow, and
/// what faces away from them is too bright.
const MISPLACED: f32 = 0.45;

/// What a scattering leaves of the least degrees above `degree`, but for what goes straight on, in [0, 1].
fn left_out(phase: &Phase, degree: usize) -> f32 {
    let straight = Spectrum::splat(straight(phase, degree));
    let left = |l| (phase.moment(l) - straight).map(f32::abs).max_element();
    left(degree + 1).max(left(degree + 2))
}

/// How much a scattering leaves of what cells of `degree` do not resolve, in [0, 1].
pub(super) fn unresolved(phase: &Phase, degree: usize) -> f32 {
    left_out(phase, degree) + MISPLACED * straight(phase, degree)
}

/// Part of what is scattered that counts as going straight on where degrees above `degree` are not resolved: that of the first of these, if the second
/// is like it, as of a peak that is narrower than they tell.
pub(super) fn straight(phase: &Phase, degree: usize) -> f32 {
    let above = |by| phase.moment(degree + by).mean();
    let (first, second) = (above(1), above(2));
    first.min(2.0 * second).clamp(0.0, MOST_STRAIGHT)
}

/// The least degree of cells at which light may be scattered unevenly at all.
const LEAST_DEGREE: usize = 2;

/// The highest degree of cells where that is enough for [`SHARP`], though perhaps not for [`RESOLVED`]. Higher: memory, and photons; lower: what is lit from behind, or from beside, is too bright.
const USUAL_DEGREE: usize = 5;

/// The least degree of cells at which walks may end at once, beyond [`USUAL_DEGREE`] only if they may not end there; and the highest where none leaves so little: there
/// walks end at once all the same, or after one scattering more (decision 116).
pub(super) fn degree_for(phase: &Phase) -> usize {
    if phase.is_isotropic() {
        return 0;
    }
    let ends = |degree| unresolved(phase, degree) <= SHARP;
    let [first, last] = if ends(USUAL_DEGREE) { [LEAST_DEGREE, USUAL_DEGREE] } else { [USUAL_DEGREE + 1, MAX_DEGREE] };
    (first..last).find(|&degree| ends(degree) && left_out(phase, degree) <= RESOLVED).unwrap_or(last)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phase::Lobe;

    fn fog(g: f32) -> Phase {
        Lobe::HenyeyGreenstein { g }.into()
    }

    #[test]
    fn peaks_forwards_go_straight_on_and_others_do_not() {
        let near = |a: f32, b: f32| assert!((a - b).abs() < 1e-6, "{a}, {b}");
        near(straight(&fog(0.9), 5), 0.9_f32.powi(6));
        // What is left of the moment above goes with the peak.
        near(left_out(&fog(0.9), 5), 0.9_f32.powi(6) - 0.9_f32.powi(7));
        for degree in [4, 5] {
            assert_eq!(straight(&fog(-0.9), degree), 0.0);
            near(left_out(&fog(-0.9), degree), 0.9_f32.powi(degree as i32 + 1));
        }
        // As much as walks take for it.
        assert_eq!(straight(&fog(0.999), 5), MOST_STRAIGHT);
        assert_eq!((straight(&Phase::ISOTROPIC, 0), degree_for(&Phase::ISOTROPIC)), (0.0, 0));
    }

    /// Cells resolve what walks ask for; where not even the highest degree does, these are scattered once more.
    #[test]
    fn cells_are_as_sharp_as_walks_that_end_in_them() {
        let cells = [0.1, 0.6, 0.8, 0.9, 0.93, -0.3, -0.6, -0.7].map(|g| (g, degree_for(&fog(g))));
        assert_eq!(cells, [(0.1, 2), (0.6, 4), (0.8, 5), (0.9, 5), (0.93, 7), (-0.3, 2), (-0.6, 5), (-0.7, 5)]);
        assert!(cells.into_iter().all(|(g, degree)| unresolved(&fog(g), degree) <= SHARP));
        let left = |g: f32| (degree_for(&fog(g)), unresolved(&fog(g), MAX_DEGREE));
        for g in [0.95, 0.98, -0.85, -0.9] {
            assert!(matches!(left(g), (MAX_DEGREE, once) if once <= SHARPEST), "{g}");
        }
        for g in [0.99, -0.95] {
            assert!(matches!(left(g), (MAX_DEGREE, once) if once > SHARPEST && once * once <= SHARPEST), "{g}");
        }
    }
}
