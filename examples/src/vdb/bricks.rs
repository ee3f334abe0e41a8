//! From a grid to the bricks that media are made of.

use std::collections::HashMap;

use fogbow::medium::Bricks;
use fogbow::medium::bricks::{BRICK, NODE};

use super::bytes::Fault;
use super::{Class, Grid, LEAF};
use crate::transform::Transform;

/// Slots of a node.
const SLOTS: usize = (NODE * NODE * NODE) as usize;

/// Most nodes: with their bounds they take half a gibibyte.
const MOST_NODES: usize = 11_000;

/// Most places for nodes in the box around all voxels: 128³ voxels each.
const MOST_PLACES: usize = 1 << 21;

/// Densities of a grid, in bricks, with memory of their own. Around the box of active voxels lies at least one empty voxel on each side:
/// density is interpolated towards nothing there, as OpenVDB does.
#[derive(Debug, Clone, PartialEq)]
pub struct BrickStorage {
    size: [u32; 3],
    nodes: Vec<u32>,
    slots: Vec<u32>,
    cells: Vec<f32>,
    /// From the unit cube of the bricks' box to that of the box of active voxels.
    in_active_box: Transform,
    /// From the unit cube of the bricks' box to the world of the file.
    in_file: Transform,
}

impl BrickStorage {
    /// The densities of a grid: the values of its leaves, and of its tiles where they are active. What is negative, as filters leave it
    /// beside sharp edges, counts as nothing.
    ///
    /// # Errors
    /// A grid without active voxels, with values that are no numbers, with a background that is not 0, or of distances (a level set); a
    /// transform that is not invertible; voxels too far apart.
    pub(super) fn new(mut grid: Grid) -> Result<Self, Fault> {
        let place = format!("grid \"{}\"", grid.name);
        let fail = |reason: String| Fault::new(&*place, reason);
        if grid.class == Class::LevelSet {
            return Err(fail("it is a level set: distances from a surface, no densities".to_owned()));
        }
        if grid.background != 0.0 {
            return Err(fail(format!(
                "its background is {}: densities must be 0 where there is nothing",
                grid.background
            )));
        }
        let Some([low, high]) = grid.active_box() else { return Err(fail("none of its voxels is active".to_owned())) };
        let origin = low.map(|c| (c - 1) & !7);
        let size: [u32; 3] = core::array::from_fn(|axis| (high[axis] + 2).abs_diff(origin[axis]));
        let places = Bricks::node_count(size);
        if places == 0 || places > MOST_PLACES {
            return Err(fail(format!("its voxels lie too far apart: from {low:?} to {high:?}")));
        }
        let unit = |size: [f64; 3], offset: [f64; 3]| Transform::scaling(size).then(&Transform::translation(offset));
        let in_voxels = unit(size.map(f64::from), origin.map(|c| f64::from(c) - 0.5));
        let active: [f64; 3] = core::array::from_fn(|axis| f64::from(high[axis]) - f64::from(low[axis]) + 1.0);
        let to_active = unit(active, low.map(|c| f64::from(c) - 0.5)).inverse();
        let in_active_box = in_voxels.then(&to_active.unwrap_or(Transform::IDENTITY));
        if !grid.to_world.is_regular() {
            return Err(fail("its transform cannot be inverted".to_owned()));
        }
        let in_file = in_voxels.then(&grid.to_world);
        let mut storage = Self {
            size,
            nodes: vec![Bricks::NOTHING; places],
            slots: Vec::new(),
            cells: Vec::new(),
            in_active_box,
            in_file,
        };
        let leaves = core::mem::take(&mut grid.leaves);
        let mut cells = core::mem::take(&mut grid.values);
        let mut kept = 0;
        for (index, leaf) in leaves.iter().enumerate() {
            let Some(values) = cells.get_mut(index * LEAF..).and_then(|rest| rest.first_chunk_mut::<LEAF>()) else {
                break;
            };
            let mut sorted = [0.0; LEAF];
            for (at, value) in values.iter().enumerate() {
                let voxel = [at / 64, at / 8 % 8, at % 8];
                let here: [i32; 3] = core::array::from_fn(|axis| leaf.origin[axis] + voxel[axis] as i32);
                if !value.is_finite() {
                    return Err(Fault::new(
                        format!("{place}, voxel {here:?}"),
                        format!("density {value} is not finite"),
                    ));
                }
                if (0..3).all(|axis| here[axis] >= low[axis] && here[axis] <= high[axis]) && *value > 0.0 {
                    sorted[(voxel[2] * 8 + voxel[1]) * 8 + voxel[0]] = *value;
                }
            }
            if sorted.iter().all(|value| *value == 0.0) {
                continue;
            }
            if let Some(target) = cells.get_mut(kept * LEAF..).and_then(|rest| rest.first_chunk_mut::<LEAF>()) {
                *target = sorted;
            }
            storage.put(leaf.origin, origin, kept as u32, &fail)?;
            kept += 1;
        }
        cells.truncate(kept * LEAF);
        let mut constant: HashMap<u32, u32> = HashMap::new();
        for tile in grid.tiles.iter().filter(|tile| tile.is_active && tile.value != 0.0) {
            if !tile.value.is_finite() {
                return Err(fail(format!("density {} of the tile at {:?} is not finite", tile.value, tile.origin)));
            }
            if tile.value < 0.0 {
                continue;
            }
            let brick = *constant.entry(tile.value.to_bits()).or_insert_with(|| {
                cells.extend([tile.value; LEAF]);
                (cells.len() / LEAF - 1) as u32
            });
            let along = || (0..tile.edge).step_by(8);
            for (x, y, z) in along().flat_map(|x| along().flat_map(move |y| along().map(move |z| (x, y, z)))) {
                let corner = [tile.origin[0] + x, tile.origin[1] + y, tile.origin[2] + z];
                storage.put(corner, origin, brick, &fail)?;
            }
        }
        cells.shrink_to_fit();
        storage.cells = cells;
        Ok(storage)
    }

