//! Layer 7: covariances of light fields in participating media, after Belcour et al. 2014.
//!
//! Around a ray, light is a function of place across it `(u, v)` and direction `(θ, φ)`. The covariance of
//! that function's spectrum says how fast light varies, in which direction and with what correlation:
//!
//! ```text
//! Σ_ij = ∫ Ω_i Ω_j |f̂| dΩ / ∫ |f̂| dΩ  ≈  |Hess f| / (4π² f)        (cycles²)
//! ```
//!
//! | file | holds |
//! |---|---|
//! | `matrix` | [`Symmetric4`], packed |
//! | [`operators`] | travel, occlusion, attenuation, scattering, reflection, refraction, mixing (B Fig. 3, Eq. 3–13) |
//! | `lobe` | [`phase_covariance`] of any phase function (Eq. 13–14) |
//! | `light_field` | [`LightField`]: a covariance with its frame, operators in world coordinates |
//! | `metrics` | [`Voxel`], and what its covariance is good for: steps, radii, densities, filters (Eq. 17–20) |
//! | `emission` | [`emitted`]: with what light leaves a light |
//! | `lattice` | [`Lattice`]: a box of cells and the walk of a ray through them |
//! | `occluders` | [`Occluders`]: where surfaces lie, and what passing them does |
//! | `photon` | [`FrequencyPhotons`]: light fields carried along photon walks (Alg. 2) |
//! | `grid` | [`GridView`]: Γ anywhere in the volume; [`CovarianceGrid`] with its memory |
//! | `fill` | [`Fill`]: grids filled, as work in rounds; [`Settings`] |
//! | `steps` | [`AdaptiveSteps`] along an eye ray (Alg. 1) |
//! | `radii` | [`Radii`] of kernels anywhere in the volume (Eq. 19) |
//! | `image` | [`image_covariance`] along an eye ray |
//! | [`image_sampling`] | which pixels are computed, and filling in the others |
//! | [`bytes`] | grids saved and sent |
//!
//! Where the model is blind: an unoccluded point light's `1/r²` has no content of its own across the ray. Photons that
//! come straight from a light therefore add it as [`divergence`]; behind glass and mirrors it is missing.

pub mod bytes;
mod emission;
mod fill;
mod grid;
mod image;
pub mod image_sampling;
mod lattice;
mod light_field;
mod lobe;
mod matrix;
mod metrics;
mod occluders;
pub mod operators;
mod photon;
mod radii;
mod steps;

pub use emission::emitted;
pub use fill::{Deposit, Fill, FillError, GridMemory, GridOutput, Settings, SurfacePoint};
pub use grid::{CovarianceGrid, GridView, merge};
pub use image::image_covariance;
pub use lattice::{CellCrossing, Cells, Lattice, LatticeError, MAX_EDGE};
pub use light_field::{LightField, Patch};
pub use lobe::{phase_covariance, phase_hessian};
pub use matrix::{LIMIT, Symmetric4};
pub use metrics::{
    ImageCovariance, Voxel, balanced_radius, divergence, filter_precision, hessian_bound, kernel_radius,
    sample_density, step,
};
pub use occluders::{NEAREST, OccluderCell, Occluders};
pub use photon::FrequencyPhotons;
pub use radii::Radii;
pub use steps::{AdaptiveSteps, EVEN_STEP, LEAST_STEP, LONGEST_STEP, Rule, STEP_COUNT};
