//! Grids of probes as bytes: all that is needed to look them up, and to go on baking.
//!
//! Little endian on every target, without gaps:
//!
//! | offset | bytes | what |
//! |---|---|---|
//! | 0 | 8 | [`MAGIC`] |
//! | 8 | 4 | [`VERSION`] |
//! | 12 | 12 | probes along x, y, z |
//! | 24 | 24 | smallest and largest corner (m), as `f32` |
//! | 48 | 4 | basis: degree of spherical harmonics, 16 an ambient cube, 17 fluence |
//! | 52 | 4 | 0 in-scattered radiance, 1 irradiance; 256 more if some bricks alone are there, with 64 probes each |
//! | 56 | 4 | orders: 0 all, 1 indirect, 2 multiple |
//! | 60 | 4 | number of bricks `b` |
//! | 64 | 8 | tag: what the grid was made for, a number of the host's choice |
//! | 72 | 8 | [`Crc`] of bytes 0 to 72 and of all from 80 on |
//! | 80 | 12 n k | numbers in colour, `k` of each of `n` probes, as `f32` |
//! | | 4 n k | their sums of squared deviations over passes, a mean over channels, as `f32` |
//! | | 80 n | extinction and albedo in colour, planes of four surfaces, share of its cell, as `f32`; as `u32` state in bits 0 to 2, [`Probe::is_inner`] in bit 3, surfaces before the next probes in bits 4 to 6 |
//! | | 8 b | passes, and passes that are due |
//! | | 4 b | where some bricks alone are there: which, as [`ProbeGrid::places`] |
//!
//! [`ProbeLevels`] are one such grid after the other, the one that has all probes first.

use core::fmt;

use glam::Vec3;

use super::basis::{Orders, ProbeBasis, Quantity};
use super::grid::{BakeMemory, Brick, INNER, PROBES, Probe, ProbeGrid, ProbeState, STATE, WALLS};
use super::levels::ProbeLevels;
use super::settings::MOST_PROBES;
use crate::bytes::{Crc, element, elements};
use crate::covariance::Lattice;
use crate::math::Bounds;
use crate::spectrum::Spectrum;
use crate::storage::{Full, List};

/// The first bytes: not text, and damaged by whatever changes ends of lines.
pub const MAGIC: [u8; 8] = *b"\x89FOGBAK\n";

/// Of the layout above.
pub const VERSION: u32 = 2;

/// Length of the header (bytes).
pub const HEADER_BYTES: usize = 80;

/// Offset of the tag.
const TAG_AT: usize = 64;

/// Added to the quantity where some bricks alone are there.
const SPARSE: u32 = 256;

const AMBIENT_CUBE: u32 = 16;
const FLUENCE: u32 = 17;

/// Why bytes are not the grid asked for, in the order of the checks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum ProbeBytesError {
    /// Fewer bytes than a header.
    NoHeader {
        /// How many there are.
        found: usize,
    },
    /// Other first bytes: something else altogether.
    Magic,
    /// Of another version than [`VERSION`].
    Version(u32),
    /// Bounds, numbers of probes or a basis that no grid has.
    Layout,
    /// Not as many bytes as the header says.
    Length {
        /// How many there are.
        found: usize,
        /// How many the header says.
        due: usize,
    },
    /// Damaged.
    Checksum,
    /// Made for something else.
    Tag {
        /// What it was made for.
        found: u64,
        /// What was asked for.
        due: u64,
    },
    /// A probe that holds what no bake leaves: a number that is not finite, a state that is not known.
    Probe(usize),
    /// The storage is too small.
    Storage,
}

