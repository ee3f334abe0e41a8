//! Elementary functions from `libm`, always.
//!
//! `core` has no `exp`, and the platform's differ in the last bit: these give the same bits on
//! every target with IEEE floats, whatever features a downstream crate switches on.

/// The circle constant.
pub const PI: f32 = core::f32::consts::PI;
/// `1 / (4π)` (sr⁻¹): the isotropic density over directions.
pub const INV_FOUR_PI: f32 = 0.079_577_471_545_947_67;

/// Largest optical thickness whose transmittance is still a normal `f32`.
///
/// Beyond it `exp(−τ)` would be subnormal: slow on most CPUs and without use to an image.
pub const OPAQUE: f32 = 87.0;

/// `eˣ`.
#[inline]
#[must_use]
pub fn exp(x: f32) -> f32 {
    libm::expf(x)
}

/// Natural logarithm; −∞ at 0.
#[inline]
#[must_use]
pub fn ln(x: f32) -> f32 {
    libm::logf(x)
}

/// `eˣ − 1` without cancellation near 0.
#[inline]
#[must_use]
pub fn exp_m1(x: f32) -> f32 {
    libm::expm1f(x)
}

/// `ln(1 + x)` without cancellation near 0.
#[inline]
#[must_use]
pub fn ln_1p(x: f32) -> f32 {
    libm::log1pf(x)
}

/// Square root.
#[inline]
#[must_use]
pub fn sqrt(x: f32) -> f32 {
    libm::sqrtf(x)
}

/// Square root of `max(x, 0)`: for arguments that rounding may push below zero.
#[inline]
#[must_use]
pub fn safe_sqrt(x: f32) -> f32 {
    sqrt(x.max(0.0))
}

/// `xʸ`.
#[inline]
#[must_use]
pub fn powf(x: f32, y: f32) -> f32 {
    libm::powf(x, y)
}

/// Sine and cosine of an angle (rad).
#[inline]
#[must_use]
pub fn sin_cos(x: f32) -> (f32, f32) {
    libm::sincosf(x)
}

/// Tangent of an angle (rad).
#[inline]
#[must_use]
pub fn tan(x: f32) -> f32 {
    libm::tanf(x)
}

/// Arc cosine (rad); the argument is clamped to [−1, 1].
#[inline]
#[must_use]
pub fn acos(x: f32) -> f32 {
    libm::acosf(x.clamp(-1.0, 1.0))
}

/// Arc sine (rad); the argument is clamped to [−1, 1].
#[inline]
#[must_use]
pub fn asin(x: f32) -> f32 {
    libm::asinf(x.clamp(-1.0, 1.0))
}

/// Arc tangent (rad).
#[inline]
#[must_use]
pub fn atan(x: f32) -> f32 {
    libm::atanf(x)
}

/// Angle (rad) of the point `(x, y)`, in (−π, π].
#[inline]
#[must_use]
pub fn atan2(y: f32, x: f32) -> f32 {
    libm::atan2f(y, x)
}

/// Inverse hyperbolic tangent.
#[inline]
#[must_use]
pub fn atanh(x: f32) -> f32 {
    libm::atanhf(x)
}

/// `√(x² + y²)` without overflow of the squares.
#[inline]
#[must_use]
pub fn hypot(x: f32, y: f32) -> f32 {
    libm::hypotf(x, y)
}

/// Cube root.
#[inline]
#[must_use]
pub fn cbrt(x: f32) -> f32 {
    libm::cbrtf(x)
}

/// The smaller of two numbers; `b` if either is NaN. One instruction, where `f32::min` with its
/// care for NaN is three.
#[inline]
#[must_use]
pub fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The larger of two numbers; `b` if either is NaN.
#[inline]
#[must_use]
pub fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Largest integer not above `x`.
#[inline]
#[must_use]
pub fn floor(x: f32) -> f32 {
    libm::floorf(x)
}

/// Largest integer not above `x` as an `i32`, saturating; 0 for NaN.
///
/// Several times faster than [`floor`] on targets without a rounding instruction.
#[inline]
#[must_use]
pub fn floor_i32(x: f32) -> i32 {
    let truncated = x as i32;
    // `x as i32` rounds towards zero: one too high for negative fractions.
    truncated.saturating_sub(i32::from(x < truncated as f32))
}

/// `a·b − c·d` with one rounding of each product (in `f64`), for determinants that cancel.
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
