//! Images to be read: environments, and results to be compared.

use std::io::Cursor;
use std::path::Path;

use fogbow_std::film::Image;
use fogbow_std::image::ErrorKind;

use crate::error::{DataError, read_file};

/// Linear RGB, row by row from the top.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// `width × height` pixels.
    pub pixels: Vec<[f32; 3]>,
}

/// Most pixels of an image.
const MAX_PIXELS: u64 = 1 << 28;

impl Picture {
    /// Reads an image: `.exr`, `.pfm`, `.hdr`, `.npy` (f32 or f64, height × width × channels) as they
    /// are, `.png`, `.jpg`, `.bmp` and `.tga` with the sRGB curve undone.
    ///
    /// # Errors
    /// A file that is missing or broken, or of another kind.
    pub fn read(file: &Path) -> Result<Self, DataError> {
        Self::read_as(file, false)
    }

    /// The same, but all kinds as they are.
    ///
    /// # Errors
    /// As [`Picture::read`].
    pub fn read_raw(file: &Path) -> Result<Self, DataError> {
        Self::read_as(file, true)
    }

    fn read_as(file: &Path, is_raw: bool) -> Result<Self, DataError> {
        let extension = file.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        let known = ["exr", "pfm", "hdr", "png", "jpg", "jpeg", "bmp", "tga", "npy"];
        if !known.contains(&extension.as_str()) {
            return Err(DataError::new(file, "", format!("unknown kind of image; known are .{}", known.join(", ."))));
        }
        Self::decode(file, &extension, &read_file(file)?, is_raw)
    }

    /// Reads the bytes of an image with the given extension.
    ///
    /// # Errors
    /// As [`Picture::read`].
    pub fn from_bytes(file: &Path, extension: &str, bytes: &[u8]) -> Result<Self, DataError> {
        Self::decode(file, extension, bytes, false)
    }

    /// The same, but as they are.
    ///
    /// # Errors
    /// As [`Picture::read`].
    pub fn from_raw_bytes(file: &Path, extension: &str, bytes: &[u8]) -> Result<Self, DataError> {
        Self::decode(file, extension, bytes, true)
    }

    /// How opaque the pixels of a PNG image are, in all three channels; 1 where it does not say.
    ///
    /// # Errors
    /// As [`Picture::read`].
    pub fn opacity_from_png(file: &Path, bytes: &[u8]) -> Result<Self, DataError> {
        let image = decoded(bytes, image::ImageFormat::Png).map_err(|reason| DataError::new(file, "", reason))?;
        let rgba = image.into_rgba32f();
        let (width, height) = (rgba.width() as usize, rgba.height() as usize);
        Ok(Self { width, height, pixels: rgba.pixels().map(|p| [p.0[3]; 3]).collect() })
    }

    fn decode(file: &Path, extension: &str, bytes: &[u8], is_raw: bool) -> Result<Self, DataError> {
        let picture = match extension {
            "exr" => read_with_adapter(fogbow_std::image::exr::decode, bytes),
            "pfm" => read_with_adapter(fogbow_std::image::pfm::decode, bytes),
            "npy" => read_npy(bytes),
            "hdr" => read_with_image(bytes, image::ImageFormat::Hdr, true),
            "png" => read_with_image(bytes, image::ImageFormat::Png, is_raw),
            "jpg" | "jpeg" => read_with_image(bytes, image::ImageFormat::Jpeg, is_raw),
            "bmp" => read_with_image(bytes, image::ImageFormat::Bmp, is_raw),
            "tga" => read_with_image(bytes, image::ImageFormat::Tga, is_raw),
            _ => Err("unknown kind of image".to_owned()),
        };
        let picture = picture.map_err(|reason| DataError::new(file, "", reason))?;
        if picture.pixels.is_empty() || picture.width.checked_mul(picture.height) != Some(picture.pixels.len()) {
            return Err(DataError::new(file, "", "has no pixels"));
        }
        Ok(picture)
    }
}

fn check_size(width: u64, height: u64) -> Result<(), String> {
    match width.checked_mul(height) {
        Some(1..=MAX_PIXELS) => Ok(()),
        _ => Err(format!("{width} x {height} pixels is not a size that is read")),
    }
}

