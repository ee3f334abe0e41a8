//! Triangle meshes and their files.

mod obj;
mod ply;

use std::path::Path;

use fogbow::math::{Bounds, Vec3};

use crate::error::{DataError, read_file};
use crate::transform::{Transform, to_array, to_vec3};

/// Triangles over shared vertices.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Mesh {
    /// Positions (m).
    pub vertices: Vec<Vec3>,
    /// Three indices into the vertices each; the normal is `(b − a) × (c − a)`.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// Reads a PLY file: text or binary, triangles and quads.
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

    /// The image of the mesh. A mirror image turns the normals to the other side, because they
    /// follow from the order of the corners.
    ///
    /// # Errors
    /// Vertices that leave the range of numbers.
    pub fn transformed(mut self, to_world: &Transform, file: &Path) -> Result<Self, DataError> {
        if *to_world != Transform::IDENTITY {
            for vertex in &mut self.vertices {
                *vertex = to_vec3(to_world.point(to_array(*vertex)));
            }
        }
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
