//! Sums over coefficients in colour.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::{MAX_COEFFICIENTS, degree_of, evaluate};
use crate::spectrum::{Gradient, Spectrum};

/// One coefficient of a coloured expansion with its spatial gradient.
///
/// Twelve floats: value (r, g, b), then the derivative along x, y and z (r, g, b each). A slice of
/// `(degree + 1)²` of them is a whole expansion: `3 · M · (1 + 3)` floats, `k = l(l+1) + m` outermost.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Coefficient {
    /// The coefficient.
    pub value: Spectrum,
    /// Its spatial gradient (per metre).
    pub gradient: Gradient,
}

impl Coefficient {
    /// Nothing.
    pub const ZERO: Self = Self { value: Spectrum::ZERO, gradient: Gradient::ZERO };
}

/// `Σ c_k Y_k`: the expansion's value where the basis is known; as many terms as both have.
///
/// ```
/// # use fogbow::{math::Vec3, sh::{self, expansion}, spectrum::Spectrum};
/// let mut y = [0.0; 4];
/// sh::evaluate(Vec3::Z, 1, &mut y);
/// let ambient = [Spectrum::splat(2.0), Spectrum::ZERO, Spectrum::ZERO, Spectrum::ZERO];
/// assert!((expansion::dot(&ambient, &y)[0] - 2.0 * 0.28209479).abs() < 1e-6);
/// ```
#[inline]
#[must_use]
pub fn dot(coefficients: &[Spectrum], basis: &[f32]) -> Spectrum {
    coefficients.iter().zip(basis).map(|(&c, &y)| c * y).sum()
}

/// Value of an expansion in `direction` (unit); its degree follows from the number of coefficients.
#[must_use]
pub fn value(coefficients: &[Spectrum], direction: Vec3) -> Spectrum {
    with_basis(coefficients.len(), direction, |basis| dot(coefficients, basis))
}

/// Value and spatial gradient of an expansion in `direction` (unit), held fixed.
///
/// ```
/// # use fogbow::{math::Vec3, sh::{Coefficient, expansion}, spectrum::{Gradient, Spectrum}};
/// let gradient = Gradient::outer(Spectrum::ONE, Vec3::X);
/// let ambient = [Coefficient { value: Spectrum::ONE, gradient }];
/// let (value, slope) = expansion::value_with_gradient(&ambient, Vec3::Z);
/// assert_eq!(value, slope.x);
/// ```
#[must_use]
pub fn value_with_gradient(coefficients: &[Coefficient], direction: Vec3) -> (Spectrum, Gradient) {
    with_basis(coefficients.len(), direction, |basis| {
        coefficients.iter().zip(basis).fold((Spectrum::ZERO, Gradient::ZERO), |(value, gradient), (c, &y)| {
            (value + c.value * y, gradient + c.gradient * y)
        })
    })
}

#[inline]
fn with_basis<R>(count: usize, direction: Vec3, f: impl FnOnce(&[f32]) -> R) -> R {
    // Clearing room for the highest degree would take longer than evaluating degree 2.
    match count {
        0 => f(&[]),
        1..16 => sized::<9, R>(count, direction, f),
        16..64 => sized::<49, R>(count, direction, f),
        _ => sized::<MAX_COEFFICIENTS, R>(count, direction, f),
    }
}

#[inline]
fn sized<const ROOM: usize, R>(count: usize, direction: Vec3, f: impl FnOnce(&[f32]) -> R) -> R {
    let mut basis = [0.0; ROOM];
    let degree = degree_of(count.min(ROOM)).unwrap_or(0);
    evaluate(direction, degree, &mut basis);
    f(&basis[..super::coefficient_count(degree)])
}
