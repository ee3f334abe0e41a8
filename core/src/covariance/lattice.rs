//! A box cut into equal cells, and the walk of a ray through them.

use glam::Vec3;

use crate::math::{Bounds, Ray};

/// Most cells along an edge.
pub const MAX_EDGE: u32 = 1024;

/// A box cut into `size` equal cells; whatever belongs to a cell lies in a slice of [`Lattice::cell_count`].
///
/// ```
/// # use fogbow::{covariance::Lattice, math::{Bounds, Vec3}};
/// let bounds = Bounds { min: Vec3::ZERO, max: Vec3::new(4.0, 2.0, 1.0) };
/// let lattice = Lattice::new(bounds, [4, 2, 1])?;
/// assert_eq!((lattice.bounds(), lattice.size(), lattice.cell()), (bounds, [4, 2, 1], Vec3::ONE));
/// assert_eq!(lattice.cell_count(), 8);
/// // Cells along x come first, then those along y.
/// assert_eq!(lattice.centre(5), Vec3::new(1.5, 1.5, 0.5));
/// assert_eq!((lattice.index(lattice.centre(5)), lattice.index(Vec3::NEG_X)), (Some(5), None));
/// # Ok::<(), fogbow::covariance::LatticeError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lattice {
    bounds: Bounds,
    size: [u32; 3],
    cell: Vec3,
}

/// Why a lattice cannot be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LatticeError {
    /// A corner is not finite.
    Bounds,
    /// An edge has no cells, or more than [`MAX_EDGE`].
    Size,
    /// Lent storage has another number of cells.
    Storage,
}

impl core::fmt::Display for LatticeError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Bounds => f.write_str("the bounds of the grid are empty or not finite"),
            Self::Size => write!(f, "a grid needs 1 to {MAX_EDGE} cells along every edge"),
            Self::Storage => f.write_str("the lent storage does not have one element per cell"),
        }
    }
}

impl core::error::Error for LatticeError {}

impl Lattice {
    /// `size` cells in `bounds` (m). Flat boxes are made a little thicker.
    ///
    /// # Errors
    /// Bounds that are empty or not finite; no cells or too many.
    pub fn new(bounds: Bounds, size: [u32; 3]) -> Result<Self, LatticeError> {
        if size.iter().any(|&n| n == 0 || n > MAX_EDGE) {
            return Err(LatticeError::Size);
        }
        let extent = bounds.size();
        if !(extent.is_finite() && extent.cmpge(Vec3::ZERO).all() && extent.max_element() > 0.0) {
            return Err(LatticeError::Bounds);
        }
        let least = 1e-3 * extent.max_element();
        let grown = Vec3::splat(least).max(extent) - extent;
        let bounds = Bounds { min: bounds.min - grown * 0.5, max: bounds.max + grown * 0.5 };
        let cell = bounds.size() / Vec3::from(size.map(|n| n as f32));
        Ok(Self { bounds, size, cell })
    }

    /// The box with about cubic cells, `edge` of them along its longest side.
    ///
    /// # Errors
    /// As [`Lattice::new`].
    ///
    /// ```
    /// # use fogbow::{covariance::Lattice, math::{Bounds, Vec3}};
    /// let hall = Bounds { min: Vec3::ZERO, max: Vec3::new(4.0, 2.0, 1.0) };
    /// assert_eq!(Lattice::cubic(hall, 64)?.size(), [64, 32, 16]);
    /// # Ok::<(), fogbow::covariance::LatticeError>(())
    /// ```
    pub fn cubic(bounds: Bounds, edge: u32) -> Result<Self, LatticeError> {
        let extent = bounds.size();
        let longest = extent.max_element();
        let count = |length: f32| (libm::ceilf(length / longest * edge as f32 - 1e-3).max(1.0) as u32).min(edge.max(1));
        if edge == 0 || !(longest > 0.0) {
            return Self::new(bounds, [edge; 3]);
        }
        Self::new(bounds, [count(extent.x), count(extent.y), count(extent.z)])
    }

    /// The box (m).
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Cells along each edge.
    #[must_use]
    pub fn size(&self) -> [u32; 3] {
        self.size
    }

    /// Edge lengths (m) of a cell.
    #[must_use]
    pub fn cell(&self) -> Vec3 {
        self.cell
    }

    /// Number of cells.
    #[must_use]
    pub fn cell_count(&self) -> usize {
        self.size.iter().map(|&n| n as usize).product()
    }

    /// Centre (m) of the cell with this index.
    #[must_use]
    pub fn centre(&self, index: usize) -> Vec3 {
        let [nx, ny, _] = self.size.map(|n| n as usize);
        let at = Vec3::new((index % nx) as f32, (index / nx % ny) as f32, (index / (nx * ny)) as f32);
        self.bounds.min + (at + 0.5) * self.cell
    }

    fn flat(&self, at: [i32; 3]) -> usize {
        let [nx, ny, _] = self.size.map(|n| n as usize);
        at[0] as usize + nx * (at[1] as usize + ny * at[2] as usize)
    }

    fn cell_of(&self, point: Vec3) -> [i32; 3] {
        let at = (point - self.bounds.min) / self.cell;
        [0, 1, 2].map(|i| (at[i] as i32).clamp(0, self.size[i] as i32 - 1))
    }

    /// Index of the cell that holds `point`; `None` outside.
    #[inline]
    #[must_use]
    pub fn index(&self, point: Vec3) -> Option<usize> {
        self.bounds.contains(point).then(|| self.flat(self.cell_of(point)))
    }

