//! Many virtual lights: energy, agreement of strategies, sampling.

use fogbow::host::{Empty, Hit, Medium, Scene};
use fogbow::light::{Light, PointLight, QuadLight};
use fogbow::math::{Bounds, Ray, Vec3};
use fogbow::medium::{Homogeneous, Placed, Region};
use fogbow::path::{self, Settings};
use fogbow::phase::{Lobe, Phase};
use fogbow::sampling::{Generator, Independent, uniform};
use fogbow::spectrum::Spectrum;
use fogbow::surface::Surface;
use fogbow::vpl::{self, Bound, Compensation, EyeSettings, Flights, Gatherer, Receiver, Scatterer, VirtualLight};
use fogbow::work::{self, Rounds};
use fogbow::world::{Outline, World};
use fogbow_std::progress::Control;
use fogbow_std::threads::{self, Threads};
use fogbow_tests::chi_square;
use fogbow_tests::estimate::{Estimate, estimate};
use fogbow_tests::hosts::{Analytic, Field};

/// The infinite medium of the sheet's § 3.3: a lamp of 1 W, seen at 1.5 m, clamped within 1.2 m.
const DISTANCE: f32 = 1.5;
const RADIUS: f32 = 1.2;
/// In-scattered radiance of light scattered twice or more, and what n steps of compensation recover of it: exact
/// quadrature.
const EXACT: f64 = 2.336_49e-3;
const STEPS: [(u32, f64); 5] = [(1, 1.777_62e-3), (2, 2.087_82e-3), (3, 2.226_84e-3), (6, 2.327_72e-3), (12, EXACT)];

/// In-scattered radiance times `σₛ` at the point, light of one path from the lamp.
fn estimate_with(compensation: Option<Compensation>, samples: u32) -> Estimate {
    let fog = Homogeneous::new(Spectrum::splat(0.2), Spectrum::splat(0.8), Phase::ISOTROPIC).unwrap();
    let lamps = [Light::Point(PointLight::from_flux(Vec3::ZERO, Spectrum::ONE).unwrap())];
    let world = World { medium: &fog, scene: &Empty, lights: (&lamps).into() };
    let bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
    let properties = fog.properties(Vec3::ZERO);
    let receiver = Receiver::in_medium(Vec3::X * DISTANCE, Vec3::Y, &properties).unwrap();
    let gatherer = Gatherer { world, bound: Bound::within(RADIUS).unwrap(), compensation, has_mirrors: false };
    let paths = Settings { roulette_after: 4, ..Settings::default() };
    let mut lights: Vec<VirtualLight> = Vec::new();
    estimate(samples, |rng| {
        lights.clear();
        vpl::shoot(&world, &bounds, &paths, rng, &mut |light| lights.push(light));
        let mut sum = gatherer.gather(&receiver, &lights, u32::MAX, rng);
        sum.add(&gatherer.of_the_lights(&receiver, u32::MAX, rng), Spectrum::ONE);
        sum.total()
    })
}

#[test]
fn compensation_recovers_the_energy_that_it_should() {
    let strategies = [
        ("1-to-N", Compensation::FULL),
        ("N-to-1", Compensation::N_TO_ONE),
        ("1-to-1", Compensation { flights: Flights::Truncated, ..Compensation::ONE_TO_ONE }),
        ("1-to-1, locally homogeneous", Compensation::APPROXIMATE),
    ];
    for (name, strategy) in strategies {
        for (steps, truth) in STEPS {
            let found = estimate_with(Some(Compensation { steps, ..strategy }), 40_000);
            println!("{name}, {steps} steps: {:.5e} ± {:.1e}, should be {truth:.5e}", found.mean[0], found.error[0]);
            // From the second step on a vertex may come near the lamp, whose 1/r² has no variance.
            assert!(found.error[0] < 0.05 * truth, "{name}: too noisy to tell");
            assert!((found.mean[0] - truth).abs() < 3.0 * found.error[0], "{name}, {steps} steps");
        }
    }
    let clamped = estimate_with(None, 40_000);
    println!("clamped: {:.5e} ± {:.1e}", clamped.mean[0], clamped.error[0]);
    // Without the path for light straight from the lamp, too.
    clamped.assert_is([1.0824e-3; 3], 0.001, "clamped");
}

