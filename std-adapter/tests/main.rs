//! All tests of this package, as one program.

#[cfg(feature = "exr")]
mod exr;
mod files;
mod film;
mod pfm;
mod png;
mod seed;
