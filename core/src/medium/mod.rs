//! Layer 4a: media that need no host.
//!
//! A medium answers for its coefficients at a point and for bounds on extinction along a segment
//! of a ray:
//!
//! ```text
//! minorant ≤ σₜ(x + t ω) ≤ majorant   for t in [from, until],   until > from
//! ```
//!
//! Following calls from one `until` to the next passes any distance in finitely many steps.
//! Rounding of positions is accounted for, except at faces: within rounding of one, the two sides
//! cannot be told apart.
//!
//! | file | holds |
//! |---|---|
//! | [`homogeneous`] | the same everywhere |
//! | [`grid`] | voxels, trilinear between cell centres |
//! | [`density`] | its storage and interpolation |
//! | [`majorant`], `grid_bounds`, `joining` | its blocks of bounds and the walk through them; how bounds are joined |
//! | [`sparse`], `sparse_bounds` | voxels where there are any |
//! | [`bricks`] | their storage |
//! | [`noise`], `perlin` | fractal noise |
//! | [`region`] | parts of space: boxes, balls |
//! | [`placed`] | a medium in a region, with holes |
//! | [`overlap`] | several in the same space |
//! | [`pyramid`] | any of them with means in balls by look-up |
//! | [`any`] | one of the above as plain data |
//! | `ball` | quadrature in a ball |
//! | [`error`] | what constructors refuse |

pub mod any;
mod ball;
pub mod bricks;
pub mod density;
pub mod error;
pub mod grid;
mod grid_bounds;
pub mod homogeneous;
mod joining;
pub mod majorant;
pub mod noise;
pub mod overlap;
mod perlin;
pub mod placed;
pub mod pyramid;
pub mod region;
pub mod sparse;
mod sparse_bounds;

pub use any::AnyMedium;
pub use bricks::{Bricks, NodeBounds};
pub use density::Density;
pub use error::MediumError;
pub use grid::DensityGrid;
pub use homogeneous::Homogeneous;
pub use majorant::{BLOCK, MinMax};
pub use noise::{FractalNoise, MAX_OCTAVES, Noise};
pub use overlap::Overlap;
pub use placed::Placed;
pub use pyramid::Pyramid;
pub use region::{BoxRegion, Crossing, Region, SphereRegion};
pub use sparse::SparseGrid;
