//! `<medium>`, `<volume>` and `<phase>`.

use std::path::Path;
use std::sync::Arc;

use fogbow::phase::{Lobe, Phase};
use fogbow::spectrum::Spectrum;

use super::description::Matter;
use super::element::Element;
use super::plugin::{Plugin, is_share};
use crate::error::SceneError;
use crate::transform::Transform;
use crate::vdb::{self, BrickStorage};
use crate::volume::Volume;

/// The matter of a `<medium>`.
pub(super) fn read(element: &Element<'_>) -> Result<Matter, SceneError> {
    let plugin = Plugin::new(*element)?;
    if !matches!(plugin.kind.as_str(), "homogeneous" | "heterogeneous") {
        return Err(plugin.unknown_type("homogeneous, heterogeneous"));
    }
    let scale = plugin.number_in("scale", 1.0, 0.0..=1e12)? as f32;
    plugin.boolean("sample_emitters", true)?;
    let phase = match plugin.nested("phase") {
        Some(phase) => read_phase(&phase, 0)?,
        None => Phase::ISOTROPIC,
    };
    let (field, absorption, scattering) = coefficients(&plugin, scale)?;
    plugin.finish()?;
    if !(absorption + scattering).is_finite() {
        return Err(element.error("extinction is not finite"));
    }
    Ok(match field {
        Field::Constant => Matter::Homogeneous { absorption, scattering, phase },
        Field::Grid { volume, to_world } => Matter::Grid { volume, to_world, absorption, scattering, phase },
        Field::Sparse { bricks, to_world } => Matter::Sparse { bricks, to_world, absorption, scattering, phase },
    })
}

/// How extinction varies.
enum Field {
    Constant,
    Grid { volume: Arc<Volume>, to_world: Transform },
    Sparse { bricks: Arc<BrickStorage>, to_world: Transform },
}

/// The field, and σₐ and σₛ where it is 1.
fn coefficients(plugin: &Plugin<'_>, scale: f32) -> Result<(Field, Spectrum, Spectrum), SceneError> {
    if let (Some((_, a)), Some((_, _))) = (plugin.colour("sigma_a")?, plugin.colour("sigma_s")?)
        && plugin.kind == "heterogeneous"
    {
        return Err(a.error("a heterogeneous medium takes sigma_t and albedo"));
    }
    match (plugin.colour("sigma_a")?, plugin.colour("sigma_s")?) {
        (Some((absorption, element)), Some((scattering, _))) => {
            if plugin.get("sigma_t").is_some() || plugin.get("albedo").is_some() {
                return Err(element.error("sigma_a and sigma_s cannot stand beside sigma_t or albedo"));
            }
            return Ok((Field::Constant, absorption * scale, scattering * scale));
        }
        (Some((_, element)), None) => return Err(element.error("sigma_a needs sigma_s beside it")),
        (None, Some((_, element))) => return Err(element.error("sigma_s needs sigma_a beside it")),
        (None, None) => {}
    }
    let albedo = match plugin.get("albedo") {
        Some(element) if element.tag() == "volume" => {
            let (value, source) = constant_volume(&element)?;
            is_share(value, &source)?
        }
        _ => plugin.share("albedo", Spectrum::splat(0.75))?,
    };
    let (field, extinction) = match plugin.get("sigma_t") {
        Some(element) if element.tag() == "volume" => {
            let volume = Plugin::new(element)?;
            match volume.kind.as_str() {
                "constvolume" => (Field::Constant, constant_volume(&element)?.0),
                "gridvolume" if plugin.kind == "homogeneous" => {
                    return Err(element.error("a homogeneous medium cannot hold a grid"));
                }
                "gridvolume" => (grid_volume(&volume)?, Spectrum::ONE),
                _ => return Err(volume.unknown_type("gridvolume, constvolume")),
            }
        }
        _ => (Field::Constant, plugin.colour("sigma_t")?.map_or(Spectrum::ONE, |(value, _)| value)),
    };
    let extinction = extinction * scale;
    let scattering = extinction * albedo;
    Ok((field, (extinction - scattering).max(Spectrum::ZERO), scattering))
}

