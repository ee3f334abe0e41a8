//! The same bits for any number of threads, and renders that end early.

use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use core::time::Duration;

use fogbow::glam::Vec3;
use fogbow::host::{Empty, Medium, Scene};
use fogbow::math::Ray;
use fogbow::sampling::{uniform, uniform2};
use fogbow::spectrum::Spectrum;
use fogbow_std::film::Film;
use fogbow_std::progress::{Control, Progress};
use fogbow_std::seed::{SampleRng, Sequence};
use fogbow_std::stats::{CountingMedium, CountingScene};
use fogbow_std::tiles::{Goal, Outcome, Reason, RenderError, Sample, Settings, render};

const LAYERS: [&str; 2] = ["total", "steps"];

fn film() -> Film {
    // Neither side a multiple of a tile's.
    Film::new(37, 21, &LAYERS).unwrap()
}

/// A walk of unknown length, as a path is, whose sum depends on the order of its terms.
fn walk(sample: &Sample<'_>, rng: &mut SampleRng, layers: &mut [Spectrum]) {
    let scene = CountingScene { scene: &Empty, tally: sample.tally };
    let medium = CountingMedium { medium: &Empty, tally: sample.tally };
    let ray = Ray::new(Vec3::ZERO, Vec3::X);
    let mut weight = 1.0 + sample.x as f32 / (1.0 + sample.y as f32);
    while uniform(rng) < 0.9 {
        let colour = Spectrum::new(uniform(rng), uniform(rng) / 3.0, weight);
        layers[0] += colour * weight;
        layers[1] += Spectrum::ONE;
        weight *= 0.3 + uniform(rng);
        assert!(scene.closest_hit(&ray).is_none() && !scene.is_blocked(&ray));
        assert!(
            medium.properties(ray.origin).albedo() == Spectrum::ZERO
                && medium.majorant_segment(&ray, 0.0).is_constant()
        );
    }
}

fn run(film: &mut Film, settings: Settings) -> Outcome {
    render(film, &settings, &Control::default(), walk).unwrap()
}

#[test]
fn one_two_and_seven_threads_give_the_same_bits() {
    for sequence in [Sequence::Independent, Sequence::LowDiscrepancy] {
        let settings = Settings { samples: 21, sequence, seed: 3, threads: 1, ..Settings::default() };
        let mut expected = film();
        let outcome = run(&mut expected, settings);
        assert_eq!((outcome.reason, outcome.samples, outcome.counters.samples), (Reason::Done, 21, 21 * 37 * 21));
        for threads in [2, 7] {
            for tile in [1, 8, 16, 1000] {
                let mut found = film();
                let other = run(&mut found, Settings { threads, tile, ..settings });
                // Equal sums in `f64`, not only equal means.
                assert_eq!(found, expected, "{threads} threads, tiles of {tile}");
                assert_eq!(other.counters, outcome.counters);
            }
        }
        let mut other = film();
        run(&mut other, Settings { seed: 4, ..settings });
        assert_ne!(other, expected);
    }
}

#[test]
fn a_film_rendered_in_two_goes_equals_one_rendered_in_one() {
    let settings = Settings { samples: 50, threads: 2, ..Settings::default() };
    let (mut once, mut twice) = (film(), film());
    run(&mut once, settings);
    run(&mut twice, Settings { samples: 13, ..settings });
    run(&mut twice, settings);
    assert_eq!(once, twice);
    // And there is nothing left to do.
    assert_eq!(run(&mut twice, settings).counters.samples, 0);
    assert_eq!(once, twice);
}

/// Left of column 16 all samples are 1, right of it they are 0 or 2: mean 1, standard deviation 1.
fn half_noisy(sample: &Sample<'_>, rng: &mut SampleRng, layers: &mut [Spectrum]) {
    let coin = if uniform(rng) < 0.5 { 0.0 } else { 2.0 };
    layers[0] = Spectrum::splat(if sample.x < 16 { 1.0 } else { coin });
}

