//! A voxel grid.

use glam::{Affine3, Mat3, Vec3};

use super::density::{Cell, Density, cell_count, central_hessian};
use super::joining::Joining;
use super::majorant::{Field, MinMax, Reach, blocks_along};
use super::region::BoxRegion;
use super::{MediumError, ball};
use crate::host::{Face, Gradients, MajorantSegment, Medium, Properties};
use crate::math::Ray;
use crate::phase::Phase;
use crate::spectrum::{Gradient, Hessian, Spectrum};

/// A voxel grid: densities in lent memory, trilinear between cell centres, placed anywhere.
///
/// ```text
/// σₛ(x) = d(p) · scattering,   σₐ(x) = d(p) · absorption,   ε(x) = d(p) · emission,   p = local(x) in [0, 1]³
/// ```
///
/// With `q = p·n − 1/2`, density is interpolated between cells `⌊q⌋` and `⌊q⌋ + 1`, clamped to the
/// grid: constant in the outer half cells, as in Mitsuba 3 (wrap mode `clamp`). Outside the unit
/// cube there is nothing; where border cells are not empty, the box has faces.
///
/// Bounds along a ray come from blocks of [`BLOCK`](super::BLOCK)³ cells.
///
/// ```
/// # use fogbow::host::{Medium, Properties};
/// # use fogbow::math::{Affine3, Vec3};
/// # use fogbow::medium::{Density, DensityGrid, MinMax};
/// # use fogbow::spectrum::Spectrum;
/// let smoke = Properties { absorption: Spectrum::splat(0.1), scattering: Spectrum::splat(0.9), ..Properties::VACUUM };
/// let values = [0.0, 1.0];
/// let mut blocks = [MinMax::default(); 1];
/// assert_eq!(blocks.len(), DensityGrid::block_count([2, 1, 1]));
/// let grid =
///     DensityGrid::new([2, 1, 1], Density::F32(&values), &smoke, Affine3::IDENTITY, &mut blocks)?;
/// // Cell centres lie at 1/4 and 3/4; halfway, density is 1/2.
/// assert_eq!(grid.extinction(Vec3::new(0.5, 0.2, 0.9))[0], 0.5);
/// assert_eq!(grid.extinction(Vec3::new(0.9, 0.2, 0.9))[0], 1.0);
/// # Ok::<(), fogbow::medium::MediumError>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct DensityGrid<'a> {
    pub(super) size: [u32; 3],
    /// From the world to `p·n + 1/2`.
    pub(super) shifted_from_world: Affine3,
    /// From the world to `p·n`.
    pub(super) cells_from_world: Affine3,
    pub(super) reach: Reach,
    pub(super) resolution: f32,
    /// Largest channel of extinction (m⁻¹) per unit of density, and of absorption density.
    pub(super) thickest: (f32, f32),
    pub(super) density: Field<'a>,
    pub(super) absorption_density: Option<Field<'a>>,
    pub(super) emission_density: Option<Field<'a>>,
    pub(super) scattering: Spectrum,
    pub(super) absorption: Spectrum,
    pub(super) emission: Spectrum,
    pub(super) phase: Phase,
    pub(super) region: BoxRegion,
}

impl<'a> DensityGrid<'a> {
    /// Number of blocks whose bounds the host lends room for; 0 for a size no grid can have.
    ///
    /// A size from a file ought to be compared with the number of densities first.
    ///
    /// ```
    /// # use fogbow::medium::{BLOCK, DensityGrid};
    /// assert_eq!(DensityGrid::block_count([BLOCK, BLOCK + 1, 1]), 2);
    /// assert_eq!(DensityGrid::block_count([0, 5, 5]), 0);
    /// ```
    #[must_use]
    pub fn block_count(size: [u32; 3]) -> usize {
        if cell_count(size).is_none() {
            return 0;
        }
        blocks_along(size).iter().map(|&n| n as usize).product()
    }