// ---------------------------------------------------------------------------------------------
// A room with everything in it

/// Two walls that meet, a glossy one among them, a mirror ball and the lamp's own rectangle.
struct Room;

fn plane(ray: &Ray, normal: Vec3, offset: f32) -> Option<f32> {
    let distance = (offset - ray.origin.dot(normal)) / ray.direction.dot(normal);
    (distance > 0.0 && distance < ray.length).then_some(distance)
}

impl Scene for Room {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let wall = |normal: Vec3, surface: Surface| {
            // One-sided, a metre from the middle.
            let distance = plane(ray, normal, -1.0)?;
            Some(Hit { distance, normal, shading: normal, surface, light: None })
        };
        let floor = wall(Vec3::Y, Surface::Lambert { reflectance: Spectrum::new(0.7, 0.5, 0.3) });
        let (diffuse, specular) = (Spectrum::new(0.2, 0.4, 0.5), Spectrum::splat(0.3));
        let side = wall(Vec3::X, Surface::Phong { diffuse, specular, exponent: 4.0 });
        let lamp = plane(ray, Vec3::Y, 1.0).filter(|&t| ray.at(t).x.abs() < 0.4 && ray.at(t).z.abs() < 0.4);
        let lamp = lamp.map(|distance| Hit {
            distance,
            normal: Vec3::NEG_Y,
            shading: Vec3::NEG_Y,
            surface: Surface::BLACK,
            light: (ray.direction.y > 0.0).then_some(0),
        });
        let centre = Vec3::new(0.4, -0.6, 0.2);
        let closest = ray.direction.dot(centre - ray.origin);
        let half = 0.3_f32.powi(2) - ray.at(closest).distance_squared(centre);
        let ball = (half > 0.0).then(|| closest - half.sqrt()).filter(|&t| t > 1e-4 && t < ray.length);
        let ball = ball.map(|distance| Hit {
            distance,
            normal: (ray.at(distance) - centre).normalize(),
            shading: (ray.at(distance) - centre).normalize(),
            surface: Surface::Mirror { reflectance: Spectrum::splat(0.9) },
            light: None,
        });
        [floor, side, lamp, ball].into_iter().flatten().min_by(|a, b| a.distance.total_cmp(&b.distance))
    }
}

const BOUNDS: Bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };

fn lamp() -> [Light<'static>; 1] {
    let (corner, edge) = (Vec3::new(-0.4, 1.0, -0.4), 0.8);
    [Light::Quad(QuadLight::new(corner, Vec3::X * edge, Vec3::Z * edge, Spectrum::new(4.0, 5.0, 6.0)).unwrap())]
}

/// Coloured smoke that varies, within the room.
fn smoke() -> Placed<'static, Analytic> {
    let bump = Field::Gaussian { a: 0.3, k: 2.0, c: Vec3::new(-0.2, -0.3, 0.1), s: 0.5 };
    let medium = Analytic {
        tint: Spectrum::new(1.0, 0.8, 0.6),
        phase: Phase::from(Lobe::HenyeyGreenstein { g: 0.4 }),
        ..Analytic::grey(bump, 0.8)
    };
    Placed::new(medium, Region::bounds(BOUNDS).unwrap())
}

/// Towards the corner of the walls, and the mirror's edge.
fn eye_ray(rng: &mut Generator) -> Ray {
    let target = Vec3::new(uniform(rng) * 1.2 - 0.9, uniform(rng) * 1.2 - 0.9, 0.0);
    Ray::between(Vec3::new(0.5, 0.2, 4.0), target).with_length(f32::INFINITY)
}

