//! Files of caches and grids, read and written with care.

use core::convert::Infallible;
use core::fmt;
use std::ffi::OsString;
use std::io;
use std::path::{Path, PathBuf};

/// What is wrong with a file.
#[derive(Debug)]
pub struct FileError<E> {
    /// The file.
    pub path: PathBuf,
    /// What is wrong.
    pub problem: Problem<E>,
}

/// Why a file is not used.
#[derive(Debug)]
#[non_exhaustive]
pub enum Problem<E> {
    /// The system cannot read or write it.
    Io(io::Error),
    /// It is a directory or a device.
    NoFile,
    /// Its content.
    Content(E),
}

impl<E: fmt::Display> fmt::Display for FileError<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.path.display(), self.problem)
    }
}

impl<E: fmt::Display> fmt::Display for Problem<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Io(error) => error.fmt(f),
            Self::NoFile => f.write_str("is not a file"),
            Self::Content(error) => error.fmt(f),
        }
    }
}

impl<E: core::error::Error + 'static> core::error::Error for FileError<E> {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match &self.problem {
            Problem::Io(error) => Some(error),
            Problem::Content(error) => Some(error),
            Problem::NoFile => None,
        }
    }
}

impl<E> Problem<E> {
    pub(crate) fn of(self, path: &Path) -> FileError<E> {
        FileError { path: path.to_owned(), problem: self }
    }
}

/// Reads a file and makes something of its bytes.
///
/// # Errors
/// What the system says, or what is wrong with the bytes.
///
/// ```
/// use fogbow::cache::{RadianceCaches, Settings};
/// use fogbow_std::files::{load, write};
/// let file = std::env::temp_dir().join("fogbow-std-caches.fog");
/// write(&file, &RadianceCaches::new(Settings::default()).to_bytes(7))?;
/// let mut caches = RadianceCaches::new(Settings::default());
/// load(&file, |bytes| caches.read(bytes, 7))?;
/// assert!(load(&file, |bytes| caches.read(bytes, 8)).is_err());
/// # std::fs::remove_file(&file)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn load<T, E>(path: &Path, decode: impl FnOnce(&[u8]) -> Result<T, E>) -> Result<T, FileError<E>> {
    let bytes = read(path).map_err(Problem::Io).and_then(|bytes| bytes.ok_or(Problem::NoFile));
    bytes.and_then(|bytes| decode(&bytes).map_err(Problem::Content)).map_err(|problem| problem.of(path))
}

/// Writes a file; the one that was there is lost only when the new one is complete.
///
/// # Errors
/// What the system says.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), FileError<Infallible>> {
    save(path, bytes)
}

/// Writes a file; the one that was there is lost only when the new one is complete.
pub(crate) fn save<E>(path: &Path, bytes: &[u8]) -> Result<(), FileError<E>> {
    replace(path, bytes).map_err(|error| Problem::Io(error).of(path))
}

/// The bytes of a file; `None` if it is a directory or a device.
fn read(path: &Path) -> io::Result<Option<Vec<u8>>> {
    // Asked before opening: opening a pipe would wait for whoever writes to it.
    if !std::fs::metadata(path)?.is_file() {
        return Ok(None);
    }
    std::fs::read(path).map(Some)
}

/// Beside the old file first, so that neither a full disk nor an interruption costs both.
fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let is_plain = std::fs::symlink_metadata(path).map_or(true, |meta| meta.is_file());
    if let (true, Some(name)) = (is_plain, path.file_name()) {
        let mut beside = OsString::from(name);
        beside.push(format!(".{}.new", std::process::id()));
        let beside = path.with_file_name(beside);
        match std::fs::write(&beside, bytes).and_then(|()| std::fs::rename(&beside, path)) {
            Ok(()) => return Ok(()),
            Err(error) => {
                drop(std::fs::remove_file(&beside));
                // In a folder where nothing may be made, what remains is the file itself. Where there is no room, it is left alone.
                if error.kind() != io::ErrorKind::PermissionDenied || !path.exists() {
                    return Err(error);
                }
            }
        }
    } else {
        // A pipe or a device.
        return std::fs::write(path, bytes);
    }
    let before = std::fs::read(path)?;
    std::fs::write(path, bytes).inspect_err(|_| drop(std::fs::write(path, before)))
}
