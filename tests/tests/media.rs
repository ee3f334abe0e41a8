//! Media: bounds hold along every ray, values and derivatives are those of an independent
//! implementation, faces carry what the interior gradient leaves out.

use std::time::Instant;

use fogbow::host::{Empty, Medium, Stretch};
use fogbow::math::{Affine3, Bounds, Mat3, Ray, Vec2, Vec3, float};
use fogbow::medium::{
    AnyMedium, BLOCK, Density, FractalNoise, Grid, Homogeneous, MediumError, MinMax, Noise, Overlap, Placed, Region,
};
use fogbow::phase::{Lobe, Phase};
use fogbow::sampling::{Generator, uniform, uniform2, warp};
use fogbow::spectrum::{Gradient, Spectrum};
use proptest::prelude::*;

const SCATTERING: Spectrum = Spectrum::new(0.9, 0.5, 2.0);
const ABSORPTION: Spectrum = Spectrum::new(0.1, 0.4, 0.0);

/// A grid with memory of its own.
struct Voxels {
    size: [u32; 3],
    values: Vec<f32>,
    blocks: Vec<MinMax>,
    placement: Affine3,
}

impl Voxels {
    fn new(size: [u32; 3], placement: Affine3, values: impl FnMut(usize) -> f32) -> Self {
        let count = size.iter().map(|&n| n as usize).product();
        let blocks = vec![MinMax::default(); Grid::block_count(size)];
        Self { size, values: (0..count).map(values).collect(), blocks, placement }
    }

    fn grid(&mut self) -> Grid<'_> {
        self.try_grid().expect("valid grid")
    }

    fn try_grid(&mut self) -> Result<Grid<'_>, MediumError> {
        let density = Density::F32(&self.values);
        Grid::new(self.size, density, ABSORPTION, SCATTERING, Phase::ISOTROPIC, self.placement, &mut self.blocks)
    }
}

fn point(rng: &mut Generator, extent: f32) -> Vec3 {
    Vec3::new(uniform(rng), uniform(rng), uniform(rng)) * (2.0 * extent) - Vec3::splat(extent)
}

fn direction(rng: &mut Generator) -> Vec3 {
    warp::uniform_sphere(uniform2(rng))
}

/// Rotation, shear, unequal edges and an offset, of all sizes around `scale`.
fn placement(rng: &mut Generator, scale: f32) -> Affine3 {
    let rotation = |rng: &mut Generator| {
        let frame = fogbow::math::Frame::around(direction(rng));
        let (sin, cos) = float::sin_cos(6.0 * uniform(rng));
        Mat3::from_cols(frame.u * cos + frame.v * sin, frame.v * cos - frame.u * sin, frame.w)
    };
    let edges = Vec3::new(0.3 + uniform(rng), 0.3 + uniform(rng), 0.3 + uniform(rng));
    let matrix3 = rotation(rng) * Mat3::from_diagonal(edges * scale) * rotation(rng);
    Affine3 { matrix3, translation: point(rng, scale) }
}

/// Islands in empty space, with values over several orders of magnitude.
fn islands(rng: &mut Generator) -> impl FnMut(usize) -> f32 {
    let mut rng = Generator::child(rng);
    let mut run = (0_u32, 0.0);
    move |_| {
        if run.0 == 0 {
            let level = uniform(&mut rng);
            run = ((20.0 * uniform(&mut rng)) as u32, if level < 0.6 { 0.0 } else { level * level });
        }
        run.0 = run.0.saturating_sub(1);
        if run.1 == 0.0 { 0.0 } else { run.1 * (1e-3 + uniform(&mut rng)) }
    }
}

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

fn assert_near(a: f32, b: f32, tolerance: f32, what: &str) {
    assert!((a - b).abs() <= tolerance, "{what}: {a} and {b} differ by more than {tolerance}");
}

