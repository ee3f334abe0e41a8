//! Parts of a bake, for several machines: `--part K/N`.

use std::path::{Path, PathBuf};

use clap::Args;
use fogbow::bake::bytes::{self, ProbeBytesError};
use fogbow::bake::{BakeMemory, ProbeGrid};
use fogbow::bytes::Crc;
use fogbow::math::Bounds;
use fogbow::path;

use super::super::film_file::{About, FilmFile, Measured, Parts, Split, is_film};
use super::super::parts::part;
use super::super::scene::SceneArguments;
use super::super::{Ending, Failure};
use super::{BakeArguments, Frame, Source, bake, is_made_for, write};
use crate::error::read_file;

/// Of bakes that several machines share out.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Many machines")]
pub struct BakePartArguments {
    /// Bakes part K of N of the bricks of 64 probes, into a .fogbow file for `fogbow merge`.
    #[arg(long, value_name = "K/N", value_parser = part, requires = "level")]
    pub part: Option<(u32, u32)>,
    /// Takes the mean light of the grid in this file, which may have few probes, for the mean that errors are in proportion to. Without it, that is the mean
    /// of all probes that are baked, which no part has.
    #[arg(long, value_name = "COARSE.bake")]
    pub level: Option<PathBuf>,
}

/// What a part is of.
#[derive(Debug, Clone)]
pub(super) struct PartOf {
    pub(super) tag: u64,
    pub(super) about: About,
}

impl BakeArguments {
    /// # Errors
    /// Parts that would not add up to the whole, or would have nowhere to go.
    pub(super) fn check_part(&self) -> Result<(), Failure> {
        let is_part = self.many.part.is_some();
        if is_part != self.output.iter().any(|file| is_film(file)) || is_part && self.output.len() != 1 {
            return Err("--part: a part goes into a file of its own, -o PART.fogbow, for fogbow merge".into());
        }
        if is_part && self.per_light {
            return Err(
                "--part: --per-light makes a bake of each light; take parts of them, by scenes of one light each"
                    .into(),
            );
        }
        if is_part && self.refine.is_some() {
            return Err("--part and --refine: where bricks are finer is decided by all probes; bake and merge the parts, then refine in one piece: fogbow bake --resume --refine".into());
        }
        match self.method {
            _ if !is_part && self.many.level.is_none() => Ok(()),
            Source::Path => Ok(()),
            Source::Photons => Err("--part and --level: photons serve all probes at once, and are done in seconds; bake in one piece, or take --method path".into()),
            Source::RadianceCache => Err("--part and --level: every part would fill the same caches; bake in one piece, or take --method path".into()),
        }
    }

    /// The mean that errors are in proportion to, if it is given.
    ///
    /// # Errors
    /// A file that is damaged, of another scene, of other light, or dark.
    pub(super) fn level(&self, scene: &SceneArguments, paths: &path::Settings) -> Result<Option<f32>, Failure> {
        let Some(file) = &self.many.level else { return Ok(None) };
        let wrong = |what: &str| Failure::from(format!("--level {}: {what}", file.display()));
        let all = read_file(file)?;
        let read = bytes::tag(&all).and_then(|tag| Ok((tag, bytes::read(&all, tag, BakeMemory::default())?)));
        let (tag, grid) = read.map_err(|error: ProbeBytesError| wrong(&error.to_string()))?;
        if !is_made_for(tag, scene, paths)? {
            return Err(wrong("was baked for another scene"));
        }
        if (grid.quantity(), grid.orders()) != (self.quantity(), self.orders()) {
            return Err(wrong("holds other light: --quantity and --orders must be the same"));
        }
        match grid.level() as f32 {
            level if level > 0.0 => Ok(Some(level)),
            _ => Err(wrong("is dark, and nothing can be in proportion to that")),
        }
    }

