//! Densities where there are any: bricks of cells, and a table that says where they lie.

use glam::Vec3;

use super::MediumError;
use super::density::Corners;
use super::joining::Range;
use super::majorant::MinMax;

/// Cells along the edge of a brick.
pub const BRICK: u32 = 8;

/// Bricks along the edge of a node.
pub const NODE: u32 = 16;

/// Cells of a brick.
const CELLS: usize = (BRICK * BRICK * BRICK) as usize;

/// Cells along the edge of a node.
const NODE_CELLS: u32 = NODE * BRICK;

/// Slots of a node.
const SLOTS: usize = (NODE * NODE * NODE) as usize;

/// Densities of a sparse grid: of the cells of a box, most of them zero.
///
/// The box is cut into nodes of 128³ cells, and these into 16³ slots for bricks of 8³. `nodes` has an entry for each node of the box,
/// x fastest; `slots` 16³ for each node that is there, and `cells` 8³ for each brick, x fastest in both. An entry is the place of what
/// it means in the next list, or [`Bricks::NOTHING`]: everything below it is zero. Several slots may share a brick.
///
/// Memory and time go with what is filled. A brick takes 2 KiB, a node 16 KiB, and 49 KiB more for the [`NodeBounds`] that
/// [`SparseGrid`](super::SparseGrid) fills in.
///
/// ```
/// # use fogbow::medium::Bricks;
/// // One brick in a box of 130 × 8 × 8 cells: two nodes, of which one is there. Its last slot along x holds the brick.
/// let mut slots = [Bricks::NOTHING; 16 * 16 * 16];
/// slots[15] = 0;
/// let bricks = Bricks { size: [130, 8, 8], nodes: &[0, Bricks::NOTHING], slots: &slots, cells: &[0.5; 512] };
/// assert_eq!((bricks.value([119, 3, 3]), bricks.value([120, 3, 3]), bricks.value([128, 3, 3])), (0.0, 0.5, 0.0));
/// assert_eq!(bricks.value([-1, 3, 3]), 0.0);   // outside there is nothing
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bricks<'a> {
    /// Cells of the box along each axis.
    pub size: [u32; 3],
    /// For each node of the box, which of those in `slots` it is.
    pub nodes: &'a [u32],
    /// For each slot of each node, which of those in `cells` its brick is.
    pub slots: &'a [u32],
    /// Densities, finite and not negative.
    pub cells: &'a [f32],
}

/// What walks and look-ups ask of the slots of a node: lent to a [`SparseGrid`](super::SparseGrid), which fills it in.
///
/// ```
/// # use fogbow::medium::{Bricks, NodeBounds};
/// let slots = [Bricks::NOTHING; 4096];
/// // One for each node that is there.
/// let bounds = vec![NodeBounds::EMPTY; slots.len() / NodeBounds::SLOTS];
/// assert_eq!(bounds.len(), 1);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NodeBounds {
    /// For each aligned cube of 1, 2, 4 and 8 slots along its edge, x fastest, a bit that says whether something is there: of a box of
    /// thousands of cells they stay in a cache, where bounds do not.
    filled: ([u64; SLOTS / 64], [u64; SLOTS / 512], [u64; 1], [u64; 1]),
    slots: [Slot; SLOTS],
}

/// Bounds of a slot beside its brick: who comes to the one wants the other next.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Slot {
    bounds: MinMax,
    brick: u32,
}

impl NodeBounds {
    /// Slots of a node.
    pub const SLOTS: usize = SLOTS;

    /// A node with nothing in it.
    pub const EMPTY: Self = Self {
        filled: ([0; _], [0; _], [0], [0]),
        slots: [Slot { bounds: MinMax { min: 0.0, max: 0.0 }, brick: Bricks::NOTHING }; _],
    };

    /// Bounds of a slot, by its place in the node.
    #[inline]
    pub(super) fn bounds(&self, at: [u32; 3]) -> MinMax {
        self.slots.get(place(at, 0)).map_or(MinMax::default(), |slot| slot.bounds)
    }

    fn set_bounds(&mut self, at: [u32; 3], bounds: MinMax) {
        self.slots[place(at, 0)].bounds = bounds;
        if bounds.max > 0.0 {
            let set = |words: &mut [u64], level: u32| {
                let bit = place(at, level);
                words[bit / 64] |= 1 << (bit % 64);
            };
            let (slots, twos, fours, eights) = &mut self.filled;
            set(slots, 0);
            set(twos, 1);
            set(fours, 2);
            set(eights, 3);
        }
    }

