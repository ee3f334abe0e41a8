//! In which order records are made.
//!
//! Eye rays say where light is asked for. Where no record reaches, one is computed against the
//! frozen caches, many at a time; then they are inserted in order, and those dropped that an earlier
//! one of the same round now covers. In this order:
//!
//! 1. coarse irradiance on all surfaces, light of surfaces in the medium, coarse multiple scattering: from
//!    whole walks;
//! 2. the same records again, twice, from all that they know of each other;
//! 3. final multiple scattering and final irradiance where eye rays come: places and radii from some
//!    samples, then values from as many others, so that noise in one does not steer the other. Fewer for the
//!    first are no saving: radii that noise has made too large stay, and what they cover stays wrong.

use core::fmt;

use fogbow::bytes::Crc;
use fogbow::cache::{
    Cache, Estimator, EyeSettings, Facing, Guide, Guided, Looks, Place, Reading, Record, SurfaceCache, VolumeCache,
    clamp_gradient, clearance, places,
};
use fogbow::host::{Medium, Scene};
use fogbow::math::{Ray, Vec3};
use fogbow::sampling::Generator;
use fogbow::sampling::uniform::mix;
use fogbow::sh::Coefficient;
use fogbow::single_scatter::Sums;
use fogbow::spectrum::Gradient;
use rayon::iter::{IntoParallelIterator, IntoParallelRefIterator, ParallelIterator};

use super::{Effort, RadianceCaches, Settings};
use crate::progress::Control;
use crate::stats::{Seconds, Stopwatch};

/// What filling took.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Outcome {
    /// Records computed, by cache: those dropped because another of their round covered them included.
    pub computed: [u64; 4],
    /// Time by cache.
    pub seconds: [Seconds; 4],
    /// Time to find the places that eye rays ask for, and which of them no record covers.
    pub search: Seconds,
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
    fn count(&self) -> usize;
    fn finish(&mut self);
    fn record(&self, number: usize) -> (Place, f32);
    /// Calls `visit(number, weight)` for the records that reach `point`.
    fn visit_near(&self, point: Vec3, visit: impl FnMut(usize, f32));
    fn replace(&mut self, number: usize, sums: &Sums, gradient: &Gradient, attached: Self::Attached);
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
    fn count(&self) -> usize {
        self.len()
    }
    fn finish(&mut self) {
        let _ = Cache::finish(self);
    }
    fn record(&self, number: usize) -> (Place, f32) {
        let record = &self.records()[number];
        (Place { point: record.position, normal: None, is_seen: true }, record.radius)
    }
    fn visit_near(&self, point: Vec3, mut visit: impl FnMut(usize, f32)) {
        self.visit(point, |number, _, share| visit(number as usize, 1.0 - share));
    }
    fn replace(&mut self, number: usize, sums: &Sums, gradient: &Gradient, higher: Vec<Coefficient>) {
        self.revise(number as u32, sums.value, gradient, &higher);
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
    fn count(&self) -> usize {
        self.len()
    }
    fn finish(&mut self) {
        let _ = Cache::finish(self);
    }
    fn record(&self, number: usize) -> (Place, f32) {
        let record = &self.records()[number];
        let normal = self.attached(number as u32).first().map(|facing| facing.normal);
        (Place { point: record.position, normal, is_seen: false }, record.radius)
    }
    fn visit_near(&self, point: Vec3, mut visit: impl FnMut(usize, f32)) {
        self.visit(point, |number, _, share| visit(number as usize, 1.0 - share));
    }
    fn replace(&mut self, number: usize, sums: &Sums, gradient: &Gradient, facing: Facing) {
        self.revise(number as u32, sums.value, gradient, &[facing]);
    }
}

/// What lights all final records.
fn lighting<'a>(
    cache: &'a Option<SurfaceCache<'static>>,
    settings: &Settings,
) -> Option<(&'a SurfaceCache<'a>, Reading)> {
    Some((cache.as_ref()?, settings.reading(&settings.coarse_irradiance()?)))
}

/// How often the first records are estimated anew from each other: every time most of their noise goes.
const REVISIONS: u64 = 2;

/// What light a record in the medium holds.
#[derive(Clone, Copy)]
enum Part {
    Single,
    Surface,
    Multiple,
}

/// Samples drawn blindly, for others to learn from.
fn looks(count: u32, learnt: &mut Guide) -> Looks<'_> {
    Looks { count, guide: None, learnt: Some(learnt) }
}

