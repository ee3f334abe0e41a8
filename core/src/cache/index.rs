//! Which spheres contain this point? An octree whose leaves hold whole spheres.
//!
//! The cache of Jarosz et al. 2008 asks this at every step of every eye ray, for its records are
//! valid within a radius. Their octree keeps a record in all cells that its sphere overlaps, so that
//! a query descends to one leaf; so does this one. It departs from theirs in three ways:
//!
//! - A leaf holds the spheres themselves, not references to them, in [`Block`]s of four whose
//!   distances are computed together. A query reads one run of memory and nothing else, and large
//!   leaves are cheap: the 40 spheres that miss cost as much as the 10 that are hit.
//! - How often a sphere may be repeated is bounded by a share that is passed down the tree
//!   (`REPEATS`), so memory is linear in the number of spheres whatever their radii.
//! - It is built as a whole, which takes well under a microsecond a sphere, and not by insertion.
//!
//! A leaf keeps the spheres in the order of their numbers.

use core::ops::Range;

use bytemuck::{Pod, Zeroable};
use glam::Vec4;

use crate::math::{Vec3, float};
use crate::storage::{Chunk, Full, List, carve, chunks_for};

/// Halvings of the root cell, at most.
///
/// Fewer would leave crowds unresolved (2⁻¹⁶ of the scene is half a millimetre in 30 m); with more,
/// cells would come near the rounding of positions, which is 2⁻²⁴ of the root.
const DEPTH: u32 = 16;

/// Spheres of a [`Block`].
const LANES: usize = 4;

/// Blocks whose hits fit one word.
const RUN: usize = 64 / LANES;

/// Cells of so many spheres are never divided: descending costs more than reading them.
const FEW: usize = 8;

/// How many times as many blocks as the spheres would fill without repetition may be written.
///
/// Measured at ten spheres around a point: 8 halves memory and the time to build and makes queries
/// near the one before cost 1.7 times as much; 24 gains 5 %.
const REPEATS: f32 = 16.0;

/// A cell is divided if at least this many of its spheres do not contain all of it.
const PARTIAL: usize = 8;

/// By how much spheres are enlarged before they are sorted into cells, in edges of the root.
///
/// Above the rounding of positions relative to the root (a few 2⁻²⁴), so that a sphere is never
/// missed on the border of a cell, and far below the smallest cell (2⁻¹⁶).
const ROOM: f32 = 1.0 / (1 << 20) as f32;

/// Smallest radius that counts as positive: its reciprocal is finite.
const SMALLEST: f32 = f32::MIN_POSITIVE;

/// Spheres that reach farther from the origin are left out: sums and differences stay finite.
const FARTHEST: f32 = 1e38;

/// Coordinates of points that cells are told apart by, in edges of the root: their squares are numbers.
const SQUARES: f32 = 1e18;

/// By how much more than asked for cells are looked at, relative: above the rounding of distances.
const NEARLY: f32 = 1e-5;

/// An inner node of the octree: what lies in its eight octants, x fastest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
#[repr(C, align(64))]
pub struct IndexNode {
    octants: [Octant; 8],
}

/// Another node, or a run of blocks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
#[repr(C)]
struct Octant {
    /// Index of the node or of the first block.
    first: u32,
    /// Number of blocks, or [`INNER`].
    blocks: u32,
}

/// In place of a number of blocks: a node.
const INNER: u32 = u32::MAX;

impl Octant {
    /// The blocks of a leaf.
    #[inline]
    fn run(self) -> Range<usize> {
        let first = self.first as usize;
        first..first + self.blocks as usize
    }
}

/// Four spheres of a leaf, side by side.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Block {
    /// Centres (m); infinite in empty lanes.
    x: Vec4,
    y: Vec4,
    z: Vec4,
    /// Reciprocal radii (m⁻¹).
    inverse: Vec4,
    index: [u32; LANES],
}

impl Block {
    const EMPTY: Self = Self { x: Vec4::INFINITY, y: Vec4::ZERO, z: Vec4::ZERO, inverse: Vec4::ONE, index: [0; LANES] };

