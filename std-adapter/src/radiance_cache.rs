//! Files of radiance caches.

use std::path::Path;

use fogbow::cache::{CachesError, RadianceCaches, Settings};

use crate::files::{self, FileError};

/// Writes all caches to a file. `tag` says what they were made for: what changes the light in the world.
///
/// The old file, if there is one, is replaced when the new one is complete.
///
/// # Errors
/// What the system says.
pub fn save(file: impl AsRef<Path>, caches: &RadianceCaches<'_>, tag: u64) -> Result<(), FileError<CachesError>> {
    files::save(file.as_ref(), &caches.to_bytes(tag))
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
pub fn load(
    file: impl AsRef<Path>,
    settings: Settings,
    tag: u64,
) -> Result<RadianceCaches<'static>, FileError<CachesError>> {
    files::load(file.as_ref(), |bytes| {
        let mut caches = RadianceCaches::new(settings);
        caches.read(bytes, tag).map(|()| caches)
    })
}
