//! Filling radiance caches: the same bits for any number of threads, and fills that end early.

use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use fogbow::cache::{
    Estimator, Extrapolation, EyeSettings, Limits, Place, Reading, Record, VolumeCache, clearance, places, radiance,
};
use fogbow::host::{Gradients, MajorantSegment, Medium, Properties};
use fogbow::light::{Light, PointLight};
use fogbow::math::{Ray, Vec2, Vec3};
use fogbow::medium::Homogeneous;
use fogbow::path::{self, World};
use fogbow::phase::Lobe;
use fogbow::sampling::Generator;
use fogbow::spectrum::Spectrum;
use fogbow::surface::Surface;
use fogbow::transmittance::thickness::Steps;
use fogbow::{multiple_scatter, single_scatter::Sums};
use fogbow_std::film::Film;
use fogbow_std::progress::Control;
use fogbow_std::radiance_cache::{Effort, Outcome, RadianceCaches, Settings, decode, encode, fill};
use fogbow_std::tiles;
use fogbow_tests::hosts::{Ball, Body, Filled};

const EYE: EyeSettings = EyeSettings { density: 6.0, connections: 4, lights_visible: true, indirect: true };
/// About the angle between pixels of an image of 16 × 16 (rad).
const PIXEL: f32 = 0.06;

/// Fog that scatters forwards, in a ball.
fn fog() -> Filled<Homogeneous> {
    let (absorption, scattering) = (Spectrum::splat(0.05), Spectrum::new(0.4, 0.5, 0.6));
    let medium = Homogeneous::new(absorption, scattering, Lobe::HenyeyGreenstein { g: 0.4 }).unwrap();
    Filled { medium, body: Body::Sphere { centre: Vec3::ZERO, radius: 2.5 } }
}

/// A lamp.
fn lamp() -> Light<'static> {
    Light::Point(PointLight::new(Vec3::new(0.3, 1.2, 0.2), Spectrum::new(4.0, 3.0, 2.0)).unwrap())
}

/// A pale room, round.
fn room() -> Ball {
    Ball { centre: Vec3::ZERO, radius: 2.0, surface: Surface::Lambert { reflectance: Spectrum::splat(0.6) } }
}

/// A camera in the room.
fn eye_ray(film: [f32; 2]) -> Ray {
    let [x, y] = film.map(|u| u - 0.5);
    Ray::new(Vec3::new(0.0, 0.0, -1.5), Vec3::new(x, -y, 1.0).normalize())
}

fn settings() -> Settings {
    let limits = Limits { min: 0.02, max: 0.8 };
    let clearance = f32::INFINITY;
    let effort = |tolerance: f32, degree: usize| Some(Effort { tolerance, samples: 32, degree, limits, clearance });
    Settings {
        single: effort(0.5, 3),
        surface: effort(1.5, 2),
        multiple: effort(1.0, 2),
        irradiance: effort(0.5, 0),
        extrapolation: Extrapolation::Curved,
        rays: 600,
        margin: 0.15,
        pixels: (1.0, 1000.0),
        round: 16,
        threads: 2,
        seed: 1,
    }
}

/// [`settings`] with so many walks that a picture's mean is off by a few per cent at most.
fn settled() -> Settings {
    let more = |effort: Option<Effort>| effort.map(|e| Effort { samples: 512, ..e });
    let few = settings();
    Settings { surface: more(few.surface), multiple: more(few.multiple), irradiance: more(few.irradiance), ..few }
}

