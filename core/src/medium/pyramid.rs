//! Mean extinction in balls, from means stored on lattices that halve.

use core::f32::consts::PI;

use glam::Vec3;

use super::MediumError;
use super::density::cell_count;
use crate::host::{Face, Gradients, MajorantSegment, Medium, Properties};
use crate::math::{Bounds, Ray, float};
use crate::spectrum::{Gradient, Hessian, Spectrum};

/// A medium whose [`Medium::mean_extinction`] is a look-up at a cost that depends on neither medium nor
/// radius; everything else is the medium's own.
///
/// Level 0 holds the mean extinction of every cell of a box, level `l` that of cells `2ˡ` times as long. A ball
/// asks for the mean of a field under a kernel; two neighbouring levels, each trilinear between its cells, are mixed
/// so that their kernel has the ball's second moment, in the mean of the three axes:
///
/// ```text
/// ball of radius R:                        ⟨r²⟩/3 = R²/5
/// level l, cells of edge w = 2ˡ w₀:        vₗ = w² (t (1 − t) + 1/12),   in [w²/12, w²/3]
/// σ̄ = (1 − λ) σₗ + λ σₗ₊₁,                  λ = (R²/5 − vₗ) / (vₗ₊₁ − vₗ)
/// ```
///
/// with `t` the fraction of the way between cell centres: the cells' own boxes make `w²/12`, interpolation
/// spreads over two centres with variance `w² t (1 − t)`. Since `vₗ ≤ w²/3 ≤ vₗ₊₁`, there is one pair of levels for
/// every radius, wherever the point lies, and answers are continuous. Mean positions agree as well (linear
/// interpolation), so linear and, in cubic cells and in the mean of directions, quadratic fields come out right.
/// Where the ball's volume times that exceeds all there is in the box, the quotient is the answer, as it
/// is around the whole box. Balls smaller than `v₀` mix level 0 with extinction at the centre itself.
///
/// Outside the box counts as vacuum, in cells that stick out of it too, and so all levels hold the same amount
/// of medium. A medium that is constant everywhere is asked itself (one placed in a region is right wherever the kernel does
/// not reach a face); so is a point (radius 0 or NaN) in the box. An infinite
/// radius has mean 0.
///
/// Reference: Engelhardt et al. 2012, § 4.2, "a downsampled version of the medium". Error against the
/// ball's true mean, relative to the largest extinction: see [`Pyramid::new`].
///
/// ```
/// # use fogbow::{host::Medium, math::{Bounds, Vec3}, phase::Phase, spectrum::Spectrum};
/// # use fogbow::medium::{Homogeneous, Placed, Pyramid, Region};
/// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC).unwrap();
/// let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.0).unwrap());
/// let bounds = Bounds { min: Vec3::splat(-1.0), max: Vec3::ONE };
/// let mut cells = vec![Spectrum::ZERO; Pyramid::<()>::cell_count([16; 3])];
/// let pyramid = Pyramid::new(ball, bounds, [16; 3], &mut cells).unwrap();
/// assert_eq!(pyramid.mean_extinction(Vec3::ZERO, 0.2), Spectrum::ONE);
/// // A ball of twice the radius: an eighth is full.
/// assert!((pyramid.mean_extinction(Vec3::ZERO, 2.0)[0] - 0.125).abs() < 0.03);
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Pyramid<'a, M> {
    medium: M,
    bounds: Bounds,
    size: [u32; 3],
    /// Edges of a cell of level 0, inverse (m⁻¹), and their squares in units of the mean square, over three.
    cells_per_metre: Vec3,
    shares: Vec3,
    /// From a radius to the root of the ball's second moment, in units of that mean square.
    spread_per_radius: f32,
    /// Extinction over all of the box, in units of the volume of a ball whose spread is 1.
    amount: Spectrum,
    /// Where each level starts in `cells`; one past the coarsest, their end.
    starts: [usize; MAX_LEVELS + 1],
    levels: u32,
    cells: &'a [Spectrum],
    is_uniform: bool,
}

/// Most levels: cells along an axis are at most 2²².
const MAX_LEVELS: usize = 23;

/// Spread beyond which nothing is left of any box: it has at most 2²² cells along an axis.
const FAR: f32 = (1_u64 << 40) as f32;

