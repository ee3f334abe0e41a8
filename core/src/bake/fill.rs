//! Passes over bricks of probes, as work in rounds.
//!
//! A job is one pass over one brick. What a pass finds depends on the brick's probes, the number of the pass, and the world; a round gives every
//! brick that is not good enough one pass more. So bricks may be done in any order, and a grid knows all that is needed to go on.

use core::ops::Range;

use glam::Vec3;

use super::arriving::{Sampler, phase_at};
use super::basis::MOST_COEFFICIENTS;
use super::earlier::Earlier;
use super::flights::{FlightMemory, PhotonFlight, Photons, is_unlike_part, open_share};
use super::grid::{BakeMemory, Brick, PROBES, ProbeGrid};
use super::places;
use super::probe::{BY_PATHS, INNER, Probe, WALLS_AT};
use super::settings::{BakeError, BakeSettings};
use crate::cache::RadianceCaches;
use crate::host::{Medium, Scene};
use crate::math::Bounds;
use crate::phase::Phase;
use crate::sampling::independent;
use crate::spectrum::Spectrum;
use crate::storage::List;
use crate::work::Rounds;
use crate::world::World;

/// Sets the random numbers of probes apart from those of pixels.
const BAKE_KEY: u64 = 0xba4e_0000_0000_0000;

/// Passes before errors are believed. Fewer: bricks end by luck; more: time where little is sampled.
const LEAST_PASSES: u32 = 8;

/// Of the directions of a pass, probes that have paths where others have photons get one in so many: there are as many passes as the grid as a whole needs, and these few probes took half
/// of the time for a tenth of what it is off by. Smaller: they take longer; larger: they are what is waited for.
const BESIDE_PHOTONS: u32 = 3;

/// What a job of a [`Bake`] leaves.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Default))]
pub struct BakedProbes<'o> {
    pub(super) values: List<'o, Spectrum>,
    pub(super) probes: List<'o, Probe>,
    pub(super) flights: List<'o, PhotonFlight>,
    pub(super) is_cut: bool,
}

impl<'o> BakedProbes<'o> {
    /// In lent memory: for 64 probes, and as many times the numbers that one holds. Where there is less, the brick stays as it is and
    /// [`Bake::is_cut`].
    ///
    /// ```
    /// # use fogbow::{bake::{BakedProbes, Probe, ProbeBasis}, spectrum::Spectrum};
    /// const NUMBERS: usize = 9; // ProbeBasis::count of degree 2
    /// let (mut values, mut probes) = ([Spectrum::ZERO; 64 * NUMBERS], [Probe::default(); 64]);
    /// let output = BakedProbes::lent(&mut values, &mut probes); // for one job after the other
    /// # assert_eq!(ProbeBasis::SphericalHarmonics { degree: 2 }.count(), NUMBERS);
    /// # drop(output);
    /// ```
    #[must_use]
    pub fn lent(values: &'o mut [Spectrum], probes: &'o mut [Probe]) -> Self {
        Self { values: values.into(), probes: probes.into(), flights: (&mut [][..]).into(), is_cut: false }
    }

    /// With memory for the flights of a job of [`Bake::with_photons`], of 1024 photons.
    ///
    /// ```
    /// # use fogbow::{host::Empty, light::{Light, PointLight}, math::{Bounds, Vec3}, medium::{Homogeneous, Placed, Region}, phase::Phase};
    /// # use fogbow::{spectrum::Spectrum, work, world::{Outline, World}};
    /// # use fogbow::bake::{Bake, BakeSettings, BakedProbes, FlightMemory, PhotonFlight, Probe, ProbeBasis};
    /// # #[cfg(feature = "alloc")] {
    /// # let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::splat(0.8), Phase::ISOTROPIC)?;
    /// # let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.0)?);
    /// # let lamps = [Light::Point(PointLight::from_flux(0.2 * Vec3::Y, Spectrum::ONE)?)];
    /// # let world = World { medium: &ball, scene: &Empty, lights: (&lamps).into() };
    /// # let outline = Outline::of(&world, Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE });
    /// # let settings = BakeSettings { basis: ProbeBasis::Fluence, error: 0.2, ..BakeSettings::for_outline(&outline, [4, 4, 4]) };
    /// let (mut values, mut probes) = ([Spectrum::ZERO; 64], [Probe::default(); 64]);
    /// let mut flights = vec![PhotonFlight::default(); 32 * 1024];
    /// let mut output = BakedProbes::lent(&mut values, &mut probes).with_flights(&mut flights);
    /// let mut bake = Bake::new(settings)?.with_photons(FlightMemory::default(), outline.bounds);
    /// work::finish(&mut bake, &world, &mut output);
    /// assert!(!bake.is_cut());   // a ball of fog leaves a photon about one flight
    /// # }
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_flights(self, flights: &'o mut [PhotonFlight]) -> Self {
        Self { flights: flights.into(), ..self }
    }
}

