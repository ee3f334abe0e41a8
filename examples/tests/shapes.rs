//! Forms, normals and textures, held to what the independent renderer finds along the same rays: see `shapes/hits.py`.

use std::path::Path;

use fogbow::host::Scene;
use fogbow::math::{Ray, Vec3};
use fogbow::surface::Surface;
use fogbow_examples::scene_file::SceneFile;
use fogbow_examples::world::{Storage, World};

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
