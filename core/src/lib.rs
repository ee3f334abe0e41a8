#![doc = include_str!("../ARCHITECTURE.md")]
#![no_std]

#[cfg(feature = "alloc")]
extern crate alloc;

pub use bytemuck;
pub use glam;
pub use rand_core;

pub mod beams;
pub mod bytes;
pub mod cache;
pub mod covariance;
pub mod host;
pub mod light;
pub mod march;
pub mod math;
pub mod medium;
pub mod multiple_scatter;
pub mod path;
pub mod phase;
pub mod photon;
pub mod picture;
pub mod sampling;
pub mod sh;
pub mod single_scatter;
pub mod spectrum;
pub mod storage;
pub mod surface;
pub mod transmittance;
pub mod vpl;
pub mod work;
pub mod world;