impl fmt::Display for ProbeBytesError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoHeader { found } => write!(f, "ends after {found} bytes, before its header of {HEADER_BYTES} does"),
            Self::Magic => f.write_str("is no grid of probes: other first bytes"),
            Self::Version(version) => write!(f, "has version {version} of the format; {VERSION} is known"),
            Self::Layout => f.write_str("has bounds, numbers of probes or a basis that no grid has"),
            Self::Length { found, due } if found < due => {
                write!(f, "is cut off: {due} bytes are due, {found} are there")
            }
            Self::Length { found, due } => write!(f, "goes on after its end: {due} bytes are due, {found} are there"),
            Self::Checksum => f.write_str("is damaged: the checksum is another"),
            Self::Tag { found, due } => write!(f, "was made for something else (tag {found:016x}, not {due:016x})"),
            Self::Probe(index) => write!(f, "has a probe that is not valid: number {index}"),
            Self::Storage => f.write_str("has more probes than there is memory for"),
        }
    }
}

impl core::error::Error for ProbeBytesError {}

/// How many bytes [`write()`] writes.
///
/// ```
/// # use fogbow::{host::Empty, math::{Bounds, Vec3}, world::{Outline, World}};
/// # use fogbow::bake::{Bake, BakeSettings, bytes};
/// # #[cfg(feature = "alloc")] {
/// # let bounds = Bounds { min: Vec3::ZERO, max: Vec3::ONE };
/// # let outline = Outline::of(&World { medium: &Empty, scene: &Empty, lights: (&[]).into() }, bounds);
/// let grid = Bake::new(BakeSettings::for_outline(&outline, [5, 4, 4]))?.finish();
/// // 80 probes of nine coefficients, two bricks.
/// assert_eq!(bytes::byte_count(&grid), 80 + 80 * 9 * 16 + 80 * 80 + 2 * 8);
/// # }
/// # Ok::<(), fogbow::bake::BakeError>(())
/// ```
#[must_use]
pub fn byte_count(grid: &ProbeGrid<'_>) -> usize {
    HEADER_BYTES + grid.bytes()
}

/// Writes a grid to `sink`, part after part. `tag` says what it was made for: whoever reads it must give the same.
///
/// # Errors
/// The first of `sink`.
///
/// ```
/// # use fogbow::{host::Empty, math::{Bounds, Vec3}, storage::List, world::{Outline, World}};
/// # use fogbow::bake::{Bake, BakeMemory, BakeSettings, bytes::{self, ProbeBytesError}};
/// # #[cfg(feature = "alloc")] {
/// # let bounds = Bounds { min: Vec3::ZERO, max: Vec3::ONE };
/// # let outline = Outline::of(&World { medium: &Empty, scene: &Empty, lights: (&[]).into() }, bounds);
/// let grid = Bake::new(BakeSettings::for_outline(&outline, [2, 3, 4]))?.finish();
/// let mut file = Vec::new();
/// let Ok(()) = bytes::write(&grid, 7, |part| Ok::<_, core::convert::Infallible>(file.extend(part)));
/// assert_eq!(file.len(), bytes::byte_count(&grid));
/// let copy = bytes::read(&file, 7, BakeMemory::default())?;
/// assert_eq!((copy.lattice(), copy.basis()), (grid.lattice(), grid.basis()));
/// let other = bytes::read(&file, 8, BakeMemory::default());
/// assert_eq!(other.err(), Some(ProbeBytesError::Tag { found: 7, due: 8 }));
/// # }
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
pub fn write<F>(grid: &ProbeGrid<'_>, tag: u64, mut sink: impl FnMut(&[u8]) -> Result<(), F>) -> Result<(), F> {
    let mut header = [0; HEADER_BYTES];
    header[..8].copy_from_slice(&MAGIC);
    let basis = match grid.basis {
        ProbeBasis::SphericalHarmonics { degree } => degree,
        ProbeBasis::AmbientCube => AMBIENT_CUBE,
        ProbeBasis::Fluence => FLUENCE,
    };
    let ([nx, ny, nz], bounds) = (grid.lattice.size(), grid.lattice.bounds());
    let [low, high] = [bounds.min, bounds.max].map(|corner| corner.to_array().map(f32::to_bits));
    let quantity = grid.quantity as u32 + if grid.is_sparse() { SPARSE } else { 0 };
    let last = [basis, quantity, grid.orders as u32, grid.memory.bricks.len() as u32];
    let words = [VERSION, nx, ny, nz].into_iter().chain(low).chain(high).chain(last);
    for (to, word) in header[8..64].chunks_exact_mut(4).zip(words) {
        to.copy_from_slice(&word.to_le_bytes());
    }
    header[64..72].copy_from_slice(&tag.to_le_bytes());
    let mut crc = Crc::new();
    crc.add(&header[..72]);
    fn all<F>(memory: &BakeMemory<'_>, sink: &mut impl FnMut(&[u8]) -> Result<(), F>) -> Result<(), F> {
        let BakeMemory { values, deviations, probes, bricks, places } = memory;
        elements(values.as_slice(), sink)?;
        elements(deviations.as_slice(), sink)?;
        elements(probes.as_slice(), sink)?;
        elements(bricks.as_slice(), sink)?;
        elements(places.as_slice(), sink)
    }
    let Ok(()) = all(&grid.memory, &mut |bytes: &[u8]| {
        crc.add(bytes);
        Ok::<(), core::convert::Infallible>(())
    });
    header[72..].copy_from_slice(&crc.value().to_le_bytes());
    sink(&header)?;
    all(&grid.memory, &mut sink)
}

