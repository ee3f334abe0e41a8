//! Sparse grids: the same as dense ones that are empty elsewhere.

use fogbow::host::Medium;
use fogbow::math::{Affine3, Ray, Vec3};
use fogbow::medium::{Bricks, MediumError, NodeBounds, SparseGrid};
use fogbow::sampling::{Generator, uniform};

use super::common::*;

/// Cells of a brick, slots of a node.
const CELLS: usize = 512;
const SLOTS: usize = 4096;

/// A sparse grid with memory of its own.
struct Sparse {
    size: [u32; 3],
    nodes: Vec<u32>,
    slots: Vec<u32>,
    cells: Vec<f32>,
    bounds: Vec<NodeBounds>,
}

impl Sparse {
    /// With the bricks that hold something, and the nodes that something in them or beside them needs.
    fn new(size: [u32; 3], values: &[f32]) -> Self {
        let nodes = vec![Bricks::NOTHING; Bricks::node_count(size)];
        let mut sparse = Self { size, nodes, slots: Vec::new(), cells: Vec::new(), bounds: Vec::new() };
        let mut values = values.iter();
        for cell in 0..size.iter().product() {
            let at = [cell % size[0], cell / size[0] % size[1], cell / size[0] / size[1]];
            let value = *values.next().unwrap();
            if value == 0.0 {
                continue;
            }
            for i in 0..27 {
                sparse.slot([i % 3, i / 3 % 3, i / 9].into_iter().zip(at).map(|(step, c)| (c + step - 1) / 8));
            }
            let slot = sparse.slot(at.into_iter().map(|c| c / 8));
            if sparse.slots[slot] == Bricks::NOTHING {
                sparse.slots[slot] = (sparse.cells.len() / CELLS) as u32;
                sparse.cells.extend([0.0; CELLS]);
            }
            let [x, y, z] = at.map(|c| c as usize % 8);
            sparse.cells[sparse.slots[slot] as usize * CELLS + (z * 8 + y) * 8 + x] = value;
        }
        sparse.bounds = vec![NodeBounds::EMPTY; sparse.slots.len() / NodeBounds::SLOTS];
        sparse
    }

    /// The slot of a brick, in a node that is made where there was none.
    fn slot(&mut self, brick: impl Iterator<Item = u32>) -> usize {
        let brick: Vec<u32> = brick.collect();
        let along = self.size.map(|n| n.div_ceil(128));
        let node = |axis: usize| (brick[axis] / 16).min(along[axis] - 1);
        let entry = &mut self.nodes[((node(2) * along[1] + node(1)) * along[0] + node(0)) as usize];
        if *entry == Bricks::NOTHING {
            *entry = (self.slots.len() / SLOTS) as u32;
            self.slots.extend([Bricks::NOTHING; SLOTS]);
        }
        let within = |axis: usize| (brick[axis] % 16) as usize;
        *entry as usize * SLOTS + (within(2) * 16 + within(1)) * 16 + within(0)
    }

    fn bricks(&self) -> Bricks<'_> {
        Bricks { size: self.size, nodes: &self.nodes, slots: &self.slots, cells: &self.cells }
    }

    fn grid(&mut self, placement: Affine3) -> Result<SparseGrid<'_>, MediumError> {
        let bricks = Bricks { size: self.size, nodes: &self.nodes, slots: &self.slots, cells: &self.cells };
        SparseGrid::new(bricks, &SMOKE, placement, &mut self.bounds)
    }
}

/// Islands with an empty border, most of them gone.
fn lonely_islands(size: [u32; 3], rng: &mut Generator) -> Vec<f32> {
    let kept: Vec<bool> = (0..1000).map(|_| uniform(rng) < 0.15).collect();
    let mut values = islands(rng);
    (0..size.iter().product())
        .map(|i| {
            let at = [i % size[0], i / size[0] % size[1], i / size[0] / size[1]];
            let is_border = (0..3).any(|axis| at[axis] == 0 || at[axis] + 1 == size[axis]);
            let brick = at.map(|c| c / 8 * 8);
            let is_kept = kept[(brick[0] * 7 + brick[1] * 13 + brick[2] * 29) as usize % kept.len()];
            let value = values(i as usize);
            if is_border || !is_kept { 0.0 } else { value }
        })
        .collect()
}

/// Within a node, and across several.
const SIZES: [[u32; 3]; 4] = [[40, 21, 30], [9, 9, 9], [300, 19, 12], [10, 140, 262]];