    /// One density for everything: `properties` are those where it is 1, and absorption, scattering and emission are in
    /// proportion to it. `local_to_world` places the unit cube; `blocks` is filled here.
    ///
    /// # Errors
    /// Whatever is not finite, not invertible, negative or of the wrong size.
    ///
    /// ```
    /// # use fogbow::{host::{Medium, Properties}, math::{Affine3, Vec3}, medium::{Density, DensityGrid, MinMax}, spectrum::Spectrum};
    /// let mut blocks = [MinMax::default()];
    /// let fire = Properties { absorption: Spectrum::ONE, emission: Spectrum::splat(10.0), ..Properties::VACUUM };
    /// let grid = DensityGrid::new([1; 3], Density::F32(&[2.0]), &fire, Affine3::IDENTITY, &mut blocks)?;
    /// assert!(grid.is_emissive());
    /// assert_eq!(grid.properties(Vec3::splat(0.5)).emission[0], 20.0);   // where there is twice as much, twice as bright
    /// # Ok::<(), fogbow::medium::MediumError>(())
    /// ```
    pub fn new(
        size: [u32; 3],
        density: Density<'a>,
        properties: &Properties,
        local_to_world: Affine3,
        blocks: &'a mut [MinMax],
    ) -> Result<Self, MediumError> {
        let Properties { absorption, scattering, emission, phase } = *properties;
        if !(absorption.is_valid() && scattering.is_valid()) {
            return Err(MediumError::Coefficients);
        }
        let phase = phase.check()?;
        let region = BoxRegion::new(local_to_world)?;
        if cell_count(size).is_none() || size.contains(&0) {
            return Err(MediumError::Size);
        }
        let cells = size.map(|n| n as f32);
        let local = region.local_from_world();
        let scale = Mat3::from_diagonal(Vec3::from_array(cells));
        let cells_from_world = Affine3 { matrix3: scale * local.matrix3, translation: scale * local.translation };
        let shifted_from_world =
            Affine3 { translation: cells_from_world.translation + Vec3::splat(0.5), ..cells_from_world };
        if !cells_from_world.is_finite() {
            return Err(MediumError::Placement);
        }
        let edges = [local_to_world.matrix3.x_axis, local_to_world.matrix3.y_axis, local_to_world.matrix3.z_axis];
        let edge = |i: usize| edges[i].length() / cells[i];
        let grid = Self {
            size,
            shifted_from_world,
            cells_from_world,
            reach: Reach::new(&cells_from_world, edges.iter().map(|e| e.length()).sum()),
            resolution: edge(0).min(edge(1)).min(edge(2)).max(f32::MIN_POSITIVE),
            thickest: ((absorption + scattering).max_element(), 0.0),
            density: Field::new(density, size, blocks)?,
            absorption_density: None,
            emission_density: None,
            scattering,
            absorption,
            emission,
            phase,
            region,
        };
        grid.check()
    }

    /// The same grid with a second density, of the same size, for absorption: σₐ is then
    /// `absorption` times this one, and the first scatters only.
    ///
    /// # Errors
    /// As in [`DensityGrid::new`].
    ///
    /// ```
    /// # use fogbow::{host::{Medium, Properties}, math::{Affine3, Vec3}, medium::{Density, DensityGrid, MinMax}, spectrum::Spectrum};
    /// let (mut blocks, mut more) = ([MinMax::default()], [MinMax::default()]);
    /// let unit = Properties { absorption: Spectrum::ONE, scattering: Spectrum::ONE, ..Properties::VACUUM };
    /// let grid = DensityGrid::new([1; 3], Density::F32(&[2.0]), &unit, Affine3::IDENTITY, &mut blocks)?
    ///     .with_absorption_grid(Density::F32(&[0.5]), &mut more)?;
    /// let inside = grid.properties(Vec3::splat(0.5));
    /// assert_eq!((inside.scattering[0], inside.absorption[0]), (2.0, 0.5));
    /// # Ok::<(), fogbow::medium::MediumError>(())
    /// ```
    pub fn with_absorption_grid(mut self, density: Density<'a>, blocks: &'a mut [MinMax]) -> Result<Self, MediumError> {
        self.absorption_density = Some(Field::new(density, self.size, blocks)?);
        self.thickest = (self.scattering.max_element(), self.absorption.max_element());
        self.check()
    }

    /// The same grid with a density of its own, of the same size, for emission: `emission`
    /// (W·m⁻³·sr⁻¹) where that is 1.
    ///
    /// # Errors
    /// As in [`DensityGrid::new`]; emission that is negative or not finite.
    ///
    /// ```
    /// # use fogbow::{host::{Medium, Properties}, math::{Affine3, Vec3}, medium::{Density, DensityGrid, MinMax}, spectrum::Spectrum};
    /// let (mut blocks, mut more) = ([MinMax::default()], [MinMax::default()]);
    /// let unit = Properties { absorption: Spectrum::ONE, scattering: Spectrum::ONE, ..Properties::VACUUM };
    /// let grid = DensityGrid::new([1; 3], Density::F32(&[2.0]), &unit, Affine3::IDENTITY, &mut blocks)?
    ///     .with_emission_grid(Density::F32(&[0.5]), Spectrum::splat(10.0), &mut more)?;
    /// assert_eq!(grid.properties(Vec3::splat(0.5)).emission[0], 5.0);   // whatever the density of what absorbs
    /// # Ok::<(), fogbow::medium::MediumError>(())
    /// ```
    pub fn with_emission_grid(
        mut self,
        density: Density<'a>,
        emission: Spectrum,
        blocks: &'a mut [MinMax],
    ) -> Result<Self, MediumError> {
        self.emission_density = Some(Field::new(density, self.size, blocks)?);
        self.emission = emission;
        self.check()
    }

