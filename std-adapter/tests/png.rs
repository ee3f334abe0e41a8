//! PNG files.

use fogbow::spectrum::Spectrum;
use fogbow_std::film::Image;
use fogbow_std::image::png::encode;

/// What a decoder of the crate `png` finds of a grey picture of one pixel.
fn srgb(linear: f32) -> u8 {
    let bytes = encode(&Image { width: 1, height: 1, pixels: vec![Spectrum::splat(linear)] }, 0.0).unwrap();
    let mut reader = ::png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
    let mut samples = [0; 3];
    reader.next_frame(&mut samples).unwrap();
    assert_eq!(samples, [samples[0]; 3]);
    samples[0]
}

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
