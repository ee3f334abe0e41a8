//! Random numbers of each pixel and sample: seeds hash the pixel and the sample, never a thread.

use core::convert::Infallible;

use fogbow::rand_core::TryRng;
use fogbow::sampling::uniform::mix;
use fogbow::sampling::{Generator, GeneratorSource, pixel_seed};
pub use fogbow::sampling::{independent, pixel_key};
use sobol_burley::parts::{Int4, hash, hash_int4, owen_scramble_int4_rev, owen_scramble_rev, sobol_int4_rev};

/// Which random numbers a picture is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Sequence {
    /// Every number independent of all others.
    Independent,
    /// The samples of a pixel fill the space of their first 24 numbers evenly
    /// ([`LowDiscrepancy`]): less noise for the same number of samples.
    #[default]
    LowDiscrepancy,
}

impl Sequence {
    /// The generator of one sample of one pixel ([`pixel_key`]).
    ///
    /// ```
    /// use fogbow::rand_core::Rng;
    /// use fogbow_std::seed::{Sequence, pixel_key};
    /// let first = |x, y| Sequence::LowDiscrepancy.start(1, pixel_key(x, y), 0).next_u32();
    /// assert_eq!(first(3, 4), first(3, 4));
    /// assert_ne!(first(3, 4), first(4, 3));
    /// ```
    #[inline]
    #[must_use]
    pub fn start(self, seed: u64, pixel: u64, sample: u32) -> SampleRng {
        match self {
            Self::Independent => SampleRng::Independent(independent(seed, pixel, sample)),
            Self::LowDiscrepancy => SampleRng::LowDiscrepancy(LowDiscrepancy::new(seed, pixel, sample)),
        }
    }
}

impl GeneratorSource for Sequence {
    type Rng = SampleRng;

    #[inline]
    fn start(&self, seed: u64, key: u64, sample: u32) -> SampleRng {
        Self::start(*self, seed, key, sample)
    }
}

/// The generator of one sample, as [`Sequence::start`] chose it.
#[derive(Debug, Clone)]
pub enum SampleRng {
    /// See [`Sequence::Independent`].
    Independent(Generator),
    /// See [`Sequence::LowDiscrepancy`].
    LowDiscrepancy(LowDiscrepancy),
}

impl TryRng for SampleRng {
    type Error = Infallible;

    #[inline]
    fn try_next_u32(&mut self) -> Result<u32, Infallible> {
        match self {
            Self::Independent(rng) => rng.try_next_u32(),
            Self::LowDiscrepancy(rng) => rng.try_next_u32(),
        }
    }

    #[inline]
    fn try_next_u64(&mut self) -> Result<u64, Infallible> {
        match self {
            Self::Independent(rng) => rng.try_next_u64(),
            Self::LowDiscrepancy(rng) => rng.try_next_u64(),
        }
    }

    fn try_fill_bytes(&mut self, bytes: &mut [u8]) -> Result<(), Infallible> {
        match self {
            Self::Independent(rng) => rng.try_fill_bytes(bytes),
            Self::LowDiscrepancy(rng) => rng.try_fill_bytes(bytes),
        }
    }
}

/// How many sets of four dimensions are of low discrepancy: what a path tracer draws for the camera
/// and its first two vertices. Later numbers decide little, and cost less than a third when
/// independent.
const SETS: u32 = 6;

/// A point of an Owen-scrambled Sobol sequence, number by number (Burley 2020, Practical
/// Hash-based Owen Scrambling; tables and hash of the crate `sobol_burley`).
///
/// The sample is the point's index, the pixel scrambles; after 24 numbers an
/// [`independent`] generator goes on. The tables hold 2¹⁶ points: every further 2¹⁶ samples are a
/// new scramble. All 32 bits are scrambled, so the 24 that `fogbow::sampling::uniform` reads are
/// in [0, 1) and distributed as independent ones.
///
/// ```
/// use fogbow::sampling::uniform;
/// use fogbow_std::seed::LowDiscrepancy;
/// // Of the first 16 samples, one lies in each sixteenth.
/// let mut seen: Vec<u32> = (0..16).map(|i| (uniform(&mut LowDiscrepancy::new(1, 7, i)) * 16.0) as u32).collect();
/// seen.sort();
/// assert!(seen.iter().copied().eq(0..16));
/// ```
#[derive(Debug, Clone)]
pub struct LowDiscrepancy {
    /// Four dimensions at a time, which is what the tables are laid out for.
    ready: [u32; 4],
    /// How many of `ready` are used.
    used: u32,
    /// The next four dimensions.
    set: u32,
    /// Index in the sequence, shuffled by the seed; its bits reversed.
    index: u32,
    seed: u32,
    rest: Generator,
}

impl LowDiscrepancy {
    /// Sample number `sample` of a pixel ([`pixel_key`]).
    #[inline]
    #[must_use]
    pub fn new(seed: u64, pixel: u64, sample: u32) -> Self {
        let key = pixel_seed(seed, pixel);
        // The high half of the hash, so that this is not the start of `rest`'s.
        let scramble = (mix(key ^ u64::from(sample >> 16)) >> 32) as u32;
        let index = owen_scramble_rev((sample & 0xffff).reverse_bits(), hash(scramble ^ 0x79c6_8e4a));
        Self { ready: [0; 4], used: 4, set: 0, index, seed: scramble, rest: independent(seed, pixel, sample) }
    }

    #[inline]
    fn refill(&mut self) {
        self.ready = if self.set < SETS {
            // As `sobol_burley::sample_4d`, but the index is shuffled once per sample and all bits are kept.
            let points = sobol_int4_rev(self.index, self.set);
            let scramble = Int4::from([self.seed.wrapping_mul(0x9c8f_2d3b); 4])
                ^ Int4::from([self.set; 4])
                ^ Int4::from([0x912f_69ba, 0x174f_18ab, 0x691e_72ca, 0xb40c_c1b8]);
            self.set += 1;
            owen_scramble_int4_rev(points, hash_int4(scramble)).reverse_bits().into()
        } else {
            let Ok(a) = self.rest.try_next_u64();
            let Ok(b) = self.rest.try_next_u64();
            [a as u32, (a >> 32) as u32, b as u32, (b >> 32) as u32]
        };
        self.used = 0;
    }
}

impl TryRng for LowDiscrepancy {
    type Error = Infallible;

    #[inline]
    fn try_next_u32(&mut self) -> Result<u32, Infallible> {
        if self.used >= 4 {
            self.refill();
        }
        let value = self.ready[(self.used & 3) as usize];
        self.used += 1;
        Ok(value)
    }

    #[inline]
    fn try_next_u64(&mut self) -> Result<u64, Infallible> {
        let high = self.try_next_u32()?;
        Ok(u64::from(high) << 32 | u64::from(self.try_next_u32()?))
    }

    fn try_fill_bytes(&mut self, bytes: &mut [u8]) -> Result<(), Infallible> {
        for chunk in bytes.chunks_mut(4) {
            let word = self.try_next_u32()?.to_le_bytes();
            chunk.copy_from_slice(&word[..chunk.len()]);
        }
        Ok(())
    }
}