    /// Whether the largest coefficients are finite.
    fn check(self) -> Result<Self, MediumError> {
        if !(self.emission.is_valid() && (self.emission * self.emission_field().whole.max).is_finite()) {
            return Err(MediumError::Emission);
        }
        let bounds = self.segment_of(&self.bounds(None), f32::INFINITY);
        if bounds.majorant.is_finite() { Ok(self) } else { Err(MediumError::Coefficients) }
    }

    /// Angular law of scattering; the same everywhere.
    ///
    /// ```
    /// # use fogbow::{host::Properties, math::Affine3, medium::{Density, DensityGrid, MinMax}, phase::{Lobe, Phase}, spectrum::Spectrum};
    /// let (mut blocks, smoke) = ([MinMax::default()], Density::F32(&[1.0]));
    /// let air = Properties { scattering: Spectrum::ONE, phase: Lobe::Rayleigh.into(), ..Properties::VACUUM };
    /// let grid = DensityGrid::new([1; 3], smoke, &air, Affine3::IDENTITY, &mut blocks)?;
    /// assert_eq!(grid.phase(), Phase::from(Lobe::Rayleigh));
    /// # Ok::<(), fogbow::medium::MediumError>(())
    /// ```
    #[inline]
    #[must_use]
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// The unit cube's place in the world.
    ///
    /// ```
    /// # use fogbow::{host::Properties, math::{Affine3, Vec3}, medium::{Density, DensityGrid, MinMax, Region}};
    /// let (mut blocks, smoke) = ([MinMax::default()], Density::F32(&[1.0]));
    /// let place = Affine3::from_translation(5.0 * Vec3::X);
    /// let grid = DensityGrid::new([1; 3], smoke, &Properties::VACUUM, place, &mut blocks)?;
    /// let region = Region::Box(grid.region());
    /// assert!(region.contains(Vec3::new(5.5, 0.5, 0.5)) && !region.contains(Vec3::splat(0.5)));
    /// # Ok::<(), fogbow::medium::MediumError>(())
    /// ```
    #[must_use]
    pub fn region(&self) -> BoxRegion {
        self.region
    }

    /// Number of cells along each axis.
    ///
    /// ```
    /// # use fogbow::{host::Properties, math::Affine3, medium::{Density, DensityGrid, MinMax}};
    /// let (mut blocks, smoke) = ([MinMax::default()], Density::F32(&[1.0; 6]));
    /// let grid = DensityGrid::new([3, 2, 1], smoke, &Properties::VACUUM, Affine3::IDENTITY, &mut blocks)?;
    /// assert_eq!(grid.size(), [3, 2, 1]);
    /// # Ok::<(), fogbow::medium::MediumError>(())
    /// ```
    #[must_use]
    pub fn size(&self) -> [u32; 3] {
        self.size
    }

    #[inline]
    fn emission_field(&self) -> &Field<'a> {
        self.emission_density.as_ref().unwrap_or(&self.density)
    }

    /// The cell around a point of the box; `None` outside.
    #[inline]
    fn cell(&self, point: Vec3) -> Option<Cell> {
        // Written out, for compilers that would leave it a call.
        let Affine3 { matrix3: m, translation } = &self.shifted_from_world;
        let shifted = m.x_axis * point.x + m.y_axis * point.y + m.z_axis * point.z + *translation;
        let end = Vec3::new(self.size[0] as f32, self.size[1] as f32, self.size[2] as f32) + Vec3::splat(0.5);
        let is_inside = shifted.cmpge(Vec3::splat(0.5)).all() && shifted.cmple(end).all();
        is_inside.then(|| Cell::at(shifted, self.size))
    }

    /// Extinction at a cell position, from one density if one serves both.
    #[inline]
    fn extinction_in(&self, cell: &Cell) -> Spectrum {
        let density = cell.value(&self.density.density);
        match &self.absorption_density {
            None => (self.absorption + self.scattering) * density,
            Some(field) => self.scattering * density + self.absorption * cell.value(&field.density),
        }
    }

    /// From a gradient in cell coordinates to one in the world.
    #[inline]
    fn gradient_to_world(&self, gradient: Vec3) -> Vec3 {
        let m = &self.cells_from_world.matrix3;
        Vec3::new(gradient.dot(m.x_axis), gradient.dot(m.y_axis), gradient.dot(m.z_axis))
    }
}

