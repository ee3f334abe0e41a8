//! Layer 4: media that need no host.
//!
//! | file | holds |
//! |---|---|
//! | [`homogeneous`] | the same everywhere |

pub mod homogeneous;

pub use homogeneous::{Homogeneous, MediumError};
