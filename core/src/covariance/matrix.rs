//! The covariance of a light field's spectrum: a symmetric 4×4 matrix, packed in blocks.

use bytemuck::{Pod, Zeroable};

use crate::math::symmetric::{inverted, jacobi, rebuilt};
use crate::math::{Eigen, Symmetric2, float};

/// What operators return never exceeds this (cycles²): a million cycles per metre or radian is beyond
/// anything light in a medium shows, and `f32` holds its third power.
pub const LIMIT: f32 = 1e12;

/// A symmetric 4×4 matrix over `(u, v, θ, φ)` in blocks of two:
///
/// ```text
/// [ spatial  mixed  ]      mixed = [[uθ, uφ], [vθ, vφ]]
/// [ mixedᵀ   angular ]
/// ```
///
/// ```
/// # use fogbow::{covariance::Symmetric4, math::Symmetric2};
/// let light = Symmetric4::separable(Symmetric2::diagonal(4.0, 1.0), Symmetric2::diagonal(0.5, 0.5));
/// assert_eq!(light.to_upper(), [4.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.5, 0.0, 0.5]);
/// assert_eq!(Symmetric4::from_upper(light.to_upper()), light);
/// assert_eq!(light.trace(), 6.0);
/// assert_eq!(light.plus(&light), light.times(2.0));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Symmetric4 {
    /// Rows and columns `u`, `v`.
    pub spatial: Symmetric2,
    /// Rows `u`, `v`, columns `θ`, `φ`, row by row.
    pub mixed: [f32; 4],
    /// Rows and columns `θ`, `φ`.
    pub angular: Symmetric2,
}

impl Symmetric4 {
    /// All entries zero: a light field that varies with nothing.
    pub const ZERO: Self = Self { spatial: Symmetric2::ZERO, mixed: [0.0; 4], angular: Symmetric2::ZERO };

    /// From the upper triangle row by row: `uu uv uθ uφ vv vθ vφ θθ θφ φφ`.
    #[inline]
    #[must_use]
    pub const fn from_upper([uu, uv, ut, up, vv, vt, vp, tt, tp, pp]: [f32; 10]) -> Self {
        Self { spatial: Symmetric2::new(uu, uv, vv), mixed: [ut, up, vt, vp], angular: Symmetric2::new(tt, tp, pp) }
    }

    /// The upper triangle row by row.
    #[inline]
    #[must_use]
    pub const fn to_upper(self) -> [f32; 10] {
        let Self { spatial: x, mixed: c, angular: p } = self;
        [x.xx, x.xy, c[0], c[1], x.yy, c[2], c[3], p.xx, p.xy, p.yy]
    }

    /// Without correlation between place and direction.
    #[inline]
    #[must_use]
    pub const fn separable(spatial: Symmetric2, angular: Symmetric2) -> Self {
        Self { spatial, mixed: [0.0; 4], angular }
    }

    /// Sum of the diagonal.
    #[inline]
    #[must_use]
    pub fn trace(&self) -> f32 {
        self.spatial.trace() + self.angular.trace()
    }

    /// Sum of both.
    #[inline]
    #[must_use]
    pub fn plus(&self, other: &Self) -> Self {
        Self {
            spatial: self.spatial.plus(&other.spatial),
            mixed: [0, 1, 2, 3].map(|i| self.mixed[i] + other.mixed[i]),
            angular: self.angular.plus(&other.angular),
        }
    }

    /// Every entry times `factor`.
    #[inline]
    #[must_use]
    pub fn times(&self, factor: f32) -> Self {
        Self {
            spatial: self.spatial.times(factor),
            mixed: self.mixed.map(|c| c * factor),
            angular: self.angular.times(factor),
        }
    }

    fn rows(&self) -> [[f32; 4]; 4] {
        let Self { spatial: x, mixed: c, angular: p } = *self;
        [[x.xx, x.xy, c[0], c[1]], [x.xy, x.yy, c[2], c[3]], [c[0], c[2], p.xx, p.xy], [c[1], c[3], p.xy, p.yy]]
    }

    fn from_rows(a: [[f32; 4]; 4]) -> Self {
        Self {
            spatial: Symmetric2::new(a[0][0], a[0][1], a[1][1]),
            mixed: [a[0][2], a[0][3], a[1][2], a[1][3]],
            angular: Symmetric2::new(a[2][2], a[2][3], a[3][3]),
        }
    }

    /// Eigenvalues and eigenvectors.
    ///
    /// ```
    /// # use fogbow::covariance::Symmetric4;
    /// // Place and direction vary together: uu = θθ = 2, uθ = 1.
    /// let values = Symmetric4::from_upper([2.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0]).eigen().values;
    /// assert!((values[0] - 3.0).abs() < 1e-6 && (values[1] - 1.0).abs() < 1e-6 && values[3].abs() < 1e-6);
    /// ```
    #[must_use]
    pub fn eigen(&self) -> Eigen<4> {
        jacobi(self.rows())
    }

