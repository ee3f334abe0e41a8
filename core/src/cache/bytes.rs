//! Caches as bytes: to be saved, sent, and read elsewhere with the same bits.
//!
//! Little endian on every target, without gaps:
//!
//! | offset | bytes | what |
//! |---|---|---|
//! | 0 | 8 | [`MAGIC`] |
//! | 8 | 4 | [`VERSION`] |
//! | 12 | 4 | [`RecordKind`]: 1 in a medium, 2 on surfaces |
//! | 16 | 4 | stride `s`: attachments per record, `(degree + 1)² − 1` in a medium, two more with light towards an eye, 1 on surfaces |
//! | 20 | 4 | number of records `n` |
//! | 24 | 8 | tag: what the cache was made for, a number of the host's choice |
//! | 32 | 8 | [`Crc`](crate::bytes::Crc) of bytes 0 to 32 and of all from 40 on |
//! | 40 | 64 n | records: position, radius, value (r, g, b), gradient (along x: r, g, b; along y; along z) as `f32` |
//! | 40 + 64 n | 48 n s | attachments, record after record: 12 `f32` each, [`Coefficient`] or [`Facing`](super::Facing) |
//!
//! The index is not stored: it is built anew, and gives the same answers because it depends on the
//! records and their order alone. So a cache read back gives the bits that the one written gave after
//! [`Cache::finish`].
//!
//! What is truncated, foreign or damaged is refused with a [`BytesError`] that names the first check that failed.
//! The checksum finds every damage within 64 neighbouring bits, and any other but for one in 2⁶⁴.
//!
//! ```
//! use fogbow::cache::{Cache, Record, VolumeCache, bytes};
//! # use fogbow::{math::Vec3, spectrum::{Gradient, Spectrum}};
//! # #[cfg(feature = "alloc")] {
//! let mut cache: VolumeCache = Cache::growing(0);
//! let record = Record { position: Vec3::X, radius: 0.5, value: Spectrum::ONE, gradient: Gradient::ZERO };
//! cache.insert(record, &[])?;
//!
//! let mut file = Vec::new();
//! let Ok(()) = bytes::write(&cache, 7, |part| Ok::<_, core::convert::Infallible>(file.extend(part)));
//! assert_eq!(file.len(), bytes::byte_count(&cache));
//!
//! let mut copy: VolumeCache = Cache::growing(0);
//! bytes::read_into(&file, 7, &mut copy)?;
//! assert_eq!(copy.records(), cache.records());
//!
//! file[99] ^= 1;
//! assert_eq!(bytes::read_into(&file, 7, &mut copy), Err(fogbow::bytes::Damage::Checksum.into()));
//! # }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use core::fmt;

use super::Record;
pub use super::record::Attachment;
use super::record::MAX_STRIDE;
use super::store::Cache;
use crate::bytes::{Damage, Format, Sink, element, elements, halves};
use crate::sh::Coefficient;
use crate::storage::Full;

/// The first bytes: not text, and damaged by whatever changes ends of lines.
pub const MAGIC: [u8; 8] = *b"\x89FOGBOW\n";

/// Of the layout above.
pub const VERSION: u32 = 1;

/// Length of a [`Header`] (bytes).
pub const HEADER_BYTES: usize = 40;

const FORMAT: Format = Format { magic: MAGIC, version: VERSION, header: HEADER_BYTES, what: "radiance cache" };

/// Which cache.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum RecordKind {
    /// [`VolumeCache`](super::VolumeCache).
    Volume = 1,
    /// [`SurfaceCache`](super::SurfaceCache).
    Surface = 2,
}

impl fmt::Display for RecordKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Volume => "records in a medium",
            Self::Surface => "records on surfaces",
        })
    }
}

/// Why bytes are not the cache asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum BytesError {
    /// No such bytes, or damaged ones, or made for something else.
    Damage(Damage),
    /// A kind that is not known.
    UnknownKind(u32),
    /// A stride or a number of records that no cache has.
    Size {
        /// Attachments per record.
        stride: u32,
        /// Records.
        count: u32,
    },
    /// The other kind of cache.
    Kind {
        /// What it is.
        found: RecordKind,
        /// What was asked for.
        due: RecordKind,
    },
    /// Another number of attachments: expansions of another degree.
    Stride {
        /// Attachments per record.
        found: u32,
        /// As many as were asked for.
        due: u32,
    },
    /// A record that is not valid, see [`Record::is_valid`].
    Record(u32),
    /// An attachment that is not valid, of this record.
    Attachment(u32),
    /// The cache's lent storage is too small.
    Full,
}