fn constant_volume<'a>(element: &Element<'a>) -> Result<(Spectrum, Element<'a>), SceneError> {
    let plugin = Plugin::new(*element)?;
    if plugin.kind != "constvolume" {
        return Err(plugin.unknown_type("constvolume"));
    }
    let value = plugin.colour("value")?.ok_or_else(|| element.error("\"value\" is missing"))?;
    plugin.finish()?;
    Ok(value)
}

fn grid_volume(plugin: &Plugin<'_>) -> Result<Field, SceneError> {
    plugin.word("filter_type", &["trilinear"])?;
    plugin.word("wrap_mode", &["clamp"])?;
    plugin.boolean("raw", true)?;
    plugin.boolean("accel", true)?;
    let (file, source) = plugin.path("filename")?;
    if vdb::is_named(&file) {
        return sparse_volume(plugin, &file, &source);
    }
    if plugin.boolean("use_grid_bbox", false)? {
        return Err(plugin.element.error("use_grid_bbox is not supported: place the grid with to_world"));
    }
    let to_world = plugin.to_world()?.map_or(Transform::IDENTITY, |(t, _)| t);
    plugin.finish()?;
    let volume = Volume::read(&file).map_err(|e| source.data_error(&e))?;
    Ok(Field::Grid { volume: Arc::new(volume), to_world })
}

/// An OpenVDB or NanoVDB file: as a grid of the box of its active voxels, or with `use_grid_bbox` where the file itself says.
fn sparse_volume(plugin: &Plugin<'_>, file: &Path, source: &Element<'_>) -> Result<Field, SceneError> {
    let name = plugin.string("grid")?.map(|(name, _)| name);
    let is_in_file = plugin.boolean("use_grid_bbox", false)?;
    let to_world = plugin.to_world()?.map_or(Transform::IDENTITY, |(t, _)| t);
    plugin.finish()?;
    let bricks = vdb::Grid::read(file, name.as_deref()).and_then(|grid| grid.into_bricks(file));
    let bricks = bricks.map_err(|e| source.data_error(&e))?;
    let place = if is_in_file { bricks.in_file() } else { bricks.in_active_box() };
    let to_world = place.then(&to_world);
    Ok(Field::Sparse { bricks: Arc::new(bricks), to_world })
}

/// Blends within blends, and no further.
const MAX_BLENDS: u32 = 4;

fn read_phase(element: &Element<'_>, depth: u32) -> Result<Phase, SceneError> {
    let plugin = Plugin::new(*element)?;
    let phase = match plugin.kind.as_str() {
        "isotropic" => Phase::ISOTROPIC,
        "rayleigh" => Phase::from(Lobe::Rayleigh),
        "hg" => {
            let (g, source) = match plugin.number("g")? {
                Some((g, source)) => (g as f32, source),
                None => (0.8, *element),
            };
            let lobe = Lobe::HenyeyGreenstein { g }.check();
            Phase::from(lobe.map_err(|e| source.attribute_error("value", e))?)
        }
        "blendphase" => {
            if depth >= MAX_BLENDS {
                return Err(element.error(format!("blends are nested more than {MAX_BLENDS} deep")));
            }
            let weight = plugin.number_in("weight", 0.5, 0.0..=1.0)? as f32;
            let part = || match plugin.nested("phase") {
                Some(phase) => read_phase(&phase, depth + 1),
                None => Err(element.error("a blend needs two <phase> inside")),
            };
            let parts = [(Spectrum::splat(1.0 - weight), part()?), (Spectrum::splat(weight), part()?)];
            Phase::mix(parts).map_err(|e| element.error(e))?
        }
        _ => return Err(plugin.unknown_type("isotropic, hg, rayleigh, blendphase")),
    };
    plugin.finish()?;
    Ok(phase)
}
