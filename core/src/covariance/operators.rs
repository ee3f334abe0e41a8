//! What happens to the covariance of a light field's spectrum: Belcour et al. 2014, Fig. 3 and Eq. 6–13,
//! in the forms the sheet proves (§§ 2.2–2.4).
//!
//! All functions are total: for finite input (singular, zero, huge) the result is finite, its diagonal not
//! negative, and positive semi-definite up to rounding if the input was. The entries refer to a frame the
//! caller knows; [`LightField`](super::LightField) carries it along.

use super::matrix::{LIMIT, Symmetric4};
use crate::math::Symmetric2;
use crate::math::float::{self, PI};

/// `1/(4π²)`: from a relative Hessian to a covariance (B Eq. 2).
pub const PER_HESSIAN: f32 = 1.0 / (4.0 * PI * PI);

/// Least cosine with which a light field is projected back from a surface: beyond, spatial frequencies
/// would grow without bound at grazing angles.
pub const LEAST_COSINE: f32 = 1e-2;

/// Angular variances this much larger than those of the light let everything pass.
const PASSES_ALL: f32 = 1e6;

impl Symmetric4 {
    /// After a flight of `distance` (m) through free space.
    ///
    /// ```text
    /// T_dᵀ Σ T_d,  T_d = [[I, −d I], [0, I]]:   X′ = X,  C′ = C − dX,  P′ = P − d(C + Cᵀ) + d²X
    /// ```
    ///
    /// B Fig. 3; exact. The subtraction in `P′` cancels for long flights; a variance never drops below 0.
    ///
    /// ```
    /// # use fogbow::{covariance::Symmetric4, math::Symmetric2};
    /// let slit = Symmetric4::separable(Symmetric2::diagonal(4.0, 0.0), Symmetric2::ZERO);
    /// let far = slit.travelled(3.0);
    /// assert_eq!((far.mixed[0], far.angular.xx), (-12.0, 36.0));
    /// ```
    #[inline]
    #[must_use]
    pub fn travelled(&self, distance: f32) -> Self {
        let d = distance.clamp(-LIMIT, LIMIT);
        let Self { spatial: x, mixed: c, angular: p } = *self;
        let travelled = Self {
            spatial: x,
            mixed: [c[0] - d * x.xx, c[1] - d * x.xy, c[2] - d * x.xy, c[3] - d * x.yy],
            angular: Symmetric2 {
                xx: p.xx - d * (2.0 * c[0] - d * x.xx),
                xy: p.xy - d * (c[1] + c[2] - d * x.xy),
                yy: p.yy - d * (2.0 * c[3] - d * x.yy),
            },
        };
        travelled.tidy()
    }

    /// Multiplied in space by a mask with the spectral covariance `mask` (cycles²/m²): an occluder, a
    /// texture (B Fig. 3).
    #[inline]
    #[must_use]
    pub fn masked(&self, mask: &Symmetric2) -> Self {
        Self { spatial: self.spatial.plus(mask), ..*self }.tidy()
    }

    /// Attenuated along `distance` (m) by a medium whose extinction has the Hessian `hessian` (m⁻³) across
    /// the ray.
    ///
    /// ```text
    /// X′ = X + δt |H| / (4π²)
    /// ```
    ///
    /// B Eq. 6–7 (the print's `4π` is wrong: sheet § 2.3). Exact at minima of extinction; across maxima
    /// the truth is minus as much, so that the absolute value is conservative.
    #[inline]
    #[must_use]
    pub fn attenuated(&self, hessian: &Symmetric2, distance: f32) -> Self {
        self.masked(&hessian.absolute().times(distance * PER_HESSIAN))
    }

