//! Broken input: scene files, meshes, volumes and images that must be refused with a clear word.

mod common;
mod data;
mod fuzz;
mod reading;
mod scenes;
