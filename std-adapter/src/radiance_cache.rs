//! Filling radiance caches in parallel, in rounds whose result does not depend on the number of threads.
//!
//! Eye rays say where light is asked for. Where no record reaches, one is computed against the
//! frozen caches, many at a time; then they are inserted in order, and those dropped that an earlier
//! one of the same round now covers. First the cache on surfaces, because light from surfaces enters all
//! others.

use core::fmt;

use fogbow::cache::{
    Cache, Caches, Estimator, Extrapolation, EyeSettings, Facing, Limits, Place, Reader, Reading, Record, SurfaceCache, VolumeCache,
    places,
};
use fogbow::host::{Medium, Scene};
use fogbow::math::{Ray, Vec3};
use fogbow::sampling::Generator;
use fogbow::sampling::uniform::mix;
use fogbow::sh::{Coefficient, coefficient_count};
use fogbow::single_scatter::Sums;
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
    fn finish(&mut self) {
        let _ = Cache::finish(self);
    }
}

/// Records that end walks are carried along their gradients: what noise adds in one bounce would be
/// carried into the next by exponentials.
fn straight<'a>(known: [(&'a VolumeCache<'a>, Reading); 2]) -> [(&'a VolumeCache<'a>, Reading); 2] {
    known.map(|(cache, reading)| (cache, Reading { extrapolation: Extrapolation::Linear, ..reading }))
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

        // What lights everything else: coarse, because whoever asks sees many records at once.
        let coarse = settings.irradiance.map(|effort| {
            let effort = effort.coarser(4.0, 2);
            let mut cache: SurfaceCache<'static> = Cache::growing(1);
            let clock = Stopwatch::start();
            outcome.computed[3] += self.irradiance(&mut cache, &effort, 4, &all, everywhere, self.estimator);
            outcome.seconds[3] = clock.elapsed();
            (cache, self.settings.reading(&effort))
        });
        let surfaces = coarse.as_ref().map(|(cache, reading)| (cache, *reading));
        let estimator = Estimator { surfaces, ..*self.estimator };
        if let (Some(cache), Some(effort)) = (&mut caches.single, settings.single) {
            let clock = Stopwatch::start();
            outcome.computed[0] = self.rounds(cache, &effort, 0, &all, in_medium, |cache, place, rng| {
                let mut higher = vec![Coefficient::ZERO; cache.stride()];
                (estimator.single(place.point, &estimator.phase(place.point), &mut higher, rng), higher)
            });
            outcome.seconds[0] = clock.elapsed();
        }
        if let (Some(cache), Some(effort)) = (&mut caches.surface, settings.surface) {
            let clock = Stopwatch::start();
            outcome.computed[1] = self.rounds(cache, &effort, 1, &all, in_medium, |cache, place, rng| {
                let mut higher = vec![Coefficient::ZERO; cache.stride()];
                let phase = estimator.phase(place.point);
                (estimator.surface(place.point, &phase, effort.samples, &mut higher, rng), higher)
            });
            outcome.seconds[1] = clock.elapsed();
        }
        let surface = caches.surface.as_ref().zip(settings.surface).map(|(c, e)| (c, settings.reading(&e)));
        if let (Some(cache), Some(effort)) = (&mut caches.multiple, settings.multiple) {
            let clock = Stopwatch::start();
            // The first records come from whole walks. The final ones end theirs at those.
            let mut first: VolumeCache<'static> = Cache::growing(cache.stride());
            let rough = effort.coarser(1.5, 1);
            outcome.computed[2] = self.multiple(&mut first, &rough, 5, &all, surface, None, &estimator);
            let known = Some((&first, self.settings.reading(&rough)));
            outcome.computed[2] += self.multiple(cache, &effort, 2, &all, surface, known, &estimator);
            outcome.seconds[2] = clock.elapsed();
        }
        let multiple = caches.multiple.as_ref().zip(settings.multiple).map(|(c, e)| (c, settings.reading(&e)));
        if let (Some(cache), Some(effort)) = (&mut caches.irradiance, settings.irradiance) {
            let clock = Stopwatch::start();
            let scattered = surface.zip(multiple).map(|(surface, multiple)| [surface, multiple]);
            let estimator = Estimator { scattered: scattered.map(straight), ..estimator };
            outcome.computed[3] += self.irradiance(cache, &effort, 3, &all, in_sight, &estimator);
            outcome.seconds[3] = outcome.seconds[3] + clock.elapsed();
        }
        outcome.cancelled = self.control.is_cancelled();
        outcome
    }

    fn irradiance(
        &self,
        cache: &mut SurfaceCache<'_>,
        effort: &Effort,
        stream: u64,
        all: &[Vec<Wanted>],
        is_for: impl Fn(&Place) -> bool,
        estimator: &Estimator<'_, M, S>,
    ) -> u64 {
        self.rounds(cache, effort, stream, all, is_for, |cache, place, rng| {
            let own = Some((cache, self.settings.reading(&effort)));
            let estimator = Estimator { surfaces: estimator.surfaces.or(own), ..*estimator };
            estimator.irradiance(place.point, place.normal.unwrap_or(Vec3::Z), effort.samples, rng)
        })
    }

    fn multiple(
        &self,
        cache: &mut VolumeCache<'_>,
        effort: &Effort,
        stream: u64,
        all: &[Vec<Wanted>],
        surface: Option<(&VolumeCache<'_>, Reading)>,
        known: Option<(&VolumeCache<'_>, Reading)>,
        estimator: &Estimator<'_, M, S>,
    ) -> u64 {
        let is_for = |place: &Place| place.normal.is_none();
        self.rounds(cache, effort, stream, all, is_for, |cache, place, rng| {
            let own = (cache, self.settings.reading(&effort));
            let scattered = surface.map(|surface| [surface, known.unwrap_or(own)]);
            let estimator = Estimator { scattered: scattered.map(straight), ..*estimator };
            let mut higher = vec![Coefficient::ZERO; cache.stride()];
            let phase = estimator.phase(place.point);
            (estimator.multiple(place.point, &phase, effort.samples, &mut higher, rng), higher)
        })
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
