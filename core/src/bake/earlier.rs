//! What of an earlier grid is kept, of a world that has changed since.
//!
//! ```text
//! D² = mean over probes and numbers of |new − old|² − error²(new) − error²(old)      kept where D² ≤ max(half of the error asked for, error of the brick)²
//! ```
//!
//! Whether the light of a brick has changed is asked of its first passes. They have random numbers of their own, which no pass of the earlier grid has had, so that what
//! both differ by is light or known noise; all later passes have those of any other bake, so that what is baked anew differs by as little as it may.

use super::fill::Bake;
use super::grid::{BakeMemory, Brick, ProbeGrid};
use super::settings::BakeError;
use crate::bytes::{Crc, elements};

/// One over the share of a brick's earlier passes after which it is asked whether it has changed. Larger: what has not changed is told by luck; smaller: little is gained.
const PILOT: u32 = 4;

/// Fewest of them. Fewer: errors of a brick's 64 probes together are not known well enough.
const LEAST_PILOT: u32 = 4;

/// Most that what is kept may be off by, in errors asked for, where its own noise is less. Larger: what moves stays until it is off by as much, and then jumps; smaller: first
/// passes cannot tell.
const LAG: f64 = 0.5;

/// An earlier grid.
#[derive(Debug, Clone, Copy)]
pub(super) struct Earlier<'c> {
    grid: &'c ProbeGrid<'c>,
    /// Most passes of its bricks.
    most: u32,
    /// Sets the random numbers of first passes apart from those of the earlier grid.
    key: u64,
    /// The mean that errors are in proportion to.
    level: f64,
}

impl<'c> Earlier<'c> {
    /// First passes of a brick, after which it is asked whether it has changed; none where nothing is known of it. Those of photons serve all.
    fn pilot(&self, place: usize, has_photons: bool) -> u32 {
        let known = self.grid.brick_at(place).map_or(0, |there| self.grid.memory.bricks.as_slice()[there].passes);
        let passes = if has_photons { self.most } else { known };
        if passes == 0 { 0 } else { passes.div_ceil(PILOT).max(LEAST_PILOT) }
    }

    /// What chooses the random numbers of a pass over the brick at a place.
    pub(super) fn seed(&self, seed: u64, place: usize, pass: u32, has_photons: bool) -> u64 {
        if pass < self.pilot(place, has_photons) { seed ^ self.key } else { seed }
    }

    /// The same of photons, which serve all bricks.
    pub(super) fn seed_of_photons(&self, seed: u64, pass: u32) -> u64 {
        self.seed(seed, 0, pass, true)
    }

    /// The earlier brick that is one, number by number.
    fn same(&self, grid: &ProbeGrid<'_>, brick: usize) -> Option<(usize, Brick)> {
        let there = self.grid.brick_at(grid.place(brick))?;
        Some((there, self.grid.memory.bricks.as_slice()[there])).filter(|(_, progress)| progress.passes > 0)
    }

    /// Whether a brick has its earlier light: the same bits, which no other passes have.
    pub(super) fn is_kept(&self, grid: &ProbeGrid<'_>, brick: usize) -> bool {
        let Some((there, progress)) = self.same(grid, brick) else { return false };
        let is_same = |((number, _), (earlier, _))| grid.held(number) == self.grid.held(earlier);
        let mut probes = grid.in_brick(brick).zip(self.grid.in_brick(there));
        grid.memory.bricks.as_slice()[brick].passes == progress.passes && probes.all(is_same)
    }

    /// Whether all first passes of a brick are there, and its light is that of the earlier grid as far as they tell.
    fn is_as_before(&self, grid: &ProbeGrid<'_>, brick: usize, error: f32, has_photons: bool) -> bool {
        let Some((there, _)) = self.same(grid, brick) else { return false };
        let Brick { passes, due } = grid.memory.bricks.as_slice()[brick];
        if passes != due || passes != self.pilot(grid.place(brick), has_photons) {
            return false;
        }
        let (mut squares, mut explained, mut own, mut numbers) = (0.0_f64, 0.0_f64, 0.0_f64, 0_u32);
        for ((number, _), (earlier, _)) in grid.in_brick(brick).zip(self.grid.in_brick(there)) {
            match [&grid.probes()[number], &self.grid.probes()[earlier]].map(|probe| probe.is_valid()) {
                [true, true] => {}
                // In a wall now, or beside all media.
                [false, _] => continue,
                [true, false] => return false,
            }
            for (i, (new, old)) in grid.held(number).iter().zip(self.grid.held(earlier)).enumerate() {
                let [here, before] = [grid.error(number, i), self.grid.error(earlier, i)].map(f64::from);
                squares += f64::from((*new - *old).map(|off| off * off).mean());
                explained += here * here + before * before;
                own += before * before;
                numbers += 1;
            }
        }
        let asked = LAG * f64::from(error) * self.level;
        squares - explained <= own.max(asked * asked * f64::from(numbers))
    }

