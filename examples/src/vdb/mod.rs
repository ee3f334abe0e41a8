//! Sparse volumes: OpenVDB (`.vdb`) and NanoVDB (`.nvdb`) files.
//!
//! | file | holds |
//! |---|---|
//! | `mod` | [`Grid`]: what is read of a file |
//! | `openvdb`, `nodes` | `.vdb`, versions 222 and later: the file, and the tree in it |
//! | `nanovdb`, `tree` | `.nvdb`, version 32: the same |
//! | `pack` | zip and Blosc |
//! | `bytes` | numbers, and errors that say where |
//! | `bricks` | from a grid to a sparse volume |
//!
//! Of the grids of a file those are read whose values are numbers (`float`, `half` or `double`, and NanoVDB's with 4, 8, 16 or as many bits
//! as needed) in trees of the usual form (5, 4, 3). Their transforms must be linear. Formats: the sources of OpenVDB 10 (Museth 2013) and of
//! NanoVDB (Museth 2021).

mod bricks;
mod bytes;
mod nanovdb;
mod nodes;
mod openvdb;
mod pack;
mod tree;

use std::path::Path;

pub use bricks::BrickStorage;

use crate::error::{DataError, read_file};
use crate::transform::Transform;
use bytes::Fault;

/// Voxels of a leaf.
const LEAF: usize = 512;

/// Most bytes of values, unpacked, that are held in memory: 4 GiB, and for a file of a mebibyte no more than half a gibibyte.
fn budget(file_bytes: usize) -> usize {
    (1 << 29) + file_bytes.saturating_mul(64).min((1 << 32) - (1 << 29))
}

/// Whether a file's name is that of an OpenVDB or NanoVDB file.
#[must_use]
pub fn is_named(file: &Path) -> bool {
    file.extension().is_some_and(|e| e.eq_ignore_ascii_case("vdb") || e.eq_ignore_ascii_case("nvdb"))
}

/// What a file says of a grid's purpose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Class {
    /// Distances from a surface.
    LevelSet,
    /// Densities.
    FogVolume,
    /// Anything else, or nothing.
    Other,
}

/// A part of space where all voxels are the same.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tile {
    /// Its first voxel.
    pub origin: [i32; 3],
    /// Voxels along its edge: 8, 128 or 4096.
    pub edge: i32,
    /// Their value.
    pub value: f32,
    /// Whether they are active.
    pub is_active: bool,
}

/// Eight voxels cubed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Leaf {
    /// The first voxel; its coordinates are multiples of 8.
    pub origin: [i32; 3],
    /// Which voxels are active: bit `i % 64` of `i / 64`, where values have index `i`.
    pub active: [u64; 8],
}

/// A grid of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// Its name.
    pub name: String,
    /// What it is for.
    pub class: Class,
    /// From indices of voxels to the world: voxel `(i, j, k)` has its centre there.
    pub to_world: Transform,
    /// The value where there is neither leaf nor tile.
    pub background: f32,
    /// Leaves, none twice.
    pub leaves: Vec<Leaf>,
    /// For each leaf 512 values, z fastest: voxel `(x, y, z)` of a leaf has index `(8 x + y) 8 + z`.
    pub values: Vec<f32>,
    /// Tiles.
    pub tiles: Vec<Tile>,
}

impl Grid {
    /// Reads one grid of a file: the one of that name; without a name the only one, or of several the one called `density`.
    ///
    /// # Errors
    /// A file that is missing, broken or of an unknown kind; a grid that is not there, or whose values are no densities.
    pub fn read(file: &Path, name: Option<&str>) -> Result<Self, DataError> {
        Self::from_bytes(file, read_file(file)?, name)
    }

    /// Reads the bytes of a file, and lets go of them as early as possible.
    ///
    /// # Errors
    /// As [`Grid::read`].
    pub fn from_bytes(file: &Path, bytes: Vec<u8>, name: Option<&str>) -> Result<Self, DataError> {
        let read = || match bytes.get(..8) {
            Some(magic) if openvdb::is_magic(magic) => openvdb::read(bytes, name),
            Some(magic) if nanovdb::is_magic(magic) => nanovdb::read(bytes, name),
            _ => Err(Fault::new("header", "the file is neither OpenVDB nor NanoVDB")),
        };
        read().map_err(|fault| DataError::new(file, fault.place, fault.reason))
    }

    /// The densities in bricks: see [`BrickStorage`].
    ///
    /// # Errors
    /// Values that are no densities; `file` is where they came from.
    pub fn into_bricks(self, file: &Path) -> Result<BrickStorage, DataError> {
        BrickStorage::new(self).map_err(|fault| DataError::new(file, fault.place, fault.reason))
    }

