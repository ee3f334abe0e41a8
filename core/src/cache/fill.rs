//! Filling caches, as work in rounds.
//!
//! Eye rays (or points of a box) say where light is asked for. Photons light cells at which random walks end. Where no record reaches, one is computed against the
//! frozen caches, many in a round; then they are inserted in order, and those left out that an earlier one of the same round
//! covers. The order of kinds is that of [`TURNS`].
//!
//! Places and radii of records come from some samples, values for the most part from others, as many or more, so that
//! noise in one does not steer the other (decision 13).

use core::ops::Range;

use super::Estimator;
use super::asked::{Asked, Wanted};
use super::audit::rays_for;
use super::caches::RadianceCaches;
use super::guide::Guide;
use super::kind::{Kind, Step, TURNS, Turn};
use super::lookup::Reading;
use super::memory::{FilledRecords, FillingMemory};
use super::noise::{self, Noise, REGIONS};
use super::photons::PhotonGrid;
use super::pilots::Pilots;
use super::places::Place;
use super::presets::noise_goal;
use super::radius::clearance;
use super::settings::{Effort, Settings};
use super::slot::ByKind;
use crate::host::{Medium, Scene};
use crate::math::{Ray, float};
use crate::spectrum::Spectrum;
use crate::work::Rounds;
use crate::world::World;

mod clash;
mod doubt;
mod estimates;
mod finer;
mod glances;
mod ground;
mod pilot;
mod shoot;
mod smooth;
mod steps;
mod weigh;

pub(super) use estimates::MOST_PARTS;

use doubt::{OF_DIRECTIONS, OF_WALKS};
use finer::Tighter;

/// Eye rays of one job. More: jobs take longer than some milliseconds in dense worlds.
pub(super) const RAYS_PER_JOB: u32 = 16;

/// Places that one job looks up.
pub(super) const PLACES_PER_JOB: u32 = 1024;

/// Places that one job is expected to find at most, where memory is lent: some hundreds for each of its rays. Rays with more lose them.
pub(super) const PLACES_OF_JOB: usize = 256 * RAYS_PER_JOB as usize;

/// Eye rays from whose points others are followed to what lights them. More find small things that are seen; light is
/// sums over all that is met, small things included.
const LIGHTING: u32 = 16384;

/// What the jobs of a round do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Round {
    /// Follow eye rays.
    Search,
    /// Shoot photons, so many up to a number.
    Shoot,
    /// Which cells do surfaces cut?
    Divide,
    /// Light at some places by one half of the photons, and by the other: how noisy are they?
    Doubt {
        is_second: bool,
    },
    /// Light at some places by what surfaces are known to send, before that is estimated again and after: how noisy is it?
    Ground {
        is_second: bool,
    },
    /// Sample all light along some eye rays: how much does each kind bring?
    Weigh,
    /// Look which places of a batch have no record.
    Look,
    /// Estimates for new records.
    Make,
    /// What records tell at some places, and estimates there, by pilots from a job on.
    Pilot {
        from: u32,
    },
    /// What eye rays read before records are estimated anew, and after.
    Glance {
        is_second: bool,
    },
    /// Estimates anew for records from a number on.
    Again {
        from: u32,
    },
    /// Records from a number on, averaged with their neighbours.
    Smooth {
        from: u32,
    },
    Done,
}

