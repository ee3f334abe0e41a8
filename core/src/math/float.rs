//! Elementary functions from `libm`, always.
//!
//! `core` has no `exp`, and the platform's differ in the last bit: these give the same bits on
//! every target with IEEE floats, whatever features a downstream crate switches on.

// Alone in having the lesser and the greater number without a branch.
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
use core::arch::wasm32;

/// The circle constant.
pub const PI: f32 = core::f32::consts::PI;
/// `1 / (4π)` (sr⁻¹): the isotropic density over directions.
pub const INV_FOUR_PI: f32 = 0.079_577_471_545_947_67;

/// Largest optical thickness whose transmittance is still a normal `f32`.
///
/// Beyond it `exp(−τ)` would be subnormal: slow on most CPUs and without use to an image.
pub const OPAQUE: f32 = 87.0;

/// `eˣ`.
///
/// ```
/// # use fogbow::math::float::exp;
/// assert_eq!(exp(0.0), 1.0);
/// assert!((exp(1.5) * exp(-2.5) - exp(-1.0)).abs() < 1e-7);   // e^a e^b = e^{a + b}
/// ```
#[inline]
#[must_use]
pub fn exp(x: f32) -> f32 {
    libm::expf(x)
}

/// Natural logarithm; −∞ at 0.
///
/// ```
/// # use fogbow::math::float::ln;
/// assert!((ln(2.0) + ln(3.0) - ln(6.0)).abs() < 1e-6);
/// assert_eq!(ln(0.0), f32::NEG_INFINITY);
/// ```
#[inline]
#[must_use]
pub fn ln(x: f32) -> f32 {
    libm::logf(x)
}

/// `eˣ − 1` without cancellation near 0.
///
/// ```
/// # use fogbow::math::float::{exp, exp_m1};
/// assert_eq!(exp_m1(1e-8), 1e-8);
/// assert_eq!(exp(1e-8) - 1.0, 0.0);   // all digits cancelled
/// ```
#[inline]
#[must_use]
pub fn exp_m1(x: f32) -> f32 {
    libm::expm1f(x)
}

/// `ln(1 + x)` without cancellation near 0.
///
/// ```
/// # use fogbow::math::float::{ln, ln_1p};
/// assert_eq!(ln_1p(1e-8), 1e-8);
/// assert_eq!(ln(1.0 + 1e-8), 0.0);   // all digits cancelled
/// ```
#[inline]
#[must_use]
pub fn ln_1p(x: f32) -> f32 {
    libm::log1pf(x)
}

/// Square root.
///
/// NaN below 0.
///
/// ```
/// # use fogbow::math::float::sqrt;
/// assert_eq!(sqrt(2.25), 1.5);
/// assert!(sqrt(-1.0).is_nan());
/// ```
#[inline]
#[must_use]
pub fn sqrt(x: f32) -> f32 {
    libm::sqrtf(x)
}

/// Square root of `max(x, 0)`: for arguments that rounding may push below zero.
///
/// ```
/// # use fogbow::math::float::safe_sqrt;
/// let cosine = 1.000_000_1_f32;   // of a direction that is a unit vector but for rounding
/// assert_eq!(safe_sqrt(1.0 - cosine * cosine), 0.0);
/// ```
#[inline]
#[must_use]
pub fn safe_sqrt(x: f32) -> f32 {
    sqrt(x.max(0.0))
}

/// `xʸ`.
///
/// NaN where `x` is negative and `y` no whole number.
///
/// ```
/// # use fogbow::math::float::powf;
/// assert!((powf(2.0, 10.0) - 1024.0).abs() < 1e-3);
/// assert!((powf(0.25, 0.5) - 0.5).abs() < 1e-7);   // a square root
/// ```
#[inline]
#[must_use]
pub fn powf(x: f32, y: f32) -> f32 {
    libm::powf(x, y)
}

/// Sine and cosine of an angle (rad).
///
/// ```
/// # use fogbow::math::float::{PI, sin_cos};
/// let (sine, cosine) = sin_cos(PI / 3.0);
/// assert!((cosine - 0.5).abs() < 1e-6 && (sine * sine + cosine * cosine - 1.0).abs() < 1e-6);
/// ```
#[inline]
#[must_use]
pub fn sin_cos(x: f32) -> (f32, f32) {
    libm::sincosf(x)
}

/// Tangent of an angle (rad).
///
/// ```
/// # use fogbow::math::float::{PI, tan};
/// assert!((tan(PI / 4.0) - 1.0).abs() < 1e-6);
/// ```
#[inline]
#[must_use]
pub fn tan(x: f32) -> f32 {
    libm::tanf(x)
}