    /// Puts a brick at a voxel, and sees to it that there are nodes for what lies beside it.
    fn put(
        &mut self,
        corner: [i32; 3],
        origin: [i32; 3],
        brick: u32,
        fail: &impl Fn(String) -> Fault,
    ) -> Result<(), Fault> {
        let at: [i32; 3] = core::array::from_fn(|axis| (corner[axis] - origin[axis]) / BRICK as i32);
        let is_edge = at.iter().any(|c| matches!(*c as u32 % NODE, 0 | 15));
        for i in if is_edge { 0..27 } else { 13..14 } {
            let beside = [at[0] + i % 3 - 1, at[1] + i / 3 % 3 - 1, at[2] + i / 9 - 1];
            let slot = self.slot(beside);
            if slot.is_none() && self.slots.len() / SLOTS > MOST_NODES {
                return Err(fail(
                    "its voxels are scattered over too many parts of space to be held in memory".to_owned(),
                ));
            }
            if let Some(slot) = slot.filter(|_| i == 13).and_then(|slot| self.slots.get_mut(slot)) {
                *slot = brick;
            }
        }
        Ok(())
    }

    /// The slot of a brick, in a node that is made where there was none; `None` outside, or where there are too many.
    fn slot(&mut self, brick: [i32; 3]) -> Option<usize> {
        let along = self.size.map(|n| n.div_ceil(BRICK * NODE) as usize);
        let [x, y, z] = brick.map(|c| usize::try_from(c).unwrap_or(usize::MAX) / NODE as usize);
        if x >= along[0] || y >= along[1] || z >= along[2] {
            return None;
        }
        let entry = self.nodes.get_mut((z * along[1] + y) * along[0] + x)?;
        if *entry == Bricks::NOTHING {
            if self.slots.len() / SLOTS > MOST_NODES {
                return None;
            }
            *entry = (self.slots.len() / SLOTS) as u32;
            self.slots.extend([Bricks::NOTHING; SLOTS]);
        }
        let [x, y, z] = brick.map(|c| c as usize % NODE as usize);
        Some(*entry as usize * SLOTS + (z * NODE as usize + y) * NODE as usize + x)
    }

    /// The bricks.
    #[must_use]
    pub fn bricks(&self) -> Bricks<'_> {
        Bricks { size: self.size, nodes: &self.nodes, slots: &self.slots, cells: &self.cells }
    }

    /// Cells along each axis of the box.
    #[must_use]
    pub fn size(&self) -> [u32; 3] {
        self.size
    }

    /// From the unit cube of the box to that around the active voxels, as Mitsuba places volumes by themselves.
    #[must_use]
    pub fn in_active_box(&self) -> &Transform {
        &self.in_active_box
    }

    /// From the unit cube of the box to the world, as the file says.
    #[must_use]
    pub fn in_file(&self) -> &Transform {
        &self.in_file
    }

    /// Bytes held.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.nodes) + size_of_val(&*self.slots) + size_of_val(&*self.cells)
    }

    /// The largest density.
    #[must_use]
    pub fn max(&self) -> f32 {
        self.cells.iter().copied().fold(0.0, f32::max)
    }
}
