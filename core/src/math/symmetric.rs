//! Symmetric matrices, packed, with eigenvalues, absolute value and pseudo-inverse.
//!
//! Every function has a defined result for every finite input: singular, zero and huge ones included.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::float;

/// Inverses of tiny numbers stop here.
const HUGE: f32 = 1e30;

/// `[[xx, xy], [xy, yy]]`.
///
/// ```
/// # use fogbow::math::Symmetric2;
/// let a = Symmetric2::new(2.0, 1.0, 2.0);
/// assert_eq!((a.trace(), a.determinant()), (4.0, 3.0));
/// assert_eq!((a.along(1.0, 1.0), a.along(1.0, -1.0)), (6.0, 2.0));   // λ |x|² for the eigenvalues 3 and 1
/// let unit = Symmetric2::diagonal(1.0, 1.0);
/// assert_eq!(a.plus(&unit).determinant(), 8.0);   // both eigenvalues are larger by one
/// assert_eq!(unit.scaled(3.0, 3.0), unit.times(9.0));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Symmetric2 {
    /// First row, first column.
    pub xx: f32,
    /// Off the diagonal.
    pub xy: f32,
    /// Second row, second column.
    pub yy: f32,
}

/// A symmetric 3×3 matrix, upper triangle row by row.
///
/// ```
/// # use fogbow::math::{Symmetric3, Vec3};
/// let upper = [2.0, 1.0, 0.0, 2.0, 0.0, 5.0];
/// let a = Symmetric3::from_upper(upper);
/// assert_eq!((a.trace(), a.to_upper()), (9.0, upper));
/// let x = Vec3::new(1.0, 1.0, 0.0);
/// assert_eq!((a.applied(x), a.along(x)), (3.0 * x, 6.0));   // an eigenvector of 3: A x = 3 x, xᵀ A x = 3 |x|²
/// assert_eq!(a.plus(&a), a.times(2.0));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Symmetric3 {
    /// First row, first column.
    pub xx: f32,
    /// First row, second column.
    pub xy: f32,
    /// First row, third column.
    pub xz: f32,
    /// Second row, second column.
    pub yy: f32,
    /// Second row, third column.
    pub yz: f32,
    /// Third row, third column.
    pub zz: f32,
}

/// Eigenvalues in descending order and, row by row, their eigenvectors (unit, orthogonal).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Eigen<const N: usize> {
    /// Eigenvalues, the largest first.
    pub values: [f32; N],
    /// `vectors[i]` belongs to `values[i]`.
    pub vectors: [[f32; N]; N],
}

/// Cyclic Jacobi rotations: exact symmetry, small relative errors, no failure.
#[expect(clippy::needless_range_loop, reason = "rows and columns of one matrix change together")]
pub(crate) fn jacobi<const N: usize>(mut a: [[f32; N]; N]) -> Eigen<N> {
    let largest = a.iter().flatten().fold(0.0_f32, |m, x| m.max(x.abs()));
    let mut vectors = [[0.0; N]; N];
    for (i, row) in vectors.iter_mut().enumerate() {
        row[i] = 1.0;
    }
    if !(largest > 0.0 && largest.is_finite()) {
        return Eigen { values: [0.0; N], vectors };
    }
    for x in a.iter_mut().flatten() {
        *x /= largest;
    }
    // Converges quadratically: four by four needs five sweeps at most.
    for _ in 0..8 {
        let mut off = 0.0;
        for p in 0..N {
            for q in p + 1..N {
                off += a[p][q] * a[p][q];
            }
        }
        if off < 1e-20 {
            break;
        }
        for p in 0..N {
            for q in p + 1..N {
                if a[p][q].abs() < 1e-18 {
                    continue;
                }
                let slope = 0.5 * (a[q][q] - a[p][p]) / a[p][q];
                let t = 1.0_f32.copysign(slope) / (slope.abs() + float::sqrt(slope * slope + 1.0));
                let c = 1.0 / float::sqrt(t * t + 1.0);
                let s = t * c;
                for k in 0..N {
                    let (x, y) = (a[k][p], a[k][q]);
                    a[k][p] = c * x - s * y;
                    a[k][q] = s * x + c * y;
                }
                for k in 0..N {
                    let (x, y) = (a[p][k], a[q][k]);
                    a[p][k] = c * x - s * y;
                    a[q][k] = s * x + c * y;
                    let (x, y) = (vectors[p][k], vectors[q][k]);
                    vectors[p][k] = c * x - s * y;
                    vectors[q][k] = s * x + c * y;
                }
            }
        }
    }
    let mut order = [0; N];
    for (i, o) in order.iter_mut().enumerate() {
        *o = i;
    }
    // Of equals in their order: the same on every machine.
    order.sort_unstable_by(|&i, &j| a[j][j].total_cmp(&a[i][i]).then(i.cmp(&j)));
    let value = |i: usize| (a[i][i] * largest).clamp(-f32::MAX, f32::MAX);
    Eigen { values: order.map(value), vectors: order.map(|i| vectors[i]) }
}