/// The bake of a grid, as [`Rounds`] of jobs in a [`World`].
///
/// ```
/// # use fogbow::{host::Empty, light::Light, math::{Bounds, Vec3}, phase::Lobe, medium::{Homogeneous, Placed, Region}};
/// # use fogbow::{spectrum::Spectrum, work, world::{Outline, World}};
/// # #[cfg(feature = "alloc")] {
/// use fogbow::bake::{Bake, BakeSettings, BakedProbes};
/// // Fog that absorbs nothing, below an even sky: as bright as the sky, from everywhere.
/// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::splat(0.5), Lobe::HenyeyGreenstein { g: 0.5 })?;
/// let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.0)?);
/// let sky = [Light::Constant(Spectrum::ONE)];
/// let world = World { medium: &ball, scene: &Empty, lights: (&sky).into() };
/// let outline = Outline::of(&world, Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE });
///
/// let mut bake = Bake::new(BakeSettings { error: 0.05, ..BakeSettings::for_outline(&outline, [4, 4, 4]) })?;
/// work::finish(&mut bake, &world, &mut BakedProbes::default()); // Or job by job, or on threads: see `work`.
/// assert!(bake.share() == 1.0 && !bake.is_cut() && bake.grid().relative_error() < 0.05);
/// assert!(bake.grid().passes(0) >= 8);
/// let grid = bake.finish();
/// assert!((grid.value(Vec3::ZERO, Vec3::X)[0] - 1.0).abs() < 0.1);
/// # }
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Bake<'s, 'c> {
    settings: BakeSettings,
    grid: ProbeGrid<'s>,
    caches: Option<&'c RadianceCaches<'c>>,
    photons: Option<Photons<'s>>,
    earlier: Option<Earlier<'c>>,
    /// The brick whose result is due.
    next: u32,
    bricks: u32,
    /// Whether this begins where a round has ended: which bricks have one more pass goes by all that is said of the bake, then.
    is_between_rounds: bool,
    /// The share of the work that is done, after the last round.
    share: f32,
    is_cut: bool,
}

#[cfg(feature = "alloc")]
impl<'c> Bake<'static, 'c> {
    /// In memory that grows; all light is sampled, without bias.
    ///
    /// # Errors
    /// What cannot be baked.
    pub fn new(settings: BakeSettings) -> Result<Self, BakeError> {
        Self::new_in(BakeMemory::default(), settings)
    }
}

impl<'s, 'c> Bake<'s, 'c> {
    /// In lent memory.
    ///
    /// # Errors
    /// What cannot be baked.
    ///
    /// ```
    /// # use fogbow::{host::Empty, light::Light, math::{Bounds, Vec3}, medium::Homogeneous, phase::Phase, spectrum::Spectrum};
    /// # use fogbow::{work, world::{Outline, World}};
    /// use fogbow::bake::{Bake, BakeMemory, BakeSettings, BakedProbes, Brick, Probe, ProbeBasis};
    /// # let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
    /// # let world = World { medium: &fog, scene: &Empty, lights: (&[]).into() };
    /// # let outline = Outline::of(&world, Bounds { min: Vec3::ZERO, max: Vec3::ONE });
    /// let settings = BakeSettings { basis: ProbeBasis::Fluence, ..BakeSettings::for_outline(&outline, [4, 4, 4]) };
    /// let (mut values, mut deviations) = ([Spectrum::ZERO; 64], [0.0; 64]);
    /// let (mut probes, mut bricks) = ([Probe::default(); 64], [Brick::default(); 1]);
    /// let memory = BakeMemory {
    ///     values: (&mut values[..]).into(),
    ///     deviations: (&mut deviations[..]).into(),
    ///     probes: (&mut probes[..]).into(),
    ///     bricks: (&mut bricks[..]).into(),
    ///     places: (&mut [][..]).into(), // of a grid that has all probes, none
    /// };
    /// let mut bake = Bake::new_in(memory, settings)?;
    /// let (mut of_job, mut beside) = ([Spectrum::ZERO; 64], [Probe::default(); 64]);
    /// work::finish(&mut bake, &world, &mut BakedProbes::lent(&mut of_job, &mut beside));
    /// assert!(!bake.is_cut() && bake.finish().value(Vec3::ONE, Vec3::Z).is_black()); // no lights
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    pub fn new_in(memory: BakeMemory<'s>, settings: BakeSettings) -> Result<Self, BakeError> {
        Ok(Self::over(ProbeGrid::new(&settings, memory)?, settings))
    }

