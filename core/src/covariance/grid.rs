//! The covariance grid: anywhere in the volume, how fast the light varies and in which direction.

use glam::Vec3;

use super::lattice::{Lattice, LatticeError};
use super::metrics::Voxel;
use crate::math::Symmetric3;
use crate::storage::List;

/// A filled grid, ready to be asked.
///
/// ```
/// # use fogbow::{covariance::{GridView, Lattice, Voxel}, math::{Bounds, Symmetric3, Vec3}};
/// // One cell of 8 m³, through which two photons of 3 W flew 2 m each.
/// let lattice = Lattice::new(Bounds { min: Vec3::ZERO, max: Vec3::splat(2.0) }, [1, 1, 1])?;
/// let sum = Symmetric3::from_upper([24.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
/// let voxels = [Voxel { sum, weight: 2.0 * 3.0 * 2.0 }];
/// let grid = GridView::new(lattice, &voxels, 2)?;
/// assert_eq!(grid.fluence(Vec3::ONE), Some(0.75));   // 12 W·m over 8 m³, for one of two
/// assert_eq!(grid.covariance(Vec3::ONE).unwrap().xx, 2.0);
/// assert_eq!((grid.voxel(Vec3::ONE), grid.voxel(Vec3::NEG_X)), (Some(voxels[0]), None));
/// assert_eq!((grid.lattice(), grid.voxels(), grid.paths()), (&lattice, &voxels[..], 2));
/// # Ok::<(), fogbow::covariance::LatticeError>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct GridView<'a> {
    lattice: Lattice,
    voxels: &'a [Voxel],
    paths: u64,
}

impl<'a> GridView<'a> {
    /// From one voxel per cell of the lattice, filled by `paths` photons.
    ///
    /// # Errors
    /// Storage of another length.
    pub fn new(lattice: Lattice, voxels: &'a [Voxel], paths: u64) -> Result<Self, LatticeError> {
        if voxels.len() != lattice.cell_count() {
            return Err(LatticeError::Storage);
        }
        Ok(Self { lattice, voxels, paths })
    }

    /// The lattice.
    #[must_use]
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// The voxels, one per cell.
    #[must_use]
    pub fn voxels(&self) -> &'a [Voxel] {
        self.voxels
    }

    /// How many photons filled it.
    #[must_use]
    pub fn paths(&self) -> u64 {
        self.paths
    }

    /// `Γ` (cycles²/m²) at `point`, interpolated between the cells around by their energy; `None` outside, and
    /// where no photon came by.
    #[inline]
    #[must_use]
    pub fn covariance(&self, point: Vec3) -> Option<Symmetric3> {
        self.voxel(point)?.covariance()
    }

    /// What the cells around `point` gathered, interpolated; `None` outside.
    #[inline]
    #[must_use]
    pub fn voxel(&self, point: Vec3) -> Option<Voxel> {
        let mut sum = Voxel::EMPTY;
        for (cell, weight) in self.lattice.around(point)? {
            let voxel = &self.voxels[cell];
            sum.merge(&Voxel { sum: voxel.sum.times(weight), weight: voxel.weight * weight });
        }
        Some(sum)
    }

    /// Fluence (W·m⁻²) at `point`, interpolated: flux times length in a cell over its volume. `None` outside.
    #[must_use]
    pub fn fluence(&self, point: Vec3) -> Option<f32> {
        Some(self.fluence_of(&self.voxel(point)?))
    }

    /// Fluence (W·m⁻²) of what a cell gathered.
    pub(super) fn fluence_of(&self, voxel: &Voxel) -> f32 {
        let volume = self.lattice.cell();
        voxel.weight / (volume.x * volume.y * volume.z * self.paths.max(1) as f32)
    }
}

/// A filled grid with its voxels, in lent memory or in memory of its own.
///
/// ```
/// # #[cfg(feature = "alloc")] {
/// # use fogbow::{covariance::{Fill, Settings, Voxel}, math::{Bounds, Vec3}};
/// // Of a fill that has yet to begin: two cells along each edge, through which no light came.
/// let bounds = Bounds { min: Vec3::ZERO, max: Vec3::ONE };
/// let grid = Fill::new(Settings { edge: 2, ..Settings::new(bounds) })?.finish();
/// assert_eq!((grid.view().voxels(), grid.view().paths()), (&[Voxel::EMPTY; 8][..], 0));
/// assert_eq!(grid.bytes(), 8 * size_of::<Voxel>());
/// # }
/// # Ok::<(), fogbow::covariance::FillError>(())
/// ```
#[derive(Debug)]
pub struct CovarianceGrid<'s> {
    lattice: Lattice,
    voxels: List<'s, Voxel>,
    paths: u64,
}

impl<'s> CovarianceGrid<'s> {
    /// `voxels` holds one element per cell.
    pub(super) fn new(lattice: Lattice, voxels: List<'s, Voxel>, paths: u64) -> Self {
        Self { lattice, voxels, paths }
    }

    /// The grid, to be asked.
    #[must_use]
    pub fn view(&self) -> GridView<'_> {
        GridView { lattice: self.lattice, voxels: self.voxels.as_slice(), paths: self.paths }
    }

    /// Bytes of memory held by voxels.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(self.voxels.as_slice())
    }
}

/// Adds what another grid of the same lattice gathered, voxel by voxel: partial grids of threads, in an order the
/// host fixes.
///
/// ```
/// # use fogbow::covariance::{Voxel, merge};
/// let mut all = [Voxel::EMPTY; 2];
/// merge(&mut all, &[Voxel { weight: 1.0, ..Voxel::EMPTY }; 2]);
/// assert_eq!(all[1].weight, 1.0);
/// ```
pub fn merge(into: &mut [Voxel], from: &[Voxel]) {
    for (a, b) in into.iter_mut().zip(from) {
        a.merge(b);
    }
}