/// What a grid was made for: for hosts that want any.
///
/// # Errors
/// Bytes that do not begin as those of a grid do; no more is looked at.
///
/// ```
/// # use fogbow::bake::bytes::{ProbeBytesError, tag};
/// assert_eq!(tag(&[0; 99]), Err(ProbeBytesError::Magic));
/// ```
pub fn tag(bytes: &[u8]) -> Result<u64, ProbeBytesError> {
    let header = header(bytes)?;
    Ok(long(header, TAG_AT))
}

fn header(bytes: &[u8]) -> Result<&[u8; HEADER_BYTES], ProbeBytesError> {
    let header = bytes.first_chunk::<HEADER_BYTES>().ok_or(ProbeBytesError::NoHeader { found: bytes.len() })?;
    if !header.starts_with(&MAGIC) {
        return Err(ProbeBytesError::Magic);
    }
    match word(header, 8) {
        VERSION => Ok(header),
        other => Err(ProbeBytesError::Version(other)),
    }
}

fn word(header: &[u8; HEADER_BYTES], at: usize) -> u32 {
    u32::from_le_bytes([header[at], header[at + 1], header[at + 2], header[at + 3]])
}

fn long(header: &[u8; HEADER_BYTES], at: usize) -> u64 {
    u64::from(word(header, at)) | u64::from(word(header, at + 4)) << 32
}