    fn over(grid: ProbeGrid<'s>, settings: BakeSettings) -> Self {
        let bricks = grid.memory.bricks.len() as u32;
        let (caches, photons, earlier) = (None, None, None);
        let (next, share, is_cut, is_between_rounds) = (0, 0.0, false, false);
        Self { settings, grid, caches, photons, earlier, next, bricks, is_between_rounds, share, is_cut }
    }

    /// Goes on where an earlier bake was left, whose `grid` was baked by the same settings: the bits of one that was not. A smaller error, or
    /// more passes, is what may differ.
    ///
    /// # Errors
    /// A grid of other cells or of other light: [`BakeError::Grid`].
    ///
    /// ```
    /// # use fogbow::{host::Empty, light::Light, math::{Bounds, Vec3}, medium::Homogeneous, phase::Phase, spectrum::Spectrum};
    /// # use fogbow::{work, world::{Outline, World}};
    /// # use fogbow::bake::{Bake, BakeError, BakeSettings, BakedProbes};
    /// # #[cfg(feature = "alloc")] {
    /// # let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
    /// # let sky = [Light::Constant(Spectrum::ONE)];
    /// # let world = World { medium: &fog, scene: &Empty, lights: (&sky).into() };
    /// # let bounds = Bounds { min: Vec3::ZERO, max: Vec3::ONE };
    /// # let mut settings = BakeSettings { most_passes: 3, ..BakeSettings::for_outline(&Outline::of(&world, bounds), [2, 2, 2]) };
    /// # settings.paths.max_scatterings = 2;
    /// let mut bake = Bake::new(settings)?;
    /// work::step(&mut bake, &world, &mut BakedProbes::default()); // one pass
    /// let mut again = Bake::resume(bake.finish(), settings)?;
    /// work::finish(&mut again, &world, &mut BakedProbes::default());
    /// assert!(again.finish().passes(0) >= 2);
    /// # let other = BakeSettings { counts: [1, 1, 1], ..settings };
    /// # assert_eq!(Bake::resume(Bake::new(settings)?.finish(), other).err(), Some(BakeError::Grid));
    /// # }
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    pub fn resume(grid: ProbeGrid<'s>, settings: BakeSettings) -> Result<Self, BakeError> {
        let held = (settings.basis, settings.quantity, settings.orders);
        if settings.cells(!grid.is_sparse())? != grid.lattice || held != (grid.basis, grid.quantity, grid.orders) {
            return Err(BakeError::Grid);
        }
        let mut bake = Self::over(grid, settings);
        match bake.grid.memory.bricks.as_slice().iter().position(|brick| brick.passes < brick.due) {
            Some(brick) => bake.next = brick as u32,
            None => {
                bake.is_between_rounds = true;
                bake.plan();
            }
        }
        Ok(bake)
    }

