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

#[cfg(test)]
mod tests {
    use super::*;
    use fogbow::spectrum::Spectrum;

    #[test]
    fn known_values_of_srgb() {
        let known = [(0.0, 0), (1.0, 255), (0.5, 188), (0.214_041_14, 128), (0.002, 7), (7.0, 255), (-1.0, 0)];
        for (linear, expected) in known {
            assert_eq!(srgb(linear), expected, "{linear}");
        }
        assert_eq!((srgb(f32::NAN), srgb(f32::INFINITY)), (0, 255));
    }

    #[test]
    fn a_decoder_reads_what_was_written() {
        let pixels = (0..6).map(|i| Spectrum::new(i as f32 / 5.0, 0.5, 2.0)).collect();
        let bytes = encode(&Image { width: 3, height: 2, pixels }, -1.0).unwrap();
        let mut reader = ::png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        assert!(reader.info().srgb.is_some());
        let mut samples = [0; 18];
        let info = reader.next_frame(&mut samples).unwrap();
        assert_eq!((info.width, info.height, info.color_type), (3, 2, ::png::ColorType::Rgb));
        assert_eq!(samples[..6], [0, 137, 255, 89, 137, 255]);
        assert_eq!(samples[15..], [188, 137, 255]);
    }
}
