//! Where the random numbers of a pixel, a path or a record start: they hash what is computed, never who computes it.

use rand_core::Rng;

use super::Generator;
use super::uniform::mix;

/// A source of random numbers: a generator for every sample of everything that has a key.
///
/// A host that brings a low-discrepancy sequence implements this for it: the samples of one key are the points of a sequence.
///
/// ```
/// use fogbow::sampling::{Generator, GeneratorSource, independent, uniform};
/// /// The same numbers in every pixel, for a look at what else differs between them.
/// struct Alike;
/// impl GeneratorSource for Alike {
///     type Rng = Generator;
///     fn start(&self, seed: u64, _: u64, sample: u32) -> Generator {
///         independent(seed, 0, sample)
///     }
/// }
/// let first = |key, sample| uniform(&mut Alike.start(7, key, sample));
/// assert!(first(1, 0) == first(2, 0) && first(1, 0) != first(1, 1));
/// ```
pub trait GeneratorSource {
    /// The generator of one sample.
    type Rng: Rng;

    /// The generator of sample number `sample` of what `key` names: a pixel ([`pixel_key`]), the paths of a pass. The same for the
    /// same arguments.
    fn start(&self, seed: u64, key: u64, sample: u32) -> Self::Rng;
}

/// Every number independent of all others: [`independent`].
///
/// ```
/// use fogbow::sampling::{GeneratorSource, Independent, pixel_key, uniform};
/// let first = |x, y| uniform(&mut Independent.start(1, pixel_key(x, y), 0));
/// assert_eq!(first(3, 4), first(3, 4));
/// assert_ne!(first(3, 4), first(4, 3));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Independent;

impl GeneratorSource for Independent {
    type Rng = Generator;

    #[inline]
    fn start(&self, seed: u64, key: u64, sample: u32) -> Generator {
        independent(seed, key, sample)
    }
}

/// One number for a pixel, whatever the size of the picture.
///
/// ```
/// # use fogbow::sampling::pixel_key;
/// assert_ne!(pixel_key(3, 4), pixel_key(4, 3));
/// ```
#[inline]
#[must_use]
pub fn pixel_key(x: u32, y: u32) -> u64 {
    u64::from(y) << 32 | u64::from(x)
}

/// A generator whose numbers have nothing to do with those of any other key, sample or seed.
///
/// ```
/// use fogbow::sampling::{independent, uniform};
/// let (mut a, mut b) = (independent(1, 7, 0), independent(1, 7, 1));
/// assert_ne!(uniform(&mut a), uniform(&mut b));
/// ```
#[inline]
#[must_use]
pub fn independent(seed: u64, key: u64, sample: u32) -> Generator {
    Generator::new(mix(pixel_seed(seed, key)).wrapping_add(u64::from(sample)))
}

/// Seed of a pixel, or of anything else that has a key: two rounds of hashing, so that neither sums nor exclusive-ors of seed and
/// key coincide.
///
/// ```
/// # use fogbow::sampling::pixel_seed;
/// assert_ne!(pixel_seed(1, 2), pixel_seed(2, 1));
/// ```
#[inline]
#[must_use]
pub fn pixel_seed(seed: u64, key: u64) -> u64 {
    mix(mix(seed) ^ key)
}
