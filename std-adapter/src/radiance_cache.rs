//! Files of radiance caches.

use core::fmt;
use std::io;
use std::path::{Path, PathBuf};

use fogbow::cache::{CachesError, RadianceCaches, Settings};

use crate::files;

/// What is wrong with a file of caches.
#[derive(Debug)]
pub struct FileError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong.
    pub problem: Problem,
}

/// Why a file of caches is not used.
#[derive(Debug)]
#[non_exhaustive]
pub enum Problem {
    /// The system cannot read or write it.
    Io(io::Error),
    /// It is a directory or a device.
    NoFile,
    /// Its content.
    Content(CachesError),
}

impl fmt::Display for FileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.path.display(), self.problem)
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Io(error) => error.fmt(f),
            Self::NoFile => f.write_str("is not a file"),
            Self::Content(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for FileError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match &self.problem {
            Problem::Io(error) => Some(error),
            Problem::Content(error) => Some(error),
            Problem::NoFile => None,
        }
    }
}

/// Writes all caches to a file. `tag` says what they were made for: what changes the light in the world.
///
/// The old file, if there is one, is replaced when the new one is complete.
///
/// # Errors
/// What the system says.
pub fn save(file: impl AsRef<Path>, caches: &RadianceCaches<'_>, tag: u64) -> Result<(), FileError> {
    let path = file.as_ref();
    files::replace(path, &caches.to_bytes(tag))
        .map_err(|error| FileError { path: path.to_owned(), problem: Problem::Io(error) })
}

/// Reads what [`save`] wrote with the same `tag`, to be used with `settings`: see [`RadianceCaches::read`].
///
/// # Errors
/// The first check that fails.
///
/// ```
/// use fogbow::cache::{RadianceCaches, Settings};
/// use fogbow_std::radiance_cache::{load, save};
/// let file = std::env::temp_dir().join("fogbow-std-caches.fog");
/// save(&file, &RadianceCaches::new(Settings::default()), 7)?;
/// assert!(load(&file, Settings::default(), 7).is_ok());
/// assert!(load(&file, Settings::default(), 8).is_err());
/// # std::fs::remove_file(&file)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn load(file: impl AsRef<Path>, settings: Settings, tag: u64) -> Result<RadianceCaches<'static>, FileError> {
    let path = file.as_ref();
    let read = || -> Result<RadianceCaches<'static>, Problem> {
        let bytes = files::read(path).map_err(Problem::Io)?.ok_or(Problem::NoFile)?;
        let mut caches = RadianceCaches::new(settings);
        caches.read(&bytes, tag).map_err(Problem::Content)?;
        Ok(caches)
    };
    read().map_err(|problem| FileError { path: path.to_owned(), problem })
}
