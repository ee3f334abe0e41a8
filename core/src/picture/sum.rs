//! Sums of samples that are the same bits in whatever order samples are added, and sums merged.

use crate::spectrum::Spectrum;

/// The sum of a pixel's samples in a layer: integers, multiples of 2⁻⁸⁰ of the unit of radiance, for each channel.
///
/// Floating point numbers round at every addition, so their sum depends on its order, and sums of parts are not the sum of the whole. Integers
/// do not: films of parts of a picture add up to the very bits of the whole, in any order.
///
/// Samples are held to 2⁻⁸⁰ (8·10⁻²⁵), so those above 10⁻¹⁷ to all digits of `f32`, and must be smaller than 2⁴⁷ (1.4·10¹⁴), their sum,
/// too; there it stays. The face of the sun has 2·10⁷ W·m⁻²·sr⁻¹, or 2·10⁹ cd·m⁻².
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PixelSum(pub(super) [i128; 3]);

/// Sums count in 2 to minus this. More, and bright lights do not fit; less, and faint light is coarse.
const BITS: i32 = 80;

/// Exponent, biased as in `f32`, of the first numbers that are too large: 2 to the power of 127 − [`BITS`], as half of an `i128` is negative.
const TOO_LARGE: u32 = 127 + (127 - BITS as u32);

/// Digits of an `f32` behind the first, and the bias of its exponent.
const FRACTION_BITS: u32 = 23;
const BIAS: i32 = 127;

/// A number in units of 2^−[`BITS`], rounded to the nearest; `None` if it is none, or too large.
fn exact(number: f32) -> Option<i128> {
    let bits = number.to_bits();
    let (exponent, fraction) = (bits >> FRACTION_BITS & 0xff, bits & ((1 << FRACTION_BITS) - 1));
    if exponent >= TOO_LARGE {
        return None;
    }
    // Where the exponent is zero, there is no leading one, and it counts as the next.
    let (exponent, digits) = if exponent == 0 { (1, fraction) } else { (exponent, fraction | 1 << FRACTION_BITS) };
    let shift = exponent as i32 - BIAS - FRACTION_BITS as i32 + BITS;
    let magnitude = if shift >= 0 {
        i128::from(digits) << shift
    } else if shift >= -32 {
        i128::from((u64::from(digits) + (1 << (-shift - 1))) >> -shift)
    } else {
        0
    };
    Some(if number.is_sign_negative() { -magnitude } else { magnitude })
}

impl PixelSum {
    /// No sample.
    pub const ZERO: Self = Self([0; 3]);

    /// Adds a sample; whether it could be: `false` if a channel is no finite number or 2⁴⁷ or more, and nothing is added then.
    ///
    /// ```
    /// use fogbow::{picture::PixelSum, spectrum::Spectrum};
    /// let samples = [1e9, 1e-9, 0.1, -1e9].map(Spectrum::splat);
    /// let sum = |order: [usize; 4]| {
    ///     let mut sum = PixelSum::ZERO;
    ///     assert!(order.iter().all(|&i| sum.add(samples[i])));
    ///     sum
    /// };
    /// assert_eq!(sum([0, 1, 2, 3]), sum([3, 1, 0, 2]));
    /// assert_eq!(sum([0, 1, 2, 3]).values()[0], f64::from(1e-9_f32) + f64::from(0.1_f32));
    /// assert!(!{ PixelSum::ZERO }.add(Spectrum::splat(f32::NAN)) && !{ PixelSum::ZERO }.add(Spectrum::splat(1e20)));
    /// ```
    #[inline]
    pub fn add(&mut self, sample: Spectrum) -> bool {
        let [Some(x), Some(y), Some(z)] = sample.0.map(exact) else { return false };
        self.merge(&Self([x, y, z]));
        true
    }

    /// Adds the samples of another sum.
    ///
    /// ```
    /// use fogbow::{picture::PixelSum, spectrum::Spectrum};
    /// let (mut one, mut other) = (PixelSum::ZERO, PixelSum::ZERO);
    /// one.add(Spectrum::new(1.0, 2.0, 3.0));
    /// other.add(Spectrum::splat(0.5));
    /// one.merge(&other);
    /// assert_eq!(one.values(), [1.5, 2.5, 3.5]);
    /// ```
    #[inline]
    pub fn merge(&mut self, other: &Self) {
        for (sum, more) in self.0.iter_mut().zip(other.0) {
            *sum = sum.saturating_add(more);
        }
    }