#[test]
fn a_sparse_grid_is_the_dense_grid_of_its_cells() {
    let (mut rng, mut filled) = (Generator::new(1), 0);
    for round in 0..16 {
        let size = SIZES[round % 4];
        let values = lonely_islands(size, &mut rng);
        let placement = placement(&mut rng, 1.0);
        let mut sparse = Sparse::new(size, &values);
        let mut voxels = Voxels::new(size, placement, |i| values[i]);
        let (sparse, dense) = (sparse.grid(placement).unwrap(), voxels.grid());
        assert_eq!((sparse.resolution(), sparse.is_grey(), sparse.phase()), (dense.resolution(), false, dense.phase()));
        for _ in 0..4000 {
            let at = placement.transform_point3(Vec3::splat(0.5) + point(&mut rng, 0.52));
            assert_eq!(sparse.properties(at), dense.properties(at), "{at}");
            assert_eq!(sparse.extinction_with_gradient(at), dense.extinction_with_gradient(at), "{at}");
            let (a, b) = (sparse.gradients(at), dense.gradients(at));
            // The dense one sums gradients of both coefficients.
            let apart = (a.extinction - b.extinction).norm().max_element();
            assert!(apart <= 1e-6 * b.extinction.norm().max_element() && a.scattering == b.scattering, "{at}");
            let hessians = (sparse.extinction_hessian(at), dense.extinction_hessian(at));
            assert_eq!(hessians.0, hessians.1, "{at}");
            filled += u32::from(!dense.extinction(at).is_black());
        }
        for radius in [0.0, 0.01, 0.2] {
            let at = placement.transform_point3(Vec3::splat(0.5));
            assert_eq!(sparse.mean_extinction(at, radius), dense.mean_extinction(at, radius));
        }
    }
    assert!(filled > 1000, "{filled} points in something");
}

#[test]
fn cells_are_told_one_by_one() {
    let size = [300, 19, 12];
    let values = lonely_islands(size, &mut Generator::new(5));
    let sparse = Sparse::new(size, &values);
    for (i, value) in (0_i32..).zip(&values) {
        assert_eq!(sparse.bricks().value([i % 300, i / 300 % 19, i / 300 / 19]), *value);
    }
}

#[test]
fn bounds_of_sparse_grids_hold_along_every_ray() {
    let mut rng = Generator::new(2);
    let mut longest = 0;
    for round in 0..96 {
        let scale = [1e-4, 1.0, 1.0, 1e5][round / 4 % 4];
        let size = SIZES[round % 4];
        let placement = placement(&mut rng, scale);
        let mut sparse = Sparse::new(size, &lonely_islands(size, &mut rng));
        let grid = sparse.grid(placement).unwrap();
        for _ in 0..8 {
            let ray = ray_around(&mut rng, &placement);
            longest = longest.max(check_walk(&grid, &ray, 6.0 * scale, 1e-5 * scale, &mut rng));
        }
    }
    assert!(longest < 100, "{longest} steps through at most 60 bricks");
}

#[test]
fn bounds_hold_for_sparse_grids_far_away() {
    let mut rng = Generator::new(3);
    for round in 0..80 {
        let distance = [1e3, 1e5, 1e7, 1e12][round % 4];
        let mut far = placement(&mut rng, 1.0);
        far.translation += direction(&mut rng) * distance;
        let size = [150, 20, 17];
        let mut sparse = Sparse::new(size, &lonely_islands(size, &mut rng));
        let grid = sparse.grid(far).unwrap();
        let blur = 4e-7 * distance;
        check_walk(&grid, &ray_around(&mut rng, &far), 6.0 + blur, blur, &mut rng);
    }
}

#[test]
fn nodes_that_are_not_there_are_passed_in_one_step() {
    let size = [128 * 40, 9, 9];
    let mut values = vec![0.0; size.iter().product::<u32>() as usize];
    let cell = |x: usize| (4 * 9 + 4) * 128 * 40 + x;
    values[cell(20)] = 1.0;
    values[cell(128 * 40 - 20)] = 1.0;
    let mut sparse = Sparse::new(size, &values);
    assert_eq!(sparse.slots.len(), 2 * SLOTS);
    let placement = Affine3::from_scale(Vec3::from_array(size.map(|n| n as f32)));
    let grid = sparse.grid(placement).unwrap();
    let ray = Ray::new(Vec3::new(40.0, 4.5, 4.5), Vec3::X);
    let gap = grid.majorant_segment(&ray, 0.0);
    // The brick of the cell itself, or the one before it whose points are within a cell of it.
    assert!(gap.majorant.is_black() && (5048.0..5060.0).contains(&gap.until), "{gap:?}");
    assert!(grid.majorant_segment(&ray, gap.until).majorant[2] >= SMOKE.extinction()[2]);
}

