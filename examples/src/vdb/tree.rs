//! Trees of NanoVDB: nodes that say how many bytes away their children lie.

use std::collections::HashSet;

use super::bytes::{Cursor, Fault, Number, child_place, is_set};
use super::{Grid, LEAF, Leaf, Tile};

/// How values of leaves are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    /// As they are.
    Plain(Number),
    /// As whole numbers of so many bits, times a factor, plus a summand.
    Codes(u32),
    /// The same, with as many bits as the leaf says.
    Varying,
}

impl Encoding {
    /// How single values are stored, in nodes above leaves.
    fn single(self) -> Number {
        match self {
            Self::Plain(number) => number,
            Self::Codes(_) | Self::Varying => Number::Float,
        }
    }

    /// Bytes of minimum, maximum, average and deviation of a node.
    fn statistics(self) -> u64 {
        match self.single() {
            // The latter two of halves are floats.
            Number::Half => 2 * 2 + 2 * 4,
            Number::Float => 4 * 4,
            Number::Double => 4 * 8,
        }
    }
}

/// What follows is aligned to so many bytes.
const ALIGNED: u64 = 32;

const UPPER_EDGE: i32 = 4096;
const LOWER_EDGE: i32 = 128;
const LEAF_EDGE: i32 = 8;

/// Farthest voxel: sums of a few of these are still numbers.
const FARTHEST: u32 = 1 << 28;

/// What every node is read with.
struct Reader<'a> {
    tree: Cursor<'a>,
    encoding: Encoding,
    /// Leaves there were room for in the file: no more can be.
    most: usize,
}

/// `tree` stands at the tree, 64 bytes that say where the root is.
pub(super) fn read(tree: Cursor<'_>, encoding: Encoding, grid: &mut Grid) -> Result<(), Fault> {
    let start = tree.position() as u64;
    let mut cursor = tree;
    cursor.take(24)?;
    let root = start.checked_add(cursor.u64()?).ok_or_else(|| tree.fault("its root is nowhere"))?;
    let leaves = cursor.u32()? as usize;
    let reader = Reader { tree, encoding, most: leaves };
    let number = encoding.single();
    let mut cursor = tree.at(root, tree.place)?;
    // A box.
    cursor.take(24)?;
    let count = cursor.u32()?;
    // Numbers of eight bytes are aligned to eight.
    if number == Number::Double {
        cursor.take(4)?;
    }
    grid.background = number.read(&mut cursor)?;
    let base = 28 + if number == Number::Double { 4 } else { 0 };
    let head = (base + number.bytes() as u64 + reader.encoding.statistics()).next_multiple_of(ALIGNED);
    // Key, child, state and value, in 32 bytes.
    let mut seen = HashSet::new();
    for index in 0..u64::from(count) {
        let mut tile = tree.at(root + head + index * ALIGNED, tree.place)?;
        let (key, child, state) = (tile.u64()?, tile.i64()?, tile.u32()?);
        if number == Number::Double {
            tile.take(4)?;
        }
        let value = number.read(&mut tile)?;
        // Three times 21 bits, of which the lowest is of z; the sign comes from above.
        let origin = [42, 21, 0].map(|shift| ((key >> shift & 0x1f_ffff) << 12) as u32 as i32);
        if origin.iter().any(|c| c.unsigned_abs() > FARTHEST) || !seen.insert(origin) {
            return Err(tree.fault(format!("a node at {origin:?}, where none can be")));
        }
        if child == 0 {
            push(grid, Tile { origin, edge: UPPER_EDGE, value, is_active: state != 0 });
        } else {
            let node = Level { origin, log: 5, edge: LOWER_EDGE };
            reader.internal(reader.child(root, child)?, node, grid)?;
        }
    }
    Ok(())
}

fn push(grid: &mut Grid, tile: Tile) {
    if tile.is_active || tile.value != grid.background {
        grid.tiles.push(tile);
    }
}

/// A node that is neither root nor leaf.
#[derive(Debug, Clone, Copy)]
struct Level {
    origin: [i32; 3],
    /// Children along its edge, by logarithm.
    log: u32,
    /// Voxels along the edge of a child.
    edge: i32,
}

impl Reader<'_> {
    fn child(&self, node: u64, offset: i64) -> Result<u64, Fault> {
        // Children lie behind their parents, so that there is an end to them.
        let place = (offset > 0).then(|| node.checked_add(offset.unsigned_abs())).flatten();
        place.ok_or_else(|| self.tree.fault("a child that lies before its parent"))
    }

    fn internal(&self, at: u64, node: Level, grid: &mut Grid) -> Result<(), Fault> {
        let mut cursor = self.tree.at(at, self.tree.place)?;
        // A box and flags.
        cursor.take(32)?;
        let words = (1 << (3 * node.log)) / 64;
        let mut mask = || (0..words).map(|_| cursor.u64()).collect::<Result<Vec<u64>, Fault>>();
        let (active, children) = (mask()?, mask()?);
        let head = (32 + 16 * words as u64 + self.encoding.statistics()).next_multiple_of(ALIGNED);
        let mut table = self.tree.at(at + head, self.tree.place)?;
        for index in 0..words * 64 {
            let entry = table.array::<8>()?;
            let place = child_place(index, node.log);
            let origin = [0, 1, 2].map(|axis| node.origin[axis] + place[axis] * node.edge);
            if !is_set(&children, index) {
                let value = self.encoding.single().read(&mut Cursor::new(&entry, self.tree.place))?;
                push(grid, Tile { origin, edge: node.edge, value, is_active: is_set(&active, index) });
                continue;
            }
            let child = self.child(at, i64::from_le_bytes(entry))?;
            if node.edge == LEAF_EDGE {
                self.leaf(child, origin, grid)?;
            } else {
                self.internal(child, Level { origin, log: 4, edge: LEAF_EDGE }, grid)?;
            }
        }
        Ok(())
    }

    fn leaf(&self, at: u64, origin: [i32; 3], grid: &mut Grid) -> Result<(), Fault> {
        if grid.leaves.len() >= self.most {
            return Err(self.tree.fault(format!("more leaves than the {} it says there are", self.most)));
        }
        let mut cursor = self.tree.at(at, self.tree.place)?;
        cursor.take(15)?;
        let flags = cursor.u8()?;
        grid.leaves.push(Leaf { origin, active: cursor.mask::<8>()? });
        const HEAD: u64 = 80;
        if let Encoding::Plain(number) = self.encoding {
            let head = (HEAD + self.encoding.statistics()).next_multiple_of(ALIGNED);
            let bytes = self.tree.at(at + head, self.tree.place)?.take((LEAF * number.bytes()) as u64)?;
            number.all(bytes, |value| grid.values.push(value));
            return Ok(());
        }
        let (least, quantum) = (cursor.f32()?, cursor.f32()?);
        // Statistics, as codes.
        cursor.take(8)?;
        let bits = match self.encoding {
            Encoding::Codes(bits) => bits,
            _ => 1 << (flags >> 5).min(4),
        };
        let bytes = cursor.take(LEAF as u64 / 8 * u64::from(bits))?;
        let mut code = |code: u16| grid.values.push(f32::from(code) * quantum + least);
        if bits == 16 {
            bytes.as_chunks::<2>().0.iter().for_each(|pair| code(u16::from_le_bytes(*pair)));
        } else {
            for byte in bytes {
                (0..8 / bits).for_each(|i| code(u16::from(*byte) >> (i * bits) & ((1 << bits) - 1)));
            }
        }
        Ok(())
    }
}
