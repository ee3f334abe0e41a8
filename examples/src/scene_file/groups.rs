//! Groups of shapes and their instances, which become shapes of their own.

use std::collections::HashMap;

use super::description::{Container, Geometry, Shape};
use super::element::Element;
use super::plugin::Plugin;
use super::shapes::{self, ShapeElement};
use crate::error::SceneError;
use crate::mesh::Mesh;
use crate::transform::Transform;

/// Most triangles of all instances: what they need is held for each of them, about 150 bytes.
const MOST_TRIANGLES: usize = 1 << 24;

/// Groups that were read, by their place in the file, and triangles of their instances so far.
#[derive(Debug, Default)]
pub(super) struct Groups<'a> {
    read: HashMap<usize, Vec<ShapeElement<'a>>>,
    triangles: usize,
    /// Groups within groups, and no further.
    depth: u32,
}

impl<'a> Groups<'a> {
    /// The shapes of a `<shape type="shapegroup">`.
    pub(super) fn of(&mut self, element: &Element<'a>) -> Result<&[ShapeElement<'a>], SceneError> {
        let key = core::ptr::from_ref(element.node).addr();
        if !self.read.contains_key(&key) {
            let plugin = Plugin::new(*element)?;
            if plugin.kind != "shapegroup" {
                return Err(plugin.unknown_type("shapegroup (inside an instance)"));
            }
            let shapes = members(&plugin, self)?;
            plugin.finish()?;
            if let Some(light) = shapes.iter().find(|s| s.shape.as_ref().is_some_and(|s| s.radiance.is_some())) {
                return Err(light.element.error("a light cannot stand in a group that is instanced"));
            }
            self.read.insert(key, shapes);
        }
        Ok(self.read.get(&key).map_or(&[], Vec::as_slice))
    }
}

/// The shapes nested in a group.
pub(super) fn members<'a>(plugin: &Plugin<'a>, groups: &mut Groups<'a>) -> Result<Vec<ShapeElement<'a>>, SceneError> {
    if groups.depth > 3 {
        return Err(plugin.element.error("groups of shapes are nested too deep"));
    }
    groups.depth += 1;
    let mut shapes = Vec::new();
    while let Some(child) = plugin.nested("shape") {
        shapes.extend(child.keep(shapes::read(&child, groups)).into_iter().flatten());
    }
    groups.depth -= 1;
    Ok(shapes)
}

/// The shapes of the group in an instance, moved.
pub(super) fn instance<'a>(plugin: &Plugin<'a>, groups: &mut Groups<'a>) -> Result<Vec<ShapeElement<'a>>, SceneError> {
    let to_world = plugin.to_world()?.map_or(Transform::IDENTITY, |(t, _)| t);
    let group =
        plugin.nested("shape").ok_or_else(|| plugin.element.error("a <ref> to a shapegroup is missing inside"))?;
    plugin.finish()?;
    let members = groups.of(&group)?.to_vec();
    let triangles = |s: &ShapeElement<'_>| match s.shape.as_ref().map(|s| &s.geometry) {
        Some(Geometry::Mesh(mesh)) => mesh.triangles.len(),
        _ => 1,
    };
    groups.triangles = groups.triangles.saturating_add(members.iter().map(triangles).sum());
    if groups.triangles > MOST_TRIANGLES {
        let count = groups.triangles;
        return Err(plugin
            .element
            .error(format!("instances so far have {count} triangles, of which {MOST_TRIANGLES} are kept at most")));
    }
    members.into_iter().map(|member| moved(member, plugin, &to_world)).collect()
}

fn moved<'a>(
    member: ShapeElement<'a>,
    plugin: &Plugin<'a>,
    to_world: &Transform,
) -> Result<ShapeElement<'a>, SceneError> {
    let file = plugin.element.context.tree.file(plugin.element.node);
    let shape = match member.shape {
        None => None,
        Some(shape) => {
            let geometry = match shape.geometry {
                Geometry::Rectangle(t) => Geometry::Rectangle(t.then(to_world)),
                Geometry::Disk(t) => Geometry::Disk(t.then(to_world)),
                Geometry::Cube(t) => Geometry::Cube(t.then(to_world)),
                Geometry::Cylinder(t) => Geometry::Cylinder(t.then(to_world)),
                Geometry::Sphere { centre, radius, axes } if to_world.is_similar() => Geometry::Sphere {
                    centre: to_world.point(centre),
                    radius: radius * to_world.determinant().abs().cbrt(),
                    axes: axes.then(to_world),
                },
                Geometry::Sphere { centre, radius, .. } => {
                    let placed = Transform::scaling([radius; 3]).then(&Transform::translation(centre));
                    Geometry::Mesh(Mesh::ball(&placed.then(to_world)))
                }
                Geometry::Mesh(mesh) => {
                    Geometry::Mesh(mesh.transformed(to_world, file).map_err(|e| plugin.element.error(e))?)
                }
            };
            Some(Shape { geometry, ..shape })
        }
    };
    let container = match member.container {
        Some(Container::Cube(t)) => Some(Container::Cube(t.then(to_world))),
        Some(Container::Sphere { centre, radius }) if to_world.is_similar() => Some(Container::Sphere {
            centre: to_world.point(centre),
            radius: radius * to_world.determinant().abs().cbrt(),
        }),
        None => None,
        Some(_) => return Err(member.element.error("a mesh in a group that is instanced cannot hold a medium")),
    };
    Ok(ShapeElement { shape, container, ..member })
}
