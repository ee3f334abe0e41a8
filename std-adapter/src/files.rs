//! Files, read and written with care.

use std::ffi::OsString;
use std::io;
use std::path::Path;

/// The bytes of a file; `None` if it is a directory or a device.
pub(crate) fn read(path: &Path) -> io::Result<Option<Vec<u8>>> {
    // Asked before opening: opening a pipe would wait for whoever writes to it.
    if !std::fs::metadata(path)?.is_file() {
        return Ok(None);
    }
    std::fs::read(path).map(Some)
}

/// Beside the old file first, so that neither a full disk nor an interruption costs both.
pub(crate) fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let is_plain = std::fs::symlink_metadata(path).map_or(true, |meta| meta.is_file());
    if let (true, Some(name)) = (is_plain, path.file_name()) {
        let mut beside = OsString::from(name);
        beside.push(format!(".{}.new", std::process::id()));
        let beside = path.with_file_name(beside);
        match std::fs::write(&beside, bytes).and_then(|()| std::fs::rename(&beside, path)) {
            Ok(()) => return Ok(()),
            // No room for two, or a folder where nothing may be made: what remains is the file itself.
            Err(_) => drop(std::fs::remove_file(&beside)),
        }
    }
    std::fs::write(path, bytes)
}
