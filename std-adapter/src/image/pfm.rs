//! PFM: a line of text, a line of size, a line of byte order, then floats from the bottom row up.

use fogbow::spectrum::Spectrum;

use crate::film::{Image, pixel_count};
use crate::image::ErrorKind;

/// The bytes of a colour PFM file, little endian.
#[must_use]
pub fn encode(image: &Image) -> Vec<u8> {
    let mut bytes = format!("PF\n{} {}\n-1.0\n", image.width, image.height).into_bytes();
    for row in image.pixels.chunks_exact(image.width.max(1) as usize).rev() {
        bytes.extend(row.iter().flat_map(|pixel| pixel.0).flat_map(f32::to_le_bytes));
    }
    bytes
}

/// Reads the bytes of a PFM file, colour (`PF`) or grey (`Pf`), of either byte order.
///
/// # Errors
/// What is wrong with the bytes.
pub fn decode(bytes: &[u8]) -> Result<Image, ErrorKind> {
    let wrong = |what: &str| ErrorKind::Format(format!("not a PFM file: {what}"));
    let mut rest = bytes;
    let channels = match word(&mut rest) {
        Some("PF") => 3,
        Some("Pf") => 1,
        _ => return Err(wrong("it does not begin with PF or Pf")),
    };
    let mut size = || word(&mut rest)?.parse::<u32>().ok();
    let (Some(width), Some(height)) = (size(), size()) else { return Err(wrong("it has no size")) };
    let count = pixel_count(width, height)?;
    let scale = word(&mut rest).and_then(|w| w.parse::<f32>().ok()).filter(|s| s.is_finite() && *s != 0.0);
    let Some(scale) = scale else { return Err(wrong("its byte order is no number but 0")) };
    // At most 2^28 pixels of 12 bytes: 64 bits on any target.
    let expected = count as u64 * channels as u64 * 4;
    if (rest.len() as u64) < expected {
        return Err(ErrorKind::Format(format!("the file is cut short: {} of {expected} bytes of pixels", rest.len())));
    }
    let value = |four: &[u8]| {
        let four = [four[0], four[1], four[2], four[3]];
        if scale < 0.0 { f32::from_le_bytes(four) } else { f32::from_be_bytes(four) }
    };
    let row_bytes = width as usize * channels * 4;
    let mut pixels = Vec::new();
    pixels.try_reserve_exact(count).map_err(|_| crate::film::SizeError::Memory)?;
    for row in rest[..expected as usize].chunks_exact(row_bytes).rev() {
        pixels.extend(row.chunks_exact(channels * 4).map(|pixel| {
            let channel = |i: usize| value(&pixel[4 * (i % channels)..]);
            Spectrum::new(channel(0), channel(1), channel(2))
        }));
    }
    Ok(Image { width, height, pixels })
}

/// The next word and the one white space behind it.
fn word<'b>(rest: &mut &'b [u8]) -> Option<&'b str> {
    // Numbers are short; what is longer is no header.
    let end = rest.iter().take(64).position(u8::is_ascii_whitespace)?;
    let (word, tail) = rest.split_at(end);
    *rest = &tail[1..];
    core::str::from_utf8(word).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image() -> Image {
        let pixels = (0..6).map(|i| Spectrum::new(i as f32, -0.1 * i as f32, 1e-30)).collect();
        Image { width: 3, height: 2, pixels }
    }

    #[test]
    fn what_is_written_is_read_to_the_bit() {
        assert_eq!(decode(&encode(&image())).unwrap(), image());
    }

    #[test]
    fn the_bottom_row_comes_first() {
        let bytes = encode(&image());
        assert_eq!(&bytes[..12], b"PF\n3 2\n-1.0\n");
        assert_eq!(bytes[12..16], 3.0_f32.to_le_bytes());
    }

    #[test]
    fn grey_and_big_endian_files_are_read() {
        let mut bytes = b"Pf\n1 2\n1.0\n".to_vec();
        bytes.extend([2.0_f32, 5.0].into_iter().flat_map(f32::to_be_bytes));
        assert_eq!(decode(&bytes).unwrap().pixels, [Spectrum::splat(5.0), Spectrum::splat(2.0)]);
    }

    #[test]
    fn damaged_files_are_errors() {
        let whole = encode(&image());
        for end in 0..whole.len() {
            assert!(decode(&whole[..end]).is_err(), "cut at {end}");
        }
        let bad =
            ["", "PF", "P6\n1 1\n-1\n", "PF\n0 5\n-1\n", "PF\n4294967295 4294967295\n-1\n", "PF\n9999 9999\n-1\n"];
        let more =
            ["PF\n-1 1\n-1\n", "PF\n1 1\n0\n....", "PF\n1 1\nNaN\n............", "PF\n1e3 1\n-1\n", "PF 1 1 \u{fffd} "];
        for text in bad.into_iter().chain(more) {
            assert!(decode(text.as_bytes()).is_err(), "{text}");
        }
    }
}