impl<M> Pyramid<'_, M> {
    /// Number of cells of all levels, for `size` cells of level 0 along each axis; 0 for a size no pyramid
    /// can have. About `8/7` of those of level 0.
    ///
    /// ```
    /// # use fogbow::medium::Pyramid;
    /// assert_eq!(Pyramid::<()>::cell_count([3, 2, 1]), 6 + 2 + 1);
    /// assert_eq!(Pyramid::<()>::cell_count([0, 2, 1]), 0);
    /// ```
    #[must_use]
    pub fn cell_count(size: [u32; 3]) -> usize {
        starts(size).map_or(0, |(starts, levels)| starts[levels])
    }

    /// The medium.
    ///
    /// ```
    /// # use fogbow::{math::{Bounds, Vec3}, medium::{Homogeneous, Pyramid}, phase::Phase, spectrum::Spectrum};
    /// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
    /// let mut cells = [Spectrum::ZERO; 1];
    /// let pyramid = Pyramid::new(fog, Bounds { min: Vec3::ZERO, max: Vec3::ONE }, [1; 3], &mut cells)?;
    /// assert_eq!(pyramid.medium(), &fog);
    /// # Ok::<(), fogbow::medium::MediumError>(())
    /// ```
    #[must_use]
    pub fn medium(&self) -> &M {
        &self.medium
    }

    /// Number of levels; the last is one cell.
    ///
    /// ```
    /// # use fogbow::{math::{Bounds, Vec3}, medium::{Homogeneous, Pyramid}, phase::Phase, spectrum::Spectrum};
    /// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
    /// let mut cells = [Spectrum::ZERO; 32 + 4 + 1];
    /// let pyramid = Pyramid::new(fog, Bounds { min: Vec3::ZERO, max: Vec3::ONE }, [4, 4, 2], &mut cells)?;
    /// assert_eq!(pyramid.levels(), 3);   // 4 × 4 × 2, 2 × 2 × 1, 1 × 1 × 1
    /// # Ok::<(), fogbow::medium::MediumError>(())
    /// ```
    #[must_use]
    pub fn levels(&self) -> u32 {
        self.levels
    }

    /// Size of a level, and the mean extinction (m⁻¹) of its cells, x fastest; cells start at the box's smallest
    /// corner. `None` beyond the last.
    ///
    /// ```
    /// # use fogbow::{math::{Bounds, Vec3}, medium::{Homogeneous, Placed, Pyramid, Region}, phase::Phase, spectrum::Spectrum};
    /// // Fog in the left half of a box of two cells.
    /// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
    /// let left = Region::bounds(Bounds { min: Vec3::ZERO, max: Vec3::ONE })?;
    /// let (bounds, mut cells) = (Bounds { min: Vec3::ZERO, max: Vec3::new(2.0, 1.0, 1.0) }, [Spectrum::ZERO; 3]);
    /// let pyramid = Pyramid::new(Placed::new(fog, left), bounds, [2, 1, 1], &mut cells)?;
    /// assert_eq!(pyramid.level(0), Some(([2, 1, 1], &[Spectrum::ONE, Spectrum::ZERO][..])));
    /// // The one cell of the last level is as high and deep as it is wide: three quarters of it stick out of the box.
    /// assert_eq!(pyramid.level(1), Some(([1; 3], &[Spectrum::splat(0.125)][..])));
    /// assert_eq!(pyramid.level(2), None);
    /// # Ok::<(), fogbow::medium::MediumError>(())
    /// ```
    #[must_use]
    pub fn level(&self, level: u32) -> Option<([u32; 3], &[Spectrum])> {
        let range = *self.starts.get(level as usize)?..*self.starts.get(level as usize + 1)?;
        (level < self.levels).then(|| (coarser(self.size, level), &self.cells[range]))
    }
}

