//! Making the lights of a pass, as work in rounds: paths from the lights, then what witnesses see of what they left.

use core::ops::Range;

use glam::Vec3;

use super::eye::receivers;
use super::gather::Gatherer;
use super::generate::{select, shoot};
use super::light::VirtualLight;
use super::scatterer::Receiver;
use super::settings::Settings;
use crate::host::{Medium, Scene};
use crate::math::{Bounds, Ray, float};
use crate::sampling::uniform::mix;
use crate::sampling::{Generator, GeneratorSource, even2, independent, uniform};
use crate::storage::List;
use crate::work::Rounds;
use crate::world::World;

/// Paths of one job at most. More: jobs take longer than some milliseconds in dense worlds. Changes no result.
const PATHS_PER_JOB: u32 = 64;

/// Jobs that paths are dealt out to, if there are so many. Fewer: where a path leaves hundreds of lights, a pass has few paths, and other
/// threads wait for the last job; more: hosts are busy with handing out jobs. Changes no result.
const TRACE_JOBS: u32 = 128;

/// Lights that one job connects to a witness. The same.
const LIGHTS_PER_JOB: u32 = 512;

/// Eye rays by whose points the lights that matter are found. More: importance is known better, and takes as much longer; fewer:
/// what few of them see is kept by its flux alone.
const SCOUTS: u32 = 64;

/// Weight of a light's flux in its importance: what the few points do not see may still matter. Larger: more lights are kept that no witness
/// sees; smaller: those that are kept shine too bright where one would have been needed.
const DEFENSIVE: f32 = 0.3;

/// Why there are no lights.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VplPassError {
    /// No lights, candidates, points, paths or samples.
    Settings,
    /// The medium glows; paths leave lights only, so light of the medium that it scatters itself would be missing.
    Glowing,
    /// More virtual lights than lent memory holds or 32 bits count.
    TooMany,
}

impl core::fmt::Display for VplPassError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Settings => "there must be at least one virtual light, candidate and point",
            Self::Glowing => "virtual lights do not know light of glowing media: take another method",
            Self::TooMany => "too many virtual lights",
        })
    }
}

impl core::error::Error for VplPassError {}

/// Calls `keep` for points of 64 eye rays, spread over the picture: by what they see it is told which lights matter. None if
/// there are no candidates to choose from.
///
/// `eye` is the eye ray of a point of the film, both coordinates in [0, 1), or of its pixel.
///
/// ```
/// # use fogbow::{host::Empty, math::*, medium::Homogeneous, phase::Phase, sampling::Generator};
/// # use fogbow::{spectrum::Spectrum, vpl::{self, Settings}, world::{Outline, World}};
/// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
/// let world = World { medium: &fog, scene: &Empty, lights: (&[]).into() };
/// let settings = Settings::for_outline(&Outline::of(&world, Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE }));
/// let mut found = Vec::new();
/// let eye = |[x, y]: [f32; 2], _: &mut Generator| Ray::between(Vec3::NEG_Z, Vec3::new(x, y, 0.0));
/// vpl::witnesses(&world, &settings, eye, |receiver| found.push(receiver));
/// assert!(found.len() >= 64);
/// # Ok::<(), fogbow::medium::MediumError>(())
/// ```
pub fn witnesses<M: Medium + ?Sized, S: Scene + ?Sized>(
    world: &World<'_, M, S>,
    settings: &Settings,
    eye: impl Fn([f32; 2], &mut Generator) -> Ray,
    mut keep: impl FnMut(Receiver),
) {
    if settings.candidates <= 1 {
        return;
    }
    for i in 0..SCOUTS {
        let mut rng = independent(mix(settings.seed ^ 0x2f6b_11d0_99ac_4e57), u64::from(i), 0);
        let ray = eye(even2(i), &mut rng);
        receivers(&ray, world, &settings.walk, &mut rng, |receiver, _| keep(*receiver));
    }
}

/// What a job of a [`VplPass`] leaves.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Default))]
pub struct VplOutput<'o> {
    lights: List<'o, VirtualLight>,
    seen: List<'o, f32>,
    error: Option<VplPassError>,
}

