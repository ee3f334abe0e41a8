//! Wavefront OBJ: positions, texture coordinates, normals and faces. Materials come from the scene file; groups and objects are
//! read as one mesh.

use std::collections::HashMap;
use std::path::Path;

use fogbow::math::{Vec2, Vec3};

use super::Mesh;
use crate::error::DataError;

/// Where a corner has no texture coordinate or normal.
const NONE: u32 = u32::MAX;

/// What faces refer to, and the mesh so far.
#[derive(Default)]
struct Reader {
    positions: Vec<Vec3>,
    texcoords: Vec<Vec2>,
    normals: Vec<Vec3>,
    /// Vertices by their position, texture coordinate and normal.
    vertices: HashMap<[u32; 3], u32>,
    keys: Vec<[u32; 3]>,
    triangles: Vec<[u32; 3]>,
    corners: Vec<u32>,
}

pub(super) fn read(file: &Path, bytes: &[u8]) -> Result<Mesh, DataError> {
    let mut reader = Reader::default();
    for (number, line) in bytes.split(|b| *b == b'\n').enumerate() {
        // Names may be in any encoding; numbers are ASCII.
        let line = String::from_utf8_lossy(line);
        reader.line(&line).map_err(|reason| DataError::new(file, format!("line {}", number + 1), reason))?;
    }
    Ok(reader.mesh())
}

impl Reader {
    fn line(&mut self, line: &str) -> Result<(), String> {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => self.positions.push(Vec3::from_array(numbers(words)?)),
            Some("vn") => self.normals.push(Vec3::from_array(numbers(words)?)),
            Some("vt") => {
                // A second coordinate may be missing.
                let mut at = [0.0; 2];
                for (slot, word) in at.iter_mut().zip(words) {
                    *slot = number(word)?;
                }
                self.texcoords.push(Vec2::from_array(at));
            }
            Some("f") => self.face(words)?,
            _ => {}
        }
        Ok(())
    }

    fn face<'w>(&mut self, words: impl Iterator<Item = &'w str>) -> Result<(), String> {
        self.corners.clear();
        for word in words {
            if word.starts_with('#') {
                break;
            }
            let mut parts = word.split('/');
            let mut index = |count: usize, what: &str| match parts.next() {
                None | Some("") => Ok(NONE),
                Some(text) => reference(text, count, what),
            };
            let key = [
                index(self.positions.len(), "vertex")?,
                index(self.texcoords.len(), "texture coordinate")?,
                index(self.normals.len(), "normal")?,
            ];
            if key[0] == NONE {
                return Err(format!("\"{word}\" names no vertex"));
            }
            let next = u32::try_from(self.keys.len()).map_err(|_| "has too many vertices".to_owned())?;
            let vertex = *self.vertices.entry(key).or_insert(next);
            if vertex == next {
                self.keys.push(key);
            }
            self.corners.push(vertex);
        }
        match self.corners[..] {
            // Points and lines are no surface.
            [] | [_] | [_, _] => {}
            [first, ref rest @ ..] => {
                self.triangles.extend(rest.windows(2).filter_map(|w| Some([first, *w.first()?, *w.last()?])));
            }
        }
        Ok(())
    }

    fn mesh(self) -> Mesh {
        let has = |slot: usize| self.keys.iter().any(|key| key[slot] != NONE);
        let pick = |slot: usize, values: &[Vec3]| -> Vec<Vec3> {
            self.keys.iter().map(|key| values.get(key[slot] as usize).copied().unwrap_or_default()).collect()
        };
        // Rows of a picture go down, texture coordinates of this format go up.
        let texcoord = |key: &[u32; 3]| {
            let at = self.texcoords.get(key[1] as usize).copied().unwrap_or_default();
            Vec2::new(at.x, 1.0 - at.y)
        };
        Mesh {
            vertices: pick(0, &self.positions),
            normals: if has(2) { pick(2, &self.normals) } else { Vec::new() },
            texcoords: if has(1) { self.keys.iter().map(texcoord).collect() } else { Vec::new() },
            points: self.keys.iter().map(|key| key[0]).collect(),
            triangles: self.triangles,
            attributes: Vec::new(),
        }
    }
}

fn number(word: &str) -> Result<f32, String> {
    word.parse().map_err(|_| format!("\"{}\" is not a number", word.chars().take(20).collect::<String>()))
}

/// The first three numbers; others (a weight, colours) are not used.
fn numbers<'w>(mut words: impl Iterator<Item = &'w str>) -> Result<[f32; 3], String> {
    let mut next = || number(words.next().ok_or("three numbers are due")?);
    Ok([next()?, next()?, next()?])
}

/// The index of one of `count` things: from 1, or from behind as a negative number.
fn reference(text: &str, count: usize, what: &str) -> Result<u32, String> {
    let shown: String = text.chars().take(20).collect();
    let number: i64 = text.parse().map_err(|_| format!("\"{shown}\" is not the number of a {what}"))?;
    let index = if number < 0 { number.checked_add(count as i64) } else { Some(number - 1) };
    match index {
        Some(index) if index >= 0 && index < count as i64 && index < i64::from(NONE) => Ok(index as u32),
        _ => Err(format!("{what} {shown} does not exist: there are {count} so far")),
    }
}
