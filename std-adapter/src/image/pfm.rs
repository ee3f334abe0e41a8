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
