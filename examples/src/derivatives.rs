//! Second derivatives of the fluence of a covariance grid, by differences of what its cells gathered: what Belcour et
//! al. 2014, § 6.2, hold the covariances against.
//!
//! | estimate | noise | bias |
//! |---|---|---|
//! | [`difference`]: three neighbours along each axis | that of single cells over the square of their size | second order in the cell |
//! | [`filtered`]: 21³ cells around | less by far | what is finer than [`WIDTH`] cells is blurred |
//!
//! Both need the light in many cells; `fogbow::covariance::hessian_bound` needs it in one.

use fogbow::covariance::{GridView, Lattice};
use fogbow::math::Vec3;

/// Cells on each side of the middle one that [`filtered`] takes in: 21 in a row.
pub const REACH: i32 = 10;

/// Standard deviation (cells) of the filter: three of them reach the end of 21 cells.
pub const WIDTH: f64 = 3.5;

/// A Hessian's upper triangle row by row: xx, xy, xz, yy, yz, zz.
pub type Upper = [f64; 6];

/// Where a cell lies.
type Cell = [i32; 3];

fn cell_of(lattice: &Lattice, point: Vec3) -> Option<Cell> {
    let index = lattice.index(point)? as u32;
    let [nx, ny, _] = lattice.size();
    Some([index % nx, index / nx % ny, index / (nx * ny)].map(|i| i as i32))
}

/// The fluence (W·m⁻²) of a cell; `None` outside.
fn fluence(grid: &GridView<'_>, cell: Cell) -> Option<f64> {
    let lattice = grid.lattice();
    let size = lattice.size().map(|n| n as i32);
    if (0..3).any(|i| cell[i] < 0 || cell[i] >= size[i]) {
        return None;
    }
    let index = cell[0] + size[0] * (cell[1] + size[1] * cell[2]);
    let volume: f64 = lattice.cell().to_array().map(f64::from).iter().product();
    Some(f64::from(grid.voxels().get(index as usize)?.weight) / (volume * grid.paths().max(1) as f64))
}

/// The Hessian (W·m⁻⁴) of the fluence at the cell around `point`, from its neighbours:
///
/// ```text
/// F_xx ≈ (F₊ − 2F₀ + F₋)/h²        F_xy ≈ (F₊₊ − F₊₋ − F₋₊ + F₋₋)/(4 h_x h_y)
/// ```
///
/// `None` outside, and in the outermost cells.
#[must_use]
pub fn difference(grid: &GridView<'_>, point: Vec3) -> Option<Upper> {
    let middle = cell_of(grid.lattice(), point)?;
    let h = grid.lattice().cell().to_array().map(f64::from);
    let at = |a: usize, da: i32, b: usize, db: i32| {
        let mut cell = middle;
        cell[a] += da;
        cell[b] += db;
        fluence(grid, cell)
    };
    let straight = |a: usize| Some((at(a, 1, a, 0)? - 2.0 * at(a, 0, a, 0)? + at(a, -1, a, 0)?) / (h[a] * h[a]));
    let mixed = |a: usize, b: usize| {
        Some((at(a, 1, b, 1)? - at(a, 1, b, -1)? - at(a, -1, b, 1)? + at(a, -1, b, -1)?) / (4.0 * h[a] * h[b]))
    };
    Some([straight(0)?, mixed(0, 1)?, mixed(0, 2)?, straight(1)?, mixed(1, 2)?, straight(2)?])
}

/// Powers of x, y and z in the terms of a parabola, and what their coefficients are divided by in the Hessian.
const TERMS: [[usize; 3]; 10] =
    [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [2, 0, 0], [1, 1, 0], [1, 0, 1], [0, 2, 0], [0, 1, 1], [0, 0, 2]];

/// The Hessian (W·m⁻⁴) at `point` of the parabola that fits the fluence of the 21³ cells around best, weighted by a
/// Gaussian of [`WIDTH`] cells.
///
/// Where no border is near that is the fluence filtered with the second derivatives of that Gaussian, for Hermite
/// polynomials are orthogonal under it; near borders fewer cells take part. `None` outside, and where an edge of the
/// lattice has less than three cells.
#[must_use]
pub fn filtered(grid: &GridView<'_>, point: Vec3) -> Option<Upper> {
    let lattice = grid.lattice();
    let middle = cell_of(lattice, point)?;
    let size = lattice.size().map(|n| n as i32);
    if size.iter().any(|n| *n < 3) {
        return None;
    }
    let h = lattice.cell().to_array().map(f64::from);
    let range = |axis: usize| (middle[axis] - REACH).max(0)..=(middle[axis] + REACH).min(size[axis] - 1);
    // Places in units of the width, so that all terms are about as large.
    let offset = |axis: usize, i: i32| {
        let centre = f64::from(lattice.bounds().min[axis]) + (f64::from(i) + 0.5) * h[axis];
        (centre - f64::from(point[axis])) / (WIDTH * h[axis])
    };
    let weight = |x: f64| (-0.5 * x * x).exp();
    // Weights and terms are products over the axes, and so are their sums.
    let mut moments = [[0.0; 5]; 3];
    for (axis, moments) in moments.iter_mut().enumerate() {
        for x in range(axis).map(|i| offset(axis, i)) {
            let mut power = weight(x);
            for moment in moments.iter_mut() {
                *moment += power;
                power *= x;
            }
        }
    }
    let mut rows = [[0.0; 11]; 10];
    for (row, p) in rows.iter_mut().zip(TERMS) {
        for (entry, q) in row.iter_mut().zip(TERMS) {
            *entry = (0..3).map(|axis| moments[axis][p[axis] + q[axis]]).product();
        }
    }
    for k in range(2) {
        for j in range(1) {
            for i in range(0) {
                let [x, y, z] = [offset(0, i), offset(1, j), offset(2, k)];
                let value = fluence(grid, [i, j, k])? * weight(x) * weight(y) * weight(z);
                let terms = [1.0, x, y, z, x * x, x * y, x * z, y * y, y * z, z * z];
                for (row, term) in rows.iter_mut().zip(terms) {
                    row[10] += value * term;
                }
            }
        }
    }
    let c = solved(rows)?;
    let s = |a: usize, b: usize| 1.0 / (WIDTH * WIDTH * h[a] * h[b]);
    Some([
        2.0 * c[4] * s(0, 0),
        c[5] * s(0, 1),
        c[6] * s(0, 2),
        2.0 * c[7] * s(1, 1),
        c[8] * s(1, 2),
        2.0 * c[9] * s(2, 2),
    ])
}

