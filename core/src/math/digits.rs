//! Numbers in messages.

use core::fmt::{Display, Formatter, Result};

/// A number with seven significant digits. What `core` prints floats with, to the last digit and back, is twelve kilobytes: a fortieth of
/// a module for browsers, and more than some microcontrollers have to spare for messages.
pub(crate) struct Digits(pub(crate) f32);

const COUNT: usize = 7;

impl Display for Digits {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        if !self.0.is_finite() {
            return f.write_str(if self.0.is_nan() {
                "NaN"
            } else if self.0 > 0.0 {
                "inf"
            } else {
                "-inf"
            });
        }
        if self.0.is_sign_negative() {
            f.write_str("-")?;
        }
        let (mut size, mut exponent) = (f64::from(self.0.abs()), 0_i32);
        while size >= 10.0 {
            size /= 10.0;
            exponent += 1;
        }
        while size > 0.0 && size < 1.0 {
            size *= 10.0;
            exponent -= 1;
        }
        let mut left = (size * 1e6 + 0.5) as u32;
        if left == 10_000_000 {
            left /= 10;
            exponent += 1;
        }
        let mut digits = [b'0'; COUNT];
        for digit in digits.iter_mut().rev() {
            *digit = b'0' + (left % 10) as u8;
            left /= 10;
        }
        let used = digits.iter().rposition(|digit| *digit != b'0').map_or(1, |last| last + 1);
        let text =
            |range: core::ops::Range<usize>| core::str::from_utf8(digits.get(range).unwrap_or(&[])).unwrap_or("");
        match exponent {
            0..7 => {
                let whole = exponent as usize + 1;
                f.write_str(text(0..whole))?;
                if used > whole {
                    f.write_str(".")?;
                    f.write_str(text(whole..used))?;
                }
                Ok(())
            }
            -5..0 => {
                f.write_str("0.")?;
                (1..-exponent).try_for_each(|_| f.write_str("0"))?;
                f.write_str(text(0..used))
            }
            _ => {
                f.write_str(text(0..1))?;
                if used > 1 {
                    f.write_str(".")?;
                    f.write_str(text(1..used))?;
                }
                write!(f, "e{exponent}")
            }
        }
    }
}

#[cfg(all(test, feature = "alloc"))]
mod tests {
    use alloc::string::ToString;

    use super::Digits;

    #[test]
    fn seven_digits_are_those_of_the_number() {
        let said = [
            (0.0, "0"),
            (1.0, "1"),
            (-1.5, "-1.5"),
            (0.1, "0.1"),
            (999_999.6, "999999.6"),
            (0.3, "0.3"),
            (9_999_999.6, "1e7"),
            (123_456.7, "123456.7"),
            (100.25, "100.25"),
            (0.000_012_345_6, "0.0000123456"),
            (1.0e-7, "1e-7"),
            (f32::MAX, "3.402823e38"),
            (f32::from_bits(1), "1.401298e-45"),
            (f32::NAN, "NaN"),
            (f32::NEG_INFINITY, "-inf"),
        ];
        for (number, words) in said {
            assert_eq!(Digits(number).to_string(), words);
        }
        // And of many: what is read back is the number, to half a unit in the seventh digit.
        for i in 0..4000_u32 {
            let number = f32::from_bits(0x0080_0000 + i * 0x0007_fe00);
            let read: f64 = Digits(number).to_string().parse().unwrap();
            assert!((read / f64::from(number) - 1.0).abs() < 5.01e-7, "{number} as {read}");
        }
    }
}
