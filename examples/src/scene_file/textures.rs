//! `<texture>`.

use std::sync::Arc;

use fogbow::spectrum::Spectrum;

use super::element::Element;
use super::material::{Relief, ReliefForm};
use super::plugin::{Plugin, is_share};
use crate::error::SceneError;
use crate::mesh::Mesh;
use crate::picture::Picture;
use crate::texture::{Texture, ToUv, Wrap};
use crate::transform::Transform;
use crate::volume::Volume;

/// Textures within textures, and no further.
const MAX_DEPTH: u32 = 4;

/// A colour or texture of a plugin, and the element that holds it.
pub(super) fn property<'a>(plugin: &Plugin<'a>, name: &str) -> Result<Option<(Texture, Element<'a>)>, SceneError> {
    nested(plugin, name, 0)
}

/// A colour within [0, 1], or a texture, whose values are clamped to that when it is looked up: it goes to `found`, and its mean
/// stands for it.
pub(super) fn share<'a>(
    plugin: &Plugin<'a>,
    name: &str,
    default: Spectrum,
    found: &mut impl FnMut(Arc<Texture>),
) -> Result<Spectrum, SceneError> {
    match property(plugin, name)? {
        None => Ok(default),
        Some((Texture::Constant(value), element)) => is_share(value, &element),
        Some((texture, _)) => {
            let mean = texture.mean().max(Spectrum::ZERO).min(Spectrum::ONE);
            found(Arc::new(texture));
            Ok(mean)
        }
    }
}

/// What a `bumpmap` or `normalmap` does to normals; `None` for other types.
pub(super) fn relief(plugin: &Plugin<'_>) -> Result<Option<Relief>, SceneError> {
    let missing = || plugin.element.error("a <texture> is missing inside");
    let form = match plugin.kind.as_str() {
        "bumpmap" => {
            let scale = plugin.number_in("scale", 1.0, -1e6..=1e6)? as f32;
            let texture = read(&plugin.nested("texture").ok_or_else(missing)?, 0)?;
            ReliefForm::Height { texture: Arc::new(texture), scale }
        }
        "normalmap" => {
            let (texture, _) = property(plugin, "normalmap")?.ok_or_else(missing)?;
            ReliefForm::Normals(Arc::new(texture))
        }
        _ => return Ok(None),
    };
    let is_turned = plugin.boolean("flip_invalid_normals", true)?;
    if plugin.boolean("use_shadowing_function", true)? {
        let reason = "use_shadowing_function has no effect: where light grazes slopes they are up to a tenth brighter than with it";
        plugin.element.ignored(reason);
    }
    Ok(Some(Relief { form, is_turned }))
}

fn nested<'a>(plugin: &Plugin<'a>, name: &str, depth: u32) -> Result<Option<(Texture, Element<'a>)>, SceneError> {
    let Some(element) = plugin.get(name) else { return Ok(None) };
    let texture = match element.tag() {
        "texture" => read(&element, depth)?,
        _ => match plugin.colour(name)? {
            Some((value, _)) => Texture::Constant(value),
            None => return Ok(None),
        },
    };
    Ok(Some((texture, element)))
}

/// The texture of a `<texture>`.
pub(super) fn read(element: &Element<'_>, depth: u32) -> Result<Texture, SceneError> {
    if depth > MAX_DEPTH {
        return Err(element.error(format!("textures are nested more than {MAX_DEPTH} deep")));
    }
    let plugin = Plugin::new(*element)?;
    let texture = match plugin.kind.as_str() {
        "bitmap" => bitmap(&plugin)?,
        "checkerboard" => {
            let part = |name: &str, default: f32| -> Result<Texture, SceneError> {
                let found = nested(&plugin, name, depth + 1)?;
                Ok(found.map_or(Texture::Constant(Spectrum::splat(default)), |(texture, _)| texture))
            };
            let parts = Arc::new([part("color0", 0.4)?, part("color1", 0.2)?]);
            Texture::Checkerboard { parts, to_uv: to_uv(&plugin)? }
        }
        "mesh_attribute" => {
            let (name, source) = plugin.string("name")?.ok_or_else(|| element.error("\"name\" is missing"))?;
            if !(name.starts_with("vertex_") || name.starts_with("face_")) {
                return Err(source.attribute_error("value", "must begin with \"vertex_\" or \"face_\""));
            }
            let scale = plugin.number_in("scale", 1.0, -1e12..=1e12)? as f32;
            Texture::Attribute { name, scale }
        }
        "volume" => volume(&plugin)?,
        "uniform" | "rawconstant" => {
            let value = plugin.point_or_number("value")?.ok_or_else(|| element.error("\"value\" is missing"))?;
            Texture::Constant(value)
        }
        _ => return Err(plugin.unknown_type("bitmap, checkerboard, mesh_attribute, volume, uniform, rawconstant")),
    };
    plugin.finish()?;
    Ok(texture)
}