/// An estimate for a record in the medium.
fn scattered<M: Medium + ?Sized, S: Scene + ?Sized>(
    cache: &VolumeCache<'_>,
    estimator: &Estimator<'_, M, S>,
    looks: Looks<'_>,
    place: &Place,
    rng: &mut Generator,
    part: Part,
) -> (Sums, Vec<Coefficient>) {
    let mut higher = vec![Coefficient::ZERO; cache.stride()];
    let phase = estimator.phase(place.point);
    let sums = match part {
        Part::Single => estimator.single(place.point, &phase, &mut higher, rng),
        Part::Surface => estimator.surface(place.point, &phase, looks, &mut higher, rng),
        Part::Multiple => estimator.multiple(place.point, &phase, looks, &mut higher, rng),
    };
    (sums, higher)
}

/// An estimate for a record on a surface.
fn irradiance<M: Medium + ?Sized, S: Scene + ?Sized>(
    estimator: &Estimator<'_, M, S>,
    looks: Looks<'_>,
    place: &Place,
    rng: &mut Generator,
) -> (Sums, Facing) {
    estimator.irradiance(place.point, place.normal.unwrap_or(Vec3::Z), looks, rng)
}

/// Puts revised estimates in the place of the old ones, from a record on, and adds to what was learnt.
fn put<C: Fill>(
    cache: &mut Option<C>,
    effort: Option<Effort>,
    from: usize,
    revised: Revised<C::Attached>,
    guides: &mut [Guide],
) -> u64 {
    let (Some(cache), Some(effort)) = (cache, effort) else { return 0 };
    let count = revised.len() as u64;
    for (i, (sums, attached, learnt)) in revised.into_iter().enumerate() {
        // Within its radius a record changes by a factor of e to the tolerance at most.
        let number = from + i;
        let reach = cache.record(number).1 / effort.tolerance;
        cache.replace(number, &sums, &clamp_gradient(&sums.gradient, sums.value, reach), attached);
        if let Some(guide) = guides.get_mut(i) {
            guide.merge(&learnt, 1.0);
        }
    }
    count
}

/// Estimates for the records of a cache, in their order, with what they learnt.
type Revised<A> = Vec<(Sums, A, Guide)>;

