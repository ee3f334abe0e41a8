//! To come.

pub mod thickness;
