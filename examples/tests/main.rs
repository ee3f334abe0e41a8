//! All tests of the program and of what it reads, linked once.

mod broken;
mod caches;
mod gltf;
mod program;
mod shapes;
mod vdb;
