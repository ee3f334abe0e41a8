//! All caches of a world as bytes.
//!
//! Little endian, without gaps; every part is what [`bytes`] writes:
//!
//! | offset | bytes | what |
//! |---|---|---|
//! | 0 | 8 | [`MAGIC`] |
//! | 8 | 4 | [`VERSION`] |
//! | 12 | 4 | number of parts `p` |
//! | 16 | 4 | number of views `v` |
//! | 20 | 4 | 1 if a fill was left before its end and its records are still to be estimated anew, else 0 |
//! | 24 | 8 | tag: what the caches were made for |
//! | 32 | 8 | CRC-64 of bytes 0 to 32 and of both tables below |
//! | 40 | 40 p | a part each: number of the [`Kind`], degree, tolerance (`f32`), samples per record, least and greatest radius, clearance, free paths (`f32`), length in bytes (8) |
//! | 40 + 40 p | 8 v | marks of the views that were filled to the end |
//! | 40 + 40 p + 8 v | … | the parts, one after the other |

use core::fmt;

use super::bytes::{self, BytesError};
use super::caches::RadianceCaches;
use super::kind::Kind;
use super::radius::Limits;
use super::record::Attachment;
use super::settings::Effort;
use super::slot::Slot;
use super::store::Cache;
use crate::bytes::{Damage, Format, Sink, halves, long, word};
use crate::math::digits::Digits;
use crate::storage::Full;

/// The first bytes.
const MAGIC: [u8; 8] = *b"\x89FOGSET\n";

/// Of the layout above.
const VERSION: u32 = 5;

const FORMAT: Format = Format { magic: MAGIC, version: VERSION, header: HEADER, what: "file of radiance caches" };

/// Length of the header, of a part's row and of a view's (bytes).
const HEADER: usize = 40;
const ROW: usize = 40;
const VIEW: usize = 8;

/// Why bytes are not the caches asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum CachesError {
    /// No such bytes, damaged tables, or made for something else.
    Damage(Damage),
    /// The tables name no caches, or the same twice.
    Parts,
    /// Holds other caches than are asked for.
    Absent {
        /// The cache in question.
        part: Kind,
        /// Whether it was asked for, and is not there.
        is_asked_for: bool,
    },
    /// Made with other settings.
    Setting {
        /// The cache in question.
        part: Kind,
        /// Which one.
        what: &'static str,
        /// As in the file.
        found: f32,
        /// As asked for.
        due: f32,
    },
    /// A cache in it is damaged.
    Part {
        /// Which one.
        part: Kind,
        /// In what way.
        problem: BytesError,
    },
    /// Lent storage has no room for it.
    Full,
}

impl From<Damage> for CachesError {
    fn from(damage: Damage) -> Self {
        Self::Damage(damage)
    }
}

impl From<Full> for CachesError {
    fn from(_: Full) -> Self {
        Self::Full
    }
}

impl fmt::Display for CachesError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Damage(damage) => damage.fmt(f),
            Self::Parts => f.write_str("names caches that are not known, or one of them twice"),
            Self::Absent { part, is_asked_for: true } => {
                write!(f, "has no cache \"{}\", which is asked for", part.name())
            }
            Self::Absent { part, .. } => write!(f, "has a cache \"{}\", which is not asked for", part.name()),
            Self::Setting { part, what, found, due } => {
                let (found, due) = (Digits(*found), Digits(*due));
                write!(f, "its cache \"{}\" was made with {what} {found}; {due} is asked for", part.name())
            }
            Self::Full => f.write_str("does not fit into the memory lent for it"),
            Self::Part { part, problem } => write!(f, "its cache \"{}\" {problem}", part.name()),
        }
    }
}

impl core::error::Error for CachesError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Part { problem, .. } => Some(problem),
            _ => None,
        }
    }
}

