//! Layer 8: light in fog, baked into a grid of probes, for engines that show it as 3D textures.
//!
//! ```text
//! L_i(x, ω) = ∫ p(ω′·ω) L(x, ω′) dω′ ≈ Σ_lm c_lm(x) Y_lm(ω),   c_lm = f_l ∫ L(x, ω′) Y_lm(ω′) dω′
//! ```
//!
//! Probes stand at the centres of equal cells of a box, as texels do. Each holds what a [`ProbeBasis`] has: coefficients of
//! spherical harmonics, an ambient cube, or fluence; with standard errors, and with extinction and albedo beside it.
//!
//! 1. [`BakeSettings::for_outline`] says what is baked, and how well;
//! 2. [`Bake`] is work in rounds ([`crate::work`]): a job is one pass over a brick of 4 × 4 × 4 probes. What radiance caches know is read
//!    from them; all else is sampled, without bias, until the error asked for is reached;
//! 3. [`Bake::finish`] gives the [`ProbeGrid`], to be looked up, dilated into walls, and saved ([`bytes`]).
//!
//! Directions leave the probe. Of in-scattered radiance it is the one towards the eye, of irradiance the normal of the surface that is
//! lit. The phase function is in in-scattered radiance, `σₛ` is not.
//!
//! | file | holds |
//! |---|---|
//! | `settings` | [`BakeSettings`]: box, counts, effort |
//! | `basis` | [`ProbeBasis`], [`Quantity`], [`Orders`]: what a probe holds; what light from a direction counts for |
//! | `arriving` | the light that arrives at a probe, from caches, by connections and by paths |
//! | `places` | which probes are in walls or far from any medium |
//! | `fill` | [`Bake`]: passes over bricks |
//! | `earlier` | what is kept of the grid of an earlier frame |
//! | `flights` | [`PhotonFlight`]s that all probes share: what they leave in cells |
//! | `probe` | [`Probe`]: what lies beside its light, and which surfaces it sees |
//! | `grid` | [`ProbeGrid`]: what was baked; look-ups, dilation |
//! | `levels` | [`ProbeLevels`]: bricks of half the spacing where light varies |
//! | `parts` | parts of a grid, for several machines, and their merging |
//! | `froxels` | [`Froxels`]: fog before a camera in cells of its frustum, as engines show it |
//! | `one_light` | [`OneLight`]: a layer of light for each lamp |
//! | `output_bytes` | what jobs leave, as bytes |
//! | [`bytes`] | grids as bytes, to be saved |

mod arriving;
mod basis;
pub mod bytes;
mod earlier;
mod fill;
mod flights;
mod froxels;
mod grid;
mod levels;
mod one_light;
mod output_bytes;
mod parts;
mod places;
mod probe;
mod settings;
#[cfg(all(test, feature = "alloc"))]
mod tests;

pub use basis::{AXES, MOST_COEFFICIENTS, Orders, ProbeBasis, Quantity};
pub use fill::{Bake, BakedProbes};
pub use flights::{FlightMemory, PhotonFlight};
pub use froxels::{Froxel, Froxels};
pub use grid::{BakeMemory, Brick, ProbeDeviation, ProbeGrid};
pub use levels::{MOST_LEVELS, ProbeLevels};
pub use one_light::OneLight;
pub use probe::{Probe, ProbeState};
pub use settings::{BakeError, BakeSettings, MOST_PROBES};
