//! Basis functions of any degree.
//!
//! `Y_lm = P̄_l|m|(z) · A_m(x, y)` for `m ≥ 0` and `P̄_l|m|(z) · B_|m|(x, y)` for `m < 0`, with
//! `A_m + i B_m = (x + iy)^m` and `P̄` the normalised derivative `dᵐP_l/dzᵐ`. No angle, no division:
//! exact at the poles.

use glam::Vec3;

use super::{MAX_DEGREE, clamp_degree, quadratic};

const SIZE: usize = MAX_DEGREE + 2;

/// Newton's iteration, for tables made at compile time.
const fn sqrt(x: f64) -> f64 {
    let mut root = if x > 1.0 { x } else { 1.0 };
    let mut i = 0;
    while i < 64 {
        root = 0.5 * (root + x / root);
        i += 1;
    }
    root
}

/// Recurrence `P̄_l = a z P̄_{l−1} − b P̄_{l−2}` (at fixed `m`), start `P̄_mm`, and the factor `d`
/// of `dP̄_lm/dz = d P̄_l,m+1`.
struct Tables {
    a: [[f32; SIZE]; SIZE],
    b: [[f32; SIZE]; SIZE],
    d: [[f32; SIZE]; SIZE],
    start: [f32; SIZE],
}

static TABLES: Tables = {
    let mut t = Tables { a: [[0.0; SIZE]; SIZE], b: [[0.0; SIZE]; SIZE], d: [[0.0; SIZE]; SIZE], start: [0.0; SIZE] };
    // P̄_mm² = (2m+1)/(4π) Π_{k≤m} (2k−1)/(2k), twice that for m > 0.
    let mut product = 1.0;
    let mut m = 0;
    while m < SIZE {
        let mf = m as f64;
        if m > 0 {
            product *= (2.0 * mf - 1.0) / (2.0 * mf);
        }
        let twice = if m > 0 { 2.0 } else { 1.0 };
        t.start[m] = sqrt(twice * (2.0 * mf + 1.0) / (4.0 * core::f64::consts::PI) * product) as f32;
        let mut l = m + 1;
        while l < SIZE {
            let lf = l as f64;
            let a = sqrt((4.0 * lf * lf - 1.0) / (lf * lf - mf * mf));
            t.a[m][l] = a as f32;
            let before = lf - 1.0;
            t.b[m][l] = (a * sqrt((before * before - mf * mf) / (4.0 * before * before - 1.0).abs())) as f32;
            l += 1;
        }
        let mut l = m;
        while l < SIZE {
            let lf = l as f64;
            let whole = (lf - mf) * (lf + mf + 1.0);
            // The √2 of m > 0 is missing at m = 0.
            t.d[m][l] = sqrt(if m == 0 { 0.5 * whole } else { whole }) as f32;
            l += 1;
        }
        m += 1;
    }
    t
};

/// `P̄_lm(z)` for `l` from `m` to `degree`, written to `column[l]`.
#[inline]
fn legendre(z: f32, m: usize, degree: usize, column: &mut [f32; SIZE]) {
    let (a, b) = (&TABLES.a[m], &TABLES.b[m]);
    let (mut last, mut current) = (0.0, TABLES.start[m]);
    column[m] = current;
    for l in m + 1..=degree {
        let next = a[l] * z * current - b[l] * last;
        last = current;
        current = next;
        column[l] = current;
    }
}