/// Walks along a ray and checks every promise of [`Medium::stretch`]; returns the number of steps.
///
/// Within `blur` (m) of a face its two sides cannot be told apart, and either's value is right.
fn check_walk(medium: &impl Medium, ray: &Ray, end: f32, blur: f32, rng: &mut Generator) -> u32 {
    let (mut t, mut steps) = (0.0_f32, 0);
    while t < end {
        let stretch = medium.stretch(ray, t);
        steps += 1;
        assert!(stretch.until > t, "no progress at {t}: {stretch:?}, {ray:?}");
        assert!(steps < 20_000, "endless walk: {ray:?}");
        assert!(stretch.minorant.is_valid() && stretch.majorant.is_valid(), "{stretch:?}");
        let until = stretch.until.min(end);
        for i in 0..6 {
            let s = match i {
                0 => t,
                1 => until,
                _ => t + (until - t) * uniform(rng),
            };
            let sigma = medium.extinction(ray.at(s));
            for channel in 0..3 {
                let (low, high) = (stretch.minorant[channel], stretch.majorant[channel]);
                assert!(low <= high, "{stretch:?}");
                let keeps = |value: f32| value >= low && value <= high;
                let value = sigma[channel];
                // Where a face jumps within rounding of the point, the other side's value will do.
                let jumps_to_bounds = || {
                    around(ray.at(s), blur).any(|p| {
                        let other = medium.extinction(p)[channel];
                        keeps(other) && (other - value).abs() > 1e-3 * value.max(other)
                    })
                };
                assert!(keeps(value) || jumps_to_bounds(), "{value} outside {stretch:?} at {s} of {ray:?}");
            }
            let near_end = (s - t).abs() <= blur || (s - until).abs() <= blur;
            if stretch.is_constant() && !near_end {
                let middle = medium.properties(ray.at(t + 0.5 * (until - t)));
                let here = medium.properties(ray.at(s));
                if middle.scattering.is_black() || here.scattering.is_black() {
                    continue; // along a face
                }
                let difference = (middle.scattering - here.scattering).map(f32::abs).max_element();
                assert!(difference <= 1e-6 * here.scattering.max_element(), "{middle:?} {here:?}");
            }
        }
        t = until;
    }
    steps
}

/// Points around one, `distance` (m) away along each axis and diagonal.
fn around(point: Vec3, distance: f32) -> impl Iterator<Item = Vec3> {
    let offset = |i: i32| Vec3::new((i % 3 - 1) as f32, (i / 3 % 3 - 1) as f32, (i / 9 - 1) as f32);
    (0..27).map(move |i| point + offset(i) * distance)
}

/// A ray that starts somewhere around the placement, often parallel to its axes.
fn ray_around(rng: &mut Generator, placement: &Affine3) -> Ray {
    let local = Vec3::splat(0.5) + point(rng, 1.2);
    let along = match (8.0 * uniform(rng)) as u32 {
        0 => Vec3::X,
        1 => Vec3::NEG_Y,
        2 => Vec3::new(0.0, 1.0, -1.0),
        3 => Vec3::new(-1.0, 1e-9, 1e-20),
        _ => direction(rng),
    };
    // On planes between cells and blocks, too.
    let local = if uniform(rng) < 0.3 { (local * 8.0).round() / 8.0 } else { local };
    let direction = (placement.matrix3 * along).normalize();
    Ray::new(placement.transform_point3(local), direction)
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
        assert_eq!(grid.stretch(&Ray::new(origin, direction), 0.0), Stretch::vacuum(f32::INFINITY));
    }
    let through = Ray::new(Vec3::new(-1.0, 0.5, 0.5), Vec3::X);
    assert_eq!(grid.stretch(&through, 0.0), Stretch::vacuum(1.0));
    assert_eq!(grid.stretch(&through, 2.0), Stretch::vacuum(f32::INFINITY));
    let inside = grid.stretch(&through, 1.0);
    assert!(inside.is_constant() && inside.until > 1.0 && inside.majorant == ABSORPTION + SCATTERING);
}

#[test]
fn empty_blocks_are_passed_in_one_step() {
    let n = 16 * BLOCK;
    let mut voxels = Voxels::new([n, 1, 1], Affine3::IDENTITY, |i| f32::from(u8::from(i as u32 == n - 1)));
    let grid = voxels.grid();
    let stretch = grid.stretch(&Ray::new(Vec3::new(-1.0, 0.5, 0.5), Vec3::X), 0.0);
    assert!(stretch.majorant.is_black());
    // The last block, or the one before it, which interpolates with its neighbour.
    assert_near(stretch.until, 2.0 - 1.0 / 16.0, 1e-6, "start of the last block");
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
    let mut blocks = vec![MinMax::default(); Grid::block_count([6, 5, 4])];
    let density = Density::U8(&bytes);
    let grid = Grid::new([6, 5, 4], density, ABSORPTION, SCATTERING, Phase::ISOTROPIC, placement, &mut blocks).unwrap();
    for _ in 0..2000 {
        let p = placement.transform_point3(Vec3::splat(0.5) + point(&mut rng, 0.6));
        assert_near(grid.extinction(p)[2], floats.extinction(p)[2], 1e-6, "value");
        let (a, b) = (grid.gradients(p).extinction, floats.gradients(p).extinction);
        assert_near((a - b).norm().max_element(), 0.0, 1e-4, "gradient");
        check_walk(&grid, &ray_around(&mut rng, &placement), 4.0, 1e-5, &mut rng);
    }
}

