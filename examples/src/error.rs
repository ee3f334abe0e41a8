//! What is wrong with a file the user gave, and where.

use core::fmt;
use std::path::{Path, PathBuf};

/// Something in a scene file, or in a file it names, that cannot be used.
///
/// Reads as `box.xml:12: <float name="g">: attribute "value": anisotropy 1 is outside (-1, 1)`.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SceneError {
    /// The scene file.
    pub file: PathBuf,
    /// Line in the file, counted from 1; `None` where the file as a whole is meant.
    pub line: Option<u32>,
    /// The element as written, shortened to what identifies it: `<float name="g">`.
    pub element: String,
    /// The attribute that is wrong, if it is one.
    pub attribute: Option<String>,
    /// What is wrong, in words.
    pub reason: String,
}

impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file.display())?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        if !self.element.is_empty() {
            write!(f, ": {}", self.element)?;
        }
        if let Some(attribute) = &self.attribute {
            write!(f, ": attribute \"{attribute}\"")?;
        }
        write!(f, ": {}", self.reason)
    }
}

impl core::error::Error for SceneError {}

/// Something wrong with a mesh, volume or image file.
///
/// Reads as `spot.ply: vertex 12: x is not a finite number`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DataError {
    /// The file.
    pub file: PathBuf,
    /// Where in it: `header`, `vertex 12`.
    pub place: String,
    /// What is wrong, in words.
    pub reason: String,
}

impl DataError {
    /// An error at a place of a file.
    pub fn new(file: &Path, place: impl fmt::Display, reason: impl fmt::Display) -> Self {
        Self { file: file.to_owned(), place: place.to_string(), reason: reason.to_string() }
    }
}

impl fmt::Display for DataError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file.display())?;
        if !self.place.is_empty() {
            write!(f, ": {}", self.place)?;
        }
        write!(f, ": {}", self.reason)
    }
}

impl core::error::Error for DataError {}

/// Largest file that is read into memory: 1 GiB, far above any scene here and below what would
/// bring a desktop machine to swap.
const MAX_FILE: u64 = 1 << 30;

/// How a file begins that stands for one kept elsewhere, by Git LFS.
const POINTER: &[u8] = b"version https://git-lfs.github.com/";

/// The bytes of a file.
///
/// # Errors
/// A file that is missing, cannot be read, is not a regular file, is larger than 1 GiB or is a pointer of Git LFS.
pub fn read_file(file: &Path) -> Result<Vec<u8>, DataError> {
    let fail = |reason: String| DataError::new(file, "", reason);
    let meta = std::fs::metadata(file).map_err(|e| fail(format!("cannot be read: {e}")))?;
    if !meta.is_file() {
        return Err(fail("is not a file".to_owned()));
    }
    if meta.len() > MAX_FILE {
        return Err(fail(format!("has {} bytes; more than {MAX_FILE} are not read", meta.len())));
    }
    let bytes = std::fs::read(file).map_err(|e| fail(format!("cannot be read: {e}")))?;
    if bytes.starts_with(POINTER) {
        return Err(fail("is a pointer of Git LFS and not the file itself, which `git lfs pull` brings".to_owned()));
    }
    Ok(bytes)
}
