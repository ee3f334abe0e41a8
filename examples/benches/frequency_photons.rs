//! Cost of filling a covariance grid, beside the same walks without covariances: with voxel traversal and plain
//! deposit of energy, and bare. One thread, CPU seconds.
//!
//! ```sh
//! cargo bench -p fogbow-examples --bench frequency_photons -- [SCENE.xml]
//! ```

use std::path::PathBuf;

use fogbow::covariance::{CellCrossing, FrequencyPhotons, Lattice, OccluderCell, Occluders, Voxel};
use fogbow::host::Medium;
use fogbow::path;
use fogbow::photon::{self, Event};
use fogbow::sampling::Generator;
use fogbow_examples::scene_file::SceneFile;
use fogbow_examples::world::{Storage, WithMedium, World};
use fogbow_std::stats::Stopwatch;

const PATHS: u64 = 100_000;

struct Job<'a>(&'a World<'a>);

impl WithMedium for Job<'_> {
    type Output = ();

    fn with<M: Medium + Sync>(self, medium: &M) {
        let lights = self.0.lights();
        let world = fogbow::world::World { medium, scene: self.0, lights: (&lights).into() };
        let (bounds, settings) = (self.0.bounds(), path::Settings::default());
        let walks = |visit: &mut dyn FnMut(&Event<'_>)| {
            let clock = Stopwatch::start();
            for walk in 0..PATHS {
                photon::trace(&world, &bounds, &settings, &mut Generator::new(walk), &mut |event| visit(event));
            }
            clock.elapsed().cpu.unwrap_or(0.0)
        };
        println!("{PATHS} paths    bare   energy   covariance   ratio   occluders   per crossing");
        for edge in [32, 64, 128] {
            let Ok(lattice) = Lattice::cubic(bounds, edge) else { return };
            let bare = walks(&mut |_| {});
            let mut plain = vec![0.0_f32; lattice.cell_count()];
            let mut crossings = 0_u64;
            let energy = walks(&mut |event| {
                if let Event::Flew { reach, distance, power } = event {
                    for CellCrossing { cell, enter, leave } in lattice.cells(&reach.with_length(*distance)) {
                        plain[cell] += power.mean() * (leave - enter);
                        crossings += 1;
                    }
                }
            });
            let mut cells = vec![OccluderCell::default(); lattice.cell_count()];
            let clock = Stopwatch::start();
            let Ok(mut occluders) = Occluders::new(lattice, &mut cells[..]) else { return };
            occluders.add_scene(self.0, 2);
            let looking = clock.elapsed().cpu.unwrap_or(0.0);
            let mut voxels = vec![Voxel::EMPTY; lattice.cell_count()];
            let mut photons = FrequencyPhotons::new(world, Some(&occluders), lattice);
            let full = walks(&mut |event| photons.visit(event, &mut voxels));
            let sums: (f32, f32) = (plain.iter().sum(), voxels.iter().map(|v| v.weight).sum());
            assert!((sums.0 - sums.1).abs() < 1e-3 * sums.0, "both deposit the same energy: {sums:?}");
            println!(
                "{edge:>5} cells  {bare:>6.2} s {energy:>6.2} s {full:>9.2} s {:>9.2} {looking:>9.2} s {:>11.1} ns",
                full / energy,
                (full - bare) / crossings as f64 * 1e9
            );
        }
    }
}

fn main() -> Result<(), Box<dyn core::error::Error>> {
    let given = std::env::args().skip(1).find(|a| !a.starts_with("--"));
    let file =
        given.map_or_else(|| PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/nave.xml")), PathBuf::from);
    let scene = SceneFile::read(&file)?;
    let mut storage = Storage::new(&scene);
    let world = World::new(&scene, &mut storage)?;
    world.media().with(Job(&world));
    Ok(())
}
