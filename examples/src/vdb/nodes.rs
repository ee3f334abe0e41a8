//! Trees of OpenVDB: first all nodes, then the values of all leaves.

use std::collections::HashSet;

use super::bytes::{Cursor, Fault, Number, child_place, is_set};
use super::{Grid, Leaf, Tile, pack};

/// How values of a tree are stored.
#[derive(Debug, Clone, Copy)]
pub(super) struct Storage {
    /// Bits: 1 zip, 2 only active values, 4 Blosc.
    pub(super) compression: u32,
    /// Numbers in buffers.
    pub(super) buffers: Number,
    /// Numbers by themselves.
    pub(super) single: Number,
}

/// Nodes below the root hold 2^5 children along each edge, those below them 2^4.
const UPPER: u32 = 5;
const LOWER: u32 = 4;

/// Voxels along the edges of nodes.
const UPPER_EDGE: i32 = 4096;
const LOWER_EDGE: i32 = 128;
const LEAF_EDGE: i32 = 8;

/// Farthest voxel: sums of a few of these are still numbers.
const FARTHEST: u32 = 1 << 28;

pub(super) fn read(cursor: &mut Cursor<'_>, storage: Storage, grid: &mut Grid) -> Result<(), Fault> {
    let buffers = cursor.u32()?;
    if buffers != 1 {
        return Err(cursor.fault(format!("{buffers} buffers; only one is known")));
    }
    grid.background = storage.single.read(cursor)?;
    let (tiles, children) = (cursor.u32()?, cursor.u32()?);
    let mut seen = HashSet::new();
    let mut origin = |cursor: &mut Cursor<'_>| -> Result<[i32; 3], Fault> {
        let origin = cursor.coordinates()?;
        if origin.iter().any(|c| c % UPPER_EDGE != 0 || c.unsigned_abs() > FARTHEST) || !seen.insert(origin) {
            return Err(cursor.fault(format!("a node at {origin:?}, where none can be")));
        }
        Ok(origin)
    };
    for _ in 0..tiles {
        let origin = origin(cursor)?;
        let value = storage.single.read(cursor)?;
        let tile = Tile { origin, edge: UPPER_EDGE, value, is_active: cursor.u8()? != 0 };
        push(grid, tile);
    }
    for _ in 0..children {
        let origin = origin(cursor)?;
        internal(cursor, storage, grid, Level { origin, log: UPPER, edge: LOWER_EDGE })?;
    }
    for index in 0..grid.leaves.len() {
        let mask = cursor.mask::<8>()?;
        if grid.leaves.get(index).is_some_and(|leaf| leaf.active != mask) {
            return Err(cursor.fault(format!("leaf {index} says twice which voxels are active, and not the same")));
        }
        values(cursor, storage, grid.background, &mask, &mut grid.values)?;
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

fn internal(cursor: &mut Cursor<'_>, storage: Storage, grid: &mut Grid, node: Level) -> Result<(), Fault> {
    let words = (1 << (3 * node.log)) / 64;
    let mut mask = || (0..words).map(|_| cursor.u64()).collect::<Result<Vec<u64>, Fault>>();
    let (children, active) = (mask()?, mask()?);
    let mut found = Vec::new();
    values(cursor, storage, grid.background, &active, &mut found)?;
    for (index, value) in found.into_iter().enumerate() {
        let place = child_place(index, node.log);
        let origin = [0, 1, 2].map(|axis| node.origin[axis] + place[axis] * node.edge);
        if !is_set(&children, index) {
            push(grid, Tile { origin, edge: node.edge, value, is_active: is_set(&active, index) });
        } else if node.edge == LEAF_EDGE {
            grid.leaves.push(Leaf { origin, active: cursor.mask::<8>()? });
        } else {
            internal(cursor, storage, grid, Level { origin, log: LOWER, edge: LEAF_EDGE })?;
        }
    }
    Ok(())
}

/// The values of a node, as many as its mask has bits, added to `all`.
///
/// A byte says what inactive values are, where only the active ones are stored: the background or its negative (0 to 2, of one kind, 2
/// another that follows), or two kinds, with a mask that tells them apart (3 to 5); 6 says that all values are stored.
fn values(
    cursor: &mut Cursor<'_>,
    storage: Storage,
    background: f32,
    active: &[u64],
    all: &mut Vec<f32>,
) -> Result<(), Fault> {
    let kind = cursor.u8()?;
    if kind > 6 {
        return Err(cursor.fault(format!("unknown storage {kind} of values")));
    }
    let mut inactive = [if kind == 0 { background } else { -background }, background];
    if matches!(kind, 2 | 4 | 5) {
        inactive[0] = storage.single.read(cursor)?;
    }
    if kind == 5 {
        inactive[1] = storage.single.read(cursor)?;
    }
    let count = active.len() * 64;
    let second = match kind {
        3..=5 => (0..active.len()).map(|_| cursor.u64()).collect::<Result<Vec<_>, _>>()?,
        _ => Vec::new(),
    };
    let is_sparse = storage.compression & 2 != 0 && kind != 6;
    let stored = if is_sparse { active.iter().map(|word| word.count_ones() as usize).sum() } else { count };
    let size = stored * storage.buffers.bytes();
    let unpacked;
    let bytes: &[u8] = if stored == 0 && storage.buffers != storage.single {
        // Of halves that stand for other numbers, none are stored as nothing at all.
        &[]
    } else if storage.compression & 5 != 0 {
        let length = cursor.i64()?;
        let packed = cursor.take(length.unsigned_abs())?;
        if length <= 0 {
            packed
        } else {
            unpacked =
                if storage.compression & 4 != 0 { pack::unblosc(packed, size)? } else { pack::unzip(packed, size)? };
            &unpacked
        }
    } else {
        cursor.take(size as u64)?
    };
    if bytes.len() != size {
        return Err(cursor.fault(format!("{} bytes of values where {size} are due", bytes.len())));
    }
    if !is_sparse {
        storage.buffers.all(bytes, |value| all.push(value));
        return Ok(());
    }
    let start = all.len();
    all.extend((0..count).map(|index| inactive[usize::from(is_set(&second, index))]));
    let mut places = (0..count).filter(|index| is_set(active, *index));
    storage.buffers.all(bytes, |value| {
        if let Some(target) = places.next().and_then(|place| all.get_mut(start + place)) {
            *target = value;
        }
    });
    Ok(())
}