    /// Squared distances from the centres in units of the radii; infinite in empty lanes.
    ///
    /// Scaled before squaring, so that neither huge nor tiny spheres leave the range of `f32`. Written
    /// with four-vectors because a loop over lanes would be vectorised across blocks, at three times the
    /// cost; lane by lane they are the same sums.
    #[inline(always)]
    fn squared(&self, point: Vec3) -> Vec4 {
        let x = (Vec4::splat(point.x) - self.x) * self.inverse;
        let y = (Vec4::splat(point.y) - self.y) * self.inverse;
        let z = (Vec4::splat(point.z) - self.z) * self.inverse;
        x * x + y * y + z * z
    }

    /// Squared distances from the centres (m²); infinite in empty lanes, and where that is what they are in `f32`.
    #[inline]
    fn distances_squared(&self, point: Vec3) -> Vec4 {
        let (x, y, z) = (Vec4::splat(point.x) - self.x, Vec4::splat(point.y) - self.y, Vec4::splat(point.z) - self.z);
        x * x + y * y + z * z
    }
}

/// Octree over spheres for point queries.
///
/// ```
/// # use fogbow::cache::Index;
/// # use fogbow::math::Vec3;
/// # #[cfg(feature = "alloc")] {
/// let spheres = [(Vec3::ZERO, 1.0), (Vec3::X, 2.0), (Vec3::Y, 0.5)];
/// let mut index = Index::new(Vec::new(), Vec::new(), Vec::new(), Vec::new());
/// index.rebuild(3, |i| spheres[i as usize])?;
///
/// let mut found = Vec::new();
/// index.visit(Vec3::new(-0.5, 0.0, 0.0), |i, share| found.push((i, share)));
/// assert_eq!(found, [(0, 0.5), (1, 0.75)]);
/// # }
/// # Ok::<(), fogbow::storage::Full>(())
/// ```
#[derive(Debug)]
pub struct Index<'s> {
    nodes: List<'s, IndexNode>,
    /// A stack of numbers of spheres, with the masks of octants they overlap.
    entries: List<'s, u32>,
    /// Centre and radius (m).
    spheres: List<'s, [f32; 4]>,
    blocks: List<'s, Block>,
    root: Octant,
    /// Lowest corner (m) and reciprocal edge (m⁻¹) of the root cell.
    low: Vec3,
    scale: f32,
    len: u32,
}

/// A cell of the octree, in edges of the root.
#[derive(Debug, Clone, Copy)]
struct Cell {
    middle: Vec3,
    half: f32,
    depth: u32,
}

impl Cell {
    const ROOT: Self = Self { middle: Vec3::splat(0.5), half: 0.5, depth: 0 };

    fn octant(self, octant: usize) -> Self {
        let half = 0.5 * self.half;
        let side = |axis: usize| if octant >> axis & 1 == 1 { half } else { -half };
        Self { middle: self.middle + Vec3::new(side(0), side(1), side(2)), half, depth: self.depth + 1 }
    }

    /// Octants that a sphere overlaps, a bit each, and whether it contains the whole cell.
    #[inline(always)]
    fn overlap(&self, centre: Vec3, radius: f32) -> (u8, bool) {
        let offset = centre - self.middle;
        // Squared distance along each axis from the lower and from the upper half.
        let axis = |t: f32| {
            let low = float::max(t, -self.half - t);
            let high = float::max(-t, t - self.half);
            let (low, high) = (float::max(low, 0.0), float::max(high, 0.0));
            [low * low, high * high]
        };
        let (x, y, z) = (axis(offset.x), axis(offset.y), axis(offset.z));
        let reach = (radius + ROOM) * (radius + ROOM);
        let mut mask = 0;
        for octant in 0..8 {
            let square = x[octant & 1] + y[octant >> 1 & 1] + z[octant >> 2];
            mask |= u8::from(square < reach) << octant;
        }
        let farthest = offset.abs() + Vec3::splat(self.half);
        (mask, farthest.length_squared() < radius * radius)
    }
}

