//! Layer 7: photon beams.
//!
//! The flights of [`photon::trace`](crate::photon::trace()) are kept as beams, and an eye ray gathers what
//! they scatter towards the eye. Jarosz et al. 2011, *A Comprehensive Theory of Volumetric Radiance
//! Estimation Using Photon Points and Beams*: beam × beam, blurred in two dimensions.
//!
//! ```text
//! L(x,ω) ≈ 1/N Σ_beams ∫ T(x,y) σₛ(y) p(cos θ) Φ(l) K(d/r)/r² dt        y = x_t on the eye ray
//!                        l along the beam and d across it, both at y;  Φ(l) what is left of the power
//! ```
//!
//! | file | holds |
//! |---|---|
//! | [`piece`] | [`Piece`]: a part of a beam; [`shoot`], [`pieces`]: flights cut into them |
//! | [`kernel`] | the blur, its integral along a chord, progressive [`radius`](kernel::radius) |
//! | `tree` | [`BeamNode`]: boxes around pieces |
//! | `thickness` | optical thickness along an eye ray |
//! | [`gather`] | [`Beams`], what they scatter to an eye |
//! | `settings` | [`Settings`]: every tuned number, from an [`Outline`](crate::world::Outline) |
//! | `pass` | [`BeamPass`]: shooting as work in rounds; a sample of a pixel |
//!
//! Departures from the paper: the blur is a disc across the *beam*, and its integral along the eye ray is
//! taken in closed form. So no `1/sin θ` is left: the chord through a beam's cylinder grows as beams become
//! parallel to the eye ray, but never beyond the eye ray's own length, which is what parallel beams
//! contribute. The error of a pass is that of a two-dimensional blur, `½ a r² ΔΦ` with `a` of
//! [`kernel::SECOND_MOMENT`] (Belcour et al. 2014, Eq. 19), and goes with the radius of
//! progressive passes (Knaus and Zwicker 2011).
//!
//! Media need no cases: a beam is cut where ratio tracking changes its estimate of transmittance. In
//! constant media that is nowhere, and its power is the exact exponential. (Jarosz et al. 2011, *Progressive
//! Photon Beams*, let beams be step functions of several delta-tracked distances.)

pub mod gather;
pub mod kernel;
mod pass;
pub mod piece;
mod settings;
mod thickness;
mod tree;

pub use gather::{Beams, GatheredBeams};
pub use pass::{BeamOutput, BeamPass, BeamPassError};
pub use piece::{Piece, pieces, shoot};
pub use settings::Settings;
pub use tree::BeamNode;
