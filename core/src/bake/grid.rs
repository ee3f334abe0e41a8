//! What was baked.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::basis::{MOST_COEFFICIENTS, Orders, ProbeBasis, Quantity};
use super::levels;
use super::probe::Probe;
use super::settings::{BakeError, BakeSettings};
use crate::covariance::Lattice;
use crate::math::Bounds;
use crate::math::float::sqrt;
use crate::spectrum::Spectrum;
use crate::storage::{Full, List};

/// Probes along each side of a brick, which a job bakes.
pub(super) const BRICK: u32 = 4;

/// Most probes of a brick.
pub(super) const PROBES: usize = (BRICK * BRICK * BRICK) as usize;

/// Most rounds of dilation: each goes one probe farther.
const MOST_ROUNDS: u32 = 1024;

/// How far a brick of probes is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Brick {
    /// Passes that are in its probes.
    pub passes: u32,
    /// Passes that are to be, by the end of this round.
    pub(super) due: u32,
}

/// Memory of a [`Bake`](super::Bake), and of the [`ProbeGrid`] that comes of it.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Default))]
pub struct BakeMemory<'s> {
    /// For each probe as many as [`ProbeBasis::count`].
    pub values: List<'s, Spectrum>,
    /// As many.
    pub deviations: List<'s, f32>,
    /// One for each probe.
    pub probes: List<'s, Probe>,
    /// One for 4 × 4 × 4 probes.
    pub bricks: List<'s, Brick>,
    /// Of a grid that has some bricks alone ([`ProbeGrid::finer`]), where each of them is; of others none.
    pub places: List<'s, u32>,
}

impl BakeMemory<'_> {
    pub(super) fn nothing() -> Self {
        Self {
            values: (&mut [][..]).into(),
            deviations: (&mut [][..]).into(),
            probes: (&mut [][..]).into(),
            bricks: (&mut [][..]).into(),
            places: (&mut [][..]).into(),
        }
    }
}

/// How far one grid is from another: see [`ProbeGrid::deviation`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ProbeDeviation {
    /// Mean difference of light, whatever the direction, in proportion to the mean.
    pub bias: f32,
    /// Standard error of that.
    pub bias_error: f32,
    /// Root mean square of the differences of all numbers in proportion to the mean light, without what their standard errors explain.
    pub spread: f32,
    /// Probes that both grids know.
    pub probes: u32,
}

/// Probes in the cells of a box: what a [`Bake`](super::Bake) makes.
///
/// ```
/// # use fogbow::{host::Empty, light::Light, math::{Bounds, Ray, Vec3}, phase::Lobe, medium::{Homogeneous, Placed, Region}};
/// # use fogbow::{march::eye_ray, spectrum::Spectrum, work, world::{Outline, World}};
/// # #[cfg(feature = "alloc")] {
/// use fogbow::bake::{Bake, BakeSettings, BakedProbes, Orders, ProbeBasis, ProbeState, Quantity};
/// // A ball of fog in one corner of the box, below an even sky.
/// # let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::splat(0.5), Lobe::HenyeyGreenstein { g: 0.5 })?;
/// let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 0.4)?);
/// # let sky = [Light::Constant(Spectrum::ONE)];
/// # let world = World { medium: &ball, scene: &Empty, lights: (&sky).into() };
/// # let outline = Outline::of(&world, Bounds { min: Vec3::ZERO, max: Vec3::ONE });
/// # let settings = BakeSettings { most_passes: 2, ..BakeSettings::for_outline(&outline, [4, 4, 4]) };
/// # let mut bake = Bake::new(settings)?;
/// # work::finish(&mut bake, &world, &mut BakedProbes::default());
/// let mut grid = bake.finish();
/// assert_eq!((grid.basis(), grid.quantity()), (ProbeBasis::SphericalHarmonics { degree: 2 }, Quantity::InScattered));
/// assert_eq!(grid.orders(), Orders::All);
///
/// // A probe: its numbers, their errors, what lies beside.
/// let probe = grid.lattice().index(Vec3::splat(0.1)).unwrap();
/// assert_eq!((grid.held(probe).len(), grid.passes(probe)), (9, 2));
/// assert!(grid.error(probe, 0) < 1.0 && grid.relative_error() < 1.0 && grid.probes()[probe].albedo[0] == 1.0);
///
/// // Anywhere: all numbers, and what share of the probes around has any; or the light in a direction.
/// let mut held = [Spectrum::ZERO; 9];
/// assert!(grid.look_up(Vec3::splat(0.2), &mut held) > 0.999);
/// assert!((grid.value(Vec3::splat(0.2), Vec3::X)[0] - 1.0).abs() < 0.5);
/// assert_eq!((grid.deviation(&grid).spread, grid.leaks()), (0.0, 0));
/// assert!(grid.relative_coarseness()[1] < 0.5 && grid.coarseness(probe) < 0.5);
///
/// // Along an eye ray.
/// let (ray, of_grid) = (Ray::new(-Vec3::Z, Vec3::Z), |point, to_eye, _: &_| grid.value(point, to_eye));
/// let seen = eye_ray(&ray, &ball, |_| 0.05, of_grid, 0.5);
/// assert!((seen.radiance[0] + seen.transmittance[0] - 1.0).abs() < 0.3); // a furnace
///
/// // Where there is no fog nothing was baked; other probes' light spreads there.
/// let far = grid.lattice().index(Vec3::splat(0.9)).unwrap();
/// assert!(grid.probes()[far].state() == ProbeState::Empty && grid.held(far)[0].is_black());
/// assert!(grid.dilate() > 0 && !grid.held(far)[0].is_black());
/// assert_eq!(grid.bytes(), 64 * (9 * 16 + 80) + 8);
/// # }
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct ProbeGrid<'s> {
    pub(super) lattice: Lattice,
    pub(super) basis: ProbeBasis,
    pub(super) quantity: Quantity,
    pub(super) orders: Orders,
    pub(super) memory: BakeMemory<'s>,
}

