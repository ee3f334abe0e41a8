//! Running sums per pixel, in named layers, and the pictures made of them.

use core::fmt;

use fogbow::picture::{PixelSum, accumulate};
use fogbow::spectrum::Spectrum;

/// Number of pixels beyond which no picture is made.
pub const MAX_PIXELS: u64 = 1 << 28;

/// A picture: `width × height` colours, row 0 at the top.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Colours, row by row from the top, each from the left.
    pub pixels: Vec<Spectrum>,
}

impl Image {
    /// A picture all of one colour.
    ///
    /// # Errors
    /// A size of zero or beyond [`MAX_PIXELS`].
    pub fn new(width: u32, height: u32, colour: Spectrum) -> Result<Self, SizeError> {
        let count = pixel_count(width, height)?;
        let mut pixels = Vec::new();
        pixels.try_reserve_exact(count).map_err(|_| SizeError::Memory)?;
        pixels.resize(count, colour);
        Ok(Self { width, height, pixels })
    }

    /// The colour at column `x` of row `y`, or `None` outside.
    #[must_use]
    pub fn get(&self, x: u32, y: u32) -> Option<Spectrum> {
        if x >= self.width {
            return None;
        }
        self.pixels.get(y as usize * self.width as usize + x as usize).copied()
    }
}

/// Number of pixels of a picture of this size.
pub(crate) fn pixel_count(width: u32, height: u32) -> Result<usize, SizeError> {
    match u64::from(width) * u64::from(height) {
        0 => Err(SizeError::Empty),
        count if count > MAX_PIXELS => Err(SizeError::TooLarge),
        count => usize::try_from(count).map_err(|_| SizeError::TooLarge),
    }
}

/// Why a film or a picture cannot be made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SizeError {
    /// Width or height is zero.
    Empty,
    /// More than [`MAX_PIXELS`].
    TooLarge,
    /// There is no memory for it.
    Memory,
    /// A film without layers.
    NoLayers,
    /// A layer of a film without a name, or two of one name: a file could not tell them apart.
    LayerNames,
}

impl fmt::Display for SizeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Empty => "the picture's width or height is zero",
            Self::TooLarge => "the picture has more than 2^28 pixels",
            Self::Memory => "there is no memory for the picture",
            Self::NoLayers => "the film has no layers",
            Self::LayerNames => "a layer of the film has no name, or that of another",
        })
    }
}

impl core::error::Error for SizeError {}

/// Sums of samples, in named layers. Layer 0 is the picture, the others whatever the host splits it into.
///
/// Sums are exact ([`PixelSum`]), so a pixel may take millions of samples, in any order; each pixel has its own count, so a
/// film stopped half-way is still a valid picture.
///
/// ```
/// use fogbow::spectrum::Spectrum;
/// use fogbow_std::film::Film;
/// let mut film = Film::new(2, 1, &["total", "emitted"]).unwrap();
/// film.add(0, 0, &[Spectrum::splat(1.0), Spectrum::ZERO]);
/// film.add(0, 0, &[Spectrum::splat(3.0), Spectrum::ONE]);
/// assert_eq!(film.mean(0).unwrap().pixels, [Spectrum::splat(2.0), Spectrum::ZERO]);
/// assert_eq!(film.mean(1).unwrap().pixels[0], Spectrum::splat(0.5));
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Film {
    width: u32,
    height: u32,
    names: Vec<String>,
    /// Pixel by pixel, within each layer by layer.
    sums: Vec<PixelSum>,
    counts: Vec<u32>,
}

impl Film {
    /// An empty film; `layers` are their names, the first being the picture's.
    ///
    /// # Errors
    /// A size of zero or beyond [`MAX_PIXELS`], no layers, layers without a name of their own, no memory.
    pub fn new<N: AsRef<str>>(width: u32, height: u32, layers: &[N]) -> Result<Self, SizeError> {
        let count = pixel_count(width, height)?;
        let total = match layers.len() {
            0 => return Err(SizeError::NoLayers),
            n => count.checked_mul(n).ok_or(SizeError::TooLarge)?,
        };
        let names: Vec<String> = layers.iter().map(|n| n.as_ref().to_owned()).collect();
        if names.iter().enumerate().any(|(i, name)| name.is_empty() || names[..i].contains(name)) {
            return Err(SizeError::LayerNames);
        }
        let (mut sums, mut counts) = (Vec::new(), Vec::new());
        sums.try_reserve_exact(total).map_err(|_| SizeError::Memory)?;
        counts.try_reserve_exact(count).map_err(|_| SizeError::Memory)?;
        sums.resize(total, PixelSum::ZERO);
        counts.resize(count, 0);
        Ok(Self { width, height, names, sums, counts })
    }