/// Calls `visit(blocks, reach)` for the leaves that come within `reach` (m) of a point, near ones first; `visit` may
/// lower the reach. The point is given in edges of the root, with the reciprocal of these (m⁻¹).
fn walk(
    nodes: &[IndexNode],
    octant: Octant,
    cell: Cell,
    (at, scale): (Vec3, f32),
    reach: &mut f32,
    visit: &mut impl FnMut(Range<usize>, &mut f32),
) {
    let outside = ((at - cell.middle).abs() - cell.half).max(Vec3::ZERO);
    let scaled = *reach * scale * (1.0 + NEARLY) + 2.0 * ROOM;
    if outside.length_squared() > scaled * scaled {
        return;
    }
    if octant.blocks != INNER {
        return visit(octant.run(), reach);
    }
    let sides = at.cmpgt(cell.middle).bitmask() as usize;
    // Neighbours across one face first, then across an edge, then across the corner.
    for turn in [0, 1, 2, 4, 3, 5, 6, 7] {
        let side = sides ^ turn;
        let next = nodes[octant.first as usize].octants[side];
        walk(nodes, next, cell.octant(side), (at, scale), reach, visit);
    }
}

/// Squared distance of a point from a centre in units of the radius, as a [`Block`] has it: to the last bit, so that
/// no answer depends on whether a sphere is in an index already.
#[inline]
pub(super) fn squared_share(centre: Vec3, radius: f32, point: Vec3) -> f32 {
    let offset = (point - centre) * (1.0 / radius);
    offset.x * offset.x + offset.y * offset.y + offset.z * offset.z
}

/// Whether an index holds such a sphere: it reaches no farther than 10³⁸ m from the origin, and its reciprocal radius is
/// finite.
#[inline]
pub(super) fn holds(centre: Vec3, radius: f32) -> bool {
    // Also false for NaN.
    radius >= SMALLEST && centre.abs().cmple(Vec3::splat(FARTHEST - radius)).all()
}

/// Nodes, entries and blocks for so many spheres. Blocks have a bound that does not depend on how wide spheres are.
const fn lengths(spheres: usize, wider: usize) -> [usize; 3] {
    let few = if spheres == 0 { 0 } else { 16 };
    [wider * spheres + few, 6 * wider * spheres + few, 4 * spheres + few]
}

impl<'s> Index<'s> {
    /// An empty index in storage lent or growing.
    ///
    /// For `n` spheres lend `n` of `spheres`, `4 n + 16` of `blocks` (which always suffices), and about
    /// `6 n` of `entries` and `n` of `nodes` (crowds within crowds may want more). That is room for
    /// the worst: typically some 3 blocks a sphere and few nodes are used, and
    /// [`bytes`](Self::bytes) tells. `entries` and `spheres` serve [`rebuild`](Self::rebuild) alone.
    ///
    /// ```
    /// # use fogbow::cache::{Block, Index, IndexNode};
    /// # use fogbow::math::Vec3;
    /// let (mut nodes, mut entries) = ([IndexNode::default(); 8], [0; 48]);
    /// let (mut spheres, mut blocks) = ([[0.0; 4]; 8], [Block::default(); 48]);
    /// let mut index = Index::new(&mut nodes[..], &mut entries[..], &mut spheres[..], &mut blocks[..]);
    /// assert!(index.rebuild(8, |i| (Vec3::X * i as f32, 1.0)).is_ok());
    /// assert!(index.rebuild(9, |i| (Vec3::X * i as f32, 1.0)).is_err());
    /// assert!(index.is_empty());
    /// ```
    pub fn new(
        nodes: impl Into<List<'s, IndexNode>>,
        entries: impl Into<List<'s, u32>>,
        spheres: impl Into<List<'s, [f32; 4]>>,
        blocks: impl Into<List<'s, Block>>,
    ) -> Self {
        let mut index = Self {
            nodes: nodes.into(),
            entries: entries.into(),
            spheres: spheres.into(),
            blocks: blocks.into(),
            root: Octant::default(),
            low: Vec3::ZERO,
            scale: 0.0,
            len: 0,
        };
        index.clear();
        index
    }

    /// Chunks of memory with room for so many spheres, some `wider` times as large as those of records mostly are.
    pub(super) const fn chunks(spheres: usize, wider: usize) -> usize {
        let [nodes, entries, blocks] = lengths(spheres, wider);
        chunks_for::<IndexNode>(nodes)
            + chunks_for::<u32>(entries)
            + chunks_for::<[f32; 4]>(spheres)
            + chunks_for::<Block>(blocks)
    }

