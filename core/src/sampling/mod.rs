//! Layer 1: maps from uniform numbers to what light does. A sampler and its density stand side
//! by side; a fixed number of random numbers is an argument, so every map can be stratified.
//!
//! | file | holds |
//! |---|---|
//! | [`uniform`](mod@uniform) | uniform numbers from any [`Rng`](rand_core::Rng), and a small generator |
//! | [`warp`] | spheres, hemispheres, cones, discs, triangles, rectangles seen from a point |
//! | [`distance`] | exponential, truncated exponential, equiangular distances |
//! | [`discrete`] | choices by weight, in one and two dimensions |
//! | [`mis`] | multiple importance sampling weights |

pub mod discrete;
pub mod distance;
pub mod mis;
pub mod uniform;
pub mod warp;

pub use uniform::{Generator, independent, uniform, uniform2};
