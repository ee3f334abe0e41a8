//! Layer 5: light scattered once, with gradients.
//!
//! ```text
//! L_s = Σ p T H w V,     ∇L_s = Σ w V [(∇p) T H + p (∇T) H + p T (∇H)]
//! ```
//!
//! Jarosz et al. 2008, Eq. 7–15, 24, 26, with the corrections of the sheet's § 1.5: phase functions
//! act on light that [`Arrival`] describes, so that a value for one direction and an expansion over
//! all directions share everything else. `L` is in-scattered radiance per scattering: it does *not*
//! contain `σₛ`.
//!
//! | file | holds |
//! |---|---|
//! | `arrival` | [`Arrival`]: fogged light at a point with its gradient; from a source, or a surface hit |
//! | `sums` | [`Sums`]: value, gradient, `Σ‖∇L_j‖` and the unshadowed variants that Eq. 34 needs |
//! | `sample` | estimates over all lights, and over surfaces hit by uniformly sampled directions |

mod arrival;
mod sample;
mod sums;

pub use arrival::{Arrival, Contribution, connect, moments};
pub(crate) use sample::lattice;
pub use sample::{
    Directional, Settings, Towards, sample, sample_directional, sample_surfaces, sample_surfaces_directional,
    visit_lights, visit_surfaces,
};
pub use sums::Sums;