    /// What a part is of: all that changes it.
    ///
    /// # Errors
    /// More parts than bricks, or a scene that cannot be read.
    pub(super) fn part_of(
        &self,
        scene: &SceneArguments,
        paths: &path::Settings,
        (bounds, counts): (&Bounds, [u32; 3]),
        level: Option<f32>,
    ) -> Result<Option<PartOf>, Failure> {
        let Some((number, of)) = self.many.part else { return Ok(None) };
        check_count(of, counts)?;
        let fingerprint = scene.fingerprint()?;
        let [x, y, z] = counts;
        let told = |name: &str, value: String| (name.to_owned(), value);
        let options = vec![
            told("box", format!("{} {}", bounds.min, bounds.max)),
            told("number of probes", format!("{x}x{y}x{z}")),
            told("basis", format!("{:?}", self.basis())),
            told("quantity", format!("{:?}", self.quantity())),
            told("choice of light", format!("{:?}", self.orders())),
            told("error", format!("{:?}", self.error)),
            told("number of passes", format!("{:?}", self.passes)),
            told("mean light (--level)", format!("{level:?}")),
            told("seed", self.seed.to_string()),
            told("longest path", format!("{paths:?}")),
        ];
        let mut crc = Crc::new();
        crc.add(&fingerprint.to_le_bytes());
        options.iter().for_each(|(_, value)| crc.add(value.as_bytes()));
        let about = About {
            program: env!("CARGO_PKG_VERSION").to_owned(),
            scene: scene.file.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            fingerprint: format!("{fingerprint:016x}"),
            samples: 0,
            options,
            layers: Vec::new(),
            has_layers: false,
            unfinished: None,
            parts: Some(Parts { split: Split::Bricks, of, has: vec![number] }),
        };
        Ok(Some(PartOf { tag: crc.value(), about }))
    }
}

/// # Errors
/// More parts than bricks.
pub(in super::super) fn check_count(of: u32, counts: [u32; 3]) -> Result<(), Failure> {
    let bricks: u64 = counts.map(|n| u64::from(n.div_ceil(4))).iter().product();
    if u64::from(of) > bricks {
        return Err(format!("--part: {of} parts of {bricks} bricks of 64 probes; take fewer").into());
    }
    Ok(())
}

/// Bakes a part.
pub(super) fn run(arguments: &BakeArguments, scene: &SceneArguments) -> Result<Ending, Failure> {
    let (made, ending) = bake(arguments, scene, &Frame::default())?;
    let (Some(part), [file]) = (&made.part, arguments.output.as_slice()) else { return Err("there is no part".into()) };
    let is_done = ending == Ending::Done;
    let unfinished = made.unfinished.as_ref().unwrap_or(file);
    let written = if is_done { file } else { unfinished };
    part.write(written, made.baked.grid(), made.tag, is_done)?;
    if written != unfinished && made.has_kept {
        drop(std::fs::remove_file(unfinished));
    }
    if !arguments.quiet {
        say!("wrote {}: {}", written.display(), part.about.name());
    }
    Ok(ending)
}

impl PartOf {
    /// # Errors
    /// What the system says.
    pub(super) fn write(&self, file: &Path, grid: &ProbeGrid<'_>, tag: u64, is_done: bool) -> Result<(), String> {
        let unfinished = (!is_done).then(|| "some of its bricks need more passes".to_owned());
        let about = About { unfinished, ..self.about.clone() };
        let (caches, beside, picture) = (Vec::new(), Vec::new(), write::to_bytes(grid, tag));
        FilmFile { tag: self.tag, about, measured: Measured::default(), caches, grid: beside, picture }.write(file)
    }

    /// The grid that was left in a file, if there is any.
    ///
    /// # Errors
    /// A file that is damaged, or of another part.
    pub(super) fn begun(&self, file: &Path, tag: u64) -> Result<Vec<ProbeGrid<'static>>, Failure> {
        if !file.exists() {
            return Ok(Vec::new());
        }
        let film = FilmFile::read(file)?;
        let wrong = |what: String| Failure::from(format!("{}: {what}", file.display()));
        if let Some(difference) = self.about.difference(&film.about, false) {
            return Err(wrong(format!("was left by another bake: it {difference}")));
        }
        if film.about.parts != self.about.parts {
            return Err(wrong(format!("is {}, not {}", film.about.name(), self.about.name())));
        }
        let grid = bytes::read(&film.picture, tag, BakeMemory::default());
        Ok(vec![grid.map_err(|error| wrong(format!("its grid {error}")))?])
    }
}

/// Whether a film file holds probes of a bake and no picture.
pub(in super::super) fn holds_probes(film: &FilmFile) -> bool {
    film.picture.starts_with(&bytes::MAGIC)
}

/// Probes of a part, and what they are for.
///
/// # Errors
/// What is wrong with them.
pub(in super::super) fn probes(film: &FilmFile) -> Result<(ProbeGrid<'static>, u64), ProbeBytesError> {
    let tag = bytes::tag(&film.picture)?;
    Ok((bytes::read(&film.picture, tag, BakeMemory::default())?, tag))
}

/// Probes as a part or a .bake file has them.
pub(in super::super) fn probe_bytes(grid: &ProbeGrid<'_>, tag: u64) -> Vec<u8> {
    write::to_bytes(grid, tag)
}
