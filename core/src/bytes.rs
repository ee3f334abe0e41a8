//! Layer 0a: what is saved and sent: little-endian elements, headers and a checksum.

use core::fmt;

use bytemuck::Pod;

/// Why bytes are not what they should be, in the order of the checks: what all formats of this crate have in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Damage {
    /// Other first bytes: something else altogether.
    Magic {
        /// What they should be the bytes of.
        due: &'static str,
    },
    /// Fewer bytes than a header.
    NoHeader {
        /// How many there are.
        found: usize,
        /// How many a header has.
        due: usize,
    },
    /// Of another version of the format.
    Version {
        /// The one that is there.
        found: u32,
        /// The one that is read.
        known: u32,
    },
    /// Not as many bytes as the header says.
    Length {
        /// How many there are.
        found: u64,
        /// How many the header says.
        due: u64,
    },
    /// Another checksum.
    Checksum,
    /// Made for something else.
    Tag {
        /// What it was made for.
        found: u64,
        /// What was asked for.
        due: u64,
    },
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Magic { due } => write!(f, "is no {due}: other first bytes"),
            Self::NoHeader { found, due } => write!(f, "is cut off after {found} bytes, in its header of {due}"),
            Self::Version { found, known } => write!(f, "has version {found} of the format; {known} is known"),
            Self::Length { found, due } if found < due => {
                write!(f, "is cut off: {due} bytes are due, {found} are there")
            }
            Self::Length { found, due } => write!(f, "goes on after its end: {due} bytes are due, {found} are there"),
            Self::Checksum => f.write_str("is damaged: the checksum is another"),
            Self::Tag { found, due } => write!(f, "was made for something else (tag {found:016x}, not {due:016x})"),
        }
    }
}

impl core::error::Error for Damage {}

impl Damage {
    /// An error unless a tag is the one asked for.
    pub(crate) fn unless_tag(found: u64, due: u64) -> Result<(), Self> {
        if found == due { Ok(()) } else { Err(Self::Tag { found, due }) }
    }

    /// An error unless there are as many bytes as are due.
    pub(crate) fn unless_length(found: usize, due: u64) -> Result<(), Self> {
        let found = found as u64;
        if found == due { Ok(()) } else { Err(Self::Length { found, due }) }
    }
}

/// What is written part after part, to a sink.
pub(crate) type Sink<'a, F> = &'a mut dyn FnMut(&[u8]) -> Result<(), F>;

/// How bytes of a kind begin: 8 that tell the kind, the version, words of its own, and at the end of this header the [`Crc`] of all but itself.
pub(crate) struct Format {
    /// The first bytes: not text, and damaged by whatever changes ends of lines.
    pub(crate) magic: [u8; 8],
    pub(crate) version: u32,
    /// Length of the header, at most [`MOST_HEADER`] (bytes).
    pub(crate) header: usize,
    /// What it is, for messages.
    pub(crate) what: &'static str,
}

/// No header is longer (bytes).
const MOST_HEADER: usize = 128;

const CHECKSUM: usize = 8;

impl Format {
    /// Writes a header with `words` of its own, and the `body`, which is gone through twice, since its checksum comes before it.
    pub(crate) fn write<F>(
        &self,
        words: impl IntoIterator<Item = u32>,
        body: &dyn Fn(Sink<'_, F>) -> Result<(), F>,
        sink: Sink<'_, F>,
    ) -> Result<(), F> {
        let mut header = [0; MOST_HEADER];
        let (header, crc_at) = (&mut header[..self.header], self.header - CHECKSUM);
        header[..8].copy_from_slice(&self.magic);
        let words = [self.version].into_iter().chain(words);
        for (to, word) in header[8..crc_at].chunks_exact_mut(4).zip(words) {
            to.copy_from_slice(&word.to_le_bytes());
        }
        let mut crc = Crc::new();
        crc.add(&header[..crc_at]);
        body(&mut |part| {
            crc.add(part);
            Ok(())
        })?;
        header[crc_at..].copy_from_slice(&crc.value().to_le_bytes());
        sink(header)?;
        body(sink)
    }

    /// The header, after a look at its first bytes, length and version.
    pub(crate) fn header<'b>(&self, bytes: &'b [u8]) -> Result<Header<'b>, Damage> {
        let start = bytes.len().min(self.magic.len());
        if bytes[..start] != self.magic[..start] {
            return Err(Damage::Magic { due: self.what });
        }
        let due = self.header;
        let (header, _) = bytes.split_at_checked(due).ok_or(Damage::NoHeader { found: bytes.len(), due })?;
        let header = Header(header);
        match header.word(8) {
            version if version == self.version => Ok(header),
            found => Err(Damage::Version { found, known: self.version }),
        }
    }
}

