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
//! | [`source`] | [`GeneratorSource`]: where the random numbers of a pixel or a path start |

pub mod discrete;
pub mod distance;
pub mod mis;
pub mod source;
pub mod uniform;
pub mod warp;

pub use source::{GeneratorSource, Independent, independent, pixel_key, pixel_seed};
pub use uniform::{Generator, even2, even3, uniform, uniform2};