    /// The value of a voxel, active or not.
    ///
    /// Goes through all leaves; for tests and single voxels.
    #[must_use]
    pub fn value(&self, voxel: [i32; 3]) -> f32 {
        let corner = voxel.map(|c| c & !7);
        if let Some(at) = self.leaves.iter().position(|leaf| leaf.origin == corner) {
            let [x, y, z] = voxel.map(|c| (c & 7) as usize);
            return self.values.get(at * LEAF + (x * 8 + y) * 8 + z).copied().unwrap_or(self.background);
        }
        let holds = |tile: &&Tile| (0..3).all(|axis| voxel[axis] & -tile.edge == tile.origin[axis]);
        self.tiles.iter().find(holds).map_or(self.background, |tile| tile.value)
    }

    /// The first and the last voxel of the smallest box around all that are active; `None` where none is.
    #[must_use]
    pub fn active_box(&self) -> Option<[[i32; 3]; 2]> {
        let tiles = self
            .tiles
            .iter()
            .filter(|t| t.is_active)
            .map(|t| [t.origin, t.origin.map(|c| c.saturating_add(t.edge - 1))]);
        let leaves = self.leaves.iter().filter_map(|leaf| {
            let [low, high] = leaf.active_box()?;
            Some([low, high].map(|corner| [0, 1, 2].map(|axis| leaf.origin[axis] + corner[axis])))
        });
        tiles.chain(leaves).reduce(|a, b| {
            [[0, 1, 2].map(|axis| a[0][axis].min(b[0][axis])), [0, 1, 2].map(|axis| a[1][axis].max(b[1][axis]))]
        })
    }
}

impl Leaf {
    /// The first and the last of the active voxels' coordinates, within the leaf.
    fn active_box(&self) -> Option<[[i32; 3]; 2]> {
        let (mut low, mut high) = ([8; 3], [-1; 3]);
        for (x, word) in (0..).zip(self.active) {
            // A word is a layer: bytes are rows along y, their bits along z.
            if word == 0 {
                continue;
            }
            let rows = word.to_le_bytes();
            let all = rows.iter().fold(0, |all, row| all | row);
            let (first, last) = (rows.iter().position(|r| *r != 0)?, rows.iter().rposition(|r| *r != 0)?);
            let layer =
                [[x, first as i32, all.trailing_zeros() as i32], [x, last as i32, 7 - all.leading_zeros() as i32]];
            for axis in 0..3 {
                low[axis] = low[axis].min(layer[0][axis]);
                high[axis] = high[axis].max(layer[1][axis]);
            }
        }
        (high[0] >= 0).then_some([low, high])
    }
}

/// The grid to read of those of a file, by name; `is_number` tells which could be read.
fn choose<'g, G>(
    grids: &'g [G],
    wanted: Option<&str>,
    name_of: impl Fn(&G) -> &str,
    is_number: impl Fn(&G) -> bool,
) -> Result<&'g G, Fault> {
    let names = || {
        let names: Vec<String> = grids.iter().map(|g| format!("\"{}\"", name_of(g))).collect();
        if names.is_empty() { "no grids".to_owned() } else { names.join(", ") }
    };
    let fail = |reason: String| Fault::new("grids", reason);
    if let Some(wanted) = wanted {
        let found = grids.iter().find(|g| name_of(g) == wanted);
        return found.ok_or_else(|| fail(format!("there is no grid \"{wanted}\"; the file holds {}", names())));
    }
    let mut usable = grids.iter().filter(|g| is_number(g));
    match (usable.next(), usable.next()) {
        (None, _) => Err(fail(format!("there is no grid of numbers; the file holds {}", names()))),
        (Some(only), None) => Ok(only),
        _ => grids.iter().find(|g| name_of(g) == "density" && is_number(g)).ok_or_else(|| {
            fail(format!("the file holds several grids, none of them \"density\": name one of {}", names()))
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_box_of_a_leaf_is_that_of_its_active_voxels() {
        let mut leaf = Leaf { origin: [0; 3], active: [0; 8] };
        assert_eq!(leaf.active_box(), None);
        let mut set = |[x, y, z]: [usize; 3]| leaf.active[x] |= 1 << (8 * y + z);
        set([3, 4, 5]);
        set([6, 1, 7]);
        assert_eq!(leaf.active_box(), Some([[3, 1, 5], [6, 4, 7]]));
    }

    #[test]
    fn grids_are_chosen_by_name() {
        let chosen = |grids: &[(&str, bool)], wanted| choose(grids, wanted, |g| g.0, |g| g.1).map(|g| g.0.to_owned());
        let three = [("velocity", false), ("temperature", true), ("density", true)];
        assert_eq!(chosen(&three, None), Ok("density".to_owned()));
        assert_eq!(chosen(&three[..2], None), Ok("temperature".to_owned()));
        assert_eq!(chosen(&three, Some("temperature")), Ok("temperature".to_owned()));
        let reason = |grids, wanted| chosen(grids, wanted).unwrap_err().reason;
        assert_eq!(
            reason(&three, Some("smoke")),
            "there is no grid \"smoke\"; the file holds \"velocity\", \"temperature\", \"density\""
        );
        assert_eq!(reason(&[], None), "there is no grid of numbers; the file holds no grids");
        assert!(reason(&[("a", true), ("b", true)], None).contains("name one of \"a\", \"b\""));
    }
}
