//! The scene of a command, how it is read, and what is said of it.

use core::fmt;
use std::path::PathBuf;

use clap::Args;

use crate::error::SceneError;
use crate::scene_file::{Findings, Note, NoteKind, ReadOptions, SceneFile, fingerprint_with};

/// The scene file and how it is read.
#[derive(Debug, Clone, Args)]
pub struct SceneArguments {
    /// The scene file.
    #[arg(id = "scene", value_name = "SCENE")]
    pub file: PathBuf,
    /// How it is read.
    #[command(flatten)]
    pub reading: ReadArguments,
}

/// How a scene file is read.
#[derive(Debug, Clone, Args)]
pub struct ReadArguments {
    /// Value of a parameter ($NAME) of the scene, before the one the scene has for it; may be repeated.
    #[arg(help_heading = "Scenes", short = 'D', long = "define", value_name = "NAME=VALUE", value_parser = definition)]
    pub define: Vec<(String, String)>,
    /// Which of the scene's sensors (glTF: cameras), counted from 0.
    #[arg(help_heading = "Scenes", long, value_name = "N", default_value_t = 0)]
    pub sensor: usize,
    /// Takes the nearest there is in place of what cannot be rendered, and lists it.
    #[arg(help_heading = "Scenes", long)]
    pub lenient: bool,
    /// Fog for a glTF scene, in TOML [default: SCENE.fog.toml beside it, if there is one].
    #[arg(help_heading = "Scenes", long, value_name = "FILE.toml")]
    pub fog: Option<PathBuf>,
    /// Leaves out the fog that lies beside a glTF scene.
    #[arg(help_heading = "Scenes", long, conflicts_with = "fog")]
    pub no_fog: bool,
}

fn definition(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.is_empty() => Ok((name.to_owned(), value.to_owned())),
        _ => Err("must look like NAME=VALUE".to_owned()),
    }
}

impl SceneArguments {
    /// A scene that is read as it stands.
    pub(crate) fn plain(file: PathBuf) -> Self {
        Self {
            file,
            reading: ReadArguments { define: Vec::new(), sensor: 0, lenient: false, fog: None, no_fog: false },
        }
    }

    fn options(&self) -> ReadOptions {
        let ReadArguments { define, sensor, lenient, fog, no_fog } = &self.reading;
        ReadOptions {
            parameters: define.clone(),
            sensor: *sensor,
            is_lenient: *lenient,
            fog: fog.clone(),
            is_without_fog: *no_fog,
        }
    }

    /// All that is in the scene, or wrong with it.
    pub(super) fn findings(&self) -> Findings {
        SceneFile::read_with(&self.file, &self.options())
    }

    /// The scene. Notes go to standard error unless the user wants quiet.
    ///
    /// # Errors
    /// All that is wrong with it.
    pub(super) fn read(&self, is_quiet: bool) -> Result<SceneFile, SceneErrors> {
        let Findings { scene, errors, notes } = self.findings();
        let scene = scene.ok_or(SceneErrors(errors))?;
        if !is_quiet {
            said(&notes).iter().for_each(|note| say!("{note}"));
        }
        Ok(scene)
    }

    /// See [`fingerprint_with`].
    pub(super) fn fingerprint(&self) -> Result<u64, SceneError> {
        fingerprint_with(&self.file, &self.options())
    }
}

/// All that is wrong with a scene: a line each.
#[derive(Debug)]
pub(crate) struct SceneErrors(Vec<SceneError>);

impl fmt::Display for SceneErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        /// More than fill a screen hide the first ones; `fogbow check` tells all.
        const MOST: usize = 20;
        for (index, error) in self.0.iter().take(MOST).enumerate() {
            let separator = if index > 0 { "\n" } else { "" };
            write!(f, "{separator}{error}")?;
        }
        match self.0.len().saturating_sub(MOST) {
            0 => Ok(()),
            more => write!(f, "\nand {more} more: see fogbow check"),
        }
    }
}

impl core::error::Error for SceneErrors {}

/// Notes as lines, the gravest kind first; those that differ in place only are one line.
pub(super) fn said(notes: &[Note]) -> Vec<String> {
    let mut groups: Vec<(&Note, usize)> = Vec::new();
    for note in notes {
        let is_same = |other: &Note| {
            (other.kind, &other.text.reason, &other.text.attribute)
                == (note.kind, &note.text.reason, &note.text.attribute)
        };
        match groups.iter_mut().find(|(first, _)| is_same(first)) {
            Some((_, count)) => *count += 1,
            None => groups.push((note, 1)),
        }
    }
    groups.sort_by_key(|(note, _)| core::cmp::Reverse(note.kind));
    let line = |(note, count): &(&Note, usize)| {
        let word = match note.kind {
            NoteKind::Replaced => "replaced",
            NoteKind::Suspicious => "suspicious",
            NoteKind::Ignored => "note",
        };
        let more = if *count > 1 { format!(" (and {} more)", count - 1) } else { String::new() };
        format!("{word}: {note}{more}")
    };
    groups.iter().map(line).collect()
}
