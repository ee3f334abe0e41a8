//! Layer 5: integration of in-scattered light along an eye ray.
//!
//! ```text
//! L = ∫₀ˢ T (σₛ L_i + ε) dt,     the surface behind adds T(s) L_surface
//! ```
//!
//! Jarosz et al. 2008, Eq. 3 and 6; with the steps of Belcour et al. 2014, Alg. 1, when the step
//! function comes from a covariance. What scatters in is a function of the host: a cache look-up, a
//! gather of virtual lights, single scattering.
//!
//! | file | holds |
//! |---|---|
//! | `eye_ray` | [`eye_ray`], [`EyeRay`]: by steps; [`steps`], their points |
//! | `points` | [`scattering_points`]: by points as dense as light is scattered |

mod eye_ray;
mod points;

pub use eye_ray::{EyeRay, eye_ray, steps};
pub(crate) use points::attenuated_length;
pub use points::scattering_points;
