//! A world in millimetres or kilometres is the same world: radiance does not change when all lengths do.

use fogbow::beams::{BeamOutput, BeamPass};
use fogbow::cache::{Asked, FilledRecords, RadianceCaches};
use fogbow::host::{Hit, Scene};
use fogbow::light::{Light, PointLight, SphereLight, SpotLight};
use fogbow::math::{Affine3, Bounds, Mat3, Ray, Vec3};
use fogbow::medium::{Density, DensityGrid, MinMax, Placed, Region};
use fogbow::path;
use fogbow::phase::Lobe;
use fogbow::sampling::{Generator, Independent};
use fogbow::spectrum::Spectrum;
use fogbow::surface::Surface;
use fogbow::vpl::{VplOutput, VplPass};
use fogbow::work::finish;
use fogbow::world::{Outline, World, nearest_surface};
use fogbow::{beams, cache, host::Properties, vpl};

/// Powers of two, which round nothing: what is left of lengths that do not scale shows to the last bit.
const SCALES: [f32; 2] = [1.0 / 1024.0, 1024.0];

/// A floor at `y = −1`, a glass ball in its middle, and a null interface above; the shining ball is number 0 of the lights.
struct Room {
    scale: f32,
}

const SHINING: (Vec3, f32) = (Vec3::new(0.5, 0.75, 0.25), 0.125);
const GLASS: (Vec3, f32) = (Vec3::new(-0.5, -0.5, 0.0), 0.25);

impl Scene for Room {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let grey = Surface::Lambert { reflectance: Spectrum::new(0.75, 0.5, 0.25) };
        let planes = [(-1.0, grey), (0.5, Surface::Null)].map(|(y, surface)| {
            let distance = (y * self.scale - ray.origin.y) / ray.direction.y;
            (distance, Vec3::Y * -ray.direction.y.signum(), surface, None)
        });
        let glass = Surface::Dielectric { eta: 1.5, reflectance: Spectrum::ONE, transmittance: Spectrum::ONE };
        let balls =
            [(SHINING, Surface::BLACK, Some(0)), (GLASS, glass, None)].map(|((centre, radius), surface, light)| {
                let (offset, radius) = (ray.origin - centre * self.scale, radius * self.scale);
                let (b, c) = (offset.dot(ray.direction), offset.length_squared() - radius * radius);
                let root = (b * b - c).sqrt();
                // Away from a surface that it starts at.
                let least = 1e-4 * radius;
                let distance = if -b - root > least { -b - root } else { -b + root };
                let distance = if distance > least { distance } else { f32::NAN };
                (distance, (ray.at(distance) - centre * self.scale).normalize_or_zero(), surface, light)
            });
        let hits = planes.into_iter().chain(balls).filter(|hit| hit.0 > 0.0 && hit.0 < ray.length);
        let (distance, normal, surface, light) = hits.min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(Hit { distance, normal, shading: normal, surface, light })
    }
}

const CELLS: [f32; 8] = [0.5, 1.0, 0.25, 0.75, 1.0, 0.5, 0.125, 1.0];

