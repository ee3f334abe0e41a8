//! Mean extinction in a ball.

use fogbow::host::Medium;
use fogbow::math::{Affine3, Bounds, Vec3, float};
use fogbow::medium::{Homogeneous, Placed, Region};
use fogbow::phase::Phase;
use fogbow::sampling::{Generator, uniform};

use super::common::*;

/// Mean over a ball by many random points, and its standard error.
fn brute_mean(medium: &impl Medium, centre: Vec3, radius: f32, rng: &mut Generator) -> (f32, f32) {
    const N: u32 = 40_000;
    let (mut sum, mut squares) = (0.0_f64, 0.0_f64);
    for _ in 0..N {
        let offset = direction(rng) * (radius * float::cbrt(uniform(rng)));
        let value = f64::from(medium.extinction(centre + offset)[0]);
        sum += value;
        squares += value * value;
    }
    let mean = sum / f64::from(N);
    (mean as f32, ((squares / f64::from(N) - mean * mean).max(0.0) / f64::from(N)).sqrt() as f32)
}

#[test]
fn mean_extinction_agrees_with_many_random_points() {
    let mut rng = Generator::new(7);
    let mut worst = 0.0_f32;
    for round in 0..60 {
        let placement = placement(&mut rng, 1.0);
        let mut random = Generator::child(&mut rng);
        let mut voxels = Voxels::new([12, 12, 12], placement, |_| uniform(&mut random));
        let grid = voxels.grid();
        let centre = placement.transform_point3(Vec3::splat(0.5) + point(&mut rng, 0.5));
        let radius = grid.resolution() * [0.3, 1.0, 3.0, 8.0][round % 4];
        let (expected, error) = brute_mean(&grid, centre, radius, &mut rng);
        let mean = grid.mean_extinction(centre, radius)[0];
        worst = worst.max((mean - expected).abs() - 4.0 * error);
        // White noise on the cells, the hardest field there is, and faces through most balls.
        assert_near(mean, expected, 4.0 * error + 0.06, "mean in a ball");
    }
    assert!(worst < 0.06, "{worst}");
    let mut voxels = Voxels::new([4, 4, 4], Affine3::IDENTITY, |_| 1.0);
    let grid = voxels.grid();
    assert_near(grid.mean_extinction(Vec3::splat(0.5), 0.3)[0], 1.0, 1e-6, "inside");
    assert_near(grid.mean_extinction(Vec3::new(0.0, 0.5, 0.5), 0.25)[0], 0.5, 0.05, "half outside");
    assert_eq!(grid.mean_extinction(Vec3::splat(3.0), 0.3)[0], 0.0);
    assert_eq!(grid.mean_extinction(Vec3::splat(0.5), 0.0)[0], 1.0);
}

#[test]
fn mean_extinction_counts_what_is_outside_a_region_as_nothing() {
    let mut rng = Generator::new(8);
    let fog = Homogeneous::new(ABSORPTION, SCATTERING, Phase::ISOTROPIC).unwrap();
    let holes = [Region::sphere(Vec3::new(0.5, 0.0, 0.0), 0.4).unwrap()];
    let bounds = Bounds { min: Vec3::splat(-1.0), max: Vec3::splat(1.0) };
    for region in [Region::sphere(Vec3::ZERO, 1.0).unwrap(), Region::bounds(bounds).unwrap(), Region::Everywhere] {
        let placed = Placed::new(fog, region).with_holes(&holes);
        for _ in 0..30 {
            let (centre, radius) = (point(&mut rng, 1.3), 0.05 + 0.5 * uniform(&mut rng));
            let (expected, error) = brute_mean(&placed, centre, radius, &mut rng);
            // A face cuts 280 points with an error of about one layer's surplus.
            assert_near(placed.mean_extinction(centre, radius)[0], expected, 4.0 * error + 0.04, "mean in a ball");
        }
    }
}