/// `Σ f(λ) v vᵀ`.
pub(crate) fn rebuilt<const N: usize>(eigen: &Eigen<N>, f: impl Fn(f32) -> f32) -> [[f32; N]; N] {
    let mut out = [[0.0; N]; N];
    for (value, v) in eigen.values.iter().zip(&eigen.vectors) {
        let value = f(*value);
        for i in 0..N {
            for j in 0..N {
                out[i][j] += value * (v[i] * v[j]);
            }
        }
    }
    // Near the largest number a last bit may be one too many.
    out.map(|row| row.map(|x| x.clamp(-f32::MAX, f32::MAX)))
}

/// The Moore–Penrose inverse; eigenvalues below a millionth of the largest count as 0.
pub(crate) fn inverted<const N: usize>(eigen: &Eigen<N>) -> [[f32; N]; N] {
    let largest = eigen.values.iter().fold(0.0_f32, |m, x| m.max(x.abs()));
    rebuilt(eigen, |value| if value.abs() > 1e-6 * largest { (1.0 / value).clamp(-HUGE, HUGE) } else { 0.0 })
}

impl Symmetric2 {
    /// All entries zero.
    pub const ZERO: Self = Self { xx: 0.0, xy: 0.0, yy: 0.0 };

    /// From the upper triangle row by row.
    #[inline]
    #[must_use]
    pub const fn new(xx: f32, xy: f32, yy: f32) -> Self {
        Self { xx, xy, yy }
    }

    /// `diag(x, y)`.
    #[inline]
    #[must_use]
    pub const fn diagonal(x: f32, y: f32) -> Self {
        Self { xx: x, xy: 0.0, yy: y }
    }

    /// Sum of the diagonal.
    #[inline]
    #[must_use]
    pub fn trace(&self) -> f32 {
        self.xx + self.yy
    }

    /// Determinant; products are rounded once, so that what cancels is right.
    #[inline]
    #[must_use]
    pub fn determinant(&self) -> f32 {
        float::difference_of_products(self.xx, self.yy, self.xy, self.xy)
    }

    /// `xᵀ A x` for a column `(x, y)`.
    #[inline]
    #[must_use]
    pub fn along(&self, x: f32, y: f32) -> f32 {
        self.xx * x * x + 2.0 * self.xy * x * y + self.yy * y * y
    }

    /// Sum of both.
    #[inline]
    #[must_use]
    pub fn plus(&self, other: &Self) -> Self {
        Self { xx: self.xx + other.xx, xy: self.xy + other.xy, yy: self.yy + other.yy }
    }

    /// Every entry times `factor`.
    #[inline]
    #[must_use]
    pub fn times(&self, factor: f32) -> Self {
        Self { xx: self.xx * factor, xy: self.xy * factor, yy: self.yy * factor }
    }

