//! Layer 7: pictures, sample by sample, as work in rounds.
//!
//! A round is a pass: some more samples of every pixel. Tiles that have little enough noise are left out. What a
//! sample is, the host says with an [`Integrand`]; where random numbers come from, with a [`GeneratorSource`](crate::sampling::GeneratorSource).
//!
//! | file | holds |
//! |---|---|
//! | `tiles` | [`Tiles`]: passes over all pixels, in memory that grows or is lent |
//! | `integrand` | [`Integrand`]: what a sample is |
//! | `sum` | [`PixelSum`]: sums that do not depend on the order of samples |
//! | `share` | [`Share`]: parts of a picture, for several machines |
//! | `noise` | [`Goal`]: how many samples are enough, by the noise they still have |
//! | [`bytes`] | a picture on its way, to be gone on with later |
//! | `budget` | [`affordable`]: samples that the time left allows |
//! | `counting` | [`Queries`]: how often the world is asked |

mod budget;
#[cfg(feature = "alloc")]
pub mod bytes;
mod counting;
mod integrand;
mod noise;
mod share;
mod sum;
mod tiles;

pub use budget::{affordable, whole_passes};
#[cfg(feature = "alloc")]
pub use bytes::PictureBytesError;
pub use counting::{Counters, CountingMedium, CountingScene, Queries};
pub use integrand::{Counts, Integrand, Sample, Tally};
pub use noise::{Goal, LEAST_SAMPLES, MOST_SAMPLES, PixelNoise, TileNoise};
pub use share::Share;
pub use sum::PixelSum;
pub use tiles::{Settings, TileOutput, TileRoom, TileSlots, Tiles, accumulate};
