//! What everybody does with a world: the same answer whoever asks.

use fogbow::cache::{Caches, Estimator, Place, RaySettings, clearance, places, radiance};
use fogbow::host::{Empty, Hit, Medium, Scene};
use fogbow::light::{Light, PointLight, QuadLight, Sun};
use fogbow::math::{Bounds, Ray, Vec3};
use fogbow::medium::{Homogeneous, Placed, Region};
use fogbow::multiple_scatter;
use fogbow::path::{self, Settings};
use fogbow::phase::Phase;
use fogbow::photon::{self, Event};
use fogbow::sampling::Generator;
use fogbow::spectrum::Spectrum;
use fogbow::surface::Surface;
use fogbow::transmittance::thickness::Steps;
use fogbow::vpl;
use fogbow::world::{MAX_INTERFACES, World, nearest_surface};

/// A grey floor at z = 0, and over it as many null interfaces as wanted, z between 1 and 2, tilted a little.
struct Sheets(u32);

impl Scene for Sheets {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let floor = (0.0, Vec3::Z, Surface::Lambert { reflectance: Spectrum::splat(0.5) });
        let tilted = Vec3::new(0.1, 0.0, 1.0).normalize();
        let sheet = |k: u32| ((1.0 + (k as f32 + 0.5) / self.0 as f32) * tilted.z, tilted, Surface::Null);
        let hits = core::iter::once(floor).chain((0..self.0).map(sheet)).filter_map(|(height, normal, surface)| {
            let distance = (height - ray.origin.dot(normal)) / ray.direction.dot(normal);
            (distance > 0.0 && distance < ray.length).then_some(Hit {
                distance,
                normal,
                shading: normal,
                surface,
                light: None,
            })
        });
        hits.min_by(|a, b| a.distance.total_cmp(&b.distance))
    }
}

/// More than any ray was once allowed to pass.
const MANY: u32 = 100;

/// Each of a hundred interfaces moves the rest of a ray by 64 roundings of its coordinates, 3 at most here, at worst all to
/// the same side.
const MOVED: f32 = 100.0 * 64.0 * 3.0 * f32::EPSILON;

