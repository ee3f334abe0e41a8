//! Where the random numbers of samples come from: every sample of every pixel has a generator of its own.

use rand_core::Rng;

use super::uniform::{Generator, mix};

/// Generators by seed, key (a pixel, a pass) and number of a sample: never by thread, so that results do not depend on
/// how work is dealt out.
pub trait Source {
    /// The generator of one sample.
    type Rng: Rng;

    /// The generator of sample number `sample` of what `key` names.
    fn start(&self, seed: u64, key: u64, sample: u32) -> Self::Rng;
}

/// Numbers that are independent from sample to sample.
///
/// ```
/// use fogbow::sampling::{Independent, Source, uniform};
/// let (mut a, mut b) = (Independent.start(1, 7, 0), Independent.start(1, 7, 1));
/// assert_ne!(uniform(&mut a), uniform(&mut b));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Independent;

impl Source for Independent {
    type Rng = Generator;

    #[inline]
    fn start(&self, seed: u64, key: u64, sample: u32) -> Generator {
        // Two rounds of hashing, so that neither sums nor exclusive-ors of seed and key coincide.
        Generator::new(mix(mix(mix(seed) ^ key)).wrapping_add(u64::from(sample)))
    }
}