    /// An empty index in the first [`Index::chunks`] of `memory`.
    pub(super) fn lent(memory: &mut &'s mut [Chunk], spheres: usize, wider: usize) -> Self {
        let [nodes, entries, blocks] = lengths(spheres, wider);
        Self::new(
            carve::<IndexNode>(memory, nodes),
            carve::<u32>(memory, entries),
            carve::<[f32; 4]>(memory, spheres),
            carve::<Block>(memory, blocks),
        )
    }

    /// Number of spheres it was built over, those left out included.
    ///
    /// ```
    /// # use fogbow::{cache::{Block, Index, IndexNode}, math::Vec3};
    /// let (mut nodes, mut entries) = ([IndexNode::default(); 2], [0; 12]);
    /// let (mut spheres, mut blocks) = ([[0.0; 4]; 2], [Block::default(); 24]);
    /// let mut index = Index::new(&mut nodes[..], &mut entries[..], &mut spheres[..], &mut blocks[..]);
    /// index.rebuild(2, |i| (Vec3::ZERO, i as f32))?;   // the first has no radius: no point lies in it
    /// assert_eq!(index.len(), 2);
    /// # Ok::<(), fogbow::storage::Full>(())
    /// ```
    #[must_use]
    pub fn len(&self) -> u32 {
        self.len
    }

