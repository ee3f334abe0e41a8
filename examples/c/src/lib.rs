//! fogbow for C and C++: what `include/fogbow.h` declares. The interface is explained there, and in the README beside this crate's
//! manifest.
//!
//! | file | holds |
//! |---|---|
//! | `status` | what functions return; messages; no panic leaves a function |
//! | `handles` | handles: a table of what they stand for |
//! | `arguments` | pointers, sizes and numbers, checked |
//! | `host` | callbacks of the host, and checks of their answers |
//! | `medium`, `light`, `world` | the world |
//! | `work` | jobs of fills, bakes and audits |
//! | `view` | eye rays |
//! | `caches`, `readers`, `audit` | radiance caches |
//! | `probes` | baked light |
//! | `phase`, `transmittance`, `covariance`, `records`, `compensation` | formulas |
#![expect(non_camel_case_types, reason = "types have the names that C knows")]

mod arguments;
mod audit;
mod caches;
mod compensation;
mod covariance;
mod handles;
mod host;
mod light;
mod medium;
mod phase;
mod probes;
mod readers;
mod records;
mod status;
mod transmittance;
mod view;
mod work;
mod world;

pub use audit::*;
pub use caches::*;
pub use compensation::*;
pub use covariance::*;
pub use host::*;
pub use light::*;
pub use medium::*;
pub use phase::*;
pub use probes::*;
pub use readers::*;
pub use records::*;
pub use status::*;
pub use transmittance::*;
pub use view::*;
pub use work::*;
pub use world::*;
