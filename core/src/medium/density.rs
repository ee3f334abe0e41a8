//! Densities on a lattice, trilinear between cell centres.

use glam::{Mat3, Vec3};

use super::MediumError;
use crate::spectrum::{Hessian, Spectrum};

/// Densities of the cells of a grid, x fastest: cell `(x, y, z)` of `(nx, ny, nz)` has index
/// `(z·ny + y)·nx + x`.
///
/// ```
/// # use fogbow::medium::Density;
/// let bytes = Density::U8(&[0, 51, 255]);
/// assert_eq!((bytes.len(), bytes.is_empty()), (3, false));
/// assert!((bytes.value(1) - 0.2).abs() < 1e-7);   // 51/255
/// assert_eq!(bytes.value(7), 0.0);   // beyond the last
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Density<'a> {
    /// Any finite value that is not negative.
    F32(&'a [f32]),
    /// 0 to 255 for a density of 0 to 1.
    U8(&'a [u8]),
}

impl Density<'_> {
    /// Number of cells.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::F32(values) => values.len(),
            Self::U8(values) => values.len(),
        }
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Density of one cell; 0 beyond the last.
    #[inline]
    #[must_use]
    pub fn value(&self, index: usize) -> f32 {
        match self {
            Self::F32(values) => values.get(index).copied().unwrap_or(0.0),
            Self::U8(values) => values.get(index).map_or(0.0, |v| f32::from(*v) * (1.0 / 255.0)),
        }
    }

    /// Whether there is one valid value for every cell of `size`.
    pub(super) fn check(&self, size: [u32; 3]) -> Result<(), MediumError> {
        if cell_count(size) != Some(self.len()) || self.is_empty() {
            return Err(MediumError::Size);
        }
        match self {
            Self::F32(values) if !values.iter().all(|v| *v >= 0.0 && *v < f32::INFINITY) => Err(MediumError::Density),
            _ => Ok(()),
        }
    }
}

/// Number of cells of a grid, where that is a number.
pub(super) fn cell_count(size: [u32; 3]) -> Option<usize> {
    // Lookups count cells in f32, where 2²³ and a half is still a number of its own.
    if size.iter().any(|&n| n > 1 << 22) {
        return None;
    }
    size.iter().try_fold(1_usize, |product, &n| product.checked_mul(usize::try_from(n).ok()?))
}

/// Where a point falls between cell centres.
///
/// `q = p·n − 1/2` for local `p` in [0, 1]; between cells `⌊q⌋` and `⌊q⌋ + 1`, both clamped to the
/// grid, so that densities are constant in the outer half cells.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cell {
    /// Index of the first of eight corners.
    first: usize,
    /// To the next one along each axis; 0 where there is none.
    steps: [usize; 3],
    fraction: Vec3,
}

impl Cell {
    /// From `p·n + 1/2`, which lies in [1/2, n + 1/2] inside the grid; farther out, clamped.
    #[inline(always)]
    pub(super) fn at(shifted: Vec3, size: [u32; 3]) -> Self {
        // Shifted by one, a truncation is the floor, and the fraction lies in [0, 1) exactly.
        let axis = |s: f32, n: u32| {
            let upper = (s as u32).min(n);
            ((upper.saturating_sub(1)) as usize, upper.min(n - 1) as usize, (s - upper as f32).clamp(0.0, 1.0))
        };
        let (x0, x1, fx) = axis(shifted.x, size[0]);
        let (y0, y1, fy) = axis(shifted.y, size[1]);
        let (z0, z1, fz) = axis(shifted.z, size[2]);
        let (nx, ny) = (size[0] as usize, size[1] as usize);
        Self {
            first: (z0 * ny + y0) * nx + x0,
            steps: [x1 - x0, (y1 - y0) * nx, (z1 - z0) * nx * ny],
            fraction: Vec3::new(fx, fy, fz),
        }
    }

