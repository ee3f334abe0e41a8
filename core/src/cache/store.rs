//! Records, what is attached to each, and the index over them.

use core::fmt;

use glam::Vec3;

use super::index::{Index, squared_share};
use super::radius::neighbour_clamped;
use super::record::{Attachment, Facing, MAX_STRIDE, Record};
use crate::math::float;
use crate::sh::Coefficient;
use crate::spectrum::{Gradient, Spectrum};
use crate::storage::{Full, List};

/// Records not yet in the index: looked at one by one, so only few; but every rebuild costs as much as
/// a few hundred records.
const LOOSE: u32 = 32;

/// No cache holds more: what counts them, and what the index keeps of them, fits 32 bits.
const MAX_RECORDS: usize = 1 << 28;

/// Records with `stride` attachments each, found by position.
///
/// In the medium the attachments are an expansion's coefficients of degree 1 and more
/// ([`VolumeCache`]); on surfaces what an irradiance record has besides ([`SurfaceCache`]).
/// Insertion looks at neighbours and rebuilds the index now and then; nothing else changes, so that
/// any number of threads may read.
#[derive(Debug)]
pub struct Cache<'s, E> {
    records: List<'s, Record>,
    attached: List<'s, E>,
    index: Index<'s>,
    wide: Index<'s>,
    stride: usize,
}

/// By how much spheres are widened: in the medium for points that none contains, on surfaces against noise.
pub(super) const WIDE: f32 = 2.0;

/// Why a record was not taken. The cache is then as before.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum InsertError {
    /// Lent storage has no room left.
    Full,
    /// Not [`Cache::stride`] attachments: a mistake of the caller's, not of the estimate.
    Stride {
        /// As many as were given.
        found: usize,
        /// As many as are due.
        due: usize,
    },
    /// There is no record of this number to be revised: a mistake of the caller's.
    Number(u32),
    /// The record is not valid, see [`Record::is_valid`]: an estimate that is no number.
    Record,
    /// An attachment is not valid, see [`Attachment::is_valid`]: the first such.
    Attachment(usize),
}

impl InsertError {
    /// Whether the estimate was no number, so that it is to be left out; all else is for the caller to mend.
    ///
    /// ```
    /// # use fogbow::cache::InsertError;
    /// assert!(InsertError::Record.is_invalid() && !InsertError::Full.is_invalid());
    /// ```
    #[must_use]
    pub fn is_invalid(&self) -> bool {
        matches!(self, Self::Record | Self::Attachment(_))
    }
}

impl fmt::Display for InsertError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Full => Full.fmt(f),
            Self::Stride { found, due } => write!(f, "{found} attachments where a record has {due}"),
            Self::Number(number) => write!(f, "there is no record {number}"),
            Self::Record => f.write_str("the record is not valid"),
            Self::Attachment(number) => write!(f, "attachment {number} is not valid"),
        }
    }
}

impl core::error::Error for InsertError {}

impl From<Full> for InsertError {
    fn from(_: Full) -> Self {
        Self::Full
    }
}

/// In-scattered radiance in a medium.
pub type VolumeCache<'s> = Cache<'s, Coefficient>;

/// Indirect irradiance on surfaces.
pub type SurfaceCache<'s> = Cache<'s, Facing>;

impl<'s, E: Attachment> Cache<'s, E> {
    /// An empty cache in lent or growing storage, with `stride` attachments per record, those of an expansion of
    /// [`MAX_DEGREE`](crate::sh::MAX_DEGREE) at most: more are cut to as many. `wide` is the
    /// index that [`Cache::finish`] makes of spheres twice as large; it needs two to three times the room of `index`.
    #[must_use]
    pub fn new(
        records: impl Into<List<'s, Record>>,
        attached: impl Into<List<'s, E>>,
        index: Index<'s>,
        wide: Index<'s>,
        stride: usize,
    ) -> Self {
        let stride = stride.min(MAX_STRIDE);
        let mut cache = Self { records: records.into(), attached: attached.into(), index, wide, stride };
        cache.records.clear();
        cache.attached.clear();
        cache
    }

    /// All records, in the order of their insertion.
    #[must_use]
    pub fn records(&self) -> &[Record] {
        self.records.as_slice()
    }

