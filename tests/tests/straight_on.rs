//! Walks for which a part of what is scattered goes straight on: the same light, whatever that part is.

use fogbow::host::{Empty, Properties, Scene};
use fogbow::light::{Light, PointLight};
use fogbow::math::{Ray, Vec3};
use fogbow::multiple_scatter::{Known, Settings, Start, Walk};
use fogbow::phase::{Lobe, Phase};
use fogbow::sampling::{Generator, uniform, uniform2, warp};
use fogbow::single_scatter::Contribution;
use fogbow::spectrum::{Gradient, Spectrum};
use fogbow::surface::Surface;
use fogbow::transmittance::thickness::Steps;
use fogbow::world::{World, nearest_surface};
use fogbow_tests::analytic::mean_and_error;
use fogbow_tests::hosts::{Analytic, Ball, Body, Field, Filled};
use fogbow_tests::tolerance::STANDARD_ERRORS;

const STEPS: Steps = Steps::Length(0.1);

fn ball_of(field: Field, albedo: f32, g: f32, radius: f32) -> Filled<Analytic> {
    let medium = Analytic { phase: Phase::from(Lobe::HenyeyGreenstein { g }), ..Analytic::grey(field, albedo) };
    Filled { medium, body: Body::Sphere { centre: Vec3::ZERO, radius } }
}

/// Light of radiance 1 from everywhere, of which another part goes straight on wherever one looks.
struct Furnace {
    most: f32,
}

impl Known for Furnace {
    fn straight(&self, point: Vec3, _: &Properties) -> f32 {
        self.most * (0.5 + 0.5 * (3.0 * point.x).sin())
    }

    fn light(&mut self, point: Vec3, _: Vec3, properties: &Properties) -> Option<(Contribution, Gradient)> {
        let radiance = Spectrum::splat(1.0 - self.straight(point, properties));
        Some((Contribution { radiance, gradient: Gradient::ZERO }, Gradient::ZERO))
    }
}

/// What comes of it along one ray: without what comes straight from the end, `1 − T`.
fn furnace(walk: &Walk<'_, Filled<Analytic>, impl Scene>, ray: Ray, most: f32, seed: u64) -> Spectrum {
    let rng = &mut Generator::new(seed);
    let end = nearest_surface(&ray, walk.world.scene);
    let u = uniform(rng);
    let collision = walk.first(&ray, end.as_ref(), u, false, rng).collision;
    let start = Start { ray, end, pdf: 1.0, collision };
    walk.along(&start, |_, _| Spectrum::ONE, &mut Furnace { most }, rng).irradiance
}

/// Under an even sky, and between walls that shine as evenly, in even fog and in fog of three colours that thins out.
#[test]
fn in_a_white_furnace_light_is_one_whatever_goes_straight_on() {
    let sky = [Light::Constant(Spectrum::ONE)];
    let wall = Ball { centre: Vec3::ZERO, radius: 1.0, surface: Surface::BLACK };
    let field = Field::Gaussian { a: 0.2, k: 3.0, c: Vec3::new(0.3, 0.0, 0.0), s: 0.4 };
    let mut coloured = ball_of(field, 1.0, 0.9, 1.0);
    coloured.medium.tint = Spectrum::new(1.0, 0.6, 0.3);
    let ray = Ray::new(Vec3::new(-0.4, 0.1, 0.2), Vec3::new(0.8, 0.0, -0.6));
    for (name, medium) in [("even", ball_of(Field::Homogeneous { a: 1.5 }, 1.0, 0.9, 1.0)), ("coloured", coloured)] {
        let through = fogbow::transmittance::thickness::transmittance(
            &ray,
            &medium,
            fogbow::transmittance::thickness::Marching::midpoints(512),
        );
        for most in [0.0, 0.5, 0.9] {
            let of = |walled: bool, channel: usize| {
                let samples = (0..20_000).map(|seed| {
                    let light = if walled {
                        let world = World { medium: &medium, scene: &wall, lights: (&[]).into() };
                        furnace(&Walk { world, settings: Settings::new(STEPS) }, ray, most, seed)
                    } else {
                        let world = World { medium: &medium, scene: &Empty, lights: (&sky).into() };
                        furnace(&Walk { world, settings: Settings::new(STEPS) }, ray, most, seed)
                    };
                    f64::from(light[channel])
                });
                mean_and_error(&samples.collect::<Vec<_>>())
            };
            for walled in [false, true] {
                for channel in [0, 2] {
                    let ((mean, error), expected) = (of(walled, channel), 1.0 - f64::from(through[channel]));
                    let off = (mean - expected).abs();
                    assert!(
                        off < STANDARD_ERRORS * error + 1e-3,
                        "{name} {walled} {most}: {mean} ± {error}, {expected}"
                    );
                }
            }
        }
    }
}

/// The rest of the light around a lamp, found by walks of which nothing goes straight on: one for each question.
struct Nested<'a> {
    walk: Walk<'a, Filled<Analytic>, Empty>,
    part: f32,
    rng: Generator,
}

