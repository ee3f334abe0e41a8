//! Filling radiance caches: the same bits for any number of threads, and fills that end early.

use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use fogbow::cache::{
    Asked, Effort, Estimate, FilledRecords, Filling, FillingMemory, Glance, Guide, Kind, Limits, PhotonCell,
    PhotonDeposit, PhotonEffort, Place, RadianceCaches, RaySettings, Reading, Record, Room as Lengths, Settings, Slots,
    Wanted, clearance, places, room_for,
};
use fogbow::host::{Gradients, MajorantSegment, Medium, Properties};
use fogbow::light::{Light, PointLight};
use fogbow::math::{Bounds, Ray, Vec2, Vec3};
use fogbow::medium::Homogeneous;
use fogbow::phase::Lobe;
use fogbow::sampling::{Generator, uniform};
use fogbow::sh::Coefficient;
use fogbow::spectrum::Spectrum;
use fogbow::storage::Chunk;
use fogbow::surface::Surface;
use fogbow::transmittance::thickness::Steps;
use fogbow::work::{Rounds, finish, step};
use fogbow::world::World;
use fogbow::{multiple_scatter, single_scatter::Sums};
use fogbow_std::film::Film;
use fogbow_std::progress::Control;
use fogbow_std::threads::{Ending, Threads, run};
use fogbow_std::tiles;
use fogbow_tests::hosts::{Ball, Body, Filled};

const EYE: RaySettings =
    RaySettings { density: 6.0, connections: 4, lamp_parts: 1, lights_visible: true, indirect: true };
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
    let effort = |tolerance: f32, degree: usize| {
        Some(Effort { tolerance, samples: 32, degree, limits, clearance, free_paths: f32::INFINITY })
    };
    let bounds = Bounds { min: Vec3::splat(-2.0), max: Vec3::splat(2.0) };
    Settings {
        photons: Some(PhotonEffort { bounds, cells: 8, degree: 2, paths: 2048, flights: u64::MAX, enough: u32::MAX }),
        single: effort(0.5, 3),
        surface: effort(1.5, 2),
        multiple: effort(1.0, 2),
        irradiance: effort(0.5, 0),
        rays: 600,
        pixels: [1.0, 1000.0],
        round: 16,
        eye: EYE,
        walk: multiple_scatter::Settings::new(Steps::Length(0.3)),
        light_samples: 1,
        finest: 0.02,
        seed: 1,
        ..Settings::default()
    }
}

/// [`settings`] with so many walks that a picture's mean is off by a few per cent at most.
fn settled() -> Settings {
    let more = |effort: Option<Effort>| effort.map(|e| Effort { samples: 512, ..e });
    let few = settings();
    Settings { surface: more(few.surface), multiple: more(few.multiple), irradiance: more(few.irradiance), ..few }
}

type Caches = RadianceCaches<'static>;
type Eye = fn([f32; 2]) -> Ray;

const VIEW: Asked<Eye> = Asked::View { ray: eye_ray, pixel: PIXEL };

/// Fills `caches` as far as `control` lets it, on so many threads.
fn fill_on<M: Medium + Sync>(
    caches: Caches,
    medium: &M,
    threads: usize,
    control: &Control<'_>,
) -> (Filling<'static, Eye>, Ending) {
    let (room, lights) = (room(), [lamp()]);
    let world = World { medium, scene: &room, lights: (&lights).into() };
    let mut filling = caches.fill(VIEW);
    let ran = run(&mut filling, &world, &Threads::new(threads).unwrap(), control, None, |_| {});
    (filling, ran.ending)
}

fn fill_in<M: Medium + Sync>(caches: Caches, medium: &M) -> (Caches, [u64; 5]) {
    let (filling, ending) = fill_on(caches, medium, 2, &Control::default());
    assert_eq!(ending, Ending::Done);
    let computed = computed(&filling);
    (filling.finish(), computed)
}

fn computed(filling: &Filling<'static, Eye>) -> [u64; 5] {
    Kind::ALL.map(|kind| filling.computed(kind))
}

fn filled(settings: Settings) -> Caches {
    fill_in(RadianceCaches::new(settings), &fog()).0
}

fn counts(caches: &Caches) -> [usize; 4] {
    Kind::FINAL.map(|kind| caches.records(kind).len())
}

