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
//! | 72 | 8 | [`Crc`](crate::bytes::Crc) of bytes 0 to 72 and of all from 80 on |
//! | 80 | 12 n k | numbers in colour, `k` of each of `n` probes, as `f32` |
//! | | 4 n k | their sums of squared deviations over passes, a mean over channels, as `f32` |
//! | | 80 n | extinction and albedo in colour, planes of four surfaces, share of its cell, as `f32`; as `u32` state in bits 0 to 2, [`Probe::is_inner`] in bit 3, surfaces before the next probes in bits 4 to 6, [`Probe::is_by_paths`] in bit 7 |
//! | | 8 b | passes, and passes that are due |
//! | | 4 b | where some bricks alone are there: which, as [`ProbeGrid::places`] |
//!
//! [`ProbeLevels`] are one such grid after the other, the one that has all probes first.

use core::fmt;

use super::basis::{Orders, ProbeBasis, Quantity};
use super::grid::{BakeMemory, Brick, PROBES, ProbeGrid};
use super::levels::ProbeLevels;
use super::probe::{BY_PATHS, INNER, Probe, ProbeState, STATE, WALLS};
use super::settings::MOST_PROBES;
use crate::bytes::{Damage, Format, Header, Sink, element, elements, halves};
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

const FORMAT: Format = Format { magic: MAGIC, version: VERSION, header: HEADER_BYTES, what: "grid of probes" };

/// Why bytes are not the grid asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum ProbeBytesError {
    /// No such bytes, or damaged ones, or made for something else.
    Damage(Damage),
    /// Bounds, numbers of probes or a basis that no grid has.
    Layout,
    /// A probe that holds what no bake leaves: a number that is not finite, a state that is not known.
    Probe(usize),
    /// The storage is too small.
    Storage,
}

impl From<Damage> for ProbeBytesError {
    fn from(damage: Damage) -> Self {
        Self::Damage(damage)
    }
}

impl fmt::Display for ProbeBytesError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Damage(damage) => damage.fmt(f),
            Self::Layout => f.write_str("has bounds, numbers of probes or a basis that no grid has"),
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
/// # use fogbow::{bake::{Bake, BakeMemory, BakeSettings, bytes}, bytes::Damage};
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
/// assert_eq!(other.err(), Some(Damage::Tag { found: 7, due: 8 }.into()));
/// # }
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
pub fn write<F>(grid: &ProbeGrid<'_>, tag: u64, mut sink: impl FnMut(&[u8]) -> Result<(), F>) -> Result<(), F> {
    let basis = match grid.basis {
        ProbeBasis::SphericalHarmonics { degree } => degree,
        ProbeBasis::AmbientCube => AMBIENT_CUBE,
        ProbeBasis::Fluence => FLUENCE,
    };
    let BakeMemory { values, deviations, probes, bricks, places } = &grid.memory;
    let bounds = grid.lattice.bounds();
    let corners = [bounds.min, bounds.max].into_iter().flat_map(|corner| corner.to_array().map(f32::to_bits));
    let quantity = grid.quantity as u32 + if grid.is_sparse() { SPARSE } else { 0 };
    let last = [basis, quantity, grid.orders as u32, bricks.len() as u32];
    let words = grid.lattice.size().into_iter().chain(corners).chain(last).chain(halves(tag));
    let body = |sink: Sink<'_, F>| {
        elements(values.as_slice(), sink)?;
        elements(deviations.as_slice(), sink)?;
        elements(probes.as_slice(), sink)?;
        elements(bricks.as_slice(), sink)?;
        elements(places.as_slice(), sink)
    };
    FORMAT.write(words, &body, &mut sink)
}

/// What a grid was made for: for hosts that want any.
///
/// # Errors
/// Bytes that do not begin as those of a grid do; no more is looked at.
///
/// ```
/// # use fogbow::bake::bytes::tag;
/// assert!(tag(&[0; 99]).is_err());
/// ```
pub fn tag(bytes: &[u8]) -> Result<u64, ProbeBytesError> {
    Ok(FORMAT.header(bytes)?.long(TAG_AT))
}

/// Reads what was written as `bytes` with the same `tag`, into `memory`.
///
/// # Errors
/// The first check that fails.
///
/// ```
/// # use fogbow::bake::{BakeMemory, bytes};
/// # #[cfg(feature = "alloc")] {
/// let nothing = bytes::read(b"P6", 7, BakeMemory::default());
/// assert_eq!(nothing.err().unwrap().to_string(), "is no grid of probes: other first bytes");
/// # }
/// ```
pub fn read<'s>(bytes: &[u8], tag: u64, memory: BakeMemory<'s>) -> Result<ProbeGrid<'s>, ProbeBytesError> {
    let header = FORMAT.header(bytes)?;
    let (mut grid, sizes) = layout(&header, memory)?;
    Damage::unless_length(bytes.len(), (HEADER_BYTES + sizes.iter().sum::<usize>()) as u64)?;
    header.check(&bytes[HEADER_BYTES..])?;
    Damage::unless_tag(header.long(TAG_AT), tag)?;
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
        let bits = STATE | INNER | WALLS | BY_PATHS;
        let is_known = probe.state & STATE <= ProbeState::Empty as u32 && probe.state & !bits == 0;
        if !is_number || !is_known {
            return Err(ProbeBytesError::Probe(index));
        }
    }
    Ok(grid)
}

/// What a header says, and how many bytes each part takes: numbers, deviations, probes, bricks, places.
fn layout<'s>(header: &Header<'_>, memory: BakeMemory<'s>) -> Result<(ProbeGrid<'s>, [usize; 5]), ProbeBytesError> {
    let word = |at: usize| header.word(at);
    let counts = [12, 16, 20].map(word);
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
    let bounds = Bounds { min: header.numbers(24).into(), max: header.numbers(36).into() };
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
/// # use fogbow::bake::{Bake, BakeMemory, BakeSettings, ProbeLevels, bytes};
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
/// # use fogbow::bake::{BakeMemory, bytes};
/// # #[cfg(feature = "alloc")] {
/// let nothing = bytes::read_levels(b"P6", 7, |_| BakeMemory::default());
/// assert_eq!(nothing.err().unwrap().to_string(), "is no grid of probes: other first bytes");
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
        let cut = Damage::Length { found: rest.len() as u64, due: due as u64 };
        let (grid, after) = rest.split_at_checked(due).ok_or(cut)?;
        rest = after;
        Ok::<_, ProbeBytesError>((read(grid, tag, memory(number))?, after.is_empty()))
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
    Ok(layout(&FORMAT.header(bytes)?, BakeMemory::nothing())?.1)
}

fn fill<T: bytemuck::Pod>(list: &mut List<'_, T>, bytes: &[u8]) -> Result<(), Full> {
    list.reset(bytes.len() / size_of::<T>(), T::zeroed())?;
    for (slot, bytes) in list.as_mut_slice().iter_mut().zip(bytes.chunks_exact(size_of::<T>())) {
        *slot = element(bytes);
    }
    Ok(())
}
