//! How wide density kernels may be, anywhere in the volume.

use glam::Vec3;

use super::grid::GridView;
use super::lattice::{Lattice, LatticeError};
use super::metrics::{balanced_radius, kernel_radius};

/// Kernel radii (m), one per cell of a lattice.
///
/// B Eq. 19 gives the radius where light is known to be smooth; beside a sharp border it still reaches over it and
/// drags light out of a shaft. So radii are bounded by their neighbours' (as radii of cache records are, Křivánek et
/// al. 2006):
///
/// ```text
/// r(x) ≤ r(y) + |x − y|
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Radii<'a> {
    lattice: Lattice,
    radii: &'a [f32],
}

impl<'a> Radii<'a> {
    /// From a filled grid, into one lent number per cell. `relative_bias`, `moment` and `most` (m) are those of
    /// [`kernel_radius`]. Where no photon came by, neighbours alone decide.
    ///
    /// # Errors
    /// Storage of another length.
    ///
    /// ```
    /// # use fogbow::{covariance::{GridView, Lattice, Radii, Voxel}, math::*};
    /// let lattice = Lattice::new(Bounds { min: Vec3::ZERO, max: Vec3::new(3.0, 1.0, 1.0) }, [3, 1, 1])?;
    /// let sharp = Voxel { sum: Symmetric3::from_upper([1e6, 0.0, 0.0, 0.0, 0.0, 0.0]), weight: 1.0 };
    /// let voxels = [sharp, Voxel { weight: 1.0, ..Voxel::EMPTY }, Voxel::EMPTY];
    /// let mut storage = [0.0; 3];
    /// let radii = Radii::new(&GridView::new(lattice, &voxels, 1)?, 0.02, 0.125, 10.0, &mut storage)?;
    /// assert!(radii.at(Vec3::splat(0.5)) < 1e-3);
    /// assert!((radii.at(Vec3::new(2.5, 0.5, 0.5)) - 2.0).abs() < 1e-3);   // two cells away
    /// # Ok::<(), fogbow::covariance::LatticeError>(())
    /// ```
    pub fn new(
        grid: &GridView<'_>,
        relative_bias: f32,
        moment: f32,
        most: f32,
        radii: &'a mut [f32],
    ) -> Result<Self, LatticeError> {
        Self::of_cells(grid, radii, |trace, _| kernel_radius(trace, relative_bias, moment, most))
    }

    /// Those of a first pass that make the mean of all passes best, however many there will be, if radii shrink from pass to
    /// pass like `i^−1/5`: [`balanced_radius`]. They are wide where light is even, and where little comes by: there noise is greatest.
    /// `noise` (W·m⁻¹) is the relative variance of a pass at a fluence of 1 W·m⁻² with kernels of 1 m. The other arguments are those of
    /// [`Radii::new`], by whose radii these are bounded.
    ///
    /// # Errors
    /// Storage of another length.
    ///
    /// ```
    /// # use fogbow::{covariance::{GridView, Lattice, Radii, Voxel}, math::*};
    /// // Light that varies alike in both cells, one of them 32 times as dark: its kernels are twice as wide.
    /// let lattice = Lattice::new(Bounds { min: Vec3::ZERO, max: Vec3::new(2.0, 1.0, 1.0) }, [2, 1, 1])?;
    /// let voxel = |weight| Voxel { sum: Symmetric3::from_upper([2.0 * weight, 0.0, 0.0, 0.0, 0.0, 0.0]), weight };
    /// let voxels = [voxel(32.0), voxel(1.0)];
    /// let (grid, mut storage) = (GridView::new(lattice, &voxels, 1)?, [0.0; 2]);
    /// let radii = Radii::balanced(&grid, 0.1, 10.0, 0.125, 10.0, &mut storage)?;
    /// assert!((radii.values()[1] / radii.values()[0] - 2.0).abs() < 1e-4);
    /// # Ok::<(), fogbow::covariance::LatticeError>(())
    /// ```
    pub fn balanced(
        grid: &GridView<'_>,
        noise: f32,
        relative_bias: f32,
        moment: f32,
        most: f32,
        radii: &'a mut [f32],
    ) -> Result<Self, LatticeError> {
        Self::of_cells(grid, radii, |trace, fluence| {
            let bound = kernel_radius(trace, relative_bias, moment, most);
            balanced_radius(trace, noise / fluence, moment).min(bound)
        })
    }

