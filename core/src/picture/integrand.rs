//! What a sample is, and what is counted on the way to it.

use crate::spectrum::Spectrum;

/// One sample of one pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sample<'t, T> {
    /// Column, from the left.
    pub x: u32,
    /// Row, from the top.
    pub y: u32,
    /// Index of the sample in its pixel.
    pub index: u32,
    /// What the integrand counts, job by job.
    pub tally: &'t T,
}

/// What a sample of a picture is: writes a colour per layer into the slice it is given (black at first), from the random
/// numbers it is given and nothing else that changes.
///
/// ```
/// use fogbow::picture::{Integrand, Sample};
/// use fogbow::{sampling::Generator, spectrum::Spectrum};
/// // A function that counts nothing is one.
/// let columns = |sample: &Sample<'_, ()>, _: &mut Generator, layers: &mut [Spectrum]| layers[0] = Spectrum::splat(sample.x as f32);
/// let mut layers = [Spectrum::ZERO];
/// columns.sample(&Sample { x: 3, y: 0, index: 0, tally: &() }, &mut Generator::new(1), &mut layers);
/// assert_eq!(layers[0], Spectrum::splat(3.0));
/// ```
pub trait Integrand<R> {
    /// What it counts on its way; `()` for nothing.
    type Tally: Tally;

    /// Takes one sample.
    fn sample(&self, sample: &Sample<'_, Self::Tally>, rng: &mut R, layers: &mut [Spectrum]);
}

/// What an [`Integrand`] counts, job by job: each starts with the default.
///
/// ```
/// # #[cfg(feature = "alloc")] {
/// use core::cell::Cell;
/// use fogbow::picture::{Integrand, Sample, Settings, Tally, TileOutput, Tiles};
/// use fogbow::{sampling::{Generator, Independent}, spectrum::Spectrum, work};
///
/// #[derive(Default)]
/// struct Rays(Cell<u64>);
///
/// impl Tally for Rays {
///     type Total = u64;
///     fn add_to(&self, total: &mut u64) {
///         *total += self.0.get();
///     }
/// }
///
/// /// Sends one ray more in each row than in the row above.
/// struct Rows;
///
/// impl Integrand<Generator> for Rows {
///     type Tally = Rays;
///     fn sample(&self, sample: &Sample<'_, Rays>, _: &mut Generator, _: &mut [Spectrum]) {
///         sample.tally.0.set(sample.tally.0.get() + u64::from(sample.y));
///     }
/// }
///
/// let settings = Settings { size: [5, 3], layers: 1, samples: 10, goal: None, seed: 0, tile: 8 };
/// let mut tiles = Tiles::new(settings, Independent);
/// work::finish(&mut tiles, &Rows, &mut TileOutput::default());
/// assert_eq!(*tiles.total(), 10 * 5 * (0 + 1 + 2));
/// # }
/// ```
pub trait Tally: Default {
    /// The sum over all jobs.
    type Total: Default;

    /// Adds what a job has counted.
    fn add_to(&self, total: &mut Self::Total);
}

impl Tally for () {
    type Total = ();

    fn add_to(&self, (): &mut ()) {}
}

impl<R, F: Fn(&Sample<'_, ()>, &mut R, &mut [Spectrum])> Integrand<R> for F {
    type Tally = ();

    fn sample(&self, sample: &Sample<'_, ()>, rng: &mut R, layers: &mut [Spectrum]) {
        self(sample, rng, layers);
    }
}

/// Samples that were taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// All of them.
    pub samples: u64,
    /// Of these, those that were no finite numbers and count as black: 0 unless something is wrong.
    pub non_finite: u64,
}
