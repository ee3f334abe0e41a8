//! `<film>` and `<rfilter>`.

use super::description::Sensor;
use super::element::Element;
use super::plugin::Plugin;
use crate::error::SceneError;
use crate::filter::Filter;

/// Most pixels along a side.
const MAX_SIDE: i64 = 65_536;
/// Most pixels in an image.
pub const MAX_PIXELS: u64 = 1 << 28;

/// Reads a film: size, what part of it is seen, and filter.
pub(super) fn read(element: &Element<'_>, sensor: &mut Sensor) -> Result<(), SceneError> {
    let plugin = Plugin::new(*element)?;
    if plugin.kind != "hdrfilm" {
        let error = plugin.unknown_type("hdrfilm");
        element.instead(error, "\"hdrfilm\" instead", || ())?;
    }
    let width = plugin.integer("width", 768, 1..=MAX_SIDE)?;
    let height = plugin.integer("height", 576, 1..=MAX_SIDE)?;
    if (width * height) as u64 > MAX_PIXELS {
        return Err(element.error(format!("{width} x {height} is more than {MAX_PIXELS} pixels")));
    }
    let crop = |offset: &str, size: &str, whole: i64| -> Result<[i64; 2], SceneError> {
        let low = plugin.integer(offset, 0, 0..=whole - 1)?;
        let size = plugin.integer(size, whole - low, 1..=whole - low)?;
        Ok([low, size])
    };
    let (x, y) = (crop("crop_offset_x", "crop_width", width)?, crop("crop_offset_y", "crop_height", height)?);
    let share = |value: i64, whole: i64| value as f64 / whole as f64;
    sensor.window =
        [[share(x[0], width), share(y[0], height)], [share(x[0] + x[1], width), share(y[0] + y[1], height)]];
    (sensor.width, sensor.height) = (x[1] as u32, y[1] as u32);
    // How Mitsuba would write its file; here the options of the program say that.
    plugin.skip(&["file_format", "component_format", "banner", "attach_log", "metadata", "high_quality_edges"]);
    // Samples beyond the border differ in noise only, and so does making up for filters that do not add up to 1.
    plugin.skip(&["sample_border", "compensate"]);
    if let Some((format, source)) = plugin.string("pixel_format")?
        && !["rgb", "rgba"].contains(&format.to_ascii_lowercase().as_str())
    {
        source.ignored(format!("\"{format}\": pictures are written in colour"));
    }
    plugin.ignore(&["exposure", "gamma", "tonemap_method", "key", "burn"], "PNG is written as sRGB (see --exposure)");
    sensor.filter = match plugin.nested("rfilter") {
        Some(filter) => read_filter(&filter)?,
        None => Filter::USUAL,
    };
    plugin.finish()
}

fn read_filter(element: &Element<'_>) -> Result<Filter, SceneError> {
    let plugin = Plugin::new(*element)?;
    // As wide as the film is too wide for a table, and far beyond what is any use.
    let width = |name: &str, usual: f64| plugin.number_in(name, usual, 0.01..=64.0);
    let filter = match plugin.kind.as_str() {
        "box" => Filter::Box { radius: width("radius", 0.5)? },
        "tent" => Filter::Tent { radius: width("radius", 1.0)? },
        "gaussian" => Filter::Gaussian { deviation: width("stddev", 0.5)? },
        "mitchell" => {
            let number = |name: &str| plugin.number_in(name, 1.0 / 3.0, -10.0..=10.0);
            Filter::Mitchell { b: number("A")?, c: number("B")? }
        }
        "catmullrom" => Filter::CATMULL_ROM,
        "lanczos" => Filter::Lanczos { radius: plugin.integer("lobes", 3, 1..=64)? as f64 },
        _ => {
            let error = plugin.unknown_type("box, tent, gaussian, mitchell, catmullrom, lanczos");
            return element.instead(error, "\"gaussian\" instead", || Filter::USUAL);
        }
    };
    plugin.finish()?;
    Ok(filter)
}
