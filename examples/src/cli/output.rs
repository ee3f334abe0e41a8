//! Checks made before a long render, so that its result is not lost.

use std::fs::OpenOptions;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use fogbow_std::image::is_writable;

use super::Failure;

/// Writes what was asked for to standard output, and ends the line. Who has stopped reading has read enough.
///
/// # Errors
/// A disk that is full, and the like.
pub(super) fn print(text: &str) -> Result<(), Failure> {
    match writeln!(std::io::stdout().lock(), "{text}") {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(format!("standard output: {error}").into()),
        _ => Ok(()),
    }
}

/// # Errors
/// A file whose kind is not known, or that cannot be written.
pub(super) fn check(file: &Path) -> Result<(), String> {
    if !is_writable(file) {
        return Err(format!("{}: the extension is none of png, pfm, exr", file.display()));
    }
    check_place(file)
}

/// # Errors
/// A file that cannot be written. Nothing is left behind, and nothing overwritten.
pub(super) fn check_place(file: &Path) -> Result<(), String> {
    let is_new = !file.exists();
    OpenOptions::new()
        .append(true)
        .create(true)
        .open(file)
        .map_err(|e| format!("{}: cannot be written: {e}", file.display()))?;
    if is_new {
        std::fs::remove_file(file).map_err(|e| format!("{}: {e}", file.display()))?;
    }
    Ok(())
}

/// Where a picture goes: if it was `stopped`, not over one that is there, which may have had all its time, but beside it.
pub(super) fn not_over_better(files: Vec<PathBuf>, stopped: bool) -> Vec<PathBuf> {
    if stopped { files.into_iter().map(beside).collect() } else { files }
}

/// Where something unfinished goes: into this file, or, if there is one already, into one beside it.
pub(super) fn beside(file: PathBuf) -> PathBuf {
    if !file.is_file() {
        return file;
    }
    let mut name = file.file_stem().unwrap_or_default().to_owned();
    name.push(".stopped");
    if let Some(extension) = file.extension() {
        name.push(".");
        name.push(extension);
    }
    file.with_file_name(name)
}

/// Writes what had no place in `file` into the folder of temporary files, with this extension: hours of work are not lost for want of a place. Where it
/// is, if it had one there.
pub(super) fn rescue(file: &Path, extension: &str, write: impl FnOnce(&Path) -> Result<(), String>) -> Option<PathBuf> {
    let mut name = file.file_stem().unwrap_or_default().to_owned();
    name.push(format!("-{}.{extension}", std::process::id()));
    let rescue = std::env::temp_dir().join(name);
    write(&rescue).is_ok().then_some(rescue)
}

/// A number above 0.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err("must be a number greater than 0".to_owned()),
    }
}

/// A number that is not infinite.
pub(super) fn finite(text: &str) -> Result<f32, String> {
    text.parse::<f32>().ok().filter(|value| value.is_finite()).ok_or_else(|| "must be a finite number".to_owned())
}

/// `x,y,z x,y,z`: an origin and a target.
pub(super) fn camera(text: &str) -> Result<[[f64; 3]; 2], String> {
    let number = |text: &str| text.trim().parse().ok().filter(|v: &f64| v.is_finite());
    let point =
        |text: &str| -> Option<[f64; 3]> { text.split(',').map(number).collect::<Option<Vec<_>>>()?.try_into().ok() };
    let points: Option<Vec<_>> = text.split_whitespace().map(point).collect();
    points
        .and_then(|points| points.try_into().ok())
        .ok_or_else(|| "must look like \"0,1.8,4 0,1,0\": where it stands, a space, what it looks at".to_owned())
}

/// `WIDTHxHEIGHT`.
pub(super) fn size(text: &str) -> Result<(u32, u32), String> {
    let parsed = text.split_once('x').and_then(|(w, h)| Some((w.parse::<u32>().ok()?, h.parse::<u32>().ok()?)));
    match parsed {
        Some((w @ 1..=65_536, h @ 1..=65_536)) if u64::from(w) * u64::from(h) <= crate::scene_file::MAX_PIXELS => {
            Ok((w, h))
        }
        Some(_) => Err(format!("sides must lie in [1, 65536], with at most {} pixels", crate::scene_file::MAX_PIXELS)),
        None => Err("must look like 640x480".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_is_two_points() {
        assert_eq!(camera("-9,1.8,0.4  0,4.2,-0.4"), Ok([[-9.0, 1.8, 0.4], [0.0, 4.2, -0.4]]));
        for text in ["", "1,2,3", "1,2 3,4,5", "1,2,3 4,5,6 7,8,9", "1,2,x 4,5,6", "1,2,nan 4,5,6", "1, 2, 3 4, 5, 6"] {
            assert!(camera(text).unwrap_err().contains("0,1.8,4 0,1,0"), "{text}");
        }
    }
}
