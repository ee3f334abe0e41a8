//! Rough interfaces as a multitude of small flat ones: distributions of their normals, how they hide each other, and the
//! normals that a direction sees (Walter et al. 2007; Heitz 2014; Dupuy and Benyoub 2023).
//!
//! Directions are in the frame of the surface: `z` along its normal, `x` along the tangent of [`Roughness::alpha`]'s first
//! number.

use glam::{Vec2, Vec3};

use crate::math::{Frame, float, float::PI};
use crate::sampling::warp::spherical;

/// Cosines below this count as grazing: nothing is seen, or comes, from there.
pub(super) const GRAZING: f32 = 1e-6;

/// The smallest roughness; less is taken for this. Smaller: normals are no longer told apart in single precision.
const LEAST_ALPHA: f32 = 1e-4;

/// `1/√π`.
const INV_SQRT_PI: f32 = 0.564_189_6;

/// How the normals of small facets are spread.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Distribution {
    /// Slopes of a Gaussian random surface (Beckmann and Spizzichino 1963).
    #[default]
    Beckmann,
    /// Long tails (Trowbridge and Reitz 1975; Walter et al. 2007), known as GGX.
    Ggx,
}

/// The roughness of an interface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Roughness {
    /// How normals are spread.
    pub distribution: Distribution,
    /// How far, along the tangent and across: `√2` times the root mean square slope with
    /// [`Distribution::Beckmann`]. In (0, 1] for what is usual; below 10⁻⁴ as 10⁻⁴.
    pub alpha: [f32; 2],
    /// Where the first number is meant, in the world; of any length, and only what lies across the normal counts. Zero:
    /// anywhere, for surfaces that are as rough along as across.
    pub tangent: Vec3,
}

impl Roughness {
    /// As rough along as across.
    ///
    /// ```
    /// # use fogbow::{math::Vec3, surface::{Distribution, Roughness}};
    /// let brushed = Roughness { alpha: [0.1, 0.4], tangent: Vec3::X, ..Roughness::even(Distribution::Ggx, 0.2) };
    /// assert_eq!((brushed.least(), Roughness::even(Distribution::Ggx, 0.0).least()), (0.1, 1e-4));
    /// ```
    #[inline]
    #[must_use]
    pub const fn even(distribution: Distribution, alpha: f32) -> Self {
        Self { distribution, alpha: [alpha; 2], tangent: Vec3::ZERO }
    }

    /// The smaller of both numbers, at least 10⁻⁴.
    ///
    /// ```
    /// # use fogbow::surface::{Distribution, Roughness};
    /// assert_eq!(Roughness::even(Distribution::Beckmann, 0.3).least(), 0.3);
    /// ```
    #[inline]
    #[must_use]
    pub fn least(&self) -> f32 {
        let [x, y] = self.clamped();
        float::min(x, y)
    }

    #[inline]
    fn clamped(&self) -> [f32; 2] {
        [float::max(self.alpha[0], LEAST_ALPHA), float::max(self.alpha[1], LEAST_ALPHA)]
    }

    /// The exponent of a Phong lobe as wide as what facets mirror: a root mean square slope of `α/√2` turns light by twice
    /// that.
    #[inline]
    pub(super) fn exponent(&self) -> f32 {
        let [x, y] = self.clamped();
        0.5 / (x * y)
    }

    /// The frame that directions are meant in.
    ///
    /// ```
    /// # use fogbow::{math::Vec3, surface::{Distribution, Roughness}};
    /// let brushed = Roughness { distribution: Distribution::Ggx, alpha: [0.1, 0.4], tangent: Vec3::new(0.0, 2.0, 7.0) };
    /// assert_eq!(brushed.frame(Vec3::Z).u, Vec3::Y);
    /// ```
    #[inline]
    #[must_use]
    pub fn frame(&self, normal: Vec3) -> Frame {
        Frame::along(normal, self.tangent)
    }

    /// Area of facets with normals around `m`, per steradian and area of the surface: `∫ D cos dm = 1`.
    ///
    /// ```
    /// # use fogbow::{math::{Vec3, float::PI, quadrature::integrate}, surface::{Distribution, Roughness}};
    /// for distribution in [Distribution::Beckmann, Distribution::Ggx] {
    ///     let rough = Roughness::even(distribution, 0.6);
    ///     let ring = |cos: f32| cos * rough.density(Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos));
    ///     let area: f32 = (0..8).map(|i| integrate(i as f32 / 8.0, (i + 1) as f32 / 8.0, ring)).sum();
    ///     assert!((2.0 * PI * area - 1.0).abs() < 1e-4);
    /// }
    /// ```
    #[inline]
    #[must_use]
    pub fn density(&self, m: Vec3) -> f32 {
        let [ax, ay] = self.clamped();
        let (x, y, cos2) = (m.x / ax, m.y / ay, m.z * m.z);
        let slopes = x * x + y * y;
        let density = match self.distribution {
            Distribution::Beckmann => float::exp(-slopes / cos2) / (PI * ax * ay * cos2 * cos2),
            Distribution::Ggx => {
                let sum = slopes + cos2;
                1.0 / (PI * ax * ay * sum * sum)
            }
        };
        // Also where a number has overflown.
        if density * m.z > 1e-20 && density < f32::INFINITY { density } else { 0.0 }
    }

