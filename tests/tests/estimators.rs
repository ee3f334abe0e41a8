//! Single and multiple scattering and the march against known answers and each other.

use fogbow::host::{Empty, Medium};
use fogbow::light::{Light, PointLight, Sun};
use fogbow::march::eye_ray;
use fogbow::math::{Ray, Vec3};
use fogbow::multiple_scatter::{self, Lengths, Settings, Start, Walk};
use fogbow::phase::{Lobe, Phase};
use fogbow::sampling::Generator;
use fogbow::sh::{Coefficient, expansion};
use fogbow::single_scatter::{self, Directional, Sums, Towards, moments};
use fogbow::spectrum::Spectrum;
use fogbow::surface::Surface;
use fogbow::transmittance::thickness::Steps;
use fogbow::world::World;
use fogbow_tests::analytic::{INFINITE_MEDIUM_MULTIPLE, mean_and_error};
use fogbow_tests::hosts::{Analytic, Ball, Body, Complaining, Field, Filled};
use fogbow_tests::tolerance::STANDARD_ERRORS;

const STEPS: Steps = Steps::Length(0.1);
const NO_SURFACE: fn(&Ray, &fogbow::host::Hit) -> Spectrum = |_, _| Spectrum::ZERO;

fn samples(samples: u32) -> single_scatter::Settings {
    single_scatter::Settings { samples, steps: STEPS }
}

fn ball_of(field: Field, albedo: f32, g: f32, radius: f32) -> Filled<Analytic> {
    let medium = Analytic { phase: Phase::from(Lobe::HenyeyGreenstein { g }), ..Analytic::grey(field, albedo) };
    Filled { medium, body: Body::Sphere { centre: Vec3::ZERO, radius } }
}

/// Means over batches must lie within [`STANDARD_ERRORS`] of `expected`.
fn assert_mean(name: &str, batches: u32, expected: f64, mut batch: impl FnMut(&mut Generator) -> f64) {
    let samples: Vec<f64> = (0..batches).map(|i| batch(&mut Generator::new(u64::from(i)))).collect();
    let (mean, error) = mean_and_error(&samples);
    let off = (mean - expected).abs();
    assert!(off <= STANDARD_ERRORS * error + 1e-6 * expected, "{name}: {mean} ± {error}, expected {expected}");
}

/// In a white furnace every point sees radiance 1 from everywhere, fog or no fog.
#[test]
fn single_and_multiple_scattering_add_up_to_one_in_a_white_furnace() {
    let lights = [Light::Constant(Spectrum::ONE)];
    let x = Vec3::new(0.4, -0.3, 0.2);
    for (field, g) in [
        (Field::Homogeneous { a: 2.0 }, 0.6),
        (Field::Gaussian { a: 0.2, k: 3.0, c: Vec3::new(0.3, 0.0, 0.0), s: 0.4 }, -0.3),
    ] {
        let medium = Complaining::new(ball_of(field, 1.0, g, 1.0));
        for lengths in [Lengths::Tracking, Lengths::Marched] {
            let settings = Settings { lengths, max_vertices: 1000, ..Settings::new(STEPS) };
            let walk = Walk { world: World { medium: &medium, scene: &Empty, lights: (&lights).into() }, settings };
            let towards = Towards { to_eye: Vec3::Z, phase: &medium.inner.medium.phase };
            assert_mean(&format!("white furnace, {lengths:?}"), 400, 1.0, |rng| {
                let once = single_scatter::sample(x, &towards, &walk.world, &samples(16), rng);
                let more = multiple_scatter::sample(x, &towards, &walk, NO_SURFACE, 16, rng);
                f64::from(once.value[1] + more.value[1])
            });
        }
        assert!(medium.counts()[0] > 0);
    }
}

#[test]
fn multiple_scattering_in_an_infinite_medium_agrees_with_the_fourier_solution() {
    let medium = Analytic::grey(Field::Homogeneous { a: 1.0 }, 0.8);
    let lamp = PointLight::from_flux(Vec3::ZERO, Spectrum::ONE).unwrap();
    let lights = [Light::Point(lamp)];
    for lengths in [Lengths::Tracking, Lengths::Marched, Lengths::Exponential { floor: 0.05 }] {
        let settings = Settings { lengths, max_vertices: 1000, ..Settings::new(STEPS) };
        let walk = Walk { world: World { medium: &medium, scene: &Empty, lights: (&lights).into() }, settings };
        let x = Vec3::new(0.0, 1.5, 0.0);
        let towards = Towards { to_eye: Vec3::X, phase: &Phase::ISOTROPIC };
        assert_mean(&format!("{lengths:?}"), 500, INFINITE_MEDIUM_MULTIPLE, |rng| {
            f64::from(multiple_scatter::sample(x, &towards, &walk, NO_SURFACE, 256, rng).value[0])
        });
    }
}

