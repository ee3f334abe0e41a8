//! How far an image is from a reference.

use fogbow::spectrum::Spectrum;
use fogbow_std::film::Image;

use crate::picture::Picture;

/// Side of the blocks over which noise averages out and bias shows.
pub const BLOCK: usize = 16;

/// Figures of a comparison. With `I` the image, `R` the reference and `R5` its mean over 5 × 5
/// pixels, which takes the reference's own noise out of the denominator:
///
/// ```text
/// relMSE = mean((I − R)² / (R5² + 0.01 mean(R)²))     bias = Σ(I − R) / ΣR
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Comparison {
    /// Mean squared relative error.
    pub rel_mse: f64,
    /// Its square root.
    pub rel_rmse: f64,
    /// Mean signed difference over the reference's mean.
    pub bias: f64,
    /// Largest error of a single pixel and channel, relative to the same denominator.
    pub largest: f64,
    /// The block that differs most.
    pub worst_block: WorstBlock,
}

/// The block of 16 × 16 pixels whose mean differs most, in one channel, relative to the
/// reference's (of which at least 5 % of the whole image's mean is assumed).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct WorstBlock {
    /// Its left column.
    pub x: usize,
    /// Its top row.
    pub y: usize,
    /// Relative difference, signed.
    pub difference: f64,
}

/// Why two images cannot be compared.
#[derive(Debug, Clone, PartialEq)]
pub enum CompareError {
    /// Their sizes differ.
    Size([usize; 2], [usize; 2]),
    /// A pixel of the image (`false`) or the reference (`true`) is not a finite number.
    NotFinite(bool, usize, usize),
    /// The reference is black.
    Black,
}

impl core::fmt::Display for CompareError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Size(a, b) => write!(f, "sizes differ: {} x {} and {} x {}", a[0], a[1], b[0], b[1]),
            Self::NotFinite(is_reference, x, y) => {
                let which = if *is_reference { "reference" } else { "image" };
                write!(f, "pixel ({x}, {y}) of the {which} is not a finite number")
            }
            Self::Black => f.write_str("the reference has no light in it"),
        }
    }
}

impl core::error::Error for CompareError {}

/// Compares an image with a reference.
///
/// # Errors
/// Sizes that differ, pixels that are not finite, a black reference.
pub fn compare(image: &Picture, reference: &Picture) -> Result<Comparison, CompareError> {
    let denominators = denominators(image, reference)?;
    let (mut sum, mut bias, mut total, mut largest) = (0.0, 0.0, 0.0, 0.0_f64);
    for ((i, r), den) in image.pixels.iter().zip(&reference.pixels).zip(&denominators) {
        for channel in 0..3 {
            let difference = f64::from(i[channel]) - f64::from(r[channel]);
            let square = difference * difference / den[channel];
            sum += square;
            largest = largest.max(square);
            bias += difference;
            total += f64::from(r[channel]);
        }
    }
    let count = (3 * image.pixels.len()) as f64;
    let rel_mse = sum / count;
    Ok(Comparison {
        rel_mse,
        rel_rmse: rel_mse.sqrt(),
        bias: bias / total,
        largest: largest.sqrt(),
        worst_block: worst_block(image, reference, total / count),
    })
}

/// A picture of the difference: red where the image is too bright, blue where it is too dark, by
/// the mean of the channels; full colour at `range` times the smoothed reference.
///
/// # Errors
/// As [`compare`].
pub fn false_colour(image: &Picture, reference: &Picture, range: f64) -> Result<Image, CompareError> {
    let denominators = denominators(image, reference)?;
    let colour = |((i, r), den): ((&[f32; 3], &[f32; 3]), &[f64; 3])| {
        let difference: f64 = (0..3).map(|c| (f64::from(i[c]) - f64::from(r[c])) / den[c].sqrt()).sum::<f64>() / 3.0;
        let strength = (difference / range).clamp(-1.0, 1.0) as f32;
        let rest = 1.0 - strength.abs();
        if strength > 0.0 { Spectrum::new(1.0, rest, rest) } else { Spectrum::new(rest, rest, 1.0) }
    };
    let pixels = image.pixels.iter().zip(&reference.pixels).zip(&denominators).map(colour).collect();
    Ok(Image { width: image.width as u32, height: image.height as u32, pixels })
}

fn denominators(image: &Picture, reference: &Picture) -> Result<Vec<[f64; 3]>, CompareError> {
    let (a, b) = ([image.width, image.height], [reference.width, reference.height]);
    if a != b || image.pixels.len() != reference.pixels.len() {
        return Err(CompareError::Size(a, b));
    }
    for (picture, is_reference) in [(image, false), (reference, true)] {
        if let Some(at) = picture.pixels.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
            return Err(CompareError::NotFinite(is_reference, at % a[0], at / a[0]));
        }
    }
    let total: f64 = reference.pixels.iter().flatten().map(|c| f64::from(*c)).sum();
    if !(total > 0.0) {
        return Err(CompareError::Black);
    }
    let floor = 0.01 * (total / (3 * reference.pixels.len()) as f64).powi(2);
    Ok(smooth(reference).into_iter().map(|p| p.map(|c| c * c + floor)).collect())
}

