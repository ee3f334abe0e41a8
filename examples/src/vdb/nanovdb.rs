//! NanoVDB files: segments of grids, each an image of memory, packed or not.

use super::bytes::{Cursor, Fault, Number};
use super::tree::{self, Encoding};
use super::{Class, Grid, budget, choose, pack};
use crate::transform::Transform;

/// The major version whose files these are.
const VERSION: u32 = 32;

/// `NanoVDB` and a digit: 0 in old files, 1 for grids and 2 for files in newer ones.
pub(super) fn is_magic(bytes: &[u8]) -> bool {
    matches!(bytes, [b'N', b'a', b'n', b'o', b'V', b'D', b'B', b'0'..=b'2'])
}

/// What a file says of a grid before the grid itself.
#[derive(Debug)]
struct Entry {
    name: String,
    kind: u32,
    codec: u16,
    /// Bytes in memory, and in the file.
    size: u64,
    packed: u64,
    /// Where it lies in the file.
    at: u64,
}

/// How values of a type are stored; `None` if they are no numbers.
fn encoding(kind: u32) -> Option<Encoding> {
    Some(match kind {
        1 => Encoding::Plain(Number::Float),
        2 => Encoding::Plain(Number::Double),
        9 => Encoding::Plain(Number::Half),
        13 => Encoding::Codes(4),
        14 => Encoding::Codes(8),
        15 => Encoding::Codes(16),
        16 => Encoding::Varying,
        _ => return None,
    })
}

pub(super) fn read(bytes: Vec<u8>, wanted: Option<&str>) -> Result<Grid, Fault> {
    let entries = entries(Cursor::new(&bytes, "header"))?;
    let chosen = choose(&entries, wanted, |e| &e.name, |e| encoding(e.kind).is_some())?;
    let place = format!("grid \"{}\"", chosen.name);
    let Some(encoding) = encoding(chosen.kind) else {
        let reason = format!(
            "its type is number {} of NanoVDB; Float, Double, Half, Fp4, Fp8, Fp16 and FpN are known",
            chosen.kind
        );
        return Err(Fault::new(place, reason));
    };
    let packed = Cursor::new(&bytes, &place).at(chosen.at, &place)?.take(chosen.packed)?;
    if chosen.codec == 0 {
        return grid(packed, chosen, encoding, &place);
    }
    let size = usize::try_from(chosen.size).ok().filter(|size| *size <= budget(bytes.len()));
    let size = size.ok_or_else(|| Fault::new(&*place, format!("{} bytes are more than are unpacked", chosen.size)))?;
    let unpacked = unpack(packed, chosen.codec, size, &place)?;
    let entry = Entry { name: chosen.name.clone(), ..*chosen };
    // What is packed is not needed any more, and memory may be short.
    drop(bytes);
    grid(&unpacked, &entry, encoding, &place)
}

fn entries(mut file: Cursor<'_>) -> Result<Vec<Entry>, Fault> {
    let mut all = Vec::new();
    while !file.is_at_end() {
        if !is_magic(file.take(8)?) {
            return Err(file.fault(format!("no segment begins at byte {}", file.position() - 8)));
        }
        let version = file.u32()? >> 21;
        if version != VERSION {
            return Err(file.fault(format!("major version {version} is not known; {VERSION} is")));
        }
        let (count, codec) = (file.u16()?, file.u16()?);
        if codec > 2 {
            return Err(file.fault(format!("unknown codec {codec}")));
        }
        let first = all.len();
        for _ in 0..count {
            let (size, packed) = (file.u64()?, file.u64()?);
            let (_key, _voxels) = (file.u64()?, file.u64()?);
            let (kind, _class) = (file.u32()?, file.u32()?);
            // Boxes in the world and in voxels, the size of a voxel.
            file.take(48 + 24 + 24)?;
            let length = file.u32()?;
            // Counts of nodes and tiles, codec, version.
            file.take(16 + 12 + 8)?;
            let name = file.take(u64::from(length))?;
            let end = name.iter().position(|byte| *byte == 0).unwrap_or(name.len());
            let name = String::from_utf8_lossy(name.get(..end).unwrap_or_default()).into_owned();
            all.push(Entry { name, kind, codec, size, packed, at: 0 });
        }
        for entry in all.iter_mut().skip(first) {
            entry.at = file.position() as u64;
            file.take(entry.packed)?;
        }
    }
    Ok(all)
}

/// Codec 1 is zip, in one piece; 2 is Blosc, in pieces of up to a gibibyte.
fn unpack(packed: &[u8], codec: u16, size: usize, place: &str) -> Result<Vec<u8>, Fault> {
    let mut cursor = Cursor::new(packed, place);
    if codec == 1 {
        let length = cursor.u64()?;
        return pack::unzip(cursor.take(length)?, size);
    }
    const PIECE: usize = 1 << 30;
    let mut bytes = Vec::new();
    while bytes.len() < size {
        let length = cursor.u64()?;
        let piece = pack::unblosc(cursor.take(length)?, PIECE.min(size - bytes.len()))?;
        if bytes.is_empty() {
            bytes = piece;
        } else {
            bytes.extend(piece);
        }
    }
    Ok(bytes)
}

/// Bytes before the tree.
const GRID: u64 = 672;

fn grid(bytes: &[u8], entry: &Entry, encoding: Encoding, place: &str) -> Result<Grid, Fault> {
    let file = Cursor::new(bytes, place);
    if !is_magic(file.at(0, place)?.take(8)?) {
        return Err(file.fault("it does not begin as a grid does"));
    }
    let mut map = file.at(296 + 88, place)?;
    let mut numbers = [0.0; 9];
    for number in &mut numbers {
        *number = map.f64()?;
    }
    let mut vector = file.at(296 + 232, place)?;
    let offset = [vector.f64()?, vector.f64()?, vector.f64()?];
    let rows = [0, 1, 2].map(|row| [numbers[3 * row], numbers[3 * row + 1], numbers[3 * row + 2], offset[row]]);
    let mut class = file.at(632, place)?;
    let (class, kind) = (class.u32()?, class.u32()?);
    if kind != entry.kind {
        return Err(file.fault(format!("it is of type {kind} where the file says {}", entry.kind)));
    }
    let class = match class {
        1 => Class::LevelSet,
        2 => Class::FogVolume,
        _ => Class::Other,
    };
    let mut grid = Grid {
        name: entry.name.clone(),
        class,
        to_world: Transform { rows },
        background: 0.0,
        leaves: Vec::new(),
        values: Vec::new(),
        tiles: Vec::new(),
    };
    tree::read(file.at(GRID, place)?, encoding, &mut grid)?;
    Ok(grid)
}
