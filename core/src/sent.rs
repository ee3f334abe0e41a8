//! Layer 0c: what jobs leave, as little-endian bytes: for workers that share no memory.
//!
//! ```text
//! magic "\x89FOGJOB\n" · version · kind of job · lengths of four lists · words · lists · CRC-64
//! ```

use core::fmt;

use glam::Vec3;

use crate::bytes::Crc;
use crate::spectrum::{Gradient, Spectrum};
use crate::storage::{Full, List};

/// First bytes of what a job has left.
const MAGIC: [u8; 8] = *b"\x89FOGJOB\n";

/// The version of the format that is written and read. Both ends of one computation are of one version of this crate: no older one is read.
const VERSION: u32 = 1;

/// Magic, version, what kind of job, lengths of the lists.
const HEADER: usize = 8 + 4 + 4 + 4 * LISTS;

/// Lists that a job may leave.
const LISTS: usize = 4;

const CHECKSUM: usize = 8;

/// Why bytes are not what a job has left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JobBytesError {
    /// Something else, or of another version or another kind of job.
    Kind,
    /// More or fewer bytes than they say.
    Length,
    /// The checksum does not fit: damage.
    Checksum,
    /// Lent memory is too small.
    Full,
}

impl fmt::Display for JobBytesError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Kind => "these bytes are not what such a job leaves, or of another version",
            Self::Length => "bytes are missing, or there are too many",
            Self::Checksum => "the bytes are damaged: their checksum does not fit",
            Self::Full => "the lent memory is too small for what the job has left",
        })
    }
}

impl core::error::Error for JobBytesError {}

impl From<Full> for JobBytesError {
    fn from(_: Full) -> Self {
        Self::Full
    }
}

/// What is made of words.
pub(crate) trait Packed: Copy {
    /// How many words.
    const WORDS: usize;

    fn pack(&self, put: &mut impl FnMut(u32));

    /// From words; zeros where there are no more.
    fn unpack(next: &mut impl FnMut() -> u32) -> Self;
}

impl Packed for u32 {
    const WORDS: usize = 1;
    fn pack(&self, put: &mut impl FnMut(u32)) {
        put(*self);
    }
    fn unpack(next: &mut impl FnMut() -> u32) -> Self {
        next()
    }
}

impl Packed for bool {
    const WORDS: usize = 1;
    fn pack(&self, put: &mut impl FnMut(u32)) {
        put(u32::from(*self));
    }
    fn unpack(next: &mut impl FnMut() -> u32) -> Self {
        next() != 0
    }
}

impl Packed for f32 {
    const WORDS: usize = 1;
    fn pack(&self, put: &mut impl FnMut(u32)) {
        put(self.to_bits());
    }
    fn unpack(next: &mut impl FnMut() -> u32) -> Self {
        Self::from_bits(next())
    }
}

impl Packed for u64 {
    const WORDS: usize = 2;
    fn pack(&self, put: &mut impl FnMut(u32)) {
        put(*self as u32);
        put((*self >> 32) as u32);
    }
    fn unpack(next: &mut impl FnMut() -> u32) -> Self {
        let low = next();
        Self::from(low) | Self::from(next()) << 32
    }
}

impl Packed for f64 {
    const WORDS: usize = 2;
    fn pack(&self, put: &mut impl FnMut(u32)) {
        self.to_bits().pack(put);
    }
    fn unpack(next: &mut impl FnMut() -> u32) -> Self {
        Self::from_bits(u64::unpack(next))
    }
}

impl<T: Packed, const N: usize> Packed for [T; N] {
    const WORDS: usize = N * T::WORDS;
    fn pack(&self, put: &mut impl FnMut(u32)) {
        self.iter().for_each(|one| one.pack(put));
    }
    fn unpack(next: &mut impl FnMut() -> u32) -> Self {
        core::array::from_fn(|_| T::unpack(next))
    }
}

impl Packed for Vec3 {
    const WORDS: usize = 3;
    fn pack(&self, put: &mut impl FnMut(u32)) {
        self.to_array().pack(put);
    }
    fn unpack(next: &mut impl FnMut() -> u32) -> Self {
        <[f32; 3]>::unpack(next).into()
    }
}

impl<T: Packed + Default> Packed for Option<T> {
    const WORDS: usize = 1 + T::WORDS;
    fn pack(&self, put: &mut impl FnMut(u32)) {
        self.is_some().pack(put);
        self.unwrap_or_default().pack(put);
    }
    fn unpack(next: &mut impl FnMut() -> u32) -> Self {
        let is_some = bool::unpack(next);
        let value = T::unpack(next);
        is_some.then_some(value)
    }
}

/// Packs a structure field by field. A field that is left out does not compile.
macro_rules! packed {
    ($name:ty { $($field:ident: $kind:ty),+ $(,)? }) => {
        impl $crate::sent::Packed for $name {
            const WORDS: usize = 0 $(+ <$kind as $crate::sent::Packed>::WORDS)+;
            fn pack(&self, put: &mut impl FnMut(u32)) {
                let Self { $($field),+ } = self;
                $(<$kind as $crate::sent::Packed>::pack($field, put);)+
            }
            fn unpack(next: &mut impl FnMut() -> u32) -> Self {
                Self { $($field: <$kind as $crate::sent::Packed>::unpack(next)),+ }
            }
        }
    };
}

