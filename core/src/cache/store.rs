//! Records, what is attached to each, and the index over them.

use core::fmt;

use glam::Vec3;

use super::index::{Index, squared_share};
use super::lobe::coefficients_of;
use super::radius::neighbour_clamped;
use super::record::{Attachment, Facing, MAX_STRIDE, Record};
use crate::math::float;
use crate::sh::Coefficient;
use crate::spectrum::{Gradient, Spectrum};
use crate::storage::{Chunk, Full, List, carve, chunks_for, most_within};

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
///
/// ```
/// # use fogbow::cache::{Record, VolumeCache};
/// # use fogbow::{math::Vec3, sh::Coefficient, spectrum::{Gradient, Spectrum}, storage::Chunk};
/// // Room for one record with an expansion of degree 1: three coefficients besides the mean.
/// let mut memory = [Chunk::default(); VolumeCache::chunks(1, 3)];
/// let mut cache = VolumeCache::lent(&mut memory, 3);
/// assert!(cache.is_empty() && cache.stride() == 3);
/// let record = Record { position: Vec3::ZERO, radius: 1.0, value: Spectrum::ONE, gradient: Gradient::ZERO };
/// let higher = [Coefficient { value: Spectrum::splat(0.5), gradient: Gradient::ZERO }; 3];
/// cache.insert(record, &higher)?;
/// cache.finish()?;
/// assert_eq!((cache.len(), cache.records()), (1, &[record][..]));
/// assert_eq!((cache.attachments(), cache.attached(0)), (&higher[..], &higher[..]));
/// // Its sphere holds a point at 0.5 m; twice as large, one at 1.5 m as well.
/// let (mut near, mut far) = (0, 0);
/// cache.visit(0.5 * Vec3::X, |_, _, share| near += u32::from(share == 0.5));
/// cache.visit(1.5 * Vec3::X, |_, _, _| far += 1);
/// cache.visit_wide(1.5 * Vec3::X, |_, _, share| far += u32::from(share == 0.75));
/// assert_eq!((near, far), (1, 1));
/// assert!(cache.bytes() > size_of::<Record>() + 3 * size_of::<Coefficient>());   // with the indices
/// assert!(cache.insert(record, &higher).is_err());   // full
/// cache.clear();
/// assert!(cache.is_empty());
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Cache<'s, E> {
    records: List<'s, Record>,
    attached: List<'s, E>,
    index: Index<'s>,
    wide: Index<'s>,
    stride: usize,
    /// Of these, coefficients of an expansion.
    coefficients: usize,
}

/// Nodes and entries of the index of wider spheres, in those of the other: a sphere that is twice as large lies in more
/// cells.
const WIDER: usize = 3;

/// The radius of a record that is to be dropped; no other has it.
const DOUBTED: f32 = 0.0;

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
///
/// ```
/// # use fogbow::{cache::{Basis, Cache, Reading, Record, TurningBasis, VolumeCache}, math::Vec3};
/// # use fogbow::spectrum::{Gradient, Spectrum};
/// # #[cfg(feature = "alloc")] {
/// let mut cache: VolumeCache = Cache::growing(0);
/// let gradient = Gradient::outer(Spectrum::ONE, Vec3::X);
/// cache.insert(Record { position: Vec3::ZERO, radius: 1.0, value: Spectrum::splat(2.0), gradient }, &[])?;
/// cache.finish()?;
/// let (reading, basis) = (Reading::new(0.5), Basis::new(Vec3::Z, cache.degree()));
/// let point = 0.5 * Vec3::X;
/// assert_eq!(cache.lookup(point, &basis, &reading), Some(Spectrum::splat(2.5)));   // L + ∇L·Δ
/// let (light, _) = cache.lookup_with_gradients(point, &TurningBasis::new(Vec3::Z, 0), &reading).unwrap();
/// assert_eq!((light.radiance[0], light.gradient), (2.5, gradient));
/// // A metre and a half away no record reaches; in such gaps spheres count as twice as large.
/// let gap = 1.5 * Vec3::X;
/// assert!(cache.covers(point, &reading) && !cache.covers(gap, &reading));
/// assert!(cache.lookup(gap, &basis, &reading).is_some() && cache.lookup(3.0 * Vec3::X, &basis, &reading).is_none());
/// assert_eq!(cache.radius_near(gap), Some(1.0));
/// # }
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
pub type VolumeCache<'s> = Cache<'s, Coefficient>;