fn estimator<'a, M>(medium: &'a M, room: &'a Ball, lights: &'a [Light<'a>]) -> Estimator<'a, M, Ball> {
    Estimator {
        world: World { medium, scene: room, lights },
        surfaces: None,
        scattered: None,
        walk: multiple_scatter::Settings::new(Steps::Length(0.3)),
        paths: path::Settings::default(),
        light_samples: 1,
        finest: 0.02,
    }
}

/// Fills `caches` as far as `control` lets it.
fn fill_in<M: Medium + Sync>(caches: &mut RadianceCaches, medium: &M, control: &Control<'_>) -> Outcome {
    let (room, lights) = (room(), [lamp()]);
    fill(caches, &estimator(medium, &room, &lights), &EYE, PIXEL, control, eye_ray).unwrap()
}

fn filled(settings: Settings) -> (RadianceCaches, Outcome) {
    let mut caches = RadianceCaches::new(settings);
    let outcome = fill_in(&mut caches, &fog(), &Control::default());
    (caches, outcome)
}

/// All that is stored, to the last bit: the shortest decimal that reads back as the same number tells numbers
/// apart, and zeros by their sign.
fn stored(caches: &RadianceCaches) -> String {
    let volumes = [&caches.single, &caches.surface, &caches.multiple]
        .map(|cache| cache.as_ref().map(|cache| (cache.records(), cache.attachments())));
    let surface = caches.irradiance.as_ref().map(|cache| (cache.records(), cache.attachments()));
    format!("{volumes:?} {surface:?}")
}

/// An image with the caches, and how many of its look-ups were misses.
fn picture(caches: &RadianceCaches, threads: usize) -> (Film, u64, u64) {
    let (fog, room, lights) = (fog(), room(), [lamp()]);
    let reader = caches.reader();
    let surfaces = reader.irradiance.map(|r| (r.cache, r.reading));
    let estimator = Estimator { surfaces, ..estimator(&fog, &room, &lights) };
    let mut film = Film::new(16, 16, &["total"]).unwrap();
    let settings = tiles::Settings { samples: 4, threads, ..tiles::Settings::default() };
    let outcome = tiles::render(&mut film, &settings, &Control::default(), |sample, rng, layers| {
        let at = (Vec2::new(sample.x as f32, sample.y as f32) + 0.5) / 16.0;
        let seen = radiance(&eye_ray(at.to_array()), &estimator, &reader, &EYE, rng);
        sample.tally.look_up(seen.lookups, seen.misses);
        layers[0] = seen.total();
    })
    .unwrap();
    assert_eq!(outcome.counters.non_finite, 0);
    (film, outcome.counters.cache_lookups, outcome.counters.cache_misses)
}

fn mean(film: &Film) -> f32 {
    let pixels = film.mean(0).unwrap().pixels;
    pixels.iter().map(|pixel| pixel.mean()).sum::<f32>() / pixels.len() as f32
}

#[test]
fn caches_filled_by_one_two_and_seven_threads_hold_the_same_bits() {
    let (one, outcome) = filled(Settings { threads: 1, ..settings() });
    assert!(one.counts().iter().all(|&(records, _)| records > 10), "{:?}", one.counts());
    let image = picture(&one, 1);
    for threads in [2, 7] {
        let (other, counted) = filled(Settings { threads, ..settings() });
        assert!(stored(&other) == stored(&one), "{threads} threads: {:?}, {:?}", other.counts(), one.counts());
        assert_eq!(counted.computed, outcome.computed);
        assert_eq!(picture(&other, threads), image);
    }
}

#[test]
fn other_seeds_fill_other_records_of_about_as_much_light() {
    let (caches, _) = filled(settled());
    let (others, _) = filled(Settings { seed: 2, ..settled() });
    let records = |caches: &RadianceCaches| caches.multiple.as_ref().unwrap().records().to_vec();
    assert_ne!(records(&caches)[0], records(&others)[0]);
    let (a, b) = (mean(&picture(&caches, 2).0), mean(&picture(&others, 2).0));
    // Records of 512 walks towards a lamp without extent are off by some per cent, and some hundred of them make the image.
    assert!((a - b).abs() < 0.05 * a && a > 0.0, "{a} and {b}");
}

#[test]
fn what_is_filled_answers_every_question_of_the_image() {
    let (caches, outcome) = filled(settings());
    assert!(!outcome.cancelled);
    let (_, lookups, misses) = picture(&caches, 2);
    assert!(lookups > 10_000 && misses == 0, "{misses} of {lookups}");
}

#[test]
fn records_reach_no_farther_than_surfaces_let_them() {
    let beyond = |caches: &RadianceCaches, share: f32| {
        let bound = |record: &Record| share * clearance(record.position, None, &room());
        // No radius is narrowed to less than what is asked for at all, or than a pixel.
        let least = |record: &Record| (PIXEL * record.position.distance(eye_ray([0.5; 2]).origin)).max(0.02);
        let is_beyond = |record: &&Record| record.radius > bound(record).max(least(record)) * 1.000_01;
        let count =
            |cache: &Option<VolumeCache<'_>>| cache.as_ref().unwrap().records().iter().filter(is_beyond).count();
        [count(&caches.surface), count(&caches.multiple), count(&caches.coarse_multiple)]
    };
    let near = |effort: Option<Effort>| effort.map(|e| Effort { clearance: 0.5, ..e });
    let few = settings();
    let (bounded, _) = filled(Settings { surface: near(few.surface), multiple: near(few.multiple), ..few });
    assert_eq!(beyond(&bounded, 0.5), [0; 3]);
    // Unbounded ones do reach farther, but for those at which walks end.
    let (unbounded, _) = filled(few);
    let [surface, multiple, coarse] = beyond(&unbounded, 1.0);
    assert!(surface > 0 && multiple > 0 && coarse == 0, "{surface}, {multiple}, {coarse}");
}

/// Share of places of fresh eye rays that no record of a cache of multiple scattering reaches.
fn uncovered(caches: &RadianceCaches) -> f64 {
    let (fog, room, lights) = (fog(), room(), [lamp()]);
    let world = World { medium: &fog, scene: &room, lights: &lights };
    let cache = caches.multiple.as_ref().unwrap();
    let reading = Reading::new(settings().multiple.unwrap().tolerance);
    let (mut asked, mut open) = (0, 0);
    for number in 0..400_u64 {
        let ray = eye_ray([(number % 20) as f32 / 20.0, (number / 20) as f32 / 20.0]);
        places(&ray, &world, &EYE, &mut Generator::new(77 + number), |place: Place| {
            if place.normal.is_none() {
                asked += 1;
                open += u32::from(!cache.covers(place.point, &reading));
            }
        });
    }
    assert!(asked > 400, "{asked}");
    f64::from(open) / f64::from(asked)
}

#[test]
fn hardly_a_place_of_other_eye_rays_is_left_uncovered() {
    let (caches, _) = filled(settings());
    // As many rays were asked as records cover several pixels each; the rest is what gaps are for.
    assert!(uncovered(&caches) < 0.02, "{}", uncovered(&caches));
}

#[test]
fn filling_what_is_full_adds_next_to_nothing() {
    let (mut caches, _) = filled(settings());
    let before = caches.counts().map(|(records, _)| records);
    fill_in(&mut caches, &fog(), &Control::default());
    let after = caches.counts().map(|(records, _)| records);
    for (before, after) in before.into_iter().zip(after) {
        // Records shrink as their neighbours are clamped: a few places are open again at the end.
        assert!(after >= before && after <= before + before / 10 + 1, "{before} records, then {after}");
    }
}

#[test]
fn a_fill_cancelled_beforehand_leaves_empty_caches_that_serve() {
    let flag = AtomicBool::new(true);
    let mut caches = RadianceCaches::new(settings());
    let outcome = fill_in(&mut caches, &fog(), &Control { cancel: Some(&flag), progress: None });
    assert!(outcome.cancelled);
    assert_eq!((outcome.computed, caches.counts().map(|(records, _)| records)), ([0; 4], [0; 4]));
    // Every question is answered by a sample of its own.
    let (film, lookups, misses) = picture(&caches, 2);
    assert!(lookups == misses && mean(&film) > 0.0, "{misses} of {lookups}");
}

/// A medium that has enough after a number of questions.
struct Impatient<'a> {
    medium: Filled<Homogeneous>,
    left: AtomicU64,
    flag: &'a AtomicBool,
}

