//! Ray marching against the path tracer: the same light from points chosen otherwise.

use fogbow::host::{Empty, Medium};
use fogbow::light::{Light, PointLight};
use fogbow::march;
use fogbow::math::{Ray, Vec3};
use fogbow::medium::{Placed, Region};
use fogbow::path::{self, InScattered, Settings};
use fogbow::phase::Lobe;
use fogbow::sampling::{Generator, uniform};
use fogbow::spectrum::Spectrum;
use fogbow::world::World;
use fogbow_tests::estimate::{Estimate, estimate};
use fogbow_tests::hosts::{Analytic, Field};

/// Two lamps outside of where eye rays look: connections from there have little noise.
fn lamps() -> [Light<'static>; 2] {
    let lamp = |position, intensity| Light::Point(PointLight::new(position, Spectrum::splat(intensity)).unwrap());
    [lamp(Vec3::new(0.0, 3.0, 0.5), 4.0), lamp(Vec3::new(-2.0, -2.0, 1.0), 2.0)]
}

fn marched<M: Medium>(
    world: &World<'_, M, Empty>,
    ray: &Ray,
    settings: &Settings,
    pick: fn(&path::Radiance) -> Spectrum,
) -> Estimate {
    estimate(6000, |rng| {
        let seen = path::radiance_beyond(ray, world, settings, rng, |segment: &Ray, most, rng: &mut Generator| {
            let settings = Settings { max_scatterings: most, ..*settings };
            let mut light = InScattered::default();
            let offset = uniform(rng);
            march::steps(
                segment,
                world.medium,
                |_| 0.11,
                offset,
                |at, properties, weight| {
                    let (point, to_eye) = (segment.at(at), -segment.direction);
                    let here = path::in_scattered(world, point, to_eye, &properties.phase, &settings, rng);
                    light.single += weight * properties.scattering * here.single;
                    light.multiple += weight * properties.scattering * here.multiple;
                },
            );
            light
        });
        pick(&seen)
    })
}

#[test]
fn marching_sees_what_the_path_tracer_sees() {
    let phase = Lobe::HenyeyGreenstein { g: 0.3 }.into();
    let cloud = Analytic { phase, ..Analytic::grey(Field::Gaussian { a: 0.1, k: 0.9, c: Vec3::ZERO, s: 0.5 }, 0.8) };
    let bump = Placed::new(cloud, Region::sphere(Vec3::ZERO, 1.5).unwrap());
    let lights = lamps();
    let world = World { medium: &bump, scene: &Empty, lights: (&lights).into() };
    let ray = Ray::between(Vec3::new(0.3, 0.1, -3.0), Vec3::new(-0.1, 0.2, 3.0));
    for most in [1, 2, u32::MAX] {
        let settings = Settings { max_scatterings: most, ..Settings::default() };
        for (name, pick) in [
            ("single", (|seen| seen.medium_single) as fn(&path::Radiance) -> Spectrum),
            ("multiple", |seen| seen.medium_multiple),
        ] {
            let truth = estimate(60_000, |rng| pick(&path::radiance(&ray, &world, &settings, rng)));
            let found = marched(&world, &ray, &settings, pick);
            for c in 0..3 {
                let error = truth.error[c].hypot(found.error[c]);
                // Steps of 0.11 m in a bump of 0.5 m: a march takes extinction as constant within each.
                let allowed = 4.5 * error + 5e-3 * truth.mean[c];
                assert!((found.mean[c] - truth.mean[c]).abs() <= allowed, "{most} {name}: {found:?} {truth:?}");
            }
            assert_eq!(truth.mean[0] > 0.0, name == "single" || most > 1);
        }
    }
}
