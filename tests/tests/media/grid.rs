//! Grids: bounds, lookups, derivatives.

use fogbow::host::{MajorantSegment, Medium, Properties};
use fogbow::math::{Affine3, Mat3, Ray, Vec3};
use fogbow::medium::{BLOCK, Density, DensityGrid, MinMax};
use fogbow::sampling::{Generator, uniform};
use fogbow::spectrum::Spectrum;

use super::common::*;

/// Densities by the definition: eight weighted corners, in `f64`.
fn trilinear(size: [u32; 3], values: &[f32], local: [f64; 3]) -> f64 {
    if local.iter().any(|&p| !(0.0..=1.0).contains(&p)) {
        return 0.0;
    }
    let mut sum = 0.0;
    for corner in 0..8_usize {
        let (mut weight, mut index, mut stride) = (1.0, 0, 1);
        for axis in 0..3 {
            let q = local[axis] * f64::from(size[axis]) - 0.5;
            let upper = corner >> axis & 1;
            let fraction = q - q.floor();
            weight *= if upper == 1 { fraction } else { 1.0 - fraction };
            let cell = (q.floor() as i64 + upper as i64).clamp(0, i64::from(size[axis]) - 1);
            index += cell as usize * stride;
            stride *= size[axis] as usize;
        }
        sum += weight * f64::from(values[index]);
    }
    sum
}

#[test]
fn bounds_of_grids_hold_along_every_ray() {
    let mut rng = Generator::new(1);
    let mut longest = 0;
    for round in 0..1500 {
        let scale = [1e-4, 1.0, 1.0, 1e5][round % 4];
        let mut side = || 1 + (uniform(&mut rng) * uniform(&mut rng) * 40.0) as u32;
        let size = [side(), side(), side()];
        let placement = if round % 3 == 0 {
            Affine3 { matrix3: Mat3::from_diagonal(Vec3::splat(scale)), translation: Vec3::ZERO }
        } else {
            placement(&mut rng, scale)
        };
        let mut voxels = Voxels::new(size, placement, islands(&mut rng));
        let grid = voxels.grid();
        for _ in 0..8 {
            let ray = ray_around(&mut rng, &placement);
            longest = longest.max(check_walk(&grid, &ray, 6.0 * scale, 1e-5 * scale, &mut rng));
        }
    }
    assert!(longest < 100, "{longest} steps through at most 30 blocks");
}

#[test]
fn bounds_hold_for_grids_far_from_the_origin_and_seen_from_far_away() {
    let mut rng = Generator::new(2);
    for round in 0..300 {
        let distance = [1e3, 1e5, 1e7, 1e12][round % 4];
        let mut far = placement(&mut rng, 1.0);
        far.translation += direction(&mut rng) * distance;
        let mut voxels = Voxels::new([24, 20, 17], far, islands(&mut rng));
        let grid = voxels.grid();
        // Positions are no finer than this.
        let blur = 4e-7 * distance;
        check_walk(&grid, &ray_around(&mut rng, &far), 6.0 + blur, blur, &mut rng);
        let centre = far.transform_point3(Vec3::splat(0.5));
        let origin = centre + direction(&mut rng) * distance;
        let seen = Ray { length: f32::INFINITY, ..Ray::between(origin, centre + point(&mut rng, 0.4)) };
        check_walk(&grid, &seen, 2.0 * distance, blur, &mut rng);
    }
}

