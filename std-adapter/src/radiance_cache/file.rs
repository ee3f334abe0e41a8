//! All caches of a scene in one file.
//!
//! Little endian, without gaps; every part is what [`fogbow::cache::bytes`] writes:
//!
//! | offset | bytes | what |
//! |---|---|---|
//! | 0 | 8 | [`MAGIC`] |
//! | 8 | 4 | [`VERSION`] |
//! | 12 | 4 | number of parts `p` |
//! | 16 | 4 | number of views `v` |
//! | 20 | 4 | 1 if a fill was cancelled and its records are still to be estimated anew, else 0 |
//! | 24 | 8 | tag: what the caches were made for |
//! | 32 | 8 | CRC-64 of bytes 0 to 32 and of both tables below |
//! | 40 | 36 p | a part each: number of the cache, degree, tolerance (`f32`), samples per record, least and greatest radius, clearance (`f32`), length in bytes (8) |
//! | 40 + 36 p | 8 v | [`RadianceCaches::views`] |
//! | 40 + 36 p + 8 v | … | the parts, one after the other |

use core::fmt;
use std::io;
use std::path::{Path, PathBuf};

use fogbow::bytes::Crc;
use fogbow::cache::Limits;
use fogbow::cache::bytes::{self, Attachment, BytesError};

use super::{Cache, Effort, RadianceCaches, Settings};
use crate::files;

/// The first bytes.
const MAGIC: [u8; 8] = *b"\x89FOGSET\n";

/// Of the layout above.
const VERSION: u32 = 3;

/// Length of the header, of a part's row and of a view's (bytes).
const HEADER: usize = 40;
const ROW: usize = 36;
const VIEW: usize = 8;

/// Names of the parts, in the order of their numbers.
const PARTS: [&str; 6] = ["single", "surface", "multiple", "irradiance", "coarse multiple", "coarse irradiance"];

/// What is wrong with a file of caches.
#[derive(Debug)]
pub struct FileError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong.
    pub problem: Problem,
}

/// Why a file of caches is not used, in the order of the checks.
#[derive(Debug)]
#[non_exhaustive]
pub enum Problem {
    /// The system cannot read or write it.
    Io(io::Error),
    /// It is a directory or a device.
    NoFile,
    /// Other first bytes: something else altogether.
    Magic,
    /// Of another version of the format.
    Version(u32),
    /// Not as long as its header and tables say.
    Length {
        /// Its length (bytes).
        found: u64,
        /// What it says.
        due: u64,
    },
    /// Header or tables are damaged.
    Checksum,
    /// The tables name no caches, or the same twice.
    Parts,
    /// Made for something else.
    Tag {
        /// What it was made for.
        found: u64,
        /// What was asked for.
        due: u64,
    },
    /// Holds other caches than are asked for.
    Absent {
        /// The cache in question.
        part: &'static str,
        /// Whether it was asked for, and is not there.
        is_asked_for: bool,
    },
    /// Made with other settings.
    Setting {
        /// The cache in question.
        part: &'static str,
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
        part: &'static str,
        /// In what way.
        problem: BytesError,
    },
}

impl fmt::Display for FileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.path.display(), self.problem)
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Io(error) => error.fmt(f),
            Self::NoFile => f.write_str("is not a file"),
            Self::Magic => f.write_str("is not a file of radiance caches: other first bytes"),
            Self::Version(found) => write!(f, "has version {found} of the format; {VERSION} is known"),
            Self::Length { found, due } if found < due => {
                write!(f, "is cut off: {due} bytes are due, {found} are there")
            }
            Self::Length { found, due } => write!(f, "goes on after its end: {due} bytes are due, {found} are there"),
            Self::Checksum => f.write_str("is damaged: the checksum of its header is another"),
            Self::Parts => f.write_str("names caches that are not known, or one of them twice"),
            Self::Tag { found, due } => write!(f, "was made for something else (tag {found:016x}, not {due:016x})"),
            Self::Absent { part, is_asked_for: true } => write!(f, "has no cache \"{part}\", which is asked for"),
            Self::Absent { part, .. } => write!(f, "has a cache \"{part}\", which is not asked for"),
            Self::Setting { part, what, found, due } => {
                write!(f, "its cache \"{part}\" was made with {what} {found}; {due} is asked for")
            }
            Self::Part { part, problem } => write!(f, "its cache \"{part}\" {problem}"),
        }
    }
}

impl core::error::Error for FileError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match &self.problem {
            Problem::Io(error) => Some(error),
            Problem::Part { problem, .. } => Some(problem),
            _ => None,
        }
    }
}

