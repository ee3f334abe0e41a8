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
