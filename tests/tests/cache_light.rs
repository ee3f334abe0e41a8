//! What the radiance cache is filled with, where the light is known.

use fogbow::cache::{
    Basis, Cache, Caches, Estimator, Extrapolation, Looks, PhotonEffort, PhotonGrid, RaySettings, Reader, Reading,
    Record, VolumeCache, clearance, radiance,
};
use fogbow::host::{Empty, Hit, Medium, Scene};
use fogbow::light::{EnvironmentMap, Light, PointLight, QuadLight, SphereLight, Sun};
use fogbow::math::{Bounds, Mat3, Ray, Vec2, Vec3, float::PI};
use fogbow::medium::{Homogeneous, Placed, Region};
use fogbow::multiple_scatter;
use fogbow::path;
use fogbow::phase::{Lobe, Phase};
use fogbow::sampling::{Generator, uniform2, warp};
use fogbow::sh::{self, Coefficient};
use fogbow::single_scatter::Sums;
use fogbow::spectrum::{Gradient, Spectrum};
use fogbow::surface::{Distribution, Plastic, Principled, RoughPlastic, Surface};
use fogbow::transmittance::thickness::Steps;
use fogbow::world::World;
use fogbow_tests::analytic::INFINITE_MEDIUM_MULTIPLE;
use fogbow_tests::estimate::estimate;
use fogbow_tests::hosts::{Ball, Complaining};

