//! Adaptive sampling of images: means stay what they are, borders stay sharp, noise is evened out.

use fogbow::covariance::image_sampling::{Computed, FillingIn, LEAST_PLAN, Outlook, Plan, PlanOutput, Planning};
use fogbow::math::Symmetric2;
use fogbow::sampling::{Generator, uniform};
use fogbow::spectrum::Spectrum;
use fogbow::storage::List;
use fogbow::work;
use fogbow_std::progress::Control;
use fogbow_std::threads::{self, Threads};

fn planned(size: u32, share: f32, outlooks: &[Outlook]) -> Plan<'static> {
    let mut planning = Planning::new([size, size], share).unwrap();
    work::finish(&mut planning, outlooks, &mut PlanOutput::default());
    assert!(!planning.is_cut());
    planning.finish()
}

fn filled(plan: &Plan<'_>, pixels: &[Spectrum]) -> Vec<Spectrum> {
    let mut work = FillingIn::new(plan, List::default()).unwrap();
    work::finish(&mut work, &Computed { plan, pixels }, &mut List::default());
    work.pixels().to_vec()
}

#[test]
fn one_two_and_seven_threads_plan_the_same_pixels() {
    let outlook = |i: u32| {
        let (x, y) = ((i % 37) as f32, (i / 37) as f32);
        let covariance = (!i.is_multiple_of(11)).then(|| Symmetric2::diagonal(1e-3 * x / (1.0 + y), 1e-5 * y));
        Outlook { covariance, depth: if x + y < 30.0 { 1.0 + 0.01 * x } else { f32::INFINITY } }
    };
    let outlooks: Vec<Outlook> = (0..37 * 23).map(outlook).collect();
    let plans: Vec<Vec<(bool, u32)>> = [1, 2, 7]
        .map(|count| {
            let mut planning = Planning::new([37, 23], 0.3).unwrap();
            let pool = Threads::new(count).unwrap();
            threads::run(&mut planning, &outlooks[..], &pool, &Control::default(), None, |_| {});
            let plan = planning.finish();
            (0..37 * 23).map(|i| (plan.is_computed(i), plan.density(i).to_bits())).collect()
        })
        .into();
    assert!(plans[0].iter().filter(|(is_computed, _)| *is_computed).count() > 200);
    assert!(plans[1] == plans[0] && plans[2] == plans[0]);
}

fn plan(share: f32, outlook: impl Fn(u32, u32) -> Outlook) -> Plan<'static> {
    planned(40, share, &(0..1600).map(|i| outlook(i % 40, i / 40)).collect::<Vec<_>>())
}

#[test]
fn even_light_is_filled_in_exactly_and_unread_pixels_do_not_count() {
    for share in [0.0, 0.05, 0.4, 1.0] {
        let even = Symmetric2::diagonal(1e-4, 1e-4);
        let plan = plan(share, |_, _| Outlook { covariance: Some(even), depth: f32::INFINITY });
        assert!(plan.share() <= share.max(LEAST_PLAN) && plan.share() > 0.5 * share, "{}", plan.share());
        let mut image = vec![Spectrum::splat(3.0); 1600];
        for (i, pixel) in image.iter_mut().enumerate() {
            if !plan.is_computed(i) {
                *pixel = Spectrum::splat(f32::NAN);
            }
        }
        assert!(filled(&plan, &image).iter().all(|p| (p[0] - 3.0).abs() < 1e-5), "share {share}");
    }
}

#[test]
fn light_does_not_leak_over_a_border_of_depth() {
    let near = |x: u32| if x < 20 { 1.0 } else { 2.0 };
    let plan = plan(0.3, |x, _| Outlook { covariance: Some(Symmetric2::ZERO), depth: near(x) });
    let mut image = vec![Spectrum::ZERO; 1600];
    for (i, pixel) in image.iter_mut().enumerate() {
        *pixel = Spectrum::splat(near(i as u32 % 40));
    }
    let filled = filled(&plan, &image);
    assert!(filled.iter().zip(&image).all(|(a, b)| (a[0] - b[0]).abs() < 1e-5));
}