    /// Convolved over directions with a lobe of angular covariance `lobe` (cycles²/rad²), turned by an angle
    /// of cosine `cos_alpha` in the plane of `u`.
    ///
    /// ```text
    /// ((V Σ V)⁻¹ + [[0, 0], [0, σ_ρ⁻¹]])⁻¹,  V = diag(cos α, 1, 1, 1)
    /// Q = (σ_ρ + P)⁺:   P′ = σ_ρ Q P,  C′ = C Q σ_ρ,  X′ = X − C Q Cᵀ
    /// ```
    ///
    /// B Eq. 11–13 without inverses (sheet § 2.4), so that singular light fields and lobes are no special
    /// case. Exact for Gaussian lobes; 20–30 % off for Henyey–Greenstein with g = 0.8.
    ///
    /// ```
    /// # use fogbow::{covariance::Symmetric4, math::Symmetric2};
    /// let light = Symmetric4::separable(Symmetric2::diagonal(2.0, 2.0), Symmetric2::diagonal(3.0, 3.0));
    /// let seen = light.scattered(1.0, &Symmetric2::diagonal(1.5, 1.5));
    /// assert_eq!(seen.angular, Symmetric2::diagonal(1.0, 1.0));   // 1/(1/3 + 1/1.5)
    /// ```
    #[inline]
    #[must_use]
    pub fn scattered(&self, cos_alpha: f32, lobe: &Symmetric2) -> Self {
        let Self { spatial, mixed: c, angular: p } = *self;
        let x = spatial.scaled(cos_alpha, 1.0);
        let c = [c[0] * cos_alpha, c[1] * cos_alpha, c[2], c[3]];
        if lobe.xx + lobe.yy > PASSES_ALL * p.trace() && lobe.xx.min(lobe.yy) > PASSES_ALL * p.trace() {
            return Self { spatial: x, mixed: c, angular: p }.tidy();
        }
        let (q, is_regular) = lobe.plus(&p).inverse_and_rank();
        // C Q
        let cq = [
            c[0] * q.xx + c[1] * q.xy,
            c[0] * q.xy + c[1] * q.yy,
            c[2] * q.xx + c[3] * q.xy,
            c[2] * q.xy + c[3] * q.yy,
        ];
        let spatial = Symmetric2 {
            xx: x.xx - (cq[0] * c[0] + cq[1] * c[1]),
            xy: x.xy - (cq[0] * c[2] + cq[1] * c[3]),
            yy: x.yy - (cq[2] * c[2] + cq[3] * c[3]),
        };
        let (mixed, angular);
        if is_regular {
            mixed = [
                cq[0] * lobe.xx + cq[1] * lobe.xy,
                cq[0] * lobe.xy + cq[1] * lobe.yy,
                cq[2] * lobe.xx + cq[3] * lobe.xy,
                cq[2] * lobe.xy + cq[3] * lobe.yy,
            ];
            // σ_ρ Q P, and its transpose P Q σ_ρ: the same but for rounding.
            let sq = product(lobe, &q);
            angular = Symmetric2 {
                xx: sq[0] * p.xx + sq[1] * p.xy,
                xy: 0.5 * (sq[0] * p.xy + sq[1] * p.yy + sq[2] * p.xx + sq[3] * p.xy),
                yy: sq[2] * p.xy + sq[3] * p.yy,
            };
        } else {
            mixed = [
                c[0] - (cq[0] * p.xx + cq[1] * p.xy),
                c[1] - (cq[0] * p.xy + cq[1] * p.yy),
                c[2] - (cq[2] * p.xx + cq[3] * p.xy),
                c[3] - (cq[2] * p.xy + cq[3] * p.yy),
            ];
            let pq = product(&p, &q);
            angular = Symmetric2 {
                xx: p.xx - (pq[0] * p.xx + pq[1] * p.xy),
                xy: p.xy - 0.5 * (pq[0] * p.xy + pq[1] * p.yy + pq[2] * p.xx + pq[3] * p.xy),
                yy: p.yy - (pq[2] * p.xy + pq[3] * p.yy),
            };
        }
        Self { spatial, mixed, angular }.tidy()
    }

    /// Reflected by a surface whose lobe has the angular covariance `lobe` (cycles²/rad²), in the surface's own
    /// frame: [`Symmetric4::scattered`] without a turn.
    #[inline]
    #[must_use]
    pub fn reflected_in_lobe(&self, lobe: &Symmetric2) -> Self {
        self.scattered(1.0, lobe)
    }

    /// In a frame turned about the ray by an angle: `u′ = cos u + sin v`.
    #[inline]
    #[must_use]
    pub fn rotated(&self, cos: f32, sin: f32) -> Self {
        let Self { spatial, mixed: m, angular } = *self;
        let (c, s) = (cos, sin);
        let block = |a: &Symmetric2| Symmetric2 {
            xx: c * c * a.xx + 2.0 * c * s * a.xy + s * s * a.yy,
            xy: c * s * (a.yy - a.xx) + (c * c - s * s) * a.xy,
            yy: s * s * a.xx - 2.0 * c * s * a.xy + c * c * a.yy,
        };
        // Rᵀ C R
        let rows = [c * m[0] + s * m[2], c * m[1] + s * m[3], c * m[2] - s * m[0], c * m[3] - s * m[1]];
        let mixed = [
            c * rows[0] + s * rows[1],
            c * rows[1] - s * rows[0],
            c * rows[2] + s * rows[3],
            c * rows[3] - s * rows[2],
        ];
        Self { spatial: block(&spatial), mixed, angular: block(&angular) }.tidy()
    }