#[test]
fn tiles_get_the_samples_their_noise_asks_for() {
    let goal = Goal { noise: 0.1, least: 8 };
    let settings = Settings {
        samples: 1000,
        goal: Some(goal),
        sequence: Sequence::Independent,
        threads: 1,
        ..Settings::default()
    };
    let mut expected = film();
    let outcome = render(&mut expected, &settings, &Control::default(), half_noisy).unwrap();
    assert_eq!((outcome.reason, outcome.samples), (Reason::Done, 8), "where there is no noise");
    assert_eq!(expected.count(15, 20), 8);
    // 1/sqrt(n) = 0.1 after 100 samples; passes of 32 end at 96 and 128, and single tiles err by some of these.
    let noisy =
        |film: &Film| (0..21).flat_map(|y| (16..37).map(move |x| (x, y))).map(|(x, y)| film.count(x, y)).sum::<u32>();
    let mean = noisy(&expected) as f32 / (21.0 * 21.0);
    assert!((85.0..130.0).contains(&mean), "{mean}");
    let picture = expected.mean(0).unwrap().pixels;
    let errors = picture.iter().enumerate().filter(|(i, _)| i % 37 >= 16).map(|(_, p)| (p[0] - 1.0) * (p[0] - 1.0));
    let error = (errors.sum::<f32>() / (21.0 * 21.0)).sqrt();
    assert!((0.085..0.115).contains(&error), "{error}");
    for threads in [2, 7] {
        let mut found = film();
        let other = render(&mut found, &Settings { threads, ..settings }, &Control::default(), half_noisy).unwrap();
        assert_eq!((&found, other.counters), (&expected, outcome.counters), "{threads} threads");
    }
    // The number of samples still is the most there are.
    let mut few = film();
    render(&mut few, &Settings { samples: 32, ..settings }, &Control::default(), half_noisy).unwrap();
    assert_eq!(noisy(&few), 32 * 21 * 21);
}

#[test]
fn of_an_even_sequence_no_more_samples_are_taken_than_its_noise_asks_for() {
    // A quarter of a disc in the unit square: mean π/4, and edges as pictures have.
    let disc = |_: &Sample<'_>, rng: &mut SampleRng, layers: &mut [Spectrum]| {
        layers[0] = if uniform2(rng).length_squared() < 1.0 { Spectrum::ONE } else { Spectrum::ZERO };
    };
    let goal = Goal { noise: 0.02, least: 8 };
    let of = |sequence| {
        let settings = Settings { samples: 10_000, goal: Some(goal), sequence, ..Settings::default() };
        let mut film = film();
        let outcome = render(&mut film, &settings, &Control::default(), disc).unwrap();
        let picture = film.mean(0).unwrap().pixels;
        let mean = core::f32::consts::FRAC_PI_4;
        let error = picture.iter().map(|p| (p[0] / mean - 1.0).powi(2)).sum::<f32>() / picture.len() as f32;
        (error.sqrt(), outcome.counters.samples as f32 / picture.len() as f32)
    };
    let ((even, few), (random, many)) = (of(Sequence::default()), of(Sequence::Independent));
    // Samples are doubled, which divides the noise of even ones by 1.7.
    assert!((0.5 * goal.noise..1.1 * goal.noise).contains(&even), "{even} with {few}");
    // (1 − m)/m/0.02² = 683.
    assert!((0.9 * goal.noise..1.1 * goal.noise).contains(&random), "{random} with {many}");
    assert!((600.0..800.0).contains(&many) && few < 0.25 * many, "{few} of {many}");
}

#[test]
fn queries_are_counted() {
    let mut film = film();
    let counters = run(&mut film, Settings { samples: 4, ..Settings::default() }).counters;
    let steps: f32 = film.mean(1).unwrap().pixels.iter().map(|pixel| 4.0 * pixel[0]).sum();
    for count in [counters.rays, counters.shadow_rays, counters.lookups, counters.segments] {
        assert_eq!(count, steps.round() as u64);
    }
}

#[test]
fn a_cancelled_render_leaves_a_valid_film_that_can_be_finished() {
    for threads in [1, 3] {
        let (flag, taken) = (AtomicBool::new(false), AtomicU64::new(0));
        let control = Control { cancel: Some(&flag), ..Control::default() };
        let settings = Settings { samples: 64, threads, ..Settings::default() };
        let mut found = film();
        let outcome = render(&mut found, &settings, &control, |sample, rng, layers| {
            // In the third pass, with 37 · 21 pixels.
            if taken.fetch_add(1, Ordering::Relaxed) == 2000 {
                flag.store(true, Ordering::Relaxed);
            }
            walk(sample, rng, layers);
        })
        .unwrap();
        assert_eq!((outcome.reason, outcome.samples), (Reason::Cancelled, 2));
        assert_eq!(found.total_count(), outcome.counters.samples);
        // Jobs that have begun are ended: up to eight pixels of two samples, on every thread.
        assert!(found.total_count() <= 2001 + 16 * threads as u64);
        assert!(found.mean(0).unwrap().pixels.iter().all(|p| p.0.iter().all(|c| c.is_finite())));

        let mut expected = film();
        run(&mut expected, settings);
        run(&mut found, settings);
        assert_eq!(found, expected);
    }
}

