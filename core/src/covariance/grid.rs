//! The covariance grid: anywhere in the volume, how fast the light varies and in which direction.

use core::ops::ControlFlow;

use glam::Vec3;

use super::lattice::{Lattice, LatticeError};
use super::metrics::Voxel;
use crate::math::{Ray, Symmetric3, float};

/// A filled grid, ready to be asked.
#[derive(Debug, Clone, Copy)]
pub struct Grid<'a> {
    lattice: Lattice,
    voxels: &'a [Voxel],
    paths: u64,
}

impl<'a> Grid<'a> {
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

    /// Where the step that starts at `from` (m) on `ray` ends, as a length (m): where `∫ 2√v dt = 1`, with
    /// `v = ωᵀΓω` in each cell and `2√v` within `1/most..=1/least`.
    ///
    /// B's Alg. 1 asks for `v` at the step's start alone: from darkness beside a shaft of light it steps over
    /// the shaft. Where no photon came by, and outside, light counts as even.
    ///
    /// ```
    /// # use fogbow::{covariance::{Grid, Lattice, Voxel}, math::*};
    /// let lattice = Lattice::new(Bounds { min: Vec3::ZERO, max: Vec3::new(2.0, 1.0, 1.0) }, [2, 1, 1])?;
    /// let sum = Symmetric3::from_upper([25.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    /// let voxels = [Voxel::EMPTY, Voxel { sum, weight: 1.0 }];
    /// let grid = Grid::new(lattice, &voxels, 1)?;
    /// let ray = Ray::new(Vec3::new(0.0, 0.5, 0.5), Vec3::X);
    /// assert!((grid.step(&ray, 0.0, 0.01, 2.0) - 1.05).abs() < 1e-6);   // half in darkness, half in 0.05 m of light
    /// assert!((grid.step(&ray, 1.2, 0.01, 2.0) - 0.1).abs() < 1e-6);
    /// # Ok::<(), fogbow::covariance::LatticeError>(())
    /// ```
    #[inline]
    #[must_use]
    pub fn step(&self, ray: &Ray, from: f32, least: f32, most: f32) -> f32 {
        let rest = Ray { origin: ray.at(from), direction: ray.direction, length: most.min(ray.length - from) };
        let (even, finest) = (1.0 / most, 1.0 / least);
        let (mut done, mut at, mut end) = (0.0, 0.0, None);
        self.lattice.traverse(&rest, |cell, enter, leave| {
            done += (enter - at) * even;
            let density = self.voxels[cell]
                .covariance()
                .map_or(even, |gamma| (2.0 * float::safe_sqrt(gamma.along(ray.direction))).max(even).min(finest));
            let here = enter + (1.0 - done) / density;
            if here <= leave {
                end = Some(here);
                return ControlFlow::Break(());
            }
            done += (leave - enter) * density;
            at = leave;
            ControlFlow::Continue(())
        });
        end.unwrap_or(at + (1.0 - done) * most).max(least)
    }

    /// Fluence (W·m⁻²) at `point`, interpolated: flux times length in a cell over its volume. `None` outside.
    #[must_use]
    pub fn fluence(&self, point: Vec3) -> Option<f32> {
        let voxel = self.voxel(point)?;
        let volume = self.lattice.cell();
        Some(voxel.weight / (volume.x * volume.y * volume.z * self.paths.max(1) as f32))
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
