//! The parts of the `fogbow` program: scene files in, pictures out.
//!
//! | module | holds |
//! |---|---|
//! | [`scene_file`] | reads Mitsuba 3 scenes into a checked description |
//! | [`mesh`], [`volume`], [`vdb`], [`picture`] | the files scenes name |
//! | [`world`] | the host: surfaces, lights and media, ready for rays |
//! | [`camera`], [`filter`] | where eye rays start, and how much they count for a pixel |
//! | [`bake`] | files of baked light |
//! | [`plume`] | an animation of smoke |
//! | [`figures`] | figures of papers, rebuilt |
//! | [`derivatives`] | second derivatives of the fluence by differences |
//! | [`texture`] | values that vary over surfaces |
//! | [`statistics`] | what a run took, phase by phase |
//! | [`compare`] | how far two images are apart |
//! | [`cli`], `say` | the command line; lines on standard error and output |

extern crate alloc;

#[macro_use]
mod say;

pub mod bake;
pub mod camera;
pub mod cli;
pub mod compare;
pub mod derivatives;
pub mod error;
pub mod figures;
pub mod filter;
pub mod glare;
pub mod mesh;
pub mod picture;
pub mod plume;
pub mod scene_file;
pub mod statistics;
pub mod texture;
pub mod transform;
pub mod vdb;
pub mod volume;
pub mod world;