/// Reads what was written as `bytes` with the same `tag`, into `memory`.
///
/// # Errors
/// The first check that fails.
///
/// ```
/// # use fogbow::bake::{BakeMemory, bytes::{self, ProbeBytesError}};
/// # #[cfg(feature = "alloc")] {
/// let nothing = bytes::read(b"P6", 7, BakeMemory::default());
/// assert_eq!(nothing.err(), Some(ProbeBytesError::NoHeader { found: 2 }));
/// # }
/// ```
pub fn read<'s>(bytes: &[u8], tag: u64, memory: BakeMemory<'s>) -> Result<ProbeGrid<'s>, ProbeBytesError> {
    let header = header(bytes)?;
    let long = |at: usize| long(header, at);
    let (mut grid, sizes) = layout(header, memory)?;
    let due = HEADER_BYTES + sizes.iter().sum::<usize>();
    if bytes.len() != due {
        return Err(ProbeBytesError::Length { found: bytes.len(), due });
    }
    let mut crc = Crc::new();
    crc.add(&header[..72]);
    crc.add(&bytes[HEADER_BYTES..]);
    if crc.value() != long(72) {
        return Err(ProbeBytesError::Checksum);
    }
    if long(TAG_AT) != tag {
        return Err(ProbeBytesError::Tag { found: long(TAG_AT), due: tag });
    }
    let (values, rest) = bytes[HEADER_BYTES..].split_at(sizes[0]);
    let (deviations, rest) = rest.split_at(sizes[1]);
    let (states, rest) = rest.split_at(sizes[2]);
    let (progress, places) = rest.split_at(sizes[3]);
    let BakeMemory {
        values: to_values,
        deviations: to_deviations,
        probes: to_probes,
        bricks: to_bricks,
        places: to_places,
    } = &mut grid.memory;
    let mut copy = || {
        fill(to_values, values)?;
        fill(to_deviations, deviations)?;
        fill(to_probes, states)?;
        fill(to_bricks, progress)?;
        fill(to_places, places)
    };
    copy().map_err(|Full| ProbeBytesError::Storage)?;
    let all = grid.brick_counts().iter().map(|&n| n as usize).product::<usize>();
    let is_rising = grid.places().windows(2).all(|pair| pair[0] < pair[1]);
    if !is_rising || grid.places().last().is_some_and(|last| *last as usize >= all) {
        return Err(ProbeBytesError::Layout);
    }
    let each = grid.basis.count();
    for (index, probe) in grid.probes().iter().enumerate() {
        let deviations = &grid.memory.deviations.as_slice()[index * each..][..each];
        let is_number = grid.held(index).iter().all(|number| number.is_finite())
            && deviations.iter().all(|deviation| *deviation >= 0.0 && deviation.is_finite())
            && probe.extinction.is_valid()
            && probe.albedo.is_valid()
            && [probe.near, probe.other, probe.third, probe.fourth].iter().all(|plane| plane.is_finite())
            && (0.0..=1.0).contains(&probe.open);
        let is_known = probe.state & STATE <= ProbeState::Empty as u32 && probe.state & !(STATE | INNER | WALLS) == 0;
        if !is_number || !is_known {
            return Err(ProbeBytesError::Probe(index));
        }
    }
    Ok(grid)
}

/// What a header says, and how many bytes each part takes: numbers, deviations, probes, bricks, places.
fn layout<'s>(
    header: &[u8; HEADER_BYTES],
    memory: BakeMemory<'s>,
) -> Result<(ProbeGrid<'s>, [usize; 5]), ProbeBytesError> {
    let word = |at: usize| word(header, at);
    let counts = [word(12), word(16), word(20)];
    let corner = |at: usize| Vec3::from_array([0, 4, 8].map(|i| f32::from_bits(word(at + i))));
    let basis = match word(48) {
        degree @ 0..=3 => ProbeBasis::SphericalHarmonics { degree },
        AMBIENT_CUBE => ProbeBasis::AmbientCube,
        FLUENCE => ProbeBasis::Fluence,
        _ => return Err(ProbeBytesError::Layout),
    };
    let is_sparse = word(52) & SPARSE != 0;
    let quantity = match word(52) & !SPARSE {
        0 => Quantity::InScattered,
        1 => Quantity::Irradiance,
        _ => return Err(ProbeBytesError::Layout),
    };
    let orders = match word(56) {
        0 => Orders::All,
        1 => Orders::Indirect,
        2 => Orders::Multiple,
        _ => return Err(ProbeBytesError::Layout),
    };
    let bounds = Bounds { min: corner(24), max: corner(36) };
    let lattice = Lattice::new(bounds, counts).ok().filter(|lattice| lattice.bounds() == bounds);
    let lattice = lattice.ok_or(ProbeBytesError::Layout)?;
    let grid = ProbeGrid { lattice, basis, quantity, orders, memory };
    let (all, bricks) = (grid.brick_counts().iter().map(|&n| n as usize).product(), word(60) as usize);
    let probes = if is_sparse { bricks.saturating_mul(PROBES) } else { lattice.cell_count() };
    // Of some bricks alone, one at least.
    let is_possible = if is_sparse { (1..=all).contains(&bricks) } else { bricks == all };
    if !is_possible || probes > MOST_PROBES {
        return Err(ProbeBytesError::Layout);
    }
    let numbers = probes * basis.count();
    let sizes = [
        numbers * size_of::<Spectrum>(),
        numbers * size_of::<f32>(),
        probes * size_of::<Probe>(),
        bricks * size_of::<Brick>(),
        if is_sparse { bricks * size_of::<u32>() } else { 0 },
    ];
    Ok((grid, sizes))
}

