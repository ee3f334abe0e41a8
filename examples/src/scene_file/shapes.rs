//! `<shape>`.

use std::sync::Arc;

use fogbow::spectrum::Spectrum;
use fogbow::surface::Surface;

use super::description::{Container, Geometry, Shape};
use super::element::Element;
use super::groups::Groups;
use super::plugin::Plugin;
use super::tree::Inline;
use super::{groups, materials, textures};
use crate::error::SceneError;
use crate::mesh::Mesh;
use crate::texture::Texture;
use crate::transform::{Transform, normalized};
use crate::world::{Body, as_box};

const KNOWN: &str = "rectangle, cube, sphere, disk, cylinder, ply, obj, serialized, linearcurve, bsplinecurve, shapegroup, instance, merge";

/// A shape and the media at its sides.
#[derive(Debug, Clone)]
pub(super) struct ShapeElement<'a> {
    pub(super) element: Element<'a>,
    /// The surface; `None` where light passes unchanged.
    pub(super) shape: Option<Shape>,
    /// The body it encloses, if media can be told apart by it.
    pub(super) container: Option<Container>,
    /// Whether its normals point into that body: then interior and exterior are exchanged.
    pub(super) is_inside_out: bool,
    /// The `<medium>` elements at both sides.
    pub(super) interior: Option<Element<'a>>,
    pub(super) exterior: Option<Element<'a>>,
}

/// The shapes of a `<shape>`: several for an instance of a group, none for the group itself.
pub(super) fn read<'a>(element: &Element<'a>, groups: &mut Groups<'a>) -> Result<Vec<ShapeElement<'a>>, SceneError> {
    let plugin = Plugin::new(*element)?;
    match plugin.kind.as_str() {
        // What nobody instances is not seen.
        "shapegroup" => {
            groups.of(element)?;
            Ok(Vec::new())
        }
        "instance" => groups::instance(&plugin, groups),
        "merge" => {
            let shapes = groups::members(&plugin, groups)?;
            plugin.finish()?;
            Ok(shapes)
        }
        _ => Ok(vec![read_one(&plugin)?]),
    }
}

fn read_one<'a>(plugin: &Plugin<'a>) -> Result<ShapeElement<'a>, SceneError> {
    let element = &plugin.element;
    let is_flipped = plugin.boolean("flip_normals", false)?;
    let emitter = plugin.nested("emitter");
    let (radiance, mut glow) = match &emitter {
        Some(emitter) => area_emitter(emitter).map(|(radiance, glow)| (Some(radiance), glow))?,
        None => (None, None),
    };
    let interior = side(plugin, "interior")?;
    let exterior = side(plugin, "exterior")?;
    let material = match plugin.nested("bsdf") {
        // A shape whose material is not known still tells what else is wrong with it.
        Some(bsdf) => {
            let grey = || materials::default_material(radiance.is_some());
            bsdf.keep(bsdf.or_instead(materials::read(&bsdf), "a grey surface instead", grey))
        }
        None => None,
    };
    let material = material.unwrap_or_else(|| materials::default_material(radiance.is_some()));
    let geometry = read_geometry(plugin)?;
    plugin.finish()?;
    let has_media = interior.is_some() || exterior.is_some();
    let is_boundary = has_media && material.surface.transmits();
    let (container, mut is_inside_out) = if is_boundary { container_of(&geometry, element)? } else { (None, false) };
    is_inside_out ^= is_flipped;
    if let (Some(texture), Some(emitter)) = (&glow, &emitter) {
        let checked = match &geometry {
            Geometry::Rectangle(_) => textures::check_attributes(texture, None),
            Geometry::Mesh(mesh) => textures::check_attributes(texture, Some(mesh)),
            _ => Err("light that varies over a surface is supported on rectangles and meshes only".to_owned()),
        };
        if let Err(reason) = checked {
            emitter.instead(emitter.error(reason), "its mean everywhere", || ())?;
            glow = None;
        }
    }
    let geometry = if radiance.is_some() { shining(geometry, is_flipped) } else { geometry };
    let mesh = match &geometry {
        Geometry::Mesh(mesh) => Some(mesh),
        _ => None,
    };
    for (_, texture) in material.leaves().into_iter().flat_map(|leaf| &leaf.textures) {
        textures::check_attributes(texture, mesh).map_err(|reason| element.error(reason))?;
    }
    let material = if radiance.is_some() && material.transmits() {
        let error = element.error("an area light needs a bsdf that light cannot pass through");
        element.instead(error, "a black surface that shines instead", || materials::default_material(true))?
    } else {
        material
    };
    let file = element.context.tree.file(element.node).into();
    let is_visible = material.surface != Surface::Null || material.mix.is_some();
    let shape =
        is_visible.then(|| Shape { geometry, is_flipped, material, radiance, glow, file, line: element.line() });
    Ok(ShapeElement { element: *element, shape, container, is_inside_out, interior, exterior })
}