/// A fill of [`RadianceCaches`], as [`Rounds`] of jobs in a [`World`]. It owns the caches until
/// [`Filling::finish`] gives them back, filled so far.
///
/// ```
/// # #[cfg(feature = "alloc")] {
/// # use fogbow::cache::{Asked, FilledRecords, FillingMemory, Kind, RadianceCaches, Settings};
/// # use fogbow::{host::Empty, math::{Bounds, Ray, Vec3}, medium::Homogeneous, phase::Phase, spectrum::Spectrum};
/// # use fogbow::{work::step, world::{Outline, World}};
/// # let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
/// # let world = World { medium: &fog, scene: &Empty, lights: (&[]).into() };
/// # let bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
/// # let settings = Settings { rays: 20, ..Settings::for_outline(&Outline::of(&world, bounds), 0.02).with_walks(16) };
/// # let asked = Asked::anywhere_in(bounds);
/// let mut filling = RadianceCaches::new(settings).fill_in(FillingMemory::default(), asked);
/// let mut output = FilledRecords::default();
/// for _ in 0..10 {
///     step(&mut filling, &world, &mut output); // so many jobs a frame
/// }
/// // What there is by now can be read at any time.
/// assert!(!filling.is_cut() && filling.audit_rays() >= 4096);
/// assert!(filling.record_noise().is_none()); // of what no eye looks at
/// assert_eq!(filling.noise_goal(0.02, 1 << 20), 0.02); // of a large picture, from few records
/// assert!(filling.computed(Kind::Single) == 0 && filling.caches().reader().single.is_none());
/// let caches = filling.finish();
/// # }
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Filling<'s, F> {
    caches: RadianceCaches<'s>,
    asked: Asked<F>,
    view: u64,
    /// Angles (rad) under which the film is seen, across and down.
    film: [f32; 2],
    memory: FillingMemory<'s>,
    round: Round,
    jobs: u32,
    taken: u32,
    /// Which of [`TURNS`].
    step: usize,
    /// The rays whose places are being covered.
    batch: [u32; 2],
    /// Records computed in this step, and the number of its first.
    computed: u64,
    first: u64,
    /// The radius from which on a record gets all samples (m).
    usual: f32,
    /// The usual value of a record.
    bright: f32,
    /// In how many jobs each new record is estimated.
    parts: u32,
    /// What pilots have found, how often radii have shrunk because of them, and how far caches were off before they did.
    pilots: Pilots,
    shrunk: u32,
    off: f64,
    /// How often records that contradict each other were parted.
    parted: u32,
    /// What glances have found: the noise of records, light that is dark, how often each kind is to be estimated once more in each region, and what noise is left then.
    noise: Noise,
    dark: f64,
    more: ByKind<[u32; REGIONS]>,
    /// Of second estimates, how many times the usual samples, in sum, and how many there are.
    efforts: ByKind<[f64; 2]>,
    left: Option<f32>,
    /// Rounds of more estimates so far.
    again: u32,
    /// How often [`Filling::refine`] was called.
    level: u32,
    /// What is done to radii of a coarser level before new records are made.
    tighter: ByKind<Option<Tighter>>,
    /// From these records on nothing is final.
    before: ByKind<usize>,
    /// All records computed, by kind.
    all_computed: ByKind<u64>,
    /// Photons before this round, and in it.
    photons_before: u32,
    photons_of_round: u32,
    /// Whether photons are being shot because those that there were are too noisy.
    are_more: bool,
    is_cut: bool,
}

impl<'s> RadianceCaches<'s> {
    /// Work that adds records until every place that is asked for has one.
    ///
    /// If the caches were filled for the same view before, there is nothing to do.
    #[cfg(feature = "alloc")]
    #[must_use]
    pub fn fill<F: Fn([f32; 2]) -> Ray>(self, asked: Asked<F>) -> Filling<'s, F> {
        self.fill_in(FillingMemory::default(), asked)
    }

    /// As [`RadianceCaches::fill`], in lent memory. Where that is too small, the rest is left out:
    /// [`Filling::is_cut`].
    ///
    /// ```
    /// # #[cfg(feature = "alloc")] {
    /// # use fogbow::cache::{Asked, FilledRecords, FillingMemory, Kind, RadianceCaches, Settings};
    /// # use fogbow::{host::Empty, math::{Bounds, Ray, Vec3}, medium::Homogeneous, phase::Phase, spectrum::Spectrum};
    /// # use fogbow::{work, world::{Outline, World}};
    /// # let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
    /// # let world = World { medium: &fog, scene: &Empty, lights: (&[]).into() };
    /// # let bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
    /// # let settings = Settings { rays: 20, ..Settings::for_outline(&Outline::of(&world, bounds), 0.02).with_walks(16) };
    /// # let asked = || Asked::anywhere_in(bounds);
    /// let mut output = FilledRecords::default();
    /// let mut filling = RadianceCaches::new(settings).fill_in(FillingMemory::default(), asked());
    /// work::finish(&mut filling, &world, &mut output);
    /// assert!(filling.computed(Kind::Multiple) > 0);
    /// // Who asks for the same again has no work.
    /// let mut again = filling.finish().fill_in(FillingMemory::default(), asked());
    /// assert!(!work::step(&mut again, &world, &mut output));
    /// # }
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    #[must_use]
    pub fn fill_in<F: Fn([f32; 2]) -> Ray>(mut self, mut memory: FillingMemory<'s>, asked: Asked<F>) -> Filling<'s, F> {
        memory.clear();
        if self.photon_effort().is_some_and(|(effort, seed)| self.photons.is_made_for(&effort, seed)) {
            memory.photons = core::mem::replace(&mut self.photons, PhotonGrid::none());
        }
        let (view, film) = (asked.mark(&self.settings), asked.film());
        let (before, rays) = (self.settled, self.settings.rays);
        let is_known = self.views.as_slice().contains(&view);
        let mut is_cut = false;
        for kind in Kind::ALL {
            // What a fill that was left has made is estimated again, too.
            for _ in before[kind]..self.slots[kind].len() {
                is_cut |= memory.guides[kind].push(Guide::default()).is_err();
            }
        }
        Filling {
            caches: self,
            asked,
            view,
            memory,
            round: if is_known { Round::Done } else { Round::Search },
            jobs: if is_known { 0 } else { rays.div_ceil(RAYS_PER_JOB) },
            taken: 0,
            step: 0,
            batch: [0, 0],
            computed: 0,
            first: 0,
            usual: 0.0,
            bright: 0.0,
            parts: 1,
            pilots: Pilots::default(),
            shrunk: 0,
            off: 0.0,
            parted: 0,
            noise: Noise::default(),
            dark: 0.0,
            more: ByKind([[0; REGIONS]; Kind::COUNT]),
            efforts: ByKind([[0.0; 2]; Kind::COUNT]),
            left: None,
            again: 0,
            level: 0,
            tighter: ByKind([None; Kind::COUNT]),
            film,
            before,
            all_computed: ByKind([0; Kind::COUNT]),
            photons_before: 0,
            photons_of_round: 0,
            are_more: false,
            is_cut,
        }
    }
}

