//! Picture files, chosen by extension: PNG to look at, PFM and OpenEXR to measure.

#[cfg(feature = "exr")]
pub mod exr;
pub mod pfm;
pub mod png;

use core::fmt;
use std::path::Path;

use crate::files::{self, FileError, Problem};
use crate::film::{Film, Image, SizeError, pixel_count};

/// A picture with a name.
#[derive(Debug, Clone, Copy)]
pub struct Layer<'a> {
    /// Name in the file; the first layer's is not used.
    pub name: &'a str,
    /// The picture.
    pub image: &'a Image,
}

/// What is wrong with a picture file.
pub type ImageError = FileError<ErrorKind>;

/// What is wrong with a picture or its bytes.
#[derive(Debug)]
#[non_exhaustive]
pub enum ErrorKind {
    /// The extension is none of these known ones.
    Extension(&'static [&'static str]),
    /// No layers to write, layers of different sizes, or fewer pixels than the size says.
    Layers,
    /// An impossible size.
    Size(SizeError),
    /// The bytes are no picture of this format, or a damaged one; in what way.
    Format(String),
}

impl fmt::Display for ErrorKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Extension(known) => write!(f, "the extension is none of {}", known.join(", ")),
            Self::Layers => f.write_str("no layers, or layers that differ in size"),
            Self::Size(error) => error.fmt(f),
            Self::Format(what) => f.write_str(what),
        }
    }
}

impl core::error::Error for ErrorKind {}

impl From<SizeError> for ErrorKind {
    fn from(error: SizeError) -> Self {
        Self::Size(error)
    }
}

/// Extensions that [`write`](fn@write) knows.
pub const WRITABLE: &[&str] = if cfg!(feature = "exr") { &["png", "pfm", "exr"] } else { &["png", "pfm"] };

/// Extensions that [`read`] knows.
pub const READABLE: &[&str] = if cfg!(feature = "exr") { &["pfm", "exr"] } else { &["pfm"] };

fn extension(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default()
}

/// Whether [`write`](fn@write) knows the file's extension: a question to ask before a long render.
#[must_use]
pub fn is_writable(path: impl AsRef<Path>) -> bool {
    WRITABLE.contains(&extension(path.as_ref()).as_str())
}

/// Writes layers of one size to a file in the format of its extension.
///
/// PNG (8-bit sRGB after `exposure` stops) and PFM take the first layer, OpenEXR all of them: the
/// first as channels `R`, `G`, `B`, the others as `name.R` and so on. The measuring formats ignore
/// `exposure`. The file that was there is lost only when the new one is complete.
///
/// # Errors
/// An unknown extension, no layers or different sizes, or what the system says.
///
/// ```
/// use fogbow::spectrum::Spectrum;
/// use fogbow_std::{film::Image, image::{Layer, read, write}};
/// let image = Image::new(4, 3, Spectrum::splat(0.5))?;
/// let file = std::env::temp_dir().join("fogbow-std-write.pfm");
/// write(&file, &[Layer { name: "total", image: &image }], 0.0)?;
/// assert_eq!(read(&file)?, image);
/// # std::fs::remove_file(&file)?;
///
/// let error = write("picture.jpeg", &[Layer { name: "total", image: &image }], 0.0).unwrap_err();
/// assert!(error.to_string().starts_with("picture.jpeg: the extension is none of png, pfm"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write(path: impl AsRef<Path>, layers: &[Layer<'_>], exposure: f32) -> Result<(), ImageError> {
    let path = path.as_ref();
    let bytes = encode(&extension(path), layers, exposure).map_err(|kind| Problem::Content(kind).of(path))?;
    files::save(path, &bytes)
}

/// Writes the means of a film's layers, as [`write`](fn@write).
///
/// # Errors
/// As [`write`](fn@write).
pub fn write_film(path: impl AsRef<Path>, film: &Film, exposure: f32) -> Result<(), ImageError> {
    let images: Vec<_> = (0..film.layers().len()).filter_map(|i| film.mean(i)).collect();
    let layers: Vec<_> = film.layers().iter().zip(&images).map(|(name, image)| Layer { name, image }).collect();
    write(path, &layers, exposure)
}

fn encode(extension: &str, layers: &[Layer<'_>], exposure: f32) -> Result<Vec<u8>, ErrorKind> {
    let Some(first) = layers.first() else { return Err(ErrorKind::Layers) };
    let (width, height) = (first.image.width, first.image.height);
    let count = pixel_count(width, height)?;
    let fits =
        |layer: &Layer<'_>| (layer.image.width, layer.image.height, layer.image.pixels.len()) == (width, height, count);
    if !layers.iter().all(fits) {
        return Err(ErrorKind::Layers);
    }
    match extension {
        "png" => png::encode(first.image, exposure),
        "pfm" => Ok(pfm::encode(first.image)),
        #[cfg(feature = "exr")]
        "exr" => exr::encode(layers),
        _ => Err(ErrorKind::Extension(WRITABLE)),
    }
}

/// Reads a picture file in the format of its extension: PFM (grey or colour), or OpenEXR (the
/// channels `R`, `G`, `B`, or `Y` alone).
///
/// # Errors
/// An unknown extension, what the system says, or what is wrong with the bytes.
pub fn read(path: impl AsRef<Path>) -> Result<Image, ImageError> {
    let path = path.as_ref();
    let decode: fn(&[u8]) -> Result<Image, ErrorKind> = match extension(path).as_str() {
        "pfm" => pfm::decode,
        #[cfg(feature = "exr")]
        "exr" => exr::decode,
        _ => return Err(Problem::Content(ErrorKind::Extension(READABLE)).of(path)),
    };
    files::load(path, decode)
}
