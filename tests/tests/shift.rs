//! How the vertices of walks move with their start: closed forms, and gradients of light in a closed room and in fog with open faces.

use fogbow::cache::Estimator;
use fogbow::host::{Empty, Hit, Medium, Scene};
use fogbow::light::{Light, PointLight, QuadLight};
use fogbow::math::{Bounds, Ray, Vec2, Vec3};
use fogbow::medium::{Homogeneous, Placed, Region};
use fogbow::multiple_scatter::{self, Shift, Walk, Weight};
use fogbow::path;
use fogbow::phase::{Lobe, Phase};
use fogbow::sampling::{Generator, warp::uniform_sphere};
use fogbow::single_scatter::{Sums, Towards};
use fogbow::spectrum::Spectrum;
use fogbow::surface::Surface;
use fogbow::transmittance::thickness::{Marching, Steps, optical_thickness, optical_thickness_with_gradients};
use fogbow::world::World;
use fogbow_tests::analytic::mean_and_error;
use fogbow_tests::hosts::{Analytic, Field, Room};
use fogbow_tests::tolerance;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

/// As good as exact for the smooth fields used here.
const EXACT: Marching = Marching { steps: Steps::Gauss(4), offset: 0.0 };

fn config(cases: u32, seed: u64) -> ProptestConfig {
    ProptestConfig {
        cases,
        // Kinks of the shift are set aside.
        max_global_rejects: 4 * cases,
        failure_persistence: None,
        rng_seed: RngSeed::Fixed(seed),
        ..ProptestConfig::default()
    }
}

fn direction() -> impl Strategy<Value = Vec3> {
    (0.0..1.0_f32, 0.0..1.0_f32).prop_map(|(a, b)| uniform_sphere(Vec2::new(a, b)))
}

/// What ends the segments from the origin: a plane in front of it, or nothing, and a sphere.
#[derive(Debug, Clone, Copy)]
struct Around {
    /// Normal of the plane and its distance from the origin.
    plane: Option<(Vec3, f32)>,
    reach: f32,
}

impl Around {
    /// The shift of a vertex, its segment starting at the origin.
    fn shift(&self, vertex: Vec3) -> Shift {
        let ray = Ray::between(Vec3::ZERO, vertex);
        let wall = self.plane.and_then(|(normal, away)| {
            let cosine = -normal.dot(ray.direction);
            (cosine > 0.0).then_some((away / cosine, normal))
        });
        Shift::new(&Ray { length: f32::INFINITY, ..ray }, wall, self.reach, ray.length)
    }

    /// How `Shift::share` changes with the vertex.
    fn slope(&self, vertex: Vec3, h: f32) -> Vec3 {
        let along =
            |axis: Vec3| (self.shift(vertex + axis * h).share - self.shift(vertex - axis * h).share) / (2.0 * h);
        Vec3::new(along(Vec3::X), along(Vec3::Y), along(Vec3::Z))
    }

    /// Whether all that differences look at ends on the same thing.
    fn is_smooth(&self, vertex: Vec3, h: f32) -> bool {
        let ray = Ray::between(Vec3::ZERO, vertex);
        let s = self.plane.map_or(f32::INFINITY, |(normal, away)| {
            let cosine = -normal.dot(ray.direction);
            if cosine > 0.0 { away / cosine } else { f32::INFINITY }
        });
        let near = |x: f32| (x - self.reach).abs() < 8.0 * h * (1.0 + s.min(100.0)).powi(2);
        let grazing = self.plane.is_some_and(|(normal, _)| normal.dot(ray.direction).abs() < 0.1);
        !(near(s) || near(ray.length) || ray.length > 0.97 * s || ray.length < 0.1 || grazing)
    }
}

/// A wall at a distance, or none; and a reach that matters sometimes.
fn around() -> impl Strategy<Value = Around> {
    let plane = prop::option::of((direction(), 0.3..2.0_f32));
    let reach = prop_oneof![Just(f32::INFINITY), 0.3..3.0_f32];
    (plane, reach).prop_map(|(plane, reach)| Around { plane, reach })
}