    /// Reads what radiance caches know at the probes, where they were filled for the same world and all of the box
    /// ([`Asked::Box`](crate::cache::Asked::Box)): quick, and as far off as single records are, which in thin fog reach far. Only the rest is sampled: light straight
    /// from the lights, unless it is cached, what no record reaches, and all irradiance of surfaces, of which records in a medium know nothing.
    ///
    /// What caches have wrong is in the probes, and in no standard error; [`ProbeGrid::deviation`] tells it. Light that a medium emits is in none.
    ///
    /// ```
    /// # use fogbow::{host::Empty, light::{Light, PointLight}, math::{Bounds, Vec3}, medium::{Homogeneous, Placed, Region}, phase::Phase};
    /// # use fogbow::cache::{Asked, FilledRecords, RadianceCaches, Settings};
    /// # use fogbow::{spectrum::Spectrum, work, world::{Outline, World}};
    /// # use fogbow::bake::{Bake, BakeSettings, BakedProbes, Orders, ProbeBasis};
    /// # #[cfg(feature = "alloc")] {
    /// # let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::splat(0.8), Phase::ISOTROPIC)?;
    /// # let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.0)?);
    /// # let lamps = [Light::Point(PointLight::from_flux(0.2 * Vec3::Y, Spectrum::ONE)?)];
    /// # let world = World { medium: &ball, scene: &Empty, lights: (&lamps).into() };
    /// # let bounds = Bounds { min: Vec3::splat(-0.5), max: Vec3::splat(0.5) };
    /// # let outline = Outline::of(&world, Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE });
    /// # let settings = Settings { rays: 200, ..Settings::for_outline(&outline, 0.02).with_walks(64) };
    /// let mut filling = RadianceCaches::new(settings).fill(Asked::anywhere_in(bounds));
    /// work::finish(&mut filling, &world, &mut FilledRecords::default());
    /// let caches = filling.finish();
    /// let settings = BakeSettings {
    ///     bounds,
    ///     basis: ProbeBasis::Fluence,
    ///     orders: Orders::Indirect,
    ///     ..BakeSettings::for_outline(&outline, [4, 4, 4])
    /// };
    /// let mut bake = Bake::new(settings)?.with_caches(&caches);
    /// work::finish(&mut bake, &world, &mut BakedProbes::default());
    /// let grid = bake.finish();
    /// let point = grid.lattice().centre(21);
    /// assert_eq!(grid.held(21)[0], caches.fluence(point).unwrap());
    /// # }
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_caches(self, caches: &'c RadianceCaches<'c>) -> Self {
        Self { caches: Some(caches), ..self }
    }