    /// `radius` gets the trace of Γ (cycles²/m²) and the fluence (W·m⁻²) of a cell.
    fn of_cells(
        grid: &GridView<'_>,
        radii: &'a mut [f32],
        radius: impl Fn(f32, f32) -> f32,
    ) -> Result<Self, LatticeError> {
        let lattice = *grid.lattice();
        if radii.len() != lattice.cell_count() {
            return Err(LatticeError::Storage);
        }
        for (of_cell, voxel) in radii.iter_mut().zip(grid.voxels()) {
            let trace = voxel.covariance().map_or(0.0, |gamma| gamma.trace());
            *of_cell = radius(trace, grid.fluence_of(voxel));
        }
        spread(&lattice, radii);
        Ok(Self { lattice, radii })
    }

    /// The radius (m) at `point`, interpolated; 0 outside.
    ///
    /// ```
    /// # use fogbow::{covariance::{GridView, Lattice, Radii, Voxel}, math::{Bounds, Vec3}};
    /// let lattice = Lattice::new(Bounds { min: Vec3::ZERO, max: Vec3::ONE }, [2, 1, 1])?;
    /// let mut storage = [0.0; 2];
    /// let radii = Radii::new(&GridView::new(lattice, &[Voxel::EMPTY; 2], 1)?, 0.02, 0.125, 0.3, &mut storage)?;
    /// assert_eq!((radii.at(Vec3::splat(0.5)), radii.at(Vec3::NEG_X)), (0.3, 0.0));   // even light: the largest allowed
    /// # Ok::<(), fogbow::covariance::LatticeError>(())
    /// ```
    #[inline]
    #[must_use]
    pub fn at(&self, point: Vec3) -> f32 {
        let Some(around) = self.lattice.around(point) else { return 0.0 };
        around.iter().map(|&(cell, weight)| self.radii[cell] * weight).sum()
    }

    /// The radii, one per cell.
    ///
    /// ```
    /// # use fogbow::{covariance::{GridView, Lattice, Radii, Voxel}, math::{Bounds, Vec3}};
    /// let lattice = Lattice::new(Bounds { min: Vec3::ZERO, max: Vec3::ONE }, [2, 1, 1])?;
    /// let mut storage = [0.0; 2];
    /// let radii = Radii::new(&GridView::new(lattice, &[Voxel::EMPTY; 2], 1)?, 0.02, 0.125, 0.3, &mut storage)?;
    /// assert_eq!(radii.values(), [0.3, 0.3]);
    /// # Ok::<(), fogbow::covariance::LatticeError>(())
    /// ```
    #[must_use]
    pub fn values(&self) -> &'a [f32] {
        self.radii
    }
}

/// Bounds every number by its neighbours' plus their distance: two sweeps over the 26 cells around (Borgefors 1986),
/// at most 8 % above what straight lines would give.
fn spread(lattice: &Lattice, radii: &mut [f32]) {
    let [nx, ny, nz] = lattice.size().map(|n| n as i32);
    let cell = lattice.cell();
    let index = |x: i32, y: i32, z: i32| (x + nx * (y + ny * z)) as usize;
    let mut relax = |x: i32, y: i32, z: i32, sign: i32| {
        let mut best = radii[index(x, y, z)];
        // The thirteen neighbours that a sweep in this direction has seen.
        for number in 0..13 {
            let (dx, dy, dz) = (number % 3 - 1, number / 3 % 3 - 1, number / 9 - 1);
            let at = (x + sign * dx, y + sign * dy, z + sign * dz);
            if at.0 < 0 || at.1 < 0 || at.2 < 0 || at.0 >= nx || at.1 >= ny || at.2 >= nz {
                continue;
            }
            let distance = (Vec3::new(dx as f32, dy as f32, dz as f32) * cell).length();
            best = best.min(radii[index(at.0, at.1, at.2)] + distance);
        }
        radii[index(x, y, z)] = best;
    };
    for z in 0..nz {
        for y in 0..ny {
            for x in 0..nx {
                relax(x, y, z, 1);
            }
        }
    }
    for z in (0..nz).rev() {
        for y in (0..ny).rev() {
            for x in (0..nx).rev() {
                relax(x, y, z, -1);
            }
        }
    }
}
