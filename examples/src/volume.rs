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