impl From<Damage> for BytesError {
    fn from(damage: Damage) -> Self {
        Self::Damage(damage)
    }
}

impl From<Full> for BytesError {
    fn from(_: Full) -> Self {
        Self::Full
    }
}

impl fmt::Display for BytesError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Damage(damage) => damage.fmt(f),
            Self::UnknownKind(found) => write!(f, "holds a cache of unknown kind {found}"),
            Self::Size { stride, count } => {
                write!(f, "claims {count} records with {stride} attachments each, which no cache has")
            }
            Self::Kind { found, due } => write!(f, "holds {found} where {due} are due"),
            Self::Stride { found, due } => {
                write!(f, "has {found} attachments per record where {due} are due: expansions of another degree")
            }
            Self::Record(index) => write!(f, "has a record that is not valid: number {index}"),
            Self::Attachment(index) => write!(f, "has an attachment that is not valid: of record {index}"),
            Self::Full => f.write_str("has more records than the lent storage holds"),
        }
    }
}

impl core::error::Error for BytesError {}

/// What the first [`HEADER_BYTES`] say.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Header {
    /// Which cache.
    pub kind: RecordKind,
    /// Attachments per record.
    pub stride: u32,
    /// Records.
    pub count: u32,
    /// What it was made for.
    pub tag: u64,
    /// Of all but itself.
    pub checksum: u64,
}

impl Header {
    /// Reads the header alone, to learn how much follows; the checksum is not compared.
    ///
    /// # Errors
    /// What is wrong with it.
    ///
    /// ```
    /// # use fogbow::{bytes::Damage, cache::bytes::Header};
    /// assert_eq!(Header::read(&[]), Err(Damage::NoHeader { found: 0, due: 40 }.into()));
    /// assert_eq!(Header::read(b"P6"), Err(Damage::Magic { due: "radiance cache" }.into()));
    /// ```
    pub fn read(bytes: &[u8]) -> Result<Self, BytesError> {
        let header = FORMAT.header(bytes)?;
        let kind = match header.word(12) {
            1 => RecordKind::Volume,
            2 => RecordKind::Surface,
            unknown => return Err(BytesError::UnknownKind(unknown)),
        };
        let [stride, count] = [16, 20].map(|at| header.word(at));
        let header = Self { kind, stride, count, tag: header.long(24), checksum: header.long(32) };
        let size = BytesError::Size { stride: header.stride, count: header.count };
        if header.stride as usize > MAX_STRIDE {
            return Err(size);
        }
        header.total().map(|_| header).ok_or(size)
    }

    /// Length of all of it, header included (bytes). `usize::MAX` where that is too small.
    ///
    /// ```
    /// # use fogbow::cache::bytes::{HEADER_BYTES, Header, RecordKind};
    /// let header = Header { kind: RecordKind::Volume, stride: 3, count: 10, tag: 0, checksum: 0 };
    /// assert_eq!(header.byte_count(), HEADER_BYTES + 10 * (64 + 3 * 48));
    /// ```
    #[must_use]
    pub fn byte_count(&self) -> usize {
        self.total().unwrap_or(usize::MAX)
    }

    fn total(&self) -> Option<usize> {
        let attached = size_of::<Coefficient>().checked_mul(self.stride as usize)?;
        let each = size_of::<Record>().checked_add(attached)?;
        each.checked_mul(self.count as usize)?.checked_add(HEADER_BYTES)
    }
}

/// How many bytes [`write()`] writes.
///
/// ```
/// # use fogbow::cache::{Cache, VolumeCache, bytes};
/// # #[cfg(feature = "alloc")] {
/// let cache: VolumeCache = Cache::growing(3);
/// assert_eq!(bytes::byte_count(&cache), bytes::HEADER_BYTES);   // no records so far
/// # }
/// ```
#[must_use]
pub fn byte_count<E: Attachment>(cache: &Cache<'_, E>) -> usize {
    HEADER_BYTES + size_of_val(cache.records()) + size_of_val(cache.attachments())
}