fn bitmap(plugin: &Plugin<'_>) -> Result<Texture, SceneError> {
    let wrap = match plugin.word("wrap_mode", &["repeat", "mirror", "clamp"])? {
        "mirror" => Wrap::Mirror,
        "clamp" => Wrap::Clamp,
        _ => Wrap::Repeat,
    };
    let is_smooth = plugin.word("filter_type", &["bilinear", "nearest"])? == "bilinear";
    plugin.word("format", &["auto", "variant", "float16", "fp16", "uint8"])?;
    plugin.boolean("accel", true)?;
    let is_raw = plugin.boolean("raw", false)?;
    let to_uv = to_uv(plugin)?;
    let (file, source) = plugin.path("filename")?;
    let picture = if is_raw { Picture::read_raw(&file) } else { Picture::read(&file) };
    let picture = picture.map_err(|e| source.data_error(&e))?;
    if let Some(at) = picture.pixels.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
        let (x, y) = (at % picture.width, at / picture.width);
        return Err(source.attribute_error("value", format!("pixel ({x}, {y}) is not finite")));
    }
    Ok(Texture::Bitmap { picture: Arc::new(picture), wrap, is_smooth, to_uv })
}

/// The part of a transform that maps texture coordinates: as Mitsuba takes it, rows and columns of z are ignored.
fn to_uv(plugin: &Plugin<'_>) -> Result<ToUv, SceneError> {
    let Some(transform) = plugin.transform("to_uv")? else { return Ok(ToUv::IDENTITY) };
    let row = |i: usize| [transform.rows[i][0] as f32, transform.rows[i][1] as f32, transform.rows[i][3] as f32];
    Ok(ToUv { rows: [row(0), row(1)] })
}

fn volume(plugin: &Plugin<'_>) -> Result<Texture, SceneError> {
    let element = plugin.nested("volume").ok_or_else(|| plugin.element.error("a <volume> is missing inside"))?;
    let inner = Plugin::new(element)?;
    let texture = match inner.kind.as_str() {
        "constvolume" => {
            let (value, _) = inner.colour("value")?.ok_or_else(|| element.error("\"value\" is missing"))?;
            Texture::Constant(value)
        }
        "gridvolume" => {
            inner.word("filter_type", &["trilinear"])?;
            inner.word("wrap_mode", &["clamp"])?;
            inner.boolean("raw", true)?;
            inner.boolean("accel", true)?;
            let (file, source) = inner.path("filename")?;
            let to_world = inner.to_world()?.map_or(Transform::IDENTITY, |(t, _)| t);
            let to_local = to_world.inverse().ok_or_else(|| element.error("its transform cannot be undone"))?;
            let volume = Volume::read(&file).map_err(|e| source.data_error(&e))?;
            Texture::Grid { volume: Arc::new(volume), to_local }
        }
        _ => return Err(inner.unknown_type("gridvolume, constvolume")),
    };
    inner.finish()?;
    Ok(texture)
}

/// # Errors
/// An attribute that the mesh does not have, in words.
pub(super) fn check_attributes(texture: &Texture, mesh: Option<&Mesh>) -> Result<(), String> {
    match texture {
        Texture::Attribute { name, .. } => {
            let known: Vec<&str> = mesh.iter().flat_map(|m| &m.attributes).map(|a| a.name.as_str()).collect();
            if known.contains(&name.as_str()) {
                return Ok(());
            }
            let there = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
            Err(format!("its bsdf wants the mesh attribute \"{name}\", but there is {there}"))
        }
        Texture::Checkerboard { parts, .. } => parts.iter().try_for_each(|part| check_attributes(part, mesh)),
        Texture::Scaled(inner, _) => check_attributes(inner, mesh),
        Texture::Constant(_) | Texture::Bitmap { .. } | Texture::Grid { .. } => Ok(()),
    }
}