    /// Columns.
    #[must_use]
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Rows.
    #[must_use]
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Names of the layers.
    #[must_use]
    pub fn layers(&self) -> &[String] {
        &self.names
    }

    /// Bytes of memory used for sums and counts.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(self.sums.as_slice()) + size_of_val(self.counts.as_slice())
    }

    /// Samples of the pixel at column `x` of row `y`; 0 outside.
    #[must_use]
    pub fn count(&self, x: u32, y: u32) -> u32 {
        self.index(x, y).map_or(0, |i| self.counts[i])
    }

    /// The smallest number of samples any pixel has.
    #[must_use]
    pub fn min_count(&self) -> u32 {
        self.counts.iter().copied().min().unwrap_or(0)
    }

    /// Samples of all pixels together.
    #[must_use]
    pub fn total_count(&self) -> u64 {
        self.counts.iter().map(|&n| u64::from(n)).sum()
    }

    /// Adds one sample to the pixel at column `x` of row `y`: a colour per layer (missing ones are
    /// black). One that is no finite number counts as black, see [`accumulate`]. Outside the film nothing happens.
    pub fn add(&mut self, x: u32, y: u32, colours: &[Spectrum]) {
        if let Some(i) = self.index(x, y) {
            let layers = self.names.len();
            accumulate(&mut self.sums[i * layers..][..layers], colours);
            self.counts[i] = self.counts[i].saturating_add(1);
        }
    }

    /// Forgets all samples.
    pub fn clear(&mut self) {
        self.sums.fill(PixelSum::ZERO);
        self.counts.fill(0);
    }

    /// The mean of a layer's samples (black where there are none), or `None` if there is no such layer.
    #[must_use]
    pub fn mean(&self, layer: usize) -> Option<Image> {
        let layers = self.names.len();
        if layer >= layers {
            return None;
        }
        let all = self.sums.chunks_exact(layers).zip(&self.counts);
        let pixels = all.map(|(sums, count)| sums[layer].mean(*count)).collect();
        Some(Image { width: self.width, height: self.height, pixels })
    }

    /// The same picture with its first `layers` layers alone.
    ///
    /// # Errors
    /// [`SizeError::NoLayers`] for none, [`SizeError::Memory`].
    pub fn first(&self, layers: usize) -> Result<Self, SizeError> {
        let names = &self.names[..layers.min(self.names.len())];
        let mut film = Self::new(self.width, self.height, names)?;
        let kept = names.len();
        for (to, from) in film.sums.chunks_exact_mut(kept).zip(self.sums.chunks_exact(self.names.len())) {
            to.copy_from_slice(&from[..kept]);
        }
        film.counts.copy_from_slice(&self.counts);
        Ok(film)
    }

    /// Takes sums and counts out, to be added to elsewhere; [`Film::replace`] puts them back.
    pub(crate) fn take(&mut self) -> (Vec<PixelSum>, Vec<u32>) {
        (core::mem::take(&mut self.sums), core::mem::take(&mut self.counts))
    }

    /// Takes sums and numbers of samples of a picture of the same size and layers, as [`fogbow::picture::Tiles::into_sums`] gives them.
    ///
    /// # Panics
    /// If there are not as many as the size says.
    pub fn replace(&mut self, (sums, counts): (Vec<PixelSum>, Vec<u32>)) {
        let count = self.width as usize * self.height as usize;
        assert!((sums.len(), counts.len()) == (count * self.names.len(), count), "sums of another picture");
        (self.sums, self.counts) = (sums, counts);
    }

    fn index(&self, x: u32, y: u32) -> Option<usize> {
        (x < self.width && y < self.height).then(|| y as usize * self.width as usize + x as usize)
    }
}
