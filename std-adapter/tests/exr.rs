//! OpenEXR files.

use std::io::Cursor;

use ::exr::meta::MetaData;
use fogbow::spectrum::Spectrum;
use fogbow_std::film::Image;
use fogbow_std::image::Layer;
use fogbow_std::image::exr::{decode, encode};

fn image(width: u32, height: u32) -> Image {
    let pixels = (0..width * height).map(|i| Spectrum::new(i as f32, -0.1 * i as f32, 1e-30)).collect();
    Image { width, height, pixels }
}

#[test]
fn what_is_written_is_read_to_the_bit() {
    let (main, other) = (image(37, 21), Image::new(37, 21, Spectrum::ONE).unwrap());
    let layers = [Layer { name: "total", image: &main }, Layer { name: "emitted", image: &other }];
    assert_eq!(decode(&encode(&layers).unwrap()).unwrap(), main);
}

#[test]
fn other_layers_keep_their_names() {
    let image = image(2, 2);
    let layers = ["a", "b"].map(|name| Layer { name, image: &image });
    let bytes = encode(&layers).unwrap();
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).unwrap();
    let names: Vec<_> = meta.headers[0].channels.list.iter().map(|c| c.name.to_string()).collect();
    assert_eq!(names, ["B", "G", "R", "b.B", "b.G", "b.R"]);
}

#[test]
fn damaged_files_neither_panic_nor_allocate_what_they_claim() {
    let image = image(19, 35);
    let whole = encode(&[Layer { name: "", image: &image }]).unwrap();
    for end in 0..whole.len() {
        assert!(decode(&whole[..end]).is_err(), "cut at {end}");
    }
    // Every byte of the header and some of the pixels, changed in several ways: any answer will do.
    for at in (0..whole.len().min(700)).chain((700..whole.len()).step_by(23)) {
        for flip in [0x01, 0x80, 0xff] {
            let mut bytes = whole.clone();
            bytes[at] ^= flip;
            drop(decode(&bytes));
        }
    }
}
