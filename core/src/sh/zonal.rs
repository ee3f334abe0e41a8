//! Functions of an angle alone: phase functions, seen from one direction.

use glam::Vec3;

use super::{MAX_COEFFICIENTS, evaluate, evaluate_with_gradients};
use crate::spectrum::{Gradient, Spectrum};

/// Coefficients of `p(axis · ω)` as a function of `ω`, given its Legendre moments `f_0 … f_L`.
///
/// ```text
/// f_l = 2π ∫ p(c) P_l(c) dc   ⇒   c_lm = f_l Y_lm(axis)
/// ```
///
/// The axis of a phase function is the direction of *propagation* of the incoming light; the
/// expansion is then evaluated at `to_eye`. Truncation makes peaked functions negative in places
/// (from `|g| > 0.529` for Henyey–Greenstein at degree 2). Source: sheet § 1.6.
///
/// ```
/// # use fogbow::{math::Vec3, sh::{expansion, zonal}, spectrum::Spectrum};
/// let g = 0.3_f32;
/// let moments = [0, 1, 2, 3, 4].map(|l| Spectrum::splat(g.powi(l)));
/// let mut coefficients = [Spectrum::ZERO; 25];
/// zonal::coefficients(&moments, Vec3::Z, &mut coefficients);
/// let exact = (1.0 - g * g) / (4.0 * 3.14159265 * (1.0 + g * g).powf(1.5));   // across the axis
/// assert!((expansion::value(&coefficients, Vec3::X)[0] - exact).abs() < 3e-4);
/// ```
pub fn coefficients(moments: &[Spectrum], axis: Vec3, out: &mut [Spectrum]) {
    let mut basis = [0.0; MAX_COEFFICIENTS];
    let Some(degree) = moments.len().checked_sub(1) else { return };
    evaluate(axis, degree, &mut basis);
    for_each(moments, out.len(), |l, k| out[k] = moments[l] * basis[k]);
}

/// [`coefficients`] with their gradients when the axis is the direction of light from a fixed
/// point `distance` (m) away: `∇c_lm = f_l ∇Y_lm(u(x))`. Calls `visit(k, c_k, ∇c_k)`.
///
/// ```
/// # use fogbow::{math::Vec3, sh::zonal, spectrum::{Gradient, Spectrum}};
/// let moments = [Spectrum::ONE, Spectrum::splat(0.5)];   // mean cosine 0.5
/// let mut gradients = [Gradient::ZERO; 4];
/// zonal::coefficients_with_gradients(&moments, Vec3::Z, 2.0, |k, _, gradient| gradients[k] = gradient);
/// // As the point moves by dx, light from 2 m away turns by dx/2: Y₁₁ = √(3/4π) x grows, times f₁ = 0.5.
/// assert!((gradients[3].x[0] - 0.5 * 0.48860251 / 2.0).abs() < 1e-7);
/// assert_eq!(gradients[2], Gradient::ZERO);   // Y₁₀ is at its top
/// ```
#[inline]
pub fn coefficients_with_gradients(
    moments: &[Spectrum],
    axis: Vec3,
    distance: f32,
    visit: impl FnMut(usize, Spectrum, Gradient),
) {
    // Room for what is needed: clearing that of the highest degree would take longer than degree 2.
    match moments.len() {
        0 => {}
        1..=3 => sized::<9>(moments, axis, distance, visit),
        4..=7 => sized::<49>(moments, axis, distance, visit),
        _ => sized::<MAX_COEFFICIENTS>(moments, axis, distance, visit),
    }
}

#[inline]
fn sized<const ROOM: usize>(
    moments: &[Spectrum],
    axis: Vec3,
    distance: f32,
    mut visit: impl FnMut(usize, Spectrum, Gradient),
) {
    let (mut basis, mut slopes) = ([0.0; ROOM], [Vec3::ZERO; ROOM]);
    evaluate_with_gradients(axis, moments.len() - 1, &mut basis, &mut slopes);
    // From infinity the direction does not change; 1/∞ = 0 says so.
    let inverse = 1.0 / distance;
    for_each(moments, ROOM, |l, k| {
        visit(k, moments[l] * basis[k], Gradient::outer(moments[l], slopes[k] * inverse));
    });
}

/// Calls `f(l, k)` for every coefficient `k` of every degree `l` that has a moment and fits.
fn for_each(moments: &[Spectrum], room: usize, mut f: impl FnMut(usize, usize)) {
    for l in 0..moments.len().min(super::MAX_DEGREE + 1) {
        for k in l * l..((l + 1) * (l + 1)).min(room) {
            f(l, k);
        }
    }
}