    /// `diag(x, y) A diag(x, y)`.
    #[inline]
    #[must_use]
    pub fn scaled(&self, x: f32, y: f32) -> Self {
        Self { xx: self.xx * x * x, xy: self.xy * x * y, yy: self.yy * y * y }
    }

    /// Eigenvalues and eigenvectors.
    ///
    /// ```
    /// # use fogbow::math::Symmetric2;
    /// let eigen = Symmetric2::new(2.0, 1.0, 2.0).eigen();
    /// assert!((eigen.values[0] - 3.0).abs() < 1e-6 && (eigen.values[1] - 1.0).abs() < 1e-6);
    /// let [x, y] = eigen.vectors[0];
    /// assert!((x - y).abs() < 1e-6);   // along the diagonal
    /// ```
    #[must_use]
    pub fn eigen(&self) -> Eigen<2> {
        jacobi([[self.xx, self.xy], [self.xy, self.yy]])
    }

    /// The matrix with the absolute values of the eigenvalues.
    ///
    /// ```text
    /// |A| = (A² + |det A| I)/(|λ₁| + |λ₂|)   where the signs of λ differ,   ±A elsewhere
    /// ```
    ///
    /// No trigonometry; sheet § 2.3. Where that exceeds what `f32` holds, it is scaled back as a whole.
    ///
    /// ```
    /// # use fogbow::math::Symmetric2;
    /// assert_eq!(Symmetric2::diagonal(-1.0, 3.0).absolute(), Symmetric2::diagonal(1.0, 3.0));
    /// ```
    #[inline]
    #[must_use]
    pub fn absolute(&self) -> Self {
        let mean = 0.5 * self.xx + 0.5 * self.yy;
        let half = 0.5 * self.xx - 0.5 * self.yy;
        let radius = float::hypot(half, self.xy);
        if mean >= radius {
            return *self;
        }
        if mean <= -radius {
            return self.times(-1.0);
        }
        if !(radius > 1e-30 && radius < 1e38) {
            return self.absolute_beyond(radius);
        }
        // In units of the radius, so that squares neither overflow nor vanish.
        let a = self.times(1.0 / radius);
        let det = (a.xx * a.yy - a.xy * a.xy).abs();
        let out =
            Self { xx: a.xx * a.xx + a.xy * a.xy + det, xy: a.xy * (a.xx + a.yy), yy: a.yy * a.yy + a.xy * a.xy + det };
        out.times(0.5 * radius)
    }

    /// [`Symmetric2::absolute`] where `radius` is tiny or huge.
    #[cold]
    fn absolute_beyond(&self, radius: f32) -> Self {
        if radius < 1.0 {
            return self.times(1e30).absolute().times(1e-30);
        }
        let out = self.times(1e-6).absolute();
        out.times(float::min(1e6, 0.999 * f32::MAX / float::max(out.xx, out.yy)))
    }

    /// Moore–Penrose inverse of a positive semi-definite matrix: the inverse, that of rank one where the
    /// determinant drowns in rounding, or zero; entries do not exceed 10³⁰.
    ///
    /// ```
    /// # use fogbow::math::Symmetric2;
    /// assert_eq!(Symmetric2::diagonal(4.0, 0.0).pseudo_inverse(), Symmetric2::diagonal(0.25, 0.0));
    /// ```
    #[must_use]
    pub fn pseudo_inverse(&self) -> Self {
        // Products of two `f32` are exact in `f64`, which also holds the squares of all of them.
        let Self { xx, xy, yy } = self.tidy();
        let [xx, xy, yy] = [xx, xy, yy].map(f64::from);
        let (det, trace) = (xx * yy - xy * xy, xx + yy);
        let bounded = |x: f64| x.clamp(-f64::from(HUGE), f64::from(HUGE)) as f32;
        if det > 1e-6 * xx * yy {
            let f = 1.0 / det;
            Self { xx: bounded(yy * f), xy: bounded(-xy * f), yy: bounded(xx * f) }
        } else if trace > 0.0 {
            // A/‖A‖²
            let f = 1.0 / (trace * trace);
            Self { xx: bounded(xx * f), xy: bounded(xy * f), yy: bounded(yy * f) }
        } else {
            Self::ZERO
        }
    }