    /// Gives a brick its earlier light. What lies beside it is that of the world as it is.
    fn keep(&self, grid: &mut ProbeGrid<'_>, brick: usize) {
        let Some((there, progress)) = self.same(grid, brick) else { return };
        let each = grid.basis.count();
        for ((number, _), (earlier, _)) in grid.in_brick(brick).zip(self.grid.in_brick(there)) {
            let [to, from] = [number, earlier].map(|probe| probe * each..(probe + 1) * each);
            let BakeMemory { values, deviations, .. } = &self.grid.memory;
            grid.memory.values.as_mut_slice()[to.clone()].copy_from_slice(&values.as_slice()[from.clone()]);
            grid.memory.deviations.as_mut_slice()[to].copy_from_slice(&deviations.as_slice()[from]);
        }
        grid.memory.bricks.as_mut_slice()[brick] = Brick { passes: progress.passes, due: progress.passes };
    }

    /// Keeps all bricks that have not changed.
    pub(super) fn keep_unchanged(&self, grid: &mut ProbeGrid<'_>, error: f32, has_photons: bool) {
        for brick in 0..grid.memory.bricks.len() {
            if self.is_as_before(grid, brick, error, has_photons) {
                self.keep(grid, brick);
            }
        }
    }
}

impl<'c> Bake<'_, 'c> {
    /// Keeps what has not changed since an `earlier` grid of the same cells was baked, as of the frame before in an animation: the light of every brick of 4 × 4 × 4 probes
    /// that a fourth of its earlier passes cannot tell from what it was, to half of the error asked for or that of the brick itself, whichever is larger. It stays bit for bit; all others are baked anew.
    /// Extinction and albedo are those of the world as it is in any case.
    ///
    /// Light is compared with the grid it was baked for, however many frames ago, so that small changes do not add up. For bakes that have not begun, and those that were begun so; before
    /// [`Bake::with_photons`] or after it.
    ///
    /// # Errors
    /// A grid of other cells or of other light: [`BakeError::Grid`].
    ///
    /// ```
    /// # use fogbow::{host::Empty, light::{Light, PointLight}, math::{Bounds, Vec3}, medium::{Homogeneous, Placed, Region}, phase::Phase};
    /// # use fogbow::{spectrum::Spectrum, work, world::{Outline, World}};
    /// # use fogbow::bake::{Bake, BakeSettings, BakedProbes, ProbeBasis};
    /// # #[cfg(feature = "alloc")] {
    /// # let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::splat(0.8), Phase::ISOTROPIC)?;
    /// # let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.0)?);
    /// # let lamps = [Light::Point(PointLight::from_flux(2.0 * Vec3::Y, Spectrum::ONE)?)];
    /// # let world = World { medium: &ball, scene: &Empty, lights: (&lamps).into() };
    /// # let outline = Outline::of(&world, Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE });
    /// # let settings = BakeSettings { basis: ProbeBasis::Fluence, ..BakeSettings::for_outline(&outline, [8, 4, 4]) };
    /// let mut first = Bake::new(settings)?;
    /// work::finish(&mut first, &world, &mut BakedProbes::default());
    /// // A frame in which nothing has moved.
    /// let mut second = Bake::new(settings)?.after(first.grid())?;
    /// work::finish(&mut second, &world, &mut BakedProbes::default());
    /// assert_eq!(second.kept(), 2);   // of two bricks
    /// assert_eq!(second.grid().held(7), first.grid().held(7));
    /// # }
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    pub fn after(mut self, earlier: &'c ProbeGrid<'c>) -> Result<Self, BakeError> {
        let light = |grid: &ProbeGrid<'_>| (grid.lattice, grid.basis, grid.quantity, grid.orders);
        if light(earlier) != light(self.grid()) {
            return Err(BakeError::Grid);
        }
        let mut crc = Crc::new();
        let Ok(()) = elements(earlier.memory.values.as_slice(), &mut |bytes: &[u8]| {
            crc.add(bytes);
            Ok::<(), core::convert::Infallible>(())
        });
        let most = earlier.memory.bricks.as_slice().iter().map(|brick| brick.passes).max().unwrap_or(0);
        let level = self.level_of_numbers(earlier);
        // Never 0, which would be no key.
        self.set_earlier(Earlier { grid: earlier, most, key: crc.value() | 1, level });
        Ok(self)
    }

    /// How many bricks have the light of the [earlier](Bake::after) grid, so far.
    ///
    /// ```
    /// # use fogbow::{host::Empty, math::{Bounds, Vec3}, world::{Outline, World}};
    /// # use fogbow::bake::{Bake, BakeSettings};
    /// # #[cfg(feature = "alloc")] {
    /// # let bounds = Bounds { min: Vec3::ZERO, max: Vec3::ONE };
    /// # let outline = Outline::of(&World { medium: &Empty, scene: &Empty, lights: (&[]).into() }, bounds);
    /// # let settings = BakeSettings::for_outline(&outline, [5, 4, 4]);
    /// assert_eq!(Bake::new(settings)?.kept(), 0);   // there is no earlier one
    /// # }
    /// # Ok::<(), fogbow::bake::BakeError>(())
    /// ```
    #[must_use]
    pub fn kept(&self) -> usize {
        (0..self.grid().brick_count()).filter(|brick| self.is_kept(*brick)).count()
    }
}
