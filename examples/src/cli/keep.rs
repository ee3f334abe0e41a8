//! What is kept of a render on its way: `--checkpoint` with `--resume`, and `--preview`.
//!
//! A checkpoint file is little endian: 8 bytes [`MAGIC`], version, tag, lengths of caches and picture, what was measured of the caches, a
//! [`Crc`] of all else; then the caches and the picture as the core writes them. It is replaced as a whole, so whatever ends the program
//! leaves the last one.

use core::cell::{Cell, RefCell};
use std::path::{Path, PathBuf};

use clap::Args;
use fogbow::bytes::Crc;
use fogbow::spectrum::Spectrum;
use fogbow_std::files::write;
use fogbow_std::film::Image;
use fogbow_std::image::{self, Layer};
use fogbow_std::stats::Stopwatch;
use fogbow_std::tiles::Watched;

use super::{Failure, output};
use crate::error::read_file;

const MAGIC: [u8; 8] = *b"\x89FOGCKP\n";
const VERSION: u32 = 1;
const HEADER_BYTES: usize = 8 + 4 + 8 + 8 + 8 + 4 + 4 + 4 + 8;

/// Longest side of a preview (pixels): more takes longer to write than to render.
const PREVIEW_SIDE: u32 = 512;

/// Seconds between two previews.
const PREVIEW_EVERY: f64 = 1.0;

/// Of renders that may be interrupted.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Long renders")]
pub struct KeepArguments {
    /// Keeps what is done in this file, again and again and when the render ends or is stopped, for --resume.
    #[arg(long, value_name = "FILE")]
    pub checkpoint: Option<PathBuf>,
    /// Seconds between two checkpoints.
    #[arg(long, value_name = "SECONDS", requires = "checkpoint", default_value_t = 30.0, value_parser = output::positive)]
    pub checkpoint_every: f64,
    /// Goes on where the --checkpoint file was left, to the bits of a render that was never left. Without such a file, begins.
    #[arg(long, requires = "checkpoint")]
    pub resume: bool,
    /// Shows the picture so far, small, in this .png file, each second.
    #[arg(long, value_name = "FILE.png")]
    pub preview: Option<PathBuf>,
}

impl KeepArguments {
    /// # Errors
    /// Files that cannot be written: better before a long render than after it.
    pub(super) fn check(&self) -> Result<(), String> {
        if let Some(file) = &self.preview {
            if !file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png")) {
                return Err(format!("--preview: {} must end in .png", file.display()));
            }
            output::check_place(file)?;
        }
        self.checkpoint.as_deref().map_or(Ok(()), output::check_place)
    }
}

/// What was measured of caches while they were filled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Measured {
    /// Noise that a picture from them may have.
    pub(super) noise: f32,
    /// Eye rays of their audit.
    pub(super) audit_rays: u32,
}

/// A checkpoint that was read.
#[derive(Debug)]
struct Left {
    caches: Vec<u8>,
    measured: Measured,
    picture: Vec<u8>,
}

/// Keeps what is done.
#[derive(Debug)]
pub(super) struct Keeper<'a> {
    arguments: &'a KeepArguments,
    tag: u64,
    left: Option<Left>,
    /// Of finished caches.
    caches: RefCell<(Vec<u8>, Measured)>,
    /// Columns and rows of the picture.
    size: [u32; 2],
    clock: Stopwatch,
    /// When a checkpoint and a preview were written last (s).
    last: Cell<[f64; 2]>,
    /// The first thing that went wrong; a render is not given up for it.
    problem: RefCell<Option<String>>,
}

impl<'a> Keeper<'a> {
    /// For a render with this tag, which goes on where one of the same tag was left.
    ///
    /// # Errors
    /// A checkpoint that is damaged, or of another render.
    pub(super) fn new(arguments: &'a KeepArguments, size: [u32; 2], tag: u64) -> Result<Self, Failure> {
        let left = match &arguments.checkpoint {
            Some(file) if arguments.resume && file.exists() => Some(read(file, tag)?),
            _ => None,
        };
        let none = Measured { noise: 0.0, audit_rays: 0 };
        Ok(Self {
            arguments,
            tag,
            left,
            caches: RefCell::new((Vec::new(), none)),
            size,
            clock: Stopwatch::start(),
            last: Cell::new([0.0; 2]),
            problem: RefCell::new(None),
        })
    }

    /// The picture to go on with, and its tag.
    pub(super) fn picture(&self) -> Option<(&[u8], u64)> {
        self.left.as_ref().map(|left| (left.picture.as_slice(), self.tag))
    }

    /// The caches of the picture to go on with.
    pub(super) fn caches(&self) -> Option<(&[u8], Measured)> {
        self.left.as_ref().filter(|left| !left.caches.is_empty()).map(|left| (left.caches.as_slice(), left.measured))
    }

    /// Whether anything is kept.
    pub(super) fn is_asked(&self) -> bool {
        self.arguments.checkpoint.is_some()
    }

