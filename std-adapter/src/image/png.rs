//! PNG: 8 bits per channel in sRGB, to look at.

use crate::film::Image;
use crate::image::ErrorKind;

/// The bytes of a PNG file; colours are multiplied by 2 to the power of `exposure`, then cut to [0, 1].
///
/// # Errors
/// What the encoder says: sizes beyond the format's.
pub fn encode(image: &Image, exposure: f32) -> Result<Vec<u8>, ErrorKind> {
    let gain = exposure.exp2();
    let samples: Vec<u8> = image.pixels.iter().flat_map(|p| p.0).map(|value| srgb(value * gain)).collect();
    let mut bytes = Vec::new();
    let mut encoder = ::png::Encoder::new(&mut bytes, image.width, image.height);
    encoder.set_color(::png::ColorType::Rgb);
    encoder.set_depth(::png::BitDepth::Eight);
    encoder.set_source_srgb(::png::SrgbRenderingIntent::RelativeColorimetric);
    let format = |error: ::png::EncodingError| ErrorKind::Format(error.to_string());
    let mut writer = encoder.write_header().map_err(format)?;
    writer.write_image_data(&samples).map_err(format)?;
    writer.finish().map_err(format)?;
    Ok(bytes)
}

/// Transfer function of sRGB (IEC 61966-2-1), rounded to 8 bits; NaN is black.
fn srgb(linear: f32) -> u8 {
    let encoded = if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    // The cast cuts what lies outside and makes NaN 0.
    (encoded * 255.0 + 0.5) as u8
}
