//! Packed bytes: zip (zlib's format) and Blosc (version 1, by LZ4 or zlib).

use std::io::Read;

use super::bytes::Fault;

fn broken(what: &str) -> Fault {
    Fault::new("packed values", what)
}

/// Unpacks what zlib packed to `size` bytes.
pub(super) fn unzip(packed: &[u8], size: usize) -> Result<Vec<u8>, Fault> {
    // Not more than packed bytes can hold: sizes of broken files are anything.
    let mut bytes = Vec::with_capacity(size.min(packed.len().saturating_mul(1032) + 64));
    flate2::read::ZlibDecoder::new(packed)
        .take(size as u64 + 1)
        .read_to_end(&mut bytes)
        .map_err(|e| broken(&format!("cannot be unzipped: {e}")))?;
    if bytes.len() == size { Ok(bytes) } else { Err(broken(&format!("{} bytes where {size} are due", bytes.len()))) }
}

/// Bytes of the header of a Blosc buffer.
const HEADER: usize = 16;

/// Blocks of this many elements and more may be split by byte.
const LEAST_SPLIT: usize = 128;

/// Unpacks a Blosc buffer of `size` bytes.
///
/// A header (versions, flags, size of an element, sizes), where each block starts, and blocks: the streams of a block, of which there are
/// as many as an element has bytes where it was split, each with its packed size before it; then bytes are shuffled back.
pub(super) fn unblosc(packed: &[u8], size: usize) -> Result<Vec<u8>, Fault> {
    let word = |at: usize| -> Result<usize, Fault> {
        let bytes = packed.get(at..at + 4).and_then(|b| <[u8; 4]>::try_from(b).ok());
        bytes.map(|b| u32::from_le_bytes(b) as usize).ok_or_else(|| broken("ends early"))
    };
    let (&[_, _, flags, element], nbytes, block) =
        (packed.first_chunk::<4>().ok_or_else(|| broken("ends early"))?, word(4)?, word(8)?);
    let element = usize::from(element).max(1);
    if nbytes != size {
        return Err(broken(&format!("{nbytes} bytes where {size} are due")));
    }
    if flags & 2 != 0 {
        let plain = packed.get(HEADER..HEADER + size).ok_or_else(|| broken("ends early"))?;
        return Ok(plain.to_vec());
    }
    if size == 0 {
        return Ok(Vec::new());
    }
    if block == 0 || block > size {
        return Err(broken(&format!("blocks of {block} bytes")));
    }
    if flags & 4 != 0 {
        return Err(broken("shuffled by bits, which is not supported"));
    }
    let unpack: fn(&[u8], &mut [u8]) -> Option<usize> = match flags >> 5 {
        1 => |from, to| lz4_flex::block::decompress_into(from, to).ok(),
        3 => |from, to| {
            let mut zlib = flate2::Decompress::new(true);
            zlib.decompress(from, to, flate2::FlushDecompress::Finish).ok()?;
            usize::try_from(zlib.total_out()).ok()
        },
        other => return Err(broken(&format!("packed by Blosc's codec {other}; LZ4 (1) and zlib (3) are known"))),
    };
    // LZ4 makes 255 bytes of one, zlib a thousand.
    if size > packed.len().saturating_mul(1100) {
        return Err(broken("fewer bytes than could hold so many"));
    }
    let mut bytes = vec![0; size];
    let mut shuffled = Vec::new();
    for (index, target) in bytes.chunks_mut(block).enumerate() {
        let is_cut = target.len() < block;
        let is_split = flags & 16 == 0 && element <= 16 && block / element >= LEAST_SPLIT && !is_cut;
        let streams = if is_split { element } else { 1 };
        if !target.len().is_multiple_of(streams) {
            return Err(broken("a block that is no whole number of elements"));
        }
        shuffled.resize(target.len(), 0);
        let mut at = word(HEADER + 4 * index)?;
        for stream in shuffled.chunks_mut(target.len() / streams) {
            let length = word(at)?;
            let from = packed.get(at + 4..).and_then(|rest| rest.get(..length)).ok_or_else(|| broken("ends early"))?;
            at += 4 + length;
            if length == stream.len() {
                stream.copy_from_slice(from);
            } else if unpack(from, stream) != Some(stream.len()) {
                return Err(broken("a block that cannot be unpacked"));
            }
        }
        if flags & 1 != 0 && element > 1 {
            unshuffle(&shuffled, element, target);
        } else {
            target.copy_from_slice(&shuffled);
        }
    }
    Ok(bytes)
}

/// First bytes of all elements, then second ones, back in order; what is left over stays.
fn unshuffle(shuffled: &[u8], element: usize, target: &mut [u8]) {
    let count = shuffled.len() / element;
    for (i, one) in target.chunks_exact_mut(element).enumerate() {
        for (byte, value) in one.iter_mut().enumerate() {
            *value = shuffled.get(byte * count + i).copied().unwrap_or(0);
        }
    }
    let whole = count * element;
    if let (Some(to), Some(from)) = (target.get_mut(whole..), shuffled.get(whole..)) {
        to.copy_from_slice(from);
    }
}