impl Medium for Impatient<'_> {
    fn properties(&self, point: Vec3) -> Properties {
        if self.left.fetch_sub(1, Ordering::Relaxed) == 1 {
            self.flag.store(true, Ordering::Relaxed);
        }
        self.medium.properties(point)
    }
    fn majorant_segment(&self, ray: &Ray, from: f32) -> MajorantSegment {
        self.medium.majorant_segment(ray, from)
    }
    fn gradients(&self, point: Vec3) -> Gradients {
        self.medium.gradients(point)
    }
}

#[test]
fn a_fill_cancelled_on_its_way_leaves_caches_that_serve_and_can_be_filled() {
    let flag = AtomicBool::new(false);
    let impatient = |questions| Impatient { medium: fog(), left: AtomicU64::new(questions), flag: &flag };
    let (mut whole, patient) = (RadianceCaches::new(settled()), impatient(u64::MAX));
    fill_in(&mut whole, &patient, &Control::default());
    let asked = u64::MAX - patient.left.load(Ordering::Relaxed);
    let expected = mean(&picture(&whole, 2).0);
    for tenths in [1, 3, 8] {
        let questions = asked * tenths / 10;
        let medium = impatient(questions);
        flag.store(false, Ordering::Relaxed);
        let mut caches = RadianceCaches::new(settled());
        let outcome = fill_in(&mut caches, &medium, &Control { cancel: Some(&flag), progress: None });
        assert!(outcome.cancelled, "{questions}: {outcome:?}");
        let (film, _, misses) = picture(&caches, 2);
        // What is missing is sampled: noise of 4 samples in 256 pixels.
        assert!((mean(&film) / expected - 1.0).abs() < 0.2, "{questions}: {} for {expected}", mean(&film));
        // The last questions only improve records that are there.
        assert!(misses > 0 || tenths == 8, "{questions}: nothing was missing");

        // A file remembers that records are still to be estimated anew.
        let mut loaded = decode(&encode(&caches, 7), settled(), 7).unwrap();
        assert_eq!(loaded.settled, [0; 5]);
        let again = fill_in(&mut loaded, &fog(), &Control::default());
        let outcome = fill_in(&mut caches, &fog(), &Control::default());
        assert!(!outcome.cancelled);
        assert_eq!((again.computed, picture(&loaded, 2)), (outcome.computed, picture(&caches, 2)));
        let (film, _, misses) = picture(&caches, 2);
        let ratio = mean(&film) / expected;
        assert!((ratio - 1.0).abs() < 0.05 && misses == 0, "{questions}: {ratio}, {misses} misses");
    }
}

