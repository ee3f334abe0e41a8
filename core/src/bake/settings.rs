//! What is baked, and how well.

use super::basis::{Orders, ProbeBasis, Quantity};
use crate::covariance::{Lattice, LatticeError};
use crate::math::Bounds;
use crate::path;
use crate::phase::Phase;
use crate::world::Outline;

/// Most probes of a grid, 256³. More take memory by the gigabyte, and no engine has a texture for them.
pub const MOST_PROBES: usize = 1 << 24;

/// Directions of a pass: a job of 64 probes takes some ten milliseconds then. More: longer jobs; fewer: directions of a pass are spread less evenly.
const DIRECTIONS: u32 = 16;

/// Passes at most. Next to a lamp within the medium, the variance of light has no bound, and no error is reached.
const MOST_PASSES: u32 = 1024;

/// Relative error of a grid that nobody asked for more of.
const ERROR: f32 = 0.02;

/// What is baked, and how well.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BakeSettings {
    /// The box (m) that cells fill.
    pub bounds: Bounds,
    /// Probes along x, y and z.
    pub counts: [u32; 3],
    /// What a probe holds.
    pub basis: ProbeBasis,
    /// Which light of a direction.
    pub quantity: Quantity,
    /// Which light is in it.
    pub orders: Orders,
    /// Standard error at which a brick of probes has enough passes, in proportion to the mean of the whole grid: a root mean square over
    /// its probes and their numbers, of degree 1 and more compared with degree 0.
    pub error: f32,
    /// The mean that errors are in proportion to (W·m⁻²·sr⁻¹, of irradiance W·m⁻²), if it is known beforehand, as [`ProbeGrid::level`](super::ProbeGrid::level) of a coarse grid: then no brick
    /// depends on any other, and several machines may bake some of them each ([`Bake::of_part`](super::Bake::of_part)). `None`: that of all probes, as far as
    /// they are baked.
    pub level: Option<f32>,
    /// Directions of a pass in which light is looked for.
    pub directions: u32,
    /// Passes at most.
    pub most_passes: u32,
    /// The phase function of probes that stand beside the medium and not in it.
    pub phase: Phase,
    /// How paths are traced.
    pub paths: path::Settings,
    /// Chooses other random numbers.
    pub seed: u64,
}

/// Why nothing can be baked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BakeError {
    /// The bounds or the number of probes along an edge.
    Lattice(LatticeError),
    /// More probes than [`MOST_PROBES`].
    Probes(u64),
    /// A degree of spherical harmonics above 3.
    Degree(u32),
    /// No directions, fewer than two passes, or an error that is not above 0.
    Effort,
    /// A grid that was begun is of other cells or of other light.
    Grid,
    /// The memory does not have one element for each number of a probe, each probe and each brick.
    Memory,
}

impl core::fmt::Display for BakeError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Lattice(error) => error.fmt(f),
            Self::Probes(count) => write!(f, "{count} probes are too many: there may be at most {MOST_PROBES}"),
            Self::Degree(degree) => write!(f, "degree {degree} is none from 0 to 3"),
            Self::Effort => f.write_str("a bake needs directions, two passes and an error above 0"),
            Self::Grid => f.write_str("the grid was begun for other cells or for other light"),
            Self::Memory => f.write_str("there is no memory for the probes"),
        }
    }
}

impl core::error::Error for BakeError {}

impl From<LatticeError> for BakeError {
    fn from(error: LatticeError) -> Self {
        Self::Lattice(error)
    }
}

impl BakeSettings {
    /// In-scattered radiance of all orders, in spherical harmonics of degree 2, over the bounds of a world; with so many probes along x, y
    /// and z.
    ///
    /// ```
    /// # use fogbow::{bake::{BakeSettings, ProbeBasis}, host::Empty, math::{Bounds, Vec3}, world::{Outline, World}};
    /// let bounds = Bounds { min: Vec3::ZERO, max: Vec3::ONE };
    /// let outline = Outline::of(&World { medium: &Empty, scene: &Empty, lights: (&[]).into() }, bounds);
    /// let settings = BakeSettings::for_outline(&outline, [8, 8, 8]);
    /// assert_eq!((settings.bounds, settings.basis.count()), (bounds, 9));
    /// ```
    #[must_use]
    pub fn for_outline(outline: &Outline, counts: [u32; 3]) -> Self {
        Self {
            bounds: outline.bounds,
            counts,
            basis: ProbeBasis::SphericalHarmonics { degree: 2 },
            quantity: Quantity::InScattered,
            orders: Orders::All,
            error: ERROR,
            level: None,
            directions: DIRECTIONS,
            most_passes: MOST_PASSES,
            phase: outline.phase,
            paths: path::Settings::default(),
            seed: 0,
        }
    }

    /// With as many probes as cells of about `spacing` (m) on a side fill the box.
    ///
    /// ```
    /// # use fogbow::{bake::BakeSettings, host::Empty, math::{Bounds, Vec3}, world::{Outline, World}};
    /// # let bounds = Bounds { min: Vec3::ZERO, max: Vec3::new(2.0, 1.0, 0.3) };
    /// # let outline = Outline::of(&World { medium: &Empty, scene: &Empty, lights: (&[]).into() }, bounds);
    /// // A box of 2 m × 1 m × 0.3 m.
    /// let settings = BakeSettings::for_outline(&outline, [1, 1, 1]).with_spacing(0.25);
    /// assert_eq!(settings.counts, [8, 4, 2]);
    /// ```
    #[must_use]
    pub fn with_spacing(self, spacing: f32) -> Self {
        // A box of whole cells has no sliver of another, whatever rounds.
        let count = |size: f32| (libm::ceilf(size / spacing - 1e-3) as u32).max(1);
        Self { counts: self.bounds.size().to_array().map(count), ..self }
    }

    /// The cells.
    ///
    /// # Errors
    /// What no grid can be.
    pub(super) fn lattice(&self) -> Result<Lattice, BakeError> {
        self.cells(true)
    }

    /// The cells, with a probe in each or in some alone, of which there may be more.
    ///
    /// # Errors
    /// What no grid can be.
    pub(super) fn cells(&self, has_all: bool) -> Result<Lattice, BakeError> {
        let count = self.counts.iter().try_fold(1_u64, |product, n| product.checked_mul(u64::from(*n)));
        if has_all && count.is_none_or(|count| count > MOST_PROBES as u64) {
            return Err(BakeError::Probes(count.unwrap_or(u64::MAX)));
        }
        if let ProbeBasis::SphericalHarmonics { degree: degree @ 4.. } = self.basis {
            return Err(BakeError::Degree(degree));
        }
        if self.directions == 0 || self.most_passes < 2 || !(self.error > 0.0) {
            return Err(BakeError::Effort);
        }
        Ok(Lattice::new(self.bounds, self.counts)?)
    }
}
