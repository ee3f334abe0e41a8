//! A voxel grid that is empty in most places.

use glam::{Affine3, Mat3, Vec3};

use super::bricks::{Bricks, NodeBounds};
use super::density::{Corners, central_hessian};
use super::joining::Joining;
use super::majorant::{MinMax, Reach};
use super::region::BoxRegion;
use super::{MediumError, ball};
use crate::host::{Gradients, MajorantSegment, Medium, Properties};
use crate::math::Ray;
use crate::phase::Phase;
use crate::spectrum::{Gradient, Hessian, Spectrum};

/// A sparse voxel grid: bricks of densities in lent memory, trilinear between cell centres, placed anywhere.
///
/// ```text
/// σₛ(x) = d(p) · scattering,   σₐ(x) = d(p) · absorption,   p = local(x) in [0, 1]³
/// ```
///
/// As a [`DensityGrid`](super::DensityGrid) of as many cells, but for two things: only what is filled takes memory and time, and the
/// outermost cells must be empty, so that density ends by itself: there are no faces. That is how OpenVDB and NanoVDB interpolate:
/// towards the background beyond the last cell.
///
/// Bounds along a ray come from bricks of 8³ cells; nodes of 128³ that are not there are passed in one step.
///
/// ```
/// # use fogbow::host::{Medium, Properties};
/// # use fogbow::math::{Affine3, Ray, Vec3};
/// # use fogbow::medium::{Bricks, NodeBounds, SparseGrid};
/// # use fogbow::spectrum::Spectrum;
/// // 1000 cells along x, of which only those around the middle of the first eight are filled.
/// let mut cells = [0.0; 512];
/// cells[(4 * 8 + 4) * 8 + 4] = 1.0;
/// let mut slots = [Bricks::NOTHING; 4096];
/// slots[0] = 0;
/// let mut nodes = [Bricks::NOTHING; 8];
/// nodes[0] = 0;
/// let bricks = Bricks { size: [1000, 9, 9], nodes: &nodes, slots: &slots, cells: &cells };
/// let mut bounds = [NodeBounds::EMPTY];
/// let smoke = Properties { scattering: Spectrum::ONE, ..Properties::VACUUM };
/// let metres = Affine3::from_scale(Vec3::new(1000.0, 9.0, 9.0));
/// let grid = SparseGrid::new(bricks, &smoke, metres, &mut bounds)?;
/// assert_eq!(grid.extinction(Vec3::splat(4.5))[0], 1.0);   // the centre of the cell
/// assert_eq!(grid.extinction(Vec3::new(5.0, 4.5, 4.5))[0], 0.5);
/// // From the far end, vacuum up to where something may be.
/// let ray = Ray::new(Vec3::new(990.0, 4.5, 4.5), -Vec3::X);
/// let gap = grid.majorant_segment(&ray, 0.0);
/// assert!(gap.majorant.is_black() && gap.until == 990.0 - 8.0);
/// # Ok::<(), fogbow::medium::MediumError>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct SparseGrid<'a> {
    pub(super) bricks: Bricks<'a>,
    /// Like the nodes of the bricks.
    pub(super) bounds: &'a [NodeBounds],
    pub(super) whole: MinMax,
    /// From the world to `p·n`.
    pub(super) cells_from_world: Affine3,
    /// From the world to `p·n + 1/2`.
    shifted_from_world: Affine3,
    pub(super) reach: Reach,
    pub(super) resolution: f32,
    absorption: Spectrum,
    scattering: Spectrum,
    pub(super) extinction: Spectrum,
    phase: Phase,
}

impl<'a> SparseGrid<'a> {
    /// `properties` are those where density is 1; their emission is not looked at. `local_to_world` places the unit cube, which is
    /// the box of the bricks; `bounds`, one for each node that is there, is filled here.
    ///
    /// # Errors
    /// Whatever is not finite, not invertible, negative or of the wrong size; outermost cells that are not empty; a node that is not
    /// there beside a cell that is not empty.
    ///
    /// ```
    /// # use fogbow::{host::Properties, math::Affine3, medium::{Bricks, MediumError, NodeBounds, SparseGrid}, spectrum::Spectrum};
    /// let mut slots = [Bricks::NOTHING; 4096];
    /// slots[0] = 0;
    /// let full = Bricks { size: [8; 3], nodes: &[0], slots: &slots, cells: &[1.0; 512] };
    /// let (smoke, mut bounds) = (Properties { scattering: Spectrum::ONE, ..Properties::VACUUM }, [NodeBounds::EMPTY]);
    /// let refused = SparseGrid::new(full, &smoke, Affine3::IDENTITY, &mut bounds);
    /// assert_eq!(refused.map(|_| ()), Err(MediumError::Border));   // its outermost cells are filled
    /// let empty = Bricks { cells: &[0.0; 512], ..full };
    /// assert!(SparseGrid::new(empty, &smoke, Affine3::IDENTITY, &mut bounds).is_ok());
    /// ```
    pub fn new(
        bricks: Bricks<'a>,
        properties: &Properties,
        local_to_world: Affine3,
        bounds: &'a mut [NodeBounds],
    ) -> Result<Self, MediumError> {
        let Properties { absorption, scattering, phase, .. } = *properties;
        if !(absorption.is_valid() && scattering.is_valid()) {
            return Err(MediumError::Coefficients);
        }
        let phase = phase.check()?;
        let region = BoxRegion::new(local_to_world)?;
        bricks.check()?;
        let size = Vec3::from_array(bricks.size.map(|n| n as f32));
        let local = region.local_from_world();
        let scale = Mat3::from_diagonal(size);
        let cells_from_world = Affine3 { matrix3: scale * local.matrix3, translation: scale * local.translation };
        if !cells_from_world.is_finite() {
            return Err(MediumError::Placement);
        }
        let edges = [local_to_world.matrix3.x_axis, local_to_world.matrix3.y_axis, local_to_world.matrix3.z_axis];
        let edge = |i: usize| edges[i].length() / size[i];
        let whole = bricks.fill(bounds)?;
        let extinction = absorption + scattering;
        if !(extinction * whole.max).is_finite() {
            return Err(MediumError::Coefficients);
        }
        Ok(Self {
            bricks,
            bounds,
            whole,
            cells_from_world,
            shifted_from_world: Affine3 {
                translation: cells_from_world.translation + Vec3::splat(0.5),
                ..cells_from_world
            },
            reach: Reach::new(&cells_from_world, edges.iter().map(|e| e.length()).sum()),
            resolution: edge(0).min(edge(1)).min(edge(2)).max(f32::MIN_POSITIVE),
            absorption,
            scattering,
            extinction,
            phase,
        })
    }