/// Central differences of extinction, in `f32` with a step that balances rounding and curvature.
fn numeric_gradient(medium: &impl Medium, p: Vec3, step: f32) -> Gradient {
    let along = |axis: Vec3| (medium.extinction(p + axis * step) - medium.extinction(p - axis * step)) / (2.0 * step);
    Gradient { x: along(Vec3::X), y: along(Vec3::Y), z: along(Vec3::Z) }
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

/// Optical thickness of a ray by stretches of vacuum and of constant medium alone.
fn thickness(medium: &impl Medium, ray: &Ray) -> f32 {
    let (mut t, mut sum) = (0.0_f32, 0.0_f64);
    while t < ray.length {
        let stretch = medium.stretch(ray, t);
        assert!(stretch.is_constant());
        let until = stretch.until.min(ray.length);
        sum += f64::from(stretch.majorant[0]) * f64::from(until - t);
        t = until;
    }
    sum as f32
}

/// Gradient of thickness by the interior and boundary terms of the sheet, for homogeneous bodies.
fn thickness_gradient(medium: &impl Medium, ray: &Ray, is_joint: bool) -> Vec3 {
    let u = -ray.direction;
    let mut sum = if is_joint { Vec3::ZERO } else { u * (thickness(medium, ray) / ray.length) };
    medium.faces(ray, &mut |face| {
        assert_near(face.normal.length(), 1.0, 1e-5, "normal");
        let fraction = face.distance / ray.length;
        let weight = if is_joint { 1.0 } else { 1.0 - fraction };
        sum += face.normal * (weight * face.jump[0] / face.normal.dot(u).abs().max(1e-3));
    });
    sum
}

/// Compares both gradients with differences; rays that graze a face are left out.
fn check_faces(medium: &impl Medium, rng: &mut Generator, rays: u32) -> u32 {
    let mut checked = 0;
    for _ in 0..rays {
        let (from, to) = (point(rng, 2.0), point(rng, 2.0));
        let ray = Ray::between(from, to);
        // Faces just beyond the ends count, too: differences reach them.
        const MARGIN: f32 = 0.05;
        let longer = Ray { origin: ray.at(-MARGIN), direction: ray.direction, length: ray.length + 2.0 * MARGIN };
        let mut faces = Vec::new();
        medium.faces(&longer, &mut |face| faces.push((face.distance, face.normal.dot(ray.direction).abs())));
        let is_clear = |at: f32, from: f32| (at - from).abs() > 2.0 * MARGIN;
        let are_clear = faces.iter().enumerate().all(|(i, &(at, cosine))| {
            let apart = faces[..i].iter().all(|other| is_clear(at, other.0));
            cosine > 0.3 && apart && is_clear(at, 0.0) && is_clear(at, longer.length)
        });
        if !are_clear {
            continue;
        }
        const H: f32 = 2e-3;
        // Nor may a displaced ray pass the other side of an edge.
        let normals = |from: Vec3, to: Vec3| {
            let mut normals = Vec::new();
            medium.faces(&Ray::between(from, to), &mut |face| normals.push(face.normal));
            normals
        };
        let here = normals(from, to);
        let is_same = |from: Vec3, to: Vec3| {
            let there = normals(from, to);
            here.len() == there.len() && here.iter().zip(&there).all(|(a, b)| a.dot(*b) > 0.99)
        };
        if !around(Vec3::ZERO, H).all(|o| is_same(from + o, to) && is_same(from + o, to + o)) {
            continue;
        }
        checked += 1;
        for is_joint in [false, true] {
            let at = |offset: Vec3| {
                let moved = if is_joint { to + offset } else { to };
                thickness(medium, &Ray::between(from + offset, moved))
            };
            let along = |axis: Vec3| (at(axis * H) - at(-axis * H)) / (2.0 * H);
            let numeric = Vec3::new(along(Vec3::X), along(Vec3::Y), along(Vec3::Z));
            let analytic = thickness_gradient(medium, &ray, is_joint);
            // Rounding 5e-7/H; third derivatives of spheres at 0.3 from grazing, H² of them.
            let tolerance = 5e-3 * (1.0 + analytic.length());
            assert!((numeric - analytic).length() < tolerance, "{numeric} {analytic} joint {is_joint} {ray:?}");
        }
    }
    checked
}

#[test]
fn faces_complete_the_gradients_of_thickness() {
    let mut rng = Generator::new(9);
    let fog = Homogeneous::new(ABSORPTION, SCATTERING, Phase::ISOTROPIC).unwrap();
    let ball = Region::sphere(Vec3::new(0.2, -0.1, 0.0), 0.9).unwrap();
    let mut tilted = placement(&mut rng, 1.5);
    tilted.translation = tilted.matrix3 * Vec3::splat(-0.5);
    let cube = Region::unit_cube(tilted).unwrap();
    let hole = [Region::sphere(Vec3::ZERO, 0.4).unwrap()];
    let outside = [Region::sphere(Vec3::new(1.0, 0.0, 0.0), 0.7).unwrap(), hole[0]];
    let mut voxels = Voxels::new([5, 4, 3], tilted, |_| 1.0);
    let grid = voxels.grid();
    for checked in [
        check_faces(&Placed::new(fog, ball), &mut rng, 800),
        check_faces(&Placed::new(fog, cube), &mut rng, 800),
        check_faces(&Placed::new(fog, ball).with_holes(&hole), &mut rng, 800),
        check_faces(&Placed::new(fog, cube).with_holes(&outside), &mut rng, 800),
        check_faces(&Placed::new(fog, Region::Everywhere).with_holes(&outside), &mut rng, 800),
        check_faces(&grid, &mut rng, 800),
        // The same faces twice over count once.
        check_faces(&Placed::new(grid, cube), &mut rng, 800),
        check_faces(&Placed::new(grid, ball), &mut rng, 800),
    ] {
        assert!(checked > 60, "{checked}");
    }
}

#[test]
fn faces_of_one_sphere_give_the_closed_form_of_the_sheet() {
    let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::splat(1.5), Phase::ISOTROPIC).unwrap();
    let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.0).unwrap());
    let ray = Ray::between(Vec3::new(0.3, 0.2, 0.0), Vec3::new(2.0, 1.0, 1.5));
    let mut faces = Vec::new();
    ball.faces(&ray, &mut |face| faces.push(face));
    let [face] = faces[..] else { panic!("one face, not {faces:?}") };
    assert_eq!(face.jump, Spectrum::splat(-1.5));
    let (m, u, fraction) = (ray.at(face.distance), -ray.direction, face.distance / ray.length);
    assert_near((m - face.normal).length(), 0.0, 1e-6, "normal");
    // Sheet § 1.4: ∇τ = σ [ t u + (1 − t) m/(m·u) ].
    let expected = (u * fraction + m * ((1.0 - fraction) / m.dot(u))) * 1.5;
    assert_near((thickness_gradient(&ball, &ray, false) - expected).length(), 0.0, 1e-5, "gradient");
}

