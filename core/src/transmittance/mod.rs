//! Layer 4a: how light gets through a medium.
//!
//! | file | holds |
//! |---|---|
//! | `segments` | [`segments()`]: the one loop over the majorant segments of a ray |
//! | [`tracking`] | flights to the next collision (delta tracking), transmittance (ratio tracking) |
//! | [`marched`] | collisions drawn from a marched ray, with the thickness up to them |
//! | [`thickness`] | optical thickness by closed forms and marching, with both gradients |
//!
//! Closed forms wherever a [`MajorantSegment`](crate::host::MajorantSegment) says that the medium is constant.

pub mod marched;
mod segments;
pub mod thickness;
pub mod tracking;

pub use segments::{Segments, marching_segments, segments};
pub use tracking::{Flight, flight, transmittance};