    /// Angular law of scattering; the same everywhere.
    ///
    /// ```
    /// # use fogbow::{host::Properties, math::Affine3, medium::{Bricks, SparseGrid}, phase::{Lobe, Phase}};
    /// let nothing = Bricks { size: [8; 3], nodes: &[Bricks::NOTHING], slots: &[], cells: &[] };
    /// let air = Properties { phase: Lobe::Rayleigh.into(), ..Properties::VACUUM };
    /// let grid = SparseGrid::new(nothing, &air, Affine3::IDENTITY, &mut [])?;
    /// assert_eq!(grid.phase(), Phase::from(Lobe::Rayleigh));
    /// # Ok::<(), fogbow::medium::MediumError>(())
    /// ```
    #[inline]
    #[must_use]
    pub fn phase(&self) -> Phase {
        self.phase
    }

    #[inline]
    fn corners(&self, point: Vec3) -> Option<Corners> {
        let shifted = self.shifted_from_world.transform_point3(point);
        let [x, y, z] = self.bricks.size.map(|n| n as f32 + 0.5);
        let is_inside = shifted.cmpge(Vec3::splat(0.5)).all() && shifted.cmple(Vec3::new(x, y, z)).all();
        is_inside.then(|| self.bricks.corners(self.bounds, shifted))
    }

    #[inline]
    fn density(&self, point: Vec3) -> f32 {
        self.corners(point).map_or(0.0, |corners| corners.value())
    }

    /// From a gradient in cell coordinates to one in the world.
    #[inline]
    fn gradient_to_world(&self, gradient: Vec3) -> Vec3 {
        let m = &self.cells_from_world.matrix3;
        Vec3::new(gradient.dot(m.x_axis), gradient.dot(m.y_axis), gradient.dot(m.z_axis))
    }
}

impl Medium for SparseGrid<'_> {
    #[inline]
    fn properties(&self, point: Vec3) -> Properties {
        let density = self.density(point);
        Properties {
            absorption: self.absorption * density,
            scattering: self.scattering * density,
            phase: self.phase,
            ..Properties::VACUUM
        }
    }

    #[inline]
    fn majorant_segment(&self, ray: &Ray, from: f32) -> MajorantSegment {
        self.joined_segment(ray, from, Joining::Tight)
    }

    #[inline]
    fn marching_segment(&self, ray: &Ray, from: f32) -> MajorantSegment {
        self.joined_segment(ray, from, Joining::Loose)
    }

    #[inline]
    fn extinction(&self, point: Vec3) -> Spectrum {
        self.extinction * self.density(point)
    }

    #[inline]
    fn extinction_with_gradient(&self, point: Vec3) -> (Spectrum, Gradient) {
        let Some(corners) = self.corners(point) else { return (Spectrum::ZERO, Gradient::ZERO) };
        let slope = self.gradient_to_world(corners.gradient());
        (self.extinction * corners.value(), Gradient::outer(self.extinction, slope))
    }

    /// The shortest edge of a cell (m).
    fn resolution(&self) -> f32 {
        self.resolution
    }

    /// The gradient of the interpolant itself: piecewise, jumping between cells.
    fn gradients(&self, point: Vec3) -> Gradients {
        let Some(corners) = self.corners(point) else { return Gradients::default() };
        let slope = self.gradient_to_world(corners.gradient());
        Gradients {
            extinction: Gradient::outer(self.extinction, slope),
            scattering: Gradient::outer(self.scattering, slope),
        }
    }

    /// Central differences over one cell along the grid's own axes, as those of a
    /// [`DensityGrid`](super::DensityGrid); zero outside.
    fn extinction_hessian(&self, point: Vec3) -> Hessian {
        if self.corners(point).is_none() {
            return Hessian::ZERO;
        }
        let centre = self.shifted_from_world.transform_point3(point);
        // Half a cell before the first, where a truncation would no longer be the floor, nothing is left.
        let at = |offset: Vec3| self.bricks.corners(self.bounds, (centre + offset).max(Vec3::ZERO)).value();
        central_hessian(&self.cells_from_world.matrix3, |offset| self.extinction * at(offset))
    }

    /// From about one point per cell that the ball spans, between 32 and 900; outside the grid counts as nothing.
    fn mean_extinction(&self, centre: Vec3, radius: f32) -> Spectrum {
        if radius.max(0.0) == 0.0 {
            return self.extinction(centre);
        }
        let across = 2.0 * radius / self.resolution;
        let per_axis = 2 * ((0.5 * across) as u32).clamp(2, ball::MAX_PER_AXIS / 2);
        ball::mean(centre, radius, per_axis, |point| self.extinction(point))
    }

    fn is_grey(&self) -> bool {
        self.extinction.is_grey()
    }
}