/// Indirect irradiance on surfaces.
///
/// ```
/// # use fogbow::{cache::{Cache, Facing, Reading, Record, SurfaceCache}, math::Vec3, spectrum::{Gradient, Spectrum}};
/// # #[cfg(feature = "alloc")] {
/// let mut cache: SurfaceCache = Cache::growing(1);
/// let record = Record { position: Vec3::ZERO, radius: 1.0, value: Spectrum::splat(2.0), gradient: Gradient::ZERO };
/// cache.insert(record, &[Facing { normal: Vec3::Z, turn: Gradient::ZERO }])?;
/// cache.finish()?;
/// let (reading, point) = (Reading::new(0.5), 0.5 * Vec3::X);
/// assert_eq!(cache.lookup(point, Vec3::Z, &reading), Some(Spectrum::splat(2.0)));
/// assert!(cache.covers(point, Vec3::Z, &reading) && !cache.covers(point, Vec3::X, &reading));   // around the corner
/// assert_eq!(cache.radius_near(point), Some(1.0));
/// # }
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
pub type SurfaceCache<'s> = Cache<'s, Facing>;

impl<'s, E: Attachment> Cache<'s, E> {
    /// An empty cache in lent memory, with `stride` attachments per record: for as many records as there is room, see
    /// [`Cache::chunks`]. A stride is at most that of an expansion of [`MAX_DEGREE`](crate::sh::MAX_DEGREE) and two; more are cut
    /// to as many.
    ///
    /// Lend more where records come in crowds within crowds: their index may want more. Without room for it, records
    /// are looked at one by one, and [`Cache::finish`] says so.
    ///
    /// ```
    /// # use fogbow::cache::{InsertError, Record, VolumeCache};
    /// # use fogbow::{math::Vec3, spectrum::{Gradient, Spectrum}, storage::Chunk};
    /// let mut memory = [Chunk::default(); VolumeCache::chunks(8, 0)];
    /// let mut cache = VolumeCache::lent(&mut memory, 0);
    /// let at = |i: f32| Record { position: i * Vec3::X, radius: 1.0, value: Spectrum::ONE, gradient: Gradient::ZERO };
    /// for i in 0..8 {
    ///     cache.insert(at(i as f32), &[])?;
    /// }
    /// assert_eq!(cache.insert(at(8.0), &[]), Err(InsertError::Full));
    /// cache.finish()?;
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    #[must_use]
    pub fn lent(memory: &'s mut [Chunk], stride: usize) -> Self {
        let records = most_within(memory.len(), |records| Self::chunks(records, stride));
        Self::carved(&mut { memory }, records, stride)
    }

    /// In the first [`Cache::chunks`] of `memory`.
    pub(super) fn carved(memory: &mut &'s mut [Chunk], records: usize, stride: usize) -> Self {
        let stride = stride.min(MAX_STRIDE);
        let index = Index::lent(memory, records, 1);
        let wide = Index::lent(memory, records, WIDER);
        let attached = carve::<E>(memory, records * stride);
        let (records, attached) = (carve::<Record>(memory, records).into(), attached.into());
        Self { records, attached, index, wide, stride, coefficients: coefficients_of(stride) }
    }