/// OpenEXR and PFM are what the adapter writes; it reads them too.
fn read_with_adapter(decode: fn(&[u8]) -> Result<Image, ErrorKind>, bytes: &[u8]) -> Result<Picture, String> {
    let image = decode(bytes).map_err(|e| e.to_string())?;
    Ok(Picture {
        width: image.width as usize,
        height: image.height as usize,
        pixels: image.pixels.iter().map(|colour| colour.0).collect(),
    })
}

fn read_with_image(bytes: &[u8], format: image::ImageFormat, is_linear: bool) -> Result<Picture, String> {
    let rgb = decoded(bytes, format)?.into_rgb32f();
    let (width, height) = (rgb.width() as usize, rgb.height() as usize);
    let curve = |c: f32| if is_linear { c } else { linear(c) };
    Ok(Picture { width, height, pixels: rgb.pixels().map(|p| p.0.map(curve)).collect() })
}

fn decoded(bytes: &[u8], format: image::ImageFormat) -> Result<image::DynamicImage, String> {
    let mut reader = image::ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(1 << 16);
    limits.max_image_height = Some(1 << 16);
    reader.limits(limits);
    let decoded = reader.decode().map_err(|e| format!("is not a usable image: {e}"))?;
    check_size(u64::from(decoded.width()), u64::from(decoded.height()))?;
    Ok(decoded)
}

/// Undoes the sRGB curve.
fn linear(c: f32) -> f32 {
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

fn floats(bytes: &[u8], count: u64) -> Result<Vec<f32>, String> {
    if bytes.len() as u64 != count * 4 {
        return Err(format!("{} bytes of values are due, but {} follow", count * 4, bytes.len()));
    }
    Ok(bytes.as_chunks::<4>().0.iter().map(|word| f32::from_le_bytes(*word)).collect())
}

fn from_values(width: usize, height: usize, channels: usize, values: &[f32]) -> Picture {
    let pixel = |v: &[f32]| match *v {
        [r, g, b, ..] => [r, g, b],
        [grey, ..] => [grey; 3],
        [] => [0.0; 3],
    };
    Picture { width, height, pixels: values.chunks(channels.max(1)).map(pixel).collect() }
}

/// NumPy's format, versions 1 to 3: C order, little-endian floats.
fn read_npy(bytes: &[u8]) -> Result<Picture, String> {
    let rest = bytes.strip_prefix(b"\x93NUMPY").ok_or("does not begin with the mark of NumPy")?;
    let (length, rest) = match rest {
        [1, _, a, b, tail @ ..] => (usize::from(u16::from_le_bytes([*a, *b])), tail),
        [2 | 3, _, a, b, c, d, tail @ ..] => (u32::from_le_bytes([*a, *b, *c, *d]) as usize, tail),
        _ => return Err("an unknown version of the format".to_owned()),
    };
    let (header, body) = rest.split_at_checked(length).ok_or("the header is cut off")?;
    let header = core::str::from_utf8(header).map_err(|_| "the header is not text")?;
    if header.contains("'fortran_order': True") {
        return Err("columns come before rows (Fortran order)".to_owned());
    }
    let shape = header.split_once("'shape': (").and_then(|(_, t)| t.split_once(')')).ok_or("the shape is missing")?.0;
    let shape: Vec<u64> = shape.split(',').filter_map(|n| n.trim().parse().ok()).collect();
    let (height, width, channels) = match shape[..] {
        [h, w] => (h, w, 1),
        [h, w, c @ (1 | 3 | 4)] => (h, w, c),
        _ => return Err(format!("shape {shape:?} is not that of an image")),
    };
    check_size(width, height)?;
    let count = width * height * channels;
    let values = if header.contains("'<f4'") {
        floats(body, count)?
    } else if header.contains("'<f8'") {
        if body.len() as u64 != count * 8 {
            return Err(format!("{} bytes of values are due, but {} follow", count * 8, body.len()));
        }
        body.as_chunks::<8>().0.iter().map(|word| f64::from_le_bytes(*word) as f32).collect()
    } else {
        return Err("values are neither <f4 nor <f8".to_owned());
    };
    Ok(from_values(width as usize, height as usize, channels as usize, &values))
}