/// By virtual lights of 16 paths each time.
fn by_lights(medium: &impl Medium, gatherer: (Bound, Option<Compensation>), paths: Settings, samples: u32) -> Estimate {
    const PATHS: u32 = 16;
    let lights = lamp();
    let world = World { medium, scene: &Room, lights: (&lights).into() };
    let (bound, compensation) = gatherer;
    let gatherer = Gatherer { world, bound, compensation, has_mirrors: true };
    let settings = EyeSettings { single: 1, primary: 1, ..EyeSettings::new(paths) };
    let mut found: Vec<VirtualLight> = Vec::new();
    estimate(samples, |rng| {
        found.clear();
        for _ in 0..PATHS {
            vpl::shoot(&world, &BOUNDS, &paths, rng, &mut |light| found.push(light.scaled(1.0 / PATHS as f32)));
        }
        // Half of them at a time count double.
        let half = if uniform(rng) < 0.5 { &found[..found.len() / 2] } else { &found[found.len() / 2..] };
        let ray = eye_ray(rng);
        vpl::radiance(&ray, &gatherer, half, 2.0, &settings, rng).radiance.total()
    })
}

fn by_paths(medium: &impl Medium, paths: Settings, samples: u32) -> Estimate {
    let lights = lamp();
    let world = World { medium, scene: &Room, lights: (&lights).into() };
    estimate(samples, |rng| path::radiance(&eye_ray(rng), &world, &paths, rng).total())
}

fn assert_agree(found: &Estimate, truth: &Estimate, what: &str) {
    for c in 0..3 {
        let error = found.error[c].hypot(truth.error[c]);
        println!("{what}: {:.5} ± {:.5}, by paths {:.5}", found.mean[c], found.error[c], truth.mean[c]);
        assert!(error < 0.02 * truth.mean[c], "{what}: too noisy to tell");
        assert!((found.mean[c] - truth.mean[c]).abs() < 4.5 * error, "{what}, channel {c}");
    }
}

/// Means are known to one per cent, so a bias of five is found; without compensation 9 to 27 % of the light are missing.
fn full_compensation_is_without_bias(most: u32) {
    let medium = smoke();
    let bound = Bound::within(0.5).unwrap();
    let exact = Compensation { flights: Flights::Truncated, steps: u32::MAX, ..Compensation::ONE_TO_ONE };
    let paths = Settings { max_scatterings: most, ..Settings::default() };
    let truth = by_paths(&medium, paths, 400_000);
    for (name, compensation) in [("Woodcock, 1-to-N", Compensation::FULL), ("truncated, 1-to-1", exact)] {
        let found = by_lights(&medium, (bound, Some(compensation)), paths, 20_000);
        assert_agree(&found, &truth, &format!("{name}, at most {most} scatterings"));
    }
}

#[test]
fn full_compensation_of_light_scattered_twice_is_without_bias() {
    full_compensation_is_without_bias(2);
}

#[test]
fn full_compensation_of_all_light_is_without_bias() {
    full_compensation_is_without_bias(u32::MAX);
}

#[test]
fn surfaces_are_compensated_in_vacuum() {
    let paths = Settings { max_scatterings: 3, ..Settings::default() };
    let truth = by_paths(&Empty, paths, 400_000);
    let bound = Bound::within(0.8).unwrap();
    assert_agree(&by_lights(&Empty, (bound, Some(Compensation::FULL)), paths, 60_000), &truth, "compensated");
    let truncated = Compensation { steps: u32::MAX, ..Compensation::APPROXIMATE };
    assert_agree(&by_lights(&Empty, (bound, Some(truncated)), paths, 60_000), &truth, "truncated flights");
    let clamped = by_lights(&Empty, (bound, None), paths, 60_000);
    assert!(clamped.mean[0] < 0.97 * truth.mean[0], "clamping must show: {} of {}", clamped.mean[0], truth.mean[0]);
}

