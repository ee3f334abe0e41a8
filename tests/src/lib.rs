//! Evidence for fogbow: what the tests share.
//!
//! | file | holds |
//! |---|---|
//! | [`golden`] | golden vectors: reading, comparing, one function per topic |
//! | [`hosts`] | media with exact gradients, bodies with faces, wrappers that complain |
//! | [`analytic`] | scenes whose answers are known, finite differences |
//! | [`estimate`](mod@estimate) | means with error bars |
//! | [`chi_square`] | χ² of samplers against their densities |
//! | [`tolerance`] | every tolerance, with its reason |

pub mod analytic;
pub mod chi_square;
pub mod estimate;
pub mod golden;
pub mod hosts;
pub mod tolerance;

/// The README's examples, run as tests.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
#[derive(Debug)]
pub struct Readme;
