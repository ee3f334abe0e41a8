//! `<sensor>` and `<integrator>`.

use super::description::{FovAxis, Integrator, Sensor};
use super::element::Element;
use super::plugin::Plugin;
use crate::error::SceneError;
use crate::transform::Transform;

/// Most pixels along a side.
const MAX_SIDE: i64 = 65_536;
/// Most pixels in an image.
pub const MAX_PIXELS: u64 = 1 << 28;

pub(super) fn read_integrator(element: &Element<'_>) -> Result<Integrator, SceneError> {
    let plugin = Plugin::new(*element)?;
    if !matches!(plugin.kind.as_str(), "path" | "volpath" | "volpathmis") {
        return Err(plugin.unknown_type("path, volpath, volpathmis"));
    }
    let max_depth = plugin.integer("max_depth", -1, -1..=1_000_000)?;
    if max_depth == 0 {
        return Err(element.error("max_depth 0 renders nothing; -1 is without limit"));
    }
    let rr_depth = plugin.integer("rr_depth", 5, 1..=1_000_000)?;
    let hide_emitters = plugin.boolean("hide_emitters", false)?;
    plugin.skip(&["block_size", "samples_per_pass", "timeout"]);
    plugin.finish()?;
    Ok(Integrator {
        max_depth: u32::try_from(max_depth).ok(),
        rr_depth: u32::try_from(rr_depth).unwrap_or(5),
        hide_emitters,
    })
}

/// The sensor, its element, and the `<medium>` it says it stands in.
pub(super) fn read<'a>(element: &Element<'a>) -> Result<(Sensor, Option<Element<'a>>), SceneError> {
    let plugin = Plugin::new(*element)?;
    if plugin.kind != "perspective" {
        return Err(plugin.unknown_type("perspective"));
    }
    let (fov, source) = plugin.number("fov")?.ok_or_else(|| element.error("<float name=\"fov\"> is missing"))?;
    if !(fov > 0.0 && fov < 180.0) {
        return Err(source.attribute_error("value", format!("field of view {fov} is outside (0, 180)")));
    }
    let fov_axis = match plugin.word("fov_axis", &["x", "y", "smaller", "larger", "diagonal"])? {
        "y" => FovAxis::Y,
        "smaller" => FovAxis::Smaller,
        "larger" => FovAxis::Larger,
        "diagonal" => FovAxis::Diagonal,
        _ => FovAxis::X,
    };
    let near = plugin.positive("near_clip", 1e-2)?;
    let far = plugin.positive("far_clip", 1e4)?;
    if far <= near {
        return Err(element.error(format!("far_clip {far} is not beyond near_clip {near}")));
    }
    let to_world = match plugin.to_world()? {
        Some((t, source)) if !t.is_rigid() => return Err(source.error("a camera cannot be scaled or sheared")),
        Some((t, _)) => t,
        None => Transform::IDENTITY,
    };
    let medium = match plugin.get("medium") {
        Some(medium) if medium.tag() == "medium" => Some(medium),
        Some(other) => return Err(other.wrong_tag("medium")),
        None => None,
    };
    // A pinhole has everything in focus, and nothing here moves.
    plugin.skip(&["focus_distance", "shutter_open", "shutter_close"]);
    let film = plugin.nested("film").ok_or_else(|| element.error("a <film> is missing"))?;
    let (width, height) = read_film(&film)?;
    let samples = match plugin.nested("sampler") {
        Some(sampler) => read_sampler(&sampler)?,
        None => 4,
    };
    plugin.finish()?;
    Ok((Sensor { fov, fov_axis, near, far, to_world, width, height, samples }, medium))
}

fn read_film(element: &Element<'_>) -> Result<(u32, u32), SceneError> {
    let plugin = Plugin::new(*element)?;
    if plugin.kind != "hdrfilm" {
        return Err(plugin.unknown_type("hdrfilm"));
    }
    let width = plugin.integer("width", 768, 1..=MAX_SIDE)?;
    let height = plugin.integer("height", 576, 1..=MAX_SIDE)?;
    if (width * height) as u64 > MAX_PIXELS {
        return Err(element.error(format!("{width} x {height} is more than {MAX_PIXELS} pixels")));
    }
    plugin.word("file_format", &["openexr", "exr", "pfm"])?;
    plugin.word("pixel_format", &["rgb", "rgba"])?;
    plugin.word("component_format", &["float16", "float32"])?;
    plugin.skip(&["banner", "attach_log", "high_quality_edges", "sample_border", "compensate"]);
    plugin
        .ignore(&["exposure", "gamma", "tonemap_method"], "pictures are written linear, PNG as sRGB (see --exposure)");
    let Some(filter) = plugin.nested("rfilter") else {
        return Err(element.error(
            "<rfilter type=\"box\"/> is missing: no other filter is supported, and Mitsuba's default is another",
        ));
    };
    let filter = Plugin::new(filter)?;
    if filter.kind != "box" {
        return Err(filter.unknown_type("box"));
    }
    filter.finish()?;
    plugin.finish()?;
    Ok((width as u32, height as u32))
}

fn read_sampler(element: &Element<'_>) -> Result<u32, SceneError> {
    let plugin = Plugin::new(*element)?;
    // They differ in noise, not in the image meant.
    if !matches!(plugin.kind.as_str(), "independent" | "stratified" | "multijitter" | "orthogonal" | "ldsampler") {
        return Err(plugin.unknown_type("independent, stratified, multijitter, orthogonal, ldsampler"));
    }
    let count = plugin.integer("sample_count", 4, 1..=1 << 30)?;
    plugin.integer("seed", 0, 0..=i64::from(u32::MAX))?;
    plugin.finish()?;
    Ok(count as u32)
}