/// Arc cosine (rad); the argument is clamped to [−1, 1].
///
/// ```
/// # use fogbow::math::float::{PI, acos};
/// assert!((acos(0.5) - PI / 3.0).abs() < 1e-6);
/// assert_eq!(acos(1.000_001), 0.0);   // beyond 1 by rounding
/// ```
#[inline]
#[must_use]
pub fn acos(x: f32) -> f32 {
    libm::acosf(x.clamp(-1.0, 1.0))
}

/// Arc sine (rad); the argument is clamped to [−1, 1].
///
/// ```
/// # use fogbow::math::float::{PI, asin};
/// assert!((asin(0.5) - PI / 6.0).abs() < 1e-6);
/// assert!((asin(-1.000_001) + PI / 2.0).abs() < 1e-6);   // beyond −1 by rounding
/// ```
#[inline]
#[must_use]
pub fn asin(x: f32) -> f32 {
    libm::asinf(x.clamp(-1.0, 1.0))
}

/// Arc tangent (rad).
///
/// ```
/// # use fogbow::math::float::{PI, atan};
/// assert!((atan(1.0) - PI / 4.0).abs() < 1e-6);
/// assert!((atan(f32::INFINITY) - PI / 2.0).abs() < 1e-6);
/// ```
#[inline]
#[must_use]
pub fn atan(x: f32) -> f32 {
    libm::atanf(x)
}

/// Angle (rad) of the point `(x, y)`, in (−π, π].
///
/// ```
/// # use fogbow::math::float::{PI, atan2};
/// assert!((atan2(2.0, -2.0) - 0.75 * PI).abs() < 1e-6);   // y first; the quadrant is kept
/// assert_eq!(atan2(0.0, -1.0), PI);
/// ```
#[inline]
#[must_use]
pub fn atan2(y: f32, x: f32) -> f32 {
    libm::atan2f(y, x)
}

/// Inverse hyperbolic tangent.
///
/// Infinite at ±1, NaN beyond.
///
/// ```
/// # use fogbow::math::float::{atanh, ln};
/// assert!((atanh(0.5) - 0.5 * ln(3.0)).abs() < 1e-6);   // ½ ln((1 + x)/(1 − x))
/// ```
#[inline]
#[must_use]
pub fn atanh(x: f32) -> f32 {
    libm::atanhf(x)
}

/// `√(x² + y²)` without overflow of the squares.
///
/// ```
/// # use fogbow::math::float::hypot;
/// assert!((hypot(3e30, 4e30) / 5e30 - 1.0).abs() < 1e-6);
/// assert_eq!(3e30_f32 * 3e30, f32::INFINITY);
/// ```
#[inline]
#[must_use]
pub fn hypot(x: f32, y: f32) -> f32 {
    libm::hypotf(x, y)
}

/// Cube root.
///
/// Of negative numbers, too.
///
/// ```
/// # use fogbow::math::float::cbrt;
/// assert!((cbrt(-27.0) + 3.0).abs() < 1e-6);
/// ```
#[inline]
#[must_use]
pub fn cbrt(x: f32) -> f32 {
    libm::cbrtf(x)
}

/// Error function `2/√π ∫₀ˣ e^{−t²} dt`.
///
/// ```
/// # use fogbow::math::float::erf;
/// assert!((erf(0.5) - 0.520_499_9).abs() < 1e-6 && erf(-0.5) == -erf(0.5));
/// assert_eq!(erf(f32::INFINITY), 1.0);
/// ```
#[inline]
#[must_use]
pub fn erf(x: f32) -> f32 {
    libm::erff(x)
}

/// Inverse of [`erf`] within (−1, 1): Giles 2010, "Approximating the erfinv function". Infinite at the ends, NaN beyond.
///
/// ```
/// # use fogbow::math::float::{erf, erf_inv};
/// for x in [-2.5, -0.3, 0.0, 1e-3, 1.0, 3.0] {
///     assert!((erf_inv(erf(x)) - x).abs() < 1e-3 * (1.0 + x * x), "{x}");
/// }
/// ```
#[inline]
#[must_use]
pub fn erf_inv(x: f32) -> f32 {
    const CENTRE: [f32; 9] = [
        2.810_226_4e-8,
        3.432_739_4e-7,
        -3.523_387_7e-6,
        -4.391_506_5e-6,
        2.185_808_7e-4,
        -1.253_725_03e-3,
        -4.177_681_64e-3,
        0.246_640_73,
        1.501_409_4,
    ];
    const TAIL: [f32; 9] = [
        -2.002_142_6e-4,
        1.009_505_6e-4,
        1.349_343_2e-3,
        -3.673_428_4e-3,
        5.739_507_7e-3,
        -7.622_461_3e-3,
        9.438_870_5e-3,
        1.001_674_06,
        2.832_976_8,
    ];
    let w = -ln((1.0 - x) * (1.0 + x));
    let polynomial = |coefficients: [f32; 9], w: f32| coefficients.into_iter().fold(0.0, |sum, c| sum * w + c);
    if w < 5.0 {
        polynomial(CENTRE, w - 2.5) * x
    } else if w < f32::INFINITY {
        polynomial(TAIL, sqrt(w) - 3.0) * x
    } else {
        x * f32::INFINITY
    }
}