#[test]
fn rays_that_miss_a_grid_see_vacuum_for_ever() {
    let mut voxels = Voxels::new([4, 4, 4], Affine3::IDENTITY, |_| 1.0);
    let grid = voxels.grid();
    for (origin, direction) in [
        (Vec3::new(-1.0, 2.0, 0.5), Vec3::X),
        (Vec3::new(2.0, 0.5, 0.5), Vec3::X),
        (Vec3::new(-1.0, -1.0, 0.5), Vec3::new(-0.6, 0.8, 0.0)),
        (Vec3::new(0.5, 0.5, 1.0 + 1e-6), Vec3::Y),
    ] {
        assert_eq!(grid.majorant_segment(&Ray::new(origin, direction), 0.0), MajorantSegment::vacuum(f32::INFINITY));
    }
    let through = Ray::new(Vec3::new(-1.0, 0.5, 0.5), Vec3::X);
    assert_eq!(grid.majorant_segment(&through, 0.0), MajorantSegment::vacuum(1.0));
    assert_eq!(grid.majorant_segment(&through, 2.0), MajorantSegment::vacuum(f32::INFINITY));
    let inside = grid.majorant_segment(&through, 1.0);
    assert!(inside.is_constant() && inside.until > 1.0 && inside.majorant == ABSORPTION + SCATTERING);
}

#[test]
fn empty_blocks_are_passed_in_one_step() {
    let n = 16 * BLOCK;
    let mut voxels = Voxels::new([n, 1, 1], Affine3::IDENTITY, |i| f32::from(u8::from(i as u32 == n - 1)));
    let grid = voxels.grid();
    let segment = grid.majorant_segment(&Ray::new(Vec3::new(-1.0, 0.5, 0.5), Vec3::X), 0.0);
    assert!(segment.majorant.is_black());
    // The last block, or the one before it, which interpolates with its neighbour.
    let marching = grid.marching_segment(&Ray::new(Vec3::new(-1.0, 0.5, 0.5), Vec3::X), 0.0);
    assert_eq!(marching, segment);
    assert_near(segment.until, 2.0 - 1.0 / 16.0, 1e-6, "start of the last block");
}

/// Thick smoke ends segments early, so that bounds are tight; marching has no use for bounds.
#[test]
fn smoke_is_one_segment_however_thick() {
    let n = 16 * BLOCK;
    let mut voxels = Voxels::new([n, 1, 1], Affine3::IDENTITY, |i| 1e3 * (1.0 + i as f32));
    let grid = voxels.grid();
    let ray = Ray::new(Vec3::new(-1.0, 0.5, 0.5), Vec3::X);
    assert!(grid.majorant_segment(&ray, 1.0).until < 1.2);
    assert_near(grid.marching_segment(&ray, 1.0).until, 2.0, 1e-5, "end of the smoke");
}

#[test]
fn lookups_agree_with_the_definition_in_double_precision() {
    let mut rng = Generator::new(3);
    for size in [[5, 7, 3], [1, 6, 1], [1, 1, 1], [2, 1, 9], [33, 4, 8]] {
        for _ in 0..10 {
            let placement = placement(&mut rng, 1.0);
            let mut random = Generator::child(&mut rng);
            let mut voxels = Voxels::new(size, placement, |_| uniform(&mut random));
            let values = voxels.values.clone();
            let grid = voxels.grid();
            for _ in 0..200 {
                let local = Vec3::splat(0.5) + point(&mut rng, 0.6);
                // Within rounding of a face the answer is either.
                if local.to_array().iter().any(|p| p.abs() < 1e-5 || (p - 1.0).abs() < 1e-5) {
                    continue;
                }
                let density = trilinear(size, &values, local.to_array().map(f64::from)) as f32;
                let there = grid.properties(placement.transform_point3(local));
                // Position rounds by 1e-6 of the box, 33 cells of slope 1.
                assert_near(there.scattering[2], 2.0 * density, 1e-4, "scattering");
                assert_near(there.absorption[1], 0.4 * density, 1e-4, "absorption");
                let sum = grid.extinction(placement.transform_point3(local));
                assert_near(sum[0], density, 1e-4, "extinction");
            }
        }
    }
}

