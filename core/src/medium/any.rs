//! The closed set of this module's media, for scenes that hold several kinds.

use super::{DensityGrid, Homogeneous, Noise, SparseGrid};
use crate::host::Medium;
use crate::phase::Phase;

/// A medium of any of the kinds made here.
///
/// ```
/// # use fogbow::{host::Medium, math::Vec3, phase::Phase, spectrum::Spectrum};
/// # use fogbow::medium::{AnyMedium, Homogeneous};
/// let fog = AnyMedium::from(Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC).unwrap());
/// assert_eq!(fog.extinction(Vec3::ZERO), Spectrum::ONE);
/// assert_eq!(fog.phase(), Phase::ISOTROPIC);
/// ```
#[derive(Debug, Clone, Copy)]
pub enum AnyMedium<'a> {
    /// The same everywhere.
    Homogeneous(Homogeneous),
    /// A voxel grid.
    Grid(DensityGrid<'a>),
    /// A sparse voxel grid.
    Sparse(SparseGrid<'a>),
    /// Fractal noise.
    Noise(Noise),
}

impl AnyMedium<'_> {
    /// Angular law of scattering; the same everywhere in each of these media.
    #[inline]
    #[must_use]
    pub fn phase(&self) -> Phase {
        match self {
            Self::Homogeneous(medium) => medium.phase(),
            Self::Grid(medium) => medium.phase(),
            Self::Sparse(medium) => medium.phase(),
            Self::Noise(medium) => medium.phase(),
        }
    }
}

impl Medium for AnyMedium<'_> {
    crate::host::delegate_medium!(self, [Homogeneous Grid Sparse Noise]);
}

impl From<Homogeneous> for AnyMedium<'_> {
    fn from(medium: Homogeneous) -> Self {
        Self::Homogeneous(medium)
    }
}

impl<'a> From<DensityGrid<'a>> for AnyMedium<'a> {
    fn from(medium: DensityGrid<'a>) -> Self {
        Self::Grid(medium)
    }
}

impl<'a> From<SparseGrid<'a>> for AnyMedium<'a> {
    fn from(medium: SparseGrid<'a>) -> Self {
        Self::Sparse(medium)
    }
}

impl From<Noise> for AnyMedium<'_> {
    fn from(medium: Noise) -> Self {
        Self::Noise(medium)
    }
}