    /// Nothing negative on the diagonal, nothing off it that the diagonal cannot carry.
    #[inline]
    #[must_use]
    pub(crate) fn tidy(mut self) -> Self {
        self.xx = float::max(self.xx, 0.0);
        self.yy = float::max(self.yy, 0.0);
        if !(self.xy * self.xy <= self.xx * self.yy) {
            self.xy = float::sqrt(self.xx) * float::sqrt(self.yy).copysign(self.xy);
        }
        self
    }

    /// Scaled back as a whole if a variance exceeds `most`; positive semi-definite input stays so.
    #[must_use]
    pub(crate) fn bounded(&self, most: f32) -> Self {
        let larger = float::max(self.xx.abs(), self.yy.abs());
        if larger <= most { *self } else { self.times(most / larger) }
    }
}

impl Symmetric3 {
    /// All entries zero.
    pub const ZERO: Self = Self { xx: 0.0, xy: 0.0, xz: 0.0, yy: 0.0, yz: 0.0, zz: 0.0 };

    /// From the upper triangle row by row.
    #[inline]
    #[must_use]
    pub const fn from_upper([xx, xy, xz, yy, yz, zz]: [f32; 6]) -> Self {
        Self { xx, xy, xz, yy, yz, zz }
    }

    /// The upper triangle row by row.
    #[inline]
    #[must_use]
    pub const fn to_upper(self) -> [f32; 6] {
        [self.xx, self.xy, self.xz, self.yy, self.yz, self.zz]
    }

    /// `R A Rᵀ` with the columns `u`, `v` of `R`: a matrix in a plane, in space.
    ///
    /// ```
    /// # use fogbow::math::{Symmetric2, Symmetric3, Vec3};
    /// let floor = Symmetric3::embedded(&Symmetric2::diagonal(4.0, 9.0), Vec3::Y, Vec3::X);
    /// assert_eq!((floor.along(Vec3::Y), floor.along(Vec3::X), floor.along(Vec3::Z)), (4.0, 9.0, 0.0));
    /// ```
    #[inline]
    #[must_use]
    pub fn embedded(a: &Symmetric2, u: Vec3, v: Vec3) -> Self {
        let (p, q) = (u * a.xx + v * a.xy, u * a.xy + v * a.yy);
        Self {
            xx: p.x * u.x + q.x * v.x,
            xy: p.x * u.y + q.x * v.y,
            xz: p.x * u.z + q.x * v.z,
            yy: p.y * u.y + q.y * v.y,
            yz: p.y * u.z + q.y * v.z,
            zz: p.z * u.z + q.z * v.z,
        }
    }

    /// `Rᵀ A R` with the columns `u`, `v` of `R`: what the matrix says within a plane.
    ///
    /// ```
    /// # use fogbow::math::{Symmetric2, Symmetric3, Vec3};
    /// let flat = Symmetric2::new(4.0, 1.0, 9.0);
    /// let space = Symmetric3::embedded(&flat, Vec3::Y, Vec3::Z);
    /// assert_eq!(space.within(Vec3::Y, Vec3::Z), flat);   // undoes `embedded`
    /// ```
    #[inline]
    #[must_use]
    pub fn within(&self, u: Vec3, v: Vec3) -> Symmetric2 {
        let (p, q) = (self.applied(u), self.applied(v));
        Symmetric2 { xx: p.dot(u), xy: p.dot(v), yy: q.dot(v) }
    }