/// All that is stored, to the last bit.
fn stored(caches: &Caches) -> Vec<u8> {
    caches.to_bytes(0)
}

/// An image with the caches, and how many of its look-ups were misses.
fn picture(caches: &Caches, threads: usize) -> (Film, u64, u64) {
    let (fog, room, lights) = (fog(), room(), [lamp()]);
    let world = World { medium: &fog, scene: &room, lights: (&lights).into() };
    let mut film = Film::new(16, 16, &["total"]).unwrap();
    let settings = tiles::Settings { samples: 4, threads, ..tiles::Settings::default() };
    let outcome = tiles::render(&mut film, &settings, &Control::default(), |sample, rng, layers| {
        let at = (Vec2::new(sample.x as f32, sample.y as f32) + 0.5) / 16.0;
        let seen = caches.radiance(&eye_ray(at.to_array()), &world, rng);
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
    let on = |threads| {
        let (filling, _) = fill_on(RadianceCaches::new(settings()), &fog(), threads, &Control::default());
        let computed = computed(&filling);
        (filling.finish(), computed)
    };
    let (one, expected) = on(1);
    assert!(counts(&one).iter().all(|&records| records > 10), "{:?}", counts(&one));
    let image = picture(&one, 1);
    for threads in [2, 7] {
        let (other, computed) = on(threads);
        assert!(stored(&other) == stored(&one), "{threads} threads: {:?}, {:?}", counts(&other), counts(&one));
        assert_eq!(computed, expected);
        assert_eq!(picture(&other, threads), image);
    }
}

#[test]
fn a_fill_a_few_jobs_at_a_time_in_any_order_has_the_same_bits() {
    let (fog, room, lights) = (fog(), room(), [lamp()]);
    let world = World { medium: &fog, scene: &room, lights: (&lights).into() };
    let mut filling = RadianceCaches::new(settings()).fill(VIEW);
    let mut slots: Vec<FilledRecords<'static>> = (0..5).map(|_| FilledRecords::default()).collect();
    let mut frame = 0_u32;
    while !jobs(&filling).is_empty() {
        // So many jobs a frame, the last first; of every third frame only the first result is taken, the rest is lost.
        let jobs = jobs(&filling);
        let batch: Vec<u32> = jobs.clone().take(1 + frame as usize % slots.len()).collect();
        for (job, slot) in batch.iter().zip(&mut slots).rev() {
            filling.run(*job, &world, slot);
        }
        let taken = if frame % 3 == 2 { 1 } else { batch.len() };
        slots[..taken].iter().for_each(|slot| take(&mut filling, slot));
        frame += 1;
    }
    assert!(frame > 100);
    let once = stored(&filling.finish());
    assert!(once == stored(&filled(settings())));
}

type Room<'a> = World<'a, Filled<Homogeneous>, Ball>;

fn jobs(filling: &Filling<'static, Eye>) -> core::ops::Range<u32> {
    Rounds::<Room<'_>>::jobs(filling)
}

fn take(filling: &mut Filling<'static, Eye>, output: &FilledRecords<'static>) {
    Rounds::<Room<'_>>::accept(filling, output);
}

/// With less than half the error.
fn finer(settings: Settings) -> Settings {
    let finer = |effort: Effort| Effort { samples: 8 * effort.samples, tolerance: 0.8 * effort.tolerance, ..effort };
    let [surface, multiple, irradiance] =
        [settings.surface, settings.multiple, settings.irradiance].map(|effort| effort.map(finer));
    let photons = settings.photons.map(|photons| PhotonEffort { paths: 4 * photons.paths, ..photons });
    Settings { surface, multiple, irradiance, photons, ..settings }
}

/// Caches of two levels.
fn refined(settings: Settings, threads: usize) -> (Caches, [u64; 5]) {
    let (fog, room, lights) = (fog(), room(), [lamp()]);
    let world = World { medium: &fog, scene: &room, lights: (&lights).into() };
    let (mut filling, _) = fill_on(RadianceCaches::new(settings), &fog, threads, &Control::default());
    let coarse = counts(filling.caches());
    filling.refine(finer(settings));
    assert!(
        filling.caches().is_open() && counts(filling.caches())[1..] == coarse[1..],
        "they stay until they are better"
    );
    run(&mut filling, &world, &Threads::new(threads).unwrap(), &Control::default(), None, |_| {});
    let computed = computed(&filling);
    (filling.finish(), computed)
}

#[test]
fn levels_that_are_given_beforehand_hold_the_same_bits_for_any_number_of_threads() {
    let (one, expected) = refined(settings(), 1);
    let (two, computed) = refined(settings(), 2);
    assert!(stored(&one) == stored(&two) && computed == expected && !one.is_open());
    assert_eq!(one.settings().multiple.unwrap().samples, 8 * 32);
    // What is full at this level is full.
    assert_eq!(fill_in(one, &fog()).1, [0; 5]);
}

/// Relative root mean square of what two pictures differ by.
fn apart(a: &Film, b: &Film) -> f64 {
    let [a, b] = [a, b].map(|film| film.mean(0).unwrap().pixels);
    let square = |(a, b): (&Spectrum, &Spectrum)| f64::from((a.mean() - b.mean()) / b.mean()).powi(2);
    (a.iter().zip(&b).map(square).sum::<f64>() / a.len() as f64).sqrt()
}

#[test]
fn a_finer_level_is_as_good_as_caches_made_for_it_and_costs_less() {
    let seeds = [1, 2].map(|seed| Settings { seed, ..settings() });
    let coarse = seeds.map(|settings| picture(&filled(settings), 2).0);
    let ((fine, computed), (anew, computed_anew)) =
        (refined(seeds[0], 2), fill_in(RadianceCaches::new(finer(seeds[1])), &fog()));
    let (few, many) = (computed.iter().sum::<u64>(), computed_anew.iter().sum::<u64>());
    assert!(few < many - many / 8, "{computed:?} {computed_anew:?}");
    let between = [apart(&coarse[0], &coarse[1]), apart(&picture(&fine, 2).0, &picture(&anew, 2).0)];
    // Eight times the samples: between them there is some 2.8 times less noise.
    assert!(between[1] < 0.5 * between[0], "{between:?}");
}

#[test]
fn a_box_of_points_has_records_everywhere_in_it() {
    let (fog, room, lights) = (fog(), room(), [lamp()]);
    let world = World { medium: &fog, scene: &room, lights: (&lights).into() };
    let bounds = Bounds { min: Vec3::splat(-0.8), max: Vec3::splat(0.8) };
    let mut filling = RadianceCaches::new(settings()).fill(Asked::<Eye>::Box(bounds));
    finish(&mut filling, &world, &mut FilledRecords::default());
    let caches = filling.finish();
    let read = caches.volume(Kind::Multiple).unwrap();
    let mut rng = Generator::new(3);
    let open = (0..1000).filter(|_| {
        let at = Vec3::new(uniform(&mut rng), uniform(&mut rng), uniform(&mut rng));
        !read.cache.covers(bounds.min + bounds.size() * at, &read.reading)
    });
    assert!(open.count() < 20);
}

#[test]
#[ignore = "long: tests/acceptance/long.sh"]
fn other_seeds_fill_other_records_of_about_as_much_light() {
    let caches = filled(settled());
    let others = filled(Settings { seed: 2, ..settled() });
    assert_ne!(caches.records(Kind::Multiple)[0], others.records(Kind::Multiple)[0]);
    let all = (3..=12).map(|seed| filled(Settings { seed, ..settled() }));
    let lights: Vec<f32> = [caches, others].into_iter().chain(all).map(|caches| mean(&picture(&caches, 2).0)).collect();
    let count = lights.len() as f32;
    let usual = lights.iter().sum::<f32>() / count;
    let variance = lights.iter().map(|light| (light - usual) * (light - usual)).sum::<f32>() / (count - 1.0);
    // Records of 512 walks towards a lamp without extent are off by some per cent, and some hundred of them make the image. Of two seeds alone chance decides.
    assert!(variance.sqrt() < 0.02 * usual && usual > 0.0, "{lights:?}");
}

#[test]
fn what_is_filled_answers_every_question_of_the_image() {
    let (_, lookups, misses) = picture(&filled(settings()), 2);
    assert!(lookups > 10_000 && misses == 0, "{misses} of {lookups}");
}

#[test]
fn records_reach_no_farther_than_surfaces_let_them() {
    let beyond = |caches: &Caches, share: f32| {
        let bound = |record: &Record| share * clearance(record.position, None, &room());
        // No radius is narrowed to less than what is asked for at all, or than a pixel.
        let least = |record: &Record| (PIXEL * record.position.distance(eye_ray([0.5; 2]).origin)).max(0.02);
        let is_beyond = |record: &&Record| record.radius > bound(record).max(least(record)) * 1.000_01;
        [Kind::Surface, Kind::Multiple].map(|kind| caches.records(kind).iter().filter(is_beyond).count())
    };
    let near = |effort: Option<Effort>| effort.map(|e| Effort { clearance: 0.5, ..e });
    let few = settings();
    let bounded = filled(Settings { surface: near(few.surface), multiple: near(few.multiple), ..few });
    assert_eq!(beyond(&bounded, 0.5), [0; 2]);
    // Unbounded ones do reach farther.
    let [surface, multiple] = beyond(&filled(few), 1.0);
    assert!(surface > 0 && multiple > 0, "{surface}, {multiple}");
}

/// Share of places of fresh eye rays that no record of a cache of multiple scattering reaches.
fn uncovered(caches: &Caches) -> f64 {
    let (fog, room, lights) = (fog(), room(), [lamp()]);
    let world = World { medium: &fog, scene: &room, lights: (&lights).into() };
    let cache = caches.volume(Kind::Multiple).unwrap().cache;
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
    let open = uncovered(&filled(settings()));
    // As many rays were asked as records cover several pixels each; the rest is what gaps are for.
    assert!(open < 0.02, "{open}");
}

#[test]
fn filling_what_is_full_computes_nothing() {
    let caches = filled(settings());
    let before = stored(&caches);
    let (again, computed) = fill_in(caches, &fog());
    assert_eq!((computed, stored(&again) == before), ([0; 5], true));
}

#[test]
fn filling_for_another_view_adds_what_is_missing_there() {
    let caches = filled(settings());
    let before = counts(&caches);
    let other: Eye = |film| Ray { origin: Vec3::new(0.05, 0.0, -1.5), ..eye_ray(film) };
    let (room, fog, lights) = (room(), fog(), [lamp()]);
    let world = World { medium: &fog, scene: &room, lights: (&lights).into() };
    let mut filling = caches.fill(Asked::View { ray: other, pixel: PIXEL });
    finish(&mut filling, &world, &mut FilledRecords::default());
    for (before, after) in before.into_iter().zip(counts(&filling.finish())) {
        assert!(after >= before && after <= before + before / 4 + 1, "{before} records, then {after}");
    }
}

fn stage_in<W: ?Sized, R: Rounds<W>>(_: &W, work: &R) -> &'static str {
    work.stage()
}

#[test]
fn photons_are_shot_once_for_all_views() {
    let (room, fog, lights) = (room(), fog(), [lamp()]);
    let world = World { medium: &fog, scene: &room, lights: (&lights).into() };
    let other: Eye = |film| Ray { origin: Vec3::new(0.05, 0.0, -1.5), ..eye_ray(film) };
    // The caches after one more view, and how many jobs had to do with photons.
    let seen = |caches: Caches, ray: Eye| {
        let (mut filling, mut shots) = (caches.fill(Asked::View { ray, pixel: PIXEL }), 0);
        let mut output = FilledRecords::default();
        loop {
            let is_shot = stage_in(&world, &filling) == "fill photons";
            if !step(&mut filling, &world, &mut output) {
                return (filling.finish(), shots);
            }
            shots += u32::from(is_shot);
        }
    };
    let (first, shots) = seen(RadianceCaches::new(settings()), eye_ray);
    assert!(shots > 0 && first.photon_bytes() > 0);
    let (kept, none) = seen(first, other);
    assert_eq!(none, 0);
    let (mut again, _) = seen(RadianceCaches::new(settings()), eye_ray);
    again.forget_photons();
    let (again, as_many) = seen(again, other);
    assert_eq!((as_many, stored(&again) == stored(&kept)), (shots, true));
}

#[test]
fn a_fill_cancelled_beforehand_leaves_empty_caches_that_serve() {
    let flag = AtomicBool::new(true);
    let control = Control { cancel: Some(&flag), ..Control::default() };
    let (filling, ending) = fill_on(RadianceCaches::new(settings()), &fog(), 2, &control);
    assert_eq!((ending, computed(&filling)), (Ending::Cancelled, [0; 5]));
    let caches = filling.finish();
    assert_eq!(counts(&caches), [0; 4]);
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
fn a_fill_cancelled_on_its_way_leaves_caches_that_serve_and_goes_on_to_the_same_bits() {
    let flag = AtomicBool::new(false);
    let impatient = |questions| Impatient { medium: fog(), left: AtomicU64::new(questions), flag: &flag };
    let patient = impatient(u64::MAX);
    let (whole, _) = fill_in(RadianceCaches::new(settled()), &patient);
    let asked = u64::MAX - patient.left.load(Ordering::Relaxed);
    let expected = mean(&picture(&whole, 2).0);
    for tenths in [1, 3, 8] {
        let questions = asked * tenths / 10;
        flag.store(false, Ordering::Relaxed);
        let control = Control { cancel: Some(&flag), ..Control::default() };
        let (mut filling, ending) = fill_on(RadianceCaches::new(settled()), &impatient(questions), 2, &control);
        assert_eq!(ending, Ending::Cancelled, "{questions}");

        // What was made by then is in the bytes, which remember that it is still to be estimated anew.
        let mut loaded = RadianceCaches::new(settled());
        loaded.read(&filling.caches().to_bytes(7), 7).unwrap();
        assert_eq!(loaded.is_open(), Kind::ALL.iter().any(|kind| !loaded.records(*kind).is_empty()));
        let (film, _, misses) = picture(&loaded, 2);
        // What is missing is sampled: noise of 4 samples in 256 pixels.
        assert!((mean(&film) / expected - 1.0).abs() < 0.2, "{questions}: {} for {expected}", mean(&film));
        // The last questions only improve records that are there.
        assert!(misses > 0 || tenths == 8, "{questions}: nothing was missing");
        let (again, _) = fill_in(loaded, &fog());
        let (film, _, misses) = picture(&again, 2);
        let ratio = mean(&film) / expected;
        assert!((ratio - 1.0).abs() < 0.05 && misses == 0 && !again.is_open(), "{questions}: {ratio}, {misses} misses");

        // The fill itself goes on where it was.
        let (fog, room, lights) = (fog(), room(), [lamp()]);
        let world = World { medium: &fog, scene: &room, lights: (&lights).into() };
        finish(&mut filling, &world, &mut FilledRecords::default());
        assert!(stored(&filling.finish()) == stored(&whole), "{questions}");
    }
}

#[test]
fn nothing_asked_for_is_nothing_filled() {
    let none = Settings { single: None, surface: None, multiple: None, irradiance: None, ..settings() };
    let (caches, computed) = fill_in(RadianceCaches::new(none), &fog());
    assert_eq!((computed, counts(&caches), Kind::ALL.map(|kind| caches.bytes(kind))), ([0; 5], [0; 4], [0; 5]));
    assert_eq!(picture(&caches, 2).2, 0);
    let (caches, computed) = fill_in(RadianceCaches::new(Settings { rays: 0, ..settings() }), &fog());
    assert_eq!((computed, counts(&caches)), ([0; 5], [0; 4]));
}

#[test]
fn an_estimate_of_nothing_fills_no_radius() {
    // In the dark every sum is zero: records are there, as far as they may reach.
    assert_eq!(fogbow::cache::valid_radius(&Sums::default(), 1.0), None);
    let (room, medium) = (room(), fog());
    let world = World { medium: &medium, scene: &room, lights: (&[]).into() };
    let mut filling = RadianceCaches::new(settings()).fill(VIEW);
    finish(&mut filling, &world, &mut FilledRecords::default());
    let caches = filling.finish();
    for kind in [Kind::Single, Kind::Surface, Kind::Multiple] {
        let records = caches.records(kind);
        assert!(!records.is_empty() && records.iter().all(|r| r.value.is_black() && r.radius == 0.8), "{records:?}");
    }
}

/// A fill in memory of just these lengths: the bytes of the caches, whether it was cut, and how many records there are.
fn filled_in(room: &Lengths) -> (Vec<u8>, bool, [usize; 5]) {
    let (fog, walls, lights) = (fog(), self::room(), [lamp()]);
    let world = World { medium: &fog, scene: &walls, lights: (&lights).into() };
    let (mut memory, mut views) = (vec![Chunk::default(); room.chunks], [0; 1]);
    let caches = RadianceCaches::lent(settings(), &mut views[..], &mut memory);

    let mut wanted = vec![Wanted::default(); room.wanted];
    let [mut open, mut still_open] = [vec![0; room.open], vec![0; room.open]];
    let mut chosen = vec![(0, 0.0); room.chosen];
    let mut estimates = vec![Estimate::default(); room.estimates];
    let mut of_estimates = vec![Coefficient::ZERO; room.higher];
    let mut guides = room.guides.map(|count| vec![Guide::default(); count]);
    let (mut photons, mut deposits) =
        (vec![PhotonCell::default(); room.photons], vec![PhotonDeposit::default(); room.of_job_deposits]);
    let mut photon_moments = vec![Spectrum::ZERO; room.photon_moments];
    let mut glances = vec![Glance::default(); room.glances];
    let memory = FillingMemory::lent(Slots {
        wanted: &mut wanted,
        open: [&mut open, &mut still_open],
        chosen: &mut chosen,
        estimates: &mut estimates,
        higher: &mut of_estimates,
        guides: guides.each_mut().map(|guides| &mut guides[..]),
        photons: &mut photons,
        photon_moments: &mut photon_moments,
        glances: &mut glances,
    });
    let mut of_job = vec![Wanted::default(); room.of_job_wanted];
    let mut open_of_job = vec![0; room.of_job_open];
    let mut higher_of_job = vec![Coefficient::ZERO; room.of_job_higher];
    let mut filling = caches.fill_in(memory, VIEW);
    finish(
        &mut filling,
        &world,
        &mut FilledRecords::lent(&mut of_job, &mut open_of_job, &mut higher_of_job, &mut deposits),
    );
    let is_cut = filling.is_cut();
    let caches = filling.finish();
    // Whatever there is can be read.
    let seen = caches.radiance(&eye_ray([0.4, 0.6]), &world, &mut Generator::new(1));
    assert!(seen.total().is_valid() && seen.total().mean() > 0.0, "{seen:?}");
    (caches.to_bytes(0), is_cut, Kind::ALL.map(|kind| caches.records(kind).len()))
}

#[test]
fn a_fill_in_lent_memory_has_the_bits_of_one_that_grows_or_says_that_it_was_cut() {
    let grown = filled(settings());
    let counts = Kind::ALL.map(|kind| grown.records(kind).len());
    let most = counts.into_iter().max().unwrap();
    let ample = room_for(&settings(), 20_000, most);
    let (bytes, is_cut, _) = filled_in(&ample);
    assert!(!is_cut && bytes == stored(&grown));

    // Too little of one thing after the other.
    let seven = room_for(&settings(), 20_000, 7).chunks;
    for chunks in [seven, seven + 1, seven + 17] {
        let (_, is_cut, fewer) = filled_in(&Lengths { chunks, ..ample });
        assert!(
            is_cut && fewer.into_iter().zip(counts).all(|(fewer, count)| fewer == count.min(7)),
            "{chunks}: {fewer:?}"
        );
    }
    for room in [
        Lengths { wanted: 100, ..ample },
        Lengths { open: 50, ..ample },
        Lengths { estimates: 5, ..ample },
        Lengths { higher: 40, ..ample },
        Lengths { guides: [3; 5], ..ample },
        Lengths { of_job_wanted: 10, ..ample },
        Lengths { of_job_open: 10, ..ample },
        Lengths { of_job_deposits: 10, ..ample },
        Lengths { photons: 7, ..ample },
        Lengths { photon_moments: 7, ..ample },
    ] {
        let (_, is_cut, counts) = filled_in(&room);
        assert!(is_cut && counts.iter().any(|&count| count > 0), "{room:?}: {counts:?}");
    }
    // Expansions have no room at all; without any memory nothing is made.
    let (_, is_cut, counts) = filled_in(&Lengths { of_job_higher: 2, ..ample });
    assert!(is_cut && counts[Kind::Multiple as usize] == 0 && counts[Kind::CoarseIrradiance as usize] > 0);
    let (_, is_cut, counts) = filled_in(&Lengths::default());
    assert!(is_cut && counts == [0; 5]);
}