impl<'o> VplOutput<'o> {
    /// In lent memory: for the lights that 64 paths leave, and 512 numbers. Where that is too small, the pass ends with
    /// [`VplPassError::TooMany`].
    ///
    /// ```
    /// # use fogbow::vpl::{Settings, VirtualLight, VplOutput, VplPass, VplPassError};
    /// # use fogbow::{host::Empty, light::{Light, PointLight}, math::*, medium::Homogeneous, phase::Phase, sampling::Independent};
    /// # use fogbow::{spectrum::Spectrum, work, world::{Outline, World}};
    /// # let fog = Homogeneous::new(Spectrum::ONE, Spectrum::ONE, Phase::ISOTROPIC)?;
    /// # let lamps = [Light::Point(PointLight::from_flux(Vec3::ZERO, Spectrum::ONE)?)];
    /// # let world = World { medium: &fog, scene: &Empty, lights: (&lamps).into() };
    /// # let outline = Outline::of(&world, Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE });
    /// # let light = VirtualLight::in_medium(Vec3::ZERO, Vec3::Z, Spectrum::ONE, 1, &Phase::ISOTROPIC);
    /// let settings = Settings { paths: 8192, ..Settings::for_outline(&outline) };
    /// let run = |lights: &mut [VirtualLight]| {
    ///     let mut pass = VplPass::new(&settings, 0, Independent, &[]);
    ///     work::finish(&mut pass, &world, &mut VplOutput::new(lights, &mut [0.0; 512][..]));
    ///     pass.error()
    /// };
    /// assert_eq!((run(&mut [light; 1024]), run(&mut [light; 10])), (None, Some(VplPassError::TooMany)));
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    pub fn new(lights: impl Into<List<'o, VirtualLight>>, seen: impl Into<List<'o, f32>>) -> Self {
        Self { lights: lights.into(), seen: seen.into(), error: None }
    }
}

/// Place of a light along a curve, and its number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub struct CurvePlace {
    key: u64,
    number: u32,
}

/// Memory of a [`VplPass`].
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Default))]
pub struct VplMemory<'s> {
    lights: List<'s, VirtualLight>,
    order: List<'s, CurvePlace>,
    importance: List<'s, f32>,
    seen: List<'s, f32>,
}

impl<'s> VplMemory<'s> {
    /// Lent: room for all candidates of a pass in `lights`, and for as many in each of the others, or for none if there are no
    /// witnesses.
    ///
    /// ```
    /// # use fogbow::host::Medium;
    /// # use fogbow::vpl::{CurvePlace, Receiver, Settings, VirtualLight, VplMemory, VplOutput, VplPass};
    /// # use fogbow::{host::Empty, light::{Light, PointLight}, math::*, medium::Homogeneous, phase::Phase, sampling::Independent};
    /// # use fogbow::{spectrum::Spectrum, work, world::{Outline, World}};
    /// # let fog = Homogeneous::new(Spectrum::ONE, Spectrum::ONE, Phase::ISOTROPIC)?;
    /// # let lamps = [Light::Point(PointLight::from_flux(Vec3::ZERO, Spectrum::ONE)?)];
    /// # let world = World { medium: &fog, scene: &Empty, lights: (&lamps).into() };
    /// # let outline = Outline::of(&world, Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE });
    /// # let light = VirtualLight::in_medium(Vec3::ZERO, Vec3::Z, Spectrum::ONE, 1, &Phase::ISOTROPIC);
    /// // Half of all light is absorbed in every collision: 64 paths leave about 64 lights, of which 20 are kept by what a witness sees.
    /// let settings = Settings { lights: 20, paths: 64, ..Settings::for_outline(&outline) };
    /// let (mut lights, mut order) = ([light; 512], [CurvePlace::default(); 512]);
    /// let [mut importance, mut seen] = [[0.0_f32; 512]; 2];
    /// let memory = VplMemory::new(&mut lights[..], &mut order[..], &mut importance[..], &mut seen[..]);
    /// let witnesses = [Receiver::in_medium(Vec3::X, Vec3::Z, &fog.properties(Vec3::X)).unwrap()];
    /// let mut pass = VplPass::new_in(memory, &settings, 0, Independent, &witnesses);
    /// let (mut of_job, mut seen_of_job) = ([light; 512], [0.0; 512]);
    /// work::finish(&mut pass, &world, &mut VplOutput::new(&mut of_job[..], &mut seen_of_job[..]));
    /// assert!((19..=21).contains(&pass.finish()?.len()));
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    pub fn new(
        lights: impl Into<List<'s, VirtualLight>>,
        order: impl Into<List<'s, CurvePlace>>,
        importance: impl Into<List<'s, f32>>,
        seen: impl Into<List<'s, f32>>,
    ) -> Self {
        Self { lights: lights.into(), order: order.into(), importance: importance.into(), seen: seen.into() }
    }