#[test]
fn one_light_at_a_time_has_the_same_mean_as_all_of_them() {
    let medium = ball_of(Field::Homogeneous { a: 1.0 }, 0.9, 0.4, 2.0);
    let lamp = |x: f32, i: f32| Light::Point(PointLight::new(Vec3::new(x, 1.0, 0.0), Spectrum::splat(i)).unwrap());
    let sun = Light::Sun(Sun::new(Vec3::new(0.3, 0.2, 1.0), Spectrum::ONE).unwrap());
    let lights = [lamp(0.0, 1.0), lamp(2.5, 3.0), sun, lamp(-0.5, 0.2)];
    let x = Vec3::new(-0.4, 0.1, 0.3);
    let towards = Towards { to_eye: Vec3::X, phase: &medium.medium.phase };
    let estimate = |one_light: bool| {
        let settings = Settings { one_light, ..Settings::new(STEPS) };
        let walk = Walk { world: World { medium: &medium, scene: &Empty, lights: (&lights).into() }, settings };
        let one = |i| multiple_scatter::sample(x, &towards, &walk, NO_SURFACE, 64, &mut Generator::new(i)).value;
        mean_and_error(&(0..300).map(|i| f64::from(one(i)[0])).collect::<Vec<_>>())
    };
    let ((all, e), (one, f)) = (estimate(false), estimate(true));
    assert!((all - one).abs() < STANDARD_ERRORS * e.hypot(f), "{all} ± {e}, {one} ± {f}");
}