impl From<io::Error> for Problem {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

/// Writes all caches to a file. `tag` says what they were made for: what changes the light in the scene.
///
/// The old file, if there is one, is replaced when the new one is complete.
///
/// # Errors
/// What the system says.
pub fn save(file: impl AsRef<Path>, caches: &RadianceCaches, tag: u64) -> Result<(), FileError> {
    let path = file.as_ref();
    files::replace(path, &encode(caches, tag))
        .map_err(|error| FileError { path: path.to_owned(), problem: error.into() })
}

/// Reads what [`save`] wrote with the same `tag`, to be used with `settings`: they must ask for the same
/// caches, with the same tolerances, samples and degrees. The rest may differ.
///
/// # Errors
/// The first check that fails.
///
/// ```
/// use fogbow::cache::Limits;
/// use fogbow_std::radiance_cache::{Effort, RadianceCaches, Settings, load, save};
/// let limits = Limits { min: 0.01, max: 1.0 };
/// let effort = Effort { tolerance: 0.5, samples: 64, degree: 2, limits, clearance: 1.0 };
/// let settings = Settings { multiple: Some(effort), ..Settings::default() };
///
/// let file = std::env::temp_dir().join("fogbow-std-caches.fog");
/// save(&file, &RadianceCaches::new(settings), 7)?;
/// assert!(load(&file, settings, 7).is_ok());
/// assert!(load(&file, settings, 8).unwrap_err().to_string().contains("something else"));
///
/// let sharper = Settings { multiple: Some(Effort { degree: 4, ..effort }), ..settings };
/// assert!(load(&file, sharper, 7).unwrap_err().to_string().contains("degree 2; 4 is asked for"));
/// # std::fs::remove_file(&file)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn load(file: impl AsRef<Path>, settings: Settings, tag: u64) -> Result<RadianceCaches, FileError> {
    let path = file.as_ref();
    files::read(path)
        .map_err(Problem::Io)
        .and_then(|bytes| bytes.ok_or(Problem::NoFile))
        .and_then(|bytes| decode(&bytes, settings, tag))
        .map_err(|problem| FileError { path: path.to_owned(), problem })
}

/// The efforts of all parts, in the order of [`PARTS`].
fn efforts(settings: &Settings) -> [Option<Effort>; 6] {
    let Settings { single, surface, multiple, irradiance, .. } = *settings;
    [single, surface, multiple, irradiance, settings.coarse_multiple(), settings.coarse_irradiance()]
}

/// What [`save`] writes, for hosts without files.
#[must_use]
pub fn encode(caches: &RadianceCaches, tag: u64) -> Vec<u8> {
    fn part<E: Attachment>(cache: Option<&Cache<'_, E>>, tag: u64) -> Option<Vec<u8>> {
        let cache = cache?;
        let mut part = Vec::with_capacity(bytes::byte_count(cache));
        let Ok(()) = bytes::write(cache, tag, |more| {
            part.extend_from_slice(more);
            Ok::<(), core::convert::Infallible>(())
        });
        Some(part)
    }
    let parts = [
        part(caches.single.as_ref(), tag),
        part(caches.surface.as_ref(), tag),
        part(caches.multiple.as_ref(), tag),
        part(caches.irradiance.as_ref(), tag),
        part(caches.coarse_multiple.as_ref(), tag),
        part(caches.coarse_irradiance.as_ref(), tag),
    ];
    let mut tables = Vec::new();
    let mut count = 0_u32;
    for ((number, part), effort) in (0_u32..).zip(&parts).zip(efforts(&caches.settings)) {
        let (Some(part), Some(effort)) = (part, effort) else { continue };
        count += 1;
        let Limits { min, max } = effort.limits;
        let words = [number, effort.degree as u32, effort.tolerance.to_bits(), effort.samples];
        let bounds = [min, max, effort.clearance].map(f32::to_bits);
        words.iter().chain(&bounds).for_each(|word| tables.extend(word.to_le_bytes()));
        tables.extend((part.len() as u64).to_le_bytes());
    }
    caches.views.iter().for_each(|view| tables.extend(view.to_le_bytes()));
    let mut file = MAGIC.to_vec();
    let is_open = caches.settled != caches.all_counts();
    [VERSION, count, caches.views.len() as u32, u32::from(is_open)]
        .iter()
        .for_each(|word| file.extend(word.to_le_bytes()));
    file.extend(tag.to_le_bytes());
    file.extend(checksum(&file, &tables).to_le_bytes());
    file.extend(tables);
    for (part, effort) in parts.iter().zip(efforts(&caches.settings)) {
        if let (Some(part), Some(_)) = (part, effort) {
            file.extend(part);
        }
    }
    file
}

fn checksum(header: &[u8], tables: &[u8]) -> u64 {
    let mut crc = Crc::new();
    crc.add(header);
    crc.add(tables);
    crc.value()
}

/// A part as the table has it.
#[derive(Clone, Copy)]
struct Row<'a> {
    effort: Effort,
    bytes: &'a [u8],
}