    /// Slots along the edge of the largest aligned cube around a slot in which nothing is; 0 where something is in the slot.
    #[inline]
    pub(super) fn gap(&self, at: [u32; 3]) -> u32 {
        let is_filled = |words: &[u64], level: u32| {
            let bit = place(at, level);
            words.get(bit / 64).is_some_and(|word| (word >> (bit % 64)) & 1 == 1)
        };
        let (slots, twos, fours, eights) = &self.filled;
        if is_filled(slots, 0) {
            0
        } else if is_filled(twos, 1) {
            1
        } else if is_filled(fours, 2) {
            2
        } else if is_filled(eights, 3) {
            4
        } else if *eights != [0] {
            8
        } else {
            NODE
        }
    }
}

/// The place of a cube of `2^level` slots along its edge, among those of its node.
#[inline(always)]
fn place(slot: [u32; 3], level: u32) -> usize {
    let [x, y, z] = slot.map(|c| ((c % NODE) >> level) as usize);
    let along = (NODE >> level) as usize;
    (z * along + y) * along + x
}

impl Bricks<'_> {
    /// The entry of a node or slot with nothing in it.
    pub const NOTHING: u32 = u32::MAX;

    /// Number of nodes of a box; 0 for a size no grid can have.
    ///
    /// ```
    /// # use fogbow::medium::Bricks;
    /// assert_eq!(Bricks::node_count([128, 129, 1]), 2);
    /// assert_eq!(Bricks::node_count([0, 5, 5]), 0);
    /// ```
    #[must_use]
    pub fn node_count(size: [u32; 3]) -> usize {
        // Look-ups count cells in f32.
        if size.iter().any(|n| *n > 1 << 22) {
            return 0;
        }
        let along = nodes_along(size).map(|n| n as usize);
        along.iter().try_fold(1_usize, |product, n| product.checked_mul(*n)).unwrap_or(0)
    }

    /// Density of one cell; 0 outside.
    #[inline]
    #[must_use]
    pub fn value(&self, cell: [i32; 3]) -> f32 {
        let [x, y, z] = cell.map(|c| c as u32);
        // Below zero wraps to beyond the end.
        if x >= self.size[0] || y >= self.size[1] || z >= self.size[2] {
            return 0.0;
        }
        self.brick([x, y, z].map(|c| c / BRICK)).map_or(0.0, |brick| brick[within([x, y, z])])
    }

    /// Whether the table and its lists belong together, and every density is a density.
    pub(super) fn check(&self) -> Result<(), MediumError> {
        let is_node = |n: &u32| *n == Self::NOTHING || (*n as usize) < self.slots.len() / SLOTS;
        let is_brick = |n: &u32| *n == Self::NOTHING || (*n as usize) < self.cells.len() / CELLS;
        let count = Self::node_count(self.size);
        let is_whole = self.slots.len().is_multiple_of(SLOTS) && self.cells.len().is_multiple_of(CELLS);
        if count == 0 || self.nodes.len() != count || !is_whole {
            return Err(MediumError::Size);
        }
        if !(self.nodes.iter().all(is_node) && self.slots.iter().all(is_brick)) {
            return Err(MediumError::Size);
        }
        if !self.cells.iter().all(|v| *v >= 0.0 && *v < f32::INFINITY) {
            return Err(MediumError::Density);
        }
        Ok(())
    }

    /// The place in `slots` of a node, in nodes from the corner; `None` where it is not there or outside.
    #[inline]
    pub(super) fn node(&self, node: [u32; 3]) -> Option<usize> {
        let [nx, ny, nz] = nodes_along(self.size);
        let [x, y, z] = node;
        if x >= nx || y >= ny || z >= nz {
            return None;
        }
        let index = (z as usize * ny as usize + y as usize) * nx as usize + x as usize;
        let entry = *self.nodes.get(index)?;
        (entry != Self::NOTHING).then_some(entry as usize)
    }

    /// The place in `slots` of a slot, in bricks from the corner; `None` where its node is not there.
    #[inline]
    pub(super) fn slot(&self, brick: [u32; 3]) -> Option<usize> {
        Some(self.node(brick.map(|c| c / NODE))? * SLOTS + place(brick, 0))
    }

    /// The cells of a brick, in bricks from the corner; `None` where there is nothing.
    #[inline]
    pub(super) fn brick(&self, brick: [u32; 3]) -> Option<&[f32; CELLS]> {
        let entry = *self.slots.get(self.slot(brick)?)? as usize;
        self.cells.get(entry * CELLS..)?.first_chunk()
    }

    /// Bounds of every slot, over the cells that interpolation inside it touches, one more on each side; and those of all.
    ///
    /// # Errors
    /// Where a slot that is not there would have some: in a node that is missing beside a cell that is not empty. Outermost cells
    /// that are not empty.
    pub(super) fn fill(&self, bounds: &mut [NodeBounds]) -> Result<MinMax, MediumError> {
        let nodes = self.slots.as_chunks::<SLOTS>().0;
        if bounds.len() != nodes.len() {
            return Err(MediumError::Blocks);
        }
        for (bounds, bricks) in bounds.iter_mut().zip(nodes) {
            *bounds = NodeBounds::EMPTY;
            for (slot, brick) in bounds.slots.iter_mut().zip(bricks) {
                slot.brick = *brick;
            }
        }
        let along = nodes_along(self.size);
        let bricks = self.size.map(|n| n.div_ceil(BRICK));
        let mut whole = MinMax { min: 0.0, max: 0.0 };
        for node in positions(along) {
            let around = |offset: [u32; 3]| [0, 1, 2].map(|axis| (node[axis] + offset[axis]).wrapping_sub(1));
            if !positions([3; 3]).any(|offset| self.node(around(offset)).is_some()) {
                continue;
            }
            for slot in positions([NODE; 3]) {
                let brick = [0, 1, 2].map(|axis| node[axis] * NODE + slot[axis]);
                if (0..3).any(|axis| brick[axis] >= bricks[axis]) {
                    continue;
                }
                match self.node(node) {
                    Some(place) => {
                        self.check_border(brick)?;
                        let found = self.around(brick).padded();
                        whole = whole.union(&found);
                        if let Some(bounds) = bounds.get_mut(place) {
                            bounds.set_bounds(slot, found);
                        }
                    }
                    // Only those along the faces of a missing node have neighbours that are there.
                    None => {
                        let is_at_face = slot.iter().any(|c| *c == 0 || *c + 1 == NODE);
                        if is_at_face && self.around(brick).max > 0.0 {
                            return Err(MediumError::Nodes);
                        }
                    }
                }
            }
        }
        Ok(whole)
    }

    /// Whether the cells of a brick are empty that lie outermost in the box, or beyond.
    fn check_border(&self, brick: [u32; 3]) -> Result<(), MediumError> {
        let is_inner = (0..3).all(|axis| brick[axis] > 0 && (brick[axis] + 1) * BRICK < self.size[axis]);
        let Some(cells) = self.brick(brick).filter(|_| !is_inner) else { return Ok(()) };
        let is_outer = |cell: [u32; 3]| {
            (0..3).any(|axis| {
                let at = brick[axis] * BRICK + cell[axis];
                at == 0 || at + 1 >= self.size[axis]
            })
        };
        let is_empty = positions([BRICK; 3]).zip(cells).all(|(cell, value)| *value == 0.0 || !is_outer(cell));
        if is_empty { Ok(()) } else { Err(MediumError::Border) }
    }

    /// Bounds of the cells of a brick and of one more on each side.
    fn around(&self, brick: [u32; 3]) -> MinMax {
        let mut bounds = MinMax::NONE;
        for neighbour in positions([3; 3]) {
            let place = [0, 1, 2].map(|axis| (brick[axis] + neighbour[axis]).wrapping_sub(1));
            let Some(cells) = self.brick(place) else {
                bounds = bounds.union(&MinMax::default());
                continue;
            };
            // Of the one before, the last layer; of the one behind, the first.
            let range = |axis: usize| match neighbour[axis] {
                0 => BRICK - 1..BRICK,
                1 => 0..BRICK,
                _ => 0..1,
            };
            for z in range(2) {
                for y in range(1) {
                    for x in range(0) {
                        let value = cells[within([x, y, z])];
                        bounds = bounds.union(&MinMax { min: value, max: value });
                    }
                }
            }
        }
        bounds
    }
}

