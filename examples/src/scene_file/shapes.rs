//! `<shape>`.

use fogbow::spectrum::Spectrum;
use fogbow::surface::Surface;

use super::description::{Container, Geometry, Material, Shape};
use super::element::Element;
use super::plugin::Plugin;
use super::{materials, textures};
use crate::error::SceneError;
use crate::mesh::Mesh;
use crate::transform::Transform;

/// A shape and the media at its sides.
#[derive(Debug)]
pub(super) struct ShapeElement<'a> {
    pub(super) element: Element<'a>,
    /// The surface; `None` where light passes unchanged.
    pub(super) shape: Option<Shape>,
    /// The body it encloses, if media can be told apart by it.
    pub(super) container: Option<Container>,
    /// The `<medium>` elements at both sides.
    pub(super) interior: Option<Element<'a>>,
    pub(super) exterior: Option<Element<'a>>,
}

pub(super) fn read<'a>(element: &Element<'a>) -> Result<ShapeElement<'a>, SceneError> {
    let plugin = Plugin::new(*element)?;
    let is_flipped = plugin.boolean("flip_normals", false)?;
    let radiance = plugin.nested("emitter").map(|e| area_emitter(&e)).transpose()?;
    let interior = side(&plugin, "interior")?;
    let exterior = side(&plugin, "exterior")?;
    let material = match plugin.nested("bsdf") {
        // A shape whose material is not known still tells what else is wrong with it.
        Some(bsdf) => bsdf.keep(materials::read(&bsdf)),
        None => None,
    };
    let material = material.unwrap_or_else(|| materials::default_material(radiance.is_some()));
    let geometry = read_geometry(&plugin)?;
    plugin.finish()?;
    let container = match &geometry {
        Geometry::Cube(to_world) => Some(Container::Cube(*to_world)),
        Geometry::Sphere { centre, radius, .. } => Some(Container::Sphere { centre: *centre, radius: *radius }),
        _ => None,
    };
    let mesh = match &geometry {
        Geometry::Mesh(mesh) => Some(mesh),
        _ => None,
    };
    for (_, texture) in &material.textures {
        textures::check_attributes(texture, mesh).map_err(|reason| element.error(reason))?;
    }
    check(element, &geometry, &material, radiance.is_some(), is_flipped, interior.is_some() || exterior.is_some())?;
    let is_visible = material.surface != Surface::Null;
    let shape = is_visible.then(|| Shape { geometry, is_flipped, material, radiance, line: element.line() });
    Ok(ShapeElement { element: *element, shape, container, interior, exterior })
}

fn check(
    element: &Element<'_>,
    geometry: &Geometry,
    material: &Material,
    is_emitter: bool,
    is_flipped: bool,
    has_media: bool,
) -> Result<(), SceneError> {
    let is_clear = matches!(material.surface, Surface::Null | Surface::Dielectric { .. });
    if is_emitter && is_clear {
        return Err(element.error("an area light needs a bsdf that light cannot pass through"));
    }
    if is_emitter && matches!(geometry, Geometry::Disk(_)) {
        return Err(element.error("a disk cannot be an area light here; rectangle, sphere, cube and meshes can"));
    }
    if is_emitter && is_flipped && matches!(geometry, Geometry::Sphere { .. }) {
        return Err(element.error("a sphere that shines inwards is not supported"));
    }
    if has_media && !matches!(geometry, Geometry::Cube(_) | Geometry::Sphere { .. }) && is_clear {
        return Err(element.error("only a cube or a sphere can hold a medium"));
    }
    if has_media && is_clear && is_flipped {
        return Err(element.error("a container of a medium cannot have flipped normals"));
    }
    Ok(())
}

/// The medium at a side: `<ref name="interior" id="fog"/>` or a `<medium name="interior">`.
fn side<'a>(plugin: &Plugin<'a>, name: &str) -> Result<Option<Element<'a>>, SceneError> {
    let Some(element) = plugin.get(name) else { return Ok(None) };
    match element.tag() {
        "medium" => Ok(Some(element)),
        _ => Err(element.wrong_tag("medium")),
    }
}

fn area_emitter(element: &Element<'_>) -> Result<Spectrum, SceneError> {
    let plugin = Plugin::new(*element)?;
    if plugin.kind != "area" {
        return Err(plugin.unknown_type("area (inside a shape)"));
    }
    let radiance = plugin.colour("radiance")?.map_or(Spectrum::ONE, |(value, _)| value);
    plugin.finish()?;
    Ok(radiance)
}

fn read_geometry(plugin: &Plugin<'_>) -> Result<Geometry, SceneError> {
    let placed = plugin.to_world()?;
    let to_world = placed.map_or(Transform::IDENTITY, |(t, _)| t);
    match plugin.kind.as_str() {
        "rectangle" => Ok(Geometry::Rectangle(to_world)),
        "cube" => Ok(Geometry::Cube(to_world)),
        "disk" => Ok(Geometry::Disk(to_world)),
        "sphere" => {
            let centre = plugin.point("center")?.unwrap_or_default();
            let radius = plugin.positive("radius", 1.0)?;
            if let Some((t, source)) = placed
                && !t.is_similar()
            {
                return Err(source.error("a sphere must be scaled by the same factor along all axes"));
            }
            let scale = to_world.determinant().abs().cbrt();
            let (centre, radius) = (to_world.point(centre), radius * scale);
            if !(radius > 1e-18 && radius < 1e18) {
                return Err(plugin.element.error(format!("radius {radius} is beyond what can be computed with")));
            }
            Ok(Geometry::Sphere { centre, radius, axes: to_world })
        }
        "ply" | "obj" => {
            let (file, source) = plugin.path("filename")?;
            let is_flat = plugin.boolean("face_normals", false)?;
            // Each format has its own idea of what is up.
            let flips = plugin.boolean("flip_tex_coords", plugin.kind == "obj")? != (plugin.kind == "obj");
            let mesh = if plugin.kind == "ply" { Mesh::read_ply(&file) } else { Mesh::read_obj(&file) };
            let mut mesh = mesh.map_err(|e| source.data_error(&e))?;
            if is_flat {
                mesh.normals = Vec::new();
            }
            if flips {
                mesh.texcoords.iter_mut().for_each(|at| at.y = 1.0 - at.y);
            }
            let mut mesh = mesh.transformed(&to_world, &file).map_err(|e| source.data_error(&e))?;
            if !is_flat {
                mesh.smooth();
            }
            Ok(Geometry::Mesh(mesh))
        }
        _ => Err(plugin.unknown_type("rectangle, cube, sphere, disk, ply, obj")),
    }
}