impl<'a, M: Medium> Pyramid<'a, M> {
    /// Of the part of `medium` in `bounds`, with `size` cells of level 0 along each axis; `cells`, of
    /// [`Pyramid::cell_count`], is filled here.
    ///
    /// A cell's mean is taken over 2³ to 8³ points, two for each [`Medium::resolution`] along an axis: exact for a
    /// [`DensityGrid`](super::DensityGrid) of the same cells. Cubic cells as long as the medium's own serve best.
    ///
    /// Error there, against dense sums, for radii of half a cell to half the box, relative to the largest extinction:
    /// 0.23 % in the mean and 2.2 % at the 99th percentile for a plume of smoke (0.35 % and 3.4 % with cells twice as
    /// long), 2 % and 10 % for noise that varies within a few cells, where it matters that the kernel is no ball.
    ///
    /// # Errors
    /// Bounds that are empty, flat or not finite; a size of zero; storage of another length; extinction that is
    /// negative or not finite.
    pub fn new(medium: M, bounds: Bounds, size: [u32; 3], cells: &'a mut [Spectrum]) -> Result<Self, MediumError> {
        let (starts, levels) = starts(size).ok_or(MediumError::Size)?;
        if cells.len() != starts[levels] {
            return Err(MediumError::Means);
        }
        let counts = Vec3::new(size[0] as f32, size[1] as f32, size[2] as f32);
        let cell = bounds.size() / counts;
        let squares = cell * cell;
        let mean_square = squares.element_sum() / 3.0;
        // A box inside out has the squares of one that is not.
        let is_measurable = |v: f32| v.is_normal() && v > 0.0 && v.recip().is_normal();
        if !(bounds.min.is_finite()
            && cell.min_element() > 0.0
            && squares.to_array().into_iter().chain([mean_square]).all(is_measurable))
        {
            return Err(MediumError::Placement);
        }
        fill(&medium, &bounds, size, cell, cells)?;
        for level in 1..levels {
            let (fine, coarse) =
                cells[starts[level - 1]..starts[level + 1]].split_at_mut(starts[level] - starts[level - 1]);
            halve(fine, coarser(size, level as u32 - 1), coarse);
        }
        let spread_per_radius = float::sqrt(0.2 / mean_square);
        let top = (1_u64 << (levels - 1)) as f32;
        let volume = (cell * spread_per_radius * top).to_array().iter().product::<f32>() * 3.0 / (4.0 * PI);
        let amount = cells[starts[levels] - 1] * volume;
        let is_uniform = is_uniform(&medium, &bounds, size, &cells[..starts[1]]);
        Ok(Self {
            medium,
            bounds,
            size,
            cells_per_metre: cell.recip(),
            shares: squares / (3.0 * mean_square),
            spread_per_radius,
            amount,
            starts,
            levels: levels as u32,
            cells,
            is_uniform,
        })
    }

    /// Where a level is asked for a point in units of cells of level 0.
    #[inline]
    fn place(&self, level: u32, point: Vec3) -> Place {
        let edge = (1_u64 << level) as f32;
        let q = point * edge.recip() - Vec3::splat(0.5);
        let lower = Vec3::new(float::floor(q.x), float::floor(q.y), float::floor(q.z));
        let fraction = q - lower;
        let spread = fraction * (Vec3::ONE - fraction) + Vec3::splat(1.0 / 12.0);
        Place { level, lower, fraction, variance: edge * edge * self.shares.dot(spread) }
    }

    /// Interpolated mean extinction (m⁻¹).
    #[inline]
    fn value(&self, place: &Place) -> Spectrum {
        let last = self.levels - 1;
        let level = place.level.min(last);
        let size = coarser(self.size, level);
        let end = Vec3::new(size[0] as f32, size[1] as f32, size[2] as f32);
        if !(place.lower.cmpge(Vec3::splat(-1.0)).all() && place.lower.cmplt(end).all()) {
            return Spectrum::ZERO;
        }
        let (start, f) = (self.starts[level as usize], place.fraction);
        let [x, y, z] = place.lower.to_array().map(|v| v as i32);
        let row = |y: i32, z: i32| {
            // Below zero wraps beyond the end.
            if y as u32 >= size[1] || z as u32 >= size[2] {
                return Spectrum::ZERO;
            }
            let row = start + (z as usize * size[1] as usize + y as usize) * size[0] as usize;
            let at = |x: i32| {
                if x as u32 >= size[0] { Spectrum::ZERO } else { self.cells[row + x as usize] }
            };
            lerp(at(x), at(x + 1), f.x)
        };
        let value = lerp(lerp(row(y, z), row(y + 1, z), f.y), lerp(row(y, z + 1), row(y + 1, z + 1), f.y), f.z);
        if place.level > last {
            // The levels beyond the last are that cell in vacuum.
            let thinner = (1_u64 << (place.level - last)) as f32;
            return value * (thinner * thinner * thinner).recip();
        }
        value
    }
}

