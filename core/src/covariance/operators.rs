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

/// Relative: four times the rounding of an `f32`, for four rows. Larger, results err by as much; smaller, a
/// matrix whose entries were rounded one by one may have a negative eigenvalue.
const SLACK: f64 = 2.4e-7;

/// Keeps what divides from being zero, and is itself zero in `f32`.
const TINY: f64 = 1e-50;

/// What remains of a difference below this part of its terms is rounding: a few of [`SLACK`].
const ROUNDING: f32 = 1e-6;

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
        self.changed(|&Self { spatial: x, mixed: c, angular: p }| Self {
            spatial: x,
            mixed: [c[0] - d * x.xx, c[1] - d * x.xy, c[2] - d * x.xy, c[3] - d * x.yy],
            angular: Symmetric2 {
                xx: p.xx - d * (2.0 * c[0] - d * x.xx),
                xy: p.xy - d * (c[1] + c[2] - d * x.xy),
                yy: p.yy - d * (2.0 * c[3] - d * x.yy),
            },
        })
    }

    /// Multiplied in space by a mask with the spectral covariance `mask` (cycles²/m²): an occluder, a
    /// texture (B Fig. 3).
    ///
    /// ```
    /// # use fogbow::{covariance::Symmetric4, math::Symmetric2};
    /// let edge = Symmetric2::diagonal(4.0, 0.0);
    /// let lit = Symmetric4::separable(Symmetric2::diagonal(1.0, 1.0), Symmetric2::ZERO).masked(&edge);
    /// assert_eq!(lit.spatial, Symmetric2::diagonal(5.0, 1.0));   // of a product of functions, variances add up
    /// ```
    #[inline]
    #[must_use]
    pub fn masked(&self, mask: &Symmetric2) -> Self {
        let mask = mask.bounded(LIMIT);
        self.changed(|a| Self { spatial: a.spatial.plus(&mask), ..*a })
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
    ///
    /// ```
    /// # use fogbow::{covariance::Symmetric4, math::{Symmetric2, float::PI}};
    /// let hessian = Symmetric2::diagonal(-4.0 * PI * PI, 0.0);   // across a maximum of extinction
    /// let seen = Symmetric4::ZERO.attenuated(&hessian, 0.5);
    /// assert!((seen.spatial.xx - 0.5).abs() < 1e-6 && seen.spatial.yy == 0.0);
    /// ```
    #[inline]
    #[must_use]
    pub fn attenuated(&self, hessian: &Symmetric2, distance: f32) -> Self {
        // In this order no product of finite numbers is lost before it is small.
        self.masked(&hessian.absolute().bounded(1e30).times(PER_HESSIAN * float::min(distance, 1e30)).bounded(LIMIT))
    }

    /// Convolved over directions with a lobe of angular covariance `lobe` (cycles²/rad²), turned by an angle
    /// of cosine `cos_alpha` in the plane of `u`.
    ///
    /// ```text
    /// ((V Σ V)⁻¹ + [[0, 0], [0, σ_ρ⁻¹]])⁻¹,  V = diag(cos α, 1, 1, 1)
    /// Q = (σ_ρ + P)⁻¹:   P′ = σ_ρ Q P,  C′ = C Q σ_ρ,  X′ = X − C Q Cᵀ
    /// ```
    ///
    /// B Eq. 11–13 without inverses of `Σ` or `σ_ρ` (sheet § 2.4), so that singular light fields and lobes are no
    /// special case. `P′` is a sum of positive terms, thanks to an identity of 2×2 matrices. Inside, numbers are
    /// `f64`, which holds products of `f32` exactly. Where the entries, each rounded, say together what no covariance
    /// can, and where `σ_ρ + P` has no inverse, `σ_ρ` and `P` are larger by the rounding of an `f32`: then nothing divides
    /// by zero, and nothing becomes negative. Exact for Gaussian lobes; 20–30 % off for Henyey–Greenstein with g = 0.8.
    ///
    /// ```
    /// # use fogbow::{covariance::Symmetric4, math::Symmetric2};
    /// let light = Symmetric4::separable(Symmetric2::diagonal(2.0, 2.0), Symmetric2::diagonal(3.0, 3.0));
    /// let seen = light.scattered(1.0, &Symmetric2::diagonal(1.5, 1.5));
    /// assert!((seen.angular.xx - 1.0).abs() < 1e-6);   // 1/(1/3 + 1/1.5)
    /// ```
    #[inline]
    #[must_use]
    pub fn scattered(&self, cos_alpha: f32, lobe: &Symmetric2) -> Self {
        self.changed(|a| {
            let [x, p, s] = [&a.spatial, &a.angular, lobe].map(Wide::new);
            let c = a.mixed.map(f64::from);
            let slack = if is_possible(&x, &c, &p) && !is_singular(&p, &s) { 0.0 } else { SLACK };
            let cos = f64::from(cos_alpha);
            let x = Wide { xx: x.xx * cos * cos, xy: x.xy * cos, yy: x.yy };
            let c = [c[0] * cos, c[1] * cos, c[2], c[3]];
            let (p, s) = (p.not_singular(slack, TINY), s.not_singular(slack, 0.0));
            // |σ_ρ + P| in parts that are not negative.
            let (det_p, det_s, cross) = (p.determinant(slack), s.determinant(slack), mixed_determinant(&p, &s));
            let scale = 1.0 / (det_p + det_s + cross);
            let (of_light, of_lobe) = (scale * det_s, scale * det_p);
            let sum = Wide { xx: s.xx + p.xx, xy: s.xy + p.xy, yy: s.yy + p.yy };
            let cq = sum.adjoint_after(&c, scale);
            let cp = p.adjoint_after(&c, scale);
            Self {
                spatial: x.without(&cq, &c),
                mixed: [
                    of_light * c[0] + (cp[0] * s.xx + cp[1] * s.xy),
                    of_light * c[1] + (cp[0] * s.xy + cp[1] * s.yy),
                    of_light * c[2] + (cp[2] * s.xx + cp[3] * s.xy),
                    of_light * c[3] + (cp[2] * s.xy + cp[3] * s.yy),
                ]
                .map(|x| x as f32),
                angular: Symmetric2 {
                    xx: (of_light * p.xx + of_lobe * s.xx) as f32,
                    xy: (of_light * p.xy + of_lobe * s.xy) as f32,
                    yy: (of_light * p.yy + of_lobe * s.yy) as f32,
                },
            }
        })
    }

    /// Reflected by a surface whose lobe has the angular covariance `lobe` (cycles²/rad²), in the surface's own
    /// frame: [`Symmetric4::scattered`] without a turn.
    ///
    /// ```
    /// # use fogbow::{covariance::Symmetric4, math::Symmetric2};
    /// let unit = Symmetric2::diagonal(1.0, 1.0);
    /// let light = Symmetric4::separable(unit, unit);
    /// // A diffuse surface shows where it is lit, not from where.
    /// let seen = light.reflected_in_lobe(&Symmetric2::ZERO);
    /// assert_eq!((seen.spatial, seen.angular), (unit, Symmetric2::ZERO));
    /// ```
    #[inline]
    #[must_use]
    pub fn reflected_in_lobe(&self, lobe: &Symmetric2) -> Self {
        self.scattered(1.0, lobe)
    }

    /// In a frame turned about the ray by an angle: `u′ = cos u + sin v`.
    ///
    /// ```
    /// # use fogbow::{covariance::Symmetric4, math::Symmetric2};
    /// let light = Symmetric4::separable(Symmetric2::diagonal(4.0, 1.0), Symmetric2::ZERO);
    /// assert_eq!(light.rotated(0.0, 1.0).spatial, Symmetric2::diagonal(1.0, 4.0));   // a right angle swaps the axes
    /// ```
    #[inline]
    #[must_use]
    pub fn rotated(&self, cos: f32, sin: f32) -> Self {
        let (c, s) = (cos, sin);
        let block = |a: &Symmetric2| Symmetric2 {
            xx: c * c * a.xx + 2.0 * c * s * a.xy + s * s * a.yy,
            xy: c * s * (a.yy - a.xx) + (c * c - s * s) * a.xy,
            yy: s * s * a.xx - 2.0 * c * s * a.xy + c * c * a.yy,
        };
        self.changed(|&Self { spatial, mixed: m, angular }| {
            // Rᵀ C R
            let rows = [c * m[0] + s * m[2], c * m[1] + s * m[3], c * m[2] - s * m[0], c * m[3] - s * m[1]];
            let mixed = [
                c * rows[0] + s * rows[1],
                c * rows[1] - s * rows[0],
                c * rows[2] + s * rows[3],
                c * rows[3] - s * rows[2],
            ];
            Self { spatial: block(&spatial), mixed, angular: block(&angular) }
        })
    }

    /// Of the light field `f(λ₁u, λ₂v, λ₃θ, λ₄φ)`: `Λ Σ Λ`.
    ///
    /// ```
    /// # use fogbow::{covariance::Symmetric4, math::Symmetric2};
    /// let unit = Symmetric2::diagonal(1.0, 1.0);
    /// let squeezed = Symmetric4::separable(unit, unit).scaled([3.0, 1.0, 1.0, 1.0]);
    /// assert_eq!(squeezed.spatial, Symmetric2::diagonal(9.0, 1.0));   // three times as fast
    /// ```
    #[inline]
    #[must_use]
    pub fn scaled(&self, factors: [f32; 4]) -> Self {
        let [u, v, theta, phi] = factors.map(|x| x.clamp(-LIMIT, LIMIT));
        self.changed(|&Self { spatial, mixed: c, angular }| Self {
            spatial: spatial.scaled(u, v),
            mixed: [c[0] * u * theta, c[1] * u * phi, c[2] * v * theta, c[3] * v * phi],
            angular: angular.scaled(theta, phi),
        })
    }

    /// On a surface met at an angle of this cosine, in the plane of `u` (step 2 of sheet § 2.2).
    ///
    /// ```
    /// # use fogbow::{covariance::Symmetric4, math::Symmetric2};
    /// let light = Symmetric4::separable(Symmetric2::diagonal(4.0, 4.0), Symmetric2::ZERO);
    /// // At 60° what is 1 m across the ray is 2 m on the surface.
    /// assert_eq!(light.projected(0.5).spatial, Symmetric2::diagonal(1.0, 4.0));
    /// ```
    #[inline]
    #[must_use]
    pub fn projected(&self, cosine: f32) -> Self {
        self.scaled([cosine.abs(), 1.0, 1.0, 1.0])
    }

    /// Off a surface, left at an angle of this cosine (step 6); grazing angles count as [`LEAST_COSINE`].
    ///
    /// ```
    /// # use fogbow::{covariance::Symmetric4, math::Symmetric2};
    /// let light = Symmetric4::separable(Symmetric2::diagonal(4.0, 4.0), Symmetric2::ZERO);
    /// assert_eq!(light.projected(0.5).unprojected(0.5), light);
    /// ```
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
    ///
    /// ```
    /// # use fogbow::{covariance::Symmetric4, math::Symmetric2};
    /// // Where a surface is curved, what varies with direction varies with place: by k² as much.
    /// let light = Symmetric4::separable(Symmetric2::ZERO, Symmetric2::diagonal(3.0, 0.0));
    /// let on_ball = light.curved(&Symmetric2::diagonal(2.0, 2.0), 1.0);
    /// assert_eq!((on_ball.spatial.xx, on_ball.mixed[0], on_ball.angular.xx), (12.0, -6.0, 3.0));
    /// ```
    #[inline]
    #[must_use]
    pub fn curved(&self, curvature: &Symmetric2, cosine: f32) -> Self {
        let bound = |k: f32| k.clamp(-LIMIT, LIMIT);
        let (tt, ts, ss) = (bound(curvature.xx), bound(curvature.xy), bound(curvature.yy));
        let n = [tt, cosine * ts, ts, cosine * ss];
        self.changed(|&Self { spatial: x, mixed: c, angular: p }| {
            // N P
            let np = [
                n[0] * p.xx + n[1] * p.xy,
                n[0] * p.xy + n[1] * p.yy,
                n[2] * p.xx + n[3] * p.xy,
                n[2] * p.xy + n[3] * p.yy,
            ];
            let mixed = [c[0] - np[0], c[1] - np[1], c[2] - np[2], c[3] - np[3]];
            // X − C Nᵀ − N Cᵀ + N P Nᵀ = X − (C + C′) Nᵀ, made symmetric
            let both = [c[0] + mixed[0], c[1] + mixed[1], c[2] + mixed[2], c[3] + mixed[3]];
            let spatial = Symmetric2 {
                xx: x.xx - both[0] * n[0] - both[1] * n[1],
                xy: x.xy - 0.5 * (both[0] * n[2] + both[1] * n[3] + both[2] * n[0] + both[3] * n[1]),
                yy: x.yy - both[2] * n[2] - both[3] * n[3],
            };
            Self { spatial, mixed, angular: p }
        })
    }

    /// With the second axis, and the angle about the first, counted the other way: from the mirror image of
    /// a frame to a right-handed one (step 7).
    ///
    /// ```
    /// # use fogbow::{covariance::Symmetric4, math::Symmetric2};
    /// let slanted = Symmetric4::separable(Symmetric2::new(2.0, 1.0, 2.0), Symmetric2::ZERO);
    /// assert_eq!(slanted.flipped().spatial, Symmetric2::new(2.0, -1.0, 2.0));
    /// assert_eq!(slanted.flipped().flipped(), slanted);
    /// ```
    #[inline]
    #[must_use]
    pub fn flipped(&self) -> Self {
        self.scaled([1.0, -1.0, 1.0, -1.0])
    }

    /// Of the sum of two light fields in the same frame, with energies `weight` and `other_weight`:
    /// `(I₁Σ₁ + I₂Σ₂)/(I₁ + I₂)`; zero without energy. An upper bound where their spectra interfere.
    ///
    /// ```
    /// # use fogbow::{covariance::Symmetric4, math::Symmetric2};
    /// let sharp = Symmetric4::separable(Symmetric2::diagonal(8.0, 0.0), Symmetric2::ZERO);
    /// let mixed = sharp.combined(1.0, &Symmetric4::ZERO, 3.0);   // among three times as much even light
    /// assert_eq!(mixed.spatial.xx, 2.0);
    /// ```
    #[inline]
    #[must_use]
    pub fn combined(&self, weight: f32, other: &Self, other_weight: f32) -> Self {
        let (weight, other_weight) = (float::max(weight, 0.0), float::max(other_weight, 0.0));
        let larger = float::max(weight, other_weight);
        if !(larger > 0.0) {
            return Self::ZERO;
        }
        // By the larger first: sums of huge weights, and inverses of tiny ones, leave what `f32` holds.
        let (a, b) = (weight / larger, other_weight / larger);
        let (a, b) = (a / (a + b), b / (a + b));
        self.changed(|this| this.times(a).plus(&other.times(b)))
    }

    /// Covariance (cycles²/m²) across the ray of the fluence, the light field summed over directions: the
    /// slice of its spectrum at angular frequency zero.
    ///
    /// ```text
    /// S = X − C P⁺ Cᵀ
    /// ```
    ///
    /// Sheet § 2.5 (in place of B Eq. 16). Variances below 10⁻⁶ of those in `X` are rounding, and returned as 0.
    ///
    /// ```
    /// # use fogbow::{covariance::Symmetric4, math::Symmetric2};
    /// // Light that falls from all sides through a slit: in the slit its fluence has the slit's edges, behind it none.
    /// let slit = Symmetric4::separable(Symmetric2::diagonal(4.0, 0.0), Symmetric2::ZERO);
    /// assert_eq!(slit.slice(), Symmetric2::diagonal(4.0, 0.0));
    /// assert_eq!(slit.travelled(3.0).slice(), Symmetric2::ZERO);
    /// ```
    #[inline]
    #[must_use]
    pub fn slice(&self) -> Symmetric2 {
        let a = self.mended();
        let [x, p] = [&a.spatial, &a.angular].map(Wide::new);
        let p = p.not_singular(SLACK, TINY);
        let c = a.mixed.map(f64::from);
        let cq = p.adjoint_after(&c, 1.0 / p.determinant(SLACK));
        let mut s = x.without(&cq, &c);
        if !(s.xx > ROUNDING * a.spatial.xx) {
            (s.xx, s.xy) = (0.0, 0.0);
        }
        if !(s.yy > ROUNDING * a.spatial.yy) {
            (s.yy, s.xy) = (0.0, 0.0);
        }
        s.tidy()
    }

    /// Covariance (cycles²/rad²) over directions of the light field summed over places: `P − Cᵀ X⁺ C`,
    /// what a camera with an aperture sees.
    ///
    /// ```
    /// # use fogbow::{covariance::Symmetric4, math::Symmetric2};
    /// let (place, direction) = (Symmetric2::diagonal(4.0, 0.0), Symmetric2::diagonal(1.0, 2.0));
    /// assert_eq!(Symmetric4::separable(place, direction).angular_slice(), direction);   // nothing they have in common
    /// ```
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
    ///
    /// ```
    /// # use fogbow::{covariance::Symmetric4, math::Symmetric2};
    /// let unit = Symmetric2::diagonal(1.0, 1.0);
    /// let light = Symmetric4::separable(unit, unit);
    /// // Head on into glass directions draw together by n = 1.5, so angular frequencies grow by as much.
    /// let inside = light.refracted(&Symmetric2::ZERO, (1.0, 1.0), (1.0, 1.5));
    /// assert!((inside.angular.xx - 2.25).abs() < 1e-5 && inside.spatial == unit);
    /// let outside = inside.refracted(&Symmetric2::ZERO, (1.0, 1.0), (1.5, 1.0));
    /// assert!((outside.angular.xx - 1.0).abs() < 1e-5);
    /// ```
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

/// What the determinant of a sum has besides those of its parts; not negative for positive semi-definite ones.
#[inline]
fn mixed_determinant(a: &Wide, b: &Wide) -> f64 {
    let cross = b.xx * a.yy + b.yy * a.xx - 2.0 * b.xy * a.xy;
    if cross > 0.0 { cross } else { 0.0 }
}

/// Determinants below this part of their products are zero, but for the rounding of `f64` in what is made with them.
const VANISHING: f64 = 1e-9;

/// What remains of a difference of products below this part of them is the rounding of `f64`.
const WIDE_ROUNDING: f64 = 1e-14;

/// Whether the sum of both has no inverse.
#[inline]
fn is_singular(a: &Wide, b: &Wide) -> bool {
    let whole = a.determinant(0.0) + b.determinant(0.0) + mixed_determinant(a, b);
    !(whole > VANISHING * ((a.xx + b.xx) * (a.yy + b.yy)))
}

/// Whether `[[X, C], [Cᵀ, P]]` is positive semi-definite as its entries are: `P` is, and so is what it leaves of `X`.
#[inline]
fn is_possible(x: &Wide, c: &[f64; 4], p: &Wide) -> bool {
    let det = p.xx * p.yy - p.xy * p.xy;
    let ca = p.adjoint_after(c, 1.0);
    // f P⁻¹, of rank one where P is.
    let (f, inverse) = if det > VANISHING * (p.xx * p.yy) {
        (det, Wide { xx: p.yy, xy: -p.xy, yy: p.xx })
    } else if det == 0.0 && ca == [0.0; 4] && (p.xx + p.yy > 0.0 || *c == [0.0; 4]) {
        ((p.xx + p.yy) * (p.xx + p.yy), *p)
    } else {
        return false;
    };
    let rows = [[c[0], c[1]], [c[2], c[3]]];
    let ci = rows.map(|[u, v]| [u * inverse.xx + v * inverse.xy, u * inverse.xy + v * inverse.yy]);
    let without = |whole: f64, i: usize, j: usize| whole * f - (ci[i][0] * rows[j][0] + ci[i][1] * rows[j][1]);
    let (uu, uv, vv) = (without(x.xx, 0, 0), without(x.xy, 0, 1), without(x.yy, 1, 1));
    let (uu, vv) = (uu + WIDE_ROUNDING * x.xx * f, vv + WIDE_ROUNDING * x.yy * f);
    (uu >= 0.0) & (vv >= 0.0) & (uv * uv <= uu * vv)
}

/// A [`Symmetric2`] in `f64`, which holds products of its entries exactly.
#[derive(Clone, Copy)]
struct Wide {
    xx: f64,
    xy: f64,
    yy: f64,
}

impl Wide {
    #[inline]
    fn new(a: &Symmetric2) -> Self {
        Self { xx: f64::from(a.xx), xy: f64::from(a.xy), yy: f64::from(a.yy) }
    }

    /// With variances larger by a part `slack`, which rounding to `f32` may have taken away, and by `least`.
    #[inline]
    fn not_singular(self, slack: f64, least: f64) -> Self {
        Self { xx: self.xx * (1.0 + slack) + least, xy: self.xy, yy: self.yy * (1.0 + slack) + least }
    }

    /// Not below what [`Wide::not_singular`] leaves of a positive semi-definite matrix.
    #[inline]
    fn determinant(&self, slack: f64) -> f64 {
        let most = self.xx * self.yy;
        let det = most - self.xy * self.xy;
        let least = slack * most;
        if det > least { det } else { least }
    }

    /// `C adj(A) f`, with the 2×2 matrix `C` row by row.
    #[inline]
    fn adjoint_after(&self, c: &[f64; 4], f: f64) -> [f64; 4] {
        let (xx, xy, yy) = (self.xx * f, self.xy * f, self.yy * f);
        [c[0] * yy - c[1] * xy, c[1] * xx - c[0] * xy, c[2] * yy - c[3] * xy, c[3] * xx - c[2] * xy]
    }

    /// `A − D Cᵀ`, for a symmetric positive semi-definite `D Cᵀ`.
    #[inline]
    fn without(&self, d: &[f64; 4], c: &[f64; 4]) -> Symmetric2 {
        let less = |a: f64, b: f64| if b > 0.0 { a - b } else { a };
        Symmetric2 {
            xx: less(self.xx, d[0] * c[0] + d[1] * c[1]) as f32,
            xy: (self.xy - (d[0] * c[2] + d[1] * c[3])) as f32,
            yy: less(self.yy, d[2] * c[2] + d[3] * c[3]) as f32,
        }
    }
}

/// Angular covariance (cycles²/rad²) of a Phong lobe `cosⁿ`: `n/(4π²) I` (sheet § 2.4).
///
/// ```
/// # use fogbow::{covariance::operators::phong_lobe, math::float::PI};
/// assert!((phong_lobe(100.0).xx - 100.0 / (4.0 * PI * PI)).abs() < 1e-5);
/// ```
#[inline]
#[must_use]
pub fn phong_lobe(exponent: f32) -> Symmetric2 {
    let b = float::min(exponent.max(0.0) * PER_HESSIAN, LIMIT);
    Symmetric2::diagonal(b, b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{Generator, uniform};

    /// `g gᵀ`.
    fn wave<const N: usize>(g: [f32; N]) -> impl Fn(usize, usize) -> f32 {
        move |i, j| g[i] * g[j]
    }

    /// Single waves and lobes over one angle each: nothing is left of angles, nor of what goes with them.
    #[test]
    fn a_wave_through_a_lobe_across_it_leaves_nothing() {
        let rng = &mut Generator::new(2);
        // Multiples of an eighth: all products are numbers of `f32`.
        let mut number = || libm::roundf(64.0 * uniform(rng) - 32.0) / 8.0;
        let (mut worst, mut count) = (0.0_f32, 0);
        for _ in 0..4000 {
            let (g, h) = ([(); 4].map(|()| number()), [number(), number()]);
            let turned = g[2] * h[1] - g[3] * h[0];
            let lengths2 = (g[2] * g[2] + g[3] * g[3]) * (h[0] * h[0] + h[1] * h[1]);
            // Lobes along the wave's own angle leave something.
            if turned * turned <= 1e-3 * lengths2 {
                continue;
            }
            let (of, lobe) = (wave(g), wave(h));
            let upper = [(0, 0), (0, 1), (0, 2), (0, 3), (1, 1), (1, 2), (1, 3), (2, 2), (2, 3), (3, 3)];
            let light = Symmetric4::from_upper(upper.map(|(i, j)| of(i, j)));
            let largest = light.to_upper().iter().fold(0.0_f32, |m, x| m.max(x.abs()));
            let out = light.scattered(1.0, &Symmetric2::new(lobe(0, 0), lobe(0, 1), lobe(1, 1)));
            worst = out.to_upper().iter().fold(worst, |m, x| m.max(x.abs() / largest));
            count += 1;
        }
        assert!(count > 3000 && worst < f32::EPSILON, "{worst:e} of {count}");
    }

    /// A lobe over the wave's own angle narrows it as it would in one dimension.
    #[test]
    fn a_wave_through_a_lobe_along_it_keeps_its_share() {
        let of = wave([1.5, -0.25, 3.0, -0.5]);
        let upper = [(0, 0), (0, 1), (0, 2), (0, 3), (1, 1), (1, 2), (1, 3), (2, 2), (2, 3), (3, 3)];
        let light = Symmetric4::from_upper(upper.map(|(i, j)| of(i, j)));
        let lobe = light.angular.times(3.0);
        // 1/(1/a + 1/(3a)) of each variance, and of what goes with it.
        let (out, expected) = (light.scattered(1.0, &lobe), light.times(0.75));
        for (got, wanted) in out.to_upper().into_iter().zip(expected.to_upper()) {
            assert!((got - wanted).abs() < 1e-5, "{out:?} {expected:?}");
        }
    }
}