    /// `tan² θ` of `v`, scaled by roughness.
    #[inline]
    fn stretched_tangent2(&self, v: Vec3) -> f32 {
        let [ax, ay] = self.clamped();
        let (x, y) = (ax * v.x, ay * v.y);
        (x * x + y * y) / (v.z * v.z)
    }

    /// Share of the facets with normal `m` that `v` sees: Smith's masking. That of [`Distribution::Beckmann`] is the rational
    /// fit of Walter et al. 2007, within 0.35 % of the integral.
    ///
    /// ```
    /// # use fogbow::{math::Vec3, surface::{Distribution, Roughness}};
    /// let rough = Roughness::even(Distribution::Ggx, 0.5);
    /// assert_eq!(rough.masking(Vec3::Z, Vec3::Z), 1.0);   // from above nothing is hidden
    /// assert!(rough.masking(Vec3::new(0.8, 0.0, 0.6), Vec3::Z) < 1.0);
    /// assert_eq!(rough.masking(Vec3::new(0.8, 0.0, 0.6), Vec3::NEG_X), 0.0);   // seen from behind
    /// ```
    #[inline]
    #[must_use]
    pub fn masking(&self, v: Vec3, m: Vec3) -> f32 {
        if v.dot(m) * v.z <= 0.0 {
            return 0.0;
        }
        let tangent2 = self.stretched_tangent2(v);
        match self.distribution {
            _ if tangent2 == 0.0 => 1.0,
            Distribution::Beckmann => {
                let a = 1.0 / float::sqrt(tangent2);
                if a >= 1.6 { 1.0 } else { a * (3.535 + 2.181 * a) / (1.0 + a * (2.276 + 2.577 * a)) }
            }
            Distribution::Ggx => ggx_masking(tangent2),
        }
    }

    /// The share of facets that `v` sees, exactly: so that what is seen makes up what there is,
    /// `∫ D · masking · max(v·m, 0) dm = cos θ_v`.
    #[inline]
    fn exact_masking(&self, v: Vec3) -> f32 {
        let tangent2 = self.stretched_tangent2(v);
        match self.distribution {
            _ if tangent2 == 0.0 => 1.0,
            Distribution::Beckmann => {
                let a = 1.0 / float::sqrt(tangent2);
                2.0 / (1.0 + float::erf(a) + float::exp(-a * a) * INV_SQRT_PI / a)
            }
            Distribution::Ggx => ggx_masking(tangent2),
        }
    }

    /// By how much [`Roughness::masking`] of a direction above the surface differs from the integral, as a factor: 1 but for
    /// the fit of [`Distribution::Beckmann`].
    ///
    /// ```
    /// # use fogbow::{math::Vec3, surface::{Distribution, Roughness}};
    /// let v = Vec3::new(0.6, 0.0, 0.8);
    /// assert_eq!(Roughness::even(Distribution::Ggx, 0.9).misfit(v), 1.0);
    /// assert!((Roughness::even(Distribution::Beckmann, 0.9).misfit(v) - 1.0).abs() < 3.5e-3);
    /// ```
    #[inline]
    #[must_use]
    pub fn misfit(&self, v: Vec3) -> f32 {
        match self.distribution {
            Distribution::Beckmann => self.masking(v, Vec3::Z) / self.exact_masking(v),
            Distribution::Ggx => 1.0,
        }
    }

    /// Density (sr⁻¹) of [`Roughness::sample`]: normals as `v`, above the surface, sees them.
    ///
    /// ```
    /// # use fogbow::{math::{Vec3, float::PI}, surface::{Distribution, Roughness}};
    /// let rough = Roughness::even(Distribution::Ggx, 0.5);
    /// assert!((rough.pdf(Vec3::Z, Vec3::Z) - 4.0 / PI).abs() < 1e-5);   // from above in proportion to D cos
    /// ```
    #[inline]
    #[must_use]
    pub fn pdf(&self, v: Vec3, m: Vec3) -> f32 {
        let seen = v.dot(m);
        if seen <= 0.0 || v.z < GRAZING { 0.0 } else { self.density(m) * self.exact_masking(v) * seen / v.z }
    }

