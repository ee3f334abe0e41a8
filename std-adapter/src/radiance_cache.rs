//! Filling radiance caches in parallel, in rounds whose result does not depend on the number of threads.
//!
//! Eye rays say where light is asked for. Where no record reaches, one is computed against the
//! frozen caches, many at a time; then they are inserted in order, and those dropped that an earlier
//! one of the same round now covers. First the cache on surfaces, because light from surfaces enters all
//! others.

use core::fmt;

use fogbow::cache::{
    Cache, Caches, Estimator, Extrapolation, EyeSettings, Facing, Limits, Place, Reader, Reading, Record, SurfaceCache, VolumeCache,
    clamp_gradient, places,
};
use fogbow::host::{Medium, Scene};
use fogbow::math::{Ray, Vec3};
use fogbow::sampling::Generator;
use fogbow::sampling::uniform::mix;
use fogbow::sh::{Coefficient, coefficient_count};
use fogbow::single_scatter::Sums;
use fogbow::spectrum::{Gradient, Spectrum};
use rayon::iter::{IntoParallelIterator, IntoParallelRefIterator, ParallelIterator};

use crate::progress::Control;
use crate::stats::{Seconds, Stopwatch};

/// One cache's share of quality and effort.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effort {
    /// `ε` of J's Eq. 34: larger is coarser.
    pub tolerance: f32,
    /// Directions or random walks per record.
    pub samples: u32,
    /// Degree of the expansions; 0 in isotropic media and on surfaces.
    pub degree: usize,
    /// Bounds of radii in the world (m).
    pub limits: Limits,
}

impl Effort {
    /// For records that serve the making of others.
    fn coarser(self, tolerance: f32, fewer: u32) -> Self {
        Self { tolerance: tolerance * self.tolerance, samples: (self.samples / fewer).max(16), ..self }
    }
}

/// How to fill.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Light of the lights, scattered once; `None` to leave it to connections.
    pub single: Option<Effort>,
    /// Light of surfaces, scattered once.
    pub surface: Option<Effort>,
    /// Light scattered more than once.
    pub multiple: Option<Effort>,
    /// Indirect irradiance on surfaces.
    pub irradiance: Option<Effort>,
    /// How records are carried to other points.
    pub extrapolation: Extrapolation,
    /// Eye rays that say where records are needed.
    pub rays: u32,
    /// Share of every radius that spheres overlap by.
    pub margin: f32,
    /// Least and greatest radius in pixels.
    pub pixels: (f32, f32),
    /// Records computed per round at most. Part of the result: larger rounds know less of each other.
    pub round: u32,
    /// Number of threads; 0 for one per processor.
    pub threads: usize,
    /// Changes all random numbers.
    pub seed: u64,
}

impl Settings {
    /// How a cache made with `effort` is read.
    #[must_use]
    pub fn reading(&self, effort: &Effort) -> Reading {
        Reading { extrapolation: self.extrapolation, ..Reading::new(effort.tolerance) }
    }
}

/// Filled caches.
#[derive(Debug)]
pub struct RadianceCaches {
    /// What they were filled with.
    pub settings: Settings,
    /// As [`Settings::single`].
    pub single: Option<VolumeCache<'static>>,
    /// As [`Settings::surface`].
    pub surface: Option<VolumeCache<'static>>,
    /// As [`Settings::multiple`].
    pub multiple: Option<VolumeCache<'static>>,
    /// As [`Settings::irradiance`].
    pub irradiance: Option<SurfaceCache<'static>>,
}

/// Names of the caches, in the order of [`RadianceCaches::counts`].
pub const NAMES: [&str; 4] = ["single", "surface", "multiple", "irradiance"];

impl RadianceCaches {
    /// Empty caches.
    #[must_use]
    pub fn new(settings: Settings) -> Self {
        let volume = |effort: Option<Effort>| effort.map(|e| Cache::growing(coefficient_count(e.degree) - 1));
        Self {
            settings,
            single: volume(settings.single),
            surface: volume(settings.surface),
            multiple: volume(settings.multiple),
            irradiance: settings.irradiance.map(|_| Cache::growing(1)),
        }
    }