fn estimator<'a, M: Medium, S: Scene>(medium: &'a M, scene: &'a S, lights: &'a [Light<'a>]) -> Estimator<'a, M, S> {
    Estimator {
        world: World { medium, scene, lights: lights.into() },
        surfaces: None,
        photons: None,
        walk: multiple_scatter::Settings::new(Steps::Gauss(8)),
        paths: path::Settings::default(),
        light_samples: 4,
        finest: 1e-6,
    }
}

#[test]
fn the_nearest_surface_is_found_within_a_few_degrees() {
    let room = Ball { centre: Vec3::X, radius: 2.0, surface: Surface::Lambert { reflectance: Spectrum::ONE } };
    for (from_centre, nearest) in [(0.0, 2.0), (1.0, 1.0), (1.9, 0.1)] {
        for axis in [Vec3::X, Vec3::NEG_Z, Vec3::new(0.48, 0.6, 0.64)] {
            let found = clearance(Vec3::X + axis * from_centre, None, &room);
            // The wall seen at an angle is farther by less than a secant; 16 degrees allow 4 %.
            assert!(found > nearest * 0.999 && found < nearest * 1.04, "{found} at {from_centre} along {axis}");
        }
    }
    // From its wall a round room is seen along chords of 2 R cos(theta), and no direction with a cosine below 0.1
    // is looked in; the next of 96 has one below 0.15.
    let floor = clearance(Vec3::X + Vec3::NEG_Y * 2.0, Some(Vec3::Y), &room);
    assert!((0.4..0.6).contains(&floor), "{floor}");
    let outside = clearance(Vec3::X + Vec3::Y * 3.0, Some(Vec3::Y), &room);
    assert_eq!(outside, f32::INFINITY, "nothing above");
}

fn fog(absorption: f32, scattering: f32, phase: impl Into<Phase>) -> Homogeneous {
    Homogeneous::new(Spectrum::splat(absorption), Spectrum::splat(scattering), phase).unwrap()
}

/// The mean over directions and its value in one direction.
fn expanded(degree: usize, to_eye: Vec3, estimate: impl FnOnce(&mut [Coefficient]) -> Sums) -> (Sums, Spectrum) {
    let mut higher = vec![Coefficient::ZERO; sh::coefficient_count(degree) - 1];
    let sums = estimate(&mut higher);
    let mut y = vec![0.0; sh::coefficient_count(degree)];
    sh::evaluate(to_eye, degree, &mut y);
    let towards = higher.iter().zip(&y[1..]).fold(sums.value, |sum, (c, y)| sum + c.value * *y);
    (sums, towards)
}

const SKY: [f64; 3] = [1.0, 2.0, 3.0];

fn sky() -> [Light<'static>; 1] {
    [Light::Constant(Spectrum::new(1.0, 2.0, 3.0))]
}

/// A ball of fog that absorbs nothing, under a sky of radiance 1, 2, 3: scattered light is as bright as the sky in
/// all directions, whatever was scattered how often.
#[test]
fn light_in_a_furnace_is_as_bright_as_the_sky() {
    let point = Vec3::new(0.2, -0.1, 0.4);
    for (phase, degree) in [(Phase::ISOTROPIC, 0), (Lobe::HenyeyGreenstein { g: 0.5 }.into(), 3)] {
        let medium = Placed::new(fog(0.0, 1.2, phase), Region::sphere(Vec3::ZERO, 1.0).unwrap());
        let medium = Complaining::new(medium);
        let lights = sky();
        let make = estimator(&medium, &Empty, &lights);
        let seen = estimate(1500, |rng| {
            let to_eye = warp::uniform_sphere(uniform2(rng));
            let (_, once) = expanded(degree, to_eye, |higher| make.surface(point, &phase, 4, higher, rng));
            let (_, multiple) = expanded(degree, to_eye, |higher| make.multiple(point, &phase, 16, higher, rng));
            once + multiple
        });
        seen.assert_is(SKY, 2e-5, &format!("{phase:?}"));
    }
}

/// A white ball in such fog is as bright as the sky, too.
#[test]
fn white_bodies_in_a_furnace_are_as_bright_as_the_sky() {
    let body = Ball { centre: Vec3::ZERO, radius: 0.5, surface: Surface::Lambert { reflectance: Spectrum::ONE } };
    let medium = {
        use fogbow::medium::{Placed, Region};
        Placed::new(fog(0.0, 0.8, Phase::ISOTROPIC), Region::sphere(Vec3::ZERO, 1.5).unwrap())
    };
    let lights = sky();
    let scene = Complaining::new(body);
    let make = estimator(&medium, &scene, &lights);
    // In the fog beside it: light from the sky, from the ball, and scattered light make up the sky.
    let beside = Vec3::new(0.0, 0.9, 0.0);
    let seen = estimate(3000, |rng| {
        let single = make.single(beside, &Phase::ISOTROPIC, &mut [], rng).value;
        let surface = make.surface(beside, &Phase::ISOTROPIC, 4, &mut [], rng).value;
        single + surface + make.multiple(beside, &Phase::ISOTROPIC, 4, &mut [], rng).value
    });
    seen.assert_is(SKY, 2e-4, "in the fog");
    // On it: irradiance from the sky, which counts as indirect.
    let (at, normal) = (Vec3::Y * 0.5, Vec3::Y);
    let hit = Hit { distance: 1.0, normal, shading: normal, surface: body.surface, light: None };
    let seen = estimate(3000, |rng| {
        let direct = make.direct(at, &hit, &mut Generator::child(rng));
        (direct + make.irradiance(at, normal, 4, rng).0.value) / PI
    });
    seen.assert_is(SKY, 2e-4, "on the ball");
}

/// Where nothing is cached, eye rays count the sky once, from surfaces and from fog: as bright as itself in a furnace,
/// and, of light scattered once, as bright as path tracing finds it.
#[test]
fn eye_rays_without_caches_count_the_sky_once() {
    use fogbow::medium::{Placed, Region};
    let body = Ball { centre: Vec3::ZERO, radius: 0.5, surface: Surface::Lambert { reflectance: Spectrum::ONE } };
    let medium = Placed::new(fog(0.0, 0.8, Phase::ISOTROPIC), Region::sphere(Vec3::ZERO, 1.5).unwrap());
    let lights = sky();
    // One ray meets the ball, one passes it.
    for origin in [Vec3::new(0.1, 0.2, 4.0), Vec3::new(0.9, 0.3, 4.0)] {
        let ray = Ray::new(origin, Vec3::NEG_Z);
        let make = estimator(&medium, &body, &lights);
        let eye = RaySettings { density: 8.0, connections: 4, lamp_parts: 1, lights_visible: true, indirect: true };
        let all = estimate(8000, |rng| radiance(&ray, &make, &Caches::default(), &eye, rng).total());
        all.assert_is(SKY, 2e-4, &format!("all light from {origin}"));

        let once = path::Settings { max_scatterings: 1, ..path::Settings::default() };
        let make = Estimator { paths: once, ..make };
        let eye = RaySettings { indirect: false, ..eye };
        let direct = estimate(20_000, |rng| radiance(&ray, &make, &Caches::default(), &eye, rng).total());
        let traced = estimate(200_000, |rng| path::radiance(&ray, &make.world, &once, rng).total());
        for c in 0..3 {
            let apart = (direct.mean[c] - traced.mean[c]).abs();
            let error = direct.error[c].hypot(traced.error[c]);
            assert!(apart < 4.0 * error && error < 0.01 * traced.mean[c], "{direct:?} instead of {traced:?}");
        }
    }
}

/// Black below the horizon, 2 m away in all directions.
struct Bowl;

impl Scene for Bowl {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        (ray.direction.y < 0.0).then_some(Hit {
            distance: 2.0,
            normal: -ray.direction,
            shading: -ray.direction,
            surface: Surface::BLACK,
            light: None,
        })
    }
    fn is_blocked(&self, ray: &Ray) -> bool {
        self.closest_hit(ray).is_some()
    }
}

