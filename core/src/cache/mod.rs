//! Layer 7: volumetric radiance caching (Jarosz et al. 2008), with a cache on surfaces besides.
//!
//! ```text
//! L(x, ω) = ∫ T σₛ (L_single + L_surface + L_multiple) dt + T(s) L_behind
//! ```
//!
//! Light scattered in a medium is smooth: it is computed with its gradient at few points
//! ([`Record`]s) and carried to all others within a radius that the gradients themselves give.
//! Every part has a cache of its own ([`Kind`]) with its own tolerance and effort. [`RadianceCaches`] holds them all:
//!
//! 1. [`Settings::for_outline`] says how fine each is in this world;
//! 2. [`RadianceCaches::fill`] is work in rounds ([`crate::work`]): [`places`] along eye rays or in a box, photons that light a
//!    [`PhotonGrid`], and where no record reaches, one from an [`Estimator`], whose walks end in that grid;
//! 3. [`Filling::finish`] gives the caches, to be read: [`RadianceCaches::radiance`] of an eye ray,
//!    [`RadianceCaches::in_scattered_sh`] of a probe.
//!
//! | file | holds |
//! |---|---|
//! | `caches` | [`RadianceCaches`]: all caches of a world |
//! | `kind` | [`Kind`]: what caches hold, what lights them, in which order they are made |
//! | `settings`, `presets` | [`Settings`], [`Effort`]; every tuned number of the method, from an outline of the world |
//! | `asked` | [`Asked`]: where light is asked for |
//! | `fill` | [`Filling`]: which places get records, rounds of new ones, better estimates for old ones |
//! | `memory` | [`FillingMemory`], [`FilledRecords`]: what a fill remembers, and what its jobs leave |
//! | `pilots` | whether records reach too far, measured in this world |
//! | `shares` | what part of a picture each kind brings, and how coarse it may be for that |
//! | `noise` | [`Glance`]: how much noise of records a picture would show, and how often it makes kinds be estimated anew |
//! | `photons` | [`PhotonEffort`]: light in cells, brought by photons, at which walks end |
//! | `resolved` | what such cells resolve by direction, and what goes straight on instead |
//! | `slot` | a cache of either sort, as filling needs it |
//! | `smooth` | irradiance averaged over neighbouring records |
//! | `readers` | probes, fluence, irradiance, in-scattered light; many at a time |
//! | `set_bytes` | all caches as bytes |
//! | `output_bytes` | what jobs leave, as bytes |
//! | `record` | [`Record`], [`Attachment`]: what is stored |
//! | `radius` | Eq. 34, limits, distance to surfaces, clamping of gradients and neighbours |
//! | `extrapolate` | Eq. 35, and a mixture of second order: [`Blend`] |
//! | `index` | [`Index`]: which spheres contain this point |
//! | `store` | [`Cache`]: records, attachments, index |
//! | `lookup` | look-ups in the medium and on surfaces |
//! | `lobe` | light towards the eye, beside an expansion of low degree |
//! | `aim` | where random walks start towards |
//! | `guide` | [`Guide`], [`Guided`]: where light was found to come from; [`Looks`]: how samples are drawn |
//! | `estimate` | [`Estimator`]: what records are made of |
//! | `connect` | connections of points to lights, for records and for eye rays |
//! | `evidence` | how far gradients can be believed; edges of the sky |
//! | `eye`, `places`, `seen` | eye rays: where they go; where they ask ([`places`]); what they see ([`radiance`]) |
//! | `offers` | their connections to many lights: more are tried than are followed |
//! | `agreement` | whether gradients of records agree with the records around them |
//! | `audit`, `bias_map` | [`Audit`]: how far pictures from caches are off; [`BiasMap`]: where |
//! | `refine` | levels of falling error, where time is limited |
//! | `room` | [`Slots`] and [`room_for`]: lent memory, and how much of it is needed |
//! | [`bytes`] | caches as bytes, to be saved |

mod agreement;
mod aim;
mod asked;
mod audit;
#[cfg(all(test, feature = "alloc"))]
mod audited;
mod bias_map;
pub mod bytes;
mod caches;
mod clashes;
mod connect;
mod estimate;
mod evidence;
mod extrapolate;
mod eye;
mod fill;
mod guide;
mod index;
mod kind;
mod lobe;
mod lookup;
mod memory;
mod mixture;
mod noise;
mod offers;
mod output_bytes;
mod photons;
mod pilots;
mod places;
mod presets;
mod radius;
mod readers;
mod record;
mod refine;
mod resolved;
mod room;
mod seen;
mod set_bytes;
mod settings;
mod shares;
mod slot;
mod smooth;
mod store;

pub use asked::{Asked, Wanted};
pub use audit::{Audit, Compared, Deviation, Findings, Squared};
pub use bias_map::{AuditedRegion, BiasMap, MeanLight};
pub use caches::RadianceCaches;
pub use estimate::Estimator;
pub use extrapolate::{Blend, Extrapolation, exponent_limit, weight};
pub use eye::RaySettings;
pub use fill::Filling;
pub use guide::{Guide, Guided, Looks};
pub use index::{Block, Index, IndexNode};
pub use kind::Kind;
pub use lookup::{Basis, Reading, TURNING_DEGREE, TurningBasis};
pub use memory::{Estimate, FilledRecords, FillingMemory};
pub use noise::Glance;
pub use photons::{PhotonCell, PhotonDeposit, PhotonEffort, PhotonGrid};
pub use places::{Place, places};
pub use presets::{ERROR_BOUNDS, MOST_REPAIRS, MOST_SAMPLES, USUAL_ERROR};
pub use radius::{Limits, clamp_gradient, clearance, log_gradient_radius, neighbour_clamped, valid_radius};
pub use readers::ScatteredLight;
pub use record::{Attachment, Facing, Record};
pub use refine::{LevelPicture, Refinement};
pub use room::{Room, Slots, room_for};
pub use seen::{CachedRadiance, Caches, Reader, radiance, radiance_beyond};
pub use set_bytes::CachesError;
pub use settings::{Effort, Settings};
pub use store::{Cache, InsertError, SurfaceCache, VolumeCache};
