//! Every tolerance of the tests, with its reason.

/// Relative, analytic gradient against [`crate::analytic::differences`]: extrapolated differences of
/// `f32` functions over 1 % of the scale carry about 10⁻⁷/10⁻² of rounding, amplified by the
/// extrapolation, and by as much again where factors multiply.
pub const GRADIENT: f32 = 2e-3;

/// Probability that a correct sampler fails a χ² test by chance, over *all* tests of a run: divided
/// by their number (Bonferroni). Seeds are fixed, so a pass stays a pass.
pub const CHI_SQUARE_FAMILY: f64 = 1e-3;

/// Number of χ² tests by which [`CHI_SQUARE_FAMILY`] is divided; more than there are.
pub const CHI_SQUARE_TESTS: f64 = 200.0;

/// Expected count below which bins are pooled: under it the χ² law is a poor approximation.
pub const CHI_SQUARE_LEAST: f64 = 8.0;

/// Standard errors by which a Monte Carlo mean may miss a known value: 1 in 15 000 by chance, with
/// fixed seeds.
pub const STANDARD_ERRORS: f64 = 4.0;

/// Relative, addition theorem and projections of spherical harmonics up to the maximum degree: the
/// recurrences lose about one unit in the last place per degree.
pub const SH: f32 = 2e-5;

/// Least eigenvalue of a covariance (`f32`) in units of the largest variances that took part: entries round by
/// 6·10⁻⁸, four rows add up, and so do the dozen operations of an operator.
pub const COVARIANCE: f64 = 4e-6;

/// The same light field by way of two frames, entries in units of the variances that took part: axes are
/// unit to 10⁻⁷, and turns, operator and turn back add up.
pub const FRAMES: f64 = 1e-4;

/// Measured covariances of sampled Gaussian light fields, entries in units of their standard deviations: what the
/// window of [−1, 1] and dips that are no parabolas leave.
pub const FFT: f64 = 1e-2;

/// The same after scattering by Henyey–Greenstein with g = 0.8, relative: a lobe that is no Gaussian.
pub const FFT_PEAKED: f64 = 0.3;

/// Covariances moved by traced bundles, entries in units of the variances of their blocks: `f32`, through a dozen
/// operations that are stretched by up to 1/0.15² at oblique incidence.
pub const BUNDLE: f64 = 1e-4;
