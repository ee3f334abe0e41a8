//! Steps along an eye ray that follow the light: adaptive integration, Belcour et al. 2014, § 6.4 and Alg. 1.

use super::grid::GridView;
use super::lattice::{CellCrossing, Cells};
use crate::math::{Ray, Vec3, float};

/// Longest step over the diagonal of the world, where steps follow the light. Longer: dark stretches cost less, and what no photon
/// met is missed; shorter: nothing is left to save.
pub const LONGEST_STEP: f32 = 1.0 / 8.0;

/// Step over the diagonal of the world, where all are of one length. Longer: more noise from light that varies; shorter: time.
pub const EVEN_STEP: f32 = 1.0 / 32.0;

/// Shortest step over the least side of a cell. Shorter: time, for noise of covariances; longer: sharp borders of shafts are noisy.
pub const LEAST_STEP: f32 = 0.05;

/// [`Rule::Error::count`] if nothing else is asked for. More: less noise, and time in proportion; fewer: the other way round.
pub const STEP_COUNT: f32 = 16.0;

/// By what rule steps are as long as they are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Rule {
    /// `1/(2√v)`, with `v = ωᵀΓω`: half a cycle of what varies most (B Alg. 1, Eq. 18). Bright and dim light alike.
    Frequency,
    /// So that all steps contribute alike to the error of the whole ray: density of steps
    ///
    /// ```text
    /// n = count · √(F/∫F dt) · ⁴√v
    /// ```
    ///
    /// A jittered step of length `1/n` over a fluence `F` that varies by `2πF√v` has a variance of about
    /// `F² v/n⁴`; at a given number of steps the sum over the ray is least where `n` goes with `√F ⁴√v`.
    Error {
        /// How fine: for a shaft of light that fills the ray and varies by one cycle in its length, the number of steps.
        count: f32,
    },
}

/// The steps along one ray: where each ends, asked in order.
///
/// Alg. 1 asks for `v` at the start of a step alone; from darkness beside a shaft of light that steps over the shaft.
/// Here a step ends where `∫ n dt = 1`, cell by cell. Where no photon came by, and outside, light counts as even.
///
/// ```
/// # use fogbow::{covariance::{AdaptiveSteps, GridView, Lattice, Rule, Voxel}, math::*};
/// let lattice = Lattice::new(Bounds { min: Vec3::ZERO, max: Vec3::new(2.0, 1.0, 1.0) }, [2, 1, 1])?;
/// let sum = Symmetric3::from_upper([25.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
/// let voxels = [Voxel::EMPTY, Voxel { sum, weight: 1.0 }];
/// let grid = GridView::new(lattice, &voxels, 1)?;
/// let ray = Ray::new(Vec3::new(0.0, 0.5, 0.5), Vec3::X).with_length(2.0);
/// let mut steps = AdaptiveSteps::new(&grid, &ray, Rule::Frequency, (0.01, 2.0));
/// assert!((steps.after(0.0) - 1.05).abs() < 1e-6);    // half in darkness, half in 5 cm of light
/// assert!((steps.after(1.05) - 0.1).abs() < 1e-6);
/// # Ok::<(), fogbow::covariance::LatticeError>(())
/// ```
#[derive(Debug, Clone)]
pub struct AdaptiveSteps<'a> {
    grid: &'a GridView<'a>,
    direction: Vec3,
    rule: Rule,
    /// Densities of steps (m⁻¹): where light is even, and the greatest.
    even: f32,
    finest: f32,
    /// One over `∫ F dt`.
    per_light: f32,
    cells: Cells,
    current: Option<(CellCrossing, f32)>,
}

impl<'a> AdaptiveSteps<'a> {
    /// Along `ray`, whose length should be finite; steps lie within `limits` (m), the shortest and the longest.
    #[inline]
    #[must_use]
    pub fn new(grid: &'a GridView<'a>, ray: &Ray, rule: Rule, limits: (f32, f32)) -> Self {
        let per_light = match rule {
            Rule::Frequency => 0.0,
            Rule::Error { .. } => {
                let voxels = grid.voxels();
                let light: f32 = grid.lattice().cells(ray).map(|c| voxels[c.cell].weight * (c.leave - c.enter)).sum();
                if light > 0.0 { 1.0 / light } else { 0.0 }
            }
        };
        let mut steps = Self {
            grid,
            direction: ray.direction,
            rule,
            even: 1.0 / limits.1,
            finest: 1.0 / limits.0,
            per_light,
            cells: grid.lattice().cells(ray),
            current: None,
        };
        steps.advance();
        steps
    }

    #[inline]
    fn advance(&mut self) {
        self.current = self.cells.next().map(|crossing| {
            let voxel = &self.grid.voxels()[crossing.cell];
            let density = voxel.covariance().map_or(0.0, |gamma| {
                let variation = float::safe_sqrt(gamma.along(self.direction));
                match self.rule {
                    Rule::Frequency => 2.0 * variation,
                    Rule::Error { count } => count * float::sqrt(voxel.weight * self.per_light * variation),
                }
            });
            (crossing, float::min(float::max(density, self.even), self.finest))
        });
    }

    /// Length (m) of the step that starts at `from` (m), not before the start of the step asked for last.
    #[inline]
    #[must_use]
    pub fn after(&mut self, from: f32) -> f32 {
        let (mut at, mut left) = (from, 1.0);
        while let Some((crossing, density)) = self.current {
            if crossing.leave > at {
                // Before the first cell light is even.
                let dark = float::max(crossing.enter - at, 0.0);
                if dark * self.even >= left {
                    break;
                }
                left -= dark * self.even;
                at += dark;
                let end = at + left / density;
                if end <= crossing.leave {
                    return end - from;
                }
                left -= (crossing.leave - at) * density;
                at = crossing.leave;
            }
            self.advance();
        }
        at + left / self.even - from
    }
}