/// A shaft of light, three pixels of standard deviation across, in a dim fog; and its covariance, by the Hessian.
fn shaft(x: f32, y: f32) -> (f32, Symmetric2) {
    let across = (x - 32.0 - 0.3 * (y - 32.0)) / 1.3_f32.hypot(0.3);
    let bell = (-0.5 * (across / 3.0).powi(2)).exp();
    let light = 0.02 + bell;
    let curvature = bell * ((across / 3.0).powi(2) - 1.0).abs() / 9.0 / light;
    let (u, v) = (0.958, -0.287);
    let p = curvature / (4.0 * core::f32::consts::PI.powi(2));
    (light, Symmetric2::new(p * u * u, p * u * v, p * v * v))
}

#[test]
fn filling_in_makes_a_picture_neither_brighter_nor_darker() {
    let at = |i: u32| shaft((i % 64) as f32, (i / 64) as f32);
    let outlook = |i| Outlook { covariance: Some(at(i).1), depth: 1.0 };
    let plan = planned(64, 0.4, &(0..4096).map(outlook).collect::<Vec<_>>());
    let converged: f32 = (0..4096).map(|i| at(i).0).sum();
    let biases: Vec<f32> = (0..12_u64)
        .map(|seed| {
            let mut rng = Generator::new(seed);
            let mut image = vec![Spectrum::ZERO; 4096];
            for (i, pixel) in image.iter_mut().enumerate() {
                *pixel = Spectrum::splat(at(i as u32).0 * (0.5 + uniform(&mut rng)));
            }
            filled(&plan, &image).iter().map(|p| p[0]).sum::<f32>() / converged - 1.0
        })
        .collect();
    let mean = biases.iter().sum::<f32>() / 12.0;
    let error = (biases.iter().map(|b| (b - mean).powi(2)).sum::<f32>() / (11.0 * 12.0)).sqrt();
    assert!(error < 0.01, "too noisy to tell: {error}");
    // What a filter four times as sharp as the light takes from the crest it gives to the feet.
    assert!(mean.abs() < 3.5 * error + 0.005, "bias {mean} ± {error}");
}

#[test]
fn walls_at_a_grazing_angle_even_out_noise_like_those_seen_from_the_front() {
    let spread = |depth: fn(f32) -> f32| {
        let even = Symmetric2::diagonal(1e-4, 1e-4);
        let plan = plan(0.4, |x, _| Outlook { covariance: Some(even), depth: depth(x as f32) });
        // Few filters fit into a picture, hence many.
        let of_seed = |seed: u64| {
            let mut rng = Generator::new(seed);
            let mut image = vec![Spectrum::ZERO; 1600];
            image.iter_mut().for_each(|p| *p = Spectrum::splat(uniform(&mut rng)));
            let filled = filled(&plan, &image);
            filled.iter().map(|p| (p[0] - 0.5).powi(2)).sum::<f32>()
        };
        (0..64).map(of_seed).sum::<f32>()
    };
    let front = spread(|_| 5.0);
    // A wall whose depth falls by up to 4 % from pixel to pixel, alone and beside one seen from the front.
    for wall in [|x: f32| 100.0 / (20.0 + x), |x: f32| 5.0_f32.min(100.0 / x)] {
        let grazing = spread(wall);
        assert!(grazing < 1.1 * front, "{grazing} instead of {front}");
    }
}

#[test]
fn a_wire_before_a_wall_stays_as_it_is() {
    let depth = |x: u32| if x == 20 { 1.0 } else { 2.0 };
    let plan = plan(0.6, |x, _| Outlook { covariance: Some(Symmetric2::ZERO), depth: depth(x) });
    let mut image = vec![Spectrum::ZERO; 1600];
    for (i, pixel) in image.iter_mut().enumerate() {
        *pixel = Spectrum::splat(depth(i as u32 % 40));
    }
    let filled = filled(&plan, &image);
    assert!(filled.iter().zip(&image).all(|(a, b)| (a[0] - b[0]).abs() < 1e-5));
}

#[test]
fn what_is_no_number_beforehand_gives_numbers() {
    let bad = Symmetric2::new(f32::NAN, f32::INFINITY, -1.0);
    let plan = plan(0.4, |x, _| Outlook { covariance: (x > 10).then_some(bad), depth: f32::NAN });
    let image = vec![Spectrum::ONE; 1600];
    assert!(filled(&plan, &image).iter().all(|p| p.is_valid()));
}