/// The body that a form encloses, and whether normals point into it.
fn container_of(geometry: &Geometry, element: &Element<'_>) -> Result<(Option<Container>, bool), SceneError> {
    let container = match geometry {
        Geometry::Cube(to_world) => Container::Cube(*to_world),
        Geometry::Sphere { centre, radius, .. } => Container::Sphere { centre: *centre, radius: *radius },
        Geometry::Mesh(mesh) => {
            let body = Body::new(mesh).map_err(|reason| element.error(format!("cannot hold a medium: {reason}")))?;
            let is_inside_out = body.is_inside_out();
            // A mesh that is a box is quicker as one.
            let container = as_box(mesh).map_or_else(|| Container::Body(Arc::new(body)), Container::Cube);
            return Ok((Some(container), is_inside_out));
        }
        Geometry::Rectangle(_) | Geometry::Disk(_) | Geometry::Cylinder(_) => {
            return Err(element.error("only a closed shape can hold a medium: a cube, a sphere or a mesh"));
        }
    };
    Ok((Some(container), false))
}

/// A form that can shine: those that the lights of the core do not know become triangles.
fn shining(geometry: Geometry, is_flipped: bool) -> Geometry {
    match geometry {
        Geometry::Disk(to_world) => Geometry::Mesh(Mesh::disc(&to_world)),
        Geometry::Cylinder(to_world) => Geometry::Mesh(Mesh::cylinder(&to_world)),
        // Lights that are spheres shine outwards.
        Geometry::Sphere { centre, radius, .. } if is_flipped => {
            let placed = Transform::scaling([radius; 3]).then(&Transform::translation(centre));
            Geometry::Mesh(Mesh::ball(&placed))
        }
        other => other,
    }
}

/// The medium at a side: `<ref name="interior" id="fog"/>` or a `<medium name="interior">`.
fn side<'a>(plugin: &Plugin<'a>, name: &str) -> Result<Option<Element<'a>>, SceneError> {
    let Some(element) = plugin.get(name) else { return Ok(None) };
    match element.tag() {
        "medium" => Ok(Some(element)),
        _ => Err(element.wrong_tag("medium")),
    }
}

/// Radiance, and what it varies by; it is the mean then.
fn area_emitter(element: &Element<'_>) -> Result<(Spectrum, Option<Arc<Texture>>), SceneError> {
    let plugin = Plugin::new(*element)?;
    if plugin.kind != "area" {
        return Err(plugin.unknown_type("area (inside a shape)"));
    }
    let found = match plugin.get("radiance") {
        Some(source) if source.tag() == "texture" => match textures::read(&source, 0)? {
            Texture::Constant(value) => (value.max(Spectrum::ZERO), None),
            texture => (texture.mean().max(Spectrum::ZERO), Some(Arc::new(texture))),
        },
        _ => (plugin.emission("radiance")?.map_or(Spectrum::ONE, |(value, _)| value), None),
    };
    plugin.finish()?;
    Ok(found)
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
        "cylinder" => cylinder(plugin, &to_world),
        "linearcurve" | "bsplinecurve" => {
            let (file, source) = plugin.path("filename")?;
            let mesh = Mesh::read_curves(&file, plugin.kind == "bsplinecurve", &to_world);
            Ok(Geometry::Mesh(mesh.map_err(|e| source.data_error(&e))?))
        }
        // Of pbrt.
        "mesh" => match plugin.inline()? {
            Some(Inline::Mesh(mesh)) => {
                let file = plugin.element.context.tree.file(plugin.element.node);
                let mesh = mesh.clone().transformed(&to_world, file).map_err(|e| plugin.element.data_error(&e))?;
                Ok(Geometry::Mesh(mesh))
            }
            _ => Err(plugin.unknown_type(KNOWN)),
        },
        "ply" | "obj" | "serialized" => {
            let (file, source) = plugin.path("filename")?;
            let is_flat = plugin.boolean("face_normals", false)?;
            // Each format has its own idea of what is up.
            let flips = plugin.boolean("flip_tex_coords", plugin.kind == "obj")? != (plugin.kind == "obj");
            let mesh = match plugin.kind.as_str() {
                "ply" => Mesh::read_ply(&file),
                "obj" => Mesh::read_obj(&file),
                _ => Mesh::read_serialized(&file, plugin.integer("shape_index", 0, 0..=i64::from(u32::MAX))? as usize),
            };
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
        _ => Err(plugin.unknown_type(KNOWN)),
    }
}

/// Around the line between two points.
fn cylinder(plugin: &Plugin<'_>, to_world: &Transform) -> Result<Geometry, SceneError> {
    let from = plugin.point("p0")?.unwrap_or([0.0; 3]);
    let to = plugin.point("p1")?.unwrap_or([0.0, 0.0, 1.0]);
    let radius = plugin.positive("radius", 1.0)?;
    let axis = [0, 1, 2].map(|i| to[i] - from[i]);
    let along = normalized(axis).ok_or_else(|| plugin.element.error("p0 and p1 are the same point"))?;
    // Where angles begin: the frame of Duff et al. 2017, "Building an Orthonormal Basis, Revisited".
    let sign = if along[2] < 0.0 { -1.0 } else { 1.0 };
    let a = -1.0 / (sign + along[2]);
    let b = along[0] * along[1] * a;
    let x = [1.0 + sign * along[0] * along[0] * a, sign * b, -sign * along[0]];
    let y = [b, sign + along[1] * along[1] * a, -along[1]];
    let placed = Transform::from_columns(x.map(|c| c * radius), y.map(|c| c * radius), axis, from).then(to_world);
    if !placed.is_regular() {
        return Err(plugin.element.error("the cylinder is flattened, or beyond what can be computed with"));
    }
    Ok(Geometry::Cylinder(placed))
}
