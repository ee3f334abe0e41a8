//! `<emitter>` outside shapes.

use fogbow::spectrum::Spectrum;

use super::description::Emitter;
use super::element::Element;
use super::plugin::Plugin;
use crate::error::SceneError;
use crate::picture::Picture;
use crate::transform::{Transform, normalized};

const KNOWN: &str = "point, spot, directional, constant, envmap; area inside a shape";

/// An emitter; none where it is left out by the user's leave.
pub(super) fn read(element: &Element<'_>) -> Result<Option<Emitter>, SceneError> {
    let plugin = Plugin::new(*element)?;
    // How often it is chosen among lights changes noise only.
    plugin.skip(&["sampling_weight"]);
    let emitter = match plugin.kind.as_str() {
        "point" => {
            let to_world = plugin.to_world()?;
            let position = plugin.point("position")?;
            let position = match (position, to_world) {
                (Some(_), Some((_, source))) => return Err(source.error("cannot stand beside \"position\"")),
                (Some(position), None) => position,
                (None, Some((t, _))) => t.column(3),
                (None, None) => [0.0; 3],
            };
            Emitter::Point { position, intensity: strength(&plugin, "intensity")? }
        }
        "spot" => {
            let to_world = plugin.to_world()?.map_or(Transform::IDENTITY, |(t, _)| t);
            let cutoff = plugin.number_in("cutoff_angle", 20.0, 1e-3..=180.0)?;
            let beam = plugin.number_in("beam_width", cutoff * 0.75, 0.0..=cutoff)?;
            if let Some(texture) = plugin.get("texture") {
                let error = texture.error("a spot light cannot show a texture here");
                texture.instead(error, "without it", || ())?;
            }
            let axis = to_world.column(2);
            Emitter::Spot {
                position: to_world.column(3),
                axis,
                beam,
                cutoff,
                intensity: strength(&plugin, "intensity")?,
            }
        }
        "directional" => {
            let to_world = plugin.to_world()?;
            let direction = match (plugin.point("direction")?, to_world) {
                (Some(_), Some((_, source))) => return Err(source.error("cannot stand beside \"direction\"")),
                (Some(direction), None) => direction,
                (None, Some((t, _))) => t.column(2),
                (None, None) => [0.0, 0.0, 1.0],
            };
            let direction = normalized(direction).ok_or_else(|| element.error("\"direction\" has no length"))?;
            Emitter::Directional { direction, irradiance: strength(&plugin, "irradiance")? }
        }
        "constant" => Emitter::Constant { radiance: strength(&plugin, "radiance")? },
        "envmap" => environment(&plugin)?,
        "area" => {
            element.suspicious("no shape refers to it: an area light must stand inside a shape");
            return Ok(None);
        }
        "projector" | "directionalarea" | "sky" | "sunsky" | "sun" | "timed_sunsky" => {
            let reason = format!("\"{}\" cannot be rendered here yet; known here: {KNOWN}", plugin.kind);
            return element.instead(element.attribute_error("type", reason), "left out", || None);
        }
        _ => return element.instead(plugin.unknown_type(KNOWN), "left out", || None),
    };
    plugin.finish()?;
    Ok(Some(emitter))
}

fn strength(plugin: &Plugin<'_>, name: &str) -> Result<Spectrum, SceneError> {
    Ok(plugin.emission(name)?.map_or(Spectrum::ONE, |(value, _)| value))
}

fn environment(plugin: &Plugin<'_>) -> Result<Emitter, SceneError> {
    let scale = plugin.number_in("scale", 1.0, 0.0..=1e12)? as f32;
    // How Mitsuba samples it.
    plugin.skip(&["mis_compensation", "sampling_weight"]);
    let to_world = match plugin.to_world()? {
        Some((t, source)) if !t.is_rigid() || t.determinant() < 0.0 => {
            return Err(source.error("an environment can be rotated only"));
        }
        Some((t, _)) => t,
        None => Transform::IDENTITY,
    };
    let (file, source) = plugin.path("filename")?;
    let mut picture = Picture::read(&file).map_err(|e| source.data_error(&e))?;
    if picture.width < 2 || picture.height < 2 {
        return Err(source.attribute_error("value", "an environment needs at least 2 x 2 pixels"));
    }
    for (index, texel) in picture.pixels.iter_mut().enumerate() {
        *texel = texel.map(|c| c * scale);
        if let Some(bad) = texel.iter().find(|c| !(c.is_finite() && **c >= 0.0)) {
            let (x, y) = (index % picture.width, index / picture.width);
            return Err(source.attribute_error("value", format!("radiance {bad} at pixel ({x}, {y})")));
        }
    }
    Ok(Emitter::Environment { picture, to_world })
}
