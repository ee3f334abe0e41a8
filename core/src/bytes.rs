//! Layer 0a: what is saved and sent: little-endian elements and a checksum.

use bytemuck::Pod;

/// Elements in little-endian bytes, one at a time.
pub(crate) fn elements<T: Pod, F>(all: &[T], sink: &mut impl FnMut(&[u8]) -> Result<(), F>) -> Result<(), F> {
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

/// For eight bytes at once: `TABLES[k][b]` is what byte `b` with `k` bytes behind it becomes.
static TABLES: [[u64; 256]; 8] = tables();

const fn tables() -> [[u64; 256]; 8] {
    let mut tables = [[0; 256]; 8];
    let mut byte = 0;
    while byte < 256 {
        let mut value = byte as u64;
        let mut bit = 0;
        while bit < 8 {
            value = if value & 1 == 1 { value >> 1 ^ 0xc96c_5795_d787_0f42 } else { value >> 1 };
            bit += 1;
        }
        tables[0][byte] = value;
        byte += 1;
    }
    let mut behind = 1;
    while behind < 8 {
        byte = 0;
        while byte < 256 {
            let value = tables[behind - 1][byte];
            tables[behind][byte] = value >> 8 ^ tables[0][(value & 0xff) as usize];
            byte += 1;
        }
        behind += 1;
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
            let mixed = (self.0 ^ u64::from_le_bytes(*eight)).to_le_bytes();
            self.0 = mixed.iter().zip(TABLES.iter().rev()).fold(0, |sum, (&b, table)| sum ^ table[b as usize]);
        }
        for &byte in rest {
            self.0 = self.0 >> 8 ^ TABLES[0][((self.0 ^ u64::from(byte)) & 0xff) as usize];
        }
    }

    /// Of all that was added.
    #[must_use]
    pub const fn value(&self) -> u64 {
        !self.0
    }
}