    /// The caches, to be read.
    #[must_use]
    pub fn reader(&self) -> Caches<'_> {
        fn read<'a, C>(settings: &Settings, cache: &'a Option<C>, effort: Option<Effort>) -> Option<Reader<'a, C>> {
            Some(Reader { cache: cache.as_ref()?, reading: settings.reading(&effort?) })
        }
        Caches {
            single: read(&self.settings, &self.single, self.settings.single),
            surface: read(&self.settings, &self.surface, self.settings.surface),
            multiple: read(&self.settings, &self.multiple, self.settings.multiple),
            irradiance: read(&self.settings, &self.irradiance, self.settings.irradiance),
        }
    }

    fn lighting(&self) -> Option<(&SurfaceCache<'_>, Reading)> {
        self.reader().irradiance.map(|r| (r.cache, r.reading))
    }

    /// Records and bytes of every cache; zeros for those that are off.
    #[must_use]
    pub fn counts(&self) -> [(usize, usize); 4] {
        let volume = |cache: &Option<VolumeCache<'_>>| cache.as_ref().map_or((0, 0), |c| (c.len(), c.bytes()));
        let surface = self.irradiance.as_ref().map_or((0, 0), |c| (c.len(), c.bytes()));
        [volume(&self.single), volume(&self.surface), volume(&self.multiple), surface]
    }
}

/// What filling took.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Outcome {
    /// Records computed, by cache: those dropped because another of their round covered them included.
    pub computed: [u64; 4],
    /// Time by cache.
    pub seconds: [Seconds; 4],
    /// Whether the host asked to stop.
    pub cancelled: bool,
}

/// Why nothing was filled.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum FillError {
    /// The system gave no threads; what it said.
    Threads(String),
}

impl fmt::Display for FillError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Threads(why) => write!(f, "cannot start threads: {why}"),
        }
    }
}

impl core::error::Error for FillError {}

/// Rays of the first batch; each next one has twice as many, up to [`LAST_BATCH`].
const FIRST_BATCH: u32 = 64;

/// See [`FIRST_BATCH`].
const LAST_BATCH: u32 = 4096;

/// Adds records to `caches` until every place that the eye rays ask for is covered.
///
/// `eye_ray(number, [u, v])` is the camera's ray for a point of the film; `pixel` the angular width of a
/// pixel (rad). `estimator` brings the world; its surface cache is replaced by the one being filled.
///
/// # Errors
/// No threads.
pub fn fill<M: Medium + Sync + ?Sized, S: Scene + Sync + ?Sized>(
    caches: &mut RadianceCaches,
    estimator: &Estimator<'_, M, S>,
    eye: &EyeSettings,
    pixel: f32,
    control: &Control<'_>,
    eye_ray: impl Fn([f32; 2]) -> Ray + Sync,
) -> Result<Outcome, FillError> {
    let settings = caches.settings;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(settings.threads)
        .build()
        .map_err(|error| FillError::Threads(error.to_string()))?;
    let filler = Filler { settings: &settings, estimator, eye, pixel, control, eye_ray: &eye_ray };
    pool.install(|| Ok(filler.fill(caches)))
}

struct Filler<'a, M: ?Sized, S: ?Sized, F> {
    settings: &'a Settings,
    estimator: &'a Estimator<'a, M, S>,
    eye: &'a EyeSettings,
    pixel: f32,
    control: &'a Control<'a>,
    eye_ray: &'a F,
}

/// A place, and how far the eye is.
#[derive(Clone, Copy)]
struct Wanted {
    place: Place,
    distance: f32,
}

/// What a cache of either kind needs to be filled.
trait Fill: Sync {
    /// What a record has besides.
    type Attached: Send;
    fn is_covered(&self, place: &Place, reading: &Reading) -> bool;
    fn guess(&self, place: &Place) -> Option<f32>;
    fn add(&mut self, record: Record, attached: Self::Attached) -> bool;
    fn finish(&mut self);
    fn count(&self) -> u32;
    fn place(&self, record: u32) -> Place;
    fn replace(&mut self, record: u32, value: Spectrum, gradient: &Gradient, attached: Self::Attached);
    fn radius(&self, record: u32) -> f32;
}