/// An even sky has no gradient, but what stands before it moves: its light changes by 2 L/r at most.
#[test]
fn the_edges_of_a_sky_bound_radii() {
    let medium = fog(0.0, 0.0, Phase::ISOTROPIC);
    let lights = sky();
    let make = estimator(&medium, &Bowl, &lights);
    let sums = make.surface(Vec3::ZERO, &Phase::ISOTROPIC, 4096, &mut [], &mut Generator::new(3));
    assert!((sums.value - Spectrum::new(0.5, 1.0, 1.5)).0.iter().all(|c| c.abs() < 0.01), "{:?}", sums.value);
    assert_eq!(sums.gradient, Gradient::ZERO);
    let radius = fogbow::cache::valid_radius(&sums, 0.25).unwrap();
    assert!((radius - 0.25).abs() < 1e-4, "{radius} m: 0.25 of half of 2 m");
    // An open sky looks the same from everywhere.
    let make = estimator(&medium, &Empty, &lights);
    let sums = make.surface(Vec3::ZERO, &Phase::ISOTROPIC, 64, &mut [], &mut Generator::new(3));
    assert_eq!(fogbow::cache::valid_radius(&sums, 0.25), None);
}

#[test]
fn an_environment_is_a_sky_unless_it_holds_a_sun() {
    for (brightest, is_sky) in [(1.0, true), (6.0, true), (500.0, false)] {
        let mut texels = vec![Spectrum::ONE; 16 * 8];
        texels[40] = Spectrum::splat(brightest);
        let (mut weights, mut column) = (vec![0.0; texels.len()], vec![0.0; 8]);
        let map = EnvironmentMap::new(16, 8, &texels, &mut weights, &mut column, Mat3::IDENTITY).unwrap();
        let lights = [Light::Environment(&map), Light::Constant(Spectrum::ONE)];
        assert_eq!(lights[0].is_sky(), is_sky, "{brightest}");
        let seen = if is_sky { map.radiance(Vec3::Y) + Spectrum::ONE } else { Spectrum::ONE };
        assert_eq!(fogbow::light::sky(&lights, Vec3::Y), seen);
    }
    let sun = Sun::new(Vec3::Y, Spectrum::ONE).unwrap();
    assert!(!Light::Sun(sun).is_sky());
}

/// Inside a closed hollow ball without anything in it whose wall reflects half of what it gets, with a lamp in the
/// middle: direct irradiance E, indirect E ρ/(1 − ρ).
#[test]
fn irradiance_in_a_hollow_ball_is_a_geometric_series() {
    let wall =
        Ball { centre: Vec3::ZERO, radius: 2.0, surface: Surface::Lambert { reflectance: Spectrum::splat(0.5) } };
    let vacuum = fog(0.0, 0.0, Phase::ISOTROPIC);
    let intensity = Spectrum::new(4.0, 8.0, 12.0);
    let lights = [Light::Point(PointLight::new(Vec3::ZERO, intensity).unwrap())];
    let make = estimator(&vacuum, &wall, &lights);
    let (at, normal) = (Vec3::X * 2.0, Vec3::NEG_X);
    let hit = Hit { distance: 1.0, normal, shading: normal, surface: wall.surface, light: None };
    let truth = [1.0, 2.0, 3.0];
    estimate(200, |rng| make.direct(at, &hit, &mut Generator::child(rng))).assert_is(truth, 1e-5, "direct");
    estimate(3000, |rng| make.irradiance(at, normal, 4, rng).0.value).assert_is(truth, 1e-4, "indirect, by paths");
    // The same where a cache on the surfaces knows it already.
    let mut cache: fogbow::cache::SurfaceCache<'_> = Cache::growing(1);
    for k in 0..400 {
        let outward = warp::uniform_sphere(Vec2::new(k as f32 / 400.0, (k as f32 * 0.618_034).fract()));
        let record = Record {
            position: outward * 2.0,
            radius: 1.0,
            value: Spectrum::new(1.0, 2.0, 3.0),
            gradient: Gradient::ZERO,
        };
        let facing = fogbow::cache::Facing { normal: -outward, turn: Gradient::ZERO };
        cache.insert(record, &[facing]).unwrap();
    }
    cache.finish().unwrap();
    let make = Estimator { surfaces: Some((&cache, Reading::new(0.5))), ..make };
    // Every wall is equally bright: no noise at all but in the densities of directions.
    let seen = estimate(100, |rng| make.irradiance(at, normal, 64, rng).0.value);
    seen.assert_is(truth, 2e-3, "indirect, by the cache");
}

