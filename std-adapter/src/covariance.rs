//! Files of covariance grids.

use std::path::Path;

use fogbow::covariance::CovarianceGrid;
use fogbow::covariance::bytes::{self, GridBytesError};
use fogbow::storage::List;

use crate::files::{self, FileError};

/// Writes a grid to a file; the file that was there is lost only when the new one is complete.
///
/// # Errors
/// What the system says.
pub fn save(file: impl AsRef<Path>, grid: &CovarianceGrid<'_>, tag: u64) -> Result<(), FileError<GridBytesError>> {
    let mut all = Vec::with_capacity(bytes::byte_count(grid.view().lattice()));
    let Ok(()) = bytes::write(&grid.view(), tag, |part| {
        all.extend_from_slice(part);
        Ok::<(), core::convert::Infallible>(())
    });
    files::save(file.as_ref(), &all)
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
pub fn load(file: impl AsRef<Path>, tag: u64) -> Result<CovarianceGrid<'static>, FileError<GridBytesError>> {
    files::load(file.as_ref(), |all| bytes::read(all, tag, List::default()))
}