    /// Of the light field `f(λ₁u, λ₂v, λ₃θ, λ₄φ)`: `Λ Σ Λ`.
    #[inline]
    #[must_use]
    pub fn scaled(&self, [u, v, theta, phi]: [f32; 4]) -> Self {
        let Self { spatial, mixed: c, angular } = *self;
        Self {
            spatial: spatial.scaled(u, v),
            mixed: [c[0] * u * theta, c[1] * u * phi, c[2] * v * theta, c[3] * v * phi],
            angular: angular.scaled(theta, phi),
        }
        .tidy()
    }

    /// On a surface met at an angle of this cosine, in the plane of `u` (step 2 of sheet § 2.2).
    #[inline]
    #[must_use]
    pub fn projected(&self, cosine: f32) -> Self {
        self.scaled([cosine.abs(), 1.0, 1.0, 1.0])
    }

    /// Off a surface, left at an angle of this cosine (step 6); grazing angles count as [`LEAST_COSINE`].
    #[inline]
    #[must_use]
    pub fn unprojected(&self, cosine: f32) -> Self {
        self.scaled([1.0 / cosine.abs().max(LEAST_COSINE), 1.0, 1.0, 1.0])
    }

    /// In angles measured from the normals of a surface with the Weingarten map `curvature` (m⁻¹, convex
    /// positive; first axis in the plane of incidence), met at an angle of this cosine (steps 3 and 5).
    ///
    /// ```text
    /// M Σ Mᵀ,  M = [[I, −N], [0, I]],  N = [[k_tt, cos θ k_ts], [k_ts, cos θ k_ss]]
    /// ```
    #[inline]
    #[must_use]
    pub fn curved(&self, curvature: &Symmetric2, cosine: f32) -> Self {
        let Self { spatial: x, mixed: c, angular: p } = *self;
        let bound = |k: f32| k.clamp(-LIMIT, LIMIT);
        let (tt, ts, ss) = (bound(curvature.xx), bound(curvature.xy), bound(curvature.yy));
        let n = [tt, cosine * ts, ts, cosine * ss];
        // N P
        let np = [
            n[0] * p.xx + n[1] * p.xy,
            n[0] * p.xy + n[1] * p.yy,
            n[2] * p.xx + n[3] * p.xy,
            n[2] * p.xy + n[3] * p.yy,
        ];
        let mixed = [c[0] - np[0], c[1] - np[1], c[2] - np[2], c[3] - np[3]];
        // X − C Nᵀ − N Cᵀ + N P Nᵀ = X − C Nᵀ − N C′ᵀ
        let spatial = Symmetric2 {
            xx: x.xx - (c[0] + mixed[0]) * n[0] - (c[1] + mixed[1]) * n[1],
            xy: x.xy
                - 0.5
                    * ((c[0] + mixed[0]) * n[2]
                        + (c[1] + mixed[1]) * n[3]
                        + (c[2] + mixed[2]) * n[0]
                        + (c[3] + mixed[3]) * n[1]),
            yy: x.yy - (c[2] + mixed[2]) * n[2] - (c[3] + mixed[3]) * n[3],
        };
        Self { spatial, mixed, angular: p }.tidy()
    }

    /// With the second axis, and the angle about the first, counted the other way: from the mirror image of
    /// a frame to a right-handed one (step 7).
    #[inline]
    #[must_use]
    pub fn flipped(&self) -> Self {
        self.scaled([1.0, -1.0, 1.0, -1.0])
    }

    /// Of the sum of two light fields in the same frame, with energies `weight` and `other_weight`:
    /// `(I₁Σ₁ + I₂Σ₂)/(I₁ + I₂)`; zero without energy. An upper bound where their spectra interfere.
    #[inline]
    #[must_use]
    pub fn combined(&self, weight: f32, other: &Self, other_weight: f32) -> Self {
        let total = weight + other_weight;
        if !(total > 0.0) {
            return Self::ZERO;
        }
        let (a, b) = if total.is_finite() {
            (weight / total, other_weight / total)
        } else {
            // The sum overflows, halves do not.
            let half = 0.5 * weight + 0.5 * other_weight;
            (0.5 * weight / half, 0.5 * other_weight / half)
        };
        let mixed = [0, 1, 2, 3].map(|i| a * self.mixed[i] + b * other.mixed[i]);
        Self {
            spatial: self.spatial.times(a).plus(&other.spatial.times(b)),
            mixed,
            angular: self.angular.times(a).plus(&other.angular.times(b)),
        }
        .tidy()
    }

