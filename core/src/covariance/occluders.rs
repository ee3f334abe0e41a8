//! What passing close to surfaces does to light: a lattice of where surfaces lie and how they face.
//!
//! B § 4.1 takes occluders from a voxel grid and leaves open how. Here a cell knows the mean and the spread of the
//! surface points in it and of their normals. A ray that passes through the cell without ending there has its
//! light cut off beside it, at the distance `d` to the surface:
//!
//! ```text
//! O = ê êᵀ / (4π² d²)
//! ```
//!
//! towards the surface points (their edge) where they face the ray, along their normals where they face
//! sideways. Closer than [`NEAREST`] of a cell, distances are not known. So shadow borders are as sharp as the
//! lattice is fine, and no sharper: the limitation B shows in Fig. 17.
//!
//! Light that passes in the cell *beside* an occluder's is not cut off: a shadow border on a face between cells, or
//! whose occluder fills so little of its last cell that no probing ray meets it there, leaves no trace.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::lattice::{Lattice, LatticeError};
use super::operators::PER_HESSIAN;
use crate::host::Scene;
use crate::math::{Ray, Symmetric3, float};
use crate::storage::{Full, List};

/// Least distance to an occluder, in cells. Smaller: rays that graze a surface decide everything. Larger:
/// shadow borders are taken for softer than the lattice could tell.
pub const NEAREST: f32 = 0.25;

/// Surfaces that one column of a lattice may cross.
const MAX_HITS: u32 = 4096;

/// What a cell knows of the surfaces in it; sums over surface points.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct OccluderCell {
    /// `Σ x`, from the cell's centre (m).
    position: Vec3,
    /// `Σ x xᵀ` (m²).
    spread: Symmetric3,
    /// `Σ n nᵀ`.
    normals: Symmetric3,
    /// Number of points.
    count: f32,
}

/// Nearby surfaces, in cells that the host lends or that grow.
///
/// ```
/// # use fogbow::{covariance::{Lattice, OccluderCell, Occluders}, math::{Bounds, Vec3, float::PI}};
/// let lattice = Lattice::new(Bounds { min: Vec3::ZERO, max: Vec3::ONE }, [1, 1, 1])?;
/// let mut cells = [OccluderCell::default()];
/// let mut occluders = Occluders::new(lattice, &mut cells[..])?;
/// assert_eq!((occluders.covariance(Vec3::splat(0.5), Vec3::Z), occluders.occupied()), (None, 0));
/// // A wall at x = 1, 0.5 m beside a ray along z: the light is cut off across x, at that distance.
/// occluders.add(Vec3::new(1.0, 0.5, 0.5), Vec3::NEG_X);
/// let edge = occluders.covariance(Vec3::splat(0.5), Vec3::Z).unwrap();
/// assert!((edge.xx - 1.0 / (4.0 * PI * PI * 0.25)).abs() < 1e-6 && edge.yy.abs() < 1e-6);
/// assert_eq!((occluders.lattice(), occluders.occupied()), (&lattice, 1));
/// # Ok::<(), fogbow::covariance::LatticeError>(())
/// ```
#[derive(Debug)]
pub struct Occluders<'a> {
    lattice: Lattice,
    cells: List<'a, OccluderCell>,
}

impl<'a> Occluders<'a> {
    /// Without surfaces; `cells` has room for one element per cell of the lattice.
    ///
    /// # Errors
    /// Storage with less room.
    pub fn new(lattice: Lattice, cells: impl Into<List<'a, OccluderCell>>) -> Result<Self, LatticeError> {
        let mut cells = cells.into();
        cells.reset(lattice.cell_count(), OccluderCell::default()).map_err(|Full| LatticeError::Storage)?;
        Ok(Self { lattice, cells })
    }

    /// Adds a point (m) of a surface with this normal (unit).
    pub fn add(&mut self, point: Vec3, normal: Vec3) {
        let Some(index) = self.lattice.index(point) else { return };
        let offset = point - self.lattice.centre(index);
        let square =
            |v: Vec3| Symmetric3::from_upper([v.x * v.x, v.x * v.y, v.x * v.z, v.y * v.y, v.y * v.z, v.z * v.z]);
        let cell = &mut self.cells.as_mut_slice()[index];
        cell.position += offset;
        cell.spread = cell.spread.plus(&square(offset));
        cell.normals = cell.normals.plus(&square(normal));
        cell.count += 1.0;
    }

    /// Adds the surfaces of `scene`, found by `rays`² rays through every column of cells along each axis.
    ///
    /// Lights, glass and null interfaces stop no light and are left out.
    ///
    /// ```
    /// # use fogbow::{covariance::{Lattice, OccluderCell, Occluders}, host::{Hit, Scene}, math::{Bounds, Ray, Vec3}};
    /// # use fogbow::surface::Surface;
    /// struct Floor;   // at z = 0.1
    /// impl Scene for Floor {
    ///     fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
    ///         let distance = (0.1 - ray.origin.z) / ray.direction.z;
    ///         let hit = Hit { distance, normal: Vec3::Z, shading: Vec3::Z, surface: Surface::BLACK, light: None };
    ///         (distance > 0.0 && distance < ray.length).then_some(hit)
    ///     }
    /// }
    /// let lattice = Lattice::new(Bounds { min: Vec3::ZERO, max: Vec3::ONE }, [2, 2, 2])?;
    /// let mut cells = [OccluderCell::default(); 8];
    /// let mut occluders = Occluders::new(lattice, &mut cells[..])?;
    /// occluders.add_scene(&Floor, 2);
    /// assert_eq!(occluders.occupied(), 4);   // the lower half of the cells
    /// # Ok::<(), fogbow::covariance::LatticeError>(())
    /// ```
    pub fn add_scene(&mut self, scene: &(impl Scene + ?Sized), rays: u32) {
        let lattice = self.lattice;
        for row in 0..row_count(&lattice, rays) {
            scan(&lattice, scene, rays, row, |point, normal| self.add(point, normal));
        }
    }

