//! From the description to primitives.

use fogbow::math::{Bounds, Vec3};

use super::Part;
use super::analytic::{Primitive, bounds};
use crate::mesh::has_area;
use crate::scene_file::{Container, Geometry, Material, SceneFile, Shape};
use crate::transform::{Transform, cross, dot, normalized, to_vec3};

/// What rays are tested against.
#[derive(Debug, Default)]
pub(super) struct Pieces {
    pub(super) materials: Vec<Material>,
    pub(super) primitives: Vec<Primitive>,
    pub(super) parts: Vec<Part>,
    pub(super) corners: Vec<[Vec3; 3]>,
    pub(super) triangle_parts: Vec<Part>,
    /// Of each triangle, its number in its mesh.
    pub(super) triangle_numbers: Vec<u32>,
}

impl Pieces {
    pub(super) fn new(scene: &SceneFile) -> Self {
        let mut pieces = Self::default();
        let mut lights = 0_u32..;
        for (index, shape) in (0_u32..).zip(&scene.shapes) {
            pieces.materials.push(shape.material.clone());
            let light = shape.radiance.and_then(|_| lights.next());
            // Of a mesh that shows a picture each triangle is a light.
            let is_many = shape.glow.is_some() && matches!(shape.geometry, Geometry::Mesh(_));
            let is_smooth = matches!(&shape.geometry, Geometry::Mesh(mesh) if !mesh.normals.is_empty());
            let varies = is_smooth || shape.material.varies();
            let part = Part { material: index, side: if shape.is_flipped { -1.0 } else { 1.0 }, light, varies };
            let before = pieces.corners.len();
            pieces.push(shape, part);
            if let Some(first) = light.filter(|_| is_many) {
                let parts = &mut pieces.triangle_parts[before..];
                (first..).zip(parts.iter_mut()).for_each(|(light, part)| part.light = Some(light));
                lights = first + u32::try_from(parts.len()).unwrap_or(0)..;
            }
        }
        pieces
    }

    fn push(&mut self, shape: &Shape, part: Part) {
        match &shape.geometry {
            Geometry::Mesh(mesh) => {
                for (number, triangle) in (0_u32..).zip(&mesh.triangles) {
                    let corners = mesh.corners(*triangle);
                    // Without an area there is nothing to hit, and no normal.
                    if has_area(corners) {
                        self.corners.push(corners);
                        self.triangle_parts.push(part);
                        self.triangle_numbers.push(number);
                    }
                }
            }
            analytic => {
                if let Some(primitive) = primitive(analytic) {
                    self.primitives.push(primitive);
                    self.parts.push(part);
                }
            }
        }
    }
}

fn primitive(geometry: &Geometry) -> Option<Primitive> {
    match geometry {
        Geometry::Rectangle(to_world) => flat(to_world, false),
        Geometry::Disk(to_world) => flat(to_world, true),
        Geometry::Sphere { centre, radius, .. } => {
            Some(Primitive::Sphere { centre: to_vec3(*centre), radius: *radius as f32 })
        }
        Geometry::Cube(to_world) => {
            let rows = to_world.inverse()?.rows.map(|r| (to_vec3([r[0], r[1], r[2]]), r[3] as f32));
            Some(Primitive::Box { rows })
        }
        Geometry::Cylinder(to_world) => {
            let rows = to_world.inverse()?.rows.map(|r| (to_vec3([r[0], r[1], r[2]]), r[3] as f32));
            Some(Primitive::Cylinder { rows })
        }
        Geometry::Mesh(_) => None,
    }
}

/// The image of the square or disc in the xy plane; the normal is the image of +z, also of a
/// mirror image.
fn flat(to_world: &Transform, is_disc: bool) -> Option<Primitive> {
    let (x, y, centre) = (to_world.column(0), to_world.column(1), to_world.column(3));
    let normal = flat_normal(to_world)?;
    // In the plane, across the other edge.
    let gradient = |edge: [f64; 3], other: [f64; 3]| {
        let across = cross(other, normal);
        let gradient = across.map(|c| c / dot(edge, across));
        (to_vec3(gradient), -dot(gradient, centre) as f32)
    };
    Some(Primitive::Flat {
        normal: to_vec3(normal),
        offset: dot(normal, centre) as f32,
        u: gradient(x, y),
        v: gradient(y, x),
        is_disc,
    })
}

/// The normal of a rectangle or disk.
pub(super) fn flat_normal(to_world: &Transform) -> Option<[f64; 3]> {
    let sign = to_world.determinant().signum();
    normalized(cross(to_world.column(0), to_world.column(1)).map(|c| c * sign))
}

/// The smallest box around a form (m).
#[must_use]
pub fn bounds_of(geometry: &Geometry) -> Bounds {
    match geometry {
        Geometry::Mesh(mesh) => mesh.bounds(),
        other => primitive(other).map_or(Bounds::EMPTY, |p| bounds(&p)),
    }
}

/// The smallest box around all surfaces and containers.
pub(super) fn scene_bounds(scene: &SceneFile) -> Bounds {
    let surfaces = scene.shapes.iter().map(|s| bounds_of(&s.geometry));
    surfaces.fold(medium_bounds(scene).unwrap_or(Bounds::EMPTY), Bounds::union)
}

/// The smallest box around all containers of media.
pub(super) fn medium_bounds(scene: &SceneFile) -> Option<Bounds> {
    let containers = scene.media.iter().flat_map(|m| &m.places).map(|p| match &p.container {
        // As far as there is anything to see.
        Container::Everywhere => {
            let eye = to_vec3(scene.sensor.to_world.column(3));
            let near = Bounds { min: eye - Vec3::ONE, max: eye + Vec3::ONE };
            scene.shapes.iter().map(|s| bounds_of(&s.geometry)).fold(near, Bounds::union)
        }
        container => {
            let [min, max] = container.bounds();
            Bounds { min: to_vec3(min), max: to_vec3(max) }
        }
    });
    containers.reduce(Bounds::union)
}