    /// Whether it was built over no spheres.
    ///
    /// ```
    /// # use fogbow::{cache::{Block, Index, IndexNode}, math::Vec3};
    /// let (mut nodes, mut entries) = ([IndexNode::default(); 2], [0; 12]);
    /// let (mut spheres, mut blocks) = ([[0.0; 4]; 2], [Block::default(); 24]);
    /// let mut index = Index::new(&mut nodes[..], &mut entries[..], &mut spheres[..], &mut blocks[..]);
    /// assert!(index.is_empty());
    /// index.rebuild(1, |_| (Vec3::ZERO, 1.0))?;
    /// assert!(!index.is_empty());
    /// # Ok::<(), fogbow::storage::Full>(())
    /// ```
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Memory in use (bytes), without what a `Vec` or a lent slice holds in reserve.
    ///
    /// ```
    /// # use fogbow::{cache::{Block, Index, IndexNode}, math::Vec3};
    /// let (mut nodes, mut entries) = ([IndexNode::default(); 2], [0; 12]);
    /// let (mut spheres, mut blocks) = ([[0.0; 4]; 2], [Block::default(); 24]);
    /// let mut index = Index::new(&mut nodes[..], &mut entries[..], &mut spheres[..], &mut blocks[..]);
    /// assert_eq!(index.bytes(), 0);   // lent, but not used
    /// index.rebuild(1, |_| (Vec3::ZERO, 1.0))?;
    /// assert!(index.bytes() >= size_of::<Block>());
    /// # Ok::<(), fogbow::storage::Full>(())
    /// ```
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice())
            + size_of_val(self.entries.as_slice())
            + size_of_val(self.spheres.as_slice())
            + size_of_val(self.blocks.as_slice())
    }

    /// Forgets all spheres and keeps the memory.
    fn clear(&mut self) {
        self.nodes.clear();
        self.entries.clear();
        self.spheres.clear();
        self.blocks.clear();
        self.root = Octant::default();
        self.len = 0;
    }

    /// Calls `visit(index, distance / radius)` for every sphere that contains `point` (m).
    ///
    /// Spheres come in ascending order of their numbers, however the tree was divided. The share lies
    /// in [0, 1); on the very surface its rounding decides. A point that is not finite lies in no sphere.
    ///
    /// Descends to one leaf, whose spheres are then compared with the point one after the other: some
    /// 60 ns where ten spheres contain the point and the caches of the CPU are warm, several times
    /// that for points far from the one before.
    #[inline]
    pub fn visit(&self, point: Vec3, mut visit: impl FnMut(u32, f32)) {
        for run in self.blocks.as_slice()[self.leaf(point)].chunks(RUN) {
            // All distances before the first decision: the loads of a run then wait for memory together
            // and not each for the branch before it.
            let mut squared = [[0.0; LANES]; RUN];
            let mut hits = 0_u64;
            for (i, (block, shares)) in run.iter().zip(&mut squared).enumerate() {
                let square = block.squared(point);
                hits |= u64::from(square.cmplt(Vec4::ONE).bitmask()) << (i * LANES);
                *shares = square.to_array();
            }
            while hits != 0 {
                let hit = hits.trailing_zeros() as usize;
                hits &= hits - 1;
                let (block, lane) = (hit / LANES % RUN, hit % LANES);
                visit(run[block].index[lane], float::sqrt(squared[block][lane]));
            }
        }
    }

    /// The blocks of the leaf around `point`: all spheres that contain it are in there, and others.
    pub(super) fn leaf(&self, point: Vec3) -> Range<usize> {
        const CELLS: f32 = (1 << DEPTH) as f32;
        let position = (point - self.low) * self.scale * CELLS;
        // Also false for NaN.
        let inside = position.min_element() >= 0.0 && position.max_element() < CELLS;
        if !inside || point.is_nan() {
            return 0..0;
        }
        let [x, y, z] = position.to_array().map(|p| p as u32);
        let nodes = self.nodes.as_slice();
        let mut octant = self.root;
        let mut shift = DEPTH;
        while octant.blocks == INNER {
            shift -= 1;
            let side = (x >> shift & 1) | (y >> shift & 1) << 1 | (z >> shift & 1) << 2;
            octant = nodes[octant.first as usize].octants[side as usize];
        }
        octant.run()
    }

    /// Numbers of the spheres of a block of [`Index::leaf`]; 0 in empty lanes.
    #[inline]
    pub(super) fn numbers(&self, block: usize) -> [u32; LANES] {
        self.blocks.as_slice()[block].index
    }

    /// Calls `visit(number, reach)` for all spheres whose centres are within `reach` (m) of `point`, and for some more;
    /// for some more than once. Near ones come early, and `visit` may lower the reach.
    pub(super) fn visit_centres(&self, point: Vec3, reach: &mut f32, mut visit: impl FnMut(u32, &mut f32)) {
        if self.len == 0 {
            return;
        }
        let at = (point - self.low) * self.scale;
        // Also true for NaN.
        if !(at.abs().max_element() < SQUARES) {
            (0..self.len).for_each(|number| visit(number, reach));
            return;
        }
        let blocks = self.blocks.as_slice();
        walk(self.nodes.as_slice(), self.root, Cell::ROOT, (at, self.scale), reach, &mut |run, reach| {
            for block in &blocks[run] {
                let most = *reach * (1.0 + NEARLY);
                let mut near = !block.distances_squared(point).cmpgt(Vec4::splat(most * most)).bitmask() & 0xf;
                while near != 0 {
                    visit(block.index[near.trailing_zeros() as usize], reach);
                    near &= near - 1;
                }
            }
        });
    }

    /// Makes a sphere smaller, whose centre and radius (m) were `(centre, before)`.
    pub(super) fn shrink(&mut self, number: u32, (centre, before): (Vec3, f32), radius: f32) {
        if number >= self.len {
            return;
        }
        let Self { nodes, blocks, root, low, scale, .. } = self;
        let (at, blocks) = ((centre - *low) * *scale, blocks.as_mut_slice());
        // Cells farther away may hold it, too, with a radius it once had: none of their points lies in it either way.
        walk(nodes.as_slice(), *root, Cell::ROOT, (at, *scale), &mut { before }, &mut |run, _| {
            for block in &mut blocks[run] {
                for (lane, inverse) in block.index.iter().zip(block.inverse.as_mut()) {
                    if *lane == number {
                        *inverse = 1.0 / radius;
                    }
                }
            }
        });
    }

    /// Builds it anew over `count` spheres: `sphere(i)` is centre and radius (m) of number `i`, and is
    /// asked once.
    ///
    /// Left out are spheres that are not finite, whose radius is not positive (or below 10⁻³⁸ m), or
    /// that reach farther than 10³⁸ m from the origin. Takes `O(n log n)` time,
    /// some 0.4 µs a sphere, and at most some 500 bytes a sphere, typically 280.
    ///
    /// # Errors
    /// [`Full`] when lent storage has no room left; the index is empty then, and may be built again.
    pub fn rebuild(&mut self, count: u32, sphere: impl Fn(u32) -> (Vec3, f32)) -> Result<(), Full> {
        self.clear();
        let built = self.build(count, sphere);
        if built.is_err() {
            self.clear();
        }
        built
    }

    fn build(&mut self, count: u32, sphere: impl Fn(u32) -> (Vec3, f32)) -> Result<(), Full> {
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let mut largest = 0.0_f32;
        for i in 0..count {
            let (centre, radius) = sphere(i);
            self.spheres.push([centre.x, centre.y, centre.z, radius])?;
            if holds(centre, radius) {
                self.entries.push(i)?;
                low = low.min(centre - radius);
                high = high.max(centre + radius);
                largest = largest.max(radius);
            }
        }
        self.len = count;
        let kept = self.entries.as_slice().len();
        if kept == 0 {
            return Ok(());
        }
        // Some room on all sides; more on one, lest what is built around the origin of a scene, such
        // as a crowd around its lamp, meet all eight octants.
        let edge = (high - low).max_element().max(1e-30);
        self.low = low - Vec3::new(0.023, 0.031, 0.017) * edge;
        self.scale = 1.0 / (1.07 * edge);
        self.root = self.divide(Cell::ROOT, 0, kept, REPEATS)?;
        Ok(())
    }

    /// Builds the cell whose candidates are `entries[start..end]`; the stack is free from `end` on.
    fn divide(&mut self, cell: Cell, start: usize, end: usize, repeats: f32) -> Result<Octant, Full> {
        let count = end - start;
        if count <= FEW || cell.depth == DEPTH {
            return self.leaf_of(start, end);
        }
        let top = end + count.div_ceil(4);
        self.reserve(top)?;
        let (candidates, masks) = self.entries.as_mut_slice()[start..top].split_at_mut(count);
        let masks: &mut [u8] = bytemuck::cast_slice_mut(masks);
        let spheres = self.spheres.as_slice();
        let mut counts = [0_usize; 8];
        let mut whole = 0;
        for (&candidate, mask) in candidates.iter().zip(masks) {
            let [x, y, z, radius] = spheres[candidate as usize];
            let (overlap, contains) = cell.overlap((Vec3::new(x, y, z) - self.low) * self.scale, radius * self.scale);
            *mask = overlap;
            for (octant, count) in counts.iter_mut().enumerate() {
                *count += usize::from(overlap >> octant & 1);
            }
            whole += usize::from(contains);
        }
        let blocks: usize = counts.iter().map(|c| c.div_ceil(LANES)).sum();
        let repeats = repeats * count.div_ceil(LANES) as f32 / blocks as f32;
        if count - whole < PARTIAL || repeats < 1.0 {
            return self.leaf_of(start, end);
        }
        let node = self.nodes.as_slice().len();
        let first = u32::try_from(node).map_err(|_| Full)?;
        self.nodes.push(IndexNode::default())?;
        for (octant, &inside) in counts.iter().enumerate() {
            // One more, which is written but not kept.
            self.reserve(top + inside + 1)?;
            let (below, above) = self.entries.as_mut_slice().split_at_mut(top);
            let (candidates, masks) = below[start..].split_at(count);
            let masks: &[u8] = bytemuck::cast_slice(masks);
            let mut next = 0;
            for (&candidate, mask) in candidates.iter().zip(masks) {
                above[next] = candidate;
                next += usize::from(mask >> octant & 1);
            }
            let built = self.divide(cell.octant(octant), top, top + inside, repeats)?;
            self.nodes.as_mut_slice()[node].octants[octant] = built;
        }
        Ok(Octant { first, blocks: INNER })
    }

    /// Makes the stack at least `len` long.
    fn reserve(&mut self, len: usize) -> Result<(), Full> {
        for _ in self.entries.as_slice().len()..len {
            self.entries.push(0)?;
        }
        Ok(())
    }

    /// Writes the spheres `entries[start..end]` as a leaf.
    fn leaf_of(&mut self, start: usize, end: usize) -> Result<Octant, Full> {
        let first = u32::try_from(self.blocks.as_slice().len()).map_err(|_| Full)?;
        let spheres = self.spheres.as_slice();
        let runs = self.entries.as_slice()[start..end].chunks(LANES);
        let blocks = runs.len() as u32;
        for run in runs {
            let mut block = Block::EMPTY;
            for (lane, &index) in run.iter().enumerate() {
                let [x, y, z, radius] = spheres[index as usize];
                (block.x[lane], block.y[lane], block.z[lane]) = (x, y, z);
                block.inverse[lane] = 1.0 / radius;
                block.index[lane] = index;
            }
            self.blocks.push(block)?;
        }
        Ok(Octant { first, blocks })
    }
}
