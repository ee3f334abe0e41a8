//! All tests of the program and of what it reads, linked once.

mod broken;
mod caches;
mod program;
mod shapes;