impl RadianceCaches<'_> {
    /// Number of bytes that [`RadianceCaches::write`] writes.
    #[must_use]
    pub fn byte_count(&self) -> usize {
        let parts: usize = self.parts().map(|(_, _, length)| ROW + length).sum();
        HEADER + VIEW * self.views.len() + parts
    }

    /// The parts there are: kind, effort, length in bytes.
    fn parts(&self) -> impl Iterator<Item = (Kind, Effort, usize)> + '_ {
        Kind::ALL.into_iter().filter_map(|kind| {
            let length = match &self.slots[kind] {
                Slot::Off => return None,
                Slot::Volume(cache) => bytes::byte_count(cache),
                Slot::Surface(cache) => bytes::byte_count(cache),
            };
            Some((kind, self.settings.asked(kind)?, length))
        })
    }

    /// Writes all caches, piece by piece, to `sink`. `tag` says what they were made for: what changes the light in the
    /// world.
    ///
    /// # Errors
    /// Those of `sink`.
    pub fn write<X>(&self, tag: u64, mut sink: impl FnMut(&[u8]) -> Result<(), X>) -> Result<(), X> {
        let counts = [self.parts().count() as u32, self.views.len() as u32, u32::from(self.is_open())];
        let tables = |each: Sink<'_, X>| {
            for (kind, effort, length) in self.parts() {
                let Limits { min, max } = effort.limits;
                let words = [kind as u32, effort.degree as u32, effort.tolerance.to_bits(), effort.samples];
                let bounds = [min, max, effort.clearance, effort.free_paths].map(f32::to_bits);
                words.iter().chain(&bounds).try_for_each(|word| each(&word.to_le_bytes()))?;
                each(&(length as u64).to_le_bytes())?;
            }
            self.views.as_slice().iter().try_for_each(|view| each(&view.to_le_bytes()))
        };
        FORMAT.write(counts.into_iter().chain(halves(tag)), &tables, &mut sink)?;
        for (kind, ..) in self.parts() {
            match &self.slots[kind] {
                Slot::Off => {}
                Slot::Volume(cache) => bytes::write(cache, tag, &mut sink)?,
                Slot::Surface(cache) => bytes::write(cache, tag, &mut sink)?,
            }
        }
        Ok(())
    }

    /// As [`RadianceCaches::write`], all in one.
    #[cfg(feature = "alloc")]
    #[must_use]
    pub fn to_bytes(&self, tag: u64) -> alloc::vec::Vec<u8> {
        let mut all = alloc::vec::Vec::with_capacity(self.byte_count());
        let Ok(()) = self.write(tag, |part| {
            all.extend_from_slice(part);
            Ok::<(), core::convert::Infallible>(())
        });
        all
    }

    /// Reads what [`RadianceCaches::write`] wrote with the same `tag` in place of what is there. [`RadianceCaches::settings`] must ask for
    /// the same kinds and degrees. Tolerances and reaches that are smaller and samples that are more than asked for are taken over, larger tolerances and
    /// fewer samples are errors; the rest may differ.
    ///
    /// ```
    /// # #[cfg(feature = "alloc")] {
    /// use fogbow::cache::{Effort, Limits, RadianceCaches, Settings};
    /// let limits = Limits { min: 0.01, max: 1.0 };
    /// let effort = Effort { tolerance: 0.5, samples: 64, degree: 2, limits, clearance: 1.0, free_paths: 1.0 };
    /// let settings = Settings { multiple: Some(effort), ..Settings::default() };
    ///
    /// let bytes = RadianceCaches::new(settings).to_bytes(7);
    /// assert!(RadianceCaches::new(settings).read(&bytes, 7).is_ok());
    /// let error = RadianceCaches::new(settings).read(&bytes, 8).unwrap_err();
    /// assert!(error.to_string().contains("something else"));
    ///
    /// let sharper = Settings { multiple: Some(Effort { degree: 4, ..effort }), ..settings };
    /// let error = RadianceCaches::new(sharper).read(&bytes, 7).unwrap_err();
    /// assert!(error.to_string().contains("degree 2; 4 is asked for"));
    /// # }
    /// ```
    ///
    /// # Errors
    /// The first check that fails; of what was there some may be lost then.
    pub fn read(&mut self, bytes: &[u8], tag: u64) -> Result<(), CachesError> {
        fn fill<E: Attachment>(
            cache: &mut Cache<'_, E>,
            bytes: &[u8],
            tag: u64,
            part: Kind,
        ) -> Result<(), CachesError> {
            bytes::read_into(bytes, tag, cache).map_err(|problem| CachesError::Part { part, problem })
        }
        let (rows, views) = rows(bytes, tag)?;
        for (part, row) in Kind::ALL.into_iter().zip(&rows) {
            let (found, due) = match (row, self.settings.asked(part)) {
                (Some(row), Some(effort)) => (row.effort, effort),
                (None, None) => continue,
                (_, effort) => return Err(CachesError::Absent { part, is_asked_for: effort.is_some() }),
            };
            let (degrees, samples) = ([found.degree, due.degree], [found.samples, due.samples]);
            let checks = [
                ("degree", degrees.map(|degree| degree as f32), degrees[0] == degrees[1]),
                ("tolerance", [found.tolerance, due.tolerance], found.tolerance <= due.tolerance),
                ("samples per record", samples.map(|samples| samples as f32), samples[0] >= samples[1]),
            ];
            if let Some(&(what, [found, due], _)) = checks.iter().find(|(.., fits)| !fits) {
                return Err(CachesError::Setting { part, what, found, due });
            }
        }
        for (kind, row) in Kind::FINAL.into_iter().filter_map(|kind| Some((kind, rows[kind as usize].as_ref()?))) {
            if let Some(effort) = self.settings.effort_mut(kind) {
                // Pilots and repairs have made records reach less far: those that are missing shall not reach farther again.
                let (min, finer) = (effort.limits.min, effort.or_finer(&row.effort));
                *effort = Effort { limits: Limits { min, max: finer.limits.max.max(min) }, ..finer };
            }
        }
        self.views.clear();
        for (kind, row) in Kind::ALL.into_iter().zip(rows) {
            let Some(row) = row else { continue };
            match &mut self.slots[kind] {
                Slot::Off => {}
                Slot::Volume(cache) => fill(cache, row.bytes, tag, kind)?,
                Slot::Surface(cache) => fill(cache, row.bytes, tag, kind)?,
            }
        }
        views.chunks_exact(VIEW).try_for_each(|view| self.views.push(long(view, 0)))?;
        for kind in Kind::ALL {
            self.settled[kind] = if word(bytes, 20) == 0 { self.slots[kind].len() } else { 0 };
        }
        Ok(())
    }
}