/// Nodes along each axis.
fn nodes_along(size: [u32; 3]) -> [u32; 3] {
    size.map(|n| n.div_ceil(NODE_CELLS))
}

/// Place of a cell in its brick.
#[inline]
fn within([x, y, z]: [u32; 3]) -> usize {
    (((z % BRICK) * BRICK + y % BRICK) * BRICK + x % BRICK) as usize
}

/// All places of a box, x fastest.
fn positions(size: [u32; 3]) -> impl Iterator<Item = [u32; 3]> {
    let [nx, ny, nz] = size;
    (0..nz).flat_map(move |z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])))
}

impl Bricks<'_> {
    /// The densities around a point, from `p·n + 1/2`.
    #[inline]
    pub(super) fn corners(&self, bounds: &[NodeBounds], shifted: Vec3) -> Corners {
        // Shifted by one, a truncation is the floor; the cell below is one less.
        let upper = shifted.to_array().map(|s| s as i32);
        let fraction =
            (shifted - Vec3::new(upper[0] as f32, upper[1] as f32, upper[2] as f32)).clamp(Vec3::ZERO, Vec3::ONE);
        let high = upper.map(|c| c as u32);
        let low = high.map(|c| c.wrapping_sub(1));
        // What is below zero wraps, and lies in no node with its neighbour.
        let is_one_node =
            (0..3).all(|axis| low[axis] / NODE_CELLS == high[axis] / NODE_CELLS && high[axis] < self.size[axis]);
        let values = if is_one_node { self.in_node(bounds, low, high) } else { self.apart(low, high) };
        Corners { values, fraction }
    }

    /// The values of cells of one node, as nearly all are.
    #[inline]
    fn in_node(&self, bounds: &[NodeBounds], low: [u32; 3], high: [u32; 3]) -> [f32; 8] {
        const ROW: usize = BRICK as usize;
        const LAYER: usize = ROW * ROW;
        let node = self.node(low.map(|c| c / NODE_CELLS)).and_then(|node| bounds.get(node));
        let Some(node) = node else { return [0.0; 8] };
        let first = place(low.map(|c| c / BRICK), 0);
        let start = |slot: usize| {
            let brick = node.slots.get(slot)?.brick;
            (brick != Bricks::NOTHING).then_some(brick as usize * CELLS)
        };
        let at = |brick: Option<usize>, place: usize| {
            brick.and_then(|start| self.cells.get(start + place)).copied().unwrap_or(0.0)
        };
        let is_split = |axis: usize| high[axis].is_multiple_of(BRICK);
        let (x, y, z) = (is_split(0), is_split(1), is_split(2));
        if !(x || y || z) {
            // All in one brick, as two thirds of all points are.
            let Some(cells) = start(first).and_then(|start| self.cells.get(start..)?.first_chunk::<CELLS>()) else {
                return [0.0; 8];
            };
            let corner = within(low);
            let row = |from: usize| {
                cells.get(corner + from..).and_then(|row| row.first_chunk::<2>()).copied().unwrap_or_default()
            };
            let ([a, b], [c, d], [e, f], [g, h]) = (row(0), row(ROW), row(LAYER), row(LAYER + ROW));
            return [a, b, c, d, e, f, g, h];
        }
        let mut values = [0.0; 8];
        const SLOT: [usize; 3] = [1, NODE as usize, (NODE * NODE) as usize];
        const CELL: [usize; 3] = [1, ROW, LAYER];
        let beyond = [x, y, z];
        let slot = |axis: usize, is_upper: bool| if is_upper && beyond[axis] { SLOT[axis] } else { 0 };
        let cell =
            |axis: usize, is_upper: bool| (if is_upper { high[axis] } else { low[axis] } % BRICK) as usize * CELL[axis];
        for (pair, values) in values.as_chunks_mut::<2>().0.iter_mut().enumerate() {
            let (upper_y, upper_z) = (pair & 1 == 1, pair > 1);
            let from = first + slot(1, upper_y) + slot(2, upper_z);
            let place = cell(1, upper_y) + cell(2, upper_z);
            let brick = start(from);
            let next = if x { start(from + 1) } else { brick };
            *values = [at(brick, place + cell(0, false)), at(next, place + cell(0, true))];
        }
        values
    }

    /// The values of cells of several nodes, or outside: each brick is looked up once.
    #[cold]
    fn apart(&self, low: [u32; 3], high: [u32; 3]) -> [f32; 8] {
        let mut values = [0.0; 8];
        // Of each axis, the upper cell may be the first of the next brick; what wraps lies outside.
        let cells = [0, 1, 2].map(|axis| [low[axis], high[axis]]);
        let is_split = cells.map(|[low, high]| high % BRICK == 0 || low >= high);
        for parts in 0..8_usize {
            let part = [parts & 1, parts >> 1 & 1, parts >> 2];
            if (0..3).any(|axis| part[axis] == 1 && !is_split[axis]) {
                continue;
            }
            let place = core::array::from_fn(|axis| cells[axis][part[axis]] / BRICK);
            let Some(brick) = self.brick(place) else { continue };
            for (corner, value) in values.iter_mut().enumerate() {
                let upper = [corner & 1, corner >> 1 & 1, corner >> 2];
                let cell: [u32; 3] = core::array::from_fn(|axis| cells[axis][upper[axis]]);
                let is_here =
                    (0..3).all(|axis| (!is_split[axis] || upper[axis] == part[axis]) && cell[axis] < self.size[axis]);
                if is_here {
                    *value = brick[within(cell)];
                }
            }
        }
        values
    }
}
