//! Forms, normals and textures, held to what the independent renderer finds along the same rays: see `shapes/hits.py`.

use std::path::Path;

use fogbow::host::{Medium, Scene};
use fogbow::math::{Ray, Vec2, Vec3};
use fogbow::path::Settings;
use fogbow::sampling::{Generator, uniform};
use fogbow::surface::Surface;
use fogbow_examples::scene_file::SceneFile;
use fogbow_examples::world::{Storage, WithMedium, World};

const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/shapes");

#[test]
fn rays_find_what_the_independent_renderer_finds() {
    let scene = SceneFile::read(&Path::new(FOLDER).join("hits.xml")).unwrap();
    let mut storage = Storage::new(&scene);
    let world = World::new(&scene, &mut storage).unwrap();
    let text = std::fs::read_to_string(Path::new(FOLDER).join("hits.txt")).unwrap();
    let (mut hits, mut misses) = (0, 0);
    for (number, line) in text.lines().enumerate() {
        let place = format!("line {}: {line}", number + 1);
        let numbers: Vec<f32> = line.split(' ').filter(|w| *w != "-").map(|w| w.parse().unwrap()).collect();
        let vector = |at: usize| Vec3::from_slice(&numbers[at..at + 3]);
        let hit = world.closest_hit(&Ray::new(vector(0), vector(3).normalize()));
        let Some(hit) = hit else {
            assert!(line.ends_with('-'), "nothing is found on {place}");
            misses += 1;
            continue;
        };
        assert!(!line.ends_with('-'), "something is found on {place}");
        assert!((hit.distance - numbers[6]).abs() < 1e-4 * numbers[6], "{} on {place}", hit.distance);
        // Where both sides do the same, the normal here is turned against the ray.
        let same_side = |mine: Vec3, theirs: Vec3| mine.distance(theirs).min(mine.distance(-theirs));
        assert!(same_side(hit.normal, vector(7)) < 2e-4, "{} on {place}", hit.normal);
        assert!(same_side(hit.shading, vector(10)) < 2e-3, "{} on {place}", hit.shading);
        assert!(hit.shading.dot(hit.normal) > 0.0, "{place}");
        let Surface::Lambert { reflectance } = hit.surface else { panic!("{:?} on {place}", hit.surface) };
        assert!(Vec3::from_array(reflectance.0).distance(vector(13)) < 3e-3, "{reflectance:?} on {place}");
        hits += 1;
    }
    assert!(hits > 60 && misses > 5, "{hits} hits, {misses} misses");
}

/// Sums over the quadrants of a picture by path tracing.
struct Quadrants<'w, 'a> {
    world: &'w World<'a>,
    samples: u32,
}

impl WithMedium for Quadrants<'_, '_> {
    type Output = [Mean; 4];

    fn with<M: Medium + Sync>(self, medium: &M) -> [Mean; 4] {
        let (lights, camera) = (self.world.lights(), self.world.camera());
        let world = fogbow::world::World { medium, scene: self.world, lights: (&*lights).into() };
        let depth = self.world.integrator().max_depth.unwrap_or(u32::MAX);
        let settings = Settings { max_scatterings: depth - 1, ..Settings::default() };
        let (width, height) = (self.world.sensor().width, self.world.sensor().height);
        let mut means = [Mean::default(); 4];
        let mut rng = Generator::new(11);
        for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
            let mean = &mut means[(2 * (2 * y / height) + 2 * x / width) as usize];
            for _ in 0..self.samples {
                let at = Vec2::new(x as f32 + uniform(&mut rng), y as f32 + uniform(&mut rng));
                let ray = camera.ray(at / Vec2::new(width as f32, height as f32));
                let seen = fogbow::path::radiance(&ray, &world, &settings, &mut rng).total();
                for channel in 0..3 {
                    mean.sum[channel] += f64::from(seen[channel]);
                    mean.squares[channel] += f64::from(seen[channel]).powi(2);
                }
                mean.count += 1.0;
            }
        }
        means
    }
}

#[derive(Clone, Copy, Default)]
struct Mean {
    sum: [f64; 3],
    squares: [f64; 3],
    count: f64,
}

impl Mean {
    /// The mean of a channel and its standard error; pixels differ, so the true one is smaller.
    fn of(&self, channel: usize) -> (f64, f64) {
        let mean = self.sum[channel] / self.count;
        (mean, ((self.squares[channel] / self.count - mean * mean).max(0.0) / self.count).sqrt())
    }
}

/// Means over quadrants within the standard errors of both renderers: see `shapes/media.py`.
#[test]
fn media_in_containers_of_any_form_look_as_in_the_independent_renderer() {
    let text = std::fs::read_to_string(Path::new(FOLDER).join("media.txt")).unwrap();
    let mut names: Vec<&str> = text.lines().filter_map(|line| line.split(' ').next()).collect();
    names.dedup();
    assert!(names.len() >= 4, "{names:?}");
    for name in names {
        let scene = SceneFile::read(&Path::new(FOLDER).join(format!("media-{name}.xml"))).unwrap();
        let mut storage = Storage::new(&scene);
        let world = World::new(&scene, &mut storage).unwrap();
        let means = world.media().with(Quadrants { world: &world, samples: scene.sensor.samples });
        for line in text.lines().filter(|line| line.split(' ').next() == Some(name)) {
            let numbers: Vec<f64> = line.split(' ').skip(1).map(|w| w.parse().unwrap()).collect();
            let mine = &means[(2.0 * numbers[0] + numbers[1]) as usize];
            for channel in 0..3 {
                let (mean, error) = mine.of(channel);
                let (wanted, its_error) = (numbers[2 + channel], numbers[5 + channel]);
                let sigmas = (mean - wanted) / error.hypot(its_error);
                // One of 96 numbers lies beyond 4 in one run of 160.
                assert!(sigmas.abs() < 4.0, "{mean} ± {error} for {wanted} ± {its_error}, channel {channel} of {line}");
                // And the test can tell a wrong medium from a right one.
                assert!(error < 0.1 * wanted, "± {error} of {wanted}, channel {channel} of {line}");
            }
        }
    }
}