/// `L_s = p I e^(−σr)/r²`, with the exact phase function instead of an expansion cut off at degree 8.
#[test]
fn single_scattering_of_a_lamp_is_its_closed_form() {
    let lamp = Vec3::new(1.0, 0.5, -0.3);
    let lights = [Light::Point(PointLight::new(lamp, Spectrum::new(1.0, 2.0, 3.0)).unwrap())];
    let phase: Phase = Lobe::HenyeyGreenstein { g: 0.4 }.into();
    let medium = fog(0.3, 0.9, phase);
    let make = estimator(&medium, &Empty, &lights);
    let r = f64::from(lamp.length());
    let irradiance = (-1.2 * r).exp() / (r * r);
    for to_eye in [Vec3::Z, -lamp.normalize(), lamp.normalize()] {
        let (sums, towards) =
            expanded(8, to_eye, |higher| make.single(Vec3::ZERO, &phase, higher, &mut Generator::new(1)));
        let cosine = f64::from(-lamp.normalize().dot(to_eye));
        let g = 0.4_f64;
        let p = (1.0 - g * g) / (4.0 * std::f64::consts::PI * (1.0 + g * g - 2.0 * g * cosine).powf(1.5));
        let mean = irradiance / (4.0 * std::f64::consts::PI);
        for c in 0..3 {
            let scale = SKY[c];
            assert!((f64::from(sums.value[c]) / (mean * scale) - 1.0).abs() < 1e-5);
            // The rest of the series: Σ_{l>8} (2l+1) gˡ/4π.
            assert!((f64::from(towards[c]) - p * irradiance * scale).abs() < 0.02 * mean * scale, "{towards:?}");
        }
        // Towards the lamp by σ + 2/r.
        let slope = sums.gradient.channel(0);
        let expected = lamp.normalize() * (mean * (1.2 + 2.0 / r)) as f32;
        assert!((slope - expected).length() < 1e-4 * expected.length(), "{slope} instead of {expected}");
        // One lamp has no saddle points: both radii agree.
        let plain = fogbow::cache::log_gradient_radius(sums.value, &sums.gradient, 0.3);
        let radius = fogbow::cache::valid_radius(&sums, 0.3).unwrap();
        assert!((radius - plain).abs() < 1e-5 * plain && (f64::from(radius) * (1.2 + 2.0 / r) - 0.3).abs() < 1e-4);
    }
}

#[test]
fn multiple_scattering_in_an_endless_medium_is_that_of_the_transport_equation() {
    let lights = [Light::Point(PointLight::from_flux(Vec3::ZERO, Spectrum::ONE).unwrap())];
    let medium = fog(0.2, 0.8, Phase::ISOTROPIC);
    let make = estimator(&medium, &Empty, &lights);
    let truth = [INFINITE_MEDIUM_MULTIPLE; 3];
    let point = Vec3::new(1.5, 0.0, 0.0);
    estimate(3000, |rng| make.multiple(point, &Phase::ISOTROPIC, 16, &mut [], rng).value)
        .assert_is(truth, 2e-3, "by walks");
    // Walks that end in cells lit by photons tell it, too; a cell's light is a mean over its volume.
    let bounds = Bounds { min: Vec3::splat(-7.0), max: Vec3::splat(7.0) };
    let effort = PhotonEffort { bounds, cells: 48, degree: 2, paths: 1 << 16, flights: u64::MAX, enough: u32::MAX };
    let photons = PhotonGrid::lit(&make.world, &effort, &make.paths, 3);
    let make = Estimator { photons: Some(&photons), ..make };
    estimate(1000, |rng| make.multiple(point, &Phase::ISOTROPIC, 16, &mut [], rng).value).assert_is(
        truth,
        0.02,
        "by walks that end in cells",
    );
}

