//! fogbow for browsers and Node: worlds, caches, probes and pictures behind a flat interface.
//!
//! | module | holds |
//! |---|---|
//! | `words` | reading what a world is described by: 32-bit words |
//! | `matter` | the media of a world |
//! | `surfaces` | triangles, quadrilaterals and spheres, and a tree for casting rays at them |
//! | `world` | [`WebWorld`]: all of it together, from words |
//! | `view` | a camera, and parts of pictures |
//! | `caches`, `probes` | radiance caches and probe grids, job by job; what jobs leave, as bytes |
//! | `mathematics` | single formulas for who wants to see them |
//! | `abi` | the exports of the module |
//!
//! Everything but `abi` is safe Rust that runs natively, too: a test compares the bits.
#![no_std]

extern crate alloc;
#[cfg(not(target_family = "wasm"))]
extern crate std;

mod abi;
mod caches;
mod mathematics;
mod matter;
mod probes;
mod surfaces;
mod view;
mod words;
mod world;

pub use caches::WebCaches;
pub use probes::WebProbes;
pub use view::{Part, View};
pub use words::{Fault, Words};
pub use world::WebWorld;
