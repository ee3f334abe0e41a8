//! Bricks of half the spacing where light varies faster than a grid can hold.
//!
//! ```text
//! L(x) = Σ ω v s c / Σ ω v s      ω = w β on the finest level, w β′ (1 − β) on the next coarser one, and so on;   β = Σ w of probes that have neighbours on all sides
//! ```
//!
//! `β` is 1 where all eight probes around have neighbours of their level, 0 where none has, and continuous; above 0 all eight are there. The first level has `β = 1`. So light is continuous
//! from level to level wherever it is within one, and what is linear is held exactly: both would be lost if coarser probes took the weight of those that are missing. One level goes over into the other
//! within the outermost two layers of probes. Unreal's volumetric lightmap and Unity's adaptive probe volumes have such bricks with copies of their neighbours' probes; here no probe is held twice.

use glam::Vec3;

use super::basis::MOST_COEFFICIENTS;
use super::grid::{BRICK, BakeMemory, Brick, PROBES, ProbeGrid};
use super::probe::{INNER, Probe};
use super::settings::{BakeError, MOST_PROBES};
use crate::covariance::Lattice;
use crate::spectrum::Spectrum;
use crate::storage::Full;

/// Most levels, with the one that has all probes. More: spacings below a sixteenth, for which boxes had better be smaller.
pub const MOST_LEVELS: usize = 4;

/// A grid of probes and levels of half its spacing, a quarter and so on, that have bricks of 4 × 4 × 4 probes where light varies.
///
/// ```
/// # use fogbow::{host::Empty, light::{Light, PointLight}, math::{Bounds, Vec3}, medium::Homogeneous, phase::Phase, spectrum::Spectrum};
/// # use fogbow::{work, world::{Outline, World}};
/// # #[cfg(feature = "alloc")] {
/// use fogbow::bake::{Bake, BakeMemory, BakeSettings, BakedProbes, ProbeLevels};
/// # let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
/// # let lamps = [Light::Point(PointLight::from_flux(Vec3::splat(0.1), Spectrum::ONE)?)];
/// # let world = World { medium: &fog, scene: &Empty, lights: (&lamps).into() };
/// # let outline = Outline::of(&world, Bounds { min: Vec3::ZERO, max: Vec3::ONE });
/// # let mut settings = BakeSettings::for_outline(&outline, [8, 8, 8]);
/// # settings.paths.max_scatterings = 1;
/// let mut bake = Bake::new(settings)?;
/// work::finish(&mut bake, &world, &mut BakedProbes::default());
/// let mut levels = ProbeLevels::new(bake.finish());
/// // Bricks where look-ups between probes are off by more than a fifth of the mean.
/// let level = levels.levels()[0].level();
/// if let Some(finer) = levels.finest().finer(level, 0.2, BakeMemory::default())? {
///     // Errors in proportion to the same mean.
///     let settings = BakeSettings { counts: [16, 16, 16], level: Some(level as f32), ..settings };
///     let mut bake = Bake::resume(finer, settings)?;
///     work::finish(&mut bake, &world, &mut BakedProbes::default());
///     levels.push(bake.finish())?;
/// }
/// assert_eq!(levels.levels().len(), 2);
/// assert!(levels.finest().places().len() < 4 * 4 * 4);   // next to the lamp alone
/// assert!(levels.relative_coarseness()[0] > 0.0);
///
/// let mut held = [Spectrum::ZERO; 9];
/// assert!(levels.look_up(Vec3::splat(0.3), &mut held) > 0.999);
/// assert!(levels.value(Vec3::splat(0.3), Vec3::X)[0] > 0.0);
/// let (albedo, extinction) = levels.medium(Vec3::splat(0.3));
/// assert!((albedo[0] - 1.0).abs() < 1e-6 && (extinction[0] - 1.0).abs() < 1e-6);
/// assert_eq!(levels.dilate(), 0);   // all are valid
/// # }
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct ProbeLevels<'s> {
    levels: heapless::Vec<ProbeGrid<'s>, MOST_LEVELS>,
}

impl<'s> ProbeLevels<'s> {
    /// A grid alone.
    #[must_use]
    pub fn new(grid: ProbeGrid<'s>) -> Self {
        let mut levels = heapless::Vec::new();
        // There is room for one.
        let _ = levels.push(grid);
        Self { levels }
    }