    /// Whether it takes such a sample.
    #[inline]
    pub(super) fn holds(sample: &Spectrum) -> bool {
        sample.0.iter().all(|channel| channel.to_bits() >> FRACTION_BITS & 0xff < TOO_LARGE)
    }

    /// The sums of the channels, to the nearest `f64`.
    ///
    /// ```
    /// assert_eq!(fogbow::picture::PixelSum::ZERO.values(), [0.0; 3]);
    /// ```
    #[inline]
    #[must_use]
    pub fn values(&self) -> [f64; 3] {
        /// 2^−[`BITS`].
        const UNIT: f64 = 1.0 / (1_u128 << BITS) as f64;
        self.0.map(|sum| sum as f64 * UNIT)
    }

    /// The mean of so many samples; black for none.
    ///
    /// ```
    /// use fogbow::{picture::PixelSum, spectrum::Spectrum};
    /// let mut sum = PixelSum::ZERO;
    /// sum.add(Spectrum::ONE);
    /// assert_eq!(sum.mean(4), Spectrum::splat(0.25));
    /// assert_eq!(sum.mean(0), Spectrum::ZERO);
    /// ```
    #[inline]
    #[must_use]
    pub fn mean(&self, count: u32) -> Spectrum {
        let weight = if count == 0 { 0.0 } else { 1.0 / f64::from(count) };
        Spectrum(self.values().map(|sum| (sum * weight) as f32))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{Generator, uniform};

    /// What is held of a number.
    fn held(number: f32) -> f64 {
        let mut sum = PixelSum::ZERO;
        assert!(sum.add(Spectrum::new(number, 0.0, -number)), "{number}");
        assert_eq!(sum.values()[0], -sum.values()[2]);
        sum.values()[0]
    }

    #[test]
    fn numbers_are_held_to_the_unit() {
        for exponent in -56..47 {
            let number = libm::exp2f(exponent as f32) * 1.999_999_9;
            assert_eq!(held(number), f64::from(number), "2^{exponent}");
        }
        for exponent in -149..-56 {
            let number = libm::exp2f(exponent as f32) * 1.3;
            let unit = libm::exp2(-80.0);
            assert!((held(number) - f64::from(number)).abs() <= 0.5 * unit, "2^{exponent}");
        }
        assert_eq!(held(0.0), 0.0);
        for wrong in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, libm::exp2f(47.0), -f32::MAX] {
            let mut sum = PixelSum::ZERO;
            assert!(!sum.add(Spectrum::new(1.0, wrong, 1.0)) && sum == PixelSum::ZERO, "{wrong}");
        }
        assert_eq!(held(libm::exp2f(47.0) * 0.999_999_9), f64::from(libm::exp2f(47.0) * 0.999_999_9));
    }

    /// Samples of forty orders of magnitude and both signs: in `f64` the order of a thousand of them changes the sum.
    #[test]
    fn sums_do_not_depend_on_order_or_parts() {
        let mut rng = Generator::new(3);
        let samples: [f32; 1000] = core::array::from_fn(|_| {
            let magnitude = libm::exp2f(120.0 * uniform(&mut rng) - 80.0);
            if uniform(&mut rng) < 0.3 { -magnitude } else { magnitude }
        });
        let sum_of = |samples: &mut dyn Iterator<Item = f32>| {
            let (mut sum, mut rounded) = (PixelSum::ZERO, 0.0);
            for sample in samples {
                assert!(sum.add(Spectrum::splat(sample)));
                rounded += f64::from(sample);
            }
            (sum, rounded)
        };
        let (whole, rounded) = sum_of(&mut samples.iter().copied());
        let (back, rounded_back) = sum_of(&mut samples.iter().rev().copied());
        assert_eq!(whole, back);
        assert_ne!(rounded, rounded_back);
        for parts in [2, 7, 16] {
            let mut merged = PixelSum::ZERO;
            for part in (0..parts).rev() {
                merged.merge(&sum_of(&mut samples.iter().skip(part).step_by(parts).copied()).0);
            }
            assert_eq!(merged, whole, "{parts}");
        }
        assert!((whole.values()[0] - rounded).abs() <= 1e-12 * rounded.abs());
    }
}
