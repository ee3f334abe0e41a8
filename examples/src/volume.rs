//! Mitsuba's grid volumes: `.vol`, version 3, one channel, `f32` or `u8`.

use std::io::Read;
use std::path::Path;

use fogbow::math::Vec3;

use crate::error::{DataError, read_file};
use crate::texture::Wrap;

/// Densities at the centres of the cells of a grid.
#[derive(Debug, Clone, PartialEq)]
pub struct Volume {
    /// Cells along x, y and z.
    pub size: [u32; 3],
    /// Values, x fastest, then y, then z.
    pub values: Values,
}

/// How densities are stored.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// As they are.
    F32(Vec<f32>),
    /// 0 to 255 stand for 0 to 1.
    U8(Vec<u8>),
}

/// Bytes before the values.
const HEADER: usize = 48;

/// The number of channels, and the box that a file names: both corners. What is wrong otherwise, reading tells.
///
/// # Errors
/// A file that is missing or too short.
pub fn peek(file: &Path) -> Result<(i32, [[f32; 3]; 2]), DataError> {
    let fail = |e: std::io::Error| DataError::new(file, "", format!("cannot be read: {e}"));
    let mut header = Vec::new();
    std::fs::File::open(file).map_err(fail)?.take(HEADER as u64).read_to_end(&mut header).map_err(fail)?;
    let words = header.as_chunks::<4>().0;
    let number = |at: usize| words.get(at).map_or(0.0, |word| f32::from_le_bytes(*word));
    let channels = words.get(5).map_or(1, |word| i32::from_le_bytes(*word));
    Ok((channels, [[6, 7, 8].map(number), [9, 10, 11].map(number)]))
}

impl Volume {
    /// Reads a file.
    ///
    /// # Errors
    /// A file that is missing, truncated, too long, or holds a value that is negative or no number.
    pub fn read(file: &Path) -> Result<Self, DataError> {
        Self::from_bytes(file, &read_file(file)?)
    }

    /// Reads the bytes of a file.
    ///
    /// # Errors
    /// As [`Volume::read`].
    pub fn from_bytes(file: &Path, bytes: &[u8]) -> Result<Self, DataError> {
        let fail = |reason: String| DataError::new(file, "header", reason);
        let Some((header, body)) = bytes.split_at_checked(HEADER) else {
            return Err(fail(format!("{} bytes are too few for a header of {HEADER}", bytes.len())));
        };
        let (tag, rest) = header.split_at(4);
        if !tag.starts_with(b"VOL") {
            return Err(fail("the file does not begin with \"VOL\"".to_owned()));
        }
        if tag != b"VOL\x03" {
            return Err(fail(format!("version {} is not known; 3 is", tag.last().copied().unwrap_or(0))));
        }
        let mut numbers = rest.as_chunks::<4>().0.iter().map(|word| i32::from_le_bytes(*word));
        let mut next = || numbers.next().unwrap_or(0);
        let encoding = next();
        let size = [next(), next(), next()];
        let channels = next();
        if size.iter().any(|n| *n <= 0) {
            return Err(fail(format!("size {} x {} x {} must be positive", size[0], size[1], size[2])));
        }
        if channels != 1 {
            return Err(fail(format!("{channels} channels; only volumes of one are known")));
        }
        let size = size.map(i32::unsigned_abs);
        let bytes_each = match encoding {
            1 => 4,
            3 => 1,
            _ => return Err(fail(format!("encoding {encoding} is not known; 1 (f32) and 3 (u8) are"))),
        };
        let needed = size.iter().try_fold(bytes_each, |n: u64, s| n.checked_mul(u64::from(*s)));
        if needed != Some(body.len() as u64) {
            let needed = needed.map_or_else(|| "more than 2^64".to_owned(), |n| n.to_string());
            let [x, y, z] = size;
            return Err(fail(format!(
                "size {x} x {y} x {z} needs {needed} bytes of values, but {} follow",
                body.len()
            )));
        }
        let values = if encoding == 1 {
            let values: Vec<f32> = body.as_chunks::<4>().0.iter().map(|word| f32::from_le_bytes(*word)).collect();
            if let Some(at) = values.iter().position(|v| !(v.is_finite() && *v >= 0.0)) {
                let value = values.get(at).copied().unwrap_or(f32::NAN);
                let [x, y, z] = cell(at, size);
                let place = format!("cell ({x}, {y}, {z})");
                return Err(DataError::new(file, place, format!("density {value} is negative or not a finite number")));
            }
            Values::F32(values)
        } else {
            Values::U8(body.to_vec())
        };
        Ok(Self { size, values })
    }

