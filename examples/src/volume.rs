//! Mitsuba's grid volumes: `.vol`, version 3, one channel, `f32` or `u8`.

use std::path::Path;

use crate::error::{DataError, read_file};

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