/// Values of all basis functions up to `degree` at `direction` (unit), in the order `l(l+1) + m`.
///
/// ```text
/// Y_lm = P̄_l|m|(z) · Re or Im (x + iy)^|m|
/// ```
///
/// `values` should hold [`coefficient_count(degree)`](super::coefficient_count) numbers; where it
/// is shorter, or `degree` above [`MAX_DEGREE`], as many whole degrees as fit are written. Exact to
/// a few times `l · 10⁻⁷`. Up to degree 2 constants replace the recurrences. Source: sheet § 1.6.
///
/// ```
/// # use fogbow::{math::Vec3, sh};
/// let mut y = [0.0; 9];
/// sh::evaluate(Vec3::Z, 2, &mut y);
/// let zonal: f32 = y.iter().map(|v| v * v).sum();
/// assert!((zonal - 9.0 / (4.0 * core::f32::consts::PI)).abs() < 1e-6);   // addition theorem
/// ```
pub fn evaluate(direction: Vec3, degree: usize, values: &mut [f32]) {
    let Some(degree) = clamp_degree(degree, values.len()) else { return };
    if degree <= 2 {
        quadratic::evaluate(direction, degree, values);
        return;
    }
    let Vec3 { x, y, z } = direction;
    let mut column = [0.0; SIZE];
    let (mut cos, mut sin) = (1.0, 0.0);
    for m in 0..=degree {
        legendre(z, m, degree, &mut column);
        for (l, p) in column.iter().enumerate().take(degree + 1).skip(m) {
            let centre = l * (l + 1);
            values[centre + m] = p * cos;
            if m > 0 {
                values[centre - m] = p * sin;
            }
        }
        (cos, sin) = (cos * x - sin * y, cos * y + sin * x);
    }
}

/// [`evaluate`] with tangential gradients on the unit sphere: `∇` of `Y(d/|d|)` at `|d| = 1`.
///
/// Divided by `r` it is the gradient with respect to a point that sees a fixed other one in
/// `direction` of propagation, `r` away:
///
/// ```text
/// ∇Y_lm(u(x)) = (1/r) (∇R_lm(u) − l Y_lm(u) u)
/// ```
///
/// with `R_lm` the solid harmonic (sheet § 1.6). Here `∇(P̄ A)` is taken as a polynomial and its
/// radial part removed, which is the same vector.
///
/// ```
/// # use fogbow::{math::Vec3, sh};
/// let (mut y, mut gradients) = ([0.0; 4], [Vec3::ZERO; 4]);
/// sh::evaluate_with_gradients(Vec3::Z, 1, &mut y, &mut gradients);
/// assert!((gradients[3] - Vec3::X * 0.48860251).length() < 1e-6);   // Y₁₁ = √(3/4π) x
/// assert_eq!(gradients[2], Vec3::ZERO);                              // Y₁₀ is at its top
/// ```
pub fn evaluate_with_gradients(direction: Vec3, degree: usize, values: &mut [f32], gradients: &mut [Vec3]) {
    let Some(degree) = clamp_degree(degree, values.len().min(gradients.len())) else { return };
    if degree <= 2 {
        quadratic::evaluate(direction, degree, values);
        quadratic::gradients(direction, degree, gradients);
        return;
    }
    let Vec3 { x, y, z } = direction;
    let tangential = |g: Vec3| g - direction * direction.dot(g);
    let (mut column, mut next) = ([0.0; SIZE], [0.0; SIZE]);
    legendre(z, 0, degree, &mut column);
    let (mut cos, mut sin) = (1.0_f32, 0.0_f32);
    // m (A, B)_{m−1}: the derivatives of (A, B)_m.
    let (mut cos_before, mut sin_before) = (0.0_f32, 0.0_f32);
    for m in 0..=degree {
        if m < degree {
            legendre(z, m + 1, degree, &mut next);
        }
        for l in m..=degree {
            let centre = l * (l + 1);
            let p = column[l];
            let slope = if l > m { TABLES.d[m][l] * next[l] } else { 0.0 };
            values[centre + m] = p * cos;
            gradients[centre + m] = tangential(Vec3::new(p * cos_before, -p * sin_before, slope * cos));
            if m > 0 {
                values[centre - m] = p * sin;
                gradients[centre - m] = tangential(Vec3::new(p * sin_before, p * cos_before, slope * sin));
            }
        }
        let order = (m + 1) as f32;
        (cos_before, sin_before) = (order * cos, order * sin);
        (cos, sin) = (cos * x - sin * y, cos * y + sin * x);
        core::mem::swap(&mut column, &mut next);
    }
}