#[test]
fn outer_half_cells_are_constant_and_cell_centres_exact() {
    let mut voxels = Voxels::new([4, 1, 1], Affine3::IDENTITY, |i| [3.0, 5.0, 4.0, 8.0][i]);
    let grid = voxels.grid();
    let at = |x: f32| grid.extinction(Vec3::new(x, 0.3, 0.9))[0];
    assert_eq!(
        [at(0.0), at(0.1), at(0.125), at(0.375), at(0.625), at(0.875), at(0.95), at(1.0)],
        [3.0, 3.0, 3.0, 5.0, 4.0, 8.0, 8.0, 8.0]
    );
    assert_eq!([at(0.25), at(0.5), at(0.75)], [4.0, 4.5, 6.0]);
    assert_eq!([at(-1e-6), at(1.000_001)], [0.0, 0.0]);
}

#[test]
fn bytes_agree_with_floats() {
    let mut rng = Generator::new(4);
    let bytes: Vec<u8> = (0..6 * 5 * 4).map(|_| (256.0 * uniform(&mut rng)) as u8).collect();
    let mut voxels = Voxels::new([6, 5, 4], placement(&mut rng, 1.0), |i| f32::from(bytes[i]) / 255.0);
    let placement = voxels.placement;
    let floats = voxels.grid();
    let mut blocks = vec![MinMax::default(); DensityGrid::block_count([6, 5, 4])];
    let density = Density::U8(&bytes);
    let grid = DensityGrid::new([6, 5, 4], density, &SMOKE, placement, &mut blocks).unwrap();
    for _ in 0..2000 {
        let p = placement.transform_point3(Vec3::splat(0.5) + point(&mut rng, 0.6));
        assert_near(grid.extinction(p)[2], floats.extinction(p)[2], 1e-6, "value");
        let (a, b) = (grid.gradients(p).extinction, floats.gradients(p).extinction);
        assert_near((a - b).norm().max_element(), 0.0, 1e-4, "gradient");
        check_walk(&grid, &ray_around(&mut rng, &placement), 4.0, 1e-5, &mut rng);
    }
}

#[test]
fn gradients_of_grids_agree_with_differences_within_cells() {
    let mut rng = Generator::new(5);
    for _ in 0..40 {
        let size = [4, 3, 5];
        let placement = placement(&mut rng, 1.0);
        let mut random = Generator::child(&mut rng);
        let mut voxels = Voxels::new(size, placement, |_| uniform(&mut random));
        let grid = voxels.grid();
        for _ in 0..100 {
            // Away from planes between cells, and from faces.
            let cell = Vec3::new(uniform(&mut rng) * 4.99, uniform(&mut rng) * 3.99, uniform(&mut rng) * 5.99).floor();
            let q = cell - Vec3::ONE + Vec3::splat(0.5) + point(&mut rng, 0.4);
            let local = (q + Vec3::splat(0.5)) / Vec3::new(4.0, 3.0, 5.0);
            if local.min_element() < 0.02 || local.max_element() > 0.98 {
                continue;
            }
            let p = placement.transform_point3(local);
            let analytic = grid.gradients(p).extinction;
            let numeric = numeric_gradient(&grid, p, 4e-3 * grid.resolution());
            let error = (analytic - numeric).norm().max_element();
            // Rounding of 1e-7 over a step of 3e-4 m; curvature in shear.
            assert!(error <= 2e-3 * (1.0 + analytic.norm().max_element()), "{error}: {analytic:?} {numeric:?}");
            // Scattering and extinction share one density.
            let (s, e) = (grid.gradients(p).scattering.x[0], analytic.x[0]);
            assert_near(s, 0.9 * e, 1e-4 * e.abs() + 1e-6, "scattering");
        }
    }
}

#[test]
fn gradient_at_a_plane_of_centres_belongs_to_the_upper_cell() {
    let mut voxels = Voxels::new([4, 1, 1], Affine3::IDENTITY, |i| [0.0, 1.0, 1.0, 3.0][i]);
    let grid = voxels.grid();
    let slope = |x: f32| grid.gradients(Vec3::new(x, 0.5, 0.5)).extinction.x[0];
    assert_eq!([slope(0.1), slope(0.125), slope(0.375), slope(0.625), slope(0.875)], [0.0, 4.0, 0.0, 8.0, 0.0]);
}

