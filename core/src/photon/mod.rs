//! Layer 6b: walks of photons from the lights.
//!
//! | file | holds |
//! |---|---|
//! | `mod` | [`Event`]: what happens to a photon |
//! | `pieces` | [`for_each_piece`]: power along a flight, also where extinction is coloured |
//! | [`trace`](mod@trace) | [`trace()`]: the walk; [`trace_split`]: in parts, by weight windows |
//!
//! One walk serves all methods that send light out instead of fetching it (covariance tracing, photon
//! beams, virtual lights): it tells what happens as [`Event`]s, in order, and whoever listens keeps
//! what they need.
//!
//! Directions in events are those of *travel*, as light flies.

mod pieces;
pub mod trace;

use glam::Vec3;

pub use pieces::for_each_piece;
pub use trace::{trace, trace_split};

use crate::host::{Hit, Properties};
use crate::math::Ray;
use crate::spectrum::Spectrum;

/// What happens to a photon.
#[derive(Debug, Clone, Copy)]
pub enum Event<'a> {
    /// It left a light.
    Emitted {
        /// Index of the light.
        light: usize,
        /// Where it starts and where it flies (unit direction).
        ray: &'a Ray,
        /// Normal of the light's surface there; `None` for lights without a surface.
        normal: Option<Vec3>,
        /// Power (W) it carries: what this path stands for. Divide by the number of paths.
        power: Spectrum,
    },
    /// It flew.
    Flew {
        /// From where it started to the surface ahead, or without end: it may have collided before.
        reach: &'a Ray,
        /// How far it came (m): to its collision, to the surface, or to the ray's end.
        distance: f32,
        /// Power (W) at the start. Where extinction is grey, that is what it stands for along the whole way; where it is coloured, [`for_each_piece`] tells.
        power: Spectrum,
    },
    /// It collided with the medium.
    Collided {
        /// Where (m).
        point: Vec3,
        /// Direction in which it came.
        incoming: Vec3,
        /// The medium there.
        properties: &'a Properties,
        /// Power (W) with which it came; albedo and phase function are still to be applied.
        power: Spectrum,
        /// Direction in which it goes on; `None` where the walk ends.
        outgoing: Option<Vec3>,
    },
    /// It met a surface.
    Met {
        /// Where (m).
        point: Vec3,
        /// Direction in which it came.
        incoming: Vec3,
        /// The surface.
        hit: &'a Hit,
        /// Power (W) with which it came.
        power: Spectrum,
        /// Direction in which it goes on; `None` where the walk ends.
        outgoing: Option<Vec3>,
    },
}
