//! A coarse grid of bounds, and the walk of a ray through it.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::Density;
use super::region::{LocalLine, Slabs};

/// Cells along the edge of a block.
pub const BLOCK: u32 = 4;

/// Bounds of density in a block of [`BLOCK`]³ cells.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct MinMax {
    /// Lower bound.
    pub min: f32,
    /// Upper bound; equal to the lower one only where density is constant.
    pub max: f32,
}

impl MinMax {
    /// The bounds of nothing.
    const NONE: Self = Self { min: f32::INFINITY, max: 0.0 };

    /// Bounds of both.
    #[inline]
    pub(super) fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Bounds with room for the rounding of an interpolation between different values.
    fn padded(self) -> Self {
        const ROOM: f32 = 8.0 * f32::EPSILON;
        if self.min == self.max {
            return self;
        }
        Self { min: self.min * (1.0 - ROOM), max: self.max * (1.0 + ROOM) }
    }
}

/// Blocks along each axis.
pub(super) fn blocks_along(size: [u32; 3]) -> [u32; 3] {
    size.map(|n| n.div_ceil(BLOCK))
}

/// Fills the bounds of every block and returns those of the whole grid.
///
/// A block covers whole cells, and interpolation inside it touches their neighbours' centres: one
/// cell more on each side. A point half a cell outside the block still finds nothing else, which
/// is far more than the rounding of a distance along a ray.
pub(super) fn fill(blocks: &mut [MinMax], density: &Density<'_>, size: [u32; 3]) -> MinMax {
    let [bx, by, _] = blocks_along(size);
    let mut whole = MinMax::NONE;
    for (index, block) in (0_u32..).zip(blocks.iter_mut()) {
        let position = [index % bx, index / bx % by, index / bx / by];
        let range = |axis: usize| {
            let first = position[axis] * BLOCK;
            first.saturating_sub(1) as usize..(first + BLOCK + 1).min(size[axis]) as usize
        };
        let mut bounds = MinMax::NONE;
        for z in range(2) {
            for y in range(1) {
                let row = (z * size[1] as usize + y) * size[0] as usize;
                for x in range(0) {
                    let value = density.value(row + x);
                    bounds = bounds.union(MinMax { min: value, max: value });
                }
            }
        }
        *block = bounds.padded();
        whole = whole.union(*block);
    }
    whole
}

/// A run of blocks along a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Run {
    /// Nothing up to the distance (m), which may be infinite.
    Vacuum(f32),
    /// The block of this index up to the distance (m).
    Block(usize, f32),
    /// Positions are too coarse to tell blocks apart: all of the grid up to the distance (m).
    Whole(f32),
}

/// Where rounding of positions could reach this many cells, blocks are not told apart: 2¹⁸ cells
/// away, with some sixteen roundings of relative size 2⁻²⁴ on the way, it reaches a quarter of a
/// cell.
const FAR: f32 = 262_144.0;

/// Walks from `from` along a line, in cell coordinates `[0, size]`, to the end of the first block
/// in which something is, or of the empty blocks before it.
///
/// `reach` is how many cells a distance of 1 m may span (largest row sum of the map) and the
/// largest coordinate the line starts from.
#[inline]
pub(super) fn walk(
    line: &LocalLine,
    size: [u32; 3],
    from: f32,
    length: f32,
    reach: (f32, f32),
    is_empty: impl Fn(usize) -> bool,
) -> Run {
    let slabs: Slabs = line.slabs(Vec3::new(size[0] as f32, size[1] as f32, size[2] as f32));
    let Some((near, far)) = slabs.interval() else { return Run::Vacuum(f32::INFINITY) };
    if far <= from {
        return Run::Vacuum(f32::INFINITY);
    }
    let mut t = near.max(from);
    let is_precise = reach.0 * far + reach.1 <= FAR;
    if !is_precise {
        return if t > from { Run::Vacuum(t) } else { Run::Whole(far) };
    }
    let blocks = blocks_along(size);
    let start = line.origin + line.direction * t;
    const PER_CELL: f32 = 1.0 / BLOCK as f32;
    // One axis of the walk: block index, its step, the plane where the block ends, the number of
    // blocks left, and how far the index of the whole grid moves.
    let axis = |i: usize, stride: usize| {
        let index = ((start[i] * PER_CELL) as u32).min(blocks[i] - 1);
        let forward = line.direction[i] > 0.0;
        let plane = ((index + u32::from(forward)) * BLOCK) as f32;
        Axis {
            index: index as usize * stride,
            stride: if forward { stride } else { stride.wrapping_neg() },
            step: if forward { BLOCK as f32 } else { -(BLOCK as f32) },
            plane,
            left: if forward { blocks[i] - 1 - index } else { index },
            exit: (plane - line.origin[i]) * line.inverse[i],
        }
    };
    let mut x = axis(0, 1);
    let mut y = axis(1, blocks[0] as usize);
    let mut z = axis(2, blocks[0] as usize * blocks[1] as usize);
    let mut index = x.index + y.index + z.index;
    loop {
        let exit = x.exit.min(y.exit).min(z.exit);
        // A block that rounding makes shorter than nothing holds no distance to speak of.
        if exit > t {
            if !is_empty(index) {
                return if t > from { Run::Vacuum(t) } else { Run::Block(index, exit.min(far)) };
            }
            t = exit;
            if t >= far {
                return Run::Vacuum(f32::INFINITY);
            }
            if t > length {
                return Run::Vacuum(t);
            }
        }
        let (axis, i) = if x.exit <= y.exit && x.exit <= z.exit {
            (&mut x, 0)
        } else if y.exit <= z.exit {
            (&mut y, 1)
        } else {
            (&mut z, 2)
        };
        if axis.left == 0 {
            return Run::Vacuum(f32::INFINITY);
        }
        axis.left -= 1;
        axis.plane += axis.step;
        // From the origin each time: a sum of steps would drift.
        axis.exit = (axis.plane - line.origin[i]) * line.inverse[i];
        index = index.wrapping_add(axis.stride);
    }
}

struct Axis {
    index: usize,
    stride: usize,
    step: f32,
    plane: f32,
    left: u32,
    exit: f32,
}