impl<'s, F> Filling<'s, F> {
    /// The caches as they are.
    #[must_use]
    pub fn caches(&self) -> &RadianceCaches<'s> {
        &self.caches
    }

    /// The caches, filled so far, to be read. What was made counts, and a later fill estimates it anew.
    #[must_use]
    pub fn finish(mut self) -> RadianceCaches<'s> {
        if self.memory.photons.is_made() {
            self.caches.photons = self.memory.photons;
        }
        self.caches.finish();
        self.caches
    }

    /// Whether lent memory was too small for something: some places then have no record.
    #[must_use]
    pub fn is_cut(&self) -> bool {
        self.is_cut
    }

    /// How many records of a kind were computed: those left out because another of their round covered them, and those
    /// estimated anew, included.
    #[must_use]
    pub fn computed(&self, kind: Kind) -> u64 {
        self.all_computed[kind]
    }

    /// Eye rays for an [`Audit`](super::Audit) that takes about a twentieth of the time of this fill, in dense fog a tenth, and at least
    /// enough to see whether a picture is grossly wrong.
    #[must_use]
    pub fn audit_rays(&self) -> u32 {
        rays_for(self.walks())
    }

    /// The noise that a picture of so many pixels may have (`picture::Goal::noise`) where `error` is asked for, noise of records
    /// included: as much, or the less the more work this fill was over what the picture will be. Small pictures gain most by samples, large ones by
    /// records.
    #[must_use]
    pub fn noise_goal(&self, error: f32, pixels: u32) -> f32 {
        noise_goal(error, pixels, self.walks())
    }

    /// The relative noise that records leave in the picture, root of the mean of squares over its pixels, as eye rays have told it that read records
    /// before and after they were estimated anew, and as halves of the photons and of what surfaces are known to send have, whose noise all records share; `None` before that, and where no picture is asked for.
    /// What samples of a pixel average is not in it: their spread tells of that.
    #[must_use]
    pub fn record_noise(&self) -> Option<f32> {
        self.left.map(|left| float::hypot(left, float::hypot(self.memory.photons.noise(), self.caches.ground)))
    }

    /// Walks and directions of all records of this fill.
    fn walks(&self) -> u64 {
        let samples = |kind: Kind| self.settings().effort(kind).map_or(0, |effort| u64::from(effort.samples));
        Kind::ALL.into_iter().map(|kind| self.computed(kind) * samples(kind)).sum()
    }

    fn settings(&self) -> &Settings {
        &self.caches.settings
    }

    /// Records in place of dropped ones meet other chances, and estimates of another level.
    fn seed(&self) -> u64 {
        self.settings().seed ^ u64::from(self.caches.dropped) << 32 ^ u64::from(self.level) << 48
    }

    /// The step at hand and its effort.
    fn at_hand(&self) -> Option<(Step, Effort)> {
        match *TURNS.get(self.step)? {
            Turn::Of(step) => Some((step, self.settings().effort(step.kind)?)),
            Turn::Doubt | Turn::Ground { .. } | Turn::Glances { .. } => None,
        }
    }

    /// Whether the final caches have all that is asked for at a place.
    fn is_known(&self, place: &Place) -> bool {
        !self.is_loose()
            && Kind::FINAL.into_iter().all(|kind| {
                let Some(effort) = self.settings().effort(kind) else { return true };
                let reading = Reading { margin: self.settings().margin, ..Reading::new(effort.tolerance) };
                self.caches.slots[kind].covers(place, &reading)
            })
    }

    /// How a cache is read to see where records are missing.
    fn strict(&self, kind: Kind) -> Option<Reading> {
        Some(Reading { margin: self.settings().margin, ..self.settings().reading(kind)? })
    }

    /// The world lit by coarse irradiance and photons.
    fn estimator<'a, M: ?Sized, S: ?Sized>(&'a self, world: &World<'a, M, S>) -> Estimator<'a, M, S> {
        let settings = self.settings();
        Estimator {
            world: *world,
            surfaces: self.caches.surface(Kind::CoarseIrradiance).map(|reader| (reader.cache, reader.reading)),
            photons: Some(&self.memory.photons),
            walk: settings.walk,
            paths: settings.paths,
            light_samples: settings.light_samples,
            finest: settings.finest,
        }
    }

    fn search<M: Medium + ?Sized, S: Scene + ?Sized>(
        &self,
        job: u32,
        world: &World<'_, M, S>,
        output: &mut FilledRecords<'_>,
    ) where
        F: Fn([f32; 2]) -> Ray,
    {
        let from = job * RAYS_PER_JOB;
        for ray in from..(from + RAYS_PER_JOB).min(self.settings().rays) {
            // Surfaces that light a place come right after it, and are of no use if nothing is made there.
            let mut is_open = false;
            self.asked.visit(ray, world, self.settings(), &mut |place, distance| {
                if place.is_seen {
                    is_open = !self.is_known(&place);
                }
                if is_open && (place.is_seen || ray < LIGHTING) {
                    output.is_cut |= output.wanted.push(Wanted { place, distance, ray }).is_err();
                }
            });
        }
    }

    fn look(&self, job: u32, output: &mut FilledRecords<'_>) {
        let Some(((step, _), open)) =
            self.at_hand().zip(self.memory.open.as_slice().chunks(PLACES_PER_JOB as usize).nth(job as usize))
        else {
            return;
        };
        let Some(reading) = self.strict(step.kind) else { return };
        let slot = &self.caches.slots[step.kind];
        let wanted = self.memory.wanted.as_slice();
        for &number in open {
            if !slot.covers(&wanted[number as usize].place, &reading) {
                output.is_cut |= output.open.push(number).is_err();
            }
        }
    }

    /// How far a record may reach because of surfaces near it, and of the medium it lies in.
    fn reach<M: Medium + ?Sized, S: Scene + ?Sized>(
        &self,
        (kind, effort): (Kind, &Effort),
        place: &Place,
        world: &World<'_, M, S>,
    ) -> f32 {
        let mut reach = f32::INFINITY;
        if effort.clearance < f32::INFINITY {
            reach = (effort.clearance * clearance(place.point, place.normal, world.scene)).max(self.settings().finest);
        }
        if effort.free_paths < f32::INFINITY {
            let properties = world.medium.properties(place.point);
            let straight = match kind {
                Kind::Multiple => properties.phase.mean_cosine().map(|g| float::safe_sqrt(1.0 - g)),
                _ => Spectrum::ONE,
            };
            reach = reach.min(effort.free_paths / (properties.extinction() * straight).max_element());
        }
        reach
    }

    /// The round after one is complete.
    fn advance(&mut self) {
        match self.round {
            Round::Search => {
                let is_settled = !self.caches.is_open();
                if self.memory.wanted.is_empty() && is_settled {
                    self.complete();
                } else if let Some((effort, seed)) = self.caches.photon_effort()
                    && !self.memory.photons.is_made_for(&effort, seed)
                {
                    self.is_cut |= self.memory.photons.prepare(&effort, seed).is_err();
                    self.shoot_more();
                } else {
                    self.begin_weighing();
                }
            }
            Round::Shoot => self.shoot_more(),
            Round::Divide => {
                if let Some((effort, seed)) = self.caches.photon_effort() {
                    self.memory.photons.finish(&effort, seed);
                }
                if core::mem::take(&mut self.are_more) {
                    self.begin(self.step);
                } else {
                    self.begin_weighing();
                }
            }
            Round::Doubt { is_second } => self.take_doubt(is_second),
            Round::Ground { is_second } => self.take_ground(is_second),
            Round::Weigh => {
                self.take_shares();
                self.begin(0);
            }
            Round::Look => {
                core::mem::swap(&mut self.memory.open, &mut self.memory.still_open);
                if !self.choose() {
                    self.next_batch();
                }
            }
            Round::Make => {
                // Places where nothing can be stored must not be asked for again and again.
                match self.insert() {
                    0 => self.next_batch(),
                    _ => self.next_look(),
                }
            }
            Round::Pilot { from } => self.take_pilots(from),
            Round::Glance { is_second } => {
                if is_second {
                    self.plan_more();
                } else {
                    self.dark = noise::dark(self.memory.glances.as_slice());
                }
                self.begin(self.step + 1);
            }
            Round::Again { from } => {
                self.blend(from as usize);
                self.begin(if self.again > 0 { self.step } else { self.step + 1 });
            }
            Round::Smooth { from } => {
                self.take_means(from);
                self.begin(self.step + 1);
            }
            Round::Done => {}
        }
    }

    fn enter(&mut self, round: Round, jobs: u32) {
        (self.round, self.jobs, self.taken) = (round, jobs, 0);
    }

    /// Everything was done. A view whose memory was too small may miss something, and is filled again when it is asked for.
    fn complete(&mut self) {
        self.is_cut |= !self.is_cut && self.caches.views.push(self.view).is_err();
        for kind in Kind::ALL {
            self.caches.settled[kind] = self.caches.slots[kind].len();
        }
        self.enter(Round::Done, 0);
    }
}