impl Medium for DensityGrid<'_> {
    #[inline]
    fn properties(&self, point: Vec3) -> Properties {
        let Some(cell) = self.cell(point) else { return Properties::VACUUM };
        let density = cell.value(&self.density.density);
        let of = |field: &Option<Field<'_>>| field.as_ref().map_or(density, |f| cell.value(&f.density));
        Properties {
            absorption: self.absorption * of(&self.absorption_density),
            scattering: self.scattering * density,
            emission: self.emission * of(&self.emission_density),
            phase: self.phase,
        }
    }

    /// The empty blocks ahead; or the first that is not, and those behind it as long as one bound
    /// for all costs less than asking again.
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
        self.cell(point).map_or(Spectrum::ZERO, |cell| self.extinction_in(&cell))
    }

    #[inline]
    fn extinction_with_gradient(&self, point: Vec3) -> (Spectrum, Gradient) {
        let Some(cell) = self.cell(point) else { return (Spectrum::ZERO, Gradient::ZERO) };
        let (density, slope) = cell.value_and_gradient(&self.density.density);
        let slope = self.gradient_to_world(slope);
        match &self.absorption_density {
            None => {
                let extinction = self.absorption + self.scattering;
                (extinction * density, Gradient::outer(extinction, slope))
            }
            Some(field) => {
                let (absorbing, steep) = cell.value_and_gradient(&field.density);
                let value = self.scattering * density + self.absorption * absorbing;
                let absorption = Gradient::outer(self.absorption, self.gradient_to_world(steep));
                (value, Gradient::outer(self.scattering, slope) + absorption)
            }
        }
    }

    /// The shortest edge of a cell (m).
    fn resolution(&self) -> f32 {
        self.resolution
    }

    /// The gradient of the interpolant itself: piecewise, jumping between cells (the upper one
    /// counts at a plane of centres), zero in the outer half cells along their axis.
    fn gradients(&self, point: Vec3) -> Gradients {
        let Some(cell) = self.cell(point) else { return Gradients::default() };
        let of = |field: &Field<'_>| self.gradient_to_world(cell.gradient(&field.density));
        let density = of(&self.density);
        let scattering = Gradient::outer(self.scattering, density);
        let absorption = Gradient::outer(self.absorption, self.absorption_density.as_ref().map_or(density, of));
        Gradients { extinction: scattering + absorption, scattering }
    }

    /// Central differences over one cell along the grid's own axes (sheet § 2.3), carried into the
    /// world: within a cell the interpolant has no pure second derivatives, its curvature sits in
    /// the kinks between cells. The box's faces do not count as curvature; zero outside.
    fn extinction_hessian(&self, point: Vec3) -> Hessian {
        if self.cell(point).is_none() {
            return Hessian::ZERO;
        }
        let centre = self.shifted_from_world.transform_point3(point);
        let at = |offset: Vec3| self.extinction_in(&Cell::at(centre + offset, self.size));
        central_hessian(&self.cells_from_world.matrix3, at)
    }

    /// From about one point per cell that the ball spans, between 32 and 900; outside the grid
    /// counts as nothing.
    fn mean_extinction(&self, centre: Vec3, radius: f32) -> Spectrum {
        if radius.max(0.0) == 0.0 {
            return self.extinction(centre);
        }
        let across = 2.0 * radius / self.resolution;
        let per_axis = 2 * ((0.5 * across) as u32).clamp(2, ball::MAX_PER_AXIS / 2);
        ball::mean(centre, radius, per_axis, |point| self.extinction(point))
    }

    fn faces(&self, ray: &Ray, visit: &mut dyn FnMut(Face)) {
        let Some(crossings) = self.region.crossings(ray) else { return };
        for crossing in crossings.into_iter().filter(|c| c.distance >= 0.0 && c.distance <= ray.length) {
            let shifted = self.shifted_from_world.transform_point3(ray.at(crossing.distance));
            let inside = self.extinction_in(&Cell::at(shifted, self.size));
            if !inside.is_black() {
                visit(Face { distance: crossing.distance, normal: crossing.normal, jump: -inside });
            }
        }
    }

    fn is_grey(&self) -> bool {
        match self.absorption_density {
            None => (self.absorption + self.scattering).is_grey(),
            Some(_) => self.absorption.is_grey() && self.scattering.is_grey(),
        }
    }

    fn is_emissive(&self) -> bool {
        !self.emission.is_black()
    }
}
