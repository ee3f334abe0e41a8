//! Cost and noise of records: seconds per record, relative standard deviation between records made with
//! other random numbers, and the product that decides, at places all over a scene.
//!
//! ```sh
//! cargo bench -p fogbow-examples --bench records -- [SCENE.xml]
//! ```

use std::path::PathBuf;

use fogbow::cache::{Estimator, Extrapolation, EyeSettings, Limits, Place, places};
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
use fogbow_std::radiance_cache::{Effort, RadianceCaches, Settings, fill};
use fogbow_std::stats::Stopwatch;

const SAMPLES: u32 = 128;
const RAYS: u32 = 600;

struct Job<'a>(&'a World<'a>);

impl WithMedium for Job<'_> {
    type Output = ();

    fn with<M: Medium + Sync>(self, medium: &M) {
        let lights = self.0.lights();
        let steps = Steps::Length(3.0 * medium.resolution());
        let walk = multiple_scatter::Settings { one_light: lights.len() > 1, ..multiple_scatter::Settings::new(steps) };
        let world = path::World { medium, scene: self.0, lights: &lights };
        let paths = path::Settings::default();
        let estimator = Estimator { world, surfaces: None, scattered: None, walk, paths, light_samples: 16, finest: 0.02 };
        let eye = EyeSettings { density: 1.0, connections: 4, lights_visible: true, indirect: true };
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
        let known = read.surface.zip(read.multiple).map(|(s, m)| [(s.cache, s.reading), (m.cache, m.reading)]);
        let surfaces = read.irradiance.map(|r| (r.cache, r.reading));

        let samples: u32 = 5000;
        let phase = estimator.phase(found[0].point);
        let none: &mut [Coefficient] = &mut [];
        let mut rng = Generator::new(77);
        let basis = fogbow::cache::Basis::new(Vec3::Z, 0);
        let surf = Estimator { surfaces, ..estimator };
        let all = Estimator { surfaces, scattered: known, ..estimator };

        let n = 400_000;
        for (p, axis) in [(Vec3::new(-0.9, 0.0, 0.0), Vec3::X), (Vec3::new(-0.9, 0.5, 0.0), Vec3::X), (Vec3::new(-0.9, -0.5, -0.3), Vec3::X), (Vec3::new(-0.5, 0.0, 0.0), Vec3::X), (Vec3::new(0.0, 0.0, -0.9), Vec3::Z), (Vec3::new(0.0, -0.9, 0.1), Vec3::Y), (Vec3::new(0.0, 0.5, 0.0), Vec3::Y), (Vec3::new(0.3, 0.5, 0.0), Vec3::X)] {
            let h = 0.05;
            for name in ["surface", "multiple"] {
                let mut est = |p: Vec3| if name == "surface" { all.surface(p, &phase, n, none, &mut rng) } else { all.multiple(p, &phase, n, none, &mut rng) };
                let (a, b, c) = (est(p - axis * h), est(p + axis * h), est(p));
                let fd = (b.value.mean() - a.value.mean()) / (2.0 * h);
                println!("{name:8} {p:?} value {:.5}  log-gradient: differences {:+.3} estimate {:+.3}  curvature {:+.2}", c.value.mean(), fd / c.value.mean(), c.gradient.along(axis).mean() / c.value.mean(), (a.value.mean() + b.value.mean() - 2.0 * c.value.mean()) / (h * h) / c.value.mean());
            }
        }
        for (p, nrm, axis) in [(Vec3::new(-0.9, -1.0, 0.0), Vec3::Y, Vec3::X), (Vec3::new(-1.0, -0.9, 0.0), Vec3::X, Vec3::Y), (Vec3::new(-1.0, 0.0, 0.0), Vec3::X, Vec3::Y), (Vec3::new(0.5, 0.9, -1.0), Vec3::Z, Vec3::Y), (Vec3::new(0.8, -1.0, 0.3), Vec3::Y, Vec3::X)] {
            let h = 0.05;
            let mut est = |p: Vec3| all.irradiance(p, nrm, n, &mut rng).0;
            let (a, b, c) = (est(p - axis * h), est(p + axis * h), est(p));
            let fd = (b.value.mean() - a.value.mean()) / (2.0 * h);
            let g = c.gradient.channel(1); println!("  g {g:?}");
            let g = a.gradient.channel(1); println!("  g {g:?}");
            let g = b.gradient.channel(1); println!("  g {g:?}");
            println!("irradi {p:?} value {:.5}  log-gradient: differences {:+.3} estimate {:+.3}  curvature {:+.2}", c.value.mean(), fd / c.value.mean(), c.gradient.along(axis).mean() / c.value.mean(), (a.value.mean() + b.value.mean() - 2.0 * c.value.mean()) / (h * h) / c.value.mean());
        }
    }
}

/// Greatest radius over the size of the scene.
const REACH: f32 = 0.1;

fn filled<M: Medium + Sync>(estimator: &Estimator<'_, M, World<'_>>, camera: &Camera, most: f32) -> RadianceCaches {
    let effort = |tolerance| {
        Some(Effort { tolerance, samples: SAMPLES, degree: 0, limits: Limits { min: 0.01 * most, max: most } })
    };
    let mut caches = RadianceCaches::new(Settings {
        single: None,
        surface: effort(2.0),
        multiple: effort(1.0),
        irradiance: effort(0.35),
        rays: 16384,
        extrapolation: Extrapolation::Curved,
        margin: 0.15,
        pixels: (1.5, 64.0),
        round: 64,
        threads: 0,
        seed: 1,
    });
    let eye = EyeSettings { density: 8.0, connections: 4, lights_visible: true, indirect: true };
    let ray = |at: [f32; 2]| camera.ray(Vec2::from(at));
    if let Err(error) = fill(&mut caches, estimator, &eye, 0.005, &Control::default(), ray) {
        eprintln!("{error}");
    }
    caches
}

fn main() -> Result<(), Box<dyn core::error::Error>> {
    let given = std::env::args().skip(1).find(|a| !a.starts_with("--"));
    let scene = given.map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("scenes/smoke-box-homogeneous-isotropic.xml"),
        PathBuf::from,
    );
    println!("{}: {SAMPLES} samples per record", scene.display());
    let scene = SceneFile::read(&scene)?;
    let mut storage = Storage::new(&scene);
    let world = World::new(&scene, &mut storage)?;
    world.media().with(Job(&world));
    Ok(())
}