/// Cells around a point, in one level.
#[derive(Debug, Clone, Copy)]
struct Place {
    level: u32,
    lower: Vec3,
    fraction: Vec3,
    /// Second moment of the kernel, per axis, in units of the mean square edge of level 0.
    variance: f32,
}

/// `a + (b − a) t` returns a constant unchanged, which weights that sum to 1 would not.
#[inline]
fn lerp(a: Spectrum, b: Spectrum, t: f32) -> Spectrum {
    a.zip(b, |a, b| a + (b - a) * t)
}

/// Size of a level.
#[inline]
fn coarser(size: [u32; 3], level: u32) -> [u32; 3] {
    size.map(|n| ((n - 1) >> level) + 1)
}

/// Where levels start, with the end of the last, and their number.
fn starts(size: [u32; 3]) -> Option<([usize; MAX_LEVELS + 1], usize)> {
    if size.contains(&0) {
        return None;
    }
    let mut starts = [0_usize; MAX_LEVELS + 1];
    for level in 0..MAX_LEVELS {
        let size = coarser(size, level as u32);
        starts[level + 1] = starts[level].checked_add(cell_count(size)?)?;
        if size == [1; 3] {
            return Some((starts, level + 1));
        }
    }
    None
}

/// Fills level 0 with the means of cells.
fn fill(
    medium: &impl Medium,
    bounds: &Bounds,
    size: [u32; 3],
    cell: Vec3,
    cells: &mut [Spectrum],
) -> Result<(), MediumError> {
    let resolution = medium.resolution();
    // Two midpoints for each length over which the medium varies; a cast of what is no number gives 0.
    let points = cell.to_array().map(|edge| (float::floor(2.0 * edge / resolution + 0.999) as u32).clamp(2, 8));
    let weight = 1.0 / (points[0] * points[1] * points[2]) as f32;
    let mut cells = cells.iter_mut();
    for z in 0..size[2] {
        for y in 0..size[1] {
            for x in 0..size[0] {
                let mut sum = Spectrum::ZERO;
                for k in 0..points[2] {
                    for j in 0..points[1] {
                        for i in 0..points[0] {
                            let along = |cell: u32, i: u32, n: u32| cell as f32 + (i as f32 + 0.5) / n as f32;
                            let [i, j, k] = [along(x, i, points[0]), along(y, j, points[1]), along(z, k, points[2])];
                            sum += medium.extinction(bounds.min + Vec3::new(i, j, k) * cell);
                        }
                    }
                }
                let mean = sum * weight;
                if !mean.is_valid() {
                    return Err(MediumError::Coefficients);
                }
                if let Some(cell) = cells.next() {
                    *cell = mean;
                }
            }
        }
    }
    Ok(())
}

/// Means of two by two by two cells; beyond the end lies vacuum.
fn halve(fine: &[Spectrum], size: [u32; 3], coarse: &mut [Spectrum]) {
    let at = |x: u32, y: u32, z: u32| {
        if x >= size[0] || y >= size[1] || z >= size[2] {
            return Spectrum::ZERO;
        }
        fine[(z as usize * size[1] as usize + y as usize) * size[0] as usize + x as usize]
    };
    // Halves first: equal values give themselves, to the bit.
    let mean = |a: Spectrum, b: Spectrum| a * 0.5 + b * 0.5;
    let row = |x: u32, y: u32, z: u32| mean(at(x, y, z), at(x + 1, y, z));
    let layer = |x: u32, y: u32, z: u32| mean(row(x, y, z), row(x, y + 1, z));
    let [nx, ny, _] = coarser(size, 1);
    for (index, cell) in coarse.iter_mut().enumerate() {
        let row = index / nx as usize;
        let (x, y, z) = (index % nx as usize, row % ny as usize, row / ny as usize);
        let [x, y, z] = [x, y, z].map(|i| 2 * i as u32);
        *cell = mean(layer(x, y, z), layer(x, y, z + 1));
    }
}

