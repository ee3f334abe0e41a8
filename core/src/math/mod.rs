//! Layer 0a: numbers, directions, rays, boxes and quadrature.
//!
//! | file | holds |
//! |---|---|
//! | [`float`] | elementary functions, the same bits on every target |
//! | [`frame`] | orthonormal frames around a direction |
//! | [`ray`] | [`Ray`] |
//! | [`bounds`] | [`Bounds`]: axis-aligned boxes |
//! | `digits` | numbers in messages |
//! | [`quadrature`] | Gauss–Legendre nodes |
//! | [`symmetric`] | symmetric 2×2 and 3×3 matrices |
//! | [`arrays`] | vectors, boxes and maps as arrays; Bevy's versions |

pub mod arrays;
pub mod bounds;
pub(crate) mod digits;
pub mod float;
pub mod frame;
pub mod quadrature;
pub mod ray;
pub mod symmetric;

pub use arrays::{affine_from_columns, affine_from_rows, affine_to_columns, affine_to_rows};
pub use bounds::Bounds;
pub use frame::Frame;
pub use glam::{Affine3, Mat3, Vec2, Vec3};
pub use ray::Ray;
pub use symmetric::{Eigen, Symmetric2, Symmetric3};