impl Fill for VolumeCache<'_> {
    type Attached = Vec<Coefficient>;
    fn is_covered(&self, place: &Place, reading: &Reading) -> bool {
        self.covers(place.point, reading)
    }
    fn guess(&self, place: &Place) -> Option<f32> {
        self.radius_near(place.point)
    }
    fn add(&mut self, record: Record, higher: Vec<Coefficient>) -> bool {
        // Storage that grows is never full.
        self.insert(record, &higher) == Ok(true)
    }
    fn count(&self) -> u32 {
        self.len() as u32
    }
    fn place(&self, record: u32) -> Place {
        Place { point: self.records()[record as usize].position, normal: None, is_seen: true }
    }
    fn replace(&mut self, record: u32, value: Spectrum, gradient: &Gradient, higher: Vec<Coefficient>) {
        self.revise(record, value, gradient, &higher);
    }
    fn radius(&self, record: u32) -> f32 {
        self.records()[record as usize].radius
    }
    fn finish(&mut self) {
        let _ = Cache::finish(self);
    }
}

impl Fill for SurfaceCache<'_> {
    type Attached = Facing;
    fn is_covered(&self, place: &Place, reading: &Reading) -> bool {
        place.normal.is_none_or(|normal| self.covers(place.point, normal, reading))
    }
    fn guess(&self, place: &Place) -> Option<f32> {
        self.radius_near(place.point)
    }
    fn add(&mut self, record: Record, facing: Facing) -> bool {
        self.insert(record, &[facing]) == Ok(true)
    }
    fn count(&self) -> u32 {
        self.len() as u32
    }
    fn place(&self, record: u32) -> Place {
        let normal = self.attached(record).first().map(|facing| facing.normal);
        Place { point: self.records()[record as usize].position, normal, is_seen: false }
    }
    fn replace(&mut self, record: u32, value: Spectrum, gradient: &Gradient, facing: Facing) {
        self.revise(record, value, gradient, &[facing]);
    }
    fn radius(&self, record: u32) -> f32 {
        self.records()[record as usize].radius
    }
    fn finish(&mut self) {
        let _ = Cache::finish(self);
    }
}

/// Records that end walks are carried along their gradients: what noise adds in one bounce would be
/// carried into the next by exponentials.
fn straight<'a>(known: [(&'a VolumeCache<'a>, Reading); 2]) -> [(&'a VolumeCache<'a>, Reading); 2] {
    known.map(|(cache, reading)| (cache, Reading { extrapolation: match fogbow::cache::tune(2) { 0 => Extrapolation::Linear, 1 => Extrapolation::ExponentialMean, 2 => Extrapolation::Constant, _ => Extrapolation::Exponential }, margin: fogbow::cache::tune(3) as f32 * 0.1, ..reading }))
}

/// How often rough caches are revised: every time halves what is left of their first noise and more.
const REVISIONS: u64 = 2;

/// What light a record in the medium holds.
#[derive(Clone, Copy)]
enum Part {
    Single,
    Surface,
    Multiple,
}

/// An estimate for a record in the medium.
fn scattered<M: Medium + ?Sized, S: Scene + ?Sized>(
    cache: &VolumeCache<'_>,
    estimator: &Estimator<'_, M, S>,
    effort: &Effort,
    place: &Place,
    rng: &mut Generator,
    part: Part,
) -> (Sums, Vec<Coefficient>) {
    let mut higher = vec![Coefficient::ZERO; cache.stride()];
    let phase = estimator.phase(place.point);
    let sums = match part {
        Part::Single => estimator.single(place.point, &phase, &mut higher, rng),
        Part::Surface => estimator.surface(place.point, &phase, effort.samples, &mut higher, rng),
        Part::Multiple => estimator.multiple(place.point, &phase, effort.samples, &mut higher, rng),
    };
    (sums, higher)
}

/// An estimate for a record on a surface.
fn irradiance<M: Medium + ?Sized, S: Scene + ?Sized>(
    estimator: &Estimator<'_, M, S>,
    effort: &Effort,
    place: &Place,
    rng: &mut Generator,
) -> (Sums, Facing) {
    estimator.irradiance(place.point, place.normal.unwrap_or(Vec3::Z), effort.samples, rng)
}