impl<M, S, F> Filler<'_, M, S, F>
where
    M: Medium + Sync + ?Sized,
    S: Scene + Sync + ?Sized,
    F: Fn([f32; 2]) -> Ray + Sync,
{
    fn fill(&self, caches: &mut RadianceCaches) -> Outcome {
        let mut outcome = Outcome::default();
        let view = self.view();
        if caches.views.contains(&view) {
            return outcome;
        }
        let clock = Stopwatch::start();
        let all = self.all_places(caches);
        let settings = self.settings;
        let everywhere = |place: &Place| place.normal.is_some();
        let in_medium = |place: &Place| place.normal.is_none();
        let in_sight = |place: &Place| place.normal.is_some() && place.is_seen;
        outcome.search = clock.elapsed();
        if all.iter().all(Vec::is_empty) && caches.settled == caches.all_counts() {
            caches.views.push(view);
            return outcome;
        }

        // From these records on nothing is final: what a cancelled fill has left is estimated again, too.
        let before = caches.settled;
        // What the records from there on have learnt.
        let counts = caches.all_counts();
        let mut guides: [Vec<Guide>; 5] =
            core::array::from_fn(|i| vec![Guide::default(); counts[i].saturating_sub(before[i])]);
        // What lights everything else: coarse, because whoever asks sees many records at once.
        if let (Some(cache), Some(effort)) = (&mut caches.coarse_irradiance, settings.coarse_irradiance()) {
            let clock = Stopwatch::start();
            outcome.computed[3] +=
                self.rounds(cache, &effort, 4, &all, everywhere, &mut guides[0], |cache, place, learnt, rng| {
                    let surfaces = Some((cache, settings.reading(&effort)));
                    let estimator = Estimator { surfaces, ..*self.estimator };
                    irradiance(&estimator, looks(effort.samples, learnt), place, rng)
                });
            outcome.seconds[3] = clock.elapsed();
        }
        let estimator = Estimator { surfaces: lighting(&caches.coarse_irradiance, settings), ..*self.estimator };
        if let (Some(cache), Some(effort)) = (&mut caches.surface, settings.surface) {
            let clock = Stopwatch::start();
            outcome.computed[1] +=
                self.rounds(cache, &effort, 1, &all, in_medium, &mut guides[1], |cache, place, learnt, rng| {
                    scattered(cache, &estimator, looks(effort.samples, learnt), place, rng, Part::Surface)
                });
            outcome.seconds[1] = clock.elapsed();
        }
        if let (Some(cache), Some(effort)) = (&mut caches.coarse_multiple, settings.coarse_multiple()) {
            let clock = Stopwatch::start();
            let surface = caches.surface.as_ref().zip(settings.surface).map(|(c, e)| (c, settings.reading(&e)));
            outcome.computed[2] +=
                self.rounds(cache, &effort, 5, &all, in_medium, &mut guides[2], |cache, place, learnt, rng| {
                    let scattered_light = surface.map(|surface| [surface, (cache, settings.reading(&effort))]);
                    let estimator = Estimator { scattered: scattered_light, ..estimator };
                    scattered(cache, &estimator, looks(effort.samples, learnt), place, rng, Part::Multiple)
                });
            outcome.seconds[2] = clock.elapsed();
        }
        for pass in 0..REVISIONS {
            self.revise(caches, before, pass, &mut guides, &mut outcome);
        }

        let estimator = Estimator { surfaces: lighting(&caches.coarse_irradiance, settings), ..*self.estimator };
        if let (Some(cache), Some(effort)) = (&mut caches.single, settings.single) {
            let clock = Stopwatch::start();
            outcome.computed[0] =
                self.rounds(cache, &effort, 0, &all, in_medium, &mut Vec::new(), |cache, place, learnt, rng| {
                    scattered(cache, &estimator, looks(effort.samples, learnt), place, rng, Part::Single)
                });
            outcome.seconds[0] = clock.elapsed();
        }
        let surface = caches.surface.as_ref().zip(settings.surface).map(|(c, e)| (c, settings.reading(&e)));
        if let (Some(cache), Some(effort)) = (&mut caches.multiple, settings.multiple) {
            let clock = Stopwatch::start();
            let coarse = caches.coarse_multiple.as_ref().zip(settings.coarse_multiple());
            let known = surface.zip(coarse).map(|(s, (c, e))| [s, (c, settings.reading(&e))]);
            let estimator = Estimator { scattered: known, ..estimator };
            outcome.computed[2] +=
                self.rounds(cache, &effort, 2, &all, in_medium, &mut guides[3], |cache, place, learnt, rng| {
                    scattered(cache, &estimator, looks(effort.samples, learnt), place, rng, Part::Multiple)
                });
            outcome.seconds[2] = outcome.seconds[2] + clock.elapsed();
        }
        let clock = Stopwatch::start();
        let known = surface.zip(caches.multiple.as_ref().zip(settings.multiple));
        let known = known.map(|(s, (c, e))| [s, (c, settings.reading(&e))]);
        let again = Estimator { scattered: known, ..estimator };
        let revised = self.revised(
            &caches.multiple,
            settings.multiple,
            before[3],
            100,
            &guides[3],
            |cache, looks, place, rng| scattered(cache, &again, looks, place, rng, Part::Multiple),
        );
        outcome.computed[2] += put(&mut caches.multiple, settings.multiple, before[3], revised, &mut guides[3]);
        outcome.seconds[2] = outcome.seconds[2] + clock.elapsed();
        let multiple = caches.multiple.as_ref().zip(settings.multiple).map(|(c, e)| (c, settings.reading(&e)));
        if let Some(effort) = settings.irradiance {
            let clock = Stopwatch::start();
            let known = surface.zip(multiple).map(|(surface, multiple)| [surface, multiple]);
            let estimator = Estimator { scattered: known, ..estimator };
            if let Some(cache) = &mut caches.irradiance {
                outcome.computed[3] +=
                    self.rounds(cache, &effort, 3, &all, in_sight, &mut guides[4], |_, place, learnt, rng| {
                        irradiance(&estimator, looks(effort.samples, learnt), place, rng)
                    });
            }
            let revised = self.revised(
                &caches.irradiance,
                settings.irradiance,
                before[4],
                101,
                &guides[4],
                |_, looks, place, rng| irradiance(&estimator, looks, place, rng),
            );
            outcome.computed[3] += put(&mut caches.irradiance, settings.irradiance, before[4], revised, &mut guides[4]);
            outcome.seconds[3] = outcome.seconds[3] + clock.elapsed();
        }
        outcome.cancelled = self.control.is_cancelled();
        if !outcome.cancelled {
            caches.views.push(view);
            caches.settled = caches.all_counts();
        }
        outcome
    }

    /// A mark of where the eye rays go and how densely places are asked for.
    fn view(&self) -> u64 {
        let Settings { rays, margin, pixels, round, seed, .. } = *self.settings;
        let EyeSettings { density, lights_visible, indirect, .. } = *self.eye;
        let mut crc = Crc::new();
        let mut add = |numbers: &[f32]| numbers.iter().for_each(|n| crc.add(&n.to_bits().to_le_bytes()));
        add(&[margin, pixels.0, pixels.1, self.pixel, density, f32::from(lights_visible), f32::from(indirect)]);
        for at in [[0.5, 0.5], [0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.3, 0.6]] {
            let ray = (self.eye_ray)(at);
            add(&ray.origin.to_array());
            add(&ray.direction.to_array());
        }
        for number in [u64::from(rays), u64::from(round), seed] {
            crc.add(&number.to_le_bytes());
        }
        crc.value()
    }

    /// Whether the final caches have all that is asked for at a place.
    fn is_covered(&self, caches: &RadianceCaches, place: &Place) -> bool {
        fn check<C: Fill>(cache: &Option<C>, effort: Option<Effort>, margin: f32, place: &Place) -> bool {
            let (Some(cache), Some(effort)) = (cache, effort) else { return true };
            cache.is_covered(place, &Reading { margin, ..Reading::new(effort.tolerance) })
        }
        let Settings { single, surface, multiple, irradiance, margin, .. } = *self.settings;
        match place.normal {
            None => {
                check(&caches.single, single, margin, place)
                    && check(&caches.surface, surface, margin, place)
                    && check(&caches.multiple, multiple, margin, place)
            }
            Some(_) => check(&caches.irradiance, irradiance, margin, place),
        }
    }

    /// Estimates the first records once more, with everything they know of each other; from those numbers on.
    fn revise(
        &self,
        caches: &mut RadianceCaches,
        from: [usize; 5],
        pass: u64,
        guides: &mut [Vec<Guide>; 5],
        outcome: &mut Outcome,
    ) {
        let settings = self.settings;
        let (on_surfaces, light, coarse) = (settings.coarse_irradiance(), settings.surface, settings.coarse_multiple());
        let surface = caches.surface.as_ref().zip(light).map(|(c, e)| (c, settings.reading(&e)));
        let multiple = caches.coarse_multiple.as_ref().zip(coarse).map(|(c, e)| (c, settings.reading(&e)));
        let known = surface.zip(multiple).map(|(surface, multiple)| [surface, multiple]);
        let estimator =
            Estimator { surfaces: lighting(&caches.coarse_irradiance, settings), scattered: known, ..*self.estimator };
        let mut clock = Stopwatch::start();
        let new_irradiance = self.revised(
            &caches.coarse_irradiance,
            on_surfaces,
            from[0],
            3 * pass,
            &guides[0],
            |_, looks, place, rng| irradiance(&estimator, looks, place, rng),
        );
        outcome.seconds[3] = outcome.seconds[3] + clock.elapsed();
        clock = Stopwatch::start();
        let new_surface =
            self.revised(&caches.surface, light, from[1], 3 * pass + 1, &guides[1], |cache, looks, place, rng| {
                scattered(cache, &estimator, looks, place, rng, Part::Surface)
            });
        outcome.seconds[1] = outcome.seconds[1] + clock.elapsed();
        clock = Stopwatch::start();
        let new_multiple = self.revised(
            &caches.coarse_multiple,
            coarse,
            from[2],
            3 * pass + 2,
            &guides[2],
            |cache, looks, place, rng| scattered(cache, &estimator, looks, place, rng, Part::Multiple),
        );
        outcome.seconds[2] = outcome.seconds[2] + clock.elapsed();
        outcome.computed[3] += put(&mut caches.coarse_irradiance, on_surfaces, from[0], new_irradiance, &mut guides[0]);
        outcome.computed[1] += put(&mut caches.surface, light, from[1], new_surface, &mut guides[1]);
        outcome.computed[2] += put(&mut caches.coarse_multiple, coarse, from[2], new_multiple, &mut guides[2]);
    }

    /// Estimates for all records from a number on, each guided by what those around it have learnt.
    fn revised<C: Fill>(
        &self,
        cache: &Option<C>,
        effort: Option<Effort>,
        from: usize,
        stream: u64,
        guides: &[Guide],
        compute: impl Fn(&C, Looks<'_>, &Place, &mut Generator) -> (Sums, C::Attached) + Sync,
    ) -> Revised<C::Attached> {
        let (Some(cache), Some(effort)) = (cache, effort) else { return Vec::new() };
        if self.control.is_cancelled() {
            return Vec::new();
        }
        let seed = mix(self.settings.seed ^ mix(stream + 16));
        let estimate = |number: usize| {
            let place = cache.record(number).0;
            let mut around = Guide::default();
            cache.visit_near(place.point, |other, weight| {
                if let Some(guide) = other.checked_sub(from).and_then(|i| guides.get(i)) {
                    around.merge(guide, weight);
                }
            });
            let (guide, mut learnt) = (Guided::new(&around), Guide::default());
            let looks = Looks { count: effort.samples, guide: guide.as_ref(), learnt: Some(&mut learnt) };
            let (sums, attached) = compute(cache, looks, &place, &mut Generator::new(seed ^ number as u64));
            (sums, attached, learnt)
        };
        (from..cache.count()).into_par_iter().map(estimate).collect()
    }

    /// Every place that eye rays ask for and `caches` do not cover, in batches from coarse to fine.
    fn all_places(&self, caches: &RadianceCaches) -> Vec<Vec<Wanted>> {
        let (mut batches, mut from, mut size) = (Vec::new(), 0, FIRST_BATCH);
        while from < self.settings.rays {
            let until = self.settings.rays.min(from + size);
            let found: Vec<Vec<Wanted>> =
                (from..until).into_par_iter().map(|number| self.places_of(number, caches)).collect();
            batches.push(found.concat());
            from = until;
            size = LAST_BATCH.min(size * 2);
        }
        batches
    }

    fn places_of(&self, number: u32, caches: &RadianceCaches) -> Vec<Wanted> {
        // The plane filled evenly by multiples of the plastic number (Roberts 2018).
        let turn = |step: f64| {
            let x = 0.5 + step * f64::from(number + 1);
            (x - x.floor()) as f32
        };
        let ray = (self.eye_ray)([turn(0.754_877_666_246_692_8), turn(0.569_840_290_998_053_3)]);
        let mut rng = Generator::new(mix(self.settings.seed ^ 0x70_1a_ce) ^ u64::from(number));
        let mut found = Vec::new();
        // Surfaces that light a place come right after it, and are of no use if nothing is made there.
        let mut is_open = false;
        places(&ray, &self.estimator.world, self.eye, &mut rng, |place| {
            if place.is_seen {
                is_open = !self.is_covered(caches, &place);
            }
            if !is_open {
                return;
            }
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
        guides: &mut Vec<Guide>,
        compute: impl Fn(&C, &Place, &mut Guide, &mut Generator) -> (Sums, C::Attached) + Sync,
    ) -> u64 {
        let reading = Reading { margin: self.settings.margin, ..self.settings.reading(effort) };
        // Records added later must not share the random numbers of the first.
        let start = if cache.count() == 0 { 0 } else { mix(cache.count() as u64) };
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
                let numbered: Vec<(u64, Wanted)> =
                    chosen.into_iter().enumerate().map(|(i, w)| (start.wrapping_add(computed + i as u64), w)).collect();
                computed += numbered.len() as u64;
                let records: Vec<(Place, Option<Record>, C::Attached, Guide)> = numbered
                    .par_iter()
                    .map(|(number, Wanted { place, distance })| {
                        let seed = mix(self.settings.seed ^ mix(stream + 1)) ^ number;
                        let mut learnt = Guide::default();
                        let (sums, attached) = compute(frozen, place, &mut learnt, &mut Generator::new(seed));
                        let (least, most) = self.settings.pixels;
                        let limits = effort
                            .limits
                            .on_screen(least, most, self.pixel, *distance)
                            .within(self.reach(effort, place));
                        (*place, Record::new(place.point, &sums, effort.tolerance, limits), attached, learnt)
                    })
                    .collect();
                let mut added = 0;
                for (place, record, attached, learnt) in records {
                    if let Some(record) = record
                        && !cache.is_covered(&place, &reading)
                        && cache.add(record, attached)
                    {
                        guides.push(learnt);
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

    /// How far a record may reach because of surfaces near it.
    fn reach(&self, effort: &Effort, place: &Place) -> f32 {
        if effort.clearance == f32::INFINITY {
            return f32::INFINITY;
        }
        let distance = clearance(place.point, place.normal, self.estimator.world.scene);
        (effort.clearance * distance).max(self.estimator.finest)
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