/// As [`load`], from bytes.
///
/// # Errors
/// The first check that fails.
pub fn decode(file: &[u8], settings: Settings, tag: u64) -> Result<RadianceCaches, Problem> {
    let (rows, views) = rows(file, tag)?;
    for ((part, row), effort) in PARTS.into_iter().zip(&rows).zip(efforts(&settings)) {
        let (found, due) = match (row, effort) {
            (Some(row), Some(effort)) => (row.effort, effort),
            (None, None) => continue,
            (_, effort) => return Err(Problem::Absent { part, is_asked_for: effort.is_some() }),
        };
        let pairs = [
            ("degree", found.degree as f32, due.degree as f32),
            ("tolerance", found.tolerance, due.tolerance),
            ("samples per record", found.samples as f32, due.samples as f32),
        ];
        if let Some(&(what, found, due)) = pairs.iter().find(|(_, found, due)| found != due) {
            return Err(Problem::Setting { part, what, found, due });
        }
    }
    fn fill<E: Attachment>(
        cache: &mut Option<Cache<'static, E>>,
        rows: &[Option<Row<'_>>; 6],
        number: usize,
        tag: u64,
    ) -> Result<(), Problem> {
        let (Some(cache), Some(row)) = (cache, rows[number]) else { return Ok(()) };
        bytes::read_into(row.bytes, tag, cache).map_err(|problem| Problem::Part { part: PARTS[number], problem })
    }
    let mut caches = RadianceCaches::new(settings);
    fill(&mut caches.single, &rows, 0, tag)?;
    fill(&mut caches.surface, &rows, 1, tag)?;
    fill(&mut caches.multiple, &rows, 2, tag)?;
    fill(&mut caches.irradiance, &rows, 3, tag)?;
    fill(&mut caches.coarse_multiple, &rows, 4, tag)?;
    fill(&mut caches.coarse_irradiance, &rows, 5, tag)?;
    caches.views = views;
    if word(file, 20) == 0 {
        caches.settled = caches.all_counts();
    }
    Ok(caches)
}

/// What the tables of a file say, once header and length are found sound.
fn rows(file: &[u8], tag: u64) -> Result<([Option<Row<'_>>; 6], Vec<u64>), Problem> {
    let length = |due: u64| Problem::Length { found: file.len() as u64, due };
    if !file.starts_with(&MAGIC) {
        // A few bytes of a header are a file cut off; nothing, or anything else, is not one.
        let is_start = !file.is_empty() && MAGIC.starts_with(file);
        return Err(if is_start { length(HEADER as u64) } else { Problem::Magic });
    }
    let (header, rest) = file.split_at_checked(HEADER).ok_or_else(|| length(HEADER as u64))?;
    if word(header, 8) != VERSION {
        return Err(Problem::Version(word(header, 8)));
    }
    let (parts, views) = (u64::from(word(header, 12)), u64::from(word(header, 16)));
    let tables = parts * ROW as u64 + views * VIEW as u64;
    let split = usize::try_from(tables).ok().and_then(|tables| rest.split_at_checked(tables));
    let (tables, mut rest) = split.ok_or_else(|| length(HEADER as u64 + tables))?;
    if checksum(&header[..32], tables) != long(header, 32) {
        return Err(Problem::Checksum);
    }
    let (table, views) = tables.split_at(parts as usize * ROW);
    let lengths = table.chunks_exact(ROW).map(|row| long(row, 28));
    let before = (HEADER + tables.len()) as u64;
    let due = lengths.fold(before, u64::saturating_add);
    if due != file.len() as u64 {
        return Err(length(due));
    }
    let mut rows = [None; 6];
    for row in table.chunks_exact(ROW) {
        let slot = rows.get_mut(word(row, 0) as usize).filter(|slot| slot.is_none()).ok_or(Problem::Parts)?;
        let number = |at| f32::from_bits(word(row, at));
        let effort = Effort {
            degree: word(row, 4) as usize,
            tolerance: number(8),
            samples: word(row, 12),
            limits: Limits { min: number(16), max: number(20) },
            clearance: number(24),
        };
        // Their sum is the length of the rest.
        let (bytes, others) = rest.split_at_checked(long(row, 28) as usize).ok_or(Problem::Parts)?;
        (*slot, rest) = (Some(Row { effort, bytes }), others);
    }
    if long(header, 24) != tag {
        return Err(Problem::Tag { found: long(header, 24), due: tag });
    }
    Ok((rows, views.chunks_exact(VIEW).map(|view| long(view, 0)).collect()))
}

fn word(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

fn long(bytes: &[u8], at: usize) -> u64 {
    u64::from(word(bytes, at)) | u64::from(word(bytes, at + 4)) << 32
}