/// Calls `with` with the world, a unit of whose lengths is so many metres.
fn in_world<T>(scale: f32, with: impl FnOnce(&World<'_, Placed<'_, DensityGrid<'_>>, Room>, Bounds) -> T) -> T {
    let mut blocks = [MinMax::default(); 1];
    let smoke = Properties {
        absorption: Spectrum::splat(0.25) / scale,
        scattering: Spectrum::new(0.5, 1.0, 2.0) / scale,
        phase: Lobe::HenyeyGreenstein { g: 0.5 }.into(),
        ..Properties::VACUUM
    };
    let place =
        Affine3 { matrix3: Mat3::from_diagonal(Vec3::splat(4.0 * scale)), translation: Vec3::splat(-2.0 * scale) };
    let grid = DensityGrid::new([2; 3], Density::F32(&CELLS), &smoke, place, &mut blocks).unwrap();
    let medium = Placed::new(grid, Region::sphere(Vec3::ZERO, 1.75 * scale).unwrap());
    let square = scale * scale;
    let spot = SpotLight::new(
        Vec3::new(1.0, 1.0, -1.0) * scale,
        Vec3::new(-1.0, -1.0, 1.0),
        0.2,
        0.6,
        Spectrum::splat(8.0) * square,
    );
    let lights = [
        Light::Sphere(SphereLight::new(SHINING.0 * scale, SHINING.1 * scale, Spectrum::new(4.0, 2.0, 1.0)).unwrap()),
        Light::Point(PointLight::new(Vec3::new(-1.0, 1.0, 1.0) * scale, Spectrum::splat(2.0) * square).unwrap()),
        Light::Spot(spot.unwrap()),
    ];
    let bounds = Bounds { min: Vec3::splat(-2.0 * scale), max: Vec3::splat(2.0 * scale) };
    with(&World { medium: &medium, scene: &Room { scale }, lights: (&lights).into() }, bounds)
}

fn eye_ray(scale: f32, [x, y]: [f32; 2]) -> Ray {
    Ray::new(Vec3::new(0.0, 0.25, -4.0) * scale, Vec3::new(x - 0.5, 0.5 - y, 1.5).normalize())
}

/// Eye rays of a small film.
fn eye_rays(scale: f32) -> impl Iterator<Item = Ray> {
    (0..64).map(move |i| eye_ray(scale, [((i % 8) as f32 + 0.5) / 8.0, ((i / 8) as f32 + 0.5) / 8.0]))
}

/// What `of` gives in the world as it is and in others.
#[track_caller]
fn assert_same(of: impl Fn(f32) -> Vec<Spectrum>) {
    let usual = of(1.0);
    assert!(usual.iter().filter(|light| !light.is_black()).count() > 32, "{usual:?}");
    for scale in SCALES {
        let other = of(scale);
        let differing: Vec<_> = usual.iter().zip(&other).enumerate().filter(|(_, (a, b))| a != b).collect();
        assert!(
            differing.is_empty() && usual.len() == other.len(),
            "{scale}: {} of {}: {:?}",
            differing.len(),
            usual.len(),
            differing.first()
        );
    }
}

#[test]
fn paths_see_the_same_in_other_units() {
    assert_same(|scale| {
        in_world(scale, |world, _| {
            let rng = &mut Generator::new(1);
            let seen =
                |ray| (0..16).map(|_| path::radiance(&ray, world, &path::Settings::default(), rng).total()).sum();
            eye_rays(scale).map(seen).collect()
        })
    });
}

#[test]
fn caches_see_the_same_in_other_units() {
    assert_same(|scale| {
        in_world(scale, |world, bounds| {
            let usual = cache::Settings::for_outline(&Outline::of(world, bounds), 0.1).with_walks(16);
            let settings = cache::Settings { rays: 64, ..usual };
            let mut filling =
                RadianceCaches::new(settings).fill(Asked::View { ray: |at| eye_ray(scale, at), pixel: 0.1 });
            finish(&mut filling, world, &mut FilledRecords::default());
            let caches = filling.finish();
            let rng = &mut Generator::new(2);
            eye_rays(scale).map(|ray| caches.radiance(&ray, world, rng).total()).collect()
        })
    });
}

#[test]
fn beams_see_the_same_in_other_units() {
    assert_same(|scale| {
        in_world(scale, |world, bounds| {
            let usual = beams::Settings::for_outline(&Outline::of(world, bounds));
            let settings = beams::Settings { paths: 256, ..usual };
            let mut pass = BeamPass::new(&settings, 0, |_, pass| pass);
            finish(&mut pass, world, &mut BeamOutput::default());
            let beams = pass.finish().unwrap();
            let rng = &mut Generator::new(3);
            eye_rays(scale).map(|ray| beams.radiance(&ray, world, &settings.walk, 1.0, rng).total()).collect()
        })
    });
}

#[test]
fn virtual_lights_see_the_same_in_other_units() {
    assert_same(|scale| {
        in_world(scale, |world, bounds| {
            let usual = vpl::Settings::for_outline(&Outline::of(world, bounds));
            let settings = vpl::Settings { paths: 64, lights: 64, candidates: 2, samples: 1, ..usual };
            assert!(settings.has_mirrors);
            let mut pass = VplPass::new(&settings, 0, Independent, &[]);
            finish(&mut pass, world, &mut VplOutput::default());
            let lights = pass.finish().unwrap();
            let (gatherer, eye, rng) = (settings.gatherer(world), settings.eye(), &mut Generator::new(4));
            eye_rays(scale)
                .map(|ray| vpl::radiance(&ray, &gatherer, lights.as_slice(), 1.0, &eye, rng).radiance.total())
                .collect()
        })
    });
}

/// The cells that compensation looks at are as many.
#[test]
fn settings_are_the_same_in_other_units() {
    let of = |scale| {
        in_world(scale, |world, bounds| {
            let settings = vpl::Settings::for_outline(&Outline::of(world, bounds));
            let (bounds, size) = settings.pyramid();
            let hit = nearest_surface(&Ray::new(Vec3::Y * scale, Vec3::NEG_Y), world.scene).unwrap();
            (settings.bound.radius() / scale, bounds.min / scale, size, hit.distance / scale)
        })
    };
    SCALES.iter().for_each(|&scale| assert_eq!(of(scale), of(1.0), "{scale}"));
    // Bounds that are flat, and bounds without end.
    let flat = |scale: f32| {
        let usual = in_world(scale, |world, bounds| vpl::Settings::for_outline(&Outline::of(world, bounds)));
        let bounds = Bounds { min: Vec3::ZERO, max: Vec3::X * scale };
        vpl::Settings { bounds, ..usual }.pyramid().0.size() / scale
    };
    let endless = |scale: f32| {
        in_world(scale, |world, bounds| {
            let outline = Outline { bounds: Bounds::EVERYTHING, ..Outline::of(world, bounds) };
            let beams = beams::Settings::for_outline(&outline);
            [vpl::usual_bound(&outline).radius(), beams.radius, beams.longest, beams.depth].map(|length| length / scale)
        })
    };
    for scale in SCALES {
        assert_eq!((flat(scale), endless(scale)), (flat(1.0), endless(1.0)), "{scale}");
    }
}
