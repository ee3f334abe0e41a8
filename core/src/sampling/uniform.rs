//! Uniform numbers.

use core::convert::Infallible;

use glam::Vec2;
use rand_core::{Rng, TryRng};

/// The largest `f32` below 1.
pub const ONE_MINUS_EPSILON: f32 = 1.0 - f32::EPSILON / 2.0;

/// A uniform number in [0, 1), a multiple of 2⁻²⁴.
#[inline]
pub fn uniform(rng: &mut (impl Rng + ?Sized)) -> f32 {
    (rng.next_u32() >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// A uniform point in the unit square.
#[inline]
pub fn uniform2(rng: &mut (impl Rng + ?Sized)) -> Vec2 {
    let x = uniform(rng);
    Vec2::new(x, uniform(rng))
}

/// A small, fast generator (PCG-RXS-M-XS, 64 bits of state, O'Neill 2014).
///
/// Loops of unknown length (delta tracking, ratio tracking) draw from a generator of their own,
/// seeded by one number of the host's: so the host's sequence keeps its alignment from sample to
/// sample and may be a low-discrepancy one.
///
/// ```
/// # use fogbow::sampling::{Generator, uniform};
/// let (mut a, mut b) = (Generator::new(7), Generator::new(7));
/// assert_eq!(uniform(&mut a), uniform(&mut b));
/// assert_ne!(uniform(&mut a), uniform(&mut Generator::new(8)));
/// ```
#[derive(Debug, Clone)]
pub struct Generator {
    state: u64,
}

impl Generator {
    /// A generator that starts from `seed`; similar seeds give unrelated sequences.
    #[inline]
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self { state: mix(seed) }
    }

    /// A generator seeded by one draw from `rng`.
    #[inline]
    #[must_use]
    pub fn child(rng: &mut (impl Rng + ?Sized)) -> Self {
        Self::new(u64::from(rng.next_u32()))
    }
}

/// Finaliser of SplitMix64 (Steele et al. 2014): every input bit reaches every output bit.
#[inline]
#[must_use]
pub fn mix(value: u64) -> u64 {
    let z = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// A generator whose numbers have nothing to do with those of any other sample, key (a pixel, a path) or seed.
///
/// ```
/// # use fogbow::sampling::{independent, uniform};
/// let (mut a, mut b) = (independent(1, 7, 0), independent(1, 7, 1));
/// assert_ne!(uniform(&mut a), uniform(&mut b));
/// ```
#[inline]
#[must_use]
pub fn independent(seed: u64, key: u64, sample: u32) -> Generator {
    Generator::new(mix(key_seed(seed, key)).wrapping_add(u64::from(sample)))
}

/// Seed of a key: two rounds of hashing, so that neither sums nor exclusive-ors of seed and key coincide.
#[inline]
fn key_seed(seed: u64, key: u64) -> u64 {
    mix(mix(seed) ^ key)
}

impl TryRng for Generator {
    type Error = Infallible;

    #[inline]
    fn try_next_u32(&mut self) -> Result<u32, Infallible> {
        Ok((self.try_next_u64()? >> 32) as u32)
    }

    #[inline]
    fn try_next_u64(&mut self) -> Result<u64, Infallible> {
        let state = self.state;
        self.state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let word = ((state >> ((state >> 59) + 5)) ^ state).wrapping_mul(12_605_985_483_714_917_081);
        Ok((word >> 43) ^ word)
    }

    fn try_fill_bytes(&mut self, bytes: &mut [u8]) -> Result<(), Infallible> {
        for chunk in bytes.chunks_mut(8) {
            let word = self.try_next_u64()?.to_le_bytes();
            chunk.copy_from_slice(&word[..chunk.len()]);
        }
        Ok(())
    }
}