    /// Adds a level that [`ProbeGrid::finer`] of [`ProbeLevels::finest`] has made.
    ///
    /// # Errors
    /// [`BakeError::Grid`] for a grid of other cells or of other light, or if there are [`MOST_LEVELS`].
    pub fn push(&mut self, finer: ProbeGrid<'s>) -> Result<(), BakeError> {
        let finest = self.finest();
        let light = |grid: &ProbeGrid<'_>| (grid.lattice.bounds(), grid.basis, grid.quantity, grid.orders);
        let is_finer = finer.is_sparse() && finer.lattice.size() == finest.lattice.size().map(|n| 2 * n);
        if !is_finer || light(&finer) != light(finest) {
            return Err(BakeError::Grid);
        }
        self.levels.push(finer).map_err(|_| BakeError::Grid)
    }

    /// All levels, that with all probes first.
    #[must_use]
    pub fn levels(&self) -> &[ProbeGrid<'s>] {
        &self.levels
    }

    /// The level of the smallest spacing.
    #[must_use]
    pub fn finest(&self) -> &ProbeGrid<'s> {
        // There is always one.
        &self.levels[self.levels.len() - 1]
    }

    #[cfg(test)]
    pub(super) fn grids_mut(&mut self) -> impl Iterator<Item = &mut ProbeGrid<'s>> {
        self.levels.iter_mut()
    }

    /// The levels by themselves, the one that has all probes first.
    ///
    /// ```
    /// # use fogbow::{host::Empty, math::{Bounds, Vec3}, world::{Outline, World}};
    /// # use fogbow::bake::{Bake, BakeSettings, ProbeLevels};
    /// # #[cfg(feature = "alloc")] {
    /// # let bounds = Bounds { min: Vec3::ZERO, max: Vec3::ONE };
    /// # let outline = Outline::of(&World { medium: &Empty, scene: &Empty, lights: (&[]).into() }, bounds);
    /// let grid = Bake::new(BakeSettings::for_outline(&outline, [5, 4, 4]))?.finish();
    /// let lattice = *grid.lattice();
    /// assert!(ProbeLevels::new(grid).into_levels().map(|level| *level.lattice()).eq([lattice]));
    /// # }
    /// # Ok::<(), fogbow::bake::BakeError>(())
    /// ```
    pub fn into_levels(self) -> impl Iterator<Item = ProbeGrid<'s>> {
        self.levels.into_iter()
    }

    /// The light at `point`, as [`ProbeGrid::look_up`] has it, from the finest probes that are there, and continuous where they end. What share of all weights valid probes have.
    pub fn look_up(&self, point: Vec3, held: &mut [Spectrum]) -> f32 {
        mix(&self.levels, point, held)
    }

    /// [`ProbeGrid::value`] of all levels.
    #[must_use]
    pub fn value(&self, point: Vec3, direction: Vec3) -> Spectrum {
        let basis = self.finest().basis;
        let mut held = [Spectrum::ZERO; MOST_COEFFICIENTS];
        let held = &mut held[..basis.count()];
        self.look_up(point, held);
        basis.value(held, direction).max(Spectrum::ZERO)
    }

    /// Single-scattering albedo and extinction (m⁻¹) at `point`, mixed from all probes around by the same weights, whether or not they are valid.
    #[must_use]
    pub fn medium(&self, point: Vec3) -> (Spectrum, Spectrum) {
        let (mut albedo, mut extinction) = (Spectrum::ZERO, Spectrum::ZERO);
        for_each_weight(&self.levels, point, |level, number, weight, _| {
            let probe = &self.levels[level].probes()[number];
            albedo += probe.albedo * weight;
            extinction += probe.extinction * weight;
        });
        (albedo, extinction)
    }

    /// [`ProbeGrid::dilate`] of each level.
    pub fn dilate(&mut self) -> usize {
        self.levels.iter_mut().map(ProbeGrid::dilate).sum()
    }

    /// [`ProbeGrid::relative_coarseness`] of what look-ups see: of each level where there is no finer one, by volume, in proportion to the mean of the grid that has all
    /// probes.
    #[must_use]
    pub fn relative_coarseness(&self) -> [f32; 2] {
        let (mut squares, mut most, mut volume) = (0.0_f64, 0.0_f64, 0.0_f64);
        let mut each = 1.0;
        for (number, grid) in self.levels.iter().enumerate() {
            let finer = self.levels.get(number + 1);
            let is_seen = |probe: usize| {
                let place = |finer: &ProbeGrid<'_>| grid.cell_of(probe).map(|cell| grid.finer_place(finer, cell));
                finer.and_then(|finer| finer.brick_at(place(finer)?)).is_none()
            };
            let valid = grid.probes().iter().enumerate().filter(|(_, probe)| probe.is_valid());
            for (probe, _) in valid.filter(|(probe, _)| is_seen(*probe)) {
                let off = f64::from(grid.coarseness(probe));
                (squares, most, volume) = (squares + each * off * off, most.max(off), volume + each);
            }
            each /= 8.0;
        }
        let level = self.levels[0].level_of_numbers();
        let over = |off: f64| if level > 0.0 { (off / level) as f32 } else { 0.0 };
        [over(libm::sqrt(squares / volume.max(each))), over(most)]
    }
}