fn estimator<'a, M: Medium, S: Scene>(medium: &'a M, scene: &'a S, lights: &'a [Light<'a>]) -> Estimator<'a, M, S> {
    Estimator {
        world: World { medium, scene, lights: lights.into() },
        surfaces: None,
        photons: None,
        walk: multiple_scatter::Settings::new(Steps::Gauss(8)),
        paths: Settings::default(),
        light_samples: 1,
        finest: 1e-6,
    }
}

#[test]
fn null_interfaces_change_no_surface_and_no_shadow() {
    for direction in [Vec3::NEG_Z, Vec3::new(0.48, 0.6, -0.64), Vec3::new(-0.8, 0.0, -0.6)] {
        let ray = Ray::new(Vec3::new(0.2, 0.1, 3.0), direction);
        let (plain, sheets) = (Sheets(0), Sheets(MANY));
        let wanted = nearest_surface(&ray, &plain).unwrap();
        let found = nearest_surface(&ray, &sheets).unwrap();
        assert!((found.distance - wanted.distance).abs() < MOVED, "{found:?}");
        assert_eq!((found.surface, found.normal), (wanted.surface, wanted.normal));
        for length in [wanted.distance * 0.999, wanted.distance * 1.001, f32::INFINITY] {
            let part = ray.with_length(length);
            assert_eq!(sheets.is_blocked(&part), plain.is_blocked(&part), "{length} along {direction}");
        }
    }
    assert!((clearance(Vec3::Z * 3.0, None, &Sheets(MANY)) - clearance(Vec3::Z * 3.0, None, &Sheets(0))).abs() < MOVED);
}

#[test]
fn null_interfaces_change_no_light() {
    // Fog that only absorbs leaves nothing to chance but whether a path gets through.
    let fog = Homogeneous::new(Spectrum::splat(0.2), Spectrum::ZERO, Phase::ISOTROPIC).unwrap();
    let fog = Placed::new(fog, Region::sphere(Vec3::ZERO, 5.0).unwrap());
    // The tilted interfaces lie between the floor and either lamp.
    let lights = [
        Light::Sun(Sun::new(Vec3::new(0.3, 0.0, 1.0), Spectrum::ONE).unwrap()),
        Light::Point(PointLight::new(Vec3::new(0.5, 0.2, 4.0), Spectrum::splat(3.0)).unwrap()),
    ];
    let ray = Ray::new(Vec3::new(0.2, 0.1, 3.0), Vec3::new(0.0, 0.6, -0.8));
    let eye = RaySettings { density: 8.0, connections: 1, lamp_parts: 1, lights_visible: true, indirect: true };
    for light in &lights {
        let light = core::slice::from_ref(light);
        let [plain, sheets] = [0, MANY].map(|count| {
            let scene = Sheets(count);
            let make = estimator(&fog, &scene, light);
            let by_caches = radiance(&ray, &make, &Caches::default(), &eye, &mut Generator::new(1)).total()[0];
            let paths = 4096;
            let by_paths: f32 = (0..paths)
                .map(|seed| {
                    path::radiance(&ray, &make.world, &Settings::default(), &mut Generator::new(seed)).total()[0]
                })
                .sum();
            let mut found: Vec<Place> = Vec::new();
            places(&ray, &make.world, &eye, &mut Generator::new(1), |place| found.push(place));
            assert!(found.iter().any(|place| place.is_seen && place.normal == Some(Vec3::Z)), "{found:?}");
            (by_caches, by_paths / paths as f32)
        });
        assert!(plain.0 > 1e-3, "the floor is lit");
        assert!((sheets.0 / plain.0 - 1.0).abs() < 10.0 * MOVED, "{sheets:?}, not {plain:?}");
        // Each path has one of two values, half of them each, about: 5 standard errors.
        for (what, found) in [("without", plain.1), ("with", sheets.1)] {
            assert!((found / plain.0 - 1.0).abs() < 0.08, "{what} interfaces: {found}, not {}", plain.0);
        }
    }
}

#[test]
fn null_interfaces_change_no_photon() {
    let fog = Homogeneous::new(Spectrum::splat(0.2), Spectrum::ZERO, Phase::ISOTROPIC).unwrap();
    let bounds = Bounds { min: Vec3::new(-1.0, -1.0, 0.0), max: Vec3::new(1.0, 1.0, 3.0) };
    let lamp = [Light::Point(PointLight::from_flux(Vec3::Z * 3.0, Spectrum::ONE).unwrap())];
    let settings = Settings { max_scatterings: 2, ..Settings::default() };
    for seed in 0..200 {
        let [plain, sheets] = [0, MANY].map(|count| {
            let scene = Sheets(count);
            let world = World { medium: &fog, scene: &scene, lights: (&lamp).into() };
            let (mut met, mut kept) = (Vec::new(), 0);
            photon::trace(&world, &bounds, &settings, &mut Generator::new(seed), &mut |event| {
                if let Event::Met { point, power, .. } = *event {
                    met.push((point, power));
                }
            });
            vpl::shoot(&world, &bounds, &settings, &mut Generator::new(seed), &mut |light| {
                kept += usize::from(light.is_on_surface());
            });
            (met, kept)
        });
        assert_eq!((plain.0.len(), plain.1), (sheets.0.len(), sheets.1));
        for (a, b) in plain.0.iter().zip(&sheets.0) {
            assert!(a.0.distance(b.0) < MOVED && a.1 == b.1, "{a:?}, {b:?}");
        }
    }
}

/// Finds one interface wherever a ray starts.
struct Stuck(core::cell::Cell<u32>);

impl Scene for Stuck {
    fn closest_hit(&self, _: &Ray) -> Option<Hit> {
        self.0.set(self.0.get() + 1);
        Some(Hit { distance: 0.0, normal: Vec3::X, shading: Vec3::X, surface: Surface::Null, light: None })
    }
}

#[test]
fn rays_that_never_get_past_an_interface_end_as_at_a_black_wall() {
    let scene = Stuck(0.into());
    let ray = Ray::new(Vec3::ZERO, Vec3::X);
    assert_eq!(nearest_surface(&ray, &scene).map(|hit| hit.surface), Some(Surface::BLACK));
    assert_eq!(scene.0.get(), MAX_INTERFACES + 1);
    assert!(scene.is_blocked(&ray));
    let sky = [Light::Constant(Spectrum::ONE)];
    let world = World { medium: &Empty, scene: &scene, lights: (&sky).into() };
    let seen = path::radiance(&ray, &world, &Settings::default(), &mut Generator::new(1));
    assert_eq!(seen.total(), Spectrum::ZERO);
    let make = estimator(&Empty, &scene, &sky);
    let eye = RaySettings { density: 8.0, connections: 1, lamp_parts: 1, lights_visible: true, indirect: true };
    let seen = radiance(&ray, &make, &Caches::default(), &eye, &mut Generator::new(1));
    assert_eq!(seen.total(), Spectrum::ZERO);
}

/// A rectangle that shines, and that light passes.
struct Pane;

impl Scene for Pane {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let distance = (1.0 - ray.origin.z) / ray.direction.z;
        let is_within = ray.at(distance).abs().truncate().max_element() < 0.5;
        let is_hit = distance > 0.0 && distance < ray.length && is_within;
        is_hit.then_some(Hit {
            distance,
            normal: Vec3::NEG_Z,
            shading: Vec3::NEG_Z,
            surface: Surface::Null,
            light: Some(0),
        })
    }
}

#[test]
fn lamps_on_null_interfaces_are_seen() {
    let edge = |x: f32, y: f32| Vec3::new(x, y, 0.0);
    let quad = QuadLight::new(Vec3::new(-0.5, -0.5, 1.0), edge(0.0, 1.0), edge(1.0, 0.0), Spectrum::ONE).unwrap();
    let lights = [Light::Quad(quad)];
    assert!(quad.normal().z < 0.0);
    let world = World { medium: &Empty, scene: &Pane, lights: (&lights).into() };
    let make = estimator(&Empty, &Pane, &lights);
    let ray = Ray::new(Vec3::ZERO, Vec3::Z);
    for lights_visible in [true, false] {
        let settings = Settings { lights_visible, ..Settings::default() };
        let eye = RaySettings { density: 8.0, connections: 1, lamp_parts: 1, lights_visible, indirect: true };
        let by_paths = path::radiance(&ray, &world, &settings, &mut Generator::new(1)).total();
        let by_caches = radiance(&ray, &make, &Caches::default(), &eye, &mut Generator::new(1)).total();
        assert_eq!(
            (by_paths, by_caches),
            if lights_visible { (Spectrum::ONE, Spectrum::ONE) } else { Default::default() }
        );
    }
}