    /// The same bake without its caches, and without an [earlier](Bake::after) grid, for hosts that keep a bake from call to call and lend caches for each. All jobs of a bake want
    /// the same of both.
    ///
    /// ```
    /// # use fogbow::{host::Empty, light::Light, math::{Bounds, Vec3}, medium::Homogeneous, phase::Phase, spectrum::Spectrum};
    /// # use fogbow::{work, world::{Outline, World}};
    /// # use fogbow::bake::{Bake, BakeSettings, BakedProbes};
    /// # #[cfg(feature = "alloc")] {
    /// # let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
    /// # let sky = [Light::Constant(Spectrum::ONE)];
    /// # let world = World { medium: &fog, scene: &Empty, lights: (&sky).into() };
    /// # let bounds = Bounds { min: Vec3::ZERO, max: Vec3::ONE };
    /// # let settings = BakeSettings { most_passes: 2, ..BakeSettings::for_outline(&Outline::of(&world, bounds), [8, 1, 1]) };
    /// let mut bake = Bake::new(settings)?;
    /// while work::step(&mut bake, &world, &mut BakedProbes::default()) {
    ///     bake = bake.without_caches(); // it goes on where it was
    /// }
    /// assert_eq!([bake.grid().passes(0), bake.grid().passes(7)], [2, 2]);
    /// # }
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    #[must_use]
    pub fn without_caches<'d>(self) -> Bake<'s, 'd> {
        let Self { settings, grid, caches: _, photons, earlier: _, next, bricks, is_between_rounds, share, is_cut } =
            self;
        let (caches, earlier) = (None, None);
        Bake { settings, grid, caches, photons, earlier, next, bricks, is_between_rounds, share, is_cut }
    }

    /// Lets photons from the lights find light that was scattered before it comes to a probe. All probes share them: in the atrium of the examples
    /// 17 times faster than paths from each probe would be, at 2 % of error with 32³ probes (decision 79).
    ///
    /// What a probe gets is the mean over its cell, or over the part that surfaces do not hide: off by about a third of what
    /// [`ProbeGrid::coarseness`] tells, which is in no standard error. Light straight from the lights is that at the probe. Light that a medium emits is in none.
    /// `world` should hold all surfaces and media. For bakes that have not begun, and those that were begun so.
    ///
    /// ```
    /// # use fogbow::{host::Empty, light::{Light, PointLight}, math::{Bounds, Vec3}, medium::{Homogeneous, Placed, Region}, phase::Phase};
    /// # use fogbow::{spectrum::Spectrum, work, world::{Outline, World}};
    /// # use fogbow::bake::{Bake, BakeSettings, BakedProbes, FlightMemory, Orders, ProbeBasis};
    /// # #[cfg(feature = "alloc")] {
    /// # let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::splat(0.8), Phase::ISOTROPIC)?;
    /// # let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.0)?);
    /// # let lamps = [Light::Point(PointLight::from_flux(0.2 * Vec3::Y, Spectrum::ONE)?)];
    /// # let world = World { medium: &ball, scene: &Empty, lights: (&lamps).into() };
    /// # let outline = Outline::of(&world, Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE });
    /// # let settings = BakeSettings { basis: ProbeBasis::Fluence, error: 0.05, ..BakeSettings::for_outline(&outline, [4, 4, 4]) };
    /// let mut bake = Bake::new(settings)?.with_photons(FlightMemory::default(), outline.bounds);
    /// work::finish(&mut bake, &world, &mut BakedProbes::default());
    /// let mut by_paths = Bake::new(settings)?;
    /// work::finish(&mut by_paths, &world, &mut BakedProbes::default());
    /// assert!(bake.grid().deviation(by_paths.grid()).bias.abs() < 0.05);
    /// # }
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_photons(mut self, memory: FlightMemory<'s>, world: Bounds) -> Self {
        self.photons = Some(Photons::new(memory, world, self.grid.lattice.cell_count()));
        self.begin();
        self
    }

    /// Whether a brick has the light of the earlier grid.
    pub(super) fn is_kept(&self, brick: usize) -> bool {
        self.earlier.is_some_and(|earlier| earlier.is_kept(&self.grid, brick))
    }

    pub(super) fn set_earlier(&mut self, earlier: Earlier<'c>) {
        self.earlier = Some(earlier);
        self.begin();
    }

    /// Begins, or goes on, with all that is said of the bake.
    fn begin(&mut self) {
        if self.is_between_rounds {
            self.grid.memory.bricks.as_mut_slice().iter_mut().for_each(|brick| brick.due = brick.passes);
            self.plan();
        } else {
            self.begin_photons();
        }
    }

    /// Begins the photons of the next pass. Bricks that have more passes than others wait for them, so that every pass of a brick is of its own photons.
    fn begin_photons(&mut self) {
        let Some(photons) = &mut self.photons else { return };
        let bricks = self.grid.memory.bricks.as_mut_slice();
        let waiting = bricks.iter().filter(|brick| brick.passes < brick.due).map(|brick| brick.passes);
        let Some(pass) = waiting.min() else { return };
        bricks.iter_mut().filter(|brick| brick.passes > pass).for_each(|brick| brick.due = brick.passes);
        photons.begin(pass);
    }

    /// Bakes those bricks alone that `is_wanted`, by their number; of the probes of all others nothing will be known. For a part of a grid,
    /// and to tell how far another bake is off by a few unbiased ones: [`ProbeGrid::deviation`]. For bakes that have not begun.
    ///
    /// ```
    /// # use fogbow::{host::Empty, light::Light, math::{Bounds, Vec3}, medium::Homogeneous, phase::Phase, spectrum::Spectrum};
    /// # use fogbow::{work, world::{Outline, World}};
    /// # use fogbow::bake::{Bake, BakeSettings, BakedProbes};
    /// # #[cfg(feature = "alloc")] {
    /// # let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
    /// # let sky = [Light::Constant(Spectrum::ONE)];
    /// # let world = World { medium: &fog, scene: &Empty, lights: (&sky).into() };
    /// # let bounds = Bounds { min: Vec3::ZERO, max: Vec3::ONE };
    /// # let settings = BakeSettings { most_passes: 2, ..BakeSettings::for_outline(&Outline::of(&world, bounds), [8, 1, 1]) };
    /// let mut bake = Bake::new(settings)?.only(|brick| brick == 1);
    /// work::finish(&mut bake, &world, &mut BakedProbes::default());
    /// assert_eq!([bake.grid().passes(0), bake.grid().passes(7)], [0, 2]);
    /// # }
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    #[must_use]
    pub fn only(mut self, is_wanted: impl Fn(usize) -> bool) -> Self {
        for (number, brick) in self.grid.memory.bricks.as_mut_slice().iter_mut().enumerate() {
            if !is_wanted(number) {
                brick.due = brick.passes;
            }
        }
        self
    }

    /// Bakes the bricks anew that have a part in a box (m), where the world has changed; all others stay as they are. Nothing else changes if
    /// nothing has changed.
    ///
    /// ```
    /// # use fogbow::{host::Empty, light::Light, math::{Bounds, Vec3}, medium::Homogeneous, phase::Phase, spectrum::Spectrum};
    /// # use fogbow::{work, world::{Outline, World}};
    /// # use fogbow::bake::{Bake, BakeSettings, BakedProbes};
    /// # #[cfg(feature = "alloc")] {
    /// # let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
    /// # let sky = [Light::Constant(Spectrum::ONE)];
    /// # let world = World { medium: &fog, scene: &Empty, lights: (&sky).into() };
    /// # let bounds = Bounds { min: Vec3::ZERO, max: Vec3::ONE };
    /// # let mut settings = BakeSettings { most_passes: 2, ..BakeSettings::for_outline(&Outline::of(&world, bounds), [8, 1, 1]) };
    /// # settings.paths.max_scatterings = 1;
    /// let mut bake = Bake::new(settings)?;
    /// work::finish(&mut bake, &world, &mut BakedProbes::default());
    /// bake.bake_anew(Bounds { min: Vec3::ZERO, max: Vec3::splat(0.3) });
    /// assert_eq!(bake.grid().passes(0), 0); // one of two bricks
    /// assert_eq!(bake.grid().passes(7), 2);
    /// # }
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    pub fn bake_anew(&mut self, bounds: Bounds) {
        let (lattice, half) = (self.grid.lattice, 0.5 * self.grid.lattice.cell());
        for brick in 0..self.bricks as usize {
            let touches = |index: usize| {
                let centre = lattice.centre(index);
                (centre + half).cmpge(bounds.min).all() && (centre - half).cmple(bounds.max).all()
            };
            if self.grid.in_brick(brick).any(|(_, cell)| touches(cell)) {
                self.grid.memory.bricks.as_mut_slice()[brick] = Brick { passes: 0, due: 1 };
            }
        }
        self.next = 0;
        self.begin_photons();
    }

    /// The grid, as far as it is baked.
    #[must_use]
    pub fn grid(&self) -> &ProbeGrid<'s> {
        &self.grid
    }

    /// The grid, as far as it is baked.
    #[must_use]
    pub fn finish(self) -> ProbeGrid<'s> {
        self.grid
    }

    /// About what share of the work is done, in [0, 1].
    #[must_use]
    pub fn share(&self) -> f32 {
        if self.jobs_left() { self.share } else { 1.0 }
    }

    /// Whether lent memory was too small for what a job found, and a brick was left out.
    #[must_use]
    pub fn is_cut(&self) -> bool {
        self.is_cut
    }

    fn jobs_left(&self) -> bool {
        self.next < self.bricks
    }

    /// The mean that errors are in proportion to, as a grid's probes hold it.
    pub(super) fn level_of_numbers(&self, grid: &ProbeGrid<'_>) -> f64 {
        let of_mean = |mean: f32| f64::from(mean) * grid.basis.number_of_mean(grid.quantity);
        self.settings.level.map_or_else(|| grid.level_of_numbers(), of_mean)
    }

    /// Which bricks have one more pass.
    fn plan(&mut self) {
        if let Some(earlier) = self.earlier {
            earlier.keep_unchanged(&mut self.grid, self.settings.error, self.photons.is_some());
        }
        let level = self.level_of_numbers(&self.grid);
        let by_photons = self.photons.is_some().then(|| {
            let not_kept = (0..self.bricks as usize).filter(|brick| !self.is_kept(*brick));
            let most = not_kept.map(|brick| self.grid.memory.bricks.as_slice()[brick].passes).max();
            (most.unwrap_or(0), self.grid.error_over(level) / self.settings.error)
        });
        let (mut due, mut done) = (0_u32, 0.0_f32);
        for brick in 0..self.bricks as usize {
            let share = match by_photons {
                _ if self.is_kept(brick) => None,
                None => self.share_of_brick(brick, level),
                Some((most, times)) => self.share_by_photons(brick, most, times),
            };
            done += share.unwrap_or(1.0);
            if share.is_some() {
                let brick = &mut self.grid.memory.bricks.as_mut_slice()[brick];
                brick.due = brick.passes + 1;
                due += 1;
            }
        }
        self.share = done / self.bricks.max(1) as f32;
        self.next = if due > 0 { 0 } else { self.bricks };
        self.begin_photons();
    }

    /// The share of a brick's passes that it has; `None` where it has all.
    fn share_of_brick(&self, brick: usize, level: f64) -> Option<f32> {
        let Self { settings, grid, .. } = self;
        let numbers_of = || grid.in_brick(brick).map(|(number, _)| number);
        let (sum, numbers) = grid.squared_errors(numbers_of());
        let relative = libm::sqrt(sum / f64::from(numbers.max(1))) / level;
        let Brick { passes, .. } = grid.memory.bricks.as_slice()[brick];
        // Where nothing is random nothing is gained; but what is black so far may have rare light.
        let is_lit = || numbers_of().any(|index| grid.held(index).iter().any(|number| !number.is_black()));
        let is_known = sum == 0.0 && passes >= 2 && is_lit();
        // In the dark the quotient is no number, and all is good.
        let is_good = is_known || passes >= LEAST_PASSES && !(relative > f64::from(settings.error));
        if passes == 0 || numbers == 0 || is_good || passes >= settings.most_passes {
            return None;
        }
        Some(self.share_of_passes(passes, relative / f64::from(settings.error)))
    }

    /// The same where photons serve all bricks: then the error of the whole grid, so many times that asked for, says when they are enough, and all bricks
    /// have as many passes.
    fn share_by_photons(&self, brick: usize, most: u32, times: f32) -> Option<f32> {
        let Self { settings, grid, .. } = self;
        let Brick { passes, .. } = grid.memory.bricks.as_slice()[brick];
        let is_empty = || !grid.in_brick(brick).any(|(number, _)| grid.probes()[number].is_valid());
        let is_enough = passes >= LEAST_PASSES && times <= 1.0 || passes >= settings.most_passes;
        if passes == 0 || passes == most && is_enough || is_empty() {
            return None;
        }
        Some(self.share_of_passes(passes, f64::from(times)))
    }

    /// Of the passes that there will be, if the error is so many times that asked for.
    fn share_of_passes(&self, passes: u32, times: f64) -> f32 {
        let whole = f64::from(passes) * times * times;
        let whole = whole.max(f64::from(LEAST_PASSES)).min(f64::from(self.settings.most_passes));
        (f64::from(passes) / whole).min(1.0) as f32
    }

    /// The jobs of photons that are due before those of bricks.
    fn photon_jobs(&self) -> Option<(&Photons<'s>, Range<u32>)> {
        let photons = self.photons.as_ref().filter(|_| self.jobs_left())?;
        Some((photons, photons.jobs())).filter(|(_, jobs)| !jobs.is_empty())
    }
}