fn uniform_cache(value: Spectrum) -> VolumeCache<'static> {
    let mut cache: VolumeCache<'static> = Cache::growing(0);
    cache.insert(Record { position: Vec3::ZERO, radius: 1e3, value, gradient: Gradient::ZERO }, &[]).unwrap();
    cache.finish().unwrap();
    cache
}

/// With caches that hold the truth of a furnace, eye rays see the truth.
#[test]
fn eye_rays_see_what_the_caches_hold() {
    let scattering = 0.7;
    let medium = fog(0.3, scattering, Phase::ISOTROPIC);
    let body = Ball { centre: Vec3::ZERO, radius: 5.0, surface: Surface::BLACK };
    let lights: [Light<'_>; 0] = [];
    let make = estimator(&medium, &body, &lights);
    let (surface, multiple) =
        (uniform_cache(Spectrum::new(0.25, 0.5, 0.75)), uniform_cache(Spectrum::new(0.75, 1.5, 2.25)));
    let reading = Reading { extrapolation: Extrapolation::Constant, ..Reading::new(0.5) };
    let caches = Caches {
        surface: Some(Reader { cache: &surface, reading }),
        multiple: Some(Reader { cache: &multiple, reading }),
        ..Caches::default()
    };
    let eye = RaySettings { density: 8.0, connections: 4, lamp_parts: 1, lights_visible: true, indirect: true };
    let seen = estimate(4000, |rng| {
        let direction = warp::uniform_sphere(uniform2(rng));
        radiance(&Ray::new(Vec3::ZERO, direction), &make, &caches, &eye, rng).total()
    });
    // L (σₛ/σₜ) (1 − e^(−σₜ s))
    let share = f64::from(scattering) * (1.0 - (-5.0_f64).exp());
    seen.assert_is(SKY.map(|l| l * share), 1e-4, "a ball of even light");
}

/// Irradiance by the same random numbers at moved points, of light from surfaces alone and far from edges.
#[test]
fn gradients_of_irradiance_agree_with_differences() {
    let wall =
        Ball { centre: Vec3::ZERO, radius: 2.0, surface: Surface::Lambert { reflectance: Spectrum::splat(0.6) } };
    for (density, tolerance) in [(0.0, 0.004), (0.15, 0.004)] {
        let medium = fog(density, 0.0, Phase::ISOTROPIC);
        let lights = [Light::Point(PointLight::new(Vec3::new(0.3, 0.4, 1.2), Spectrum::ONE).unwrap())];
        let make = Estimator {
            paths: path::Settings { max_scatterings: 1, ..path::Settings::default() },
            ..estimator(&medium, &wall, &lights)
        };
        let (point, normal, h) = (Vec3::new(0.1, -0.2, 0.0), Vec3::Z, 0.05);
        let mean = |p: Vec3| {
            let (mut value, mut gradient) = (Spectrum::ZERO, Gradient::ZERO);
            for seed in 0..40 {
                let (sums, _) = make.irradiance(p, normal, 4096, &mut Generator::new(seed));
                value += sums.value / 40.0;
                gradient += sums.gradient * (1.0 / 40.0);
            }
            (value[0], gradient.channel(0))
        };
        let (value, gradient) = mean(point);
        for axis in [Vec3::X, Vec3::Y] {
            let difference = (mean(point + axis * h).0 - mean(point - axis * h).0) / (2.0 * h);
            let along = gradient.dot(axis);
            assert!(
                (along - difference).abs() < tolerance * value,
                "σ = {density}, {axis}: {along} instead of {difference} of {value}"
            );
        }
    }
}

/// The vector irradiance tells what a tilt of the surface changes.
#[test]
fn turns_of_the_normal_agree_with_differences() {
    let wall =
        Ball { centre: Vec3::ZERO, radius: 2.0, surface: Surface::Lambert { reflectance: Spectrum::splat(0.6) } };
    let medium = fog(0.05, 0.0, Phase::ISOTROPIC);
    let lights = [Light::Point(PointLight::new(Vec3::new(0.5, 0.8, 1.2), Spectrum::ONE).unwrap())];
    let make = Estimator {
        paths: path::Settings { max_scatterings: 1, ..path::Settings::default() },
        ..estimator(&medium, &wall, &lights)
    };
    let point = Vec3::new(0.1, -0.2, 0.0);
    let mean = |normal: Vec3| {
        let (mut value, mut turn) = (0.0, Vec3::ZERO);
        for seed in 0..40 {
            let (sums, facing) = make.irradiance(point, normal, 4096, &mut Generator::new(seed));
            value += sums.value[0] / 40.0;
            turn += facing.turn.channel(0) / 40.0;
        }
        (value, turn)
    };
    let (value, turn) = mean(Vec3::Z);
    for axis in [Vec3::X, Vec3::Y] {
        let tilted = (Vec3::Z + axis * 0.05).normalize();
        let back = (Vec3::Z - axis * 0.05).normalize();
        let difference = mean(tilted).0 - mean(back).0;
        let expected = turn.dot(tilted - back);
        assert!(
            (difference - expected).abs() < 0.0008 * value,
            "{axis}: {difference} instead of {expected} of {value}"
        );
    }
}

/// A black panel or ball in fog, which is a light.
struct Lamp(Light<'static>);

impl Scene for Lamp {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let (distance, normal) = match self.0 {
            Light::Quad(_) => {
                let distance = (LAMP.z - ray.origin.z) / ray.direction.z;
                let at = ray.at(distance) - LAMP;
                let is_met = at.x.abs() <= LAMP_SIZE && at.y.abs() <= LAMP_SIZE;
                (is_met && distance > 1e-5).then_some((distance, Vec3::NEG_Z))?
            }
            _ => {
                let hit = Ball { centre: LAMP, radius: LAMP_SIZE, surface: Surface::BLACK }.closest_hit(ray)?;
                (hit.distance, hit.normal)
            }
        };
        (distance < ray.length).then_some(Hit {
            distance,
            normal,
            shading: normal,
            surface: Surface::BLACK,
            light: Some(0),
        })
    }
}

const LAMP: Vec3 = Vec3::new(0.0, 0.0, 2.0);
const LAMP_SIZE: f32 = 0.5;

fn panel_and_ball() -> [Light<'static>; 2] {
    let side = 2.0 * LAMP_SIZE;
    let corner = LAMP - Vec3::new(LAMP_SIZE, LAMP_SIZE, 0.0);
    [
        Light::Quad(QuadLight::new(corner, side * Vec3::Y, side * Vec3::X, Spectrum::ONE).unwrap()),
        Light::Sphere(SphereLight::new(LAMP, LAMP_SIZE, Spectrum::ONE).unwrap()),
    ]
}

/// Walks that are scattered sharply meet lamps as well as connect to them; paths that are traced say how bright it is. Records
/// that are made for an eye say the same, and are less noisy.
#[test]
fn sharply_scattered_light_is_that_of_traced_paths_and_steadier_towards_an_eye() {
    let phase = Phase::from(Lobe::HenyeyGreenstein { g: 0.85 });
    let medium = fog(0.1, 0.9, phase);
    let (point, to_eye) = (Vec3::new(0.3, 0.2, 0.0), Vec3::new(0.1, 0.3, -1.0).normalize());
    let degree = 14;
    for lamp in panel_and_ball() {
        let (scene, lights) = (Lamp(lamp), [lamp]);
        let make = estimator(&medium, &scene, &lights);
        let traced = estimate(60_000, |rng| {
            let sample = phase.sample(to_eye, uniform2(rng));
            let seen = path::radiance(&Ray::new(point, sample.to_light), &make.world, &make.paths, rng);
            (seen.medium_single + seen.medium_multiple) * sample.weight
        });
        let walked = estimate(60_000, |rng| make.multiple_towards(point, to_eye, &phase, rng));
        let (mean, error) = (walked.mean[0] - traced.mean[0], walked.error[0].hypot(traced.error[0]));
        assert!(mean.abs() < 4.0 * error && error < 0.03 * traced.mean[0], "{lamp:?}: {walked:?} {traced:?}");
        let record = |eye: Option<Vec3>| {
            estimate(300, |rng| {
                let looks = Looks { to_eye: eye, ..Looks::from(64) };
                expanded(degree, to_eye, |higher| make.multiple(point, &phase, looks, higher, rng)).1
            })
        };
        let [aimed, even] = [Some(to_eye), None].map(record);
        for made in [&aimed, &even] {
            let (mean, error) = (made.mean[0] - walked.mean[0], made.error[0].hypot(walked.error[0]));
            // What an expansion of this degree leaves out.
            assert!(mean.abs() < 4.0 * error + 0.01 * walked.mean[0], "{lamp:?}: {made:?} {walked:?}");
        }
        assert!(aimed.error[0] < 0.8 * even.error[0], "{lamp:?}: {aimed:?} {even:?}");
    }
}

/// A record with a short expansion tells the light towards the eye that it was made for all the same, and that a little beside; from elsewhere it does not answer.
#[test]
fn records_of_low_degree_hold_the_light_towards_an_eye() {
    let phase = Phase::from(Lobe::HenyeyGreenstein { g: 0.85 });
    let medium = fog(0.1, 0.9, phase);
    let (point, to_eye) = (Vec3::new(0.3, 0.2, 0.0), Vec3::new(0.1, 0.3, -1.0).normalize());
    let beside = (to_eye + 0.1 * Vec3::X).normalize();
    let (degree, lobe) = (2, 2);
    let [lamp, _] = panel_and_ball();
    let (scene, lights) = (Lamp(lamp), [lamp]);
    let make = estimator(&medium, &scene, &lights);
    let read = |towards: Vec3, looks: u32, rng: &mut Generator| {
        let mut attached = vec![Coefficient::ZERO; sh::coefficient_count(degree) - 1 + lobe];
        let looks = Looks { to_eye: Some(to_eye), ..Looks::from(looks) };
        let sums = make.multiple(point, &phase, looks, &mut attached, rng);
        let mut cache: VolumeCache<'_> = Cache::growing(attached.len());
        let record = Record { position: point, radius: 0.1, value: sums.value, gradient: sums.gradient };
        cache.insert(record, &attached).unwrap();
        assert_eq!(cache.degree(), degree);
        cache.lookup(point, &Basis::new(towards, degree), &Reading::new(0.5))
    };
    assert!(read(-to_eye, 8, &mut Generator::new(1)).is_none());
    for towards in [to_eye, beside] {
        let walked = estimate(60_000, |rng| make.multiple_towards(point, towards, &phase, rng));
        let made = estimate(600, |rng| read(towards, 64, rng).unwrap());
        let (mean, error) = (made.mean[0] - walked.mean[0], made.error[0].hypot(walked.error[0]));
        // Beside the eye what bends is missing.
        let bent = if towards == to_eye { 0.0 } else { 0.03 };
        assert!(mean.abs() < 4.0 * error + bent * walked.mean[0], "{towards}: {made:?} {walked:?}");
        assert!(error < 0.02 * walked.mean[0], "{made:?} {walked:?}");
    }
}

/// A floor at height 0 and a wall at its side, of one kind, under a ball of light.
struct Corner(Surface);

const BALL: Ball = Ball { centre: Vec3::new(0.3, 1.5, -0.5), radius: 0.15, surface: Surface::BLACK };

impl Scene for Corner {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let plane = |origin: f32, direction: f32, normal: Vec3| {
            let distance = -origin / direction;
            let hit = Hit { distance, normal, shading: normal, surface: self.0, light: None };
            (distance > 0.0 && distance < ray.length).then_some(hit)
        };
        let floor = plane(ray.origin.y, ray.direction.y, Vec3::Y);
        let wall = plane(ray.origin.x + 1.0, ray.direction.x, Vec3::X);
        let ball = BALL.closest_hit(ray).map(|hit| Hit { light: Some(0), ..hit });
        [floor, wall, ball].into_iter().flatten().min_by(|a, b| a.distance.total_cmp(&b.distance))
    }
}

