//! `<sensor>`, `<sampler>` and `<integrator>`.

use super::description::{FovAxis, Integrator, Projection, Sensor, Shape};
use super::element::Element;
use super::film;
use super::plugin::Plugin;
use crate::error::SceneError;
use crate::transform::Transform;
use crate::world::bounds_of;

/// Integrators that mean the picture that paths make, and differ in how they find it.
const PATHS: [&str; 3] = ["path", "volpath", "volpathmis"];
/// The same for those whose purpose is another, or that are not in Mitsuba 3.
const ALIKE: [&str; 15] = [
    "ptracer",
    "prb",
    "prb_basic",
    "prbvolpath",
    "prb_volpath",
    "prb_projective",
    "bdpt",
    "mlt",
    "pssmlt",
    "erpt",
    "photonmapper",
    "ppm",
    "sppm",
    "vpl",
    "adaptive",
];
const KNOWN_INTEGRATORS: &str =
    "path, volpath, volpathmis, direct, ptracer, prb, prbvolpath; moment, aov and stokes around these";

/// Whether Mitsuba's integrator of that name knows no media: a picture by it shows none.
pub(super) fn ignores_media(element: &Element<'_>) -> bool {
    let Ok(plugin) = Plugin::new(*element) else { return false };
    match plugin.nested("integrator") {
        Some(inner) => ignores_media(&inner),
        None => matches!(plugin.kind.as_str(), "path" | "direct" | "ptracer" | "prb"),
    }
}

pub(super) fn read_integrator(element: &Element<'_>) -> Result<Integrator, SceneError> {
    let plugin = Plugin::new(*element)?;
    let kind = plugin.kind.as_str();
    let inner = plugin.nested("integrator");
    if let "moment" | "aov" | "stokes" | "multichannel" = kind {
        let what = match kind {
            "moment" => "moments of samples are not written",
            "stokes" => "light has no polarisation here",
            _ => "its channels are not written; --aov writes the components of light",
        };
        element.ignored(format!("{kind}: {what}"));
        plugin.skip(&["aovs"]);
        let inner = inner.map_or_else(|| Ok(Integrator::default()), |inner| read_integrator(&inner));
        plugin.finish()?;
        return inner;
    }
    plugin.skip(&["block_size", "samples_per_pass", "timeout", "strict_normals", "use_nee", "unidirectional"]);
    let mut integrator = Integrator { hide_emitters: plugin.boolean("hide_emitters", false)?, ..Integrator::default() };
    match kind {
        "direct" | "direct_projective" => {
            integrator.max_depth = Some(2);
            plugin.skip(&["shading_samples", "emitter_samples", "bsdf_samples", "luminaire_samples"]);
            plugin.finish()?;
            return Ok(integrator);
        }
        _ if PATHS.contains(&kind) => {}
        _ if ALIKE.contains(&kind) => element.ignored(format!("\"{kind}\" means the picture that \"volpath\" makes")),
        _ => {
            let error = plugin.unknown_type(KNOWN_INTEGRATORS);
            return element.instead(error, "\"volpath\" instead", Integrator::default);
        }
    }
    let max_depth = plugin.integer("max_depth", -1, -1..=1_000_000)?;
    if max_depth == 0 {
        return Err(element.error("max_depth 0 renders nothing; -1 is without limit"));
    }
    integrator.max_depth = u32::try_from(max_depth).ok();
    integrator.rr_depth = u32::try_from(plugin.integer("rr_depth", 5, 1..=1_000_000)?).unwrap_or(5);
    if ALIKE.contains(&kind) {
        // What else they have serves their own way of finding the picture.
        plugin.skip_rest();
    }
    plugin.finish()?;
    Ok(integrator)
}

/// The sensor, and the `<medium>` it says it stands in.
pub(super) fn read<'a>(element: &Element<'a>) -> Result<(Sensor, Option<Element<'a>>), SceneError> {
    let plugin = Plugin::new(*element)?;
    let mut sensor = Sensor::default();
    if !matches!(plugin.kind.as_str(), "perspective" | "thinlens" | "orthographic") {
        let error = plugin.unknown_type("perspective, thinlens, orthographic");
        element.instead(error, "a pinhole (\"perspective\") instead", || ())?;
    }
    let is_parallel = plugin.kind == "orthographic";
    sensor.to_world = match plugin.to_world()? {
        Some((t, source)) if is_parallel && !is_upright(&t) => {
            return Err(source.error("a camera cannot be sheared"));
        }
        Some((t, source)) if !is_parallel && !t.is_rigid() => {
            return Err(source.error("a camera cannot be scaled or sheared"));
        }
        Some((t, _)) => t,
        None => Transform::IDENTITY,
    };
    if is_parallel {
        sensor.projection = Projection::Parallel;
    } else {
        field_of_view(&plugin, &mut sensor)?;
    }
    if plugin.kind == "thinlens" {
        let radius = plugin.positive("aperture_radius", 1.0)?;
        if plugin.get("aperture_radius").is_none() {
            return Err(element.error("<float name=\"aperture_radius\"> is missing"));
        }
        sensor.projection = Projection::Lens { radius, focus: plugin.positive("focus_distance", 1e4)? };
    }
    sensor.near = plugin.positive("near_clip", 1e-2)?;
    sensor.far = plugin.positive("far_clip", 1e4)?;
    if sensor.far <= sensor.near {
        return Err(element.error(format!("far_clip {} is not beyond near_clip {}", sensor.far, sensor.near)));
    }
    let medium = match plugin.get("medium").or_else(|| plugin.nested("medium")) {
        Some(medium) if medium.tag() == "medium" => Some(medium),
        Some(other) => return Err(other.wrong_tag("medium")),
        None => None,
    };
    // A pinhole has everything in focus, and nothing here moves.
    plugin.skip(&["focus_distance", "shutter_open", "shutter_close"]);
    let shift = |name: &str| plugin.number_in(name, 0.0, -1e3..=1e3);
    let shift = [shift("principal_point_offset_x")?, shift("principal_point_offset_y")?];
    if let Some(film) = plugin.nested("film") {
        film::read(&film, &mut sensor)?;
    }
    sensor.window = sensor.window.map(|corner| [corner[0] + shift[0], corner[1] + shift[1]]);
    if let Some(sampler) = plugin.nested("sampler") {
        sensor.samples = read_sampler(&sampler)?;
    }
    plugin.finish()?;
    Ok((sensor, medium))
}