#[test]
fn a_locally_homogeneous_medium_is_one_where_it_is_one() {
    // In an even medium without borders nearby the assumption holds, so all flights agree.
    let fog = Homogeneous::new(Spectrum::splat(0.1), Spectrum::new(0.9, 0.9, 0.9), Lobe::HenyeyGreenstein { g: 0.5 })
        .unwrap();
    let world = World { medium: &fog, scene: &Empty, lights: (&[]).into() };
    let receiver = Receiver::in_medium(Vec3::ZERO, Vec3::Z, &fog.properties(Vec3::ZERO)).unwrap();
    let bound = Bound::within(0.7).unwrap();
    // ∫∫ f̂ T B̂ h dt dω with a test function h of the vertex: its distance and direction.
    let of = |flights: Flights| {
        let compensation = Compensation { flights, ..Compensation::APPROXIMATE };
        estimate(200_000, |rng| {
            vpl::next_vertex(&world, &receiver, bound, &compensation, rng).map_or(Spectrum::ZERO, |(next, weight)| {
                let p = next.point;
                weight * Spectrum::new(1.0, p.length_squared(), 1.0 + p.z)
            })
        })
    };
    let truth = f64::from(vpl::contraction(1.0, 0.9, bound.radius()));
    for flights in [Flights::Woodcock, Flights::Truncated, Flights::LocallyHomogeneous] {
        let found = of(flights);
        // Light goes on to +z, so that it comes from below: g times the mean distance lower.
        let (mut second, mut below) = (0.0, 0.0);
        for i in 0..2000 {
            let r = (f64::from(i) + 0.5) / 2000.0 * f64::from(bound.radius());
            let weight =
                0.9 * (-r).exp() * (1.0 - (r / f64::from(bound.radius())).powi(2)) * f64::from(bound.radius()) / 2000.0;
            second += weight * r * r;
            below += weight * (1.0 - 0.5 * r);
        }
        found.assert_is([truth, second, below], 1e-4, &format!("{flights:?}"));
    }
}

#[test]
fn lights_that_are_kept_shine_for_the_others() {
    let phase = Phase::ISOTROPIC;
    let all: Vec<VirtualLight> = (0..40)
        .map(|i| VirtualLight::in_medium(Vec3::X * i as f32, Vec3::Z, Spectrum::new(1.0, i as f32, 3.0), 1, &phase))
        .collect();
    let importance: Vec<f32> = (0..40).map(|i| if i == 3 { 1e4 } else { 0.5 + (i % 7) as f32 }).collect();
    let found = estimate(20_000, |rng| {
        let (mut lights, mut importance) = (all.clone(), importance.clone());
        let kept = vpl::select(&mut lights, &mut importance, 12.0, uniform(rng));
        assert!((11..=13).contains(&kept), "{kept}");
        assert!((importance.iter().sum::<f32>() - 12.0).abs() < 1e-3 && importance[3] == 1.0);
        lights[..kept].iter().map(|light| light.flux).sum()
    });
    found.assert_is([40.0, (0..40).sum::<i32>().into(), 120.0], 1e-5, "flux");
    // More wanted than there are: all of them, as they are.
    let (mut lights, mut importance) = (all.clone(), importance);
    assert_eq!(vpl::select(&mut lights, &mut importance, 100.0, 0.3), 40);
    assert!(lights == all);
    let mut nothing = [0.0, f32::NAN];
    assert_eq!(vpl::select(&mut lights[..2], &mut nothing, 1.0, 0.9), 0);
}

