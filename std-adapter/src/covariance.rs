//! Files of covariance grids.

use core::fmt;
use std::io;
use std::path::{Path, PathBuf};

use fogbow::covariance::CovarianceGrid;
use fogbow::covariance::bytes::{self, BytesError};
use fogbow::storage::List;

use crate::files;

/// What is wrong with a file of a covariance grid.
#[derive(Debug)]
pub struct FileError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong.
    pub problem: Problem,
}

/// Why a file of a grid is not used.
#[derive(Debug)]
#[non_exhaustive]
pub enum Problem {
    /// The system cannot read or write it.
    Io(io::Error),
    /// It is a directory or a device.
    NoFile,
    /// Its content.
    Content(BytesError),
}

impl fmt::Display for FileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.path.display())?;
        match &self.problem {
            Problem::Io(error) => error.fmt(f),
            Problem::NoFile => f.write_str("not a file"),
            Problem::Content(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for FileError {}

/// Writes a grid to a file; the file that was there is lost only when the new one is complete.
///
/// # Errors
/// What the system says.
pub fn save(file: impl AsRef<Path>, grid: &CovarianceGrid<'_>, tag: u64) -> Result<(), FileError> {
    let path = file.as_ref();
    let mut all = Vec::with_capacity(bytes::byte_count(grid.view().lattice()));
    let Ok(()) = bytes::write(&grid.view(), tag, |part| {
        all.extend_from_slice(part);
        Ok::<(), core::convert::Infallible>(())
    });
    files::replace(path, &all).map_err(|error| FileError { path: path.to_owned(), problem: Problem::Io(error) })
}

/// Reads a grid that [`save`] wrote for the same `tag`.
///
/// # Errors
/// What the system says, or what is wrong with the file.
///
/// ```
/// use fogbow::covariance::{Fill, Settings};
/// use fogbow::math::{Bounds, Vec3};
/// use fogbow_std::covariance::{load, save};
/// let empty = Fill::new(Settings::new(Bounds { min: Vec3::ZERO, max: Vec3::ONE }))?.finish();
/// let file = std::env::temp_dir().join("fogbow-std-grid.fog");
/// save(&file, &empty, 7)?;
/// assert_eq!(load(&file, 7)?.view().paths(), 0);
/// assert!(load(&file, 8).is_err());
/// # std::fs::remove_file(&file)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn load(file: impl AsRef<Path>, tag: u64) -> Result<CovarianceGrid<'static>, FileError> {
    let path = file.as_ref();
    let read = || -> Result<CovarianceGrid<'static>, Problem> {
        let all = files::read(path).map_err(Problem::Io)?.ok_or(Problem::NoFile)?;
        bytes::read(&all, tag, List::default()).map_err(Problem::Content)
    };
    read().map_err(|problem| FileError { path: path.to_owned(), problem })
}