/// Puts revised estimates in the place of the old ones.
fn put<C: Fill>(
    cache: Option<&mut C>,
    effort: Option<Effort>,
    revised: Option<Vec<(Sums, C::Attached)>>,
    computed: &mut u64,
) {
    let (Some(cache), Some(effort), Some(revised)) = (cache, effort, revised) else { return };
    *computed += revised.len() as u64;
    for (i, (sums, attached)) in (0..).zip(revised) {
        // Within its radius a record changes by a factor of e to the tolerance at most.
        let gradient = clamp_gradient(&sums.gradient, sums.value, cache.radius(i) / effort.tolerance);
        cache.replace(i, sums.value, &gradient, attached);
    }
}

impl<M, S, F> Filler<'_, M, S, F>
where
    M: Medium + Sync + ?Sized,
    S: Scene + Sync + ?Sized,
    F: Fn([f32; 2]) -> Ray + Sync,
{
    fn fill(&self, caches: &mut RadianceCaches) -> Outcome {
        let mut outcome = Outcome::default();
        let all = self.all_places();
        let settings = self.settings;
        let everywhere = |place: &Place| place.normal.is_some();
        let in_medium = |place: &Place| place.normal.is_none();
        let in_sight = |place: &Place| place.normal.is_some() && place.is_seen;

        // What lights everything else: coarse, because whoever asks sees many records at once. Made
        // by whole walks, then revised with what those have told.
        let clock = Stopwatch::start();
        let mut rough = RadianceCaches::new(Settings {
            single: None,
            surface: settings.surface.map(|effort| effort.coarser(1.5, 2)),
            multiple: settings.multiple.map(|effort| effort.coarser(1.5, 1)),
            irradiance: settings.irradiance.map(|effort| effort.coarser(4.0, 2)),
            ..*settings
        });
        if let (Some(cache), Some(effort)) = (&mut rough.irradiance, rough.settings.irradiance) {
            outcome.computed[3] += self.rounds(cache, &effort, 4, &all, everywhere, |cache, place, rng| {
                let surfaces = Some((cache, settings.reading(&effort)));
                irradiance(&Estimator { surfaces, ..*self.estimator }, &effort, place, rng)
            });
        }
        outcome.seconds[3] = clock.elapsed();
        let clock = Stopwatch::start();
        let mut surface = rough.surface.take();
        if let (Some(cache), Some(effort)) = (&mut surface, rough.settings.surface) {
            let estimator = Estimator { surfaces: rough.lighting(), ..*self.estimator };
            outcome.computed[1] += self.rounds(cache, &effort, 6, &all, in_medium, |cache, place, rng| {
                scattered(cache, &estimator, &effort, place, rng, Part::Surface)
            });
        }
        rough.surface = surface;
        outcome.seconds[1] = clock.elapsed();
        let clock = Stopwatch::start();
        let mut multiple = rough.multiple.take();
        if let (Some(cache), Some(effort)) = (&mut multiple, rough.settings.multiple) {
            let estimator = Estimator { surfaces: rough.lighting(), ..*self.estimator };
            let surface = rough.reader().surface;
            outcome.computed[2] += self.rounds(cache, &effort, 5, &all, in_medium, |cache, place, rng| {
                let known = surface.map(|s| [(s.cache, s.reading), (cache, settings.reading(&effort))]);
                let estimator = Estimator { scattered: known.map(straight), ..estimator };
                scattered(cache, &estimator, &effort, place, rng, Part::Multiple)
            });
        }
        rough.multiple = multiple;
        outcome.seconds[2] = clock.elapsed();
        for pass in 0..REVISIONS {
            self.revise(&mut rough, pass, &mut outcome);
        }

        let estimator = Estimator { surfaces: rough.lighting(), ..*self.estimator };
        if let (Some(cache), Some(effort)) = (&mut caches.single, settings.single) {
            let clock = Stopwatch::start();
            outcome.computed[0] = self.rounds(cache, &effort, 0, &all, in_medium, |cache, place, rng| {
                scattered(cache, &estimator, &effort, place, rng, Part::Single)
            });
            outcome.seconds[0] = clock.elapsed();
        }
        if let (Some(cache), Some(effort)) = (&mut caches.surface, settings.surface) {
            let clock = Stopwatch::start();
            outcome.computed[1] += self.rounds(cache, &effort, 1, &all, in_medium, |cache, place, rng| {
                scattered(cache, &estimator, &effort, place, rng, Part::Surface)
            });
            outcome.seconds[1] = outcome.seconds[1] + clock.elapsed();
        }
        let surface = caches.surface.as_ref().zip(settings.surface).map(|(c, e)| (c, settings.reading(&e)));
        if let (Some(cache), Some(effort)) = (&mut caches.multiple, settings.multiple) {
            let clock = Stopwatch::start();
            let known = surface.zip(rough.reader().multiple).map(|(s, m)| [s, (m.cache, m.reading)]);
            let estimator = Estimator { scattered: known.map(straight), ..estimator };
            outcome.computed[2] += self.rounds(cache, &effort, 2, &all, in_medium, |cache, place, rng| {
                scattered(cache, &estimator, &effort, place, rng, Part::Multiple)
            });
            outcome.seconds[2] = outcome.seconds[2] + clock.elapsed();
        }
        let multiple = caches.multiple.as_ref().zip(settings.multiple).map(|(c, e)| (c, settings.reading(&e)));
        if let (Some(cache), Some(effort)) = (&mut caches.irradiance, settings.irradiance) {
            let clock = Stopwatch::start();
            let known = surface.zip(multiple).map(|(surface, multiple)| straight([surface, multiple]));
            let estimator = Estimator { scattered: known, ..estimator };
            outcome.computed[3] += self.rounds(cache, &effort, 3, &all, in_sight, |_, place, rng| {
                irradiance(&estimator, &effort, place, rng)
            });
            outcome.seconds[3] = outcome.seconds[3] + clock.elapsed();
        }
        outcome.cancelled = self.control.is_cancelled();
        outcome
    }

    /// Estimates all records of the rough caches once more, with everything they know of each other.
    fn revise(&self, rough: &mut RadianceCaches, pass: u64, outcome: &mut Outcome) {
        let settings = rough.settings;
        let read = rough.reader();
        let surfaces = read.irradiance.map(|r| (r.cache, r.reading));
        let known = read.surface.zip(read.multiple).map(|(s, m)| straight([(s.cache, s.reading), (m.cache, m.reading)]));
        let estimator = Estimator { surfaces, scattered: known, ..*self.estimator };
        let clock = Stopwatch::start();
        let on_surfaces = rough.irradiance.as_ref().zip(settings.irradiance).map(|(cache, effort)| {
            self.revised(cache, 16 + 4 * pass, |place, rng| irradiance(&estimator, &effort, place, rng))
        });
        let done = clock.elapsed();
        outcome.seconds[3] = outcome.seconds[3] + done;
        let clock = Stopwatch::start();
        let multiple = rough.multiple.as_ref().zip(settings.multiple).map(|(cache, effort)| {
            self.revised(cache, 17 + 4 * pass, |place, rng| {
                scattered(cache, &estimator, &effort, place, rng, Part::Multiple)
            })
        });
        outcome.seconds[2] = outcome.seconds[2] + clock.elapsed();
        let clock = Stopwatch::start();
        let surface = rough.surface.as_ref().zip(settings.surface).map(|(cache, effort)| {
            self.revised(cache, 18 + 4 * pass, |place, rng| {
                scattered(cache, &estimator, &effort, place, rng, Part::Surface)
            })
        });
        outcome.seconds[1] = outcome.seconds[1] + clock.elapsed();
        put(rough.irradiance.as_mut(), settings.irradiance, on_surfaces, &mut outcome.computed[3]);
        put(rough.multiple.as_mut(), settings.multiple, multiple, &mut outcome.computed[2]);
        put(rough.surface.as_mut(), settings.surface, surface, &mut outcome.computed[1]);
    }

    fn revised<C: Fill>(
        &self,
        cache: &C,
        stream: u64,
        compute: impl Fn(&Place, &mut Generator) -> (Sums, C::Attached) + Sync,
    ) -> Vec<(Sums, C::Attached)> {
        let seed = mix(self.settings.seed ^ mix(stream + 1));
        let number = |i: u32| compute(&cache.place(i), &mut Generator::new(seed ^ u64::from(i)));
        (0..cache.count()).into_par_iter().map(number).collect()
    }

    /// Every place that eye rays ask for, in batches from coarse to fine.
    fn all_places(&self) -> Vec<Vec<Wanted>> {
        let (mut batches, mut from, mut size) = (Vec::new(), 0, FIRST_BATCH);
        while from < self.settings.rays {
            let until = self.settings.rays.min(from + size);
            let found: Vec<Vec<Wanted>> = (from..until).into_par_iter().map(|number| self.places_of(number)).collect();
            batches.push(found.concat());
            from = until;
            size = LAST_BATCH.min(size * 2);
        }
        batches
    }

    fn places_of(&self, number: u32) -> Vec<Wanted> {
        // The plane filled evenly by multiples of the plastic number (Roberts 2018).
        let turn = |step: f64| {
            let x = 0.5 + step * f64::from(number + 1);
            (x - x.floor()) as f32
        };
        let ray = (self.eye_ray)([turn(0.754_877_666_246_692_8), turn(0.569_840_290_998_053_3)]);
        let mut rng = Generator::new(mix(self.settings.seed ^ 0x70_1a_ce) ^ u64::from(number));
        let mut found = Vec::new();
        places(&ray, &self.estimator.world, self.eye, &mut rng, |place| {
            found.push(Wanted { place, distance: place.point.distance(ray.origin) });
        });
        found
    }

    /// Covers all places, round by round; how many records were computed.
    fn rounds<C: Fill>(
        &self,
        cache: &mut C,
        effort: &Effort,
        stream: u64,
        batches: &[Vec<Wanted>],
        is_for: impl Fn(&Place) -> bool,
        compute: impl Fn(&C, &Place, &mut Generator) -> (Sums, C::Attached) + Sync,
    ) -> u64 {
        let reading = Reading { margin: self.settings.margin, ..self.settings.reading(&effort) };
        let mut computed = 0_u64;
        for batch in batches {
            let mut open: Vec<Wanted> = batch.iter().filter(|wanted| is_for(&wanted.place)).copied().collect();
            loop {
                let frozen = &*cache;
                open = open.into_par_iter().filter(|wanted| !frozen.is_covered(&wanted.place, &reading)).collect();
                if open.is_empty() || self.control.is_cancelled() {
                    break;
                }
                let chosen = self.choose(frozen, effort, &open);
                let first = computed;
                let numbered: Vec<(u64, Wanted)> = (first..).zip(chosen).collect();
                computed += numbered.len() as u64;
                let records: Vec<(Place, Option<Record>, C::Attached)> = numbered
                    .par_iter()
                    .map(|(number, Wanted { place, distance })| {
                        let seed = mix(self.settings.seed ^ mix(stream + 1)) ^ number;
                        let (sums, attached) = compute(frozen, place, &mut Generator::new(seed));
                        let (least, most) = self.settings.pixels;
                        let limits = effort.limits.on_screen(least, most, self.pixel, *distance);
                        (*place, Record::new(place.point, &sums, effort.tolerance, limits), attached)
                    })
                    .collect();
                let mut added = 0;
                for (place, record, attached) in records {
                    if let Some(record) = record
                        && !cache.is_covered(&place, &reading)
                        && cache.add(record, attached)
                    {
                        added += 1;
                    }
                }
                // Places where nothing can be stored must not be asked for again and again.
                if added == 0 {
                    break;
                }
            }
        }
        cache.finish();
        computed
    }

    /// The places of one round: the first open ones that are not too close to each other.
    fn choose<C: Fill>(&self, cache: &C, effort: &Effort, open: &[Wanted]) -> Vec<Wanted> {
        let mut chosen: Vec<(Wanted, f32)> = Vec::new();
        for wanted in open {
            if chosen.len() >= self.settings.round as usize {
                break;
            }
            let near = |(other, radius): &(Wanted, f32)| {
                let same_side = match (wanted.place.normal, other.place.normal) {
                    (Some(a), Some(b)) => a.dot(b) > 0.7,
                    _ => true,
                };
                same_side && other.place.point.distance_squared(wanted.place.point) < radius * radius
            };
            if chosen.iter().any(near) {
                continue;
            }
            let guess = cache.guess(&wanted.place).unwrap_or(0.5 * effort.limits.max);
            chosen.push((*wanted, guess * (1.0 - self.settings.margin)));
        }
        chosen.into_iter().map(|(wanted, _)| wanted).collect()
    }
}
