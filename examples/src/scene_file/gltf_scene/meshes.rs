//! Meshes: the triangles of each primitive become a shape.

use ::gltf::Semantic;
use ::gltf::mesh::Mode;
use std::sync::Arc;

use fogbow::math::{Vec2, Vec3};
use fogbow::phase::Phase;
use fogbow::spectrum::Spectrum;

use super::data::Data;
use super::materials::Materials;
use super::{Source, label};
use crate::error::SceneError;
use crate::mesh::Mesh;
use crate::scene_file::description::{Container, Geometry, Matter, MediumDescription, Place, Shape};
use crate::scene_file::notes::NoteKind;
use crate::transform::Transform;
use crate::world::Body;

/// Most triangles of a scene, instances included: about 4 GB with all that is built from them.
const MAX_TRIANGLES: usize = 1 << 25;

/// Adds the shapes of a mesh.
pub(super) fn read(
    source: &Source<'_>,
    mesh: &::gltf::Mesh<'_>,
    to_world: &Transform,
    data: &Data,
    materials: &Materials,
    (shapes, media): (&mut Vec<Shape>, &mut Vec<MediumDescription>),
) -> Result<(), SceneError> {
    for primitive in mesh.primitives() {
        let element = format!("{}, primitive {}", label("mesh", mesh.index(), mesh.name()), primitive.index());
        let error = |reason: String| source.error(&*element, reason);
        if primitive.morph_targets().len() > 0 {
            source.note(NoteKind::Ignored, "morph targets", "are not applied: meshes stand as they were modelled");
        }
        if matches!(primitive.mode(), Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
            source.note(NoteKind::Ignored, &*element, "points and lines have no surface, and are left out");
            continue;
        }
        let material = materials.of(&primitive.material());
        let of = |semantic: &Semantic| primitive.get(semantic);
        let named = |name: &'static str| move |reason: String| error(format!("{name} {reason}"));
        let positions = of(&Semantic::Positions).ok_or_else(|| error("has no positions".to_owned()))?;
        let positions = data.numbers::<3>(&positions).map_err(named("POSITION"))?;
        let mut vertices = Mesh { vertices: positions.into_iter().map(Vec3::from_array).collect(), ..Mesh::default() };
        let count = vertices.vertices.len();
        if let Some(accessor) = of(&Semantic::Normals) {
            let normals = data.numbers::<3>(&accessor).map_err(named("NORMAL"))?;
            vertices.normals = normals.into_iter().map(Vec3::from_array).collect();
        }
        if let Some(accessor) = material.texcoords.and_then(|set| of(&Semantic::TexCoords(set))) {
            let texcoords = data.numbers::<2>(&accessor).map_err(named("TEXCOORD"))?;
            vertices.texcoords = texcoords.into_iter().map(Vec2::from_array).collect();
        }
        if of(&Semantic::Colors(0)).is_some() {
            source.note(NoteKind::Ignored, "COLOR_0", "colours of vertices have no effect");
        }
        for (name, length) in [("NORMAL", vertices.normals.len()), ("TEXCOORD", vertices.texcoords.len())] {
            if length != 0 && length != count {
                return Err(error(format!("{name} has {length} elements where there are {count} positions")));
            }
        }
        let corners = match primitive.indices() {
            Some(accessor) => data.indices(&accessor).map_err(named("indices"))?,
            None => (0..u32::try_from(count).map_err(|_| error("has too many vertices".to_owned()))?).collect(),
        };
        vertices.triangles = triangles(primitive.mode(), &corners);
        let triangles: usize = shapes
            .iter()
            .map(|shape| match &shape.geometry {
                Geometry::Mesh(mesh) => mesh.triangles.len(),
                _ => 0,
            })
            .sum();
        if triangles.saturating_add(vertices.triangles.len()) > MAX_TRIANGLES {
            return Err(error(format!("with it, there are more than {MAX_TRIANGLES} triangles")));
        }
        if vertices.normals.iter().any(|n| !(n.is_finite() && n.length_squared() > 0.0)) {
            source.note(NoteKind::Suspicious, &*element, "normals without a length: its triangles are flat");
            vertices.normals = Vec::new();
        }
        let geometry =
            vertices.transformed(to_world, source.file).map_err(|e| error(format!("{} {}", e.place, e.reason)))?;
        if let Some(absorption) = material.attenuation {
            match Body::new(&geometry) {
                Ok(body) => media.push(MediumDescription {
                    id: format!("glass of {element}"),
                    matter: Matter::Homogeneous { absorption, scattering: Spectrum::ZERO, phase: Phase::ISOTROPIC },
                    limits: None,
                    glow: Spectrum::ZERO,
                    heat: None,
                    places: vec![Place { container: Container::Body(Arc::new(body)), holes: Vec::new() }],
                }),
                Err(reason) => {
                    source.note(NoteKind::Replaced, &*element, format!("attenuation within: clear, for {reason}"))
                }
            }
        }
        shapes.push(Shape {
            geometry: Geometry::Mesh(geometry),
            is_flipped: false,
            material: material.surface.clone(),
            radiance: material.radiance,
            glow: material.glow.clone(),
            file: source.file.into(),
            line: 0,
        });
    }
    Ok(())
}

fn triangles(mode: Mode, corners: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        Mode::TriangleStrip => {
            // Every second one runs the other way around.
            let turn = |(i, w): (usize, &[u32])| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] };
            corners.windows(3).enumerate().map(turn).collect()
        }
        Mode::TriangleFan => match corners {
            [first, rest @ ..] => rest.windows(2).map(|w| [w[0], w[1], *first]).collect(),
            [] => Vec::new(),
        },
        _ => corners.as_chunks::<3>().0.to_vec(),
    }
}