    /// The eight cells around `point` with their trilinear weights; at the border the outer ones repeat.
    /// `None` outside.
    ///
    /// ```
    /// # use fogbow::{covariance::Lattice, math::{Bounds, Vec3}};
    /// let lattice = Lattice::new(Bounds { min: Vec3::ZERO, max: Vec3::ONE }, [4, 4, 4])?;
    /// let point = Vec3::new(0.3, 0.6, 0.5);
    /// let around = lattice.around(point).unwrap();
    /// let mean: Vec3 = around.iter().map(|&(cell, weight)| lattice.centre(cell) * weight).sum();
    /// assert!((mean - point).length() < 1e-6);   // what is linear is interpolated exactly
    /// # Ok::<(), fogbow::covariance::LatticeError>(())
    /// ```
    #[inline]
    #[must_use]
    pub fn around(&self, point: Vec3) -> Option<[(usize, f32); 8]> {
        if !self.bounds.contains(point) {
            return None;
        }
        let at = (point - self.bounds.min) / self.cell - 0.5;
        let low = at.floor();
        let f = at - low;
        let mut out = [(0, 0.0); 8];
        for (i, slot) in out.iter_mut().enumerate() {
            let bit = [i & 1, i >> 1 & 1, i >> 2 & 1];
            let mut weight = 1.0;
            let mut cell = [0; 3];
            for axis in 0..3 {
                weight *= if bit[axis] == 1 { f[axis] } else { 1.0 - f[axis] };
                cell[axis] = (low[axis] as i32 + bit[axis] as i32).clamp(0, self.size[axis] as i32 - 1);
            }
            *slot = (self.flat(cell), weight);
        }
        Some(out)
    }

    /// The cells that `ray` crosses, in order, with the distances (m) at which it enters and leaves them; they join
    /// without gaps.
    ///
    /// Amanatides and Woo 1987.
    ///
    /// ```
    /// # use fogbow::{covariance::Lattice, math::{Bounds, Ray, Vec3}};
    /// let lattice = Lattice::new(Bounds { min: Vec3::ZERO, max: Vec3::ONE }, [4, 4, 4])?;
    /// let ray = Ray::between(Vec3::new(-1.0, 0.3, 0.1), Vec3::new(2.0, 0.4, 0.9));
    /// let length: f32 = lattice.cells(&ray).map(|crossing| crossing.leave - crossing.enter).sum();
    /// assert!((length - 3.0_f32.hypot(0.1).hypot(0.8) / 3.0).abs() < 1e-5);
    /// # Ok::<(), fogbow::covariance::LatticeError>(())
    /// ```
    #[inline]
    #[must_use]
    pub fn cells(&self, ray: &Ray) -> Cells {
        let nothing = Cells {
            index: 0,
            at: 0.0,
            end: 0.0,
            next: [f32::INFINITY; 3],
            advance: [0.0; 3],
            stride: [0; 3],
            left: [0; 3],
        };
        let Some((near, far)) = self.bounds.intersect(ray) else { return nothing };
        let (start, end) = (near.max(0.0), far.min(ray.length));
        if !(start < end) {
            return nothing;
        }
        let cell = self.cell_of(ray.at(start));
        let [nx, ny, _] = self.size.map(|n| n as isize);
        let strides = [1, nx, nx * ny];
        let mut cells = Cells { index: self.flat(cell) as isize, at: start, end, ..nothing };
        for axis in 0..3 {
            let d = ray.direction[axis];
            if d == 0.0 {
                continue;
            }
            let forward = d > 0.0;
            let face = cell[axis] + i32::from(forward);
            cells.next[axis] = (self.bounds.min[axis] + face as f32 * self.cell[axis] - ray.origin[axis]) / d;
            cells.advance[axis] = self.cell[axis] / d.abs();
            cells.stride[axis] = if forward { strides[axis] } else { -strides[axis] };
            cells.left[axis] = if forward { self.size[axis] as i32 - 1 - cell[axis] } else { cell[axis] };
        }
        cells
    }
}

/// The part of a ray within a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CellCrossing {
    /// Index of the cell.
    pub cell: usize,
    /// Distance (m) at which the ray enters it.
    pub enter: f32,
    /// Distance (m) at which the ray leaves it.
    pub leave: f32,
}

/// The cells along a ray: see [`Lattice::cells`].
#[derive(Debug, Clone)]
pub struct Cells {
    index: isize,
    at: f32,
    end: f32,
    next: [f32; 3],
    advance: [f32; 3],
    stride: [isize; 3],
    left: [i32; 3],
}

impl Iterator for Cells {
    type Item = CellCrossing;

    #[inline]
    fn next(&mut self) -> Option<CellCrossing> {
        // Every turn leaves one layer for good, so that the walk ends whatever rounding does.
        while self.at < self.end {
            let [x, y, z] = self.next;
            let axis = if x < y {
                if x < z { 0 } else { 2 }
            } else if y < z {
                1
            } else {
                2
            };
            let (cell, enter) = (self.index as usize, self.at);
            let is_last = !(self.next[axis] < self.end) || self.left[axis] == 0;
            // In the last layer by rounding, what is left of the ray belongs to its cell.
            let leave = if is_last { self.end } else { self.next[axis] };
            self.left[axis] -= 1;
            self.next[axis] += self.advance[axis];
            self.index += self.stride[axis];
            self.at = self.at.max(leave);
            if leave > enter {
                return Some(CellCrossing { cell, enter, leave });
            }
        }
        None
    }
}