    /// Writes a file, which [`Volume::read`] reads back as it is.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, file: &Path) -> Result<(), DataError> {
        std::fs::write(file, self.to_bytes()).map_err(|e| DataError::new(file, "", format!("cannot be written: {e}")))
    }

    /// The bytes of a file. Its bounding box, which no reader here heeds, is the unit cube.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let (encoding, values): (u32, Vec<u8>) = match &self.values {
            Values::F32(values) => (1, values.iter().flat_map(|v| v.to_le_bytes()).collect()),
            Values::U8(values) => (3, values.clone()),
        };
        let mut bytes = Vec::with_capacity(HEADER + values.len());
        bytes.extend(b"VOL\x03");
        let [x, y, z] = self.size;
        bytes.extend([encoding, x, y, z, 1].iter().flat_map(|n| n.to_le_bytes()));
        bytes.extend([0.0_f32, 0.0, 0.0, 1.0, 1.0, 1.0].iter().flat_map(|c| c.to_le_bytes()));
        bytes.extend(values);
        bytes
    }

    /// Whether the outermost cells hold nothing.
    #[must_use]
    pub fn has_empty_border(&self) -> bool {
        let is_outer =
            |at: usize| cell(at, self.size).iter().zip(self.size).any(|(c, n)| *c == 0 || *c + 1 == n as usize);
        match &self.values {
            Values::F32(values) => values.iter().enumerate().all(|(at, v)| *v == 0.0 || !is_outer(at)),
            Values::U8(values) => values.iter().enumerate().all(|(at, v)| *v == 0 || !is_outer(at)),
        }
    }

    /// Bytes of the values.
    #[must_use]
    pub fn bytes(&self) -> usize {
        match &self.values {
            Values::F32(values) => size_of_val(&**values),
            Values::U8(values) => values.len(),
        }
    }

    /// The largest density.
    #[must_use]
    pub fn max(&self) -> f32 {
        match &self.values {
            Values::F32(values) => values.iter().copied().fold(0.0, f32::max),
            Values::U8(values) => f32::from(values.iter().copied().max().unwrap_or(0)) / 255.0,
        }
    }
}

impl From<&Volume> for Colours {
    /// The same in all channels.
    fn from(volume: &Volume) -> Self {
        let values = match &volume.values {
            Values::F32(values) => values.iter().map(|v| [*v; 3]).collect(),
            Values::U8(values) => values.iter().map(|v| [f32::from(*v) / 255.0; 3]).collect(),
        };
        Self { size: volume.size, values, is_grey: true }
    }
}

/// Colours at the centres of the cells of a grid: a file of one channel or three.
#[derive(Debug, Clone, PartialEq)]
pub struct Colours {
    /// Cells along x, y and z.
    pub size: [u32; 3],
    /// Values, x fastest, then y, then z; none is negative.
    pub values: Vec<[f32; 3]>,
    /// Whether all channels are the same everywhere.
    pub is_grey: bool,
}

impl Colours {
    /// Reads a file.
    ///
    /// # Errors
    /// As [`Volume::read`]; three channels are known, too.
    pub fn read(file: &Path) -> Result<Self, DataError> {
        Self::from_bytes(file, &read_file(file)?)
    }

