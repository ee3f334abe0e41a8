//! Threads, film and files.

pub mod film;
pub mod progress;
pub mod seed;
pub mod stats;
pub mod tiles;