/// Whether axes stay at right angles.
fn is_upright(t: &Transform) -> bool {
    let unit = |i: usize| crate::transform::normalized(t.column(i)).unwrap_or_default();
    (0..3).all(|i| crate::transform::dot(unit(i), unit((i + 1) % 3)).abs() < 1e-4)
}

pub(super) fn field_of_view(plugin: &Plugin<'_>, sensor: &mut Sensor) -> Result<(), SceneError> {
    let length = plugin.string("focal_length")?;
    let angle = plugin.number("fov")?;
    match (angle, length) {
        (Some(_), Some((_, source))) => return Err(source.error("\"focal_length\" cannot stand beside \"fov\"")),
        (Some((fov, source)), None) => {
            if !(fov > 0.0 && fov < 180.0) {
                return Err(source.attribute_error("value", format!("field of view {fov} is outside (0, 180)")));
            }
            sensor.fov = fov;
            sensor.fov_axis = match plugin.word("fov_axis", &["x", "y", "smaller", "larger", "diagonal"])? {
                "y" => FovAxis::Y,
                "smaller" => FovAxis::Smaller,
                "larger" => FovAxis::Larger,
                "diagonal" => FovAxis::Diagonal,
                _ => FovAxis::X,
            };
        }
        (None, length) => {
            // Of a film of 36 mm × 24 mm, whose diagonal the angle spans.
            plugin.skip(&["fov_axis"]);
            sensor.fov_axis = FovAxis::Diagonal;
            if let Some((text, source)) = length {
                let millimetres: Option<f64> = text.trim().trim_end_matches("mm").trim().parse().ok();
                let millimetres = millimetres.filter(|f| *f > 1e-3 && *f < 1e6);
                let millimetres = millimetres.ok_or_else(|| {
                    source.attribute_error("value", format!("\"{text}\" is no length such as \"50mm\""))
                })?;
                sensor.fov = 2.0 * (36.0_f64.hypot(24.0) / (2.0 * millimetres)).atan().to_degrees();
            }
        }
    }
    Ok(())
}

/// The camera of Mitsuba for a scene without one: it sees all shapes, along +z.
pub(super) fn around<'s>(shapes: impl Iterator<Item = &'s Shape>) -> Sensor {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for shape in shapes {
        let bounds = bounds_of(&shape.geometry);
        for axis in 0..3 {
            low[axis] = low[axis].min(f64::from(bounds.min[axis]));
            high[axis] = high[axis].max(f64::from(bounds.max[axis]));
        }
    }
    let sensor = Sensor { fov: 45.0, fov_axis: FovAxis::X, ..Sensor::default() };
    let size = (0..3).map(|i| high[i] - low[i]).fold(0.0, f64::max);
    if !(size.is_finite() && size > 0.0) {
        return sensor;
    }
    let distance = size / (2.0 * 22.5_f64.to_radians().tan());
    let at = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), low[2] - distance];
    Sensor { near: distance / 100.0, far: 5.0 * size + distance, to_world: Transform::translation(at), ..sensor }
}

fn read_sampler(element: &Element<'_>) -> Result<u32, SceneError> {
    /// They differ in noise, not in the image meant.
    const KNOWN: [&str; 5] = ["independent", "stratified", "multijitter", "orthogonal", "ldsampler"];
    let plugin = Plugin::new(*element)?;
    if !KNOWN.contains(&plugin.kind.as_str()) {
        let error = plugin.unknown_type(&KNOWN.join(", "));
        element.instead(error, "\"independent\" instead", || ())?;
    }
    let count = plugin.integer("sample_count", 4, 1..=1 << 30)?;
    plugin.integer("seed", 0, 0..=i64::from(u32::MAX))?;
    plugin.skip(&["jitter", "strength", "dimension", "scramble", "sample_count_x", "sample_count_y"]);
    plugin.finish()?;
    Ok(count as u32)
}