/// Calls `visit(level, number, weight, offset)` for all probes that have a part at a point; the weights sum to 1, or to what is there if the first level lacks some.
#[inline]
fn for_each_weight(levels: &[ProbeGrid<'_>], point: Vec3, mut visit: impl FnMut(usize, usize, f32, Vec3)) {
    let mut rest = 1.0;
    for (level, grid) in levels.iter().enumerate().rev() {
        let around = grid.around(point);
        let mut part = 1.0;
        if level > 0 {
            let is_inner = |number: Option<usize>| number.is_some_and(|number| grid.probes()[number].is_inner());
            let inner = around.map(|(number, weight, _)| if is_inner(number) { Some(weight) } else { None });
            if inner.iter().any(Option::is_none) {
                part = inner.into_iter().flatten().sum::<f32>().min(1.0);
            }
        }
        if part > 0.0 {
            for (number, weight, offset) in around {
                if let Some(number) = number.filter(|_| weight > 0.0) {
                    visit(level, number, rest * part * weight, offset);
                }
            }
        }
        rest *= 1.0 - part;
        if !(rest > 0.0) {
            return;
        }
    }
}

/// How many levels have a part at a point.
#[cfg(test)]
pub(super) fn levels_at(levels: &[ProbeGrid<'_>], point: Vec3) -> usize {
    let mut found = 0_u32;
    for_each_weight(levels, point, |level, _, _, _| found |= 1 << level);
    found.count_ones() as usize
}

/// Probes that may have a part at a point.
const AROUND: usize = 8 * MOST_LEVELS;

/// See [`ProbeLevels::look_up`].
pub(super) fn mix(levels: &[ProbeGrid<'_>], point: Vec3, held: &mut [Spectrum]) -> f32 {
    let (mut share, mut total) = (0.0, 0.0);
    let mut all = heapless::Vec::<(usize, usize, f32, f32), AROUND>::new();
    for_each_weight(levels, point, |level, number, weight, offset| {
        let probe = &levels[level].probes()[number];
        let part = if probe.is_valid() { weight * probe.sees(offset) } else { 0.0 };
        share += if probe.is_valid() { weight } else { 0.0 };
        total += part;
        // There is room for all.
        let _ = all.push((level, number, weight, part));
    });
    held.fill(Spectrum::ZERO);
    for (level, number, weight, part) in all {
        let weight = if total > 0.0 { part / total } else { weight };
        if weight > 0.0 {
            held.iter_mut().zip(levels[level].held(number)).for_each(|(sum, value)| *sum += *value * weight);
        }
    }
    share
}

/// Cells around those that a grid is too coarse for whose bricks are finer, too. With none, look-ups within the cells themselves go over into the coarser level.
const AROUND_BRICKS: u32 = 1;

impl ProbeGrid<'_> {
    /// Whether there are probes in all cells around that of a probe which are in the box.
    fn has_all_around(&self, number: usize) -> bool {
        let Some(cell) = self.cell_of(number) else { return false };
        let (at, size) = (self.at(cell), self.lattice.size());
        (0..27).all(|i| {
            let near: [u32; 3] = core::array::from_fn(|axis| {
                let step = i / 3_i32.pow(axis as u32) % 3 - 1;
                at[axis].saturating_add_signed(step).min(size[axis] - 1)
            });
            self.number_of(self.flat(near)).is_some()
        })
    }

    /// The place of the brick of a finer grid that covers a cell of this one.
    fn finer_place(&self, finer: &ProbeGrid<'_>, cell: usize) -> usize {
        let [x, y, z] = self.at(cell).map(|i| (2 * i / BRICK) as usize);
        let [bx, by, _] = finer.brick_counts().map(|n| n as usize);
        x + bx * (y + by * z)
    }

    /// A grid of half the spacing, to be baked ([`Bake::resume`](super::Bake::resume)), of those bricks alone within which look-ups between probes are off by more than `error` of `level` (W·m⁻²·sr⁻¹, of irradiance
    /// W·m⁻²), as [`ProbeGrid::coarseness`] says. Their probes will have the bits of those of a grid that has all. `None` where there are none.
    ///
    /// # Errors
    /// [`BakeError::Lattice`] if that is more than a grid has along an edge, [`BakeError::Probes`] for more than [`MOST_PROBES`], [`BakeError::Memory`] for lent memory that is too small.
    ///
    /// ```
    /// # use fogbow::{host::Empty, light::Light, math::{Bounds, Vec3}, medium::Homogeneous, phase::Phase, spectrum::Spectrum};
    /// # use fogbow::{work, world::{Outline, World}};
    /// # use fogbow::bake::{Bake, BakeMemory, BakeSettings, BakedProbes};
    /// # #[cfg(feature = "alloc")] {
    /// # let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
    /// # let sky = [Light::Constant(Spectrum::ONE)];
    /// # let world = World { medium: &fog, scene: &Empty, lights: (&sky).into() };
    /// # let bounds = Bounds { min: Vec3::ZERO, max: Vec3::ONE };
    /// # let mut settings = BakeSettings { most_passes: 2, ..BakeSettings::for_outline(&Outline::of(&world, bounds), [4, 4, 4]) };
    /// # settings.paths.max_scatterings = 2;
    /// let mut bake = Bake::new(settings)?;
    /// work::finish(&mut bake, &world, &mut BakedProbes::default());
    /// let grid = bake.finish();
    /// // Light that varies less than the grid can hold.
    /// assert!(grid.finer(grid.level(), 9.0, BakeMemory::default())?.is_none());
    /// # }
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    pub fn finer<'t>(
        &self,
        level: f64,
        error: f32,
        memory: BakeMemory<'t>,
    ) -> Result<Option<ProbeGrid<'t>>, BakeError> {
        let lattice = Lattice::new(self.lattice.bounds(), self.lattice.size().map(|n| n.saturating_mul(2)))?;
        let most = f64::from(error) * level * self.basis.number_of_mean(self.quantity);
        let Self { basis, quantity, orders, .. } = *self;
        let mut finer = ProbeGrid { lattice, basis, quantity, orders, memory };
        let is_coarse = |number: usize| self.probes()[number].is_valid() && f64::from(self.coarseness(number)) > most;
        let places = finer.brick_counts().iter().map(|&n| n as usize).product::<usize>();
        let mut bricks = 0_usize;
        finer.memory.places.clear();
        for place in 0..places {
            // Cells of this grid within the brick, and those around it, all over which look-ups go over into this grid.
            let first = finer.first_of(place).map(|i| i / 2);
            let range = |axis: usize| {
                let end = (first[axis] + BRICK / 2 + AROUND_BRICKS).min(self.lattice.size()[axis]);
                first[axis].saturating_sub(AROUND_BRICKS)..end
            };
            let mut cells = range(2).flat_map(|z| range(1).flat_map(move |y| range(0).map(move |x| [x, y, z])));
            let is_wanted = cells.any(|at| self.number_of(self.flat(at)).is_some_and(is_coarse));
            if is_wanted {
                bricks += 1;
                finer.memory.places.push(place as u32).map_err(|Full| BakeError::Memory)?;
            }
        }
        if bricks * PROBES > MOST_PROBES {
            return Err(BakeError::Probes((bricks * PROBES) as u64));
        }
        if bricks == 0 {
            return Ok(None);
        }
        let BakeMemory { values, deviations, probes, bricks: progress, places: _ } = &mut finer.memory;
        let mut reset = || {
            values.reset(bricks * PROBES * basis.count(), Spectrum::ZERO)?;
            deviations.reset(bricks * PROBES * basis.count(), 0.0)?;
            probes.reset(bricks * PROBES, Probe::default())?;
            progress.reset(bricks, Brick { passes: 0, due: 1 })
        };
        reset().map_err(|Full| BakeError::Memory)?;
        for number in 0..bricks * PROBES {
            if finer.has_all_around(number) {
                finer.memory.probes.as_mut_slice()[number].state |= INNER;
            }
        }
        Ok(Some(finer))
    }
}