#[test]
fn placed_media_walk_through_regions_and_holes() {
    let mut rng = Generator::new(10);
    let holes = [Region::sphere(Vec3::ZERO, 0.4).unwrap(), Region::sphere(Vec3::new(0.5, 0.0, 0.0), 0.3).unwrap()];
    let shape = FractalNoise { frequency: 1.5, ..FractalNoise::default() };
    let noise = Noise::new(shape, ABSORPTION, SCATTERING, Phase::ISOTROPIC).unwrap();
    for _ in 0..300 {
        let placement = placement(&mut rng, 1.0);
        let placed = Placed::new(noise, Region::unit_cube(placement).unwrap()).with_holes(&holes);
        check_walk(&placed, &ray_around(&mut rng, &placement), 6.0, 1e-5, &mut rng);
        let ball = Placed::new(noise, Region::sphere(point(&mut rng, 1.0), 0.1 + uniform(&mut rng)).unwrap());
        check_walk(&ball, &ray_around(&mut rng, &placement), 6.0, 1e-5, &mut rng);
        let p = point(&mut rng, 1.0);
        let expected = if placed.contains(p) { noise.extinction(p) } else { Spectrum::ZERO };
        assert_eq!(placed.extinction(p), expected);
    }
}

#[test]
fn noise_keeps_its_bounds_along_rays_and_its_gradient_is_right() {
    let mut rng = Generator::new(11);
    for round in 0..60 {
        let shape = FractalNoise {
            frequency: [0.01, 1.0, 30.0][round % 3],
            octaves: 1 + (6.0 * uniform(&mut rng)) as u32,
            lacunarity: 1.5 + uniform(&mut rng),
            gain: 0.3 + 0.5 * uniform(&mut rng),
            offset: uniform(&mut rng) - 0.5,
            amplitude: uniform(&mut rng) * 2.0,
            max_density: 0.2 + uniform(&mut rng),
            seed: round as u32,
        };
        let noise = Noise::new(shape, ABSORPTION, SCATTERING * 3.0, Phase::ISOTROPIC).unwrap();
        let scale = 1.0 / shape.frequency;
        for _ in 0..8 {
            let ray = Ray::new(point(&mut rng, 20.0) * scale, direction(&mut rng));
            check_walk(&noise, &ray, 4.0 * scale, 0.0, &mut rng);
            let p = ray.origin;
            let density = shape.density(p);
            if density < 0.05 || density > shape.max_density - 0.05 {
                continue;
            }
            let analytic = noise.gradients(p).extinction;
            let numeric = numeric_gradient(&noise, p, 0.02 * noise.resolution());
            let error = (analytic - numeric).norm().max_element();
            // Rounding of coordinates: 1e-6 of 20 cells and more over two hundredths of a quarter.
            assert!(error < 0.02 * (analytic.norm().max_element() + 10.0 / scale), "{error} {analytic:?} {numeric:?}");
        }
    }
    // The bounds are of use: thin parts are known to be thin.
    let shape = FractalNoise { offset: -0.1, ..FractalNoise::default() };
    let noise = Noise::new(shape, Spectrum::ZERO, Spectrum::splat(4.0), Phase::ISOTROPIC).unwrap();
    let (mut t, mut bound, mut value) = (0.0, 0.0, 0.0);
    let ray = Ray::new(Vec3::ZERO, Vec3::new(0.6, 0.48, 0.64));
    while t < 500.0 {
        let stretch = noise.stretch(&ray, t);
        bound += stretch.majorant[0] * (stretch.until - t);
        value += noise.extinction(ray.at(t + uniform(&mut rng) * (stretch.until - t)))[0] * (stretch.until - t);
        t = stretch.until;
    }
    println!("bound {bound}, mean {value}, largest {}", 4.0 * t);
    assert!(bound < 0.7 * (4.0 * t), "{bound} {value}");
}

