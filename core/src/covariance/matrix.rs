//! The covariance of a light field's spectrum: a symmetric 4×4 matrix, packed in blocks.

use bytemuck::{Pod, Zeroable};

use crate::math::symmetric::{inverse_of, jacobi, rebuilt};
use crate::math::{Eigen, Symmetric2, float};

/// Entries of covariances never exceed this (cycles²): a million cycles per metre or radian is beyond
/// anything light in a medium shows, and fourth powers of it are still finite.
pub const LIMIT: f32 = 1e12;

/// A symmetric 4×4 matrix over `(u, v, θ, φ)` in blocks of two:
///
/// ```text
/// [ spatial  mixed  ]      mixed = [[uθ, uφ], [vθ, vφ]]
/// [ mixedᵀ   angular ]
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
    #[must_use]
    pub fn eigen(&self) -> Eigen<4> {
        jacobi(self.rows())
    }

    /// The matrix with the absolute values of the eigenvalues.
    #[must_use]
    pub fn absolute(&self) -> Self {
        Self::from_rows(rebuilt(&self.eigen(), f32::abs))
    }

    /// Moore–Penrose inverse; eigenvalues below a millionth of the largest count as 0.
    #[must_use]
    pub fn pseudo_inverse(&self) -> Self {
        let eigen = self.eigen();
        let largest = eigen.values[0].abs().max(eigen.values[3].abs());
        Self::from_rows(rebuilt(&eigen, |value| inverse_of(value, largest)))
    }

    /// What every operator ends with: rounding may have pushed a variance below zero or a covariance beyond
    /// what its variances carry; numbers beyond [`LIMIT`] are scaled back row and column together, which
    /// keeps the matrix positive semi-definite.
    #[inline]
    #[must_use]
    pub(super) fn tidy(self) -> Self {
        let Self { spatial: mut x, mixed: mut c, angular: mut p } = self;
        let largest = float::max(float::max(x.xx, x.yy), float::max(p.xx, p.yy));
        if !(largest <= LIMIT) {
            return self.bounded();
        }
        x = x.tidy();
        p = p.tidy();
        for (i, entry) in c.iter_mut().enumerate() {
            let row = if i < 2 { x.xx } else { x.yy };
            let column = if i % 2 == 0 { p.xx } else { p.yy };
            let most = row * column;
            if !(*entry * *entry <= most) {
                *entry = float::sqrt(most).copysign(*entry);
            }
        }
        Self { spatial: x, mixed: c, angular: p }
    }

    /// [`Symmetric4::tidy`] for what is beyond [`LIMIT`].
    #[cold]
    fn bounded(self) -> Self {
        let clean = |x: f32| if x.is_nan() { 0.0 } else { x.clamp(-1e36, 1e36) };
        let upper = self.to_upper().map(clean);
        let diagonal = [upper[0], upper[4], upper[7], upper[9]];
        let s = diagonal.map(|d| if d > LIMIT { float::sqrt(LIMIT / d) } else { 1.0 });
        let mut k = 0;
        let mut out = [0.0; 10];
        for i in 0..4 {
            for j in i..4 {
                out[k] = (upper[k] * s[i] * s[j]).clamp(-LIMIT, LIMIT);
                k += 1;
            }
        }
        for k in [0, 4, 7, 9] {
            out[k] = out[k].max(0.0);
        }
        Self::from_upper(out).tidy()
    }
}