    /// The densities around, in units of the second.
    #[inline(always)]
    fn corners(&self, density: &Density<'_>) -> (Corners, f32) {
        // Written out: an array's own `map` may stay a call.
        let [dx, dy, dz] = self.steps;
        let (a, c) = (self.first, self.first + dy);
        let (e, g) = (a + dz, c + dz);
        let (b, d, f, h) = (a + dx, c + dx, e + dx, g + dx);
        let (values, unit) = match density {
            Density::F32(values) => {
                let at = |i: usize| values.get(i).copied().unwrap_or(0.0);
                ([at(a), at(b), at(c), at(d), at(e), at(f), at(g), at(h)], 1.0)
            }
            Density::U8(values) => {
                let at = |i: usize| f32::from(values.get(i).copied().unwrap_or(0));
                ([at(a), at(b), at(c), at(d), at(e), at(f), at(g), at(h)], 1.0 / 255.0)
            }
        };
        (Corners { values, fraction: self.fraction }, unit)
    }

    /// Density.
    #[inline(always)]
    pub(super) fn value(&self, density: &Density<'_>) -> f32 {
        let (corners, unit) = self.corners(density);
        corners.value() * unit
    }

    /// Gradient of density, per cell, in cell coordinates.
    #[inline]
    pub(super) fn gradient(&self, density: &Density<'_>) -> Vec3 {
        let (corners, unit) = self.corners(density);
        corners.gradient() * unit
    }

    /// Both, from the same corners.
    #[inline]
    pub(super) fn value_and_gradient(&self, density: &Density<'_>) -> (f32, Vec3) {
        let (corners, unit) = self.corners(density);
        (corners.value() * unit, corners.gradient() * unit)
    }
}

/// Densities of the eight cells around a point, x fastest, and where between their centres it lies.
#[derive(Debug, Clone, Copy)]
pub(super) struct Corners {
    pub(super) values: [f32; 8],
    pub(super) fraction: Vec3,
}

impl Corners {
    #[inline]
    pub(super) fn value(&self) -> f32 {
        let (v, f) = (&self.values, self.fraction);
        // `a + (b − a) f` returns a constant unchanged, which weights that sum to 1 would not.
        let (y0, y1) = (lerp(v[0], v[1], f.x), lerp(v[2], v[3], f.x));
        let (y2, y3) = (lerp(v[4], v[5], f.x), lerp(v[6], v[7], f.x));
        lerp(lerp(y0, y1, f.y), lerp(y2, y3, f.y), f.z)
    }

    /// Gradient per cell, in cell coordinates.
    #[inline]
    pub(super) fn gradient(&self) -> Vec3 {
        let (v, f) = (&self.values, self.fraction);
        let bilinear = |a: f32, b: f32, c: f32, d: f32, s: f32, t: f32| lerp(lerp(a, b, s), lerp(c, d, s), t);
        let x = bilinear(v[1] - v[0], v[3] - v[2], v[5] - v[4], v[7] - v[6], f.y, f.z);
        let y = bilinear(v[2] - v[0], v[3] - v[1], v[6] - v[4], v[7] - v[5], f.x, f.z);
        let z = bilinear(v[4] - v[0], v[5] - v[1], v[6] - v[2], v[7] - v[3], f.x, f.y);
        Vec3::new(x, y, z)
    }
}

#[inline]
fn lerp(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}

/// Central differences over one cell along the axes of a lattice, carried into the world; `at` tells extinction at an offset in cells.
pub(super) fn central_hessian(cells_from_world: &Mat3, at: impl Fn(Vec3) -> Spectrum) -> Hessian {
    let here = at(Vec3::ZERO);
    let second = |a: Vec3| at(a) + at(-a) - here * 2.0;
    let mixed = |a: Vec3, b: Vec3| (at(a + b) + at(-a - b) - at(a - b) - at(b - a)) * 0.25;
    let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
    let local =
        Hessian { xx: second(x), xy: mixed(x, y), xz: mixed(x, z), yy: second(y), yz: mixed(y, z), zz: second(z) };
    let (x, y, z) = (cells_from_world.x_axis, cells_from_world.y_axis, cells_from_world.z_axis);
    Hessian {
        xx: local.between(x, x),
        xy: local.between(x, y),
        xz: local.between(x, z),
        yy: local.between(y, y),
        yz: local.between(y, z),
        zz: local.between(z, z),
    }
}