impl<M, S, F> Rounds<World<'_, M, S>> for Filling<'_, F>
where
    M: Medium + ?Sized,
    S: Scene + ?Sized,
    F: Fn([f32; 2]) -> Ray,
{
    type Output<'o> = FilledRecords<'o>;

    fn jobs(&self) -> Range<u32> {
        self.taken..self.jobs
    }

    fn run(&self, job: u32, world: &World<'_, M, S>, output: &mut FilledRecords<'_>) {
        output.wanted.clear();
        output.open.clear();
        output.higher.clear();
        output.deposits.clear();
        (output.paths, output.flights, output.pilots) = (0, 0, Pilots::default());
        (output.estimate, output.is_cut) = (None, false);
        match self.round {
            Round::Search => self.search(job, world, output),
            Round::Shoot => self.shoot(job, world, output),
            Round::Divide => self.divide(job, world, output),
            Round::Doubt { .. } => self.read_places(job, (Kind::Multiple, OF_WALKS), world, output),
            Round::Ground { .. } => self.read_places(job, (Kind::Surface, OF_DIRECTIONS), world, output),
            Round::Weigh => self.weigh(job, world, output),
            Round::Look => self.look(job, output),
            Round::Make => self.make(job, world, output),
            Round::Pilot { from } => self.pilot(from + job, world, output),
            Round::Glance { .. } => self.glance(job, world, output),
            Round::Again { from } => self.again(from, job, world, output),
            Round::Smooth { from } => self.smooth(from, job, output),
            Round::Done => {}
        }
    }

    fn accept(&mut self, output: &FilledRecords<'_>) {
        if self.taken >= self.jobs {
            return;
        }
        let memory = &mut self.memory;
        if self.round == Round::Divide {
            memory.photons.mark(output.open.as_slice());
        }
        self.pilots.merge(&output.pilots);
        memory.photons.accept(output.deposits.as_slice(), output.paths, output.flights);
        let mut kept = memory.wanted.extend_from_slice(output.wanted.as_slice());
        if self.round == Round::Look {
            kept = kept.and(memory.still_open.extend_from_slice(output.open.as_slice()));
        }
        if matches!(self.round, Round::Weigh | Round::Doubt { .. } | Round::Ground { .. }) {
            kept = kept.and(memory.glances.extend_from_slice(&output.glances));
        }
        if let Round::Glance { is_second } = self.round {
            self.take_glances(&output.glances, is_second);
        }
        if let Some(estimate) = &output.estimate {
            kept = kept.and(self.keep(estimate, output.higher.as_slice()));
        }
        self.is_cut |= kept.is_err() | output.is_cut;
        self.taken += 1;
        if self.taken == self.jobs {
            self.advance();
        }
    }

    fn stage(&self) -> &'static str {
        match self.round {
            Round::Search => "fill search",
            Round::Shoot | Round::Divide | Round::Doubt { .. } => "fill photons",
            Round::Done => "",
            Round::Weigh | Round::Glance { .. } => "fill glances",
            Round::Ground { .. } => "fill irradiance",
            Round::Look | Round::Make | Round::Pilot { .. } | Round::Again { .. } | Round::Smooth { .. } => {
                match self.at_hand().map_or(Kind::Multiple, |(step, _)| step.kind) {
                    Kind::Single => "fill single",
                    Kind::Surface => "fill surface",
                    Kind::Multiple => "fill multiple",
                    Kind::Irradiance | Kind::CoarseIrradiance => "fill irradiance",
                }
            }
        }
    }
}
