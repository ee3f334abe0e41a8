//! Nanoseconds per ray: `cargo bench -p fogbow-examples --bench rays -- SCENE.xml...`
//!
//! Rays start on surfaces and inside the scene and go in all directions, as those of a path tracer do.

use core::hint::black_box;
use std::path::Path;
use std::time::Instant;

use fogbow::host::Scene;
use fogbow::math::{Ray, Vec2, Vec3};
use fogbow::sampling::warp::uniform_sphere;
use fogbow_examples::scene_file::SceneFile;
use fogbow_examples::world::{Storage, World};

/// A small generator: benches need no more.
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 40) as f32 / (1 << 24) as f32
    }
    fn direction(&mut self) -> Vec3 {
        uniform_sphere(Vec2::new(self.unit(), self.unit())).normalize()
    }
}

/// Rays of paths that bounce about from the camera.
fn paths(world: &World<'_>, count: usize) -> Vec<Ray> {
    let mut random = Random(0x9E37_79B9_7F4A_7C15);
    let camera = world.camera();
    let mut rays = Vec::with_capacity(count);
    while rays.len() < count {
        let mut ray = camera.ray(Vec2::new(random.unit(), random.unit()));
        for _ in 0..8 {
            rays.push(ray);
            let Some(hit) = world.closest_hit(&ray) else { break };
            // Half of the vertices lie in the fog before the surface.
            let share = if random.unit() < 0.5 { random.unit() } else { 1.0 };
            let mut direction = random.direction();
            if share == 1.0 && direction.dot(hit.normal) * ray.direction.dot(hit.normal) > 0.0 {
                direction = -direction;
            }
            let point = ray.at(hit.distance * share) - ray.direction * 1e-4;
            ray = Ray::new(point, direction);
        }
    }
    rays
}

/// The least time of several passes (ns per ray).
fn measure(rays: &[Ray], mut test: impl FnMut(&Ray) -> bool) -> (f64, f64) {
    let mut best = f64::INFINITY;
    let mut hits = 0;
    for _ in 0..7 {
        let start = Instant::now();
        hits = rays.iter().filter(|r| black_box(test(black_box(r)))).count();
        best = best.min(start.elapsed().as_secs_f64() * 1e9 / rays.len() as f64);
    }
    (best, hits as f64 / rays.len() as f64)
}

fn main() {
    println!("{:24} {:>11} {:>7} {:>11} {:>7}", "scene", "closest ns", "hits", "blocked ns", "hits");
    for file in std::env::args().skip(1).filter(|a| a.ends_with(".xml")) {
        let path = Path::new(&file);
        let scene = match SceneFile::read(path) {
            Ok(scene) => scene,
            Err(error) => {
                println!("{error}");
                continue;
            }
        };
        let mut storage = Storage::new(&scene);
        let world = match World::new(&scene, &mut storage) {
            Ok(world) => world,
            Err(error) => {
                println!("{error}");
                continue;
            }
        };
        let rays = paths(&world, 200_000);
        let size = world.bounds().size();
        let mut random = Random(7);
        let shadow: Vec<Ray> = rays
            .iter()
            .map(|ray| {
                let target = Vec3::new(random.unit(), random.unit(), random.unit()) * size + world.bounds().min;
                Ray::between(ray.origin, target)
            })
            .collect();
        let (closest, hits) = measure(&rays, |ray| world.closest_hit(ray).is_some());
        let (blocked, blocks) = measure(&shadow, |ray| world.is_blocked(ray));
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        println!("{name:24} {closest:>11.1} {hits:>7.3} {blocked:>11.1} {blocks:>7.3}");
    }
}