/// The smaller of two numbers; `b` if either is NaN. One instruction, where `f32::min` with its
/// care for NaN is three: in WebAssembly, three branches.
///
/// ```
/// # use fogbow::math::float::min;
/// assert_eq!((min(1.0, 2.0), min(f32::NAN, 2.0)), (1.0, 2.0));
/// assert!(min(2.0, f32::NAN).is_nan());
/// ```
#[inline(always)]
#[must_use]
pub fn min(a: f32, b: f32) -> f32 {
    #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
    return wasm32::f32x4_extract_lane::<0>(wasm32::f32x4_pmin(wasm32::f32x4_splat(b), wasm32::f32x4_splat(a)));
    #[cfg(not(all(target_arch = "wasm32", target_feature = "simd128")))]
    if a < b { a } else { b }
}

/// The larger of two numbers; `b` if either is NaN.
///
/// ```
/// # use fogbow::math::float::max;
/// assert_eq!((max(1.0, 2.0), max(f32::NAN, 0.0)), (2.0, 0.0));   // so `max(x, 0)` is always a number
/// assert!(max(2.0, f32::NAN).is_nan());
/// ```
#[inline(always)]
#[must_use]
pub fn max(a: f32, b: f32) -> f32 {
    #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
    return wasm32::f32x4_extract_lane::<0>(wasm32::f32x4_pmax(wasm32::f32x4_splat(b), wasm32::f32x4_splat(a)));
    #[cfg(not(all(target_arch = "wasm32", target_feature = "simd128")))]
    if a > b { a } else { b }
}

/// Largest integer not above `x`.
///
/// ```
/// # use fogbow::math::float::floor;
/// assert_eq!((floor(1.5), floor(-1.5)), (1.0, -2.0));
/// ```
#[inline]
#[must_use]
pub fn floor(x: f32) -> f32 {
    libm::floorf(x)
}

/// Largest integer not above `x` as an `i32`, saturating; 0 for NaN.
///
/// Several times faster than [`floor`] on targets without a rounding instruction.
///
/// ```
/// # use fogbow::math::float::floor_i32;
/// assert_eq!((floor_i32(1.5), floor_i32(-1.5)), (1, -2));
/// assert_eq!((floor_i32(1e20), floor_i32(f32::NAN)), (i32::MAX, 0));
/// ```
#[inline]
#[must_use]
pub fn floor_i32(x: f32) -> i32 {
    let truncated = x as i32;
    // `x as i32` rounds towards zero: one too high for negative fractions.
    truncated.saturating_sub(i32::from(x < truncated as f32))
}

/// `a·b − c·d` with one rounding of each product (in `f64`), for determinants that cancel.
///
/// ```
/// # use fogbow::math::float::difference_of_products;
/// let (a, b, c, d) = (4097.0_f32, 4097.0, 4096.0, 4098.0);
/// assert_eq!(difference_of_products(a, b, c, d), 1.0);
/// assert_eq!(a * b - c * d, 0.0);   // 4097² has one digit too many
/// ```
#[inline]
#[must_use]
pub fn difference_of_products(a: f32, b: f32, c: f32, d: f32) -> f32 {
    (f64::from(a) * f64::from(b) - f64::from(c) * f64::from(d)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floor_i32_agrees_with_floor_on_both_sides_of_zero() {
        for i in -4000..4000 {
            let x = i as f32 * 0.125;
            assert_eq!(floor_i32(x) as f32, floor(x), "x = {x}");
        }
        assert_eq!(floor_i32(f32::NAN), 0);
        assert_eq!(floor_i32(f32::INFINITY), i32::MAX);
        assert_eq!(floor_i32(f32::NEG_INFINITY), i32::MIN);
    }
}