#[test]
fn tables_that_do_not_fit_are_refused() {
    let size = [140, 9, 9];
    let mut values = vec![0.0; 140 * 81];
    values[(4 * 9 + 4) * 140 + 127] = 1.0;
    let good = Sparse::new(size, &values);
    let refused = |change: &dyn Fn(&mut Sparse)| {
        let Sparse { size, nodes, slots, cells, bounds } = &good;
        let (nodes, slots, cells, bounds) = (nodes.clone(), slots.clone(), cells.clone(), bounds.clone());
        let mut sparse = Sparse { size: *size, nodes, slots, cells, bounds };
        change(&mut sparse);
        sparse.grid(Affine3::IDENTITY).map(|_| ()).err()
    };
    assert_eq!(refused(&|_| {}), None);
    assert_eq!(refused(&|s| s.size = [0, 9, 9]), Some(MediumError::Size));
    assert_eq!(refused(&|s| s.size = [u32::MAX, 9, 9]), Some(MediumError::Size));
    assert_eq!(refused(&|s| s.nodes[0] = 2), Some(MediumError::Size));
    assert_eq!(refused(&|s| s.slots[7] = 1), Some(MediumError::Size));
    assert_eq!(refused(&|s| s.slots.truncate(5000)), Some(MediumError::Size));
    assert_eq!(refused(&|s| s.cells.truncate(500)), Some(MediumError::Size));
    assert_eq!(refused(&|s| s.cells[3] = f32::NAN), Some(MediumError::Density));
    assert_eq!(refused(&|s| s.cells[3] = -1.0), Some(MediumError::Density));
    assert_eq!(refused(&|s| s.bounds.truncate(1)), Some(MediumError::Blocks));
    // Cell 127 lies beside the second node.
    assert_eq!(refused(&|s| s.nodes[1] = Bricks::NOTHING), Some(MediumError::Nodes));
    assert_eq!(refused(&|s| s.size = [140, 9, 5]), Some(MediumError::Border));
    assert_eq!(refused(&|s| s.cells[(4 * 8 + 4) * 8 + 7] = f32::MAX), Some(MediumError::Coefficients));
}

#[test]
#[ignore = "prints times"]
fn speed_of_sparse_and_dense_grids() {
    let mut rng = Generator::new(9);
    let n = 64_u32;
    let size = [n; 3];
    let values: Vec<f32> = (0..n * n * n)
        .map(|i| {
            let at = [i % n, i / n % n, i / n / n].map(|c| (c as f32 + 0.5) / (0.5 * n as f32) - 1.0);
            let r = (at[0] * at[0] + at[1] * at[1] + at[2] * at[2]).sqrt();
            if r > 0.97 { 0.0 } else { (1.3 * (1.0 - r)).clamp(0.0, 1.0) * 20.0 }
        })
        .collect();
    let mut sparse = Sparse::new(size, &values);
    let mut voxels = Voxels::new(size, Affine3::IDENTITY, |i| values[i]);
    let (sparse, dense) = (sparse.grid(Affine3::IDENTITY).unwrap(), voxels.grid());
    let points: Vec<Vec3> = (0..100_000).map(|_| Vec3::splat(0.5) + point(&mut rng, 0.5)).collect();
    let rays: Vec<Ray> = points.iter().map(|p| Ray::new(*p, direction(&mut rng))).collect();
    fn time(name: &str, medium: &impl Medium, points: &[Vec3], rays: &[Ray]) {
        let mut best = [f64::INFINITY; 2];
        let mut sum = 0.0;
        for _ in 0..12 {
            let start = std::time::Instant::now();
            for p in points {
                sum += medium.extinction(*p)[0];
            }
            best[0] = best[0].min(start.elapsed().as_secs_f64());
            let start = std::time::Instant::now();
            for r in rays {
                sum += medium.majorant_segment(r, 0.0).majorant[0];
            }
            best[1] = best[1].min(start.elapsed().as_secs_f64());
        }
        println!("{name}: look-up {:.1} ns, segment {:.1} ns ({sum})", best[0] * 1e4, best[1] * 1e4);
    }
    time("dense", &dense, &points, &rays);
    time("sparse", &sparse, &points, &rays);
}