    fn clear(&mut self) {
        self.lights.clear();
        self.order.clear();
        self.importance.clear();
        self.seen.clear();
    }
}

/// What the jobs of a round do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Round {
    /// Follow paths from the lights.
    Trace,
    /// Connect lights to a witness.
    Weigh,
    Done,
}

/// The virtual lights of one pass, in an order left to chance: all that its paths leave, or, where `witnesses` tell what matters, about
/// [`Settings::lights`] of them. [`Rounds`] of jobs in a [`World`].
///
/// How much of what a witness sees each light, clamped, is: the root of the mean square over the witnesses, mixed with the
/// light's share of all flux, is its importance ([`select`]). Lights kept with such probabilities make errors small everywhere,
/// dark corners included.
///
/// Paths draw from a [`GeneratorSource`]; a low-discrepancy one makes lights even.
///
/// ```
/// use fogbow::vpl::{self, Settings, VplOutput, VplPass};
/// use fogbow::{host::Empty, light::{Light, PointLight}, math::*, medium::Homogeneous, phase::Phase};
/// use fogbow::sampling::{Generator, Independent};
/// use fogbow::{spectrum::Spectrum, work, world::{Outline, World}};
/// let fog = Homogeneous::new(Spectrum::ONE, Spectrum::ONE, Phase::ISOTROPIC)?;
/// let lamps = [Light::Point(PointLight::from_flux(Vec3::ZERO, Spectrum::ONE)?)];
/// let world = World { medium: &fog, scene: &Empty, lights: (&lamps).into() };
/// let outline = Outline::of(&world, Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE });
/// // A pilot tells how many paths leave as many candidates.
/// let settings = Settings { lights: 100, candidates: 4, ..Settings::for_outline(&outline) };
/// let mut pilot = VplPass::pilot(&settings, Independent);
/// work::finish(&mut pilot, &world, &mut VplOutput::default());
/// let settings = pilot.settings_for_lights();
/// // Points of the picture tell which matter.
/// let eye = |[x, y]: [f32; 2], _: &mut Generator| Ray::between(Vec3::NEG_Z * 2.0, Vec3::new(x, y, 0.0));
/// let mut witnesses = Vec::new();
/// vpl::witnesses(&world, &settings, eye, |witness| witnesses.push(witness));
/// let mut pass = VplPass::new(&settings, 0, Independent, &witnesses);
/// work::finish(&mut pass, &world, &mut VplOutput::default());
/// let lights = pass.finish()?;
/// assert!((99..=101).contains(&lights.len()));
/// // A sample of a pixel.
/// let (part, share) = settings.part(lights.as_slice(), 0);
/// let mut rng = Generator::new(1);
/// let ray = eye([0.5, 0.5], &mut rng);
/// let seen = vpl::radiance(&ray, &settings.gatherer(&world), part, share, &settings.eye(), &mut rng);
/// assert!(seen.radiance.total().is_finite());
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct VplPass<'s, Q> {
    settings: Settings,
    /// The pass's number.
    number: u32,
    source: Q,
    witnesses: &'s [Receiver],
    memory: VplMemory<'s>,
    /// Of selection and order.
    rng: Generator,
    round: Round,
    jobs: u32,
    taken: u32,
    /// Lights that paths left.
    traced: usize,
    error: Option<VplPassError>,
}

/// The number of a pass that is never rendered.
const PILOT: u32 = u32::MAX;

impl<'s, Q: GeneratorSource> VplPass<'s, Q> {
    /// A pass that is never rendered, of 2048 paths: see [`VplPass::settings_for_lights`].
    #[cfg(feature = "alloc")]
    #[must_use]
    pub fn pilot(settings: &Settings, source: Q) -> Self {
        Self::pilot_in(VplMemory::default(), settings, source)
    }