#[test]
fn a_render_cancelled_beforehand_does_nothing() {
    let flag = AtomicBool::new(true);
    let mut found = film();
    let control = Control { cancel: Some(&flag), ..Control::default() };
    let outcome = render(&mut found, &Settings::default(), &control, walk).unwrap();
    assert_eq!((outcome.reason, outcome.samples, found), (Reason::Cancelled, 0, film()));
}

#[test]
fn time_ends_a_render_after_a_whole_pass() {
    let budget = Duration::from_millis(400);
    let settings = Settings { samples: u32::MAX, time: Some(budget), threads: 2, ..Settings::default() };
    let mut film = Film::new(16, 16, &LAYERS[..1]).unwrap();
    // 256 samples of 50 µs: about 6 to 13 ms per sample of each pixel.
    let outcome = render(&mut film, &settings, &Control::default(), |_, rng, layers| {
        let start = std::time::Instant::now();
        while start.elapsed() < Duration::from_micros(50) {}
        layers[0] = Spectrum::splat(uniform(rng));
    })
    .unwrap();
    assert_eq!(outcome.reason, Reason::TimeUp);
    assert!(outcome.samples >= 2, "{outcome:?}");
    assert_eq!(film.total_count(), u64::from(outcome.samples) * 256);
    // Generous, because the processors of a test are not its own.
    assert!((0.1..1.2).contains(&outcome.seconds.wall), "{outcome:?}");
}

#[test]
fn the_first_samples_are_taken_however_short_the_time() {
    let settings = Settings { time: Some(Duration::ZERO), ..Settings::default() };
    let mut film = film();
    let outcome = run(&mut film, settings);
    assert_eq!((outcome.reason, outcome.samples), (Reason::TimeUp, 1));
}

#[test]
fn progress_goes_forward_and_ends_at_one() {
    let seen = std::cell::RefCell::new(Vec::<Progress>::new());
    let report = |progress: &Progress| seen.borrow_mut().push(*progress);
    let control = Control { progress: Some(&report), ..Control::default() };
    let settings = Settings { samples: 20, threads: 2, ..Settings::default() };
    render(&mut film(), &settings, &control, |_, _, _| std::thread::sleep(Duration::from_micros(20))).unwrap();
    let seen = seen.into_inner();
    assert!(seen.len() >= 2, "{seen:?}");
    assert!(seen.is_sorted_by(|a, b| a.done <= b.done && a.elapsed <= b.elapsed));
    let last = seen.last().unwrap();
    assert_eq!((last.fraction(), last.done, last.remaining()), (1.0, last.total, Some(Duration::ZERO)));
    // Not for every tile: 15 tiles, 4 passes and more.
    assert!(seen.len() as f64 <= 2.0 + last.elapsed.as_secs_f64() / 0.05);
}

#[test]
fn values_that_are_no_numbers_are_black_and_counted() {
    let mut film = Film::new(2, 1, &LAYERS).unwrap();
    let settings = Settings { samples: 4, ..Settings::default() };
    let outcome = render(&mut film, &settings, &Control::default(), |sample, _, layers| {
        layers[0] = Spectrum::ONE;
        layers[1] = Spectrum::splat(if sample.index == 1 { f32::NAN } else { 2.0 });
    })
    .unwrap();
    assert_eq!(outcome.counters.non_finite, 2);
    assert_eq!(film.mean(0).unwrap().pixels, [Spectrum::splat(0.75); 2]);
    assert_eq!(film.mean(1).unwrap().pixels, [Spectrum::splat(1.5); 2]);
}

#[test]
fn impossible_settings_are_errors() {
    let refused = |settings| render(&mut film(), &settings, &Control::default(), walk).unwrap_err();
    assert_eq!(refused(Settings { samples: 0, ..Settings::default() }), RenderError::NoSamples);
    assert_eq!(refused(Settings { tile: 0, ..Settings::default() }), RenderError::NoTile);
}
