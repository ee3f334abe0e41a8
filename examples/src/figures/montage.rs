//! Pictures made of pictures.

use std::path::Path;

use fogbow::spectrum::Spectrum;
use fogbow_std::film::Image;
use fogbow_std::image::{Layer, write};

use crate::cli::Failure;

/// Between pictures (pixels).
const GAP: u32 = 4;

const PAPER: Spectrum = Spectrum([1.0; 3]);

/// Part of a picture, from the top left corner; what lies outside is white.
pub(super) fn crop(image: &Image, [x0, y0]: [u32; 2], [width, height]: [u32; 2]) -> Result<Image, Failure> {
    made(width, height, |x, y| image.get(x0 + x, y0 + y).unwrap_or(PAPER))
}

/// Every pixel as a square.
pub(super) fn enlarged(image: &Image, by: u32) -> Result<Image, Failure> {
    made(image.width * by, image.height * by, |x, y| image.get(x / by, y / by).unwrap_or(PAPER))
}

/// The same, brighter.
pub(super) fn brightened(image: &Image, by: f32) -> Image {
    let mut image = image.clone();
    image.pixels.iter_mut().for_each(|pixel| *pixel *= by);
    image
}

/// From left to right.
pub(super) fn beside(images: &[Image]) -> Result<Image, Failure> {
    let gaps = GAP * (images.len().max(1) as u32 - 1);
    let width = images.iter().map(|i| i.width).sum::<u32>() + gaps;
    let mut canvas = Image::new(width, images.iter().map(|i| i.height).max().unwrap_or(1), PAPER)?;
    let mut x = 0;
    for image in images {
        paste(&mut canvas, image, x, 0);
        x += image.width + GAP;
    }
    Ok(canvas)
}

/// From top to bottom.
pub(super) fn above(images: &[Image]) -> Result<Image, Failure> {
    let gaps = GAP * (images.len().max(1) as u32 - 1);
    let height = images.iter().map(|i| i.height).sum::<u32>() + gaps;
    let mut canvas = Image::new(images.iter().map(|i| i.width).max().unwrap_or(1), height, PAPER)?;
    let mut y = 0;
    for image in images {
        paste(&mut canvas, image, 0, y);
        y += image.height + GAP;
    }
    Ok(canvas)
}

/// A picture from a function of its pixels.
pub(super) fn made(width: u32, height: u32, pixel: impl Fn(u32, u32) -> Spectrum) -> Result<Image, Failure> {
    let mut image = Image::new(width, height, PAPER)?;
    let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    for (to, (x, y)) in image.pixels.iter_mut().zip(places) {
        *to = pixel(x, y);
    }
    Ok(image)
}

/// Draws the outline of a rectangle.
pub(super) fn frame(image: &mut Image, [x0, y0]: [u32; 2], [width, height]: [u32; 2]) {
    for x in x0..x0 + width {
        set(image, x, y0, Spectrum::new(1.0, 0.7, 0.0));
        set(image, x, y0 + height - 1, Spectrum::new(1.0, 0.7, 0.0));
    }
    for y in y0..y0 + height {
        set(image, x0, y, Spectrum::new(1.0, 0.7, 0.0));
        set(image, x0 + width - 1, y, Spectrum::new(1.0, 0.7, 0.0));
    }
}

/// Changes one pixel, if there is one.
pub(super) fn set(image: &mut Image, x: u32, y: u32, colour: Spectrum) {
    if x < image.width
        && y < image.height
        && let Some(pixel) = image.pixels.get_mut((y * image.width + x) as usize)
    {
        *pixel = colour;
    }
}

fn paste(canvas: &mut Image, image: &Image, x0: u32, y0: u32) {
    for y in 0..image.height {
        for x in 0..image.width {
            if let Some(colour) = image.get(x, y) {
                set(canvas, x0 + x, y0 + y, colour);
            }
        }
    }
}

/// Writes a picture, brightened by `stops`.
pub(super) fn save(file: &Path, image: &Image, stops: f32) -> Result<(), Failure> {
    Ok(write(file, &[Layer { name: "picture", image }], stops)?)
}