#[test]
fn virtual_lights_keep_what_scatters() {
    let haze = Phase::droplets(20.0).unwrap();
    let parts = [
        (Spectrum::new(1.0, 2.0, 3.0), Phase::from(Lobe::Rayleigh)),
        (Spectrum::new(3.0, 1.0, 0.0), Phase::from(Lobe::Schlick { k: -0.3 })),
        (Spectrum::ONE, haze),
    ];
    let mixed = Phase::mix(parts).unwrap();
    for phase in [Phase::ISOTROPIC, haze, mixed, Phase::from(Lobe::HenyeyGreenstein { g: -0.9 })] {
        let light = VirtualLight::in_medium(Vec3::ONE, Vec3::Z, Spectrum::ONE, 2, &phase);
        let bytes = fogbow::bytemuck::bytes_of(&light).to_vec();
        let copy: VirtualLight = fogbow::bytemuck::pod_read_unaligned(&bytes);
        let Scatterer::Medium { phase: found, .. } = copy.scatterer() else { panic!("a medium") };
        for cosine in [-1.0, -0.3, 0.2, 0.99] {
            let deflection = fogbow::phase::Deflection::from_cos(cosine);
            let (a, b) = (found.value(deflection), phase.value(deflection));
            assert!((a - b).max_element().abs() <= 1e-5 * b.max_element(), "{a:?} {b:?}");
        }
    }
    let surface =
        Surface::Phong { diffuse: Spectrum::new(0.1, 0.2, 0.3), specular: Spectrum::splat(0.5), exponent: 9.0 };
    let light = VirtualLight::on_surface(Vec3::ONE, Vec3::Z, Spectrum::ONE, 1, Vec3::NEG_Z, &surface).unwrap();
    assert_eq!(light.scatterer(), Scatterer::Surface { normal: Vec3::NEG_Z, surface });
    assert!(light.is_on_surface() && size_of::<VirtualLight>() * 100_000 < 16_000_000);
    let mirror = Surface::Mirror { reflectance: Spectrum::ONE };
    assert!(VirtualLight::on_surface(Vec3::ONE, Vec3::Z, Spectrum::ONE, 1, Vec3::NEG_Z, &mirror).is_none());
}

#[test]
fn first_lights_lie_where_flights_end() {
    let fog = Homogeneous::new(Spectrum::splat(0.5), Spectrum::splat(1.5), Phase::ISOTROPIC).unwrap();
    let lamps = [Light::Point(PointLight::from_flux(Vec3::ZERO, Spectrum::ONE).unwrap())];
    let world = World { medium: &fog, scene: &Empty, lights: (&lamps).into() };
    // Equal shares of distance, height and azimuth: 4 x 4 x 4 cells as likely as each other.
    let mut counts = [0_u64; 64];
    let mut rng = Generator::new(4);
    const PATHS: u32 = 64_000;
    for _ in 0..PATHS {
        let mut first = true;
        let settings = Settings { max_scatterings: 2, ..Settings::default() };
        vpl::shoot(&world, &BOUNDS, &settings, &mut rng, &mut |light| {
            assert!(core::mem::take(&mut first) && light.scatterings == 1);
            let p = light.position;
            let share = [
                1.0 - (-2.0 * p.length()).exp(),
                0.5 * (1.0 + p.z / p.length()),
                0.5 + p.y.atan2(p.x) / (2.0 * core::f32::consts::PI),
            ];
            let [i, j, k] = share.map(|s| ((s * 4.0) as usize).min(3));
            counts[16 * i + 4 * j + k] += 1;
            // Power over the number of paths is what collides; albedo is applied.
            assert!((light.flux[0] - 0.75).abs() < 1e-5);
        });
    }
    let expected = [f64::from(PATHS) / 64.0; 64];
    chi_square::assert_passes("first virtual lights", &chi_square::compare(&counts, &expected));
}

