//! Wavefront OBJ, by way of `tobj`.

use std::io::Cursor;
use std::path::Path;

use fogbow::math::Vec3;
use tobj::{LoadError, LoadOptions};

use super::Mesh;
use crate::error::DataError;

pub(super) fn read(file: &Path, bytes: &[u8]) -> Result<Mesh, DataError> {
    let fail = |reason: String| DataError::new(file, "", reason);
    let options = LoadOptions { triangulate: true, ignore_points: true, ignore_lines: true, ..LoadOptions::default() };
    // Materials come from the scene file.
    let no_materials = |_: &Path| Err(LoadError::OpenFileFailed);
    let (models, _) = tobj::load_obj_buf(&mut Cursor::new(bytes), &options, no_materials)
        .map_err(|e| fail(format!("is not a usable OBJ file: {e}")))?;
    let mut mesh = Mesh::default();
    for model in models {
        let base = u32::try_from(mesh.vertices.len()).map_err(|_| fail("has too many vertices".to_owned()))?;
        mesh.vertices.extend(model.mesh.positions.as_chunks::<3>().0.iter().map(|p| Vec3::from_array(*p)));
        for corners in model.mesh.indices.as_chunks::<3>().0 {
            let shifted = corners.map(|i| i.checked_add(base));
            let [Some(a), Some(b), Some(c)] = shifted else { return Err(fail("has too many vertices".to_owned())) };
            mesh.triangles.push([a, b, c]);
        }
    }
    Ok(mesh)
}
