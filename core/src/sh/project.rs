//! Projection by quadrature: Gauss–Legendre in z, equal steps in azimuth.

use glam::Vec3;

use super::{MAX_COEFFICIENTS, coefficient_count, degree_of, evaluate};
use crate::spectrum::Spectrum;

/// Writes the coefficients of `f`, a function of direction, to `out`, whose length sets the degree.
///
/// `nodes` rings of `2 · nodes` directions: exact for functions of degree `2·nodes − 1 − degree` or
/// less, otherwise as good as `f` is smooth. Accumulated in `f64`.
///
/// ```
/// # use fogbow::{math::Vec3, sh, spectrum::Spectrum};
/// let mut coefficients = [Spectrum::ZERO; 9];
/// sh::project(8, |direction| Spectrum::splat(direction.x), &mut coefficients);
/// assert!((coefficients[3][0] - (4.0 * 3.14159265_f32 / 3.0).sqrt()).abs() < 1e-6);
/// assert!(coefficients[6][0].abs() < 1e-6);
/// ```
pub fn project(nodes: usize, mut f: impl FnMut(Vec3) -> Spectrum, out: &mut [Spectrum]) {
    let Some(degree) = degree_of(out.len()) else { return };
    let count = coefficient_count(degree);
    let mut basis = [0.0; MAX_COEFFICIENTS];
    let mut sums = [[0.0_f64; 3]; MAX_COEFFICIENTS];
    let rings = nodes.max(1);
    for i in 0..rings {
        let (z, weight) = gauss_legendre(rings, i);
        let sine = libm::sqrt((1.0 - z) * (1.0 + z));
        for j in 0..2 * rings {
            let azimuth = core::f64::consts::PI * (j as f64 + 0.5) / rings as f64;
            let direction = Vec3::new((sine * libm::cos(azimuth)) as f32, (sine * libm::sin(azimuth)) as f32, z as f32);
            let value = f(direction);
            evaluate(direction, degree, &mut basis[..count]);
            for (sum, &y) in sums.iter_mut().zip(&basis[..count]) {
                for channel in 0..3 {
                    sum[channel] += weight * f64::from(value[channel]) * f64::from(y);
                }
            }
        }
    }
    let scale = core::f64::consts::PI / rings as f64;
    for (slot, sum) in out.iter_mut().zip(&sums[..count]) {
        *slot = Spectrum(sum.map(|s| (s * scale) as f32));
    }
}

/// Node and weight `i` of the `n`-point rule on [−1, 1].
fn gauss_legendre(n: usize, i: usize) -> (f64, f64) {
    let mut z = libm::cos(core::f64::consts::PI * (i as f64 + 0.75) / (n as f64 + 0.5));
    let mut derivative = 1.0;
    for _ in 0..8 {
        let (mut before, mut current) = (1.0, z);
        for k in 2..=n {
            let k = k as f64;
            (before, current) = (current, ((2.0 * k - 1.0) * z * current - (k - 1.0) * before) / k);
        }
        derivative = n as f64 * (z * current - before) / (z * z - 1.0);
        z -= current / derivative;
    }
    (z, 2.0 / ((1.0 - z) * (1.0 + z) * derivative * derivative))
}