/// `V'/V · r²/r'²` where the start moves by `delta`, from the finite change of the share of the vertex.
fn spread(vertex: Vec3, share: f32, slope: Vec3, delta: Vec3) -> f64 {
    let moved = vertex.as_dvec3() + delta.as_dvec3() * (f64::from(share) - 1.0);
    // det(1 + δ ∇φᵀ)
    let volume = 1.0 + slope.as_dvec3().dot(delta.as_dvec3());
    volume * vertex.as_dvec3().length_squared() / moved.length_squared()
}

proptest! {
    #![proptest_config(config(2000, 1))]

    /// The Jacobian of `y ↦ y + φ(y) δ` over `r²`, and the turn of its direction, against differences.
    #[test]
    fn volumes_and_directions_change_as_a_shift_says(around in around(), towards in direction(), t in 0.1..4.0_f32) {
        const H: f32 = 4e-3;
        let vertex = towards * t;
        prop_assume!(around.is_smooth(vertex, H));
        let shift = around.shift(vertex);
        prop_assert!((0.0..=1.0).contains(&shift.share));
        if around.plane.is_none() && around.reach == f32::INFINITY {
            prop_assert_eq!(shift, Shift::TRANSLATION);
        }
        let slope = around.slope(vertex, H);
        for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
            let step = axis * 1e-3;
            let jacobian = |delta| spread(vertex, shift.share, slope, delta);
            let change = (jacobian(step) - jacobian(-step)) / 2e-3;
            let expected = f64::from(shift.spread.dot(axis));
            let scale = f64::from(shift.spread.length()) + 1.0 / f64::from(t);
            prop_assert!((change - expected).abs() < 2e-3 * scale, "{shift:?}, {axis}: {change} instead of {expected}");
            let moved = |delta: Vec3| (vertex + delta * (shift.share - 1.0)).as_dvec3().normalize();
            let turned = (moved(step) - moved(-step)) / 2e-3;
            let across = (axis - towards * axis.dot(towards)).as_dvec3();
            prop_assert!((turned + across * f64::from(shift.turn)).length() < 1e-3 / f64::from(t), "{shift:?}: {turned}");
        }
    }

    /// Vertices never cross what they end on, and stay beyond the reach.
    #[test]
    fn vertices_stay_where_their_segments_end(around in around(), towards in direction(), t in 0.01..8.0_f32) {
        let shift = around.shift(towards * t);
        let end = around.plane.map_or(f32::INFINITY, |(normal, away)| {
            let cosine = -normal.dot(towards);
            if cosine > 0.0 { away / cosine } else { f32::INFINITY }
        });
        let s = end.min(around.reach);
        let expected = if s == f32::INFINITY { 1.0 } else { (1.0 - t / s).max(0.0) };
        prop_assert!((shift.share - expected).abs() < 1e-5 * (1.0 + t / s), "{shift:?}");
        prop_assert!(shift.turn * t <= 1.0 + 1e-5, "no direction turns more than with its vertex at rest: {shift:?}");
    }

    /// Transmittance, scattering and geometry of a segment both ends of which move, against differences.
    #[test]
    fn weights_of_moved_segments_agree_with_differences(
        around in around(), towards in direction(), t in 0.2..2.5_f32,
        k in 0.5..2.0_f32, centre in direction(), width in 0.7..1.5_f32, before in 0.2..1.0_f32,
    ) {
        const H: f32 = 4e-3;
        let vertex = towards * t;
        prop_assume!(around.is_smooth(vertex, H));
        let medium = Analytic {
            tint: Spectrum::new(1.0, 0.6, 0.3),
            albedo: Spectrum::new(0.9, 0.7, 0.5),
            ..Analytic::grey(Field::Gaussian { a: 0.2, k, c: centre, s: width }, 1.0)
        };
        let (shift, slope) = (around.shift(vertex), around.slope(vertex, H));
        // Of a walk whose start has moved by 1, this segment's start by `before`.
        let weight = Weight { moved: before, ..Weight::ONE };
        let ray = Ray::between(Vec3::ZERO, vertex);
        let thickness = optical_thickness_with_gradients(&ray, &medium, EXACT);
        let (through, kappa) = (thickness.value.transmitted(), Spectrum::new(0.5, 1.0, 2.0));
        let next = medium.gradients(vertex).scattering;
        let advanced =
            weight.advance_by(&shift, kappa, through, &thickness, medium.properties(vertex).scattering, &next);
        prop_assert!((advanced.moved - before * shift.share).abs() < 1e-6);
        prop_assert!((advanced.last_turn - before * shift.turn).abs() <= 1e-6 * shift.turn);
        prop_assert_eq!(advanced.turn, Some(shift.turn));
        let f = |delta: Vec3| {
            let delta = delta * before;
            let (start, end) = (delta, vertex + delta * shift.share);
            let through = optical_thickness(&Ray::between(start, end), &medium, EXACT).transmitted();
            let value = kappa * through * medium.properties(end).scattering;
            let spread = spread(vertex, shift.share, slope, delta);
            [0, 1, 2].map(|c| f64::from(value[c]) * spread)
        };
        for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
            let (above, below) = (f(axis * 0.01), f(-axis * 0.01));
            for c in 0..3 {
                let change = (above[c] - below[c]) / 0.02;
                let got = f64::from(advanced.gradient.channel(c).dot(axis));
                let scale = f64::from(advanced.value[c]) * (1.0 + 1.0 / f64::from(t).powi(2) + f64::from(shift.spread.length()));
                prop_assert!((got - change).abs() < 2e-3 * scale, "{shift:?}, {axis}: {got} instead of {change}");
            }
        }
    }
}

