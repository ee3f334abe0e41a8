//! Cost and noise of records: seconds per record, relative standard deviation between records made with
//! other random numbers, and the product that decides, at places all over a scene.
//!
//! ```sh
//! cargo bench -p fogbow-examples --bench records -- [SCENE.xml]
//! ```

use std::path::PathBuf;

use fogbow::cache::{Asked, Effort, Estimator, Limits, Place, RadianceCaches, RaySettings, Settings, places};
use fogbow::host::Medium;
use fogbow::math::{Vec2, Vec3};
use fogbow::multiple_scatter;
use fogbow::path;
use fogbow::phase::Phase;
use fogbow::sampling::Generator;
use fogbow::sh::Coefficient;
use fogbow::single_scatter::Sums;
use fogbow::transmittance::thickness::Steps;
use fogbow_examples::camera::Camera;
use fogbow_examples::scene_file::SceneFile;
use fogbow_examples::world::{Storage, WithMedium, World};
use fogbow_std::progress::Control;
use fogbow_std::stats::Stopwatch;
use fogbow_std::threads::{Threads, run};

const SAMPLES: u32 = 256;
const REPEATS: u64 = 24;
const RAYS: u32 = 60;

struct Job<'a>(&'a World<'a>);

impl WithMedium for Job<'_> {
    type Output = ();

    fn with<M: Medium + Sync>(self, medium: &M) {
        let lights = self.0.lights();
        let steps = Steps::Length(3.0 * medium.resolution());
        let walk = multiple_scatter::Settings { one_light: lights.len() > 1, ..multiple_scatter::Settings::new(steps) };
        let world = fogbow::world::World { medium, scene: self.0, lights: (&lights).into() };
        let paths = path::Settings::default();
        let estimator =
            Estimator { world, surfaces: None, photons: None, walk, paths, light_samples: 16, finest: 0.02 };
        let eye = RaySettings { density: 1.0, connections: 4, lamp_parts: 1, lights_visible: true, indirect: true };
        let camera = self.0.camera();
        let mut found: Vec<Place> = Vec::new();
        for i in 0..RAYS {
            let turn = |step: f32| (0.5 + step * i as f32).fract();
            let ray = camera.ray(Vec2::new(turn(0.754_877_7), turn(0.569_840_3)));
            places(&ray, &world, &eye, &mut Generator::new(u64::from(i)), |place| {
                if place.is_seen {
                    found.push(place);
                }
            });
        }
        let caches = filled(&estimator, &camera, REACH * self.0.bounds().size().max_element());
        let read = caches.reader();
        let surfaces = read.irradiance.map(|r| (r.cache, r.reading));
        for (name, estimator) in
            [("nothing cached", estimator), ("surfaces cached", Estimator { surfaces, ..estimator })]
        {
            println!("{name}");
            println!("  {:10} {:>7} {:>12} {:>10} {:>14}", "kind", "places", "us/sample", "noise", "noise^2 * us");
            measure(&estimator, &found);
        }
    }
}

/// Greatest radius over the size of the scene.
const REACH: f32 = 0.1;

fn filled<M: Medium + Sync>(
    estimator: &Estimator<'_, M, World<'_>>,
    camera: &Camera,
    most: f32,
) -> RadianceCaches<'static> {
    let effort = |tolerance| {
        let limits = Limits { min: 0.01 * most, max: most };
        Some(Effort {
            tolerance,
            samples: SAMPLES,
            degree: 0,
            limits,
            clearance: f32::INFINITY,
            free_paths: f32::INFINITY,
        })
    };
    let caches = RadianceCaches::new(Settings {
        surface: effort(2.0),
        multiple: effort(1.0),
        irradiance: effort(0.7),
        rays: 4096,
        margin: 0.1,
        walk: estimator.walk,
        paths: estimator.paths,
        light_samples: estimator.light_samples,
        finest: estimator.finest,
        seed: 1,
        ..Settings::default()
    });
    let ray = |at: [f32; 2]| camera.ray(Vec2::from(at));
    let mut filling = caches.fill(Asked::View { ray, pixel: 0.005 });
    match Threads::new(0) {
        Ok(threads) => drop(run(&mut filling, &estimator.world, &threads, &Control::default(), None, |_| {})),
        Err(error) => eprintln!("{error}"),
    }
    filling.finish()
}

fn measure<M: Medium>(estimator: &Estimator<'_, M, World<'_>>, found: &[Place]) {
    {
        let medium_places = || found.iter().filter(|p| p.normal.is_none()).map(|p| (p.point, Vec3::Z));
        let surface_places = || found.iter().filter_map(|p| Some((p.point, p.normal?)));
        let phase: Phase = estimator.phase(medium_places().next().map_or(Vec3::ZERO, |p| p.0));
        let none: &mut [Coefficient] = &mut [];
        report("surface", medium_places(), |(point, _), rng| estimator.surface(point, &phase, SAMPLES, none, rng));
        let none: &mut [Coefficient] = &mut [];
        report("multiple", medium_places(), |(point, _), rng| estimator.multiple(point, &phase, SAMPLES, none, rng));
        report("irradiance", surface_places(), |(point, normal), rng| {
            estimator.irradiance(point, normal, SAMPLES, rng).0
        });
    }
}

fn report(
    name: &str,
    places: impl Iterator<Item = (Vec3, Vec3)>,
    mut estimate: impl FnMut((Vec3, Vec3), &mut Generator) -> Sums,
) {
    let (mut noise, mut count) = (0.0, 0_u32);
    let clock = Stopwatch::start();
    for place in places {
        let values: Vec<f64> =
            (0..REPEATS).map(|i| f64::from(estimate(place, &mut Generator::new(1 + i)).value.mean())).collect();
        let mean = values.iter().sum::<f64>() / REPEATS as f64;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (REPEATS - 1) as f64;
        if mean > 0.0 {
            noise += variance / (mean * mean);
            count += 1;
        }
    }
    let seconds = clock.elapsed().cpu.unwrap_or(0.0);
    let each = 1e6 * seconds / (f64::from(count.max(1)) * REPEATS as f64 * f64::from(SAMPLES));
    let variance = noise / f64::from(count.max(1));
    let worth = variance * each * f64::from(SAMPLES);
    println!("  {name:10} {count:>7} {each:>12.3} {:>9.1}% {worth:>14.3}", 100.0 * variance.sqrt());
}

fn main() -> Result<(), Box<dyn core::error::Error>> {
    let given = std::env::args().skip(1).find(|a| !a.starts_with("--"));
    let scene = given.map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("scenes/smoke-box-homogeneous-isotropic.xml"),
        PathBuf::from,
    );
    println!("{}: {SAMPLES} samples per record, {REPEATS} records per place", scene.display());
    let scene = SceneFile::read(&scene)?;
    let mut storage = Storage::new(&scene);
    let world = World::new(&scene, &mut storage)?;
    world.media().with(Job(&world));
    Ok(())
}