/// The header of a [`Format`]; places are in bytes from its beginning.
#[derive(Clone, Copy)]
pub(crate) struct Header<'b>(&'b [u8]);

impl Header<'_> {
    pub(crate) fn word(&self, at: usize) -> u32 {
        word(self.0, at)
    }

    pub(crate) fn long(&self, at: usize) -> u64 {
        long(self.0, at)
    }

    pub(crate) fn numbers<const N: usize>(&self, at: usize) -> [f32; N] {
        core::array::from_fn(|i| f32::from_bits(self.word(at + 4 * i)))
    }

    /// An error unless the checksum is that of the header and `body`.
    pub(crate) fn check(&self, body: &[u8]) -> Result<(), Damage> {
        let (own, checksum) = self.0.split_at(self.0.len() - CHECKSUM);
        let mut crc = Crc::new();
        crc.add(own);
        crc.add(body);
        if crc.value() == long(checksum, 0) { Ok(()) } else { Err(Damage::Checksum) }
    }
}

/// A long as two words of a header.
pub(crate) const fn halves(long: u64) -> [u32; 2] {
    [long as u32, (long >> 32) as u32]
}

pub(crate) fn word(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

pub(crate) fn long(bytes: &[u8], at: usize) -> u64 {
    u64::from(word(bytes, at)) | u64::from(word(bytes, at + 4)) << 32
}

/// Elements in little-endian bytes, one at a time.
pub(crate) fn elements<T: Pod, F>(all: &[T], sink: Sink<'_, F>) -> Result<(), F> {
    if cfg!(target_endian = "little") {
        return if all.is_empty() { Ok(()) } else { sink(bytemuck::cast_slice(all)) };
    }
    bytemuck::cast_slice::<T, u32>(all).iter().try_for_each(|word| sink(&word.to_le_bytes()))
}

/// The element in as many little-endian bytes.
pub(crate) fn element<T: Pod>(bytes: &[u8]) -> T {
    let mut value = T::zeroed();
    let words: &mut [u32] = bytemuck::cast_slice_mut(core::slice::from_mut(&mut value));
    for (word, bytes) in words.iter_mut().zip(bytes.as_chunks::<4>().0) {
        *word = u32::from_le_bytes(*bytes);
    }
    value
}

/// CRC-64/XZ (ECMA-182, reflected): finds every change within 64 neighbouring bits.
///
/// ```
/// # use fogbow::bytes::Crc;
/// let mut crc = Crc::new();
/// crc.add(b"123456789");
/// assert_eq!(crc.value(), 0x995d_c9bb_df19_39fa);
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Crc(u64);

/// For eight bytes at once: `TABLES[k][n]` is what half byte `n` with `k` half bytes behind it becomes. Tables of whole bytes would be
/// quicker, but there is nothing in these 16 kB that compresses, and modules for browsers and microcontrollers are small.
static TABLES: [[u64; 16]; 16] = tables();

const fn tables() -> [[u64; 16]; 16] {
    let mut tables = [[0; 16]; 16];
    let mut half = 0;
    while half < 16 {
        let mut value = half as u64;
        let mut behind = 0;
        while behind < 16 {
            let mut bit = 0;
            while bit < 4 {
                value = if value & 1 == 1 { value >> 1 ^ 0xc96c_5795_d787_0f42 } else { value >> 1 };
                bit += 1;
            }
            tables[behind][half] = value;
            behind += 1;
        }
        half += 1;
    }
    tables
}

impl Default for Crc {
    fn default() -> Self {
        Self::new()
    }
}

impl Crc {
    /// Of nothing yet.
    #[must_use]
    pub const fn new() -> Self {
        Self(!0)
    }

    /// Adds what comes next.
    pub fn add(&mut self, bytes: &[u8]) {
        let (eights, rest) = bytes.as_chunks::<8>();
        for eight in eights {
            let mixed = self.0 ^ u64::from_le_bytes(*eight);
            self.0 =
                TABLES.iter().rev().zip(0..).fold(0, |sum, (table, n)| sum ^ table[(mixed >> (4 * n) & 15) as usize]);
        }
        for &byte in rest {
            let mixed = self.0 ^ u64::from(byte);
            self.0 = mixed >> 8 ^ TABLES[1][(mixed & 15) as usize] ^ TABLES[0][(mixed >> 4 & 15) as usize];
        }
    }

    /// Of all that was added.
    #[must_use]
    pub const fn value(&self) -> u64 {
        !self.0
    }
}