/// With nothing in reach, the whole path is translated.
#[test]
fn a_shift_by_translation_is_an_advance() {
    let medium = Analytic::grey(Field::Exponential { a: 0.8, b: Vec3::new(0.3, -0.2, 0.5) }, 0.9);
    let ray = Ray::between(Vec3::ZERO, Vec3::new(0.4, 0.7, -0.3));
    let thickness = optical_thickness_with_gradients(&ray, &medium, EXACT);
    let at = ray.at(ray.length);
    let (scattering, slope) = (medium.properties(at).scattering, medium.gradients(at).scattering);
    let through = thickness.value.transmitted();
    let plain = Weight::ONE.advance(Spectrum::ONE, through, &thickness.gradient_joint, scattering, &slope);
    let moved = Weight::ONE.advance_by(&Shift::TRANSLATION, Spectrum::ONE, through, &thickness, scattering, &slope);
    assert_eq!((plain.value, plain.gradient, plain.moved), (moved.value, moved.gradient, moved.moved));
}

/// Walls of a room of 2 m, with fog between them, and the surface of a [`panel`].
struct Lit {
    room: Room,
    has_panel: bool,
}

impl Scene for Lit {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let wall = self.room.closest_hit(ray);
        let distance = (0.99 - ray.origin.y) / ray.direction.y;
        let at = ray.at(distance);
        let is_met = self.has_panel && distance > 1e-5 && at.x.abs() <= 0.3 && at.z.abs() <= 0.3;
        if !is_met || distance >= wall.map_or(ray.length, |wall| wall.distance) {
            return wall;
        }
        Some(Hit { distance, normal: Vec3::NEG_Y, shading: Vec3::NEG_Y, surface: Surface::BLACK, light: Some(0) })
    }
}

fn room(reflectance: f32, light: &Light<'_>) -> Lit {
    let bounds = Bounds { min: Vec3::splat(-1.0), max: Vec3::ONE };
    let room = Room { bounds, surface: Surface::Lambert { reflectance: Spectrum::splat(reflectance) } };
    Lit { room, has_panel: matches!(light, Light::Quad(_)) }
}

fn fog(phase: impl Into<Phase>) -> Homogeneous {
    Homogeneous::new(Spectrum::splat(0.1), Spectrum::splat(1.2), phase).unwrap()
}

fn bulb() -> Light<'static> {
    Light::Point(PointLight::new(Vec3::new(0.3, 0.5, 0.2), Spectrum::ONE).unwrap())
}

