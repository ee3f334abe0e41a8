//! Layer 7: many virtual lights, with bias compensation.
//!
//! The vertices of the lights' paths are kept as virtual point lights, in the medium and on surfaces; points on eye rays
//! gather them. Connections to near lights are clamped, because they would show as bright splotches, and what
//! that takes away is found by short paths from the points. Engelhardt and Dachsbacher 2012, *Approximate Bias
//! Compensation for Rendering Scenes with Heterogeneous Participating Media*; Raab et al. 2008; on surfaces Kollig and
//! Keller 2004.
//!
//! ```text
//! L_o(y,ω) = D + Σ_k E_k + C,   E_k = f̂ min(Ĝ, b) V̂ f̂(v_k) β_k/N
//! C = P + Σ_k Q_k,              P = K_B [D + P],   Q_k = K_B [E_k + Q_k],   K_B: the integral of f̂ D V̂ B̂
//! ```
//!
//! | file | holds |
//! |---|---|
//! | [`bound`] | [`Bound`]: what clamping leaves and takes; [`contraction`] `κ_B`, [`radius_for`] |
//! | [`light`] | [`VirtualLight`], its [`Connection`] to a point: visibility and transmittance are the host's |
//! | `generate` | [`shoot`]: lights from paths; [`select`]: those that matter |
//! | `scatterer` | [`Scatterer`]: medium or surface; [`Receiver`]: a point light is gathered for |
//! | `compensate` | [`Compensation`]; [`next_vertex`] of a compensation path |
//! | [`gather`] | [`Gatherer`]: clamped light and compensation at a point |
//! | [`eye`] | [`radiance`]: eye rays |
//! | `single` | light that the medium scatters once, along an eye ray |
//! | `settings` | [`Settings`]: every tuned number, from an [`Outline`](crate::world::Outline) |
//! | `pass` | [`VplPass`]: the lights of a pass, as work in rounds; [`witnesses`] of what matters |

pub mod bound;
mod compensate;
pub mod eye;
pub mod gather;
mod generate;
pub mod light;
mod pass;
mod scatterer;
mod settings;
mod single;

pub use bound::{Bound, NoBound, contraction, geometry, radius_for, usual_bound};
pub use compensate::{Compensation, Flights, next_vertex};
pub use eye::{EyeSettings, VplRadiance, radiance, receivers};
pub use gather::{GatheredVpls, Gatherer, LEVELS};
pub use generate::{select, shoot};
pub use light::{Connection, VirtualLight};
pub use pass::{CurvePlace, VplMemory, VplOutput, VplPass, VplPassError, witnesses};
pub use scatterer::{Receiver, Scatterer};
pub use settings::{MOST_CANDIDATES, SAMPLES, Settings};
