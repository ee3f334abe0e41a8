//! All tests of the program and of what it reads, linked once.

mod broken;
mod caches;
mod gltf;
mod pbrt;
mod program;
mod reads;
mod shaders;
mod shapes;
mod shown;
mod vdb;