#[test]
fn bad_input_gives_errors_or_numbers() {
    for b in [0.0, -1.0, f32::NAN, f32::NEG_INFINITY] {
        assert!(Bound::new(b).is_err() && Bound::within(b).is_err(), "{b}");
    }
    assert_eq!(Bound::new(f32::INFINITY), Ok(Bound::NONE));
    let extremes = [0.0, 1e-38, 1e-6, 1.0, 1e6, 1e38, f32::INFINITY];
    for bound in [1e-38, 1e-6, 1.0, 1e6, 1e38, f32::INFINITY].map(|b| Bound::new(b).unwrap()) {
        for distance2 in extremes {
            for cosines in [0.0, 1e-38, 0.5, 1.0] {
                let missing = bound.missing(distance2, cosines);
                assert!((0.0..=1.0).contains(&missing), "{bound:?} {distance2} {cosines}: {missing}");
                let kept = bound.clamped(vpl::geometry(distance2, cosines));
                assert!(kept >= 0.0 && kept <= bound.value(), "{bound:?} {distance2} {cosines}: {kept}");
            }
        }
    }
    for a in extremes {
        for radius in extremes {
            let kappa = vpl::contraction(a, 0.9, radius);
            assert!((0.0..=0.9).contains(&kappa), "{a} {radius}: {kappa}");
            let found = vpl::radius_for(0.25, a, 0.9, radius);
            assert!(found >= 0.0 && found <= radius, "{a} {radius}: {found}");
        }
    }
    // A light at the very point, one beyond the range of floats, one that is black.
    let receiver = Receiver::in_medium(
        Vec3::ZERO,
        Vec3::Z,
        &fogbow::host::Properties { scattering: Spectrum::ONE, ..fogbow::host::Properties::VACUUM },
    );
    let receiver = receiver.unwrap();
    for position in [Vec3::ZERO, Vec3::splat(1e-30), Vec3::splat(1e30)] {
        let light = VirtualLight::in_medium(position, Vec3::Z, Spectrum::ONE, 1, &Phase::ISOTROPIC);
        let seen =
            light.connect(&receiver).map_or(Spectrum::ZERO, |c| c.radiance(Bound::new(2.0).unwrap(), Spectrum::ONE));
        assert!(seen.is_valid(), "{position}: {seen:?}");
    }
    // Nothing to see, and no end of steps: pictures, not hangs.
    let dark = Homogeneous::new(Spectrum::ONE, Spectrum::ZERO, Phase::ISOTROPIC).unwrap();
    let clear = Homogeneous::new(Spectrum::ZERO, Spectrum::splat(5.0), Phase::ISOTROPIC).unwrap();
    let endless = Compensation { flights: Flights::LocallyHomogeneous, ..Compensation::FULL };
    let paths = Settings { max_scatterings: 20, ..Settings::default() };
    for compensation in [None, Some(Compensation::FULL), Some(endless)] {
        for bound in [1e-6, 4.0, 1e12].map(|b| Bound::new(b).unwrap()) {
            for medium in [&dark, &clear] {
                let medium = Placed::new(*medium, Region::bounds(BOUNDS).unwrap());
                assert!(by_lights(&medium, (bound, compensation), paths, 20).mean[0] >= 0.0);
            }
        }
    }
    let world = World { medium: &Empty, scene: &Empty, lights: (&[]).into() };
    let radius = |bounds| vpl::usual_bound(&Outline::of(&world, bounds)).radius();
    assert!(radius(BOUNDS) > 0.0 && radius(Bounds::EMPTY) > 0.0);
}

/// A ball of fog.
type Ball = Placed<'static, Homogeneous>;

fn ball() -> Ball {
    let fog = Homogeneous::new(Spectrum::splat(0.2), Spectrum::splat(1.5), Phase::ISOTROPIC).unwrap();
    Placed::new(fog, Region::sphere(Vec3::ZERO, 0.8).unwrap())
}

/// A pass by whatever runs it, with witnesses along a line through the ball.
fn lights_of_a_pass(
    settings: impl Fn(vpl::Settings) -> vpl::Settings,
    run: impl Fn(&mut vpl::VplPass<'_, Independent>, &World<'_, Ball, Empty>),
) -> Result<Vec<VirtualLight>, vpl::VplPassError> {
    let ball = ball();
    let lamps = [Light::Point(PointLight::from_flux(Vec3::Z * 0.2, Spectrum::ONE).unwrap())];
    let world = World { medium: &ball, scene: &Empty, lights: (&lamps).into() };
    let usual = vpl::Settings { lights: 150, paths: 400, ..vpl::Settings::for_outline(&Outline::of(&world, BOUNDS)) };
    let settings = settings(usual);
    let mut witnesses = Vec::new();
    let eye = |[x, y]: [f32; 2], _: &mut Generator| Ray::between(Vec3::NEG_Z * 2.0, Vec3::new(x - 0.5, y - 0.5, 0.0));
    vpl::witnesses(&world, &settings, eye, |witness| witnesses.push(witness));
    let mut pass = vpl::VplPass::new(&settings, 2, Independent, &witnesses);
    run(&mut pass, &world);
    pass.finish().map(|lights| lights.as_slice().to_vec())
}

