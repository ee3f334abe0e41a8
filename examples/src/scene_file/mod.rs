//! Reads the scene files of Mitsuba 3: a subset of version 3.0.0, with the same meaning.
//!
//! | element | types |
//! |---|---|
//! | `integrator` | `path`, `volpath`, `volpathmis`: `max_depth`, `rr_depth`, `hide_emitters` |
//! | `sensor` | `perspective`: `fov`, `fov_axis`, `near_clip`, `far_clip`, `to_world`, `<ref name="medium">` |
//! | `film` | `hdrfilm`: `width`, `height`; `rfilter` `box` |
//! | `sampler` | any of Mitsuba's: `sample_count` |
//! | `medium` | `homogeneous` (`sigma_t` and `albedo`, or `sigma_a` and `sigma_s`; `scale`), `heterogeneous` (`sigma_t` as `gridvolume` or `constvolume`) |
//! | `phase` | `isotropic`, `hg`, `rayleigh`, `blendphase` |
//! | `shape` | `rectangle`, `cube`, `sphere`, `disk`, `ply`, `obj` |
//! | `bsdf` | `diffuse`, `twosided`, `null`, `conductor` with material `none`, `dielectric`; and `phong`, which Mitsuba 3 does not know |
//! | `emitter` | `point`, `spot`, `area`, `directional`, `constant`, `envmap` |
//!
//! `<default name value>` with `$name`, `id` and `<ref>`, and all transforms are understood. A
//! medium fills the cube or sphere whose `interior` it is. Anything else is a [`SceneError`]:
//! nothing is skipped.

mod description;
mod element;
mod emitters;
mod fingerprint;
mod materials;
mod media;
mod places;
mod plugin;
mod sensor;
mod shapes;
mod transforms;

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

pub use description::{
    Container, Emitter, FovAxis, Geometry, Integrator, Material, Matter, MediumDescription, Place, SceneFile, Sensor,
    Shape,
};
pub use fingerprint::fingerprint;
pub use sensor::MAX_PIXELS;

use crate::error::{SceneError, read_file};
use element::{Context, Element};

/// Most elements and attributes of a file: far more than any scene written by hand or exported
/// with its meshes beside it.
const MAX_NODES: u32 = 2_000_000;

impl SceneFile {
    /// Reads a scene file and all files it names.
    ///
    /// # Errors
    /// The first thing that cannot be read or used.
    pub fn read(file: &Path) -> Result<Self, SceneError> {
        let whole = |reason: String| file_error(file, None, reason);
        let bytes = read_file(file).map_err(|e| whole(e.reason))?;
        let text = String::from_utf8(bytes).map_err(|e| whole(format!("is not UTF-8 text: {e}")))?;
        Self::parse(file, &text)
    }

    /// Reads a scene from the text of `file`.
    ///
    /// # Errors
    /// As [`SceneFile::read`].
    pub fn parse(file: &Path, text: &str) -> Result<Self, SceneError> {
        let document = document(file, text)?;
        let mut context = Context { file: file.to_owned(), defaults: BTreeMap::new(), ids: HashMap::new() };
        collect(&document, &mut context)?;
        read_scene(Element { node: document.root_element(), context: &context })
    }
}

fn document<'a>(file: &Path, text: &'a str) -> Result<roxmltree::Document<'a>, SceneError> {
    let options = roxmltree::ParsingOptions { nodes_limit: MAX_NODES, ..Default::default() };
    roxmltree::Document::parse_with_options(text, options)
        .map_err(|e| file_error(file, Some(e.pos().row), format!("is not well-formed XML: {e}")))
}

fn file_error(file: &Path, line: Option<u32>, reason: String) -> SceneError {
    SceneError { file: file.to_owned(), line, element: String::new(), attribute: None, reason }
}