/// Whether all cells are equal and the medium says, along the rows of cells and both ways, that it stays
/// constant without end.
fn is_uniform(medium: &impl Medium, bounds: &Bounds, size: [u32; 3], cells: &[Spectrum]) -> bool {
    let rows = || (0..size[2]).flat_map(|z| (0..size[1]).map(move |y| (y, z)));
    let is_endless = |origin: Vec3, direction: Vec3| {
        let segment = medium.majorant_segment(&Ray::new(origin, direction), 0.0);
        segment.is_constant() && segment.until == f32::INFINITY
    };
    let first = medium.extinction(bounds.centre());
    // Sums over a cell's points round.
    let is_near = |cell: &Spectrum| {
        let room = 1e-4 * first.max_element();
        (0..3).all(|i| (cell[i] - first[i]).abs() <= room)
    };
    !first.is_black()
        && rows().all(|(y, z)| {
            let part = Vec3::new(0.0, (y as f32 + 0.5) / size[1] as f32, (z as f32 + 0.5) / size[2] as f32);
            let origin = bounds.min + part * bounds.size();
            is_endless(origin, Vec3::X) && is_endless(origin, -Vec3::X)
        })
        && cells.iter().all(is_near)
}

impl<M: Medium> Medium for Pyramid<'_, M> {
    #[inline]
    fn properties(&self, point: Vec3) -> Properties {
        self.medium.properties(point)
    }
    #[inline]
    fn majorant_segment(&self, ray: &Ray, from: f32) -> MajorantSegment {
        self.medium.majorant_segment(ray, from)
    }
    #[inline]
    fn marching_segment(&self, ray: &Ray, from: f32) -> MajorantSegment {
        self.medium.marching_segment(ray, from)
    }
    #[inline]
    fn extinction(&self, point: Vec3) -> Spectrum {
        self.medium.extinction(point)
    }
    #[inline]
    fn extinction_with_gradient(&self, point: Vec3) -> (Spectrum, Gradient) {
        self.medium.extinction_with_gradient(point)
    }
    fn resolution(&self) -> f32 {
        self.medium.resolution()
    }
    fn gradients(&self, point: Vec3) -> Gradients {
        self.medium.gradients(point)
    }
    fn extinction_hessian(&self, point: Vec3) -> Hessian {
        self.medium.extinction_hessian(point)
    }

    /// From the cells of two levels; see [`Pyramid`].
    #[inline]
    fn mean_extinction(&self, centre: Vec3, radius: f32) -> Spectrum {
        let radius = radius.max(0.0);
        if self.is_uniform {
            return self.medium.mean_extinction(centre, radius);
        }
        let spread = radius * self.spread_per_radius;
        let point = (centre - self.bounds.min) * self.cells_per_metre;
        if !(spread < FAR && point.is_finite()) {
            return Spectrum::ZERO;
        }
        let at_centre = || if self.bounds.contains(centre) { self.medium.extinction(centre) } else { Spectrum::ZERO };
        let variance = spread * spread;
        // The last level whose greatest variance, 4ˡ/3, is not above: half the binary exponent.
        let level = (((3.0 * variance).to_bits() >> 23) as i32 - 127) >> 1;
        let next = self.place((level + 1).max(0) as u32, point);
        let (lower, upper) = if next.variance <= variance {
            (next, self.place(next.level + 1, point))
        } else if level >= 0 {
            (self.place(level as u32, point), next)
        } else if variance > 0.0 {
            // Below level 0 lies the centre alone, of variance 0.
            return lerp(at_centre(), self.value(&next), variance / next.variance);
        } else {
            return at_centre();
        };
        // Variances meet only where both levels have the same kernel, at fractions of 1/2 and 0.
        let between = (variance - lower.variance).max(0.0) / (upper.variance - lower.variance).max(f32::MIN_POSITIVE);
        let mean = lerp(self.value(&lower), self.value(&upper), between.min(1.0));
        // A mixture is too peaked where it is wider than the box. Products of 0 and infinity are no numbers.
        let sphere = spread * spread * spread;
        mean.zip(self.amount, |mean, amount| if amount < mean * sphere { amount / sphere } else { mean })
    }

    fn faces(&self, ray: &Ray, visit: &mut dyn FnMut(Face)) {
        self.medium.faces(ray, visit);
    }
    fn is_grey(&self) -> bool {
        self.medium.is_grey()
    }
    fn is_emissive(&self) -> bool {
        self.medium.is_emissive()
    }
}