/// Towards a lamp outside of the medium that the ray all but meets, the other lamp is chosen no less often than it matters.
#[test]
fn no_sample_of_light_along_a_ray_towards_a_lamp_is_an_outlier() {
    let medium = ball_of(Field::Homogeneous { a: 0.1 }, 0.9, 0.0, 1.0);
    let lamp = |at: Vec3| Light::Point(PointLight::new(at, Spectrum::splat(100.0)).unwrap());
    let lights = [lamp(Vec3::new(10.0, 0.001, 0.0)), lamp(Vec3::new(0.0, 10.0, 0.0))];
    let ray = Ray::new(Vec3::ZERO, Vec3::X);
    let along = |lights: &[Light<'_>], seed: u64| {
        let settings = Settings { one_light: true, max_vertices: 1, ..Settings::new(STEPS) };
        let walk = Walk { world: World { medium: &medium, scene: &Empty, lights: lights.into() }, settings };
        let start = Start { ray, end: None, pdf: 1.0, collision: None };
        let incoming = walk.along(&start, NO_SURFACE, &mut (), &mut Generator::new(seed));
        f64::from(incoming.irradiance[0])
    };
    let samples = |lights: &[Light<'_>]| (0..4000).map(|seed| along(lights, seed)).collect::<Vec<_>>();
    let (both, [first, second]) = (samples(&lights), [0, 1].map(|i| mean_and_error(&samples(&lights[i..=i]))));
    let (mean, error) = mean_and_error(&both);
    let off = (mean - first.0 - second.0).abs();
    assert!(off < STANDARD_ERRORS * (error + first.1 + second.1), "{mean} ± {error}, {first:?} + {second:?}");
    let most = both.iter().copied().fold(0.0, f64::max);
    assert!(most < 2.0 * mean, "{most} among samples with the mean {mean}");
}

/// A cloud without edges, lit by a sun, in three colours: estimated gradients against differences of
/// estimated values.
#[test]
fn mean_gradient_of_multiple_scattering_agrees_with_differences_of_means() {
    let field = Field::Gaussian { a: 0.0, k: 2.5, c: Vec3::ZERO, s: 0.5 };
    let mut medium = ball_of(field, 0.9, 0.5, 2.5);
    medium.medium.tint = Spectrum::new(1.0, 0.5, 0.25);
    let lights = [Light::Sun(Sun::new(Vec3::Y, Spectrum::ONE).unwrap())];
    let walk = Walk {
        world: World { medium: &medium, scene: &Empty, lights: (&lights).into() },
        settings: Settings::new(STEPS),
    };
    let towards = Towards { to_eye: Vec3::X, phase: &medium.medium.phase };
    let (x, h) = (Vec3::new(0.4, 0.3, 0.0), 0.1);
    let run =
        |p: Vec3, seed: u64| multiple_scatter::sample(p, &towards, &walk, NO_SURFACE, 64, &mut Generator::new(seed));
    for axis in [Vec3::X, Vec3::Y] {
        for channel in 0..3 {
            let (mut gradients, mut slopes) = (Vec::new(), Vec::new());
            for seed in 0..600 {
                gradients.push(f64::from(run(x, seed).gradient.along(axis)[channel]));
                let (above, below) = (run(x + axis * h, 3000 + seed), run(x - axis * h, 6000 + seed));
                slopes.push(f64::from((above.value - below.value)[channel] / (2.0 * h)));
            }
            let ((g, e), (d, f)) = (mean_and_error(&gradients), mean_and_error(&slopes));
            // Curvature over ±h: third derivatives of a Gaussian of width s are below 2 L/s³.
            let bias = f64::from(run(x, 0).value[channel] * h * h / 6.0 * 2.0 / 0.125);
            assert!((g - d).abs() < STANDARD_ERRORS * e.hypot(f) + bias, "{axis}, {channel}: {g} ± {e}, {d} ± {f}");
        }
    }
}

#[test]
fn expansions_agree_with_single_directions() {
    let medium = ball_of(Field::Exponential { a: 0.8, b: Vec3::new(0.3, 0.0, -0.2) }, 0.9, 0.4, 2.0);
    let lamp = PointLight::new(Vec3::new(0.5, 1.0, 0.0), Spectrum::new(1.0, 2.0, 3.0)).unwrap();
    let lights = [Light::Point(lamp), Light::Constant(Spectrum::ONE)];
    let wall = Ball { centre: Vec3::ZERO, radius: 3.0, surface: Surface::BLACK };
    let (x, to_eye) = (Vec3::new(0.1, 0.2, 0.3), Vec3::new(0.48, -0.6, 0.64));
    let phase = medium.medium.phase;
    let f = moments(&phase, 16);
    let walk = Walk {
        world: World { medium: &medium, scene: &wall, lights: (&lights).into() },
        settings: Settings::new(STEPS),
    };
    let glow = |ray: &Ray, hit: &fogbow::host::Hit| Spectrum::splat(1.0 + ray.at(hit.distance).y.max(0.0));
    let towards = Towards { to_eye, phase: &phase };
    let open = World { medium: &medium, scene: &Empty, lights: (&lights).into() };
    let rng = || Generator::new(5);
    let plain: [Sums; 3] = [
        single_scatter::sample(x, &towards, &open, &samples(8), &mut rng()),
        single_scatter::sample_surfaces(x, &towards, &walk.world, glow, &samples(32), &mut rng()),
        multiple_scatter::sample(x, &towards, &walk, glow, 32, &mut rng()),
    ];
    for (i, plain) in plain.iter().enumerate() {
        let mut coefficients = [Coefficient::ZERO; 289];
        let mut into = Directional { moments: &f, coefficients: &mut coefficients };
        let mean = match i {
            0 => single_scatter::sample_directional(x, &mut into, &open, &samples(8), &mut rng()),
            1 => single_scatter::sample_surfaces_directional(x, &mut into, &walk.world, glow, &samples(32), &mut rng()),
            _ => multiple_scatter::sample_directional(x, &mut into, &walk, glow, 32, &mut rng()),
        };
        let (value, gradient) = expansion::value_with_gradient(&coefficients, to_eye);
        let slope = (gradient - plain.gradient).norm();
        for c in 0..3 {
            // What degree 16 leaves out: Σ (2l+1) 0.4ˡ beyond is 10⁻⁵, and one degree more for slopes.
            assert!((value[c] / plain.value[c] - 1.0).abs() < 1e-4, "{i}: {value:?}, {:?}", plain.value);
            assert!(slope[c] <= 1e-3 * plain.gradient_norms[c], "{i}: {gradient:?}, {:?}", plain.gradient);
            assert!((coefficients[0].value[c] * 0.28209479 / mean.value[c] - 1.0).abs() < 1e-5, "{i}");
        }
    }
}

#[test]
fn a_glowing_sphere_seen_from_its_centre_through_soot() {
    let soot = Analytic::grey(Field::Homogeneous { a: 0.5 }, 0.0);
    let wall = Complaining::new(Ball { centre: Vec3::ZERO, radius: 2.0, surface: Surface::BLACK });
    let mut rng = Generator::new(1);
    let glow = |_: &Ray, _: &fogbow::host::Hit| Spectrum::ONE;
    let world = World { medium: &soot, scene: &wall, lights: (&[]).into() };
    let towards = Towards { to_eye: Vec3::X, phase: &Phase::ISOTROPIC };
    let seen = single_scatter::sample_surfaces(Vec3::ZERO, &towards, &world, glow, &samples(64), &mut rng);
    assert!((seen.value[0] - (-1.0_f32).exp()).abs() < 1e-6, "{:?}", seen.value);
    assert!(seen.gradient.norm()[0] < 0.2 * seen.gradient_norms[0], "opposite sides cancel");
    assert_eq!(wall.counts()[2], 64);
}

#[test]
fn shadowed_lights_count_in_the_unshadowed_sums_only() {
    let lamp = |x: f32| Light::Point(PointLight::new(Vec3::X * x, Spectrum::ONE).unwrap());
    // Between the point and the first light only.
    let blocker = Ball { centre: Vec3::X * 1.5, radius: 0.2, surface: Surface::BLACK };
    let lights = [lamp(3.0), lamp(-3.0)];
    let mut rng = Generator::new(1);
    let towards = Towards { to_eye: Vec3::Z, phase: &Phase::ISOTROPIC };
    let world = World { medium: &Empty, scene: &blocker, lights: (&lights).into() };
    let sums = single_scatter::sample(Vec3::ZERO, &towards, &world, &samples(1), &mut rng);
    assert!((sums.unshadowed[0] / sums.value[0] - 2.0).abs() < 1e-6);
    assert!((sums.unshadowed_gradient_norms[0] / sums.gradient_norms[0] - 2.0).abs() < 1e-6);
}

#[test]
fn march_agrees_with_closed_forms_and_asks_nothing_of_vacuum() {
    // A bubble of fog: constant in-scattering gives albedo (1 − T) whatever the steps.
    let fog = Complaining::new(ball_of(Field::Homogeneous { a: 0.7 }, 0.6, 0.0, 2.0));
    let ray = Ray::new(Vec3::new(0.0, 0.0, -10.0), Vec3::Z);
    let through = (-0.7_f64 * 4.0).exp();
    for (step, offset) in [(0.01, 0.0), (0.3, 0.5), (100.0, 0.99), (0.0, 0.5), (f32::NAN, 0.5), (f32::INFINITY, 0.1)] {
        // A step of nothing is replaced by a millionth of the segment: too slow for this test.
        let step = if step > 0.0 {
            step
        } else if step == 0.0 {
            1e-3
        } else {
            f32::INFINITY
        };
        let seen = eye_ray(&ray, &fog, |_| step, |_, _, _| Spectrum::ONE, offset);
        assert!((f64::from(seen.radiance[0]) - 0.6 * (1.0 - through)).abs() < 1e-5, "{step}: {:?}", seen.radiance);
        assert!((f64::from(seen.transmittance[0]) - through).abs() < 1e-6);
    }
    let mut calls = 0;
    let seen = eye_ray(
        &ray,
        &fog,
        |_| 0.5,
        |_, _, _| {
            calls += 1;
            Spectrum::ZERO
        },
        0.5,
    );
    assert_eq!((calls, seen.radiance), (8, Spectrum::ZERO));
    // Emission alone, in a changing medium that never ends along the ray, seen from inside.
    let haze = Analytic::grey(Field::Gaussian { a: 0.3, k: 1.0, c: Vec3::ZERO, s: 1.0 }, 1.0);
    let glow = eye_ray(&Ray::new(Vec3::ZERO, Vec3::X), &haze, |_| 0.05, |_, _, _| Spectrum::ONE, 0.5);
    assert!((glow.radiance[0] - 1.0).abs() < 1e-4 && glow.transmittance == Spectrum::ZERO, "{glow:?}");
    assert!(haze.is_grey());
}

/// `L_i` that changes along the ray: the mean over offsets is the integral.
#[test]
fn march_is_unbiased_in_constant_fog() {
    let fog = Analytic::grey(Field::Homogeneous { a: 0.8 }, 1.0);
    let ray = Ray::new(Vec3::ZERO, Vec3::X).with_length(3.0);
    // ∫ e^{−σt} σ t dt over [0, 3]
    let a = 0.8_f64 * 3.0;
    let exact = (1.0 - (1.0 + a) * (-a).exp()) / 0.8;
    let n = 4000;
    let mean = (0..n)
        .map(|i| {
            f64::from(
                eye_ray(&ray, &fog, |_| 1.1, |p, _, _| Spectrum::splat(p.x), (i as f32 + 0.5) / n as f32).radiance[0],
            )
        })
        .sum::<f64>()
        / f64::from(n);
    assert!((mean / exact - 1.0).abs() < 1e-4, "{mean}, {exact}");
}