#[test]
fn overlapping_media_add_and_mix() {
    let mut rng = Generator::new(12);
    let mut voxels = Voxels::new([6, 6, 6], placement(&mut rng, 1.0), islands(&mut rng));
    let placement = voxels.placement;
    let fog = Homogeneous::new(ABSORPTION, SCATTERING, Lobe::HenyeyGreenstein { g: 0.6 }).unwrap();
    let fog = fog.with_emission(Spectrum::ONE).unwrap();
    let shape = FractalNoise { frequency: 3.0, ..FractalNoise::default() };
    let cloud = Noise::new(shape, ABSORPTION, SCATTERING, Lobe::Rayleigh).unwrap();
    let ball = Region::sphere(Vec3::ZERO, 0.8).unwrap();
    let media = [
        Placed::new(AnyMedium::from(voxels.grid()), Region::Everywhere),
        Placed::new(AnyMedium::from(fog), ball),
        Placed::new(AnyMedium::from(cloud), Region::sphere(Vec3::X, 0.9).unwrap()),
    ];
    let all = Overlap::new(&media, |m| m.medium().phase()).unwrap();
    for _ in 0..300 {
        let ray = ray_around(&mut rng, &placement);
        check_walk(&all, &ray, 4.0, 1e-5, &mut rng);
        let p = ray.at(uniform(&mut rng));
        let parts = media.map(|m| m.properties(p));
        let sum = all.properties(p);
        let scattering: Spectrum = parts.iter().map(|q| q.scattering).sum();
        assert_near((sum.scattering - scattering).max_element(), 0.0, 1e-6, "scattering");
        assert_eq!(sum.emission, if ball.contains(p) { Spectrum::ONE } else { Spectrum::ZERO });
        let cosine: Spectrum = parts.iter().map(|q| q.scattering * q.phase.mean_cosine()).sum();
        let difference = sum.phase.mean_cosine() * scattering - cosine;
        assert_near(difference.map(f32::abs).max_element(), 0.0, 1e-5, "mean cosine");
    }
    assert!(all.is_emissive() && !all.is_grey());
    let none = Overlap::<Homogeneous>::new(&[], Homogeneous::phase).unwrap();
    let ray = Ray::new(Vec3::ZERO, Vec3::X);
    assert_eq!(none.stretch(&ray, 0.0), Empty.stretch(&ray, 0.0));
    let lobe = |i: usize| Lobe::HenyeyGreenstein { g: 0.1 * i as f32 };
    let five: [_; 5] = core::array::from_fn(|i| Homogeneous::new(ABSORPTION, SCATTERING, lobe(i)).unwrap());
    assert_eq!(Overlap::new(&five, Homogeneous::phase), Err(MediumError::TooManyLobes));
}

