//! Gauss–Legendre quadrature.

use super::float::{self, PI};

/// Nodes and weights of the 8-point rule on [0, 1]; exact for polynomials up to degree 15.
pub const GAUSS_8: [(f32, f32); 8] = [
    (0.019_855_071_751_231_88, 0.050_614_268_145_188_13),
    (0.101_666_761_293_186_63, 0.111_190_517_226_687_24),
    (0.237_233_795_041_835_5, 0.156_853_322_938_943_64),
    (0.408_282_678_752_175_1, 0.181_341_891_689_181),
    (0.591_717_321_247_824_9, 0.181_341_891_689_181),
    (0.762_766_204_958_164_5, 0.156_853_322_938_943_64),
    (0.898_333_238_706_813_4, 0.111_190_517_226_687_24),
    (0.980_144_928_248_768_1, 0.050_614_268_145_188_13),
];

/// `∫ f` over `[from, to]` by the 8-point Gauss–Legendre rule.
///
/// ```
/// # use fogbow::math::quadrature::integrate;
/// let integral = integrate(0.0, 2.0, |x| x.powi(7));
/// assert!((integral - 32.0).abs() < 1e-4);
/// ```
pub fn integrate(from: f32, to: f32, f: impl Fn(f32) -> f32) -> f32 {
    let length = to - from;
    GAUSS_8.iter().map(|&(x, w)| w * f(from + x * length)).sum::<f32>() * length
}

/// Nodes and weights of the rule of `N` points on [0, 1], ascending; exact for polynomials up to degree `2N − 1`. Takes `N²` steps; where
/// eight points will do, [`GAUSS_8`] has them.
///
/// ```
/// # use fogbow::math::quadrature::{GAUSS_8, gauss};
/// let off = gauss::<8>().into_iter().zip(GAUSS_8).map(|((x, w), (y, v))| (x - y).abs().max((w - v).abs()));
/// assert!(off.fold(0.0, f32::max) < 1e-7);
/// ```
#[must_use]
pub fn gauss<const N: usize>() -> [(f32, f32); N] {
    core::array::from_fn(|i| {
        let (_, guess) = float::sin_cos(PI * (i as f32 + 0.75) / (N as f32 + 0.5));
        // Newton's method on Legendre's polynomial. With it comes its slope.
        let (mut x, mut slope) = (f64::from(guess), 1.0);
        for _ in 0..4 {
            let (mut before, mut value) = (1.0, x);
            for n in 1..N {
                let n = n as f64;
                (before, value) = (value, ((2.0 * n + 1.0) * x * value - n * before) / (n + 1.0));
            }
            slope = N as f64 * (before - x * value) / (1.0 - x * x);
            x -= value / slope;
        }
        ((0.5 * (1.0 - x)) as f32, (1.0 / ((1.0 - x * x) * slope * slope)) as f32)
    })
}