pub(crate) use packed;

packed!(Gradient { x: Spectrum, y: Spectrum, z: Spectrum });

impl Packed for Spectrum {
    const WORDS: usize = 3;
    fn pack(&self, put: &mut impl FnMut(u32)) {
        self.0.pack(put);
    }
    fn unpack(next: &mut impl FnMut() -> u32) -> Self {
        Self(<[f32; 3]>::unpack(next))
    }
}

/// Writes what a job has left: header, then what [`Sending::put`] and [`Sending::list`] are given, then the checksum.
pub(crate) struct Sending<S> {
    sink: S,
    crc: Crc,
    buffer: [u8; 256],
    used: usize,
}

impl<F, S: FnMut(&[u8]) -> Result<(), F>> Sending<S> {
    pub(crate) fn new(sink: S, kind: u32, lists: [usize; LISTS]) -> Result<Self, F> {
        let mut sending = Self { sink, crc: Crc::new(), buffer: [0; 256], used: 0 };
        for word in MAGIC.as_chunks::<4>().0 {
            sending.word(u32::from_le_bytes(*word))?;
        }
        sending.word(VERSION)?;
        sending.word(kind)?;
        for length in lists {
            sending.word(length as u32)?;
        }
        Ok(sending)
    }

    fn word(&mut self, word: u32) -> Result<(), F> {
        self.buffer[self.used..self.used + 4].copy_from_slice(&word.to_le_bytes());
        self.used += 4;
        if self.used == self.buffer.len() { self.flush() } else { Ok(()) }
    }

    fn flush(&mut self) -> Result<(), F> {
        let full = &self.buffer[..self.used];
        self.crc.add(full);
        self.used = 0;
        (self.sink)(full)
    }

    pub(crate) fn put(&mut self, value: &impl Packed) -> Result<(), F> {
        let mut result = Ok(());
        value.pack(&mut |word| {
            if result.is_ok() {
                result = self.word(word);
            }
        });
        result
    }

    pub(crate) fn list<T: Packed>(&mut self, all: &[T]) -> Result<(), F> {
        all.iter().try_for_each(|one| self.put(one))
    }

    pub(crate) fn finish(mut self) -> Result<(), F> {
        self.flush()?;
        let checksum = self.crc.value().to_le_bytes();
        (self.sink)(&checksum)
    }
}

/// Bytes of a message with so many words besides its header.
pub(crate) const fn byte_count(words: usize) -> usize {
    HEADER + 4 * words + CHECKSUM
}

/// What a job has left, to be read in the order in which it was written.
pub(crate) struct Received<'b> {
    words: &'b [[u8; 4]],
    lists: [usize; LISTS],
    next_list: usize,
}

impl<'b> Received<'b> {
    /// Checks everything but what it means. `fixed` and `lists` say how many words there are beside the lists, and in one element of each.
    pub(crate) fn new(bytes: &'b [u8], kind: u32, fixed: usize, lists: [usize; LISTS]) -> Result<Self, JobBytesError> {
        let (whole, checksum) = bytes.split_last_chunk::<CHECKSUM>().ok_or(JobBytesError::Length)?;
        let (header, rest) = whole.split_first_chunk::<HEADER>().ok_or(JobBytesError::Length)?;
        let word = |at: usize| u32::from_le_bytes([header[at], header[at + 1], header[at + 2], header[at + 3]]);
        if header[..8] != MAGIC || word(8) != VERSION || word(12) != kind {
            return Err(JobBytesError::Kind);
        }
        let lengths: [usize; LISTS] = core::array::from_fn(|i| word(16 + 4 * i) as usize);
        let words =
            lengths.iter().zip(lists).try_fold(fixed, |sum, (length, each)| sum.checked_add(length.checked_mul(each)?));
        if words.and_then(|words| words.checked_mul(4)) != Some(rest.len()) {
            return Err(JobBytesError::Length);
        }
        let mut crc = Crc::new();
        crc.add(whole);
        if crc.value() != u64::from_le_bytes(*checksum) {
            return Err(JobBytesError::Checksum);
        }
        Ok(Self { words: rest.as_chunks().0, lists: lengths, next_list: 0 })
    }

    pub(crate) fn take<T: Packed>(&mut self) -> T {
        let (own, rest) = self.words.split_at_checked(T::WORDS).unwrap_or((self.words, &[]));
        self.words = rest;
        let mut words = own.iter();
        T::unpack(&mut || words.next().map_or(0, |word| u32::from_le_bytes(*word)))
    }

    pub(crate) fn list<T: Packed>(&mut self, to: &mut List<'_, T>) -> Result<(), JobBytesError> {
        to.clear();
        let length = self.lists.get(self.next_list).copied().unwrap_or(0);
        self.next_list += 1;
        for _ in 0..length {
            let one = self.take();
            to.push(one)?;
        }
        Ok(())
    }
}