/// The diffuse bases of materials are looked up, and eye rays bring the rest: together as much as paths bring, with a sky and without.
#[test]
fn coated_surfaces_seen_by_eye_rays_are_as_bright_as_by_paths() {
    let (diffuse, white) = (Spectrum::new(0.7, 0.5, 0.2), Spectrum::ONE);
    let plastic = Plastic { eta: 1.5, diffuse, specular: white, nonlinear: true };
    let body = Principled { base_color: diffuse, roughness: 0.4, sheen: 0.5, clearcoat: 0.5, ..Principled::default() };
    let surfaces = [
        Surface::Phong { diffuse, specular: Spectrum::splat(0.2), exponent: 30.0 },
        Surface::Plastic(plastic),
        Surface::RoughPlastic(RoughPlastic::new(plastic, Distribution::Ggx, 0.2)),
        Surface::Principled(body),
    ];
    let medium = fog(0.0, 0.15, Phase::ISOTROPIC);
    let medium = Placed::new(medium, Region::sphere(Vec3::Y, 1.5).unwrap());
    let lamp = Light::Sphere(SphereLight::new(BALL.centre, BALL.radius, Spectrum::splat(20.0)).unwrap());
    let lights = [lamp, Light::Constant(Spectrum::new(0.3, 0.4, 0.5))];
    let ray = Ray::between(Vec3::new(0.9, 1.0, 1.2), Vec3::new(-0.2, 0.0, -0.3)).with_length(f32::INFINITY);
    for surface in surfaces {
        for lights in [&lights[..], &lights[..1]] {
            let scene = Corner(surface);
            let make = estimator(&medium, &scene, lights);
            let eye = RaySettings { density: 4.0, connections: 2, lamp_parts: 1, lights_visible: true, indirect: true };
            let seen = estimate(40_000, |rng| radiance(&ray, &make, &Caches::default(), &eye, rng).total());
            let traced = estimate(160_000, |rng| path::radiance(&ray, &make.world, &make.paths, rng).total());
            for c in 0..3 {
                let (apart, error) = (seen.mean[c] - traced.mean[c], seen.error[c].hypot(traced.error[c]));
                assert!(error < 0.01 * traced.mean[c], "too noisy to tell: {seen:?} {traced:?}");
                assert!(
                    apart.abs() < 4.0 * error,
                    "{surface:?}, {} lights: {seen:?} instead of {traced:?}",
                    lights.len()
                );
            }
        }
    }
}