    /// As [`VplPass::pilot`], in lent memory.
    ///
    /// ```
    /// # use fogbow::vpl::{Settings, VirtualLight, VplMemory, VplOutput, VplPass};
    /// # use fogbow::{host::Empty, light::{Light, PointLight}, math::*, medium::Homogeneous, phase::Phase, sampling::Independent};
    /// # use fogbow::{spectrum::Spectrum, work, world::{Outline, World}};
    /// # let fog = Homogeneous::new(Spectrum::ONE, Spectrum::ONE, Phase::ISOTROPIC)?;
    /// # let lamps = [Light::Point(PointLight::from_flux(Vec3::ZERO, Spectrum::ONE)?)];
    /// # let world = World { medium: &fog, scene: &Empty, lights: (&lamps).into() };
    /// # let outline = Outline::of(&world, Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE });
    /// # let light = VirtualLight::in_medium(Vec3::ZERO, Vec3::Z, Spectrum::ONE, 1, &Phase::ISOTROPIC);
    /// let settings = Settings { lights: 100, candidates: 1, ..Settings::for_outline(&outline) };
    /// let (mut lights, mut of_job, mut seen) = (vec![light; 20_000], vec![light; 1024], [0.0; 512]);
    /// // Without witnesses nothing is weighed, and no other memory needed.
    /// let memory = VplMemory::new(&mut lights[..], &mut [][..], &mut [][..], &mut [][..]);
    /// let mut pilot = VplPass::pilot_in(memory, &settings, Independent);
    /// work::finish(&mut pilot, &world, &mut VplOutput::new(&mut of_job[..], &mut seen[..]));
    /// let settings = pilot.settings_for_lights();
    /// let mut pass = VplPass::new(&settings, 0, Independent, &[]);
    /// work::finish(&mut pass, &world, &mut VplOutput::default());
    /// assert!((70..130).contains(&pass.finish()?.len()));
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    #[must_use]
    pub fn pilot_in(memory: VplMemory<'s>, settings: &Settings, source: Q) -> Self {
        Self::new_in(memory, &settings.of_pilot(), PILOT, source, &[])
    }

    /// Pass number `number`, of what `source` draws; see [`VplPass`].
    #[cfg(feature = "alloc")]
    #[must_use]
    pub fn new(settings: &Settings, number: u32, source: Q, witnesses: &'s [Receiver]) -> Self {
        Self::new_in(VplMemory::default(), settings, number, source, witnesses)
    }

    /// As [`VplPass::new`], in lent memory. Where that is too small, [`VplPass::finish`] says so.
    ///
    /// ```
    /// # use fogbow::vpl::{Settings, VirtualLight, VplMemory, VplOutput, VplPass, VplPassError};
    /// # use fogbow::{host::Empty, light::{Light, PointLight}, math::*, medium::Homogeneous, phase::Phase, sampling::Independent};
    /// # use fogbow::{spectrum::Spectrum, work, world::{Outline, World}};
    /// # let fog = Homogeneous::new(Spectrum::ONE, Spectrum::ONE, Phase::ISOTROPIC)?;
    /// # let lamps = [Light::Point(PointLight::from_flux(Vec3::ZERO, Spectrum::ONE)?)];
    /// # let world = World { medium: &fog, scene: &Empty, lights: (&lamps).into() };
    /// # let outline = Outline::of(&world, Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE });
    /// # let light = VirtualLight::in_medium(Vec3::ZERO, Vec3::Z, Spectrum::ONE, 1, &Phase::ISOTROPIC);
    /// let settings = Settings { paths: 256, ..Settings::for_outline(&outline) };
    /// let count = |room: usize| {
    ///     let (mut lights, mut of_job) = (vec![light; room], vec![light; 1024]);
    ///     let memory = VplMemory::new(&mut lights[..], &mut [][..], &mut [][..], &mut [][..]);
    ///     let mut pass = VplPass::new_in(memory, &settings, 0, Independent, &[]);
    ///     work::finish(&mut pass, &world, &mut VplOutput::new(&mut of_job[..], &mut [][..]));
    ///     pass.finish().map(|lights| lights.len())
    /// };
    /// let all = count(4096)?;
    /// assert_eq!((count(all), count(all - 1)), (Ok(all), Err(VplPassError::TooMany)));
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    #[must_use]
    pub fn new_in(
        mut memory: VplMemory<'s>,
        settings: &Settings,
        number: u32,
        source: Q,
        witnesses: &'s [Receiver],
    ) -> Self {
        memory.clear();
        Self {
            settings: *settings,
            number,
            source,
            witnesses,
            memory,
            rng: independent(mix(settings.seed ^ 0x0d1b_7a5e_66c2_93f4), u64::from(number), 0),
            round: Round::Trace,
            jobs: settings.paths.div_ceil(paths_per_job(settings)),
            taken: 0,
            traced: 0,
            error: (!settings.is_valid()).then_some(VplPassError::Settings),
        }
    }
}

