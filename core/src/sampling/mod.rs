//! Layer 1: maps from uniform numbers to what light does. A sampler and its density stand side
//! by side; a fixed number of random numbers is an argument, so every map can be stratified.
//!
//! | file | holds |
//! |---|---|
//! | [`uniform`](mod@uniform) | uniform numbers from any [`Rng`](rand_core::Rng), and a small generator |
//! | [`warp`] | spheres, hemispheres, cones, discs, triangles, rectangles seen from a point |
//! | [`distance`] | exponential, truncated exponential, equiangular distances |
//! | [`discrete`] | choices by weight, in one and two dimensions |
//! | `source` | [`Source`]: a generator for every sample of every pixel |
//! | [`mis`] | multiple importance sampling weights |

pub mod discrete;
pub mod distance;
pub mod mis;
mod source;
pub mod uniform;
pub mod warp;

pub use source::{Independent, Source};
pub use uniform::{Generator, uniform, uniform2};