/// A part as the table has it.
#[derive(Clone, Copy)]
struct Row<'a> {
    effort: Effort,
    bytes: &'a [u8],
}

/// The parts of a set, by kind, and the bytes of its views.
type Rows<'a> = ([Option<Row<'a>>; Kind::COUNT], &'a [u8]);

/// What the tables say, once header and length are found sound.
fn rows(file: &[u8], tag: u64) -> Result<Rows<'_>, CachesError> {
    let header = FORMAT.header(file)?;
    let rest = &file[HEADER..];
    let (parts, views) = (u64::from(header.word(12)), u64::from(header.word(16)));
    let tables = parts * ROW as u64 + views * VIEW as u64;
    let split = usize::try_from(tables).ok().and_then(|tables| rest.split_at_checked(tables));
    let cut = Damage::Length { found: file.len() as u64, due: HEADER as u64 + tables };
    let (tables, mut rest) = split.ok_or(cut)?;
    header.check(tables)?;
    let (table, views) = tables.split_at(parts as usize * ROW);
    let lengths = table.chunks_exact(ROW).map(|row| long(row, 32));
    let before = (HEADER + tables.len()) as u64;
    Damage::unless_length(file.len(), lengths.fold(before, u64::saturating_add))?;
    let mut rows = [None; Kind::COUNT];
    for row in table.chunks_exact(ROW) {
        let slot = rows.get_mut(word(row, 0) as usize).filter(|slot| slot.is_none()).ok_or(CachesError::Parts)?;
        let number = |at| f32::from_bits(word(row, at));
        let effort = Effort {
            degree: word(row, 4) as usize,
            tolerance: number(8),
            samples: word(row, 12),
            limits: Limits { min: number(16), max: number(20) },
            clearance: number(24),
            free_paths: number(28),
        };
        // Their sum is the length of the rest.
        let (bytes, others) = rest.split_at_checked(long(row, 32) as usize).ok_or(CachesError::Parts)?;
        (*slot, rest) = (Some(Row { effort, bytes }), others);
    }
    Damage::unless_tag(header.long(24), tag)?;
    Ok((rows, views))
}