impl<'s, Q> VplPass<'s, Q> {
    /// The lights. Of a pass that was stopped they are all of those of the paths so far, and stand for all light all the same.
    ///
    /// # Errors
    /// See [`VplPassError`].
    pub fn finish(mut self) -> Result<List<'s, VirtualLight>, VplPassError> {
        if let Some(error) = self.error {
            return Err(error);
        }
        if self.round == Round::Trace {
            self.share_out();
        }
        // Fisher and Yates.
        let lights = self.memory.lights.as_mut_slice();
        for i in (1..lights.len()).rev() {
            lights.swap(i, (uniform(&mut self.rng) * (i + 1) as f32) as usize);
        }
        Ok(self.memory.lights)
    }

    /// What went wrong so far, if anything: then no jobs are left.
    #[must_use]
    pub fn error(&self) -> Option<VplPassError> {
        self.error
    }

    /// The settings with as many paths as leave the lights and candidates wanted, by the count that those of this pass left so far.
    #[must_use]
    pub fn settings_for_lights(&self) -> Settings {
        self.settings.for_lights(self.traced, self.paths())
    }

    /// Paths whose lights are in.
    fn paths(&self) -> u32 {
        if self.round == Round::Trace {
            self.taken.saturating_mul(paths_per_job(&self.settings)).min(self.settings.paths)
        } else {
            self.settings.paths
        }
    }

    /// Each light stands for its share of all paths so far.
    fn share_out(&mut self) {
        let share = 1.0 / self.paths() as f32;
        for light in self.memory.lights.as_mut_slice() {
            *light = light.scaled(share);
        }
    }

    /// Jobs that connect all lights to one witness.
    fn blocks(&self) -> u32 {
        (self.memory.lights.len() as u32).div_ceil(LIGHTS_PER_JOB)
    }

    /// After the last path.
    fn traced(&mut self) -> Result<(), VplPassError> {
        self.share_out();
        self.round = Round::Done;
        let count = self.memory.lights.len();
        if self.witnesses.is_empty() || count <= self.settings.lights as usize {
            return Ok(());
        }
        u32::try_from(count).map_err(|_| VplPassError::TooMany)?;
        // Systematic sampling keeps as many of every stretch of the list as it should: near lights belong together.
        self.sort()?;
        for _ in 0..count {
            self.memory.importance.push(0.0).map_err(|_| VplPassError::TooMany)?;
        }
        let witnesses = u32::try_from(self.witnesses.len()).map_err(|_| VplPassError::TooMany)?;
        self.jobs = self.blocks().checked_mul(witnesses).ok_or(VplPassError::TooMany)?;
        (self.round, self.taken) = (Round::Weigh, 0);
        Ok(())
    }

    /// Sorts the lights along a curve that fills space, those of the medium first.
    fn sort(&mut self) -> Result<(), VplPassError> {
        let VplMemory { lights, order, .. } = &mut self.memory;
        let lights = lights.as_mut_slice();
        let bounds = Bounds::of(lights.iter().map(|light| light.position));
        for (number, light) in lights.iter().enumerate() {
            let key = u64::from(light.is_on_surface()) << 63 | curve(light.position, &bounds);
            order.push(CurvePlace { key, number: number as u32 }).map_err(|_| VplPassError::TooMany)?;
        }
        let order = order.as_mut_slice();
        // Of equal keys the first comes first.
        order.sort_unstable();
        for i in 0..order.len() {
            // What lay at a place before this one has been swapped away, along the numbers that were written there.
            let mut from = order[i].number;
            while (from as usize) < i {
                from = order[from as usize].number;
            }
            order[i].number = from;
            lights.swap(i, from as usize);
        }
        Ok(())
    }

    /// One witness has seen all lights.
    fn witnessed(&mut self) {
        let VplMemory { importance, seen, .. } = &mut self.memory;
        let total: f64 = seen.as_slice().iter().copied().map(f64::from).sum();
        if total > 0.0 {
            for (square, seen) in importance.as_mut_slice().iter_mut().zip(seen.as_slice()) {
                let share = (f64::from(*seen) / total) as f32;
                *square += share * share;
            }
        }
        seen.clear();
    }

    /// After the last witness.
    fn weighed(&mut self) {
        let VplMemory { lights, importance, .. } = &mut self.memory;
        let flux: f64 = lights.as_slice().iter().map(|light| f64::from(light.flux.mean())).sum();
        let of_flux =
            |light: &VirtualLight| if flux > 0.0 { (f64::from(light.flux.mean()) / flux) as f32 } else { 1.0 };
        let count = self.witnesses.len().max(1) as f32;
        for (value, light) in importance.as_mut_slice().iter_mut().zip(lights.as_slice()) {
            *value = float::sqrt(*value / count) + DEFENSIVE * of_flux(light);
        }
        let (wanted, u) = (self.settings.lights as f32, uniform(&mut self.rng));
        let kept = select(lights.as_mut_slice(), importance.as_mut_slice(), wanted, u);
        lights.truncate(kept);
        self.round = Round::Done;
    }
}