/// Writes `cache`, part after part, to `sink`. `tag` says what it was made for: whoever reads it must give the same.
///
/// Write it after [`Cache::finish`] if the copy's answers must be the same to the last bit.
///
/// # Errors
/// The first of `sink`.
///
/// ```
/// # use fogbow::{cache::{Cache, Record, VolumeCache, bytes}, math::Vec3, spectrum::{Gradient, Spectrum}};
/// # #[cfg(feature = "alloc")] {
/// let mut cache: VolumeCache = Cache::growing(0);
/// let record = Record { position: Vec3::ZERO, radius: 1.0, value: Spectrum::ONE, gradient: Gradient::ZERO };
/// cache.insert(record, &[])?;
/// cache.finish()?;
/// let mut file = Vec::new();
/// let Ok(()) = bytes::write(&cache, 7, |part| {
///     file.extend_from_slice(part);
///     Ok::<_, core::convert::Infallible>(())
/// });
/// assert_eq!(file.len(), bytes::byte_count(&cache));
/// let mut copy: VolumeCache = Cache::growing(0);
/// bytes::read_into(&file, 7, &mut copy)?;
/// assert_eq!(copy.records(), [record]);
/// # }
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
pub fn write<E: Attachment, F>(
    cache: &Cache<'_, E>,
    tag: u64,
    mut sink: impl FnMut(&[u8]) -> Result<(), F>,
) -> Result<(), F> {
    // Numbers of records are `u32` everywhere in a cache, and strides are small.
    let words = [E::KIND as u32, cache.stride() as u32, cache.len() as u32].into_iter().chain(halves(tag));
    let body = |sink: Sink<'_, F>| {
        elements(cache.records(), sink)?;
        elements(cache.attachments(), sink)
    };
    FORMAT.write(words, &body, &mut sink)
}

/// Replaces what `cache` holds by what was written as `bytes` with the same `tag`, and brings it into the index.
///
/// # Errors
/// The first check that fails. The cache is then as before, or empty after [`BytesError::Full`].
///
/// ```
/// # use fogbow::{bytes::Damage, cache::{Cache, VolumeCache, bytes}};
/// # #[cfg(feature = "alloc")] {
/// let mut cache: VolumeCache = Cache::growing(0);
/// let mut file = Vec::new();
/// let Ok(()) = bytes::write(&cache, 7, |part| {
///     file.extend_from_slice(part);
///     Ok::<_, core::convert::Infallible>(())
/// });
/// assert_eq!(bytes::read_into(&file, 8, &mut cache), Err(Damage::Tag { found: 7, due: 8 }.into()));
/// file[30] ^= 1;   // a bit of the tag
/// assert_eq!(bytes::read_into(&file, 7, &mut cache), Err(Damage::Checksum.into()));
/// # }
/// ```
pub fn read_into<E: Attachment>(bytes: &[u8], tag: u64, cache: &mut Cache<'_, E>) -> Result<(), BytesError> {
    let header = Header::read(bytes)?;
    Damage::unless_length(bytes.len(), header.byte_count() as u64)?;
    let body = &bytes[HEADER_BYTES..];
    FORMAT.header(bytes)?.check(body)?;
    if header.kind != E::KIND {
        return Err(BytesError::Kind { found: header.kind, due: E::KIND });
    }
    if header.stride as usize != cache.stride() {
        return Err(BytesError::Stride { found: header.stride, due: cache.stride() as u32 });
    }
    Damage::unless_tag(header.tag, tag)?;
    let stride = header.stride as usize;
    let (records, attached) = body.split_at(header.count as usize * size_of::<Record>());
    let records = records.chunks_exact(size_of::<Record>());
    let attached_to = |i: usize| attached.chunks_exact(size_of::<E>()).skip(i * stride).take(stride).map(element::<E>);
    for (i, record) in records.clone().enumerate() {
        if !element::<Record>(record).is_valid() {
            return Err(BytesError::Record(i as u32));
        }
        if !attached_to(i).all(|e| e.is_valid()) {
            return Err(BytesError::Attachment(i as u32));
        }
    }
    cache.clear();
    let fill = || {
        for (i, record) in records.enumerate() {
            cache.restore(element(record), attached_to(i))?;
        }
        cache.finish()
    };
    let filled = fill();
    if filled.is_err() {
        cache.clear();
    }
    Ok(filled?)
}