    /// The matrix with the absolute values of the eigenvalues.
    ///
    /// ```
    /// # use fogbow::{covariance::Symmetric4, math::Symmetric2};
    /// let with = |u: f32| Symmetric4::separable(Symmetric2::diagonal(u, 1.0), Symmetric2::ZERO);
    /// assert_eq!(with(-2.0).absolute(), with(2.0));
    /// ```
    #[must_use]
    pub fn absolute(&self) -> Self {
        Self::from_rows(rebuilt(&self.eigen(), f32::abs))
    }

    /// Moore–Penrose inverse; eigenvalues below a millionth of the largest count as 0.
    ///
    /// ```
    /// # use fogbow::{covariance::Symmetric4, math::Symmetric2};
    /// let with = |u: f32| Symmetric4::separable(Symmetric2::diagonal(u, 1.0), Symmetric2::ZERO);
    /// assert_eq!(with(4.0).pseudo_inverse(), with(0.25));   // what is 0 stays 0
    /// ```
    #[must_use]
    pub fn pseudo_inverse(&self) -> Self {
        Self::from_rows(inverted(&self.eigen()))
    }

    /// What operators are made of: `f` of this matrix, mended where rounding asks for it.
    ///
    /// Where that leaves the range of covariances, it is done again from a matrix within [`LIMIT`]: then `f32`
    /// holds whatever an operator makes of it, and what is too large can be scaled back.
    #[inline]
    #[must_use]
    pub(super) fn changed(&self, f: impl Fn(&Self) -> Self) -> Self {
        let out = f(self);
        if out.is_sound() { out } else { self.mend(&out, f) }
    }

    #[cold]
    #[inline(never)]
    fn mend(&self, out: &Self, f: impl Fn(&Self) -> Self) -> Self {
        if out.is_bounded() { out.tidy() } else { f(&self.bounded()).bounded() }
    }

    /// Whether all variances are numbers within [`LIMIT`], none negative, and carry the covariances, up to rounding.
    #[inline]
    fn is_sound(&self) -> bool {
        let Self { spatial: x, mixed: c, angular: p } = self;
        let fits = |c: f32, a: f32, b: f32| c * c <= a * b * (1.0 + 4.0 * f32::EPSILON);
        // One branch, not ten.
        (x.xx >= 0.0)
            & (x.yy >= 0.0)
            & (p.xx >= 0.0)
            & (p.yy >= 0.0)
            & (x.xx + x.yy + (p.xx + p.yy) <= LIMIT)
            & fits(c[0], x.xx, p.xx)
            & fits(c[1], x.xx, p.yy)
            & fits(c[2], x.yy, p.xx)
            & fits(c[3], x.yy, p.yy)
            & fits(x.xy, x.xx, x.yy)
            & fits(p.xy, p.xx, p.yy)
    }

    /// Whether all variances are numbers within [`LIMIT`].
    fn is_bounded(&self) -> bool {
        let Self { spatial: x, angular: p, .. } = self;
        x.xx.abs() + x.yy.abs() + (p.xx.abs() + p.yy.abs()) <= LIMIT
    }

    /// This matrix, or what is left of it as a covariance.
    #[inline]
    #[must_use]
    pub(super) fn mended(&self) -> Self {
        self.changed(|a| *a)
    }

    /// Rounding may have pushed a variance below zero, or a covariance beyond what its variances carry.
    #[cold]
    #[must_use]
    fn tidy(&self) -> Self {
        let (x, p) = (self.spatial.tidy(), self.angular.tidy());
        let [u, v, t, f] = [x.xx, x.yy, p.xx, p.yy].map(float::sqrt);
        let most = [u * t, u * f, v * t, v * f];
        let mixed = [0, 1, 2, 3].map(|i| {
            let c: f32 = self.mixed[i];
            if c.abs() <= most[i] { c } else { most[i].copysign(c) }
        });
        Self { spatial: x, mixed, angular: p }
    }

    /// Rows and columns scaled so that no variance exceeds [`LIMIT`]: positive semi-definite input stays so.
    #[cold]
    #[must_use]
    fn bounded(&self) -> Self {
        let Self { spatial: x, angular: p, .. } = self;
        let [u, v, t, f] = [x.xx, x.yy, p.xx, p.yy].map(|variance| {
            // Powers of two, which round nothing.
            let mut factor = 1.0;
            while variance * factor * factor > LIMIT {
                factor *= 0.5;
            }
            factor
        });
        let scaled = self.to_upper();
        let by = [u * u, u * v, u * t, u * f, v * v, v * t, v * f, t * t, t * f, f * f];
        let entry = |k: usize| {
            let x = scaled[k] * by[k];
            // What no variance carries.
            if x.is_nan() { 0.0 } else { x.clamp(-LIMIT, LIMIT) }
        };
        Self::from_upper(core::array::from_fn(entry)).tidy()
    }
}
