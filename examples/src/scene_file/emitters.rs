//! `<emitter>` outside shapes.

use std::sync::Arc;

use fogbow::spectrum::Spectrum;

use super::description::{Emitter, FovAxis, Sensor};
use super::element::Element;
use super::plugin::Plugin;
use super::tree::Inline;
use super::{sensor, textures};
use crate::error::SceneError;
use crate::picture::Picture;
use crate::texture::Texture;
use crate::transform::{Transform, dot, normalized};

const KNOWN: &str = "point, spot, projector, directional, constant, envmap; area inside a shape";

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
            let axis = to_world.column(2);
            if let Some((texture, source)) = textures::property(&plugin, "texture")? {
                if !(cutoff < 89.0) {
                    return Err(source.error("a spot that shows a texture needs a cutoff_angle below 89 degrees"));
                }
                let half = cutoff.to_radians().tan();
                let shown = Shown { texture, source, half: [half; 2], cone: Some([beam, cutoff]) };
                let emitter = shown.emitter(&to_world, [1.0, 1.0], strength(&plugin, "intensity")?)?;
                plugin.finish()?;
                return Ok(Some(emitter));
            }
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
        "projector" => projector(&plugin)?,
        "directionalarea" | "sky" | "sunsky" | "sun" | "timed_sunsky" => {
            let reason = format!("\"{}\" cannot be rendered here yet; known here: {KNOWN}", plugin.kind);
            return element.instead(element.attribute_error("type", reason), "left out", || None);
        }
        _ => return element.instead(plugin.unknown_type(KNOWN), "left out", || None),
    };
    plugin.finish()?;
    Ok(Some(emitter))
}

/// What a light throws.
struct Shown<'a> {
    texture: Texture,
    source: Element<'a>,
    half: [f64; 2],
    cone: Option<[f64; 2]>,
}

impl Shown<'_> {
    /// `signs` turn the picture's rows and columns to the axes of the light.
    fn emitter(self, to_world: &Transform, signs: [f64; 2], intensity: Spectrum) -> Result<Emitter, SceneError> {
        textures::check_attributes(&self.texture, None).map_err(|reason| self.source.error(reason))?;
        let along = |index: usize, sign: f64| normalized(to_world.column(index).map(|c| c * sign));
        let (Some(x), Some(y), Some(z)) = (along(0, signs[0]), along(1, signs[1]), along(2, 1.0)) else {
            return Err(self.source.error("the light's to_world has an axis without length"));
        };
        if [dot(x, y), dot(y, z), dot(z, x)].iter().any(|c| c.abs() > 1e-4) {
            return Err(self.source.error("a light that shows a picture cannot be sheared"));
        }
        let to_world = Transform::from_columns(x, y, z, to_world.column(3));
        Ok(Emitter::Projector {
            to_world,
            half: self.half,
            cone: self.cone,
            texture: Arc::new(self.texture),
            intensity,
        })
    }
}

/// Angles of a cone that cuts nothing of a picture away.
const WHOLE: [f64; 2] = [90.0; 2];

/// `irradiance` is that on a screen one unit ahead, over π; pbrt's have `intensity` in place of it.
fn projector(plugin: &Plugin<'_>) -> Result<Emitter, SceneError> {
    let to_world = plugin.to_world()?.map_or(Transform::IDENTITY, |(t, _)| t);
    let intensity = textures::property(plugin, "intensity")?;
    let cone = intensity.as_ref().map(|_| WHOLE);
    let shown = match intensity {
        None => textures::property(plugin, "irradiance")?,
        found => found,
    };
    let (texture, source) = shown.unwrap_or((Texture::Constant(Spectrum::ONE), plugin.element));
    let [width, height] = match &texture {
        Texture::Bitmap { picture, .. } => [picture.width, picture.height].map(|n| n as f64),
        _ => [1.0; 2],
    };
    let mut camera = Sensor { width: width as u32, height: height as u32, ..Sensor::default() };
    sensor::field_of_view(plugin, &mut camera)?;
    let scale = plugin.number_in("scale", 1.0, 0.0..=1e12)? as f32;
    let tangent = (0.5 * camera.fov).to_radians().tan();
    let across = match camera.fov_axis {
        FovAxis::X => width,
        FovAxis::Y => height,
        FovAxis::Smaller => width.min(height),
        FovAxis::Larger => width.max(height),
        FovAxis::Diagonal => width.hypot(height),
    };
    let half = [tangent * width / across, tangent * height / across];
    let intensity = if cone.is_some() { scale } else { scale * std::f32::consts::PI };
    Shown { texture, source, half, cone }.emitter(&to_world, [-1.0, -1.0], Spectrum::splat(intensity))
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
    let (mut picture, source) = match plugin.inline()? {
        Some(Inline::Picture(picture)) => (picture.clone(), plugin.element),
        _ => {
            let (file, source) = plugin.path("filename")?;
            (Picture::read(&file).map_err(|e| source.data_error(&e))?, source)
        }
    };
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
