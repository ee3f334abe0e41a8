//! Film files: sums of samples of a picture or of parts of one, what they are of, and what was filled for them. Checkpoints, parts, merged parts and
//! fills are film files.
//!
//! Little endian: 8 bytes [`MAGIC`], version, tag, lengths of what follows, what was measured of the caches, a [`Crc`] of all else; then what
//! the file is of, as JSON, caches, a covariance grid and the picture, as the core writes them. A file is replaced as a whole, so
//! whatever ends the program leaves the last one.

use std::path::Path;

use fogbow::bytes::Crc;
use fogbow::picture::Share;
use fogbow_std::files::write;
use serde::{Deserialize, Serialize};

use super::Failure;
use crate::error::read_file;

const MAGIC: [u8; 8] = *b"\x89FOGCKP\n";
const VERSION: u32 = 2;

/// What follows the header.
const SECTIONS: usize = 4;
const HEADER_BYTES: usize = 8 + 4 + 8 + 8 * SECTIONS + 4 + 4 + 8;

/// Ending of names of film files.
pub(super) const EXTENSION: &str = "fogbow";

/// Whether a file is to hold sums and no picture.
pub(super) fn is_film(file: &Path) -> bool {
    file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case(EXTENSION))
}

/// By what a picture is split.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Split {
    /// Each part has some of the samples of all pixels.
    Samples,
    /// Each part has all samples of some of the tiles.
    Tiles,
    /// Of a bake: each part has some of the bricks of probes.
    #[value(skip)]
    Bricks,
}

impl Split {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Samples => "samples",
            Self::Tiles => "tiles",
            Self::Bricks => "bricks",
        }
    }
}

/// Which parts of a picture a file has.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Parts {
    pub(super) split: Split,
    pub(super) of: u32,
    /// Their numbers, from 1, in order.
    pub(super) has: Vec<u32>,
}

impl Parts {
    /// The share of a single part.
    pub(super) fn share(&self) -> Share {
        let (part, of) = (self.has.first().map_or(0, |number| number.saturating_sub(1)), self.of);
        match self.split {
            Split::Samples => Share::Samples { part, of },
            Split::Tiles => Share::Tiles { part, of },
            // No picture.
            Split::Bricks => Share::Whole,
        }
    }

    /// Numbers of those that are not there.
    pub(super) fn missing(&self) -> Vec<u32> {
        (1..=self.of).filter(|number| !self.has.contains(number)).collect()
    }
}

/// What a film is of.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct About {
    /// Version of the program.
    pub(super) program: String,
    /// Name of the scene file.
    pub(super) scene: String,
    /// Fingerprint of all that the scene consists of.
    pub(super) fingerprint: String,
    /// Samples per pixel that were asked for, of the whole picture.
    pub(super) samples: u32,
    /// All other options that change the picture, by name.
    pub(super) options: Vec<(String, String)>,
    pub(super) layers: Vec<String>,
    /// Whether layers but the first belong to the picture.
    pub(super) has_layers: bool,
    /// Why sums alone do not make the picture, if they do not.
    pub(super) unfinished: Option<String>,
    /// Which parts; `None` for all.
    pub(super) parts: Option<Parts>,
}

impl About {
    /// In what another film differs that should be of the same picture: as the end of a sentence about that one. The number of samples may differ
    /// if `more` is allowed.
    pub(super) fn difference(&self, other: &Self, may_have_more: bool) -> Option<String> {
        /// Longer values are not shown.
        const LONG: usize = 60;
        let told = |name: &str, found: &str, due: &str| {
            if found.len().max(due.len()) > LONG {
                format!("was made with another {name}")
            } else {
                format!("was made with another {name}: {found}, not {due}")
            }
        };
        if other.program != self.program {
            return Some(format!("was made by fogbow {}, not {}", other.program, self.program));
        }
        if (&other.scene, &other.fingerprint) != (&self.scene, &self.fingerprint) {
            let same = if other.scene == self.scene { "another version of it" } else { &self.scene };
            return Some(format!("is of another scene: {}, not {same}", other.scene));
        }
        let pairs = other.options.iter().zip(&self.options);
        if let Some((found, due)) = pairs.into_iter().find(|(found, due)| found != due) {
            return Some(told(&found.0, &found.1, &due.1));
        }
        if other.samples != self.samples && !may_have_more {
            return Some(told("number of samples", &other.samples.to_string(), &self.samples.to_string()));
        }
        if (&other.layers, other.has_layers) != (&self.layers, self.has_layers) || other.options != self.options {
            return Some("has other layers".to_owned());
        }
        None
    }

    /// In words: `part 3 of 16 (samples)`.
    pub(super) fn name(&self) -> String {
        match &self.parts {
            None => "the whole picture".to_owned(),
            Some(Parts { split, of, has }) => {
                let split = split.name();
                let (word, numbers) = (if has.len() == 1 { "part" } else { "parts" }, numbers(has));
                format!("{word} {numbers} of {of} by {split}")
            }
        }
    }
}

/// `1, 3–5`.
pub(super) fn numbers(all: &[u32]) -> String {
    let mut runs: Vec<[u32; 2]> = Vec::new();
    for &number in all {
        match runs.last_mut() {
            Some([_, end]) if *end + 1 == number => *end = number,
            _ => runs.push([number; 2]),
        }
    }
    let run = |[from, to]: [u32; 2]| if from == to { from.to_string() } else { format!("{from}–{to}") };
    runs.into_iter().map(run).collect::<Vec<_>>().join(", ")
}

/// What was measured of caches while they were filled.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Measured {
    /// Noise that a picture from them may have.
    pub(super) noise: f32,
    /// Eye rays of their audit.
    pub(super) audit_rays: u32,
}