#[test]
fn nothing_asked_for_is_nothing_filled() {
    let none = Settings { single: None, surface: None, multiple: None, irradiance: None, ..settings() };
    let (caches, outcome) = filled(none);
    assert_eq!((outcome.computed, caches.counts()), ([0; 4], [(0, 0); 4]));
    assert_eq!(picture(&caches, 2).2, 0);
    let (caches, outcome) = filled(Settings { rays: 0, ..settings() });
    assert_eq!((outcome.computed, caches.counts().map(|(records, _)| records)), ([0; 4], [0; 4]));
}

#[test]
fn an_estimate_of_nothing_fills_no_radius() {
    // In the dark every sum is zero: records are there, as far as they may reach.
    assert_eq!(fogbow::cache::valid_radius(&Sums::default(), 1.0), None);
    let (room, medium) = (room(), fog());
    let mut caches = RadianceCaches::new(settings());
    fill(&mut caches, &estimator(&medium, &room, &[]), &EYE, PIXEL, &Control::default(), eye_ray).unwrap();
    for cache in [&caches.single, &caches.surface, &caches.multiple] {
        let records = cache.as_ref().unwrap().records();
        assert!(!records.is_empty() && records.iter().all(|r| r.value.is_black() && r.radius == 0.8), "{records:?}");
    }
}