/// Gauss's elimination with the largest pivot of each column; `None` if there is no single solution.
#[expect(clippy::needless_range_loop, reason = "rows of one matrix change together")]
fn solved(mut rows: [[f64; 11]; 10]) -> Option<[f64; 10]> {
    for column in 0..10 {
        let pivot = (column..10).max_by(|&a, &b| rows[a][column].abs().total_cmp(&rows[b][column].abs()))?;
        rows.swap(column, pivot);
        let top = rows[column];
        if !(top[column].abs() > 1e-12) {
            return None;
        }
        for row in 0..10 {
            if row != column {
                let factor = rows[row][column] / top[column];
                for k in column..11 {
                    rows[row][k] -= factor * top[k];
                }
            }
        }
    }
    let mut solution = [0.0; 10];
    for (i, x) in solution.iter_mut().enumerate() {
        *x = rows[i][10] / rows[i][i];
    }
    Some(solution)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fogbow::covariance::Voxel;
    use fogbow::math::Bounds;

    fn lattice(size: [u32; 3]) -> Lattice {
        Lattice::new(Bounds { min: Vec3::new(-1.0, 0.0, 2.0), max: Vec3::new(2.0, 2.0, 4.0) }, size).unwrap()
    }

    fn voxels(lattice: &Lattice, f: impl Fn(Vec3) -> f32) -> Vec<Voxel> {
        let cell = lattice.cell();
        let volume = cell.x * cell.y * cell.z;
        (0..lattice.cell_count())
            .map(|i| Voxel { weight: f(lattice.centre(i)) * volume * 50.0, ..Voxel::EMPTY })
            .collect()
    }

    #[test]
    fn both_estimates_are_exact_for_parabolas_everywhere() {
        let lattice = lattice([30, 20, 24]);
        let f = |p: Vec3| 5.0 + p.x - 2.0 * p.y + 0.5 * p.x * p.x + 2.0 * p.x * p.y - 0.3 * p.y * p.z + 0.7 * p.z * p.z;
        let voxels = voxels(&lattice, f);
        let grid = GridView::new(lattice, &voxels, 50).unwrap();
        let due = [1.0, 2.0, 0.0, 0.0, -0.3, 1.4];
        for point in [Vec3::new(0.5, 1.0, 3.0), Vec3::new(-0.85, 0.15, 3.87), Vec3::new(1.73, 1.1, 2.2)] {
            for (name, found) in [("difference", difference(&grid, point)), ("filtered", filtered(&grid, point))] {
                let found = found.unwrap();
                // Cells hold f32: differences over a tenth of a metre lose three of its seven digits.
                assert!(found.iter().zip(due).all(|(a, b)| (a - b).abs() < 5e-3), "{name} at {point}: {found:?}");
            }
        }
        // The outermost cells have no neighbours, but the fit is there.
        let corner = Vec3::new(-0.999, 0.001, 2.001);
        assert_eq!(difference(&grid, corner), None);
        assert!((filtered(&grid, corner).unwrap()[5] - 1.4).abs() < 0.02);
        assert_eq!((difference(&grid, Vec3::ZERO), filtered(&grid, Vec3::ZERO)), (None, None));
    }

    #[test]
    fn the_fit_is_the_filter_with_the_second_derivative_of_a_gaussian() {
        let lattice = lattice([61, 41, 41]);
        let (centre, w) = (Vec3::new(0.5, 1.0, 3.0), 0.4_f32);
        let voxels = voxels(&lattice, |p| (-0.5 * (p - centre).length_squared() / (w * w)).exp());
        let grid = GridView::new(lattice, &voxels, 50).unwrap();
        let found = filtered(&grid, centre).unwrap();
        let h = 3.0 / 61.0;
        let (w, s) = (0.4_f64, [h, 2.0 / 41.0, 2.0 / 41.0].map(|h| WIDTH * h));
        let blurred = s.map(|s| w * w + s * s);
        let due = -(w * w * w) / blurred.map(f64::sqrt).iter().product::<f64>() / blurred[0];
        // Of a third of it that the filter blurs away, cells beyond three standard deviations would take a tenth.
        assert!((found[0] / due - 1.0).abs() < 0.05, "{} and {due}", found[0]);
    }

    #[test]
    fn flat_lattices_have_no_parabola() {
        let lattice = lattice([5, 2, 5]);
        let voxels = voxels(&lattice, |_| 1.0);
        let grid = GridView::new(lattice, &voxels, 50).unwrap();
        assert_eq!(filtered(&grid, Vec3::new(0.5, 0.5, 3.0)), None);
        assert_eq!(difference(&grid, Vec3::new(0.5, 0.5, 3.0)), None);
    }
}