    /// The lattice.
    #[must_use]
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// Number of cells that hold a surface.
    #[must_use]
    pub fn occupied(&self) -> usize {
        self.cells.as_slice().iter().filter(|cell| cell.count > 0.0).count()
    }

    /// Covariance `O` (cycles²/m², in space) of what occludes a ray that passes `point` (m) along `direction`
    /// (unit); `None` where no surface is near.
    #[inline]
    #[must_use]
    pub fn covariance(&self, point: Vec3, direction: Vec3) -> Option<Symmetric3> {
        let index = self.lattice.index(point)?;
        let cell = &self.cells.as_slice()[index];
        if !(cell.count > 0.0) {
            return None;
        }
        let inverse = 1.0 / cell.count;
        let mean = cell.position * inverse;
        let nearest = NEAREST * self.lattice.cell().min_element();
        let to_surface = self.lattice.centre(index) + mean - point;
        let across = to_surface - direction * to_surface.dot(direction);
        // How much the surface faces sideways: the normals' part across the ray.
        let normals = cell.normals.times(inverse);
        let facing = normals.along(direction).clamp(0.0, 1.0);
        let sideways = 1.0 - facing;
        let mut out = Symmetric3::ZERO;
        if sideways > 1e-3 {
            let w = direction;
            // N − N w wᵀ − w wᵀN + w (wᵀNw) wᵀ
            let nw = normals.applied(w);
            let p = nw - w * (0.5 * facing);
            let across_normals = Symmetric3::from_upper([
                normals.xx - 2.0 * p.x * w.x,
                normals.xy - p.x * w.y - p.y * w.x,
                normals.xz - p.x * w.z - p.z * w.x,
                normals.yy - 2.0 * p.y * w.y,
                normals.yz - p.y * w.z - p.z * w.y,
                normals.zz - 2.0 * p.z * w.z,
            ]);
            let distance2 = (across_normals.along(to_surface) / sideways).max(nearest * nearest);
            out = across_normals.times(PER_HESSIAN / distance2);
        }
        let length = across.length();
        if facing > 1e-3 && length > 1e-3 * nearest {
            let e = across / length;
            let centre = mean.dot(e);
            let variance = (cell.spread.along(e) * inverse - centre * centre).max(0.0);
            // Points spread evenly reach √3 standard deviations from their mean.
            let distance = (length - float::sqrt(3.0 * variance)).max(nearest);
            let weight = facing * PER_HESSIAN / (distance * distance);
            out = out.plus(
                &Symmetric3::from_upper([e.x * e.x, e.x * e.y, e.x * e.z, e.y * e.y, e.y * e.z, e.z * e.z])
                    .times(weight),
            );
        }
        Some(out)
    }
}

/// Number of rows of rays that look for the surfaces in a lattice: along every axis, `rays` for each cell across it.
pub(super) fn row_count(lattice: &Lattice, rays: u32) -> u32 {
    lattice.size().iter().map(|count| count * rays).sum()
}

/// Calls `visit(point, normal)` for the surfaces that stop light and that the rays of a row meet, in order.
pub(super) fn scan(
    lattice: &Lattice,
    scene: &(impl Scene + ?Sized),
    rays: u32,
    row: u32,
    mut visit: impl FnMut(Vec3, Vec3),
) {
    let (bounds, size) = (lattice.bounds(), lattice.size());
    let extent = bounds.size();
    // Rays along x are dealt out in rows along z, one for each step along y; and so on in turn.
    let (mut axis, mut i) = (0, row);
    while axis < 3 && i >= size[(axis + 1) % 3] * rays {
        i -= size[(axis + 1) % 3] * rays;
        axis += 1;
    }
    if axis == 3 {
        return;
    }
    let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
    let (count_a, count_b) = (size[a] * rays, size[b] * rays);
    let margin = 1e-3 * extent.max_element();
    let mut direction = Vec3::ZERO;
    direction[axis] = 1.0;
    for j in 0..count_b {
        let mut origin = bounds.min;
        origin[axis] -= margin;
        origin[a] += (i as f32 + 0.5) / count_a as f32 * extent[a];
        origin[b] += (j as f32 + 0.5) / count_b as f32 * extent[b];
        let mut rest = Ray { origin, direction, length: extent[axis] + 2.0 * margin };
        for _ in 0..MAX_HITS {
            let Some(hit) = scene.closest_hit(&rest) else { break };
            let stops_light = !hit.surface.transmits();
            if stops_light && hit.light.is_none() {
                visit(rest.at(hit.distance), hit.normal);
            }
            let passed = hit.distance + 1e-5 * extent.max_element();
            rest = Ray { origin: rest.at(passed), direction, length: rest.length - passed };
            if !(rest.length > 0.0) {
                break;
            }
        }
    }
}