impl<'s> ProbeGrid<'s> {
    /// Of which nothing is known.
    pub(super) fn new(settings: &BakeSettings, memory: BakeMemory<'s>) -> Result<Self, BakeError> {
        let lattice = settings.lattice()?;
        let BakeSettings { basis, quantity, orders, .. } = *settings;
        let mut grid = Self { lattice, basis, quantity, orders, memory };
        let (probes, numbers) = (lattice.cell_count(), lattice.cell_count() * settings.basis.count());
        let bricks = grid.brick_counts().iter().map(|&n| n as usize).product();
        let BakeMemory { values, deviations, probes: states, bricks: progress, places } = &mut grid.memory;
        let mut reset = || {
            places.clear();
            values.reset(numbers, Spectrum::ZERO)?;
            deviations.reset(numbers, 0.0)?;
            states.reset(probes, Probe::default())?;
            progress.reset(bricks, Brick { passes: 0, due: 1 })
        };
        reset().map_err(|Full| BakeError::Memory)?;
        Ok(grid)
    }
}

impl ProbeGrid<'_> {
    /// The cells, with a probe in the centre of each; of a grid that has some bricks alone ([`ProbeGrid::finer`]), of some.
    #[must_use]
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// What a probe holds.
    #[must_use]
    pub fn basis(&self) -> ProbeBasis {
        self.basis
    }

    /// Which light of a direction that is.
    #[must_use]
    pub fn quantity(&self) -> Quantity {
        self.quantity
    }

    /// Which light is in it.
    #[must_use]
    pub fn orders(&self) -> Orders {
        self.orders
    }

    /// The numbers of a probe; those of an invalid one are 0 before [`ProbeGrid::dilate`].
    ///
    /// # Panics
    /// If there is no such probe.
    #[must_use]
    pub fn held(&self, index: usize) -> &[Spectrum] {
        &self.memory.values.as_slice()[self.numbers(index)]
    }

    /// What lies beside the light of the probes, in the order of the cells; of a grid that has some bricks alone, 64 for each brick in the order of
    /// [`ProbeGrid::places`], x first in each, with unknown ones beyond the border of the box.
    #[must_use]
    pub fn probes(&self) -> &[Probe] {
        self.memory.probes.as_slice()
    }

    /// Standard error of a number of a probe, a root mean square over its channels: of what was sampled, without what caches have wrong.
    /// Infinite before there are two passes; 0 for a probe that is not valid.
    ///
    /// # Panics
    /// If there is no such probe or number.
    #[must_use]
    pub fn error(&self, index: usize, number: usize) -> f32 {
        if !self.probes()[index].is_valid() {
            return 0.0;
        }
        let n = self.memory.bricks.as_slice()[self.brick_of(index)].passes;
        if n < 2 {
            return f32::INFINITY;
        }
        let deviation = self.memory.deviations.as_slice()[self.numbers(index)][number];
        sqrt(deviation / n as f32 / (n - 1) as f32)
    }

    /// Standard error of all valid probes and their numbers, a root mean square, in proportion to the mean light of the grid; see
    /// [`ProbeGrid::error`]. 0 in the dark.
    #[must_use]
    pub fn relative_error(&self) -> f32 {
        self.error_over(self.level_of_numbers())
    }

    /// The same in proportion to a mean of numbers.
    pub(super) fn error_over(&self, level: f64) -> f32 {
        let (sum, numbers) = self.squared_errors(0..self.probes().len());
        let error = libm::sqrt(sum / f64::from(numbers.max(1))) / level;
        // In the dark there is nothing to be in proportion to.
        if error.is_nan() { 0.0 } else { error as f32 }
    }

    /// Mean light of valid probes over all directions (W·m⁻²·sr⁻¹, of irradiance W·m⁻²): what errors are in proportion to, whatever the basis.
    ///
    /// ```
    /// # use fogbow::{host::Empty, light::Light, math::{Bounds, Vec3}, medium::{Homogeneous, Placed, Region}, phase::Phase};
    /// # use fogbow::{spectrum::Spectrum, work, world::{Outline, World}};
    /// # use fogbow::bake::{Bake, BakeSettings, BakedProbes};
    /// # #[cfg(feature = "alloc")] {
    /// # let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::splat(0.5), Phase::ISOTROPIC)?;
    /// # let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.0)?);
    /// # let sky = [Light::Constant(Spectrum::splat(3.0))];
    /// # let world = World { medium: &ball, scene: &Empty, lights: (&sky).into() };
    /// # let bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
    /// # let settings = BakeSettings { error: 0.02, ..BakeSettings::for_outline(&Outline::of(&world, bounds), [2, 2, 2]) };
    /// let mut bake = Bake::new(settings)?;
    /// work::finish(&mut bake, &world, &mut BakedProbes::default());
    /// assert!((bake.grid().level() - 3.0).abs() < 0.2);   // fog that absorbs nothing is as bright as the sky
    /// # }
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    #[must_use]
    pub fn level(&self) -> f64 {
        self.level_of_numbers() / self.basis.number_of_mean(self.quantity)
    }

    /// The same as probes hold it: the mean of first coefficients, of fluence.
    pub(super) fn level_of_numbers(&self) -> f64 {
        let (mut sum, mut count) = (0.0_f64, 0_u32);
        for (index, _) in self.probes().iter().enumerate().filter(|(_, probe)| probe.is_valid()) {
            sum += f64::from(self.basis.level(self.held(index)));
            count += 1;
        }
        sum / f64::from(count.max(1))
    }

    /// The sum over the numbers of valid probes among those given, and how many there are.
    pub(super) fn squared_errors(&self, probes: impl Iterator<Item = usize>) -> (f64, u32) {
        let (mut sum, mut numbers) = (0.0_f64, 0_u32);
        for index in probes.filter(|index| self.probes()[*index].is_valid()) {
            for number in 0..self.basis.count() {
                let error = f64::from(self.error(index, number));
                sum += error * error;
                numbers += 1;
            }
        }
        (sum, numbers)
    }

    /// Pairs of neighbours, both valid, with a surface between them: where light leaks through walls that hold no probe in engines that mix all
    /// probes around a point, whatever they are. Look-ups here leave out those behind a surface.
    #[must_use]
    pub fn leaks(&self) -> usize {
        let of = |(number, probe): (usize, &Probe)| {
            let walls = probe.walls();
            let leaks = |axis: &usize| {
                walls[*axis]
                    && probe.is_valid()
                    && self.beside(number, *axis, 1).is_some_and(|next| self.probes()[next].is_valid())
            };
            (0..3).filter(leaks).count()
        };
        self.probes().iter().enumerate().map(of).sum()
    }

    /// How far look-ups half way from a probe to its neighbours are off because the grid is too coarse for how light varies (in the unit of light),
    /// a root mean square over numbers: an eighth of the second differences along the axes, added up, without what their standard errors explain. Nothing along axes where probes
    /// or neighbours are not valid or not there.
    ///
    /// Exact where light changes quadratically; at the edge of a shadow about right; of what varies between two probes and not at them, nothing is known.
    ///
    /// # Panics
    /// If there is no such probe.
    #[must_use]
    pub fn coarseness(&self, index: usize) -> f32 {
        let mut sum = 0.0;
        for axis in 0..3 {
            let (Some(before), Some(after)) = (self.beside(index, axis, -1), self.beside(index, axis, 1)) else {
                continue;
            };
            let three = [before, index, after];
            if !three.iter().all(|probe| self.probes()[*probe].is_valid()) {
                continue;
            }
            let [before, here, after] = three.map(|probe| self.held(probe));
            let mut squares = 0.0;
            for number in 0..self.basis.count() {
                let second = before[number] + after[number] - here[number] * 2.0;
                let [a, b, c] = three.map(|probe| self.error(probe, number));
                squares += second.map(|second| second * second).mean() - (a * a + 4.0 * b * b + c * c);
            }
            sum += sqrt((squares / self.basis.count() as f32).max(0.0)) / 8.0;
        }
        sum
    }

    /// The root mean square of [`ProbeGrid::coarseness`] and the greatest, in proportion to the mean light of the grid; 0 in the dark.
    #[must_use]
    pub fn relative_coarseness(&self) -> [f32; 2] {
        let (mut squares, mut most, mut count) = (0.0_f64, 0.0_f64, 0_u32);
        for (index, _) in self.probes().iter().enumerate().filter(|(_, probe)| probe.is_valid()) {
            let off = f64::from(self.coarseness(index));
            (squares, most, count) = (squares + off * off, most.max(off), count + 1);
        }
        let level = self.level_of_numbers();
        let over = |off: f64| if level > 0.0 { (off / level) as f32 } else { 0.0 };
        [over(libm::sqrt(squares / f64::from(count.max(1)))), over(most)]
    }

    /// Passes that are in a probe.
    ///
    /// # Panics
    /// If there is no such probe.
    #[must_use]
    pub fn passes(&self, index: usize) -> u32 {
        self.memory.bricks.as_slice()[self.brick_of(index)].passes
    }

    /// The light at `point`, mixed from the eight probes around it, to `held`; beyond the outermost probes that of the nearest of them.
    /// What share of the weights valid probes have.
    ///
    /// ```text
    /// Σ w v s c / Σ w v s      w: trilinear weights, v: 1 where a probe is valid, else 0, s: how much of a part it has at `point` (Probe::sees)
    /// ```
    ///
    /// Where no probe is valid, `Σ w c`: what [`ProbeGrid::dilate`] has left there.
    pub fn look_up(&self, point: Vec3, held: &mut [Spectrum]) -> f32 {
        levels::mix(core::slice::from_ref(self), point, held)
    }

    /// The cells around a point, or of the nearest of the outermost probes: the number of each one's probe, if it is there, its trilinear weight, and where the point lies as seen from it, in cells.
    #[inline]
    pub(super) fn around(&self, point: Vec3) -> [(Option<usize>, f32, Vec3); 8] {
        let bounds = self.lattice.bounds();
        let point = point.clamp(bounds.min, bounds.max);
        let around = self.lattice.around(point).unwrap_or_default();
        // Beyond the outermost probes, as at them.
        let cell = self.lattice.cell();
        let inside = point.max(bounds.min + 0.5 * cell).min(bounds.max - 0.5 * cell);
        around.map(|(index, weight)| {
            let offset = (inside - self.lattice.centre(index)) / cell;
            (self.number_of(index), weight, offset)
        })
    }

    /// The light at `point` in a direction (unit): in-scattered radiance (W·m⁻²·sr⁻¹, without `σₛ`) towards it, or irradiance (W·m⁻²) of
    /// a surface with this normal, as was baked. No less than 0, which expansions may go below.
    #[must_use]
    pub fn value(&self, point: Vec3, direction: Vec3) -> Spectrum {
        let mut held = [Spectrum::ZERO; MOST_COEFFICIENTS];
        let held = &mut held[..self.basis.count()];
        self.look_up(point, held);
        self.basis.value(held, direction).max(Spectrum::ZERO)
    }

    /// How far this grid is from an unbiased one with the same cells and numbers, by the probes that are valid in both: what caches have wrong,
    /// which no standard error tells.
    ///
    /// # Panics
    /// If the other has fewer probes or numbers.
    #[must_use]
    pub fn deviation(&self, unbiased: &Self) -> ProbeDeviation {
        let (mut level, mut bias, mut noise, mut squares) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0_f64);
        let (mut explained, mut probes) = (0.0_f64, 0_u32);
        let known = |index: usize| self.probes()[index].is_valid() && unbiased.probes()[index].is_valid();
        let squared_error = |index: usize, number: usize| {
            let [a, b] = [self, unbiased].map(|grid| f64::from(grid.error(index, number)));
            a * a + b * b
        };
        for index in (0..self.probes().len()).filter(|index| known(*index)) {
            let (held, due) = (self.held(index), unbiased.held(index));
            level += f64::from(self.basis.level(due));
            bias += f64::from(self.basis.level(held) - self.basis.level(due));
            noise += squared_error(index, 0);
            for (number, (held, due)) in held.iter().zip(due).enumerate() {
                let off = (*held - *due).map(|off| off * off).mean();
                squares += f64::from(off);
                explained += squared_error(index, number);
            }
            probes += 1;
        }
        // All in proportion to the sum of light; in the dark to nothing.
        let over = |sum: f64| if level > 0.0 { (sum / level) as f32 } else { 0.0 };
        let numbers = f64::from(probes) / self.basis.count() as f64;
        ProbeDeviation {
            bias: over(bias),
            bias_error: over(libm::sqrt(noise)),
            spread: over(libm::sqrt((squares - explained).max(0.0) * numbers)),
            probes,
        }
    }

    /// Lets the light of valid probes spread into those that are not, the nearer a probe the more of it, round by round: for engines that mix
    /// all eight probes whatever they are. Look-ups here need it only where no probe around is valid. How many probes it reached.
    pub fn dilate(&mut self) -> usize {
        let count = self.probes().len();
        let each = self.basis.count();
        let mut reached = 0;
        // Of the round in which a probe got its light; a probe gives it on in later ones.
        let known = |probe: &Probe, round: u32| probe.is_valid() || (probe.state >> 8 != 0 && probe.state >> 8 < round);
        for round in 1..=MOST_ROUNDS {
            let before = reached;
            for index in 0..count {
                if known(&self.probes()[index], round + 1) {
                    continue;
                }
                let (mut sum, mut total) = ([Spectrum::ZERO; MOST_COEFFICIENTS], 0.0);
                let Some(cell) = self.cell_of(index) else { continue };
                for_each_neighbour(&self.lattice, cell, |neighbour, distance_squared| {
                    let Some(neighbour) = self.number_of(neighbour) else { return };
                    if known(&self.memory.probes.as_slice()[neighbour], round) {
                        let weight = 1.0 / distance_squared;
                        let light = &self.memory.values.as_slice()[neighbour * each..][..each];
                        sum.iter_mut().zip(light).for_each(|(sum, light)| *sum += *light * weight);
                        total += weight;
                    }
                });
                if total > 0.0 {
                    let slots = &mut self.memory.values.as_mut_slice()[index * each..][..each];
                    slots.iter_mut().zip(sum).for_each(|(slot, sum)| *slot = sum / total);
                    self.memory.probes.as_mut_slice()[index].state |= round << 8;
                    reached += 1;
                }
            }
            if reached == before {
                break;
            }
        }
        // Marks of rounds go.
        self.memory.probes.as_mut_slice().iter_mut().for_each(|probe| probe.state &= 0xff);
        reached
    }

    /// Bytes of memory.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let BakeMemory { values, deviations, probes, bricks, places } = &self.memory;
        size_of_val(values.as_slice())
            + size_of_val(deviations.as_slice())
            + size_of_val(probes.as_slice())
            + size_of_val(bricks.as_slice())
            + size_of_val(places.as_slice())
    }

    fn numbers(&self, index: usize) -> core::ops::Range<usize> {
        let each = self.basis.count();
        index * each..(index + 1) * each
    }

    /// How many bricks of 4 × 4 × 4 probes, or of what is left of them at the border, there are.
    ///
    /// ```
    /// # use fogbow::{host::Empty, math::{Bounds, Vec3}, world::{Outline, World}};
    /// # use fogbow::bake::{Bake, BakeSettings};
    /// # #[cfg(feature = "alloc")] {
    /// # let bounds = Bounds { min: Vec3::ZERO, max: Vec3::ONE };
    /// # let outline = Outline::of(&World { medium: &Empty, scene: &Empty, lights: (&[]).into() }, bounds);
    /// let grid = Bake::new(BakeSettings::for_outline(&outline, [5, 4, 4]))?.finish();
    /// assert_eq!(grid.brick_count(), 2);
    /// # }
    /// # Ok::<(), fogbow::bake::BakeError>(())
    /// ```
    #[must_use]
    pub fn brick_count(&self) -> usize {
        self.memory.bricks.len()
    }

    pub(super) fn brick_counts(&self) -> [u32; 3] {
        self.lattice.size().map(|n| n.div_ceil(BRICK))
    }

    /// Where the bricks of a grid are that has some alone ([`ProbeGrid::finer`]), in rising order: numbers among all bricks of 4 × 4 × 4 cells of the lattice, x first. Of others, none.
    ///
    /// ```
    /// # use fogbow::{host::Empty, math::{Bounds, Vec3}, world::{Outline, World}};
    /// # use fogbow::bake::{Bake, BakeSettings};
    /// # #[cfg(feature = "alloc")] {
    /// # let bounds = Bounds { min: Vec3::ZERO, max: Vec3::ONE };
    /// # let outline = Outline::of(&World { medium: &Empty, scene: &Empty, lights: (&[]).into() }, bounds);
    /// let grid = Bake::new(BakeSettings::for_outline(&outline, [5, 4, 4]))?.finish();
    /// assert!(grid.places().is_empty());   // all of its bricks are there
    /// # }
    /// # Ok::<(), fogbow::bake::BakeError>(())
    /// ```
    #[must_use]
    pub fn places(&self) -> &[u32] {
        self.memory.places.as_slice()
    }

    /// The brick that holds a probe.
    fn brick_of(&self, number: usize) -> usize {
        if self.is_sparse() { number / PROBES } else { self.place_of(number) }
    }

    /// The brick at a place, if there is one.
    pub(super) fn brick_at(&self, place: usize) -> Option<usize> {
        if self.is_sparse() { self.places().binary_search(&(place as u32)).ok() } else { Some(place) }
    }

    pub(super) fn is_sparse(&self) -> bool {
        !self.places().is_empty()
    }

    /// The brick of all those of the lattice that holds a cell.
    fn place_of(&self, cell: usize) -> usize {
        let [bx, by, _] = self.brick_counts().map(|n| n as usize);
        let [x, y, z] = self.at(cell).map(|i| (i / BRICK) as usize);
        x + bx * (y + by * z)
    }

    /// Where a brick is among all those of the lattice.
    pub(super) fn place(&self, brick: usize) -> usize {
        self.places().get(brick).map_or(brick, |place| *place as usize)
    }

    /// Where a cell is, counted along x, y and z.
    pub(super) fn at(&self, cell: usize) -> [u32; 3] {
        let [nx, ny, _] = self.lattice.size().map(|n| n as usize);
        [cell % nx, cell / nx % ny, cell / (nx * ny)].map(|i| i as u32)
    }

    pub(super) fn flat(&self, [x, y, z]: [u32; 3]) -> usize {
        let [nx, ny, _] = self.lattice.size().map(|n| n as usize);
        x as usize + nx * (y as usize + ny * z as usize)
    }

    /// The number of a cell's probe, if there is one.
    ///
    /// ```
    /// # use fogbow::{host::Empty, math::{Bounds, Vec3}, world::{Outline, World}};
    /// # use fogbow::bake::{Bake, BakeSettings};
    /// # #[cfg(feature = "alloc")] {
    /// # let bounds = Bounds { min: Vec3::ZERO, max: Vec3::ONE };
    /// # let outline = Outline::of(&World { medium: &Empty, scene: &Empty, lights: (&[]).into() }, bounds);
    /// let grid = Bake::new(BakeSettings::for_outline(&outline, [5, 4, 4]))?.finish();
    /// // All cells have probes, in the same order.
    /// assert_eq!((grid.number_of(7), grid.cell_of(7), grid.places().len()), (Some(7), Some(7), 0));
    /// # }
    /// # Ok::<(), fogbow::bake::BakeError>(())
    /// ```
    #[inline]
    #[must_use]
    pub fn number_of(&self, cell: usize) -> Option<usize> {
        if !self.is_sparse() {
            return Some(cell);
        }
        let brick = self.brick_at(self.place_of(cell))?;
        let [x, y, z] = self.at(cell).map(|i| (i % BRICK) as usize);
        const SIDE: usize = BRICK as usize;
        Some(brick * PROBES + x + SIDE * (y + SIDE * z))
    }

    /// The cell of a probe; `None` for those beyond the border of the box, of which nothing is ever known.
    ///
    /// ```
    /// # use fogbow::{host::Empty, math::{Bounds, Vec3}, world::{Outline, World}};
    /// # use fogbow::bake::{Bake, BakeSettings};
    /// # #[cfg(feature = "alloc")] {
    /// # let bounds = Bounds { min: Vec3::ZERO, max: Vec3::ONE };
    /// # let outline = Outline::of(&World { medium: &Empty, scene: &Empty, lights: (&[]).into() }, bounds);
    /// let grid = Bake::new(BakeSettings::for_outline(&outline, [5, 4, 4]))?.finish();
    /// assert!((0..80).all(|cell| grid.cell_of(cell) == Some(cell)));   // the inverse of `number_of`
    /// # }
    /// # Ok::<(), fogbow::bake::BakeError>(())
    /// ```
    #[must_use]
    pub fn cell_of(&self, number: usize) -> Option<usize> {
        if !self.is_sparse() {
            return Some(number);
        }
        let first = self.first_of(self.place(number / PROBES));
        let local = (number % PROBES) as u32;
        let at = [local % BRICK, local / BRICK % BRICK, local / (BRICK * BRICK)];
        let at: [u32; 3] = core::array::from_fn(|i| first[i] + at[i]);
        (0..3).all(|i| at[i] < self.lattice.size()[i]).then(|| self.flat(at))
    }

    /// The probe so many cells farther along an axis, if there is one.
    fn beside(&self, number: usize, axis: usize, step: i32) -> Option<usize> {
        let mut at = self.at(self.cell_of(number)?);
        at[axis] = at[axis].checked_add_signed(step).filter(|i| *i < self.lattice.size()[axis])?;
        self.number_of(self.flat(at))
    }

    /// The first cell of a brick of the lattice.
    pub(super) fn first_of(&self, place: usize) -> [u32; 3] {
        let [bx, by, _] = self.brick_counts().map(|n| n as usize);
        [place % bx, place / bx % by, place / (bx * by)].map(|i| i as u32 * BRICK)
    }

    /// The cells of a brick, in the same order.
    pub(super) fn brick_lattice(&self, brick: usize) -> Option<Lattice> {
        let (size, first) = (self.lattice.size(), self.first_of(self.place(brick)));
        let end: [u32; 3] = core::array::from_fn(|i| (first[i] + BRICK).min(size[i]));
        let at =
            |at: [u32; 3]| self.lattice.bounds().min + self.lattice.cell() * Vec3::from_array(at.map(|n| n as f32));
        let counts = core::array::from_fn(|i| end[i] - first[i]);
        Lattice::new(Bounds { min: at(first), max: at(end) }, counts).ok()
    }

    /// The probes of a brick, in the order in which jobs leave them: the number of each, and its cell.
    pub(super) fn in_brick(&self, brick: usize) -> impl Iterator<Item = (usize, usize)> + use<> {
        let (size, first, is_sparse) = (self.lattice.size(), self.first_of(self.place(brick)), self.is_sparse());
        let end: [u32; 3] = core::array::from_fn(|i| (first[i] + BRICK).min(size[i]));
        let both = move |x: u32, y: u32, z: u32| {
            let cell = x as usize + size[0] as usize * (y as usize + size[1] as usize * z as usize);
            let local = x - first[0] + BRICK * (y - first[1] + BRICK * (z - first[2]));
            (if is_sparse { brick * PROBES + local as usize } else { cell }, cell)
        };
        (first[2]..end[2])
            .flat_map(move |z| (first[1]..end[1]).flat_map(move |y| (first[0]..end[0]).map(move |x| both(x, y, z))))
    }
}

/// Calls `visit(index, squared distance)` (m²) for the cells that touch one.
fn for_each_neighbour(lattice: &Lattice, index: usize, mut visit: impl FnMut(usize, f32)) {
    let size = lattice.size().map(|n| n as usize);
    let at = [index % size[0], index / size[0] % size[1], index / (size[0] * size[1])];
    let range = |axis: usize| at[axis].saturating_sub(1)..=(at[axis] + 1).min(size[axis] - 1);
    for z in range(2) {
        for y in range(1) {
            for x in range(0) {
                let offset = Vec3::from_array(core::array::from_fn(|i| [x, y, z][i].abs_diff(at[i]) as f32));
                let neighbour = x + size[0] * (y + size[1] * z);
                if neighbour != index {
                    visit(neighbour, (offset * lattice.cell()).length_squared());
                }
            }
        }
    }
}