    /// `A x`.
    #[inline]
    #[must_use]
    pub fn applied(&self, x: Vec3) -> Vec3 {
        Vec3::new(
            self.xx * x.x + self.xy * x.y + self.xz * x.z,
            self.xy * x.x + self.yy * x.y + self.yz * x.z,
            self.xz * x.x + self.yz * x.y + self.zz * x.z,
        )
    }

    /// `xᵀ A x`.
    #[inline]
    #[must_use]
    pub fn along(&self, x: Vec3) -> f32 {
        self.applied(x).dot(x)
    }

    /// Sum of the diagonal.
    #[inline]
    #[must_use]
    pub fn trace(&self) -> f32 {
        self.xx + self.yy + self.zz
    }

    /// Sum of both.
    #[inline]
    #[must_use]
    pub fn plus(&self, other: &Self) -> Self {
        Self {
            xx: self.xx + other.xx,
            xy: self.xy + other.xy,
            xz: self.xz + other.xz,
            yy: self.yy + other.yy,
            yz: self.yz + other.yz,
            zz: self.zz + other.zz,
        }
    }

    /// Every entry times `factor`.
    #[inline]
    #[must_use]
    pub fn times(&self, factor: f32) -> Self {
        Self {
            xx: self.xx * factor,
            xy: self.xy * factor,
            xz: self.xz * factor,
            yy: self.yy * factor,
            yz: self.yz * factor,
            zz: self.zz * factor,
        }
    }

    /// Scaled back as a whole if an entry exceeds `most`: what comes of it fits `f32` then.
    #[inline]
    #[must_use]
    pub(crate) fn bounded(&self, most: f32) -> Self {
        let largest = self.to_upper().iter().fold(0.0_f32, |m, x| float::max(x.abs(), m));
        if largest <= most { *self } else { self.times(most / largest) }
    }

    fn rows(&self) -> [[f32; 3]; 3] {
        [[self.xx, self.xy, self.xz], [self.xy, self.yy, self.yz], [self.xz, self.yz, self.zz]]
    }

    fn from_rows(a: [[f32; 3]; 3]) -> Self {
        Self { xx: a[0][0], xy: a[0][1], xz: a[0][2], yy: a[1][1], yz: a[1][2], zz: a[2][2] }
    }

    /// Eigenvalues and eigenvectors.
    ///
    /// ```
    /// # use fogbow::math::Symmetric3;
    /// let a = Symmetric3::from_upper([2.0, 1.0, 0.0, 2.0, 0.0, 5.0]);
    /// let values = a.eigen().values;
    /// assert!((values[0] - 5.0).abs() < 1e-6 && (values[1] - 3.0).abs() < 1e-6 && (values[2] - 1.0).abs() < 1e-6);
    /// ```
    #[must_use]
    pub fn eigen(&self) -> Eigen<3> {
        jacobi(self.rows())
    }

    /// The matrix with the absolute values of the eigenvalues.
    ///
    /// ```
    /// # use fogbow::math::Symmetric3;
    /// let saddle = Symmetric3::from_upper([-1.0, 0.0, 0.0, 2.0, 0.0, -3.0]);
    /// assert_eq!(saddle.absolute().to_upper(), [1.0, 0.0, 0.0, 2.0, 0.0, 3.0]);
    /// ```
    #[must_use]
    pub fn absolute(&self) -> Self {
        Self::from_rows(rebuilt(&self.eigen(), f32::abs))
    }

    /// Moore–Penrose inverse; eigenvalues below a millionth of the largest count as 0.
    ///
    /// ```
    /// # use fogbow::math::Symmetric3;
    /// let flat = Symmetric3::from_upper([2.0, 0.0, 0.0, 4.0, 0.0, 0.0]);
    /// assert_eq!(flat.pseudo_inverse().to_upper(), [0.5, 0.0, 0.0, 0.25, 0.0, 0.0]);   // 0 stays 0
    /// ```
    #[must_use]
    pub fn pseudo_inverse(&self) -> Self {
        Self::from_rows(inverted(&self.eigen()))
    }
}