/// All that is in a film file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct FilmFile {
    /// What it is for: made of the scene and of all options, but for the number of samples.
    pub(super) tag: u64,
    pub(super) about: About,
    pub(super) measured: Measured,
    /// Of all these, nothing where there is none.
    pub(super) caches: Vec<u8>,
    pub(super) grid: Vec<u8>,
    /// Or the probes of a part of a bake.
    pub(super) picture: Vec<u8>,
}

impl FilmFile {
    fn to_bytes(&self) -> Vec<u8> {
        let about = serde_json::to_vec(&self.about).unwrap_or_default();
        let sections = [&about, &self.caches, &self.grid, &self.picture];
        let mut bytes = Vec::with_capacity(HEADER_BYTES + sections.iter().map(|section| section.len()).sum::<usize>());
        bytes.extend(MAGIC);
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend(self.tag.to_le_bytes());
        sections.iter().for_each(|section| bytes.extend((section.len() as u64).to_le_bytes()));
        bytes.extend(self.measured.noise.to_le_bytes());
        bytes.extend(self.measured.audit_rays.to_le_bytes());
        bytes.extend([0; 8]);
        sections.iter().for_each(|section| bytes.extend(*section));
        let crc = checksum(&bytes);
        bytes[HEADER_BYTES - 8..HEADER_BYTES].copy_from_slice(&crc.to_le_bytes());
        bytes
    }

    /// # Errors
    /// What the system says.
    pub(super) fn write(&self, file: &Path) -> Result<(), String> {
        write(file, &self.to_bytes()).map_err(|error| error.to_string())
    }

    /// # Errors
    /// What is wrong with the file, after its name.
    pub(super) fn read(file: &Path) -> Result<Self, Failure> {
        Self::of(&read_file(file)?).map_err(|problem| format!("{}: {problem}", file.display()).into())
    }

    fn of(bytes: &[u8]) -> Result<Self, String> {
        let word = |at: usize| u32::from_le_bytes([0, 1, 2, 3].map(|i| bytes[at + i]));
        let long = |at: usize| u64::from(word(at)) | u64::from(word(at + 4)) << 32;
        if bytes.len() < HEADER_BYTES || bytes[..8] != MAGIC {
            return Err("is no film file: neither a checkpoint nor a part of a picture".to_owned());
        }
        if word(8) != VERSION {
            return Err(format!("has version {} of the format; {VERSION} is known", word(8)));
        }
        let lengths: [u64; SECTIONS] = core::array::from_fn(|i| long(20 + 8 * i));
        let due = lengths.iter().try_fold(0_u64, |sum, length| sum.checked_add(*length));
        let found = (bytes.len() - HEADER_BYTES) as u64;
        if due != Some(found) {
            let is_short = due.is_none_or(|due| due > found);
            return Err(if is_short { "is cut off" } else { "goes on after its end" }.to_owned());
        }
        if checksum(bytes) != long(HEADER_BYTES - 8) {
            return Err("is damaged: the checksum is another".to_owned());
        }
        let mut rest = &bytes[HEADER_BYTES..];
        let [about, caches, grid, picture] = lengths.map(|length| {
            let (section, behind) = rest.split_at(length as usize);
            rest = behind;
            section
        });
        let about: About =
            serde_json::from_slice(about).map_err(|error| format!("does not say what it is of: {error}"))?;
        let is_sound = |parts: &Parts| {
            let is_ordered = parts.has.is_sorted_by(|a, b| a < b);
            is_ordered && parts.has.iter().all(|number| (1..=parts.of).contains(number))
        };
        if !about.parts.as_ref().is_none_or(is_sound) {
            return Err("names parts that there cannot be".to_owned());
        }
        let at = 20 + 8 * SECTIONS;
        let measured = Measured { noise: f32::from_bits(word(at)), audit_rays: word(at + 4) };
        let [caches, grid, picture] = [caches, grid, picture].map(<[u8]>::to_vec);
        Ok(Self { tag: long(12), about, measured, caches, grid, picture })
    }
}

fn checksum(bytes: &[u8]) -> u64 {
    let mut crc = Crc::new();
    crc.add(&bytes[..HEADER_BYTES - 8]);
    crc.add(&bytes[HEADER_BYTES..]);
    crc.value()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn damage_anywhere_is_an_error_and_never_a_film() {
        let parts = Parts { split: Split::Tiles, of: 4, has: vec![1, 3] };
        let about = About {
            program: "1".to_owned(),
            scene: "a.xml".to_owned(),
            fingerprint: "0f".to_owned(),
            samples: 8,
            options: vec![("seed".to_owned(), "0".to_owned())],
            layers: vec!["total".to_owned()],
            has_layers: false,
            unfinished: None,
            parts: Some(parts),
        };
        let measured = Measured { noise: 0.5, audit_rays: 3 };
        let film = FilmFile { tag: 7, about, measured, caches: vec![1], grid: vec![], picture: vec![2; 40] };
        let bytes = film.to_bytes();
        assert_eq!(FilmFile::of(&bytes), Ok(film));
        for at in 0..bytes.len() {
            for bit in [1, 128] {
                let mut damaged = bytes.clone();
                damaged[at] ^= bit;
                assert!(FilmFile::of(&damaged).is_err(), "{at}");
            }
            assert!(FilmFile::of(&bytes[..at]).is_err(), "{at}");
        }
        assert!(FilmFile::of(&[&bytes[..], &[0]].concat()).is_err());
    }

    #[test]
    fn numbers_in_a_row_are_a_run() {
        assert_eq!(numbers(&[1, 3, 4, 5, 9, 10]), "1, 3–5, 9–10");
        assert_eq!(numbers(&[]), "");
    }
}