    /// Number of records.
    #[must_use]
    pub fn len(&self) -> usize {
        self.records().len()
    }

    /// Whether there is no record.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.records().is_empty()
    }

    /// All attachments, [`Cache::stride`] per record.
    #[must_use]
    pub fn attachments(&self) -> &[E] {
        self.attached.as_slice()
    }

    /// Attachments per record.
    #[must_use]
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// Attachments of one record; empty where there is no such record.
    #[inline]
    #[must_use]
    pub fn attached(&self, record: u32) -> &[E] {
        self.attached
            .as_slice()
            .get(record as usize * self.stride..)
            .and_then(|rest| rest.get(..self.stride))
            .unwrap_or(&[])
    }

    /// Bytes held by records, attachments and index.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(self.records()) + size_of_val(self.attachments()) + self.index.bytes() + self.wide.bytes()
    }

    /// Adds a record with its attachments, after clamping its radius and its neighbours' against each
    /// other.
    ///
    /// # Errors
    /// What is wrong with the record, or that there is no room: the cache is then as before.
    ///
    /// ```
    /// # use fogbow::cache::{Cache, InsertError, Record, VolumeCache};
    /// # use fogbow::{math::Vec3, spectrum::{Gradient, Spectrum}};
    /// # #[cfg(feature = "alloc")] {
    /// let mut cache: VolumeCache = Cache::growing(0);
    /// let record = Record { position: Vec3::ZERO, radius: 2.0, value: Spectrum::ONE, gradient: Gradient::ZERO };
    /// assert_eq!(cache.insert(record, &[]), Ok(()));
    /// // What is small beside what is large tells of something the large one missed.
    /// cache.insert(Record { position: Vec3::X, radius: 0.25, ..record }, &[])?;
    /// assert_eq!(cache.records()[0].radius, 1.25);
    /// assert_eq!(cache.insert(Record { radius: f32::NAN, ..record }, &[]), Err(InsertError::Record));
    /// # }
    /// # Ok::<(), InsertError>(())
    /// ```
    pub fn insert(&mut self, mut record: Record, attached: &[E]) -> Result<(), InsertError> {
        self.check(&record, attached)?;
        if self.len() >= MAX_RECORDS || self.records.room() == 0 || self.attached.room() < attached.len() {
            return Err(InsertError::Full);
        }
        for (number, other) in (0..).zip(self.records.as_mut_slice()) {
            let apart = record.position.distance(other.position);
            if apart < record.radius.max(other.radius) {
                record.radius = neighbour_clamped(record.radius, record.position, (other.position, other.radius));
                let (before, most) = (other.radius, record.radius + apart);
                if most < before {
                    other.radius = most;
                    self.index.shrink(number, (other.position, before), most);
                    self.wide.shrink(number, (other.position, WIDE * before), WIDE * most);
                }
            }
        }
        self.restore(record, attached.iter().copied())?;
        let loose = self.len() as u32 - self.index.len();
        if loose > LOOSE.max(self.index.len() / 16) {
            // Without room for the index records are looked at one by one.
            let _ = self.rebuild();
        }
        Ok(())
    }

    /// Whether a record can be kept, and written and read again.
    fn check(&self, record: &Record, attached: &[E]) -> Result<(), InsertError> {
        if attached.len() != self.stride {
            return Err(InsertError::Stride { found: attached.len(), due: self.stride });
        }
        if !record.is_valid() {
            return Err(InsertError::Record);
        }
        attached.iter().position(|e| !e.is_valid()).map_or(Ok(()), |number| Err(InsertError::Attachment(number)))
    }

    /// Replaces what a record says of the light, by an estimate that knows more than the first could. Its
    /// place and radius stay, and with them what decides how much it counts: a radius that comes from
    /// the same noise as the value would favour values that are too small.
    ///
    /// # Errors
    /// What is wrong with the estimate, or that there is no such record: the cache is then as before.
    ///
    /// ```
    /// # use fogbow::cache::{Cache, InsertError, Record, VolumeCache};
    /// # use fogbow::{math::Vec3, spectrum::{Gradient, Spectrum}};
    /// # #[cfg(feature = "alloc")] {
    /// let mut cache: VolumeCache = Cache::growing(0);
    /// let blind = Record { position: Vec3::ZERO, radius: 2.0, value: Spectrum::ONE, gradient: Gradient::ZERO };
    /// cache.insert(blind, &[])?;
    /// cache.revise(0, Spectrum::splat(1.5), &Gradient::ZERO, &[])?;
    /// assert_eq!(cache.records(), [Record { value: Spectrum::splat(1.5), ..blind }]);
    /// assert_eq!(cache.revise(7, Spectrum::ONE, &Gradient::ZERO, &[]), Err(InsertError::Number(7)));
    /// # }
    /// # Ok::<(), InsertError>(())
    /// ```
    pub fn revise(
        &mut self,
        record: u32,
        value: Spectrum,
        gradient: &Gradient,
        attached: &[E],
    ) -> Result<(), InsertError> {
        let (i, stride) = (record as usize, self.stride);
        let old = self.records().get(i).ok_or(InsertError::Number(record))?;
        let new = Record { value, gradient: *gradient, ..*old };
        self.check(&new, attached)?;
        self.records.as_mut_slice()[i] = new;
        self.attached.as_mut_slice()[i * stride..(i + 1) * stride].copy_from_slice(attached);
        Ok(())
    }

    /// Forgets all records and keeps the memory.
    pub fn clear(&mut self) {
        self.records.clear();
        self.attached.clear();
        // Of no spheres, an index needs no room.
        let _ = (self.index.rebuild(0, |_| (Vec3::ZERO, 0.0)), self.wide.rebuild(0, |_| (Vec3::ZERO, 0.0)));
    }

    /// Appends a record as it is: one that was in a cache already, with radii clamped then. It is seen
    /// after [`Cache::finish`].
    pub(super) fn restore(&mut self, record: Record, attached: impl Iterator<Item = E>) -> Result<(), Full> {
        self.records.push(record)?;
        attached.into_iter().try_for_each(|element| self.attached.push(element))
    }

    /// After filling, before many look-ups: brings all records into the index, and makes the one of wider spheres. Until
    /// then points in the gaps between them are misses.
    ///
    /// # Errors
    /// [`Full`] when an index's lent storage has no room left.
    pub fn finish(&mut self) -> Result<(), Full> {
        self.rebuild()?;
        let records = self.records.as_slice();
        self.wide.rebuild(records.len() as u32, |i| (records[i as usize].position, WIDE * records[i as usize].radius))
    }

    /// Whether nothing was inserted since [`Cache::finish`].
    pub(super) fn is_finished(&self) -> bool {
        self.wide.len() as usize == self.len()
    }

    fn rebuild(&mut self) -> Result<(), Full> {
        let records = self.records.as_slice();
        self.index.rebuild(records.len() as u32, |i| (records[i as usize].position, records[i as usize].radius))
    }

    /// As [`Cache::visit`], with every sphere twice as large; of the records there were at [`Cache::finish`].
    #[inline]
    pub fn visit_wide(&self, point: Vec3, mut visit: impl FnMut(u32, &Record, f32)) {
        let records = self.records();
        self.wide.visit(point, |i, share| visit(i, &records[i as usize], share));
    }

    /// Calls `visit(number, record, distance/radius)` for every record whose sphere contains `point`.
    #[inline]
    pub fn visit(&self, point: Vec3, mut visit: impl FnMut(u32, &Record, f32)) {
        let records = self.records();
        self.index.visit(point, |i, share| visit(i, &records[i as usize], share));
        let indexed = self.index.len() as usize;
        for (i, record) in records.iter().enumerate().skip(indexed) {
            let squared = squared_share(record.position, record.radius, point);
            if squared < 1.0 {
                visit(i as u32, record, float::sqrt(squared));
            }
        }
    }
}

#[cfg(feature = "alloc")]
impl<E: Attachment> Cache<'_, E> {
    /// An empty cache that grows as needed; `stride` as for [`Cache::new`].
    #[must_use]
    pub fn growing(stride: usize) -> Self {
        use alloc::vec::Vec;
        let index = || Index::new(Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Self::new(Vec::new(), Vec::new(), index(), index(), stride)
    }
}
