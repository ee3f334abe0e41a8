//! What is kept of a render on its way and after it: `--checkpoint` with `--resume`, `--preview`, and film files to go on with, of parts and fills.

use core::cell::{Cell, RefCell};
use std::path::{Path, PathBuf};

use clap::Args;
use fogbow::picture::Share;
use fogbow::spectrum::Spectrum;
use fogbow_std::film::Image;
use fogbow_std::image::{self, Layer};
use fogbow_std::stats::Stopwatch;
use fogbow_std::tiles::Watched;

use super::film_file::{About, FilmFile, Measured, Parts};
use super::{Failure, output};

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

/// Keeps what is done.
#[derive(Debug)]
pub(crate) struct Keeper<'a> {
    arguments: &'a KeepArguments,
    tag: u64,
    about: RefCell<About>,
    /// What it goes on with.
    left: Option<FilmFile>,
    /// What another run has filled.
    filled: Option<FilmFile>,
    /// Of finished caches, and of a grid.
    caches: RefCell<(Vec<u8>, Measured)>,
    grid: RefCell<Vec<u8>>,
    /// The picture at the end, if it is wanted as a film.
    last_picture: RefCell<Option<Vec<u8>>>,
    wants_film: bool,
    /// Columns and rows of the picture.
    size: [u32; 2],
    clock: Stopwatch,
    /// When a checkpoint and a preview were written last (s).
    last: Cell<[f64; 2]>,
    /// The first thing that went wrong; a render is not given up for it.
    problem: RefCell<Option<String>>,
}

impl<'a> Keeper<'a> {
    /// For a render of this, which goes on where one of the same was left, with what was filled for it in `fill`.
    ///
    /// # Errors
    /// A checkpoint that is damaged, or of another render.
    pub(super) fn new(
        arguments: &'a KeepArguments,
        (size, tag, about): ([u32; 2], u64, About),
        fill: Option<&Path>,
    ) -> Result<Self, Failure> {
        let wrong = |file: &Path, what: String| Failure::from(format!("{}: {what}", file.display()));
        let left = match &arguments.checkpoint {
            Some(file) if arguments.resume && file.exists() => {
                let left = FilmFile::read(file)?;
                if let Some(difference) = about.difference(&left.about, about.parts.is_none()) {
                    let what = format!("was left by a render of another scene, or with other options: it {difference}");
                    return Err(wrong(file, what));
                }
                if left.about.parts != about.parts {
                    return Err(wrong(file, format!("is {}, not {}", left.about.name(), about.name())));
                }
                Some(left)
            }
            _ => None,
        };
        let filled = fill.map(FilmFile::read).transpose()?;
        if let (Some(file), Some(filled)) = (fill, &filled) {
            if let Some(difference) = about.difference(&filled.about, true) {
                return Err(wrong(file, format!("was not filled for this: it {difference}")));
            }
            if filled.caches.is_empty() && filled.grid.is_empty() {
                return Err(wrong(file, "holds nothing that was filled; fogbow fill makes such files".to_owned()));
            }
        }
        Ok(Self {
            arguments,
            tag,
            about: about.into(),
            left,
            filled,
            caches: RefCell::default(),
            grid: RefCell::default(),
            last_picture: RefCell::default(),
            wants_film: false,
            size,
            clock: Stopwatch::start(),
            last: Cell::new([0.0; 2]),
            problem: RefCell::new(None),
        })
    }

    /// The picture is wanted as a film, too.
    pub(super) fn for_film(mut self, wants_film: bool) -> Self {
        self.wants_film = wants_film;
        self
    }

    /// What of the picture is rendered.
    pub(super) fn share(&self) -> Share {
        self.about.borrow().parts.as_ref().map_or(Share::Whole, Parts::share)
    }

    /// Sums alone do not make the picture, for this reason.
    pub(super) fn needs_finishing(&self, reason: &str) {
        self.about.borrow_mut().unfinished = Some(reason.to_owned());
    }

    /// The picture to go on with, and its tag.
    pub(super) fn picture(&self) -> Option<(&[u8], u64)> {
        self.left.as_ref().map(|left| (left.picture.as_slice(), self.tag))
    }

    /// The caches of the picture to go on with, or what was filled for it.
    pub(super) fn caches(&self) -> Option<(&[u8], Measured)> {
        let mut all = self.left.iter().chain(&self.filled);
        all.find(|film| !film.caches.is_empty()).map(|film| (film.caches.as_slice(), film.measured))
    }

    /// The same of the covariance grid.
    pub(super) fn grid(&self) -> Option<&[u8]> {
        self.left.iter().chain(&self.filled).map(|film| film.grid.as_slice()).find(|grid| !grid.is_empty())
    }

    /// A grid is filled: it belongs to what is kept.
    pub(super) fn keep_grid(&self, bytes: Vec<u8>) {
        *self.grid.borrow_mut() = bytes;
    }

    /// What has been filled and rendered by now.
    pub(super) fn film(&self, has_fill: bool) -> FilmFile {
        let (caches, measured) = if has_fill { self.caches.borrow().clone() } else { Default::default() };
        let grid = if has_fill { self.grid.borrow().clone() } else { Vec::new() };
        let picture = self.last_picture.borrow().clone().unwrap_or_default();
        FilmFile { tag: self.tag, about: self.about.borrow().clone(), measured, caches, grid, picture }
    }

    /// Whether anything is kept on the way.
    pub(super) fn is_asked(&self) -> bool {
        self.arguments.checkpoint.is_some()
    }

    /// Whether caches and grids are kept: not those that lie in another file already. `is_fill` if they are all that is wanted.
    pub(super) fn wants_filled(&self, is_fill: bool) -> bool {
        is_fill || self.is_asked() && self.filled.is_none()
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
            let picture = tiles.to_bytes(self.tag);
            self.note(FilmFile { picture, ..self.film(true) }.write(file));
        }
        if self.wants_film && is_last {
            *self.last_picture.borrow_mut() = Some(tiles.to_bytes(self.tag));
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