/// Fills in ids and defaults, so that references may point forwards.
fn collect<'a>(document: &'a roxmltree::Document<'a>, context: &mut Context) -> Result<(), SceneError> {
    for node in document.descendants().filter(roxmltree::Node::is_element) {
        let element = |context| Element { node, context };
        if let Some(namespace) = node.tag_name().namespace() {
            return Err(element(context).error(format!("unknown namespace \"{namespace}\"")));
        }
        if node.has_tag_name("ref") {
            continue;
        }
        if let Some(id) = node.attribute("id") {
            if context.ids.contains_key(id) {
                return Err(element(context).attribute_error("id", format!("\"{id}\" is used twice")));
            }
            context.ids.insert(id.to_owned(), node.id());
        }
    }
    for node in document.root_element().children().filter(|n| n.has_tag_name("default")) {
        let element = Element { node, context };
        element.allow(&["name", "value"])?;
        element.no_children()?;
        let (name, value) = (element.required("name")?, element.required("value")?);
        if context.defaults.contains_key(&name) {
            return Err(element.attribute_error("name", format!("\"{name}\" is given twice")));
        }
        context.defaults.insert(name, value);
    }
    Ok(())
}

/// The element a `<ref>` points to, which must have the given tag.
fn lookup<'a>(reference: &Element<'a>, tag: &str) -> Result<Element<'a>, SceneError> {
    reference.allow(&["name", "id"])?;
    reference.no_children()?;
    let id = reference.required("id")?;
    let context = reference.context;
    let node = context.ids.get(&id).and_then(|id| reference.node.document().get_node(*id));
    let Some(node) = node else {
        return Err(reference.attribute_error("id", format!("nothing has the id \"{id}\"")));
    };
    if !node.has_tag_name(tag) {
        let found = node.tag_name().name();
        return Err(reference.attribute_error("id", format!("\"{id}\" is a <{found}> where a <{tag}> is due")));
    }
    Ok(Element { node, context })
}

fn read_scene(scene: Element<'_>) -> Result<SceneFile, SceneError> {
    if scene.tag() != "scene" {
        return Err(scene.error("the outermost element must be <scene>"));
    }
    scene.allow(&["version"])?;
    let version = scene.required("version")?;
    if !(version.starts_with("3.") || version.starts_with("2.")) {
        return Err(scene.attribute_error("version", format!("\"{version}\" is not known; 3.0.0 is")));
    }
    let (mut integrator, mut sensor) = (None, None);
    let (mut shapes, mut emitters, mut media) = (Vec::new(), Vec::new(), Vec::new());
    for child in scene.children()? {
        match child.tag() {
            "default" => {}
            "integrator" if integrator.is_none() => integrator = Some(sensor::read_integrator(&child)?),
            "sensor" if sensor.is_none() => sensor = Some((child, sensor::read(&child)?)),
            "integrator" | "sensor" => return Err(child.error("only one is supported")),
            "medium" => media.push(child),
            "shape" => shapes.push(shapes::read(&child)?),
            "bsdf" => drop(materials::read(&child)?),
            "emitter" => emitters.push(read_emitter(&child, &emitters)?),
            _ => return Err(child.error("unknown element inside <scene>")),
        }
    }
    let integrator = integrator.ok_or_else(|| scene.error("an <integrator> is missing"))?;
    let (sensor_element, (sensor, sensor_medium)) = sensor.ok_or_else(|| scene.error("a <sensor> is missing"))?;
    let media = places::read(&media, &shapes, &sensor, &sensor_element, sensor_medium)?;
    let shapes = shapes.into_iter().filter_map(|s| s.shape).collect();
    let scene_file = SceneFile { file: scene.context.file.clone(), integrator, sensor, media, shapes, emitters };
    places::check_far_plane(&scene_file, &sensor_element)?;
    Ok(scene_file)
}

fn read_emitter(element: &Element<'_>, others: &[Emitter]) -> Result<Emitter, SceneError> {
    let emitter = emitters::read(element)?;
    let is_around = |e: &Emitter| matches!(e, Emitter::Constant { .. } | Emitter::Environment { .. });
    if is_around(&emitter) && others.iter().any(is_around) {
        return Err(element.error("only one emitter can surround the scene"));
    }
    Ok(emitter)
}