    /// Chunks of memory that `records` with `stride` attachments each take, their indices included.
    ///
    /// ```
    /// # use fogbow::cache::{SurfaceCache, VolumeCache};
    /// assert_eq!(VolumeCache::chunks(0, 3), 0);
    /// // Some 1.1 kB a record without an expansion, most of it for the worst that indices may want.
    /// assert!((1080..1120).contains(&(64 * VolumeCache::chunks(1000, 0) / 1000)));
    /// assert!(SurfaceCache::chunks(1000, 1) > VolumeCache::chunks(1000, 0));
    /// ```
    #[must_use]
    pub const fn chunks(records: usize, stride: usize) -> usize {
        let stride = if stride < MAX_STRIDE { stride } else { MAX_STRIDE };
        Index::chunks(records, 1)
            + Index::chunks(records, WIDER)
            + chunks_for::<E>(records * stride)
            + chunks_for::<Record>(records)
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

    /// Coefficients of degree 1 and more among the attachments of a record in the medium.
    pub(super) fn coefficients(&self) -> usize {
        self.coefficients
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
        record.radius = self.clamped(&record);
        self.clamp_around(&record);
        self.restore(record, attached.iter().copied())?;
        let indexed = self.index.len();
        // Every rebuild takes as long as there are records, every loose one is looked at by every question: with the
        // root of the number of records loose, either costs little.
        if self.len() as u32 - indexed > LOOSE.max((indexed / 16).min(4 * indexed.isqrt())) {
            // Without room for the index records are looked at one by one.
            let _ = self.rebuild();
        }
        Ok(())
    }

    /// The radius that the neighbours allow a new record.
    fn clamped(&self, record: &Record) -> f32 {
        let (records, mut radius) = (self.records(), record.radius);
        let clamped =
            |other: &Record, radius| neighbour_clamped(radius, record.position, (other.position, other.radius));
        self.index.visit_centres(record.position, &mut radius, |number, radius| {
            *radius = clamped(&records[number as usize], *radius);
        });
        records.iter().skip(self.index.len() as usize).fold(radius, |radius, other| clamped(other, radius))
    }

    /// Lets all records around a new one reach no farther than that allows.
    fn clamp_around(&mut self, record: &Record) {
        let Self { records, index, wide, .. } = self;
        let (count, records) = (records.as_slice().len() as u32, records.as_mut_slice());
        let mut clamp = |index: &mut Index<'_>, number: u32| {
            let other = &mut records[number as usize];
            let (before, most) = (other.radius, record.radius + record.position.distance(other.position));
            if most < before {
                other.radius = most;
                index.shrink(number, (other.position, before), most);
                wide.shrink(number, (other.position, WIDE * before), WIDE * most);
            }
        };
        // Too large is at most what contains its place.
        for block in index.leaf(record.position) {
            index.numbers(block).into_iter().for_each(|number| clamp(index, number));
        }
        for number in index.len()..count {
            clamp(index, number);
        }
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

    /// How far about a record at `point` would reach, going by the nearest there is (m); `None` if there are none.
    ///
    /// ```
    /// # use fogbow::cache::{Cache, Record, VolumeCache};
    /// # use fogbow::{math::Vec3, spectrum::{Gradient, Spectrum}};
    /// # #[cfg(feature = "alloc")] {
    /// let mut cache: VolumeCache = Cache::growing(0);
    /// assert_eq!(cache.radius_near(Vec3::ZERO), None);
    /// cache.insert(Record { position: Vec3::X, radius: 0.5, value: Spectrum::ONE, gradient: Gradient::ZERO }, &[])?;
    /// assert_eq!(cache.radius_near(Vec3::ZERO), Some(0.5));
    /// # }
    /// # Ok::<(), fogbow::cache::InsertError>(())
    /// ```
    #[must_use]
    pub fn radius_near(&self, point: Vec3) -> Option<f32> {
        let (records, mut nearest) = (self.records(), None);
        let mut closer = |number: u32| {
            let apart = records[number as usize].position.distance_squared(point);
            // Of several at the same distance the first.
            if nearest.is_none_or(|(least, first)| apart < least || (apart == least && number < first)) {
                nearest = Some((apart, number));
            }
            nearest.map_or(f32::INFINITY, |(least, _)| float::sqrt(least))
        };
        self.index.visit_centres(point, &mut { f32::INFINITY }, |number, reach| *reach = closer(number));
        for number in self.index.len()..records.len() as u32 {
            closer(number);
        }
        nearest.map(|(_, number)| records[number as usize].radius)
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

    /// Gives each record the radius (m) that is wanted for it, where that is smaller.
    pub(super) fn shrink(&mut self, radius: impl Fn(&Record) -> f32) -> Result<(), Full> {
        for record in self.records.as_mut_slice() {
            record.radius = radius(record).min(record.radius);
        }
        self.finish()
    }

    /// Lets each record reach no farther than `limit` (m) says of it and of another that it reaches, by their numbers and themselves. How often it reached farther.
    pub(super) fn limit(&mut self, limit: &dyn Fn([usize; 2], [&Record; 2]) -> f32) -> Result<u32, Full> {
        let count = limited(self.records.as_mut_slice(), &self.index, limit);
        self.finish().map(|()| count)
    }

    /// Marks the records whose spheres contain `point`, for [`Cache::drop_doubted`]: they are no longer valid.
    pub(super) fn doubt(&mut self, point: Vec3) {
        let Self { records, index, .. } = self;
        let records = records.as_mut_slice();
        index.visit(point, |i, _| records[i as usize].radius = DOUBTED);
        for record in &mut records[index.len() as usize..] {
            if squared_share(record.position, record.radius, point) < 1.0 {
                record.radius = DOUBTED;
            }
        }
    }

    /// Drops the records that were marked. How many of the first `first` are left.
    pub(super) fn drop_doubted(&mut self, first: usize) -> usize {
        let (stride, mut kept, mut kept_of_first) = (self.stride, 0, 0);
        let (records, attached) = (self.records.as_mut_slice(), self.attached.as_mut_slice());
        for i in 0..records.len() {
            if records[i].radius == DOUBTED {
                continue;
            }
            records[kept] = records[i];
            attached.copy_within(i * stride..(i + 1) * stride, kept * stride);
            kept += 1;
            kept_of_first += usize::from(i < first);
        }
        self.records.truncate(kept);
        self.attached.truncate(kept * stride);
        // Without room for the index records are looked at one by one.
        let _ = self.finish();
        kept_of_first
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
    /// An empty cache that grows as needed; `stride` as for [`Cache::lent`].
    ///
    /// ```
    /// # use fogbow::{cache::{Cache, Record, VolumeCache}, math::Vec3, spectrum::{Gradient, Spectrum}};
    /// let mut cache: VolumeCache = Cache::growing(0);
    /// for i in 0..1000 {
    ///     let position = i as f32 * Vec3::X;
    ///     cache.insert(Record { position, radius: 0.5, value: Spectrum::ONE, gradient: Gradient::ZERO }, &[])?;
    /// }
    /// assert_eq!(cache.len(), 1000);
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    #[must_use]
    pub fn growing(stride: usize) -> Self {
        use alloc::vec::Vec;
        let index = || Index::new(Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let stride = stride.min(MAX_STRIDE);
        Self {
            records: List::default(),
            attached: List::default(),
            index: index(),
            wide: index(),
            stride,
            coefficients: coefficients_of(stride),
        }
    }
}

/// See [`Cache::limit`]: the index knows the records by the radii that they had.
fn limited(records: &mut [Record], index: &Index<'_>, limit: &dyn Fn([usize; 2], [&Record; 2]) -> f32) -> u32 {
    let mut count = 0;
    for other in 0..records.len() {
        let there = records[other];
        index.visit(there.position, |number, _| {
            let number = number as usize;
            let Some(here) = records.get_mut(number).filter(|_| number != other) else { return };
            let most = limit([number, other], [here, &there]);
            if most < here.radius {
                (here.radius, count) = (most, count + 1);
            }
        });
    }
    count
}

#[cfg(all(test, feature = "alloc"))]
mod tests {
    use alloc::vec::Vec;

    use super::*;
    use crate::sampling::{Generator, uniform};

    fn record(position: Vec3, radius: f32) -> Record {
        Record { position, radius, value: Spectrum::ONE, gradient: Gradient::ZERO }
    }

    fn point(rng: &mut Generator) -> Vec3 {
        Vec3::new(uniform(rng), uniform(rng), uniform(rng))
    }

    /// Evenly spread, and in a crowd whose members shrink towards its middle.
    fn places(count: u32, rng: &mut Generator) -> Vec<Record> {
        let size = 3.0 * float::powf(count as f32, -1.0 / 3.0);
        let place = |i| {
            let at = point(rng);
            if i % 3 == 0 {
                let away = float::powf(10.0, -4.0 * uniform(rng));
                record(Vec3::splat(0.3) + (at - 0.5) * away, away * size)
            } else {
                record(at, size * float::powf(30.0, -uniform(rng)))
            }
        };
        (0..count).map(place).collect()
    }

    /// Every one against all there are.
    fn one_by_one(records: &mut Vec<Record>, mut record: Record) {
        for other in &*records {
            record.radius = neighbour_clamped(record.radius, record.position, (other.position, other.radius));
        }
        for other in &mut *records {
            other.radius = other.radius.min(record.radius + record.position.distance(other.position));
        }
        records.push(record);
    }

    #[test]
    fn neighbours_are_clamped_as_if_all_were_asked() {
        let rng = &mut Generator::new(3);
        let (mut all, mut cache) = (Vec::new(), VolumeCache::growing(0));
        for (i, new) in places(4000, rng).into_iter().enumerate() {
            one_by_one(&mut all, new);
            cache.insert(new, &[]).unwrap();
            if i % 64 == 0 {
                assert_eq!(cache.records(), all);
                let at = point(rng) * 1.5;
                let apart = |r: &&Record| r.position.distance_squared(at).to_bits();
                assert_eq!(cache.radius_near(at), all.iter().min_by_key(apart).map(|r| r.radius));
            }
        }
        assert_eq!(cache.records(), all);
    }

    #[test]
    fn points_that_are_none_are_nearest_to_the_first() {
        let mut cache = VolumeCache::growing(0);
        for new in places(200, &mut Generator::new(5)) {
            cache.insert(new, &[]).unwrap();
        }
        let first = Some(cache.records()[0].radius);
        for at in [Vec3::NAN, Vec3::INFINITY, Vec3::new(f32::MAX, 0.0, 0.0)] {
            assert_eq!(cache.radius_near(at), first, "{at}");
        }
    }

    /// How many are asked for a new one: of those in the index and of those that are not there yet.
    fn asked(count: u32) -> (f32, f32) {
        let rng = &mut Generator::new(9);
        let mut cache = VolumeCache::growing(0);
        let (mut near, mut loose) = (0, 0);
        for new in places(count, rng) {
            let (indexed, mut reach) = (cache.index.len(), new.radius);
            cache.index.visit_centres(new.position, &mut reach, |number, reach| {
                let other = cache.records()[number as usize];
                *reach = neighbour_clamped(*reach, new.position, (other.position, other.radius));
                near += 1;
            });
            loose += cache.len() as u32 - indexed;
            cache.insert(new, &[]).unwrap();
        }
        (near as f32 / count as f32, loose as f32 / count as f32)
    }

    #[test]
    fn what_reaches_a_doubtful_point_is_dropped_and_nothing_else() {
        let rng = &mut Generator::new(11);
        let facing = |i: usize| Facing { normal: Vec3::Z, turn: Gradient::outer(Spectrum::splat(i as f32), Vec3::X) };
        let mut cache = SurfaceCache::growing(1);
        places(1000, rng).into_iter().enumerate().for_each(|(i, new)| cache.insert(new, &[facing(i)]).unwrap());
        let points = [point(rng), point(rng), Vec3::splat(0.3)];
        let reaches = |r: &Record| points.iter().any(|p| squared_share(r.position, r.radius, *p) < 1.0);
        let left = cache.records().iter().zip(cache.attachments()).filter(|(r, _)| !reaches(r));
        let left: Vec<_> = left.map(|(r, e)| (*r, *e)).collect();
        assert!(left.len() < cache.len() && left.len() > cache.len() / 2, "{}", left.len());
        let of_first = cache.records()[..100].iter().filter(|r| !reaches(r)).count();
        points.iter().for_each(|p| cache.doubt(*p));
        assert_eq!(cache.drop_doubted(100), of_first);
        assert!(cache.records().iter().zip(cache.attachments()).map(|(r, e)| (*r, *e)).eq(left));
        assert!(cache.is_finished());
        points.iter().for_each(|p| cache.visit(*p, |_, _, _| panic!("dropped")));
    }

    #[test]
    fn inserting_into_a_large_cache_asks_few() {
        let (some, many) = (asked(8000), asked(32000));
        assert!(many.0 < 1.2 * some.0 && many.0 < 100.0, "in the index: {some:?}, {many:?}");
        // Nearly as the root of their number.
        assert!(many.1 < 2.5 * some.1, "not in the index: {some:?}, {many:?}");
    }
}