    /// Covariance (cycles²/m²) across the ray of the fluence, the light field summed over directions: the
    /// slice of its spectrum at angular frequency zero.
    ///
    /// ```text
    /// S = X − C P⁺ Cᵀ
    /// ```
    ///
    /// Sheet § 2.5 (in place of B Eq. 16). What remains below 10⁻⁶ of `X` is rounding, and returned as 0.
    #[inline]
    #[must_use]
    pub fn slice(&self) -> Symmetric2 {
        let Self { spatial: x, mixed: c, angular: p } = *self;
        let q = p.pseudo_inverse();
        let cq = [
            c[0] * q.xx + c[1] * q.xy,
            c[0] * q.xy + c[1] * q.yy,
            c[2] * q.xx + c[3] * q.xy,
            c[2] * q.xy + c[3] * q.yy,
        ];
        let least = 1e-6 * x.trace();
        let mut s = Symmetric2 {
            xx: x.xx - (cq[0] * c[0] + cq[1] * c[1]),
            xy: x.xy - 0.5 * (cq[0] * c[2] + cq[1] * c[3] + cq[2] * c[0] + cq[3] * c[1]),
            yy: x.yy - (cq[2] * c[2] + cq[3] * c[3]),
        };
        if !(s.xx > least) {
            s.xx = 0.0;
        }
        if !(s.yy > least) {
            s.yy = 0.0;
        }
        s.tidy()
    }

    /// Covariance (cycles²/rad²) over directions of the light field summed over places: `P − Cᵀ X⁺ C`,
    /// what a camera with an aperture sees.
    #[inline]
    #[must_use]
    pub fn angular_slice(&self) -> Symmetric2 {
        let Self { spatial, mixed: c, angular } = *self;
        Self { spatial: angular, mixed: [c[0], c[2], c[1], c[3]], angular: spatial }.slice()
    }

    /// Refracted by a surface with the Weingarten map `curvature` (see [`Symmetric4::curved`]).
    ///
    /// `cosines` are those of the angles of incidence and of transmission, `indices` the refractive indices on
    /// either side. Total reflection is a mirror's matter.
    ///
    /// ```text
    /// F = diag(cosθ_t,1,1,1) N₋(θ_t) diag(1,1, n_i cosθ_i/(n_t cosθ_t), n_i/n_t) N₊(θ_i) diag(1/cosθ_i,1,1,1)
    /// Σ′ = F⁻ᵀ Σ F⁻¹
    /// ```
    ///
    /// Sheet § 2.2; not in B.
    #[inline]
    #[must_use]
    pub fn refracted(&self, curvature: &Symmetric2, cosines: (f32, f32), indices: (f32, f32)) -> Self {
        let (cos_i, cos_t) = (cosines.0.abs(), cosines.1.abs().max(LEAST_COSINE));
        let ratio = indices.0 / indices.1;
        // A primal map x ↦ s·x on one axis divides the spectrum's axis by s.
        let bend = ratio * cos_i.max(LEAST_COSINE) / cos_t;
        let turned = self.projected(cos_i).curved(curvature, cos_i).scaled([1.0, 1.0, 1.0 / bend, 1.0 / ratio]);
        turned.curved(&curvature.times(-1.0), cos_t).unprojected(cos_t)
    }
}

/// `A B`, row by row.
#[inline]
fn product(a: &Symmetric2, b: &Symmetric2) -> [f32; 4] {
    [a.xx * b.xx + a.xy * b.xy, a.xx * b.xy + a.xy * b.yy, a.xy * b.xx + a.yy * b.xy, a.xy * b.xy + a.yy * b.yy]
}

/// Angular covariance (cycles²/rad²) of a Phong lobe `cosⁿ`: `n/(4π²) I` (sheet § 2.4).
#[inline]
#[must_use]
pub fn phong_lobe(exponent: f32) -> Symmetric2 {
    let b = float::min(exponent.max(0.0) * PER_HESSIAN, LIMIT);
    Symmetric2::diagonal(b, b)
}
