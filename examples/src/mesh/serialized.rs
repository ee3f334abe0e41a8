//! Mitsuba's `.serialized` files, versions 3 and 4: several meshes in one file, each compressed, with a table of where they begin.

use std::io::{self, Read};
use std::path::Path;

use flate2::read::ZlibDecoder;
use fogbow::math::{Vec2, Vec3};

use super::Mesh;
use crate::error::DataError;

const MAGIC: u16 = 0x041c;

const HAS_NORMALS: u32 = 0x0001;
const HAS_TEXCOORDS: u32 = 0x0002;
const HAS_COLOURS: u32 = 0x0008;
const DOUBLE: u32 = 0x2000;

/// Values that are read at once: memory is taken as they come, not as a header promises.
const CHUNK: usize = 1 << 14;

pub(super) fn read(file: &Path, bytes: &[u8], index: usize) -> Result<Mesh, DataError> {
    let fail = |place: &str, reason: String| DataError::new(file, place.to_owned(), reason);
    let version = header(bytes).map_err(|e| fail("header", e))?;
    let start = if index == 0 { 0 } else { offset(bytes, version, index).map_err(|e| fail("table of meshes", e))? };
    let stream = bytes.get(start..).unwrap_or_default();
    let version = header(stream).map_err(|e| fail(&format!("mesh {index}"), e))?;
    let place = format!("mesh {index}");
    body(stream.get(4..).unwrap_or_default(), version).map_err(|reason| fail(&place, reason))
}

/// The version.
fn header(bytes: &[u8]) -> Result<u16, String> {
    match bytes {
        [a, b, c, d, ..] if u16::from_le_bytes([*a, *b]) == MAGIC => match u16::from_le_bytes([*c, *d]) {
            version @ 3..=4 => Ok(version),
            other => Err(format!("version {other} is not known; 3 and 4 are")),
        },
        _ => Err("the file does not begin with the mark of a serialized mesh".to_owned()),
    }
}

/// Where a mesh begins, from the table at the end.
fn offset(bytes: &[u8], version: u16, index: usize) -> Result<usize, String> {
    let (rest, count) = bytes.split_last_chunk::<4>().ok_or("the file is too short")?;
    let count = u32::from_le_bytes(*count) as usize;
    if index >= count {
        return Err(format!("shape_index {index} does not exist: there are {count}"));
    }
    let size = if version == 4 { 8 } else { 4 };
    let behind = (count - index).checked_mul(size).ok_or("the file is too short")?;
    let entry = rest.len().checked_sub(behind).and_then(|at| rest.get(at..at + size)).ok_or("the file is too short")?;
    let mut word = [0; 8];
    for (slot, byte) in word.iter_mut().zip(entry) {
        *slot = *byte;
    }
    let offset = usize::try_from(u64::from_le_bytes(word)).unwrap_or(usize::MAX);
    if offset < rest.len() { Ok(offset) } else { Err(format!("mesh {index} begins beyond the end of the file")) }
}

fn body(compressed: &[u8], version: u16) -> Result<Mesh, String> {
    let mut input = Input(ZlibDecoder::new(compressed));
    let flags = u32::from_le_bytes(input.bytes()?);
    if version == 4 {
        // The name.
        while input.bytes::<1>()? != [0] {}
    }
    let mut count = || -> Result<usize, String> {
        let count = u64::from_le_bytes(input.bytes()?);
        u32::try_from(count).map(|n| n as usize).map_err(|_| format!("{count} are more than can be read"))
    };
    let (vertices, triangles) = (count()?, count()?);
    let mut mesh = Mesh::default();
    let is_double = flags & DOUBLE != 0;
    input.floats(is_double, vertices, |p: [f32; 3]| mesh.vertices.push(Vec3::from_array(p)))?;
    if flags & HAS_NORMALS != 0 {
        input.floats(is_double, vertices, |n: [f32; 3]| mesh.normals.push(Vec3::from_array(n).normalize_or_zero()))?;
    }
    if flags & HAS_TEXCOORDS != 0 {
        input.floats(is_double, vertices, |at: [f32; 2]| mesh.texcoords.push(Vec2::from_array(at)))?;
    }
    if flags & HAS_COLOURS != 0 {
        // Mitsuba 3 does not use them.
        input.floats(is_double, vertices, |_: [f32; 3]| {})?;
    }
    for _ in 0..triangles {
        let mut corner = || Ok::<u32, String>(u32::from_le_bytes(input.bytes()?));
        mesh.triangles.push([corner()?, corner()?, corner()?]);
    }
    Ok(mesh)
}

/// What is in a compressed stream.
struct Input<'b>(ZlibDecoder<&'b [u8]>);

impl Input<'_> {
    fn bytes<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let mut bytes = [0; N];
        self.fill(&mut bytes)?;
        Ok(bytes)
    }

    fn fill(&mut self, bytes: &mut [u8]) -> Result<(), String> {
        self.0.read_exact(bytes).map_err(|error| match error.kind() {
            io::ErrorKind::UnexpectedEof => "the file ends here".to_owned(),
            _ => format!("cannot be decompressed: {error}"),
        })
    }

    /// `count` groups of `N` numbers.
    fn floats<const N: usize>(
        &mut self,
        is_double: bool,
        count: usize,
        mut visit: impl FnMut([f32; N]),
    ) -> Result<(), String> {
        let size = if is_double { 8 } else { 4 };
        let mut buffer = vec![0; CHUNK.min(count.max(1)) * N * size];
        let mut left = count;
        while left > 0 {
            let now = left.min(CHUNK);
            let part = buffer.get_mut(..now * N * size).unwrap_or_default();
            self.fill(part)?;
            for group in part.chunks_exact(N * size) {
                let mut values = [0.0; N];
                for (slot, word) in values.iter_mut().zip(group.chunks_exact(size)) {
                    *slot = match *word {
                        [a, b, c, d] => f32::from_le_bytes([a, b, c, d]),
                        [a, b, c, d, e, f, g, h] => f64::from_le_bytes([a, b, c, d, e, f, g, h]) as f32,
                        _ => 0.0,
                    };
                }
                visit(values);
            }
            left -= now;
        }
        Ok(())
    }
}