impl<M, S, Q> Rounds<World<'_, M, S>> for VplPass<'_, Q>
where
    M: Medium + ?Sized,
    S: Scene + ?Sized,
    Q: GeneratorSource,
{
    type Output<'o> = VplOutput<'o>;

    fn jobs(&self) -> Range<u32> {
        if self.error.is_some() || self.round == Round::Done { 0..0 } else { self.taken..self.jobs }
    }

    fn run(&self, job: u32, world: &World<'_, M, S>, output: &mut VplOutput<'_>) {
        output.lights.clear();
        output.seen.clear();
        output.error = world.medium.is_emissive().then_some(VplPassError::Glowing);
        if output.error.is_some() {
            return;
        }
        let VplOutput { lights, seen, error } = output;
        let settings = &self.settings;
        let mut note = |pushed: Result<(), _>| {
            if pushed.is_err() {
                *error = Some(VplPassError::TooMany);
            }
        };
        if self.round == Round::Trace {
            let seed = mix(settings.seed ^ 0x51f2_90ad_c13b_7e66) ^ u64::from(self.number);
            let count = paths_per_job(settings);
            let from = job * count;
            for path in from..from.saturating_add(count).min(settings.paths) {
                let mut rng = self.source.start(seed, u64::from(self.number), path);
                shoot(world, &settings.bounds, &settings.walk, &mut rng, &mut |light| note(lights.push(light)));
            }
            return;
        }
        let (w, block) = (job / self.blocks().max(1), job % self.blocks().max(1));
        let Some(witness) = self.witnesses.get(w as usize) else { return };
        let gatherer = Gatherer { compensation: None, ..settings.gatherer(world) };
        let seed = settings.seed ^ u64::from(self.number);
        let from = (block * LIGHTS_PER_JOB) as usize;
        let of_block = self.memory.lights.as_slice().iter().enumerate().skip(from).take(LIGHTS_PER_JOB as usize);
        for (i, light) in of_block {
            let mut rng = independent(seed, i as u64, w);
            note(seen.push(gatherer.connected(witness, light, &mut rng).mean()));
        }
    }

    fn accept(&mut self, output: &VplOutput<'_>) {
        self.error = self.error.or(output.error);
        let VplMemory { lights, seen, .. } = &mut self.memory;
        let kept = lights
            .extend_from_slice(output.lights.as_slice())
            .and_then(|()| seen.extend_from_slice(output.seen.as_slice()))
            .map_err(|_| VplPassError::TooMany);
        self.error = self.error.or(kept.err());
        self.taken += 1;
        if self.error.is_some() {
            return;
        }
        if self.round == Round::Trace {
            self.traced = self.memory.lights.len();
            if self.taken == self.jobs {
                self.error = self.traced().err();
            }
            return;
        }
        if self.taken.is_multiple_of(self.blocks().max(1)) {
            self.witnessed();
        }
        if self.taken == self.jobs {
            self.weighed();
        }
    }

    fn stage(&self) -> &'static str {
        match self.round {
            Round::Trace => "trace lights",
            Round::Weigh => "weigh lights",
            Round::Done => "",
        }
    }
}

/// Paths of one job.
fn paths_per_job(settings: &Settings) -> u32 {
    (settings.paths / TRACE_JOBS).clamp(1, PATHS_PER_JOB)
}

/// Place of a point along a curve that fills the box: 16 bits of each coordinate, interleaved (Morton 1966).
fn curve(point: Vec3, bounds: &Bounds) -> u64 {
    let unit = (point - bounds.min) / bounds.size().max(Vec3::splat(f32::MIN_POSITIVE));
    let [x, y, z] = unit.to_array().map(|x| (x.clamp(0.0, 1.0) * 65_535.0) as u64);
    let bit = |i: u32| (x >> i & 1) << (3 * i) | (y >> i & 1) << (3 * i + 1) | (z >> i & 1) << (3 * i + 2);
    (0..16).map(bit).sum()
}
