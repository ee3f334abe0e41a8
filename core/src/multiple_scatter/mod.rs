//! Layer 6a: light scattered more than once, by random walks with gradients.
//!
//! ```text
//! L_m ≈ (1/N) Σ_paths Σ_{k≥1} W_k L_s(x_k, ω'_k),
//! ∇(W_k L_s) = W_k L_s Σ_i [∇σₛ(x_i)/σₛ(x_i) − ∇τ_joint(x_{i−1}, x_i)] + W_k ∇L_s(x_k)
//! ```
//!
//! Jarosz et al. 2008, Eq. 27–30, as in the sheet's § 1.7: there the whole path is translated with its
//! start, and everything but extinction and scattering is frozen. Departs from the paper:
//!
//! - vertices move less the nearer they are to the wall behind them, to a face of the medium or to a lamp ([`Shift`]): translated paths
//!   cross walls and leave the fog, and the gradient of the volume's border was missing. The sums above get a factor `Πφ` on each
//!   `∇` and the terms of [`Weight::advance_by`]; phase functions turn with their directions. Densities,
//!   lengths, roulette and visibility stay frozen;
//! - lengths come from marched thickness or delta tracking, which suit heterogeneous media; Eq. 29 remains as a choice;
//! - within its near field ([`Light::steep_field`](crate::light::Light::steep_field): all of space for
//!   lights without extent) a light is joined not to the collisions but to a point of every segment,
//!   sampled equiangularly (Kulla and Fajardo 2012), which takes the `1/ρ²` out along the segment.
//!   What is left of `‖∇L‖` still diverges logarithmically, so the fall-off of lights without extent
//!   may be held constant within a small distance ([`Settings::closest`]);
//! - Eq. 34 takes norms of sums over walks that start in one of 24 cones, not of single walks;
//! - a walk may end where its host knows the rest of the light, and what the host does not resolve of it may count as going straight
//!   on ([`Known`]);
//! - a part of the directions is drawn towards lamps without extent, which bounds samples that pass them;
//! - the light of surfaces enters through the direction in which the walk goes on anyway.
//!
//! `L_m` does not contain `σₛ` of the point itself. The light a surface sends straight to that
//! point is single scattering and left out here. Emission of the medium is left out, too.
//!
//! | file | holds |
//! |---|---|
//! | `weight` | [`Weight`]: a path's weight and its gradient, in forward mode; [`Shift`]: how vertices move |
//! | `flight` | the distance to the next collision: marched, by delta tracking, or by J's Eq. 29 |
//! | `lamps` | directions towards lamps without extent |
//! | `walk` | [`Walk`]: one path; [`Known`]: where it may end; [`Incoming`]: the light it brings |
//! | `estimate` | [`sample`], [`sample_directional`]: sums over paths |

mod estimate;
mod flight;
mod lamps;
mod walk;
mod weight;

pub(crate) use estimate::Cones;
pub use estimate::{sample, sample_directional};
pub use flight::{Collision, Flown, Lengths};
pub(crate) use lamps::DARK;
pub(crate) use walk::MOST_STRAIGHT;
pub use walk::{Incoming, Known, Settings, Start, Walk};
pub use weight::{Shift, Weight};
