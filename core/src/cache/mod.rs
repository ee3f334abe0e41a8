//! Layer 7: volumetric radiance caching.
//!
//! | file | holds |
//! |---|---|
//! | [`index`] | [`Index`]: which spheres contain this point? |

pub mod index;

pub use index::{Index, Node};
