//! Uniform numbers.

use core::convert::Infallible;

use glam::Vec2;
use rand_core::{Rng, TryRng};

/// The largest `f32` below 1.
pub const ONE_MINUS_EPSILON: f32 = 1.0 - f32::EPSILON / 2.0;

/// A uniform number in [0, 1), a multiple of 2⁻²⁴.
///
/// ```
/// # use fogbow::sampling::{Generator, uniform};
/// let mut rng = Generator::new(1);
/// let mean = (0..10_000).map(|_| uniform(&mut rng)).sum::<f32>() / 10_000.0;
/// assert!((mean - 0.5).abs() < 0.01);   // its standard deviation is √(1/12)/100 = 0.003
/// ```
#[inline]
pub fn uniform(rng: &mut (impl Rng + ?Sized)) -> f32 {
    (rng.next_u32() >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// A uniform point in the unit square.
///
/// ```
/// # use fogbow::sampling::{Generator, uniform, uniform2};
/// let (mut rng, mut same) = (Generator::new(1), Generator::new(1));
/// assert_eq!(uniform2(&mut rng).to_array(), [uniform(&mut same), uniform(&mut same)]);   // x, then y
/// ```
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
    ///
    /// ```
    /// # use fogbow::sampling::{Generator, uniform};
    /// let mut rng = Generator::new(1);
    /// let (mut first, mut second) = (Generator::child(&mut rng), Generator::child(&mut rng));
    /// assert_ne!(uniform(&mut first), uniform(&mut second));
    /// ```
    #[inline]
    #[must_use]
    pub fn child(rng: &mut (impl Rng + ?Sized)) -> Self {
        Self::new(u64::from(rng.next_u32()))
    }
}

/// Finaliser of SplitMix64 (Steele et al. 2014): every input bit reaches every output bit.
///
/// ```
/// # use fogbow::sampling::uniform::mix;
/// let changed = (0..64).map(|bit| (mix(7) ^ mix(7 ^ 1 << bit)).count_ones()).sum::<u32>();
/// assert!((changed / 64).abs_diff(32) < 2);   // one bit in changes half of the bits out
/// ```
#[inline]
#[must_use]
pub fn mix(value: u64) -> u64 {
    let z = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Point number `number` of a sequence that fills the unit square evenly, however many of its points are taken: multiples of
/// the powers of the plastic number, wrapped (Roberts 2018, the sequence R₂).
///
/// ```
/// # use fogbow::sampling::even2;
/// // Of 64 points every quarter has a quarter, give or take one.
/// let lower_left = (0..64).map(even2).filter(|[x, y]| *x < 0.5 && *y < 0.5).count();
/// assert!(lower_left.abs_diff(16) <= 1);
/// ```
#[must_use]
pub fn even2(number: u32) -> [f32; 2] {
    [0.754_877_666_246_692_8, 0.569_840_290_998_053_3].map(|step| wrapped(step, number))
}

/// As [`even2`] in the unit cube: the sequence R₃.
///
/// ```
/// # use fogbow::sampling::even3;
/// let low = (0..64).map(even3).filter(|[_, _, z]| *z < 0.5).count();
/// assert!(low.abs_diff(32) <= 1);
/// ```
#[must_use]
pub fn even3(number: u32) -> [f32; 3] {
    [0.819_172_513_396_164_4, 0.671_043_606_703_789_2, 0.549_700_477_901_985_2].map(|step| wrapped(step, number))
}

fn wrapped(step: f64, number: u32) -> f32 {
    let x = 0.5 + step * f64::from(number);
    (x - libm::floor(x)) as f32
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
