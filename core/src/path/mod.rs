//! Layer 6a: the volumetric path tracer, unbiased: the truth that every faster method is held to.
//!
//! | file | holds |
//! |---|---|
//! | `mod` | [`Settings`], [`Radiance`] by component |
//! | [`trace`](mod@trace) | [`radiance`]: the walk |
//! | `in_scatter` | [`in_scattered`]: light scattered towards the eye at one point |
//! | `connect` | next-event estimation, equiangular connections, their MIS weights |
//!
//! ```text
//! L(x,ω) = ∫ T(x,x_t) σₛ(x_t) ∫ p L dω′ dt + ∫ T ε dt + T(x,x_s) L(x_s,ω)
//! ```
//!
//! Light reaches a path in two ways, weighted so that none is counted twice:
//!
//! * connections: at every surface, and at every collision outside a light's near field,
//!   next-event estimation; inside a near field (everywhere, for lights without extent) an
//!   equiangular connection on every path segment (Kulla and Fajardo 2012), because there `1/r²`
//!   from collision vertices has a large or infinite variance;
//! * hits of lights with extent and of the environment by the path itself; the power heuristic
//!   (Veach 1997) weighs them against connections.

mod connect;
mod in_scatter;
pub mod trace;

pub(crate) use connect::pdf as connection_pdf;
pub use in_scatter::in_scattered;
pub(crate) use in_scatter::{FEW, arriving, direct};
pub use trace::{Delegate, radiance, radiance_beyond};

use crate::spectrum::Spectrum;

/// How long paths may grow.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Settings {
    /// Most scattering events (in the medium and at surfaces) of a path; 1 is direct light only.
    pub max_scatterings: u32,
    /// Scattering events after which Russian roulette begins.
    pub roulette_after: u32,
    /// Whether rays from the eye see area lights and the environment.
    pub lights_visible: bool,
}

impl Default for Settings {
    /// No limit, roulette from the fourth event, lights visible.
    fn default() -> Self {
        Self { max_scatterings: u32::MAX, roulette_after: 4, lights_visible: true }
    }
}

/// Radiance (W·m⁻²·sr⁻¹) by what the eye sees first and how often light was scattered.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Radiance {
    /// Lights, the environment and glowing media, seen directly.
    pub emitted: Spectrum,
    /// A surface lit directly.
    pub surface_direct: Spectrum,
    /// A surface lit by scattered light.
    pub surface_indirect: Spectrum,
    /// The medium lit directly.
    pub medium_single: Spectrum,
    /// The medium lit by scattered light.
    pub medium_multiple: Spectrum,
    /// How often the path collided with the medium: what it cost, not what is seen.
    pub collisions: u32,
}

impl Radiance {
    /// All components together.
    ///
    /// ```
    /// # use fogbow::{path::Radiance, spectrum::Spectrum};
    /// let lamp = Radiance { emitted: Spectrum::splat(2.0), ..Radiance::default() };
    /// let seen = Radiance { medium_single: Spectrum::ONE, collisions: 3, ..lamp };
    /// assert_eq!(seen.total(), Spectrum::splat(3.0));
    /// ```
    #[inline]
    #[must_use]
    pub fn total(&self) -> Spectrum {
        self.emitted + self.surface_direct + self.surface_indirect + self.medium_single + self.medium_multiple
    }
}

/// Radiance (W·m⁻²·sr⁻¹) scattered into a ray along its length, attenuated on its way to the ray's origin.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct InScattered {
    /// Light that came straight from the lights.
    pub single: Spectrum,
    /// Light that was scattered before.
    pub multiple: Spectrum,
}