impl<M: Medium + ?Sized, S: Scene + ?Sized> Rounds<World<'_, M, S>> for Bake<'_, '_> {
    type Output<'o> = BakedProbes<'o>;

    fn jobs(&self) -> Range<u32> {
        self.photon_jobs().map_or(self.next..self.bricks, |(_, jobs)| jobs)
    }

    fn run(&self, job: u32, world: &World<'_, M, S>, output: &mut BakedProbes<'_>) {
        let BakedProbes { values, probes, flights, is_cut } = output;
        values.clear();
        probes.clear();
        flights.clear();
        *is_cut = false;
        let (grid, settings) = (&self.grid, &self.settings);
        if let Some((photons, _)) = self.photon_jobs() {
            let seed = |earlier: Earlier<'_>| earlier.seed_of_photons(settings.seed, photons.pass);
            let settings = BakeSettings { seed: self.earlier.map_or(settings.seed, seed), ..*settings };
            *is_cut = photons.shoot(job, world, &settings, flights).is_err();
            return;
        }
        let Some(&Brick { passes, due }) = grid.memory.bricks.as_slice().get(job as usize) else { return };
        if passes >= due {
            return;
        }
        let (cell, each) = (grid.lattice.cell(), grid.basis.count());
        let known = |(number, at): (usize, usize)| {
            let point = grid.lattice.centre(at);
            let held = grid.probes()[number];
            if passes > 0 {
                return held;
            }
            let probe = looked_at(point, cell, world, settings);
            let has_part = self.photons.is_none()
                || !probe.is_valid()
                || !is_unlike_part(point, cell, probe.all_planes(), world.scene);
            let by_paths = if has_part { 0 } else { BY_PATHS };
            Probe { state: probe.state | held.state & INNER | by_paths, ..probe }
        };
        let seen: heapless::Vec<Probe, PROBES> = grid.in_brick(job as usize).map(known).collect();
        let mut all = [[Spectrum::ZERO; MOST_COEFFICIENTS]; PROBES];
        if let Some(photons) = &self.photons {
            let phase = |(_, at)| phase_at(grid.lattice.centre(at), world, settings);
            let phases: heapless::Vec<Phase, PROBES> = grid.in_brick(job as usize).map(phase).collect();
            photons.add(grid, job as usize, &seen, &phases, &mut all);
        }
        let sampler = |probe: &Probe| {
            let has_photons = self.photons.is_some() && !probe.is_by_paths();
            let directions =
                if self.photons.is_some() { settings.directions.div_ceil(BESIDE_PHOTONS) } else { settings.directions };
            Sampler { settings, caches: self.caches, has_photons, directions }
        };
        let place = grid.place(job as usize);
        let seed = |earlier: Earlier<'_>| earlier.seed(settings.seed, place, passes, self.photons.is_some());
        let seed = self.earlier.map_or(settings.seed, seed);
        for (((_, at), probe), held) in grid.in_brick(job as usize).zip(&seen).zip(&mut all) {
            let held = &mut held[..each];
            if probe.is_valid() {
                // By the cell, whichever others are baked: bricks of a grid that has some alone are those of one that has all.
                let mut rng = independent(seed, BAKE_KEY | at as u64, passes);
                sampler(probe).sample(grid.lattice.centre(at), world, &mut rng, held);
                // No light is better than no number, which would be in all that is mixed with it.
                held.iter_mut().filter(|number| !number.is_finite()).for_each(|number| *number = Spectrum::ZERO);
            }
            *is_cut |= probes.push(*probe).is_err() || values.extend_from_slice(held).is_err();
        }
    }

    fn accept(&mut self, output: &BakedProbes<'_>) {
        if !self.jobs_left() {
            return;
        }
        if self.photon_jobs().is_some() {
            let taken = self.photons.as_mut().map(|photons| photons.accept(output.flights.as_slice(), &self.grid));
            self.is_cut |= output.is_cut || taken.is_some_and(|taken| taken.is_err());
            return;
        }
        let brick = self.next as usize;
        self.next += 1;
        self.is_cut |= output.is_cut;
        let each = self.grid.basis.count();
        let grid = &mut self.grid;
        let Brick { passes, due } = grid.memory.bricks.as_slice()[brick];
        if passes < due && !output.is_cut {
            let found = output.values.as_slice().chunks_exact(each).zip(output.probes.as_slice());
            for ((index, _), (held, probe)) in grid.in_brick(brick).zip(found) {
                let BakeMemory { values, deviations, probes, .. } = &mut grid.memory;
                probes.as_mut_slice()[index] = *probe;
                let values = &mut values.as_mut_slice()[index * each..][..each];
                let deviations = &mut deviations.as_mut_slice()[index * each..][..each];
                for ((mean, deviation), found) in values.iter_mut().zip(deviations).zip(held) {
                    add(mean, deviation, *found, passes + 1);
                }
            }
        }
        if passes < due {
            // A brick that finds no room has its passes, too, or it would be tried for ever.
            grid.memory.bricks.as_mut_slice()[brick].passes = due;
        }
        if self.next == self.bricks {
            self.plan();
        }
    }

    fn stage(&self) -> &'static str {
        if self.photon_jobs().is_some() { "photons" } else { "bake" }
    }
}

/// Mean and squared deviations with number `n` (Welford 1962), the deviations as a mean over channels.
fn add(mean: &mut Spectrum, deviation: &mut f32, found: Spectrum, n: u32) {
    if n == 1 {
        (*mean, *deviation) = (found, 0.0);
        return;
    }
    let before = found - *mean;
    *mean += before / n as f32;
    *deviation += (before * (found - *mean)).mean();
}

/// A probe of which nothing is known yet.
fn looked_at<M: Medium + ?Sized, S: Scene + ?Sized>(
    point: Vec3,
    cell: Vec3,
    world: &World<'_, M, S>,
    settings: &BakeSettings,
) -> Probe {
    let extinction = world.medium.mean_extinction(point, 0.5 * cell.min_element());
    let albedo = world.medium.properties(point).albedo();
    let state = places::state(point, cell, world, settings);
    let (walls, planes) = places::walls(point, cell, world.scene);
    let [near, other, third, fourth] = planes;
    Probe {
        extinction,
        albedo,
        near,
        other,
        third,
        fourth,
        open: open_share(planes),
        state: state as u32 | walls << WALLS_AT,
    }
}