#[test]
fn a_pass_has_the_same_lights_however_its_jobs_are_run() {
    let serial = |settings: &dyn Fn(vpl::Settings) -> vpl::Settings| {
        lights_of_a_pass(settings, |pass, world| work::finish(pass, world, &mut vpl::VplOutput::default())).unwrap()
    };
    let expected = serial(&|settings| settings);
    assert!(expected.len().abs_diff(150) <= 1, "{} lights kept", expected.len());
    for threads in [2, 5] {
        let threads = Threads::new(threads).unwrap();
        let run = |pass: &mut vpl::VplPass<'_, Independent>, world: &World<'_, Ball, Empty>| {
            threads::run(pass, world, &threads, &Control::default(), None, |_| {});
        };
        assert_eq!(lights_of_a_pass(|settings| settings, run).as_ref(), Ok(&expected));
    }
    // Every job in memory that held another's results, the last first.
    let backwards = |pass: &mut vpl::VplPass<'_, Independent>, world: &World<'_, Ball, Empty>| {
        while !Rounds::<World<'_, Ball, Empty>>::jobs(pass).is_empty() {
            let jobs = Rounds::<World<'_, Ball, Empty>>::jobs(pass);
            let end = jobs.end.min(jobs.start + 3);
            let outputs = (jobs.start..end).rev().map(|job| {
                let mut output = vpl::VplOutput::default();
                pass.run((job + 1).min(jobs.end - 1), world, &mut output);
                pass.run(job, world, &mut output);
                output
            });
            let outputs: Vec<_> = outputs.collect();
            for output in outputs.iter().rev() {
                Rounds::<World<'_, Ball, Empty>>::accept(pass, output);
            }
        }
    };
    assert_eq!(lights_of_a_pass(|settings| settings, backwards), Ok(expected.clone()));
    assert_ne!(serial(&|settings| vpl::Settings { seed: 1, ..settings }), expected);
}

#[test]
fn lights_that_are_kept_shine_for_those_that_are_not() {
    let flux = |lights: &[VirtualLight]| lights.iter().map(|light| f64::from(light.flux.mean())).sum::<f64>();
    let of = |candidates: u32, seed: u64| {
        let change = |settings| vpl::Settings { candidates, seed, ..settings };
        flux(
            &lights_of_a_pass(change, |pass, world| work::finish(pass, world, &mut vpl::VplOutput::default())).unwrap(),
        )
    };
    // Of the same paths: their seed is the same.
    let (mut sum, mut squares) = (0.0, 0.0);
    const RUNS: u32 = 200;
    for seed in 0..u64::from(RUNS) {
        let ratio = of(16, seed) / of(1, seed);
        (sum, squares) = (sum + ratio, squares + ratio * ratio);
    }
    let mean = sum / f64::from(RUNS);
    let error = ((squares / f64::from(RUNS) - mean * mean) / f64::from(RUNS)).sqrt();
    assert!((mean - 1.0).abs() < 4.0 * error && error < 0.02, "{mean} ± {error}");
}

#[test]
fn a_pass_that_is_stopped_keeps_all_light() {
    let part = |jobs: u32| {
        lights_of_a_pass(
            |settings| settings,
            |pass, world| {
                for _ in 0..jobs {
                    work::step(pass, world, &mut vpl::VplOutput::default());
                }
            },
        )
        .unwrap()
    };
    let all = |paths: u32| {
        let change = |settings| vpl::Settings { paths, candidates: 1, ..settings };
        lights_of_a_pass(change, |pass, world| work::finish(pass, world, &mut vpl::VplOutput::default())).unwrap()
    };
    // While paths are followed: those so far. A job is a part in 128 of the 400, rounded down.
    assert_eq!(part(30), all(30 * 3));
    // While lights are weighed: all of them, sorted before they were mixed.
    let key = |light: &VirtualLight| [light.position.to_array(), light.flux.0].map(|numbers| numbers.map(f32::to_bits));
    let [mut some, mut every] = [part(400_u32.div_ceil(3) + 2), all(400)];
    some.sort_by_key(key);
    every.sort_by_key(key);
    assert_eq!(some, every);
}