#[test]
fn hessian_of_a_quadratic_density_is_its_own_in_any_placement() {
    let mut rng = Generator::new(6);
    for _ in 0..20 {
        let placement = placement(&mut rng, 1.0);
        let size = [9, 8, 7];
        let curve = |p: Vec3| 2.0 + p.x * p.x - 0.5 * p.y * p.y + 0.7 * p.x * p.z + 0.2 * p.y;
        let local = |i: usize| {
            Vec3::new((i % 9) as f32 + 0.5, (i / 9 % 8) as f32 + 0.5, (i / 72) as f32 + 0.5) / Vec3::new(9.0, 8.0, 7.0)
        };
        let mut voxels = Voxels::new(size, placement, |i| curve(local(i)));
        let grid = voxels.grid();
        let inverse = placement.matrix3.inverse();
        let expected = |a: Vec3, b: Vec3| {
            let (a, b) = (inverse * a, inverse * b);
            2.0 * a.x * b.x - a.y * b.y + 0.7 * (a.x * b.z + a.z * b.x)
        };
        // At cell centres differences over a cell are exact.
        let hessian = grid.extinction_hessian(placement.transform_point3(local(4 + 9 * 3 + 72 * 3)));
        for (a, b) in [(Vec3::X, Vec3::X), (Vec3::X, Vec3::Y), (Vec3::Y, Vec3::Z), (Vec3::Z, Vec3::Z)] {
            let scale = inverse.to_cols_array().iter().map(|v| v * v).sum::<f32>();
            assert_near(hessian.between(a, b)[0], expected(a, b), 2e-4 * scale, "second derivative");
        }
        assert_eq!(grid.extinction_hessian(placement.transform_point3(Vec3::splat(1.5))).xx, Spectrum::ZERO);
    }
}

#[test]
fn a_second_grid_absorbs_and_a_third_emits() {
    let mut rng = Generator::new(13);
    let place = placement(&mut rng, 1.0);
    let count = 10 * 9 * 8;
    let smooth: Vec<f32> = (0..count).map(islands(&mut rng)).collect();
    let soot: Vec<u8> = (0..count).map(islands(&mut rng)).map(|v| (200.0 * v) as u8).collect();
    let fire: Vec<f32> = (0..count).map(islands(&mut rng)).collect();
    let mut blocks = vec![MinMax::default(); 3 * DensityGrid::block_count([10, 9, 8])];
    let (a, rest) = blocks.split_at_mut(DensityGrid::block_count([10, 9, 8]));
    let (b, c) = rest.split_at_mut(a.len());
    let density = Density::F32(&smooth);
    let steam = Properties { absorption: Spectrum::ONE, ..SMOKE };
    let grid = DensityGrid::new([10, 9, 8], density, &steam, place, a)
        .and_then(|g| g.with_absorption_grid(Density::U8(&soot), b))
        .and_then(|g| g.with_emission_grid(Density::F32(&fire), Spectrum::new(9.0, 3.0, 1.0), c))
        .unwrap();
    assert!(grid.is_emissive() && !grid.is_grey());
    for _ in 0..500 {
        let ray = ray_around(&mut rng, &place);
        check_walk(&grid, &ray, 4.0, 1e-5, &mut rng);
        let p = place.transform_point3(Vec3::new(uniform(&mut rng), uniform(&mut rng), uniform(&mut rng)));
        let q = grid.properties(p);
        let sum = grid.extinction(p) - q.extinction();
        assert_near(sum.map(f32::abs).max_element(), 0.0, 1e-6, "extinction");
        // Vacuum may not emit.
        let segment = grid.majorant_segment(&Ray::new(p, ray.direction), 0.0);
        assert!(q.emission.is_black() || !segment.majorant.is_black());
    }
}
