//! PFM files.

use fogbow::spectrum::Spectrum;
use fogbow_std::film::Image;
use fogbow_std::image::pfm::{decode, encode};

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
    let bad = ["", "PF", "P6\n1 1\n-1\n", "PF\n0 5\n-1\n", "PF\n4294967295 4294967295\n-1\n", "PF\n9999 9999\n-1\n"];
    let more =
        ["PF\n-1 1\n-1\n", "PF\n1 1\n0\n....", "PF\n1 1\nNaN\n............", "PF\n1e3 1\n-1\n", "PF 1 1 \u{fffd} "];
    for text in bad.into_iter().chain(more) {
        assert!(decode(text.as_bytes()).is_err(), "{text}");
    }
}