#[test]
fn what_a_pass_cannot_do_is_an_error() {
    let finish = |settings: &dyn Fn(vpl::Settings) -> vpl::Settings| {
        lights_of_a_pass(settings, |pass, world| work::finish(pass, world, &mut vpl::VplOutput::default()))
    };
    assert_eq!(finish(&|settings| vpl::Settings { lights: 0, ..settings }), Err(vpl::VplPassError::Settings));
    assert_eq!(finish(&|settings| vpl::Settings { points: 0, ..settings }), Err(vpl::VplPassError::Settings));
    let glowing = Homogeneous::new(Spectrum::ONE, Spectrum::ONE, Phase::ISOTROPIC)
        .and_then(|fog| fog.with_emission(Spectrum::ONE))
        .unwrap();
    let world = World { medium: &glowing, scene: &Empty, lights: (&[]).into() };
    let settings = vpl::Settings::for_outline(&Outline::of(&world, BOUNDS));
    let mut pass = vpl::VplPass::new(&settings, 0, Independent, &[]);
    work::finish(&mut pass, &world, &mut vpl::VplOutput::default());
    assert_eq!(pass.finish().map(|lights| lights.len()), Err(vpl::VplPassError::Glowing));
}

#[test]
fn a_pass_in_lent_memory_has_the_same_lights_or_is_an_error() {
    let ball = ball();
    let lamps = [Light::Point(PointLight::from_flux(Vec3::Z * 0.2, Spectrum::ONE).unwrap())];
    let world = World { medium: &ball, scene: &Empty, lights: (&lamps).into() };
    let settings = vpl::Settings { lights: 50, paths: 100, ..vpl::Settings::for_outline(&Outline::of(&world, BOUNDS)) };
    let properties = ball.properties(Vec3::ZERO);
    let witnesses = [Receiver::in_medium(Vec3::X * 0.3, Vec3::NEG_Z, &properties).unwrap()];
    let grown = || {
        let mut pass = vpl::VplPass::new(&settings, 0, Independent, &witnesses);
        work::finish(&mut pass, &world, &mut vpl::VplOutput::default());
        pass.finish().unwrap().as_slice().to_vec()
    };
    let all = {
        let mut pass = vpl::VplPass::new(&settings, 0, Independent, &[]);
        work::finish(&mut pass, &world, &mut vpl::VplOutput::default());
        pass.finish().unwrap().len()
    };
    assert!(all > 50);
    let lent = |lights: usize, others: usize| {
        let dark = VirtualLight::in_medium(Vec3::ZERO, Vec3::Z, Spectrum::ZERO, 1, &Phase::ISOTROPIC);
        let (mut lights, mut order) = (vec![dark; lights], vec![vpl::CurvePlace::default(); others]);
        let (mut importance, mut seen) = (vec![0.0; others], vec![0.0; others]);
        let (mut of_job, mut seen_by_job) = (vec![dark; all], [0.0; 512]);
        let memory = vpl::VplMemory::new(&mut lights[..], &mut order[..], &mut importance[..], &mut seen[..]);
        let mut pass = vpl::VplPass::new_in(memory, &settings, 0, Independent, &witnesses);
        work::finish(&mut pass, &world, &mut vpl::VplOutput::new(&mut of_job[..], &mut seen_by_job[..]));
        pass.finish().map(|lights| lights.as_slice().to_vec())
    };
    assert_eq!(lent(all, all), Ok(grown()));
    assert_eq!(lent(all - 1, all), Err(vpl::VplPassError::TooMany));
    assert_eq!(lent(all, all - 1), Err(vpl::VplPassError::TooMany));
}
