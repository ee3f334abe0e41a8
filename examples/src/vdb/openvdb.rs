//! OpenVDB files: the header, descriptors of grids, and what stands before their trees.

use super::bytes::{Cursor, Fault, Number};
use super::nodes::{self, Storage};
use super::{Class, Grid, choose};
use crate::transform::Transform;

const MAGIC: [u8; 8] = 0x5644_4220_i64.to_le_bytes();

/// Since this version nodes say how their inactive values are stored.
const LEAST_VERSION: u32 = 222;

/// After the type of grids whose numbers are stored as halves.
const HALF: &str = "_HalfFloat";

/// Between the name of a grid and a number that tells it from others of that name.
const SEPARATOR: char = '\u{1e}';

pub(super) fn is_magic(bytes: &[u8]) -> bool {
    bytes == MAGIC
}

/// What a file says of a grid before the grid itself.
#[derive(Debug)]
struct Descriptor {
    /// The name with its number.
    unique: String,
    name: String,
    kind: String,
    /// The unique name of the grid whose tree it shares.
    parent: String,
    at: u64,
}

impl Descriptor {
    /// How its numbers are stored in buffers, and how single ones are; `None` if they are no numbers.
    fn numbers(&self) -> Option<(Number, Number)> {
        let (kind, is_half) = self.kind.strip_suffix(HALF).map_or((&*self.kind, false), |kind| (kind, true));
        let single = match kind {
            "Tree_half_5_4_3" => Number::Half,
            "Tree_float_5_4_3" => Number::Float,
            "Tree_double_5_4_3" => Number::Double,
            _ => return None,
        };
        Some((if is_half { Number::Half } else { single }, single))
    }
}

pub(super) fn read(bytes: Vec<u8>, wanted: Option<&str>) -> Result<Grid, Fault> {
    let file = Cursor::new(&bytes, "header");
    let descriptors = descriptors(file)?;
    let chosen = choose(&descriptors, wanted, |d| &d.name, |d| d.numbers().is_some())?;
    let place = format!("grid \"{}\"", chosen.name);
    let mut cursor = file.at(chosen.at, &place)?;
    let head = head(&mut cursor)?;
    // An instance has a place of its own in the world and the tree of another.
    let mut tree = cursor;
    let mut compression = head.compression;
    let mut owner = chosen;
    if !chosen.parent.is_empty() {
        owner = descriptors
            .iter()
            .find(|d| d.unique == chosen.parent && d.parent.is_empty())
            .ok_or_else(|| cursor.fault("it shares the tree of a grid that is not in the file"))?;
        tree = file.at(owner.at, &place)?;
        compression = self::head(&mut tree)?.compression;
    }
    let Some((buffers, single)) = owner.numbers() else {
        let reason = format!("its type is {}; float, half and double in trees 5_4_3 are known", owner.kind);
        return Err(cursor.fault(reason));
    };
    let mut grid = Grid {
        name: chosen.name.clone(),
        class: head.class,
        to_world: head.to_world,
        background: 0.0,
        leaves: Vec::new(),
        values: Vec::new(),
        tiles: Vec::new(),
    };
    nodes::read(&mut tree, Storage { compression, buffers, single }, &mut grid)?;
    Ok(grid)
}

fn descriptors(mut file: Cursor<'_>) -> Result<Vec<Descriptor>, Fault> {
    file.take(8)?;
    let version = file.u32()?;
    if version < LEAST_VERSION {
        return Err(file.fault(format!("version {version} is too old; {LEAST_VERSION} and later are read")));
    }
    let (_major, _minor) = (file.u32()?, file.u32()?);
    if file.u8()? == 0 {
        return Err(file.fault("the file was written as a stream, without places of grids, which is not supported"));
    }
    // A number of the file's own.
    file.take(36)?;
    metadata(&mut file, |_, _| {})?;
    let count = file.u32()?;
    let mut all = Vec::new();
    for _ in 0..count {
        let (unique, kind, parent) = (file.text()?, file.text()?, file.text()?);
        let (at, _blocks, end) = (file.u64()?, file.u64()?, file.u64()?);
        let name = unique.split(SEPARATOR).next().unwrap_or_default().to_owned();
        all.push(Descriptor { unique, name, kind, parent, at });
        // Files of one grid end there.
        if end < file.position() as u64 {
            return Err(file.fault("a grid that ends before it begins"));
        }
        file = file.at(end, file.place)?;
    }
    Ok(all)
}

/// Metadata: names, types and bytes.
fn metadata(cursor: &mut Cursor<'_>, mut each: impl FnMut(&str, &[u8])) -> Result<(), Fault> {
    for _ in 0..cursor.u32()? {
        let (name, _kind) = (cursor.text()?, cursor.text()?);
        let length = cursor.u32()?;
        each(&name, cursor.take(u64::from(length))?);
    }
    Ok(())
}

/// What stands before the tree of a grid.
struct Head {
    compression: u32,
    class: Class,
    to_world: Transform,
}

fn head(cursor: &mut Cursor<'_>) -> Result<Head, Fault> {
    let compression = cursor.u32()?;
    if compression > 7 {
        return Err(cursor.fault(format!("unknown compression {compression}")));
    }
    let mut class = Class::Other;
    metadata(cursor, |name, value| {
        if name == "class" {
            class = match value {
                b"level set" => Class::LevelSet,
                b"fog volume" => Class::FogVolume,
                _ => Class::Other,
            };
        }
    })?;
    Ok(Head { compression, class, to_world: transform(cursor)? })
}

fn transform(cursor: &mut Cursor<'_>) -> Result<Transform, Fault> {
    let kind = cursor.text()?;
    let mut triple = || -> Result<[f64; 3], Fault> { Ok([cursor.f64()?, cursor.f64()?, cursor.f64()?]) };
    let to_world = match kind.as_str() {
        "AffineMap" | "UnitaryMap" => {
            // Points are rows there: they are multiplied from the left.
            let mut m = [[0.0; 4]; 4];
            for row in &mut m {
                for number in row {
                    *number = cursor.f64()?;
                }
            }
            Transform { rows: [0, 1, 2].map(|row| [m[0][row], m[1][row], m[2][row], m[3][row]]) }
        }
        "ScaleMap" | "UniformScaleMap" => {
            let scale = triple()?;
            // Inverses and the like, which follow from it.
            for _ in 0..4 {
                triple()?;
            }
            Transform::scaling(scale)
        }
        "TranslationMap" => Transform::translation(triple()?),
        "ScaleTranslateMap" | "UniformScaleTranslateMap" => {
            let (translation, scale) = (triple()?, triple()?);
            for _ in 0..4 {
                triple()?;
            }
            Transform::scaling(scale).then(&Transform::translation(translation))
        }
        other => return Err(cursor.fault(format!("its transform is a {other}; only linear ones are supported"))),
    };
    Ok(to_world)
}