#[test]
fn a_second_grid_absorbs_and_a_third_emits() {
    let mut rng = Generator::new(13);
    let place = placement(&mut rng, 1.0);
    let count = 10 * 9 * 8;
    let smooth: Vec<f32> = (0..count).map(islands(&mut rng)).collect();
    let soot: Vec<u8> = (0..count).map(islands(&mut rng)).map(|v| (200.0 * v) as u8).collect();
    let fire: Vec<f32> = (0..count).map(islands(&mut rng)).collect();
    let mut blocks = vec![MinMax::default(); 3 * Grid::block_count([10, 9, 8])];
    let (a, rest) = blocks.split_at_mut(Grid::block_count([10, 9, 8]));
    let (b, c) = rest.split_at_mut(a.len());
    let density = Density::F32(&smooth);
    let grid = Grid::new([10, 9, 8], density, Spectrum::ONE, SCATTERING, Phase::ISOTROPIC, place, a)
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
        let stretch = grid.stretch(&Ray::new(p, ray.direction), 0.0);
        assert!(q.emission.is_black() || !stretch.majorant.is_black());
    }
}

#[test]
fn constructors_name_what_they_refuse() {
    let refused = |size: [u32; 3], values: Vec<f32>, placement: Affine3| {
        let blocks = vec![MinMax::default(); Grid::block_count(size)];
        Voxels { size, values, blocks, placement }.try_grid().err()
    };
    let unit = Affine3::IDENTITY;
    let flat = Affine3 { matrix3: Mat3::from_diagonal(Vec3::new(1.0, 0.0, 1.0)), translation: Vec3::ZERO };
    let skew = Mat3::from_cols(Vec3::X, Vec3::Y, Vec3::X + Vec3::Y);
    assert_eq!(refused([2, 2, 2], vec![1.0; 8], unit), None);
    assert_eq!(refused([2, 0, 2], vec![], unit), Some(MediumError::Size));
    assert_eq!(refused([2, 2, 2], vec![1.0; 7], unit), Some(MediumError::Size));
    assert_eq!(refused([u32::MAX, u32::MAX, 1], vec![1.0; 7], unit), Some(MediumError::Size));
    for bad in [f32::NAN, -1.0, f32::INFINITY] {
        assert_eq!(refused([1, 1, 2], vec![0.0, bad], unit), Some(MediumError::Density));
    }
    assert_eq!(refused([1, 1, 1], vec![f32::MAX], unit), Some(MediumError::Coefficients));
    assert_eq!(refused([1, 1, 1], vec![1.0], flat), Some(MediumError::Placement));
    let skew = Affine3 { matrix3: skew, translation: Vec3::ZERO };
    assert_eq!(refused([1, 1, 1], vec![1.0], skew), Some(MediumError::Placement));
    let nowhere = Affine3 { translation: Vec3::NAN, ..unit };
    assert_eq!(refused([1, 1, 1], vec![1.0], nowhere), Some(MediumError::Placement));
    let grid = |coefficient: f32, blocks: &mut [MinMax]| {
        let sigma = Spectrum::splat(coefficient);
        Grid::new([1, 1, 1], Density::U8(&[9]), sigma, sigma, Phase::ISOTROPIC, unit, blocks).err()
    };
    assert_eq!(grid(f32::NAN, &mut [MinMax::default()]), Some(MediumError::Coefficients));
    assert_eq!(grid(1.0, &mut []), Some(MediumError::Blocks));
    assert!(Region::sphere(Vec3::ZERO, 0.0).is_err() && Region::sphere(Vec3::NAN, 1.0).is_err());
    assert!(Region::bounds(Bounds::EMPTY).is_err());
    assert_eq!(Region::bounds(Bounds::EVERYTHING), Ok(Region::Everywhere));
    let bad = [
        FractalNoise { frequency: 0.0, ..FractalNoise::default() },
        FractalNoise { octaves: 17, ..FractalNoise::default() },
        FractalNoise { lacunarity: 0.5, ..FractalNoise::default() },
        FractalNoise { gain: f32::NAN, ..FractalNoise::default() },
        FractalNoise { max_density: f32::INFINITY, ..FractalNoise::default() },
    ];
    for shape in bad {
        assert_eq!(Noise::new(shape, ABSORPTION, SCATTERING, Phase::ISOTROPIC), Err(MediumError::Noise));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn intervals_lie_in_their_regions(
        seed in any::<u64>(), scale in prop::sample::select(vec![1e-6_f32, 1e-2, 1.0, 1e4, 1e9]),
    ) {
        let mut rng = Generator::new(seed);
        let placement = placement(&mut rng, scale);
        let cube = Region::unit_cube(placement).unwrap();
        let ball = Region::sphere(placement.translation, scale * (0.1 + uniform(&mut rng))).unwrap();
        let ray = ray_around(&mut rng, &placement);
        for region in [cube, ball] {
            let crossings = region.crossings(&ray);
            prop_assert_eq!(crossings.map(|c| (c[0].distance, c[1].distance)), region.interval(&ray));
            let Some([entry, exit]) = crossings else { continue };
            prop_assert!(entry.distance < exit.distance);
            prop_assert!(entry.normal.dot(ray.direction) <= 1e-5 && exit.normal.dot(ray.direction) >= -1e-5);
            let length = exit.distance - entry.distance;
            if length > 1e-3 * scale {
                let blur = 1e-5 * scale;
                for u in [0.1, 0.5, 0.9] {
                    // The ray may run along a face.
                    prop_assert!(around(ray.at(entry.distance + u * length), blur).any(|p| region.contains(p)));
                }
                prop_assert!(!region.contains(ray.at(entry.distance) + entry.normal * blur));
                prop_assert!(!region.contains(ray.at(exit.distance) + exit.normal * blur));
            }
        }
    }

    #[test]
    fn queries_are_total(
        origin in prop::array::uniform3(any::<f32>()), at in prop::array::uniform3(any::<f32>()),
        from in 0.0_f32..f32::MAX, u in prop::array::uniform2(0.0_f32..1.0),
    ) {
        let is_finite = |v: [f32; 3]| v.iter().all(|c| c.is_finite());
        prop_assume!(is_finite(origin) && is_finite(at));
        let mut rng = Generator::new(1);
        let mut voxels = Voxels::new([9, 5, 6], placement(&mut rng, 1.0), islands(&mut rng));
        let grid = voxels.grid();
        let shape = FractalNoise::default();
        let noise = Noise::new(shape, ABSORPTION, SCATTERING, Phase::ISOTROPIC).unwrap();
        let hole = [Region::sphere(Vec3::splat(0.5), 0.2).unwrap()];
        let ray = Ray::new(Vec3::from_array(origin), warp::uniform_sphere(Vec2::from_array(u)));
        let at = Vec3::from_array(at);
        for medium in [AnyMedium::from(grid), AnyMedium::from(noise)] {
            for region in [Region::Everywhere, Region::sphere(Vec3::ZERO, 2.0).unwrap()] {
                let placed = Placed::new(medium, region).with_holes(&hole);
                let stretch = placed.stretch(&ray, from);
                prop_assert!(stretch.until > from && stretch.majorant.is_valid() && stretch.minorant.is_valid());
                prop_assert!(placed.extinction(at).is_valid());
                prop_assert!(placed.gradients(at).extinction.is_finite());
                prop_assert!(placed.extinction_hessian(at).xx.is_finite());
                prop_assert!(placed.mean_extinction(at, from).is_valid());
                let mut is_fine = true;
                placed.faces(&ray, &mut |f| is_fine &= f.normal.is_finite() && f.jump.is_finite());
                prop_assert!(is_fine);
            }
        }
    }
}

/// Prints times: `cargo test -p fogbow-tests --test media -- --ignored --nocapture speed`. A file
/// that ends in 64³ floats, such as a Mitsuba volume, takes the place of the cloud if the variable
/// `FOGBOW_VOLUME` names it.
#[test]
#[ignore = "prints times"]
fn speed() {
    let size = [64, 64, 64];
    let shape = FractalNoise { frequency: 3.0, offset: 0.1, octaves: 4, ..FractalNoise::default() };
    let local = |i: usize| Vec3::new((i % 64) as f32, (i / 64 % 64) as f32, (i / 4096) as f32) / 64.0;
    // A round cloud in empty space.
    let cloud = |p: Vec3| shape.density(p) * (1.0 - 2.2 * (p - Vec3::splat(0.5)).length()).max(0.0);
    let placement = Affine3 { matrix3: Mat3::from_diagonal(Vec3::splat(2.0)), translation: Vec3::splat(-1.0) };
    let mut voxels = Voxels::new(size, placement, |i| 3.5 * cloud(local(i)));
    if let Some(path) = std::env::var_os("FOGBOW_VOLUME") {
        let bytes = std::fs::read(path).unwrap();
        let floats = bytes[bytes.len() - voxels.values.len() * 4..].chunks_exact(4);
        let float = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
        voxels.values = floats.map(|b| 3.5 * float(b)).collect();
    }
    let started = Instant::now();
    let grid = voxels.grid();
    println!("blocks of {BLOCK}³ filled in {:.1} ms", started.elapsed().as_secs_f64() * 1e3);
    let noise = Noise::new(shape, ABSORPTION, SCATTERING, Phase::ISOTROPIC).unwrap();
    let mut rng = Generator::new(1);
    let rays: Vec<Ray> = (0..2000)
        .map(|i| {
            let (a, b) = (point(&mut rng, 1.0), direction(&mut rng));
            if i % 2 == 0 { Ray::new(a, b) } else { Ray { length: f32::INFINITY, ..Ray::between(b * 2.5, a) } }
        })
        .collect();
    let points: Vec<Vec3> = (0..2000).map(|_| point(&mut rng, 1.0)).collect();
    measure("grid", &grid, &rays, &points);
    measure("noise", &noise, &rays, &points);
    measure("any grid", &AnyMedium::from(grid), &rays, &points);
    let ball = Region::sphere(Vec3::ZERO, 1.0).unwrap();
    measure("placed grid", &Placed::new(grid, ball), &rays, &points);
}

/// Least time (ns) of several runs, each of `count` operations: others share the machine.
fn least(count: usize, mut run: impl FnMut()) -> f64 {
    let time = |_| {
        let start = Instant::now();
        run();
        start.elapsed().as_secs_f64() * 1e9 / count as f64
    };
    (0..30).map(time).fold(f64::INFINITY, f64::min)
}

fn measure(name: &str, medium: &impl Medium, rays: &[Ray], points: &[Vec3]) {
    const END: f32 = 4.0;
    let points = &points[..2000];
    let mut sum = 0.0;
    let mut stretches = 0_usize;
    let walks = least(rays.len(), || {
        stretches = 0;
        for ray in rays {
            let mut t = 0.0;
            while t < END {
                let stretch = medium.stretch(ray, t);
                stretches += 1;
                sum += stretch.majorant[0];
                t = stretch.until;
            }
        }
    });
    let steps = stretches as f64 / rays.len() as f64;
    let stretch = walks / steps;
    let lookup = least(points.len(), || sum += points.iter().map(|p| medium.extinction(*p)[0]).sum::<f32>());
    let properties =
        least(points.len(), || sum += points.iter().map(|p| medium.properties(*p).scattering[0]).sum::<f32>());
    let ball = least(100, || sum += points[..100].iter().map(|p| medium.mean_extinction(*p, 0.1)[0]).sum::<f32>());
    // Ratio tracking of every ray to its end, then free flight to the first collision.
    let mut collisions = 0_usize;
    let mut track = |to_end: bool| {
        collisions = 0;
        let time = least(rays.len(), || {
            let mut rng = Generator::new(2);
            collisions = 0;
            for ray in rays {
                let (mut t, mut transmittance) = (0.0_f32, 1.0);
                'ray: while t < END {
                    let stretch = medium.stretch(ray, t);
                    let bound = stretch.majorant.max_element();
                    let end = stretch.until.min(END);
                    if bound == 0.0 {
                        t = end;
                        continue;
                    }
                    loop {
                        t -= float::ln(1.0 - uniform(&mut rng)) / bound;
                        if t >= end {
                            break;
                        }
                        collisions += 1;
                        let ratio = medium.extinction(ray.at(t))[0] / bound;
                        transmittance *= 1.0 - ratio;
                        if !to_end && uniform(&mut rng) < ratio {
                            break 'ray;
                        }
                    }
                    t = end;
                }
                sum += transmittance;
            }
        });
        (time, collisions as f64 / rays.len() as f64)
    };
    let (transmittance, tracked) = track(true);
    let (flight, collided) = track(false);
    println!(
        "{name}: stretch {stretch:.1} ns ({steps:.1} a ray), extinction {lookup:.1} ns, properties {properties:.1} ns, \
         ball {ball:.0} ns, transmittance {transmittance:.0} ns ({tracked:.2} collisions), \
         free flight {flight:.0} ns ({collided:.2}) [{sum}]"
    );
}