fn panel() -> Light<'static> {
    let (corner, u, v) = (Vec3::new(-0.3, 0.99, -0.3), Vec3::X * 0.6, Vec3::Z * 0.6);
    Light::Quad(QuadLight::new(corner, u, v, Spectrum::ONE).unwrap())
}

/// By walks of up to so many vertices.
fn estimator<'a, M, S>(world: World<'a, M, S>, max_vertices: u32) -> Estimator<'a, M, S> {
    Estimator {
        world,
        surfaces: None,
        photons: None,
        walk: multiple_scatter::Settings { max_vertices, ..multiple_scatter::Settings::new(Steps::Gauss(1)) },
        // Walls are lit by lamps alone.
        paths: path::Settings { max_scatterings: 1, ..path::Settings::default() },
        light_samples: 1,
        finest: 1e-6,
    }
}

/// What is compared: a value at a point with its gradient, in one channel.
type Seen = (f64, Vec3);

fn first(sums: &Sums) -> Seen {
    (f64::from(sums.value[0]), sums.gradient.channel(0))
}

/// Central differences over a stretch against the gradient's mean along it (three points of Gauss, so that the
/// stretch may be long), in 24 pairs of estimates with different random numbers.
#[track_caller]
fn check(point: Vec3, axis: Vec3, what: &str, light: impl Fn(Vec3, &mut Generator) -> Seen) {
    const H: f32 = 0.1;
    const GAUSS: [(f32, f64); 3] = [(-0.774_596_7, 5.0 / 18.0), (0.0, 8.0 / 18.0), (0.774_596_7, 5.0 / 18.0)];
    let at = |x: f32, seed: u64| light(point + axis * (H * x), &mut Generator::new(seed));
    let (mut slopes, mut apart) = (vec![], vec![]);
    for seed in 0..24 {
        let slope: f64 = GAUSS.iter().map(|&(x, w)| w * f64::from(at(x, seed).1.dot(axis))).sum();
        slopes.push(slope);
        apart.push((at(1.0, seed).0 - at(-1.0, seed).0) / f64::from(2.0 * H) - slope);
    }
    let ((slope, _), (apart, error)) = (mean_and_error(&slopes), mean_and_error(&apart));
    let said = format!("{what} at {point} along {axis}: gradient {slope:.6}, differences {apart:+.6} ± {error:.6}");
    println!("{said}");
    assert!(apart.abs() < tolerance::STANDARD_ERRORS * error, "{said}");
    // Errors of two fifths are found; translation misses by more, or has no end of noise.
    assert!(error < 0.1 * slope.abs(), "{said}: no evidence");
}

/// Beside a wall and in the middle, away from the walls and towards the lamps.
const PLACES: [(Vec3, Vec3); 2] =
    [(Vec3::new(0.84, -0.2, 0.1), Vec3::new(-0.6, 0.8, 0.0)), (Vec3::new(-0.2, -0.1, 0.1), Vec3::new(0.6, 0.8, 0.0))];

/// `sample` towards one direction, by walks of up to so many vertices.
fn check_samples(lobe: Lobe, max_vertices: u32, paths: u32) {
    let (medium, phase) = (fog(lobe), Phase::from(lobe));
    let towards = Towards { to_eye: Vec3::new(0.36, 0.48, 0.8), phase: &phase };
    for light in [bulb(), panel()] {
        let (scene, lights) = (room(0.5, &light), [light]);
        let make = estimator(World { medium: &medium, scene: &scene, lights: (&lights).into() }, max_vertices);
        let walk = Walk { world: make.world, settings: make.walk };
        for (point, axis) in PLACES {
            check(point, axis, &format!("{lobe:?}, {lights:?}"), |point, rng| {
                let mut child = Generator::child(rng);
                let outgoing = |ray: &Ray, hit: &Hit| make.outgoing(ray, hit, &mut child);
                first(&multiple_scatter::sample(point, &towards, &walk, outgoing, paths, rng))
            });
        }
    }
}