    /// Draws a normal as `v`, above the surface, sees them.
    ///
    /// ```
    /// # use fogbow::{math::{Vec2, Vec3}, surface::{Distribution, Roughness}};
    /// let (smooth, v) = (Roughness::even(Distribution::Beckmann, 1e-3), Vec3::new(0.6, 0.0, 0.8));
    /// let m = smooth.sample(v, Vec2::new(0.3, 0.8));
    /// assert!((m - Vec3::Z).length() < 1e-2 && (m.length() - 1.0).abs() < 1e-6);
    /// ```
    #[inline]
    #[must_use]
    pub fn sample(&self, v: Vec3, u: Vec2) -> Vec3 {
        let [ax, ay] = self.clamped();
        let stretched = Vec3::new(ax * v.x, ay * v.y, v.z).normalize_or(Vec3::Z);
        match self.distribution {
            Distribution::Ggx => {
                // Half vectors between the direction and the spherical cap that it sees.
                let z = (1.0 - u.y) * (1.0 + stretched.z) - stretched.z;
                let half = spherical(z, float::safe_sqrt(1.0 - z * z), u.x) + stretched;
                Vec3::new(ax * half.x, ay * half.y, half.z).normalize_or(Vec3::Z)
            }
            Distribution::Beckmann => {
                let slope = visible_slope(stretched.z, u);
                let across = float::hypot(stretched.x, stretched.y);
                let (sin, cos) = if across > 0.0 { (stretched.y / across, stretched.x / across) } else { (0.0, 1.0) };
                let (x, y) = (cos * slope.x - sin * slope.y, sin * slope.x + cos * slope.y);
                Vec3::new(-ax * x, -ay * y, 1.0).normalize()
            }
        }
    }
}

#[inline]
fn ggx_masking(tangent2: f32) -> f32 {
    2.0 / (1.0 + float::sqrt(1.0 + tangent2))
}

/// Slopes of a surface of roughness 1 as a direction sees them whose polar angle has the cosine `cos`, in the plane of the
/// direction and across: Heitz and d'Eon 2014, inverted in three steps of Newton's method over `erf` of the slope, from what
/// is exact at grazing angles (Jakob 2014, "An improved visible normal sampling routine for the Beckmann distribution").
fn visible_slope(cos: f32, u: Vec2) -> Vec2 {
    const INSIDE: f32 = 1.0 - 1e-6;
    let tan = float::safe_sqrt((1.0 - cos) * (1.0 + cos)) / cos.max(GRAZING);
    let cot = 1.0 / tan;
    let u = u.clamp(Vec2::splat(1e-6), Vec2::splat(INSIDE));
    let most = float::erf(cot);
    let mut x = most - (most + 1.0) * float::erf(float::sqrt(-float::ln(u.x)));
    let wanted = u.x * (1.0 + most + INV_SQRT_PI * tan * float::exp(-cot * cot));
    for _ in 0..3 {
        let slope = float::erf_inv(x);
        let value = 1.0 + x + INV_SQRT_PI * tan * float::exp(-slope * slope) - wanted;
        x = (x - value / (1.0 - slope * tan)).clamp(-INSIDE, INSIDE);
    }
    Vec2::new(float::erf_inv(x), float::erf_inv(2.0 * u.y - 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_seen_makes_up_what_there_is() {
        // ∫ pdf dm = 1, by a fine grid over projected normals.
        for distribution in [Distribution::Beckmann, Distribution::Ggx] {
            for cos in [0.95_f32, 0.5, 0.1] {
                let rough = Roughness { distribution, alpha: [0.5, 0.3], tangent: Vec3::ZERO };
                let v = Vec3::new(0.8 * (1.0 - cos * cos).sqrt(), 0.6 * (1.0 - cos * cos).sqrt(), cos);
                let (rings, sectors) = (2000, 200);
                let mut sum = 0.0_f64;
                for i in 0..rings {
                    let z = (i as f32 + 0.5) / rings as f32;
                    for j in 0..sectors {
                        let m = spherical(z, (1.0 - z * z).sqrt(), (j as f32 + 0.5) / sectors as f32);
                        sum += f64::from(rough.pdf(v, m));
                    }
                }
                let total = sum * core::f64::consts::TAU / f64::from(rings * sectors);
                assert!((total - 1.0).abs() < 2e-3, "{distribution:?} at {cos}: {total}");
            }
        }
    }

    #[test]
    fn nothing_is_nan_at_the_ends() {
        for distribution in [Distribution::Beckmann, Distribution::Ggx] {
            for alpha in [0.0, 1e-4, 0.1, 1.0, 10.0] {
                let rough = Roughness::even(distribution, alpha);
                for v in [Vec3::Z, Vec3::new(1.0, 0.0, 1e-6), Vec3::new(1.0, 0.0, 1e-20), Vec3::new(0.0, 0.6, 0.8)] {
                    for u in [[0.0, 0.0], [0.0, 0.5], [0.999_999_94, 0.999_999_94], [0.3, 0.0]] {
                        let m = rough.sample(v, u.into());
                        assert!(m.is_finite() && (m.length() - 1.0).abs() < 1e-5, "{rough:?} {v} {u:?}: {m}");
                        assert!(rough.pdf(v, m).is_finite() && rough.masking(v, m).is_finite(), "{rough:?} {v} {u:?}");
                    }
                }
            }
        }
    }
}
