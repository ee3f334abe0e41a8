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

/// Slots of a node.
const SLOTS: usize = (NODE * NODE * NODE) as usize;

/// Densities of a sparse grid: of the cells of a box, most of them zero.
///
/// The box is cut into nodes of 128³ cells, and these into 16³ slots for bricks of 8³. `nodes` has an entry for each node of the box,
/// x fastest; `slots` 16³ for each node that is there, and `cells` 8³ for each brick, x fastest in both. An entry is the place of what
/// it means in the next list, or [`Bricks::NOTHING`]: everything below it is zero. Several slots may share a brick.
///
/// Memory and time go with what is filled. A brick takes 2 KiB, a node 16 KiB, and 32 KiB more for bounds that
/// [`SparseGrid`](super::SparseGrid) has filled in.
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
        let node = self.node(brick.map(|c| c / NODE))?;
        let [x, y, z] = brick.map(|c| (c % NODE) as usize);
        Some(node * SLOTS + (z * NODE as usize + y) * NODE as usize + x)
    }

    /// The cells of a brick, in bricks from the corner; `None` where there is nothing.
    #[inline]
    pub(super) fn brick(&self, brick: [u32; 3]) -> Option<&[f32; CELLS]> {
        let entry = *self.slots.get(self.slot(brick)?)? as usize;
        self.cells.get(entry * CELLS..)?.first_chunk()
    }

    /// Bounds of every slot, over the cells that interpolation inside it touches, one more on each side; and those of all. Where there is
    /// nothing, the lower bound is no bound, but tells how far nothing reaches: see [`gap`].
    ///
    /// # Errors
    /// Where a slot that is not there would have some: in a node that is missing beside a cell that is not empty. Outermost cells
    /// that are not empty.
    pub(super) fn fill(&self, bounds: &mut [MinMax]) -> Result<MinMax, MediumError> {
        if bounds.len() != self.slots.len() {
            return Err(MediumError::Blocks);
        }
        bounds.fill(MinMax::default());
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
                match self.slot(brick) {
                    Some(place) => {
                        self.check_border(brick)?;
                        let found = self.around(brick).padded();
                        whole = whole.union(&found);
                        if let Some(bound) = bounds.get_mut(place) {
                            *bound = found;
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
        bounds.as_chunks_mut::<SLOTS>().0.iter_mut().for_each(mark_gaps);
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

/// Tells slots that belong to larger gaps so: aligned cubes of 2, 4 or 8 slots along each edge, or all of the node.
fn mark_gaps(bounds: &mut [MinMax; SLOTS]) {
    for edge in [2, 4, 8, NODE] {
        for corner in positions([NODE / edge; 3]) {
            let place = |offset: [u32; 3]| {
                let [x, y, z] = [0, 1, 2].map(|axis| (corner[axis] * edge + offset[axis]) as usize);
                (z * NODE as usize + y) * NODE as usize + x
            };
            // A gap is made of eight gaps of half its edge, or of slots.
            let parts = positions([2; 3]).map(|part| part.map(|c| c * edge / 2));
            let is_half =
                |part: [u32; 3]| bounds.get(place(part)).is_some_and(|b| b.max == 0.0 && gap(b) >= (edge / 2) as i32);
            if parts.into_iter().all(is_half) {
                for offset in positions([edge; 3]) {
                    bounds[place(offset)] = MinMax { min: -(edge as f32), max: 0.0 };
                }
            }
        }
    }
}

/// Slots along the edge of the aligned cube around an empty slot in which nothing is.
#[inline]
pub(super) fn gap(bounds: &MinMax) -> i32 {
    (-bounds.min as i32).max(1)
}

/// Nodes along each axis.
fn nodes_along(size: [u32; 3]) -> [u32; 3] {
    size.map(|n| n.div_ceil(NODE * BRICK))
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
    pub(super) fn corners(&self, shifted: Vec3) -> Corners {
        // Shifted by one, a truncation is the floor; the cell below is one less.
        let upper = shifted.to_array().map(|s| s as i32);
        let fraction =
            (shifted - Vec3::new(upper[0] as f32, upper[1] as f32, upper[2] as f32)).clamp(Vec3::ZERO, Vec3::ONE);
        let high = upper.map(|c| c as u32);
        let low = high.map(|c| c.wrapping_sub(1));
        const NODE_CELLS: u32 = NODE * BRICK;
        // What is below zero wraps, and lies in no node with its neighbour.
        let is_one_node =
            (0..3).all(|axis| low[axis] / NODE_CELLS == high[axis] / NODE_CELLS && high[axis] < self.size[axis]);
        let values = if is_one_node { self.in_node(low, high) } else { self.apart(low, high) };
        Corners { values, fraction }
    }

    /// The values of cells of one node, as nearly all are.
    #[inline]
    fn in_node(&self, low: [u32; 3], high: [u32; 3]) -> [f32; 8] {
        const ROW: usize = BRICK as usize;
        const LAYER: usize = ROW * ROW;
        let Some(first) = self.slot([low[0] / BRICK, low[1] / BRICK, low[2] / BRICK]) else { return [0.0; 8] };
        let start = |slot: usize| {
            self.slots.get(slot).filter(|entry| **entry != Bricks::NOTHING).map(|entry| *entry as usize * CELLS)
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
            let place = within(low);
            let row = |from: usize| {
                cells.get(place + from..).and_then(|row| row.first_chunk::<2>()).copied().unwrap_or_default()
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
