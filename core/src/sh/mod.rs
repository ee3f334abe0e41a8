//! Layer 1: real spherical harmonics, orthonormal, without the Condon–Shortley phase, in the order
//! `k = l(l+1) + m` (sheet § 1.6; the basis of Jarosz et al. 2008, Eq. 23–26).
//!
//! ```text
//! f(ω) = Σ_lm c_lm Y_lm(ω),   c_lm = ∫ f Y_lm dω,   Σ_m Y_lm(a) Y_lm(b) = (2l+1)/(4π) P_l(a·b)
//! ```
//!
//! | file | holds |
//! |---|---|
//! | `basis` | values and tangential gradients by recurrences polynomial in x, y, z |
//! | `quadratic` | the same up to degree 2, as constants |
//! | [`expansion`] | sums of coefficients and basis, in colour |
//! | [`zonal`] | expansions of functions of an angle, such as phase functions, from Legendre moments |
//! | [`mod@project`] | coefficients of any function by quadrature |

mod basis;
pub mod expansion;
pub mod project;
mod quadratic;
pub mod zonal;

pub use basis::{evaluate, evaluate_with_gradients};
pub use expansion::Coefficient;
pub use project::project;

/// Highest degree supported: 289 coefficients resolve about 11°. What is sharper is better
/// evaluated directly than cached; a larger maximum costs stack in every directional estimate.
pub const MAX_DEGREE: usize = 16;

/// Number of coefficients at [`MAX_DEGREE`].
pub const MAX_COEFFICIENTS: usize = coefficient_count(MAX_DEGREE);

/// Number of coefficients of an expansion up to `degree`: `(degree + 1)²`.
///
/// ```
/// # use fogbow::sh::coefficient_count;
/// assert_eq!(coefficient_count(2), 9);
/// ```
#[must_use]
pub const fn coefficient_count(degree: usize) -> usize {
    (degree + 1) * (degree + 1)
}

/// Highest degree whose coefficients fit into `count` places; `None` for 0.
///
/// ```
/// # use fogbow::sh::degree_of;
/// assert_eq!((degree_of(9), degree_of(15), degree_of(0)), (Some(2), Some(2), None));
/// ```
#[must_use]
pub const fn degree_of(count: usize) -> Option<usize> {
    if count == 0 {
        return None;
    }
    let mut degree = 0;
    while degree < MAX_DEGREE && coefficient_count(degree + 1) <= count {
        degree += 1;
    }
    Some(degree)
}

/// The degree asked for, as far as the maximum and the room given allow.
const fn clamp_degree(degree: usize, room: usize) -> Option<usize> {
    match degree_of(room) {
        Some(most) if most < degree => Some(most),
        Some(_) => Some(degree),
        None => None,
    }
}