/// A white floor at z = 0; half-way up to a lamp at z = 10 m a screen hides what lies beyond 1 cm to the right.
struct HalfHidden;

impl Scene for HalfHidden {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let distance = -ray.origin.z / ray.direction.z;
        let surface = Surface::Lambert { reflectance: Spectrum::ONE };
        let hit = Hit { distance, normal: Vec3::Z, shading: Vec3::Z, surface, light: None };
        (distance > 0.0 && distance < ray.length).then_some(hit)
    }
    fn is_blocked(&self, ray: &Ray) -> bool {
        let to_screen = (5.0 - ray.origin.z) / ray.direction.z;
        to_screen > 0.0 && to_screen < ray.length && ray.at(to_screen).x > 0.01
    }
}

/// Of a lamp 10 cm wide seven tenths are seen. Of its four parts, each looked at where the others are, two are seen, and two in four of ten cases: `V = 0.4 · 0.6/4` in place of
/// `0.7 · 0.3`.
#[test]
fn parts_of_a_lamp_are_looked_at_evenly() {
    let (medium, scene) = (fog(0.0, 0.0, Phase::ISOTROPIC), HalfHidden);
    let (corner, side) = (Vec3::new(-0.05, -0.05, 10.0), 0.1);
    let lights = [Light::Quad(QuadLight::new(corner, side * Vec3::Y, side * Vec3::X, Spectrum::ONE).unwrap())];
    let make = estimator(&medium, &scene, &lights);
    let ray = Ray::new(2.0 * Vec3::Z, Vec3::NEG_Z);
    let [whole, parts] = [1, 4].map(|lamp_parts| {
        let eye = RaySettings { lamp_parts, indirect: false, ..RaySettings::default() };
        estimate(40_000, |rng| radiance(&ray, &make, &Caches::default(), &eye, rng).surface_direct)
    });
    // E/π, E = L A/d² but for the lamp's extent.
    let truth = 0.7 * f64::from(side * side) / 100.0 / f64::from(PI);
    for seen in [whole, parts] {
        seen.assert_is([truth; 3], 1e-4, "light of a lamp half hidden");
    }
    let gain = (whole.error[0] / parts.error[0]).powi(2);
    assert!((gain / (0.7 * 0.3 / (0.4 * 0.6 / 4.0)) - 1.0).abs() < 0.05, "variance falls to 1/{gain}");
}