impl Nested<'_> {
    /// Light but that straight from the lamp that arrives at `point` against `to_light`.
    fn arriving(&mut self, point: Vec3, to_light: Vec3) -> Spectrum {
        let ray = Ray::new(point, to_light);
        let u = uniform(&mut self.rng);
        let collision = self.walk.first(&ray, None, u, false, &mut self.rng).collision;
        let start = Start { ray, end: None, pdf: 1.0, collision };
        self.walk.along(&start, |_, _| Spectrum::ZERO, &mut (), &mut self.rng).irradiance
    }
}

impl Known for Nested<'_> {
    fn straight(&self, _: Vec3, _: &Properties) -> f32 {
        self.part
    }

    fn light(&mut self, point: Vec3, to_eye: Vec3, properties: &Properties) -> Option<(Contribution, Gradient)> {
        let turn = properties.phase.sample(to_eye, uniform2(&mut self.rng));
        let scattered = self.arriving(point, turn.to_light) * turn.weight;
        let radiance = scattered - self.arriving(point, -to_eye) * self.part;
        Some((Contribution { radiance, gradient: Gradient::ZERO }, Gradient::ZERO))
    }
}

/// A lamp in the fog itself, whose light walks connect to along their segments, and in whose near field they pass.
#[test]
fn lamps_are_connected_to_beyond_what_goes_straight_on() {
    let medium = ball_of(Field::Homogeneous { a: 1.2 }, 0.7, 0.4, 1.5);
    let lights = [Light::Point(PointLight::new(Vec3::new(0.5, 0.4, 0.0), Spectrum::ONE).unwrap())];
    let world = World { medium: &medium, scene: &Empty, lights: (&lights).into() };
    let walk = Walk { world, settings: Settings::new(STEPS) };
    let ray = Ray::new(Vec3::new(-0.3, 0.1, 0.0), Vec3::X);
    let of = |part: f32| {
        let one = |seed: u64| {
            let mut nested = Nested { walk, part, rng: Generator::new(seed ^ 0x5eed) };
            let rng = &mut Generator::new(seed);
            let u = uniform(rng);
            let start = Start { ray, end: None, pdf: 1.0, collision: walk.first(&ray, None, u, false, rng).collision };
            f64::from(walk.along(&start, |_, _| Spectrum::ZERO, &mut nested, rng).irradiance[0])
        };
        mean_and_error(&(0..30_000).map(one).collect::<Vec<_>>())
    };
    let (all, e) = of(0.0);
    for part in [0.3, 0.6] {
        let (mean, f) = of(part);
        assert!((mean - all).abs() < STANDARD_ERRORS * e.hypot(f), "{part}: {mean} ± {f}, {all} ± {e}");
        assert!(e.max(f) < 0.02 * all, "{part}: too noisy to tell");
    }
}

/// Fluence of what is scattered in an even ball under an even sky is `∫ (1 − T) dω`: gradients are held to its slope, which the part that goes straight on
/// must not change. Walls are where fog ends: of an end in the open walks know nothing.
#[test]
fn gradients_are_those_of_all_the_light() {
    let medium = ball_of(Field::Homogeneous { a: 1.5 }, 1.0, 0.9, 1.0);
    let wall = Ball { centre: Vec3::ZERO, radius: 1.0, surface: Surface::BLACK };
    let x = 0.5_f64;
    let fluence = |x: f64| {
        // By the cosine with the axis: to the sphere it is −x c + √(1 − x² (1 − c²)).
        let n = 2000;
        let of = |i: usize| {
            let c = (i as f64 + 0.5) * 2.0 / n as f64 - 1.0;
            1.0 - (-1.5 * (-x * c + (1.0 - x * x * (1.0 - c * c)).sqrt())).exp()
        };
        2.0 * std::f64::consts::PI * (0..n).map(of).sum::<f64>() * 2.0 / n as f64
    };
    let expected = (fluence(x + 1e-3) - fluence(x - 1e-3)) / 2e-3;
    struct Even(f32);
    impl Known for Even {
        fn straight(&self, _: Vec3, _: &Properties) -> f32 {
            self.0
        }
        fn light(&mut self, _: Vec3, _: Vec3, _: &Properties) -> Option<(Contribution, Gradient)> {
            let radiance = Spectrum::splat(1.0 - self.0);
            Some((Contribution { radiance, gradient: Gradient::ZERO }, Gradient::ZERO))
        }
    }
    for part in [0.0, 0.5, 0.9] {
        let one = |seed: u64| {
            let world = World { medium: &medium, scene: &wall, lights: (&[]).into() };
            let (walk, rng) = (Walk { world, settings: Settings::new(STEPS) }, &mut Generator::new(seed));
            let ray = Ray::new(Vec3::X * x as f32, warp::uniform_sphere(uniform2(rng)));
            let (end, u) = (nearest_surface(&ray, &wall), uniform(rng));
            let collision = walk.first(&ray, end.as_ref(), u, false, rng).collision;
            let start = Start { ray, end, pdf: warp::uniform_sphere_pdf(), collision };
            f64::from(walk.along(&start, |_, _| Spectrum::ONE, &mut Even(part), rng).gradient.x[0])
        };
        let (mean, error) = mean_and_error(&(0..60_000).map(one).collect::<Vec<_>>());
        assert!((mean - expected).abs() < STANDARD_ERRORS * error, "{part}: {mean} ± {error}, {expected}");
        assert!(error < 0.02 * expected.abs(), "{part}: too noisy to tell");
    }
}
