//! `<bsdf>`.

use std::sync::Arc;

use fogbow::spectrum::Spectrum;
use fogbow::surface::Surface;

use super::element::Element;
use super::material::{Material, Mix, Slot};
use super::plugin::Plugin;
use super::{bsdfs, textures};
use crate::error::SceneError;
use crate::texture::Texture;

const KNOWN: &str = "diffuse, twosided, bumpmap, normalmap, blendbsdf, mask, null, conductor, roughconductor, dielectric, \
    roughdielectric, thindielectric, plastic, roughplastic, principled, principledthin, phong";

/// What a shape without a `<bsdf>` reflects; one that shines reflects nothing.
pub(super) fn default_material(is_emitter: bool) -> Material {
    let reflectance = Spectrum::splat(if is_emitter { 0.0 } else { 0.5 });
    Material::plain(Surface::Lambert { reflectance })
}

/// The material of a `<bsdf>`.
pub(super) fn read(element: &Element<'_>) -> Result<Material, SceneError> {
    let plugin = Plugin::new(*element)?;
    if let Some(relief) = textures::relief(&plugin)? {
        let inner = plugin.nested("bsdf").ok_or_else(|| element.error("a <bsdf> is missing inside"))?;
        let material = read(&inner)?;
        plugin.finish()?;
        if material.relief.is_some() {
            return Err(inner.error("one relief on another is not supported"));
        }
        return Ok(Material { relief: Some(relief), ..material });
    }
    let material = if plugin.kind == "twosided" {
        let inner = plugin.nested("bsdf").ok_or_else(|| element.error("a <bsdf> is missing inside"))?;
        let one_side = |inner: &Element<'_>| {
            let material = read(inner)?;
            if material.transmits() {
                return Err(inner.error("light passes through it, so it cannot be made two-sided"));
            }
            if material.is_two_sided {
                return Err(inner.attribute_error("type", "a two-sided bsdf cannot stand inside another"));
            }
            Ok(Material { is_two_sided: true, ..material })
        };
        let front = one_side(&inner)?;
        match plugin.nested("bsdf") {
            None => front,
            Some(back) => {
                let back = one_side(&back)?;
                Material {
                    is_two_sided: true,
                    mix: Some(Arc::new(Mix::Sides([front.clone(), back]))),
                    ..Material::plain(front.surface)
                }
            }
        }
    } else if let "blendbsdf" | "mask" = plugin.kind.as_str() {
        blend(&plugin)?
    } else {
        let (surface, textures) = read_one(&plugin)?;
        Material { textures, ..Material::plain(surface) }
    };
    plugin.finish()?;
    Ok(material)
}

/// `blendbsdf` of two others, or `mask` of one other and nothing.
fn blend(plugin: &Plugin<'_>) -> Result<Material, SceneError> {
    let inner = || {
        let element = plugin.nested("bsdf").ok_or_else(|| plugin.element.error("a <bsdf> is missing inside"))?;
        read(&element)
    };
    let (name, parts) = if plugin.kind == "mask" {
        ("opacity", [Material::plain(Surface::Null), inner()?])
    } else {
        ("weight", [inner()?, inner()?])
    };
    let mut weight = None;
    let mean = textures::share(plugin, name, Spectrum::splat(0.5), &mut |texture| weight = Some(texture))?;
    let weight = weight.unwrap_or_else(|| Arc::new(Texture::Constant(mean)));
    let typical = parts.iter().rev().map(|part| part.surface).find(|surface| *surface != Surface::Null);
    Ok(Material {
        mix: Some(Arc::new(Mix::Blend { weight, parts })),
        ..Material::plain(typical.unwrap_or(Surface::Null))
    })
}

/// What varies over a surface.
type Textures = Vec<(Slot, Arc<Texture>)>;

fn read_one(plugin: &Plugin<'_>) -> Result<(Surface, Textures), SceneError> {
    let mut textures = Textures::new();
    let surface = read_surface(plugin, &mut textures)?;
    Ok((surface, textures))
}

fn read_surface(plugin: &Plugin<'_>, textures: &mut Textures) -> Result<Surface, SceneError> {
    // A colour, or a texture that goes into the slot.
    let mut share =
        |name: &str, default: Spectrum, slot| textures::share(plugin, name, default, &mut |t| textures.push((slot, t)));
    match plugin.kind.as_str() {
        "diffuse" => Ok(Surface::Lambert { reflectance: share("reflectance", Spectrum::splat(0.5), Slot::Diffuse)? }),
        "null" => Ok(Surface::Null),
        "dielectric" => {
            let inside = index_of_refraction(plugin, "int_ior", 1.5046)?;
            let outside = index_of_refraction(plugin, "ext_ior", 1.000_277)?;
            Ok(Surface::Dielectric {
                eta: (inside / outside) as f32,
                reflectance: share("specular_reflectance", Spectrum::ONE, Slot::Specular)?,
                transmittance: share("specular_transmittance", Spectrum::ONE, Slot::Transmitted)?,
            })
        }
        "phong" => {
            let diffuse = share("diffuse_reflectance", Spectrum::splat(0.5), Slot::Diffuse)?;
            let specular = share("specular_reflectance", Spectrum::splat(0.2), Slot::Specular)?;
            let exponent = plugin.number_in("exponent", 30.0, 0.0..=1e6)? as f32;
            if (diffuse + specular).max_element() > 1.0 + 1e-6 {
                return Err(plugin.element.error("diffuse_reflectance + specular_reflectance is above 1"));
            }
            Ok(Surface::Phong { diffuse, specular, exponent })
        }
        kind => match bsdfs::read(plugin, &mut share)? {
            Some(surface) => Ok(surface),
            None => Err(match bsdfs::reason(kind) {
                Some(reason) => plugin.element.attribute_error("type", reason),
                None => plugin.unknown_type(KNOWN),
            }),
        },
    }
}

/// An index of refraction as a number or the name of a substance.
pub(super) fn index_of_refraction(plugin: &Plugin<'_>, name: &str, default: f64) -> Result<f64, SceneError> {
    // Names and values of Mitsuba 3's table.
    const SUBSTANCES: [(&str, f64); 23] = [
        ("vacuum", 1.0),
        ("helium", 1.000_036),
        ("hydrogen", 1.000_132),
        ("air", 1.000_277),
        ("carbon dioxide", 1.000_45),
        ("water", 1.3330),
        ("acetone", 1.36),
        ("ethanol", 1.361),
        ("carbon tetrachloride", 1.461),
        ("glycerol", 1.4729),
        ("benzene", 1.501),
        ("silicone oil", 1.520_45),
        ("bromine", 1.661),
        ("water ice", 1.31),
        ("fused quartz", 1.458),
        ("acrylic glass", 1.49),
        ("bk7", 1.5046),
        ("pyrex", 1.470),
        ("polypropylene", 1.49),
        ("sodium chloride", 1.544),
        ("amber", 1.55),
        ("pet", 1.5750),
        ("diamond", 2.419),
    ];
    let is_named = plugin.get(name).is_some_and(|e| e.tag() == "string");
    if !is_named {
        return plugin.number_in(name, default, 0.1..=10.0);
    }
    let Some((substance, element)) = plugin.string(name)? else { return Ok(default) };
    SUBSTANCES.iter().find(|(known, _)| *known == substance).map(|(_, value)| *value).ok_or_else(|| {
        let names: Vec<_> = SUBSTANCES.iter().map(|(known, _)| *known).collect();
        element.attribute_error("value", format!("\"{substance}\" is none of: {}", names.join(", ")))
    })
}