    /// Reads the bytes of a file.
    ///
    /// # Errors
    /// As [`Colours::read`].
    pub fn from_bytes(file: &Path, bytes: &[u8]) -> Result<Self, DataError> {
        // Each channel as a volume of its own, which is checked as such.
        let words: Vec<[u8; 4]> = bytes.get(..HEADER).unwrap_or_default().as_chunks::<4>().0.to_vec();
        let channels = words.get(5).map_or(1, |word| i32::from_le_bytes(*word));
        if !matches!(channels, 1 | 3) {
            return Err(DataError::new(file, "header", format!("{channels} channels; one or three are known")));
        }
        let channels = channels.unsigned_abs() as usize;
        let width = if words.get(1).is_some_and(|word| i32::from_le_bytes(*word) == 3) { 1 } else { 4 };
        let mut parts = Vec::new();
        for channel in 0..channels {
            let mut one = bytes.get(..HEADER).unwrap_or(bytes).to_vec();
            if let Some(slot) = one.get_mut(20..24) {
                slot.copy_from_slice(&1_i32.to_le_bytes());
            }
            let body = bytes.get(HEADER..).unwrap_or_default();
            if body.len() % (channels * width) != 0 {
                return Err(DataError::new(
                    file,
                    "values",
                    format!("{} bytes are no whole number of cells", body.len()),
                ));
            }
            let cells = body.chunks_exact(channels * width);
            one.extend(cells.flat_map(|cell| cell.get(channel * width..(channel + 1) * width).unwrap_or_default()));
            parts.push(Volume::from_bytes(file, &one)?);
        }
        let value = |volume: &Volume, at: usize| match &volume.values {
            Values::F32(values) => values.get(at).copied().unwrap_or(0.0),
            Values::U8(values) => f32::from(values.get(at).copied().unwrap_or(0)) / 255.0,
        };
        let size = parts.first().map_or([1; 3], |v| v.size);
        let count = size.iter().map(|n| *n as usize).product::<usize>();
        let part = |channel: usize| parts.get(channel.min(parts.len() - 1));
        let values =
            (0..count).map(|at| [0, 1, 2].map(|channel| part(channel).map_or(0.0, |v| value(v, at)))).collect();
        Ok(Self { size, values, is_grey: channels == 1 })
    }

    /// The value at a point of the unit cube, and beyond it.
    #[must_use]
    pub fn at(&self, point: Vec3, wrap: Wrap, is_smooth: bool) -> [f32; 3] {
        let size = self.size.map(|n| n as usize);
        if !point.is_finite() {
            return [0.0; 3];
        }
        let texel = |x: i64, y: i64, z: i64| {
            let (x, y, z) = (wrap.index(x, size[0]), wrap.index(y, size[1]), wrap.index(z, size[2]));
            Vec3::from_array(self.values.get((z * size[1] + y) * size[0] + x).copied().unwrap_or_default())
        };
        let at = point * Vec3::new(size[0] as f32, size[1] as f32, size[2] as f32);
        if !is_smooth {
            return texel(at.x.floor() as i64, at.y.floor() as i64, at.z.floor() as i64).to_array();
        }
        let at = at - Vec3::splat(0.5);
        let (low, share) = (at.floor(), at - at.floor());
        let [x, y, z] = low.to_array().map(|c| c as i64);
        let row = |y: i64, z: i64| texel(x, y, z).lerp(texel(x + 1, y, z), share.x);
        let sheet = |z: i64| row(y, z).lerp(row(y + 1, z), share.y);
        sheet(z).lerp(sheet(z + 1), share.z).to_array()
    }

    /// The largest value of each channel.
    #[must_use]
    pub fn most(&self) -> [f32; 3] {
        self.values.iter().fold([0.0; 3], |most, v| [0, 1, 2].map(|i| most[i].max(v[i])))
    }
}

fn cell(index: usize, size: [u32; 3]) -> [usize; 3] {
    let (x, y) = (size[0] as usize, size[1] as usize);
    [index % x, index / x % y, index / x / y]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_back() {
        let file = Path::new("a.vol");
        for values in [Values::F32(vec![0.0, 0.25, 1e-30, 1.0, 0.5, 3.0]), Values::U8(vec![0, 1, 2, 128, 254, 255])] {
            let volume = Volume { size: [3, 1, 2], values };
            assert_eq!(Volume::from_bytes(file, &volume.to_bytes()), Ok(volume));
        }
    }

    #[test]
    fn a_folder_that_is_not_there_is_an_error() {
        let file = std::env::temp_dir().join("fogbow-none").join("a.vol");
        let volume = Volume { size: [1, 1, 1], values: Values::U8(vec![0]) };
        assert!(volume.write(&file).unwrap_err().to_string().contains("a.vol: cannot be written"));
    }
}
