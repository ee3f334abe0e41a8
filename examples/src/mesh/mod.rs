//! Triangle meshes and their files.

mod curves;
mod forms;
mod normals;
mod obj;
mod ply;
mod serialized;

use std::path::Path;

use fogbow::math::{Bounds, Vec2, Vec3};

use crate::error::{DataError, read_file};
use crate::transform::{Transform, normalized, to_array, to_vec3};

/// Triangles over shared vertices.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Mesh {
    /// Positions (m).
    pub vertices: Vec<Vec3>,
    /// Three indices into the vertices each; the normal is `(b − a) × (c − a)`.
    pub triangles: Vec<[u32; 3]>,
    /// Normals (unit) at the vertices, between which they are interpolated; empty where triangles are flat.
    pub normals: Vec<Vec3>,
    /// Texture coordinates of the vertices, the second down; empty if there are none.
    pub texcoords: Vec<Vec2>,
    /// Which of the vertices are one point, as equal numbers; empty where each is its own.
    pub points: Vec<u32>,
    /// Other values of vertices and triangles.
    pub attributes: Vec<Attribute>,
}

/// Values of the vertices or triangles of a mesh, such as colours.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Attribute {
    /// As textures name it: `vertex_…`, or `face_…` for triangles.
    pub name: String,
    /// Values of each: 1 or 3.
    pub channels: usize,
    /// All values, one vertex or triangle after another.
    pub values: Vec<f32>,
}

impl Attribute {
    /// Whether it belongs to triangles.
    #[must_use]
    pub fn is_of_triangles(&self) -> bool {
        self.name.starts_with("face_")
    }

    /// The values of a vertex or triangle; one alone counts for all three.
    #[must_use]
    pub fn at(&self, index: usize) -> Vec3 {
        let start = index.saturating_mul(self.channels);
        match self.values.get(start..start.saturating_add(self.channels)) {
            Some([x, y, z, ..]) => Vec3::new(*x, *y, *z),
            Some([one, ..]) => Vec3::splat(*one),
            _ => Vec3::ZERO,
        }
    }
}

impl Mesh {
    /// Reads a PLY file: text or binary, triangles and quads, with normals, texture coordinates, colours and other values of
    /// vertices and faces.
    ///
    /// # Errors
    /// A file that is missing, truncated or broken, or holds no triangle with an area.
    pub fn read_ply(file: &Path) -> Result<Self, DataError> {
        Self::from_ply(file, &read_file(file)?)
    }

    /// Reads the bytes of a PLY file.
    ///
    /// # Errors
    /// As [`Mesh::read_ply`].
    pub fn from_ply(file: &Path, bytes: &[u8]) -> Result<Self, DataError> {
        ply::read(file, bytes)?.checked(file)
    }

    /// Reads a Wavefront OBJ file: its faces, without materials.
    ///
    /// # Errors
    /// As [`Mesh::read_ply`].
    pub fn read_obj(file: &Path) -> Result<Self, DataError> {
        Self::from_obj(file, &read_file(file)?)
    }

    /// Reads the bytes of an OBJ file.
    ///
    /// # Errors
    /// As [`Mesh::read_ply`].
    pub fn from_obj(file: &Path, bytes: &[u8]) -> Result<Self, DataError> {
        obj::read(file, bytes)?.checked(file)
    }

    /// Reads one of the meshes in a file of Mitsuba's serialized meshes.
    ///
    /// # Errors
    /// As [`Mesh::read_ply`], and an index that the file does not have.
    pub fn read_serialized(file: &Path, index: usize) -> Result<Self, DataError> {
        Self::from_serialized(file, &read_file(file)?, index)
    }

    /// Reads one of the meshes in the bytes of a file.
    ///
    /// # Errors
    /// As [`Mesh::read_serialized`].
    pub fn from_serialized(file: &Path, bytes: &[u8], index: usize) -> Result<Self, DataError> {
        serialized::read(file, bytes, index)?.checked(file)
    }

    /// Reads Mitsuba's curves, a control point with its radius on each line and an empty line between two curves, as tubes of
    /// triangles: straight between points, or cubic B-splines. Points are transformed, radii are not.
    ///
    /// # Errors
    /// A file that is missing or broken.
    pub fn read_curves(file: &Path, is_smooth: bool, to_world: &Transform) -> Result<Self, DataError> {
        Self::from_curves(file, &read_file(file)?, is_smooth, to_world)
    }

    /// Reads the bytes of a file of curves.
    ///
    /// # Errors
    /// As [`Mesh::read_curves`].
    pub fn from_curves(file: &Path, bytes: &[u8], is_smooth: bool, to_world: &Transform) -> Result<Self, DataError> {
        curves::read(file, bytes, is_smooth, to_world)?.checked(file)
    }

    /// The corners of a triangle.
    #[must_use]
    pub fn corners(&self, triangle: [u32; 3]) -> [Vec3; 3] {
        triangle.map(|i| self.vertices.get(i as usize).copied().unwrap_or_default())
    }

    /// The smallest box around the vertices.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        Bounds::of(self.vertices.iter().copied())
    }

    /// The image of the mesh. A mirror image turns the normals of triangles to the other side, because they
    /// follow from the order of the corners; but where vertices have normals of their own, those decide.
    ///
    /// # Errors
    /// Vertices that leave the range of numbers.
    pub fn transformed(mut self, to_world: &Transform, file: &Path) -> Result<Self, DataError> {
        if *to_world != Transform::IDENTITY {
            for vertex in &mut self.vertices {
                *vertex = to_vec3(to_world.point(to_array(*vertex)));
            }
            let upright = to_world.inverse().unwrap_or(Transform::IDENTITY).transposed();
            for normal in &mut self.normals {
                *normal = to_vec3(normalized(upright.point(to_array(*normal))).unwrap_or_default());
            }
        }
        self.face_normals();
        self.checked(file)
    }

    fn checked(self, file: &Path) -> Result<Self, DataError> {
        for (index, vertex) in self.vertices.iter().enumerate() {
            // The square of a coordinate must still be a number.
            if !(vertex.is_finite() && vertex.abs().max_element() < 1e15) {
                let place = format!("vertex {index}");
                return Err(DataError::new(file, place, format!("position {vertex} is not finite, or too far out")));
            }
        }
        for (index, triangle) in self.triangles.iter().enumerate() {
            if let Some(bad) = triangle.iter().find(|i| **i as usize >= self.vertices.len()) {
                let reason = format!("vertex {bad} does not exist: there are {}", self.vertices.len());
                return Err(DataError::new(file, format!("face {index}"), reason));
            }
        }
        for (what, length) in [("normals", self.normals.len()), ("texture coordinates", self.texcoords.len())] {
            if length != 0 && length != self.vertices.len() {
                let reason = format!("{length} {what} for {} vertices", self.vertices.len());
                return Err(DataError::new(file, "", reason));
            }
        }
        if let Some(index) = self.texcoords.iter().position(|at| !at.is_finite()) {
            return Err(DataError::new(file, format!("vertex {index}"), "texture coordinates are not finite"));
        }
        if !self.triangles.iter().any(|t| has_area(self.corners(*t))) {
            return Err(DataError::new(file, "", "holds no triangle with an area"));
        }
        Ok(self)
    }
}

/// Whether the corners span a triangle that can be hit.
#[must_use]
pub fn has_area([a, b, c]: [Vec3; 3]) -> bool {
    (b - a).cross(c - a).length_squared() > 0.0
}