/// `Estimator::multiple`, as [`check_samples`].
fn check_estimates(lobe: Lobe, max_vertices: u32, paths: u32) {
    let (medium, phase) = (fog(lobe), Phase::from(lobe));
    for light in [bulb(), panel()] {
        let (scene, lights) = (room(0.5, &light), [light]);
        let make = estimator(World { medium: &medium, scene: &scene, lights: (&lights).into() }, max_vertices);
        for (point, axis) in PLACES {
            check(point, axis, &format!("{lobe:?}, {lights:?}"), |point, rng| {
                first(&make.multiple(point, &phase, paths, &mut [], rng))
            });
        }
    }
}

/// `Estimator::irradiance` along a black wall towards its edge with another, and in its middle: light scattered in
/// the fog alone.
fn check_irradiance(lobe: Lobe, max_vertices: u32, paths: u32) {
    let medium = fog(lobe);
    for light in [bulb(), panel()] {
        let (scene, lights) = (room(0.0, &light), [light]);
        let make = estimator(World { medium: &medium, scene: &scene, lights: (&lights).into() }, max_vertices);
        for point in [Vec3::new(1.0, 0.85, 0.1), Vec3::new(1.0, -0.1, 0.1)] {
            check(point, Vec3::Y, &format!("{lobe:?}, {lights:?}"), |point, rng| {
                first(&make.irradiance(point, Vec3::NEG_X, paths, rng).0)
            });
        }
    }
}

/// Fog with open faces under an even sky, near one of them and deep inside, away from it: light is scattered more often inside, and no wall stands behind.
fn check_open_fog(lobe: Lobe, max_vertices: u32, paths: u32) {
    let cube = Region::bounds(Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE }).unwrap();
    let (medium, phase) = (Placed::new(fog(lobe), cube), Phase::from(lobe));
    let lights = [Light::Constant(Spectrum::ONE)];
    let world = World { medium: &medium, scene: &Empty, lights: (&lights).into() };
    let make = estimator(world, max_vertices);
    for point in [Vec3::new(0.84, -0.2, 0.1), Vec3::new(0.5, -0.1, 0.1)] {
        check(point, Vec3::NEG_X, &format!("open fog, {lobe:?}"), |point, rng| {
            first(&make.multiple(point, &phase, paths, &mut [], rng))
        });
    }
}

const FORWARDS: Lobe = Lobe::HenyeyGreenstein { g: 0.6 };

#[test]
fn light_scattered_in_a_closed_room_changes_as_its_gradient_says() {
    check_samples(Lobe::Isotropic, 64, 2048);
}

/// Scattered forwards, twice: walks that end at the first vertex, as where caches know the rest.
#[test]
fn light_scattered_forwards_in_a_closed_room_changes_as_its_gradient_says() {
    check_samples(FORWARDS, 1, 8192);
}

#[test]
fn estimates_of_records_in_a_closed_room_change_as_their_gradients_say() {
    check_estimates(Lobe::Isotropic, 64, 2048);
}

#[test]
fn estimates_of_records_of_forward_fog_in_a_closed_room_change_as_their_gradients_say() {
    check_estimates(FORWARDS, 1, 3072);
}

#[test]
fn irradiance_beside_an_edge_changes_as_its_gradient_says() {
    check_irradiance(Lobe::Isotropic, 64, 4096);
}

#[test]
fn irradiance_of_forward_fog_beside_an_edge_changes_as_its_gradient_says() {
    check_irradiance(FORWARDS, 1, 4096);
}

// Where a walk goes on, the phase function changes with the directions before and after it.

#[test]
fn light_scattered_forwards_often_changes_as_its_gradient_says() {
    check_samples(FORWARDS, 3, 8192);
}

#[test]
fn estimates_of_light_scattered_forwards_often_change_as_their_gradients_say() {
    check_estimates(FORWARDS, 64, 4096);
}

#[test]
fn irradiance_of_light_scattered_forwards_often_changes_as_its_gradient_says() {
    check_irradiance(FORWARDS, 64, 4096);
}

#[test]
fn estimates_of_records_at_open_faces_of_fog_change_as_their_gradients_say() {
    check_open_fog(Lobe::Isotropic, 64, 4096);
    check_open_fog(FORWARDS, 64, 8192);
}