/// Writes all levels to `sink`, as [`write()`] does.
///
/// # Errors
/// The first of `sink`.
///
/// ```
/// # use fogbow::{host::Empty, math::{Bounds, Vec3}, world::{Outline, World}};
/// # use fogbow::bake::{Bake, BakeMemory, BakeSettings, ProbeLevels, bytes::{self, ProbeBytesError}};
/// # #[cfg(feature = "alloc")] {
/// # let bounds = Bounds { min: Vec3::ZERO, max: Vec3::ONE };
/// # let outline = Outline::of(&World { medium: &Empty, scene: &Empty, lights: (&[]).into() }, bounds);
/// let levels = ProbeLevels::new(Bake::new(BakeSettings::for_outline(&outline, [2, 3, 4]))?.finish());
/// let mut file = Vec::new();
/// let Ok(()) = bytes::write_levels(&levels, 7, |part| Ok::<_, core::convert::Infallible>(file.extend(part)));
/// assert_eq!(bytes::read_levels(&file, 7, |_| BakeMemory::default())?.levels().len(), 1);
/// # }
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
pub fn write_levels<F>(
    levels: &ProbeLevels<'_>,
    tag: u64,
    mut sink: impl FnMut(&[u8]) -> Result<(), F>,
) -> Result<(), F> {
    levels.levels().iter().try_for_each(|grid| write(grid, tag, &mut sink))
}

/// Reads what [`write_levels`] has written, or [`write()`]; `memory` gives some for each level.
///
/// # Errors
/// The first check that fails; [`ProbeBytesError::Layout`] for levels that do not belong to each other.
///
/// ```
/// # use fogbow::bake::{BakeMemory, bytes::{self, ProbeBytesError}};
/// # #[cfg(feature = "alloc")] {
/// let nothing = bytes::read_levels(b"P6", 7, |_| BakeMemory::default());
/// assert_eq!(nothing.err(), Some(ProbeBytesError::NoHeader { found: 2 }));
/// # }
/// ```
pub fn read_levels<'s>(
    bytes: &[u8],
    tag: u64,
    mut memory: impl FnMut(usize) -> BakeMemory<'s>,
) -> Result<ProbeLevels<'s>, ProbeBytesError> {
    let mut rest = bytes;
    let mut next = |number: usize| {
        let sizes = levels_sizes(rest)?;
        let due = HEADER_BYTES + sizes.iter().sum::<usize>();
        let (grid, after) = rest.split_at_checked(due).ok_or(ProbeBytesError::Length { found: rest.len(), due })?;
        rest = after;
        Ok((read(grid, tag, memory(number))?, after.is_empty()))
    };
    let (grid, mut is_last) = next(0)?;
    if grid.is_sparse() {
        return Err(ProbeBytesError::Layout);
    }
    let mut levels = ProbeLevels::new(grid);
    while !is_last {
        let (finer, last) = next(levels.levels().len())?;
        levels.push(finer).map_err(|_| ProbeBytesError::Layout)?;
        is_last = last;
    }
    Ok(levels)
}

fn levels_sizes(bytes: &[u8]) -> Result<[usize; 5], ProbeBytesError> {
    Ok(layout(header(bytes)?, BakeMemory::nothing())?.1)
}

fn fill<T: bytemuck::Pod>(list: &mut List<'_, T>, bytes: &[u8]) -> Result<(), Full> {
    list.reset(bytes.len() / size_of::<T>(), T::zeroed())?;
    for (slot, bytes) in list.as_mut_slice().iter_mut().zip(bytes.chunks_exact(size_of::<T>())) {
        *slot = element(bytes);
    }
    Ok(())
}