/// The mean over 5 × 5 pixels, with the border repeated.
pub(crate) fn smooth(picture: &Picture) -> Vec<[f64; 3]> {
    let (width, height) = (picture.width as isize, picture.height as isize);
    let mut smoothed = Vec::with_capacity(picture.pixels.len());
    for y in 0..height {
        for x in 0..width {
            let mut sum = [0.0; 3];
            for dy in -2..=2 {
                let row = (y + dy).clamp(0, height - 1) * width;
                for dx in -2..=2 {
                    let pixel = picture.pixels[(row + (x + dx).clamp(0, width - 1)) as usize];
                    for channel in 0..3 {
                        sum[channel] += f64::from(pixel[channel]);
                    }
                }
            }
            smoothed.push(sum.map(|s| s / 25.0));
        }
    }
    smoothed
}

fn worst_block(image: &Picture, reference: &Picture, mean: f64) -> WorstBlock {
    let mut worst = WorstBlock::default();
    for top in (0..image.height).step_by(BLOCK) {
        for left in (0..image.width).step_by(BLOCK) {
            let (mut a, mut b, mut count) = ([0.0; 3], [0.0; 3], 0.0);
            for y in top..(top + BLOCK).min(image.height) {
                for x in left..(left + BLOCK).min(image.width) {
                    let at = y * image.width + x;
                    for channel in 0..3 {
                        a[channel] += f64::from(image.pixels[at][channel]);
                        b[channel] += f64::from(reference.pixels[at][channel]);
                    }
                    count += 1.0;
                }
            }
            for channel in 0..3 {
                let difference = (a[channel] - b[channel]) / b[channel].max(0.05 * mean * count);
                if difference.abs() > worst.difference.abs() {
                    worst = WorstBlock { x: left, y: top, difference };
                }
            }
        }
    }
    worst
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(width: usize, height: usize, value: impl Fn(usize, usize) -> f32) -> Picture {
        let pixels = (0..width * height).map(|i| [value(i % width, i / width); 3]).collect();
        Picture { width, height, pixels }
    }

    #[test]
    fn equal_images_do_not_differ() {
        let a = grey(20, 33, |x, y| (x + y) as f32);
        let result = compare(&a, &a).unwrap();
        assert_eq!((result.rel_mse, result.bias, result.worst_block.difference), (0.0, 0.0, 0.0));
    }

    #[test]
    fn a_tenth_brighter_is_a_bias_of_a_tenth() {
        let (a, b) = (grey(32, 32, |_, _| 1.1), grey(32, 32, |_, _| 1.0));
        let result = compare(&a, &b).unwrap();
        assert!((result.bias - 0.1).abs() < 1e-6);
        // The floor of the denominator adds 1 %.
        assert!((result.rel_mse - 0.01 / 1.01).abs() < 1e-6);
    }

    #[test]
    fn the_worst_block_is_found() {
        let b = grey(64, 64, |_, _| 1.0);
        let a = grey(64, 64, |x, y| if (16..32).contains(&x) && (48..64).contains(&y) { 0.5 } else { 1.0 });
        let worst = compare(&a, &b).unwrap().worst_block;
        assert_eq!((worst.x, worst.y), (16, 48));
        assert!((worst.difference + 0.5).abs() < 1e-9);
    }

    #[test]
    fn too_bright_is_red_and_too_dark_is_blue() {
        let b = grey(2, 1, |_, _| 1.0);
        let a = grey(2, 1, |x, _| if x == 0 { 9.0 } else { 0.0 });
        let pixels = false_colour(&a, &b, 0.5).unwrap().pixels;
        assert_eq!(pixels, [Spectrum::new(1.0, 0.0, 0.0), Spectrum::new(0.0, 0.0, 1.0)]);
    }

    #[test]
    fn what_cannot_be_compared_is_an_error() {
        let (a, b) = (grey(4, 4, |_, _| 1.0), grey(4, 5, |_, _| 1.0));
        assert_eq!(compare(&a, &b).unwrap_err(), CompareError::Size([4, 4], [4, 5]));
        let broken = grey(4, 4, |x, y| if (x, y) == (2, 1) { f32::NAN } else { 1.0 });
        assert_eq!(compare(&a, &broken).unwrap_err(), CompareError::NotFinite(true, 2, 1));
        assert_eq!(compare(&a, &grey(4, 4, |_, _| 0.0)).unwrap_err(), CompareError::Black);
    }
}