    /// Caches are filled: from now on they belong to what is kept.
    pub(super) fn keep_caches(&self, bytes: Vec<u8>, measured: Measured) {
        *self.caches.borrow_mut() = (bytes, measured);
    }

    /// Is shown the picture after every batch of jobs, and at the end.
    pub(super) fn watch(&self, tiles: &Watched, is_last: bool) {
        let now = self.clock.elapsed().wall;
        let is_due = |index: usize, every: f64| {
            let mut last = self.last.get();
            let is_due = is_last || now - last[index] >= every;
            if is_due {
                last[index] = now;
                self.last.set(last);
            }
            is_due
        };
        if let Some(file) = &self.arguments.checkpoint
            && is_due(0, self.arguments.checkpoint_every)
        {
            self.note(self.write(file, &tiles.to_bytes(self.tag)));
        }
        if let Some(file) = &self.arguments.preview
            && tiles.least_count() > 0
            && is_due(1, PREVIEW_EVERY)
        {
            self.note(self.preview(file, tiles));
        }
    }

    fn note(&self, result: Result<(), String>) {
        if let Err(problem) = result {
            self.problem.borrow_mut().get_or_insert(problem);
        }
    }

    /// The first file that could not be written.
    pub(super) fn problem(&self) -> Option<String> {
        self.problem.take()
    }

    fn write(&self, file: &Path, picture: &[u8]) -> Result<(), String> {
        let (caches, measured) = &*self.caches.borrow();
        let mut bytes = Vec::with_capacity(HEADER_BYTES + caches.len() + picture.len());
        bytes.extend(MAGIC);
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend(self.tag.to_le_bytes());
        [caches.len(), picture.len()].iter().for_each(|length| bytes.extend((*length as u64).to_le_bytes()));
        bytes.extend(measured.noise.to_le_bytes());
        bytes.extend(measured.audit_rays.to_le_bytes());
        bytes.extend([0; 12]);
        bytes.extend(caches);
        bytes.extend(picture);
        let crc = checksum(&bytes);
        bytes[HEADER_BYTES - 8..HEADER_BYTES].copy_from_slice(&crc.to_le_bytes());
        write(file, &bytes).map_err(|error| error.to_string())
    }

    /// Writes the picture, small: means of square blocks of pixels.
    fn preview(&self, file: &Path, tiles: &Watched) -> Result<(), String> {
        let [width, height] = self.size;
        let step = width.max(height).div_ceil(PREVIEW_SIDE).max(1);
        let [columns, rows] = [width, height].map(|side| (side / step).max(1));
        let mut small = Image::new(columns, rows, Spectrum::ZERO).map_err(|error| error.to_string())?;
        for (pixel, at) in small.pixels.iter_mut().zip(0..) {
            let [x, y] = [at % columns * step, at / columns * step];
            let inside = (0..step * step).map(|inner| (x + inner % step, y + inner / step));
            let inside = inside.filter(|&(x, y)| x < width && y < height);
            let (mut sum, mut count) = (Spectrum::ZERO, 0.0);
            for (x, y) in inside {
                sum += tiles.mean(x, y, 0);
                count += 1.0;
            }
            *pixel = sum * (1.0 / count);
        }
        image::write(file, &[Layer { name: "total", image: &small }], 0.0).map_err(|error| error.to_string())
    }
}

fn checksum(bytes: &[u8]) -> u64 {
    let mut crc = Crc::new();
    crc.add(&bytes[..HEADER_BYTES - 8]);
    crc.add(&bytes[HEADER_BYTES..]);
    crc.value()
}

fn read(file: &Path, tag: u64) -> Result<Left, Failure> {
    let wrong = |what: &str| Failure::from(format!("{}: {what}", file.display()));
    let bytes = read_file(file)?;
    let word = |at: usize| u32::from_le_bytes([0, 1, 2, 3].map(|i| bytes[at + i]));
    let long = |at: usize| u64::from(word(at)) | u64::from(word(at + 4)) << 32;
    if bytes.len() < HEADER_BYTES || bytes[..8] != MAGIC {
        return Err(wrong("is no checkpoint of a render"));
    }
    if word(8) != VERSION {
        return Err(wrong(&format!("has version {} of the format; {VERSION} is known", word(8))));
    }
    let (caches, picture) = (long(20), long(28));
    if (bytes.len() - HEADER_BYTES) as u64 != caches.saturating_add(picture) {
        return Err(wrong("is cut off"));
    }
    if checksum(&bytes) != long(HEADER_BYTES - 8) {
        return Err(wrong("is damaged: the checksum is another"));
    }
    if long(12) != tag {
        return Err(wrong("was left by a render of another scene, or with other options"));
    }
    let measured = Measured { noise: f32::from_bits(word(36)), audit_rays: word(40) };
    let (caches, picture) = bytes[HEADER_BYTES..].split_at(caches as usize);
    Ok(Left { caches: caches.to_vec(), measured, picture: picture.to_vec() })
}
