//! Reads glTF 2.0 (`.gltf`, `.glb`) into the same description as Mitsuba's scene files.
//!
//! | file | holds |
//! |---|---|
//! | `mod` | the scene: nodes, cameras, lights |
//! | `data` | buffers and accessors |
//! | `meshes` | triangles of primitives |
//! | `materials` | surfaces, textures, emission |
//! | `fog` | fog, which glTF has no words for, in a file beside it |
//!
//! Meters, +y up. Intensities are taken as they are: candela of point lights and spots as W/sr, lux as W/m², and `emissiveStrength`
//! (cd/m²) as radiance, so that pixels hold luminance in cd/m². Every surface is lit on both sides. What glTF says that has no effect
//! here is a note.

mod data;
mod fog;
mod materials;
mod meshes;

use std::path::{Path, PathBuf};

use ::gltf::camera::Projection;
use ::gltf::json;
use ::gltf::khr_lights_punctual::Kind;
use ::gltf::{Document, Node};
use fogbow::bytes::Crc;
use fogbow::math::Bounds;
use fogbow::spectrum::Spectrum;

use super::description::{Emitter, FovAxis, Integrator, Projection as View, SceneFile, Sensor};
use super::notes::{NoteKind, Sink};
use super::suspicions::of_medium;
use super::{Findings, ReadOptions};
use crate::error::{SceneError, read_file};
use crate::transform::{Transform, normalized};
use crate::world::bounds_of;
use data::Data;

/// Nodes within nodes, and no further.
const MAX_DEPTH: u32 = 64;

/// Most nodes that are visited: instances of instances grow quickly.
const MAX_NODES: usize = 1_000_000;

/// Pixels down, where glTF knows only a ratio; and across where it does not know even that.
const HEIGHT: u32 = 720;
const WIDTH: u32 = 1280;

/// Samples of a pixel.
const SAMPLES: u32 = 64;

/// Extensions that are read, or change only what has no effect here.
const KNOWN: [&str; 8] = [
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_transmission",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "KHR_materials_variants",
];

/// Whether a file's name is that of a glTF file.
pub(super) fn is_named(file: &Path) -> bool {
    file.extension().is_some_and(|e| e.eq_ignore_ascii_case("gltf") || e.eq_ignore_ascii_case("glb"))
}

/// Where and what of a file, for errors.
#[derive(Debug, Clone, Copy)]
pub(super) struct Source<'a> {
    file: &'a Path,
    sink: &'a Sink,
}

impl Source<'_> {
    fn error(&self, element: impl Into<String>, reason: impl Into<String>) -> SceneError {
        SceneError {
            file: self.file.to_owned(),
            element: element.into(),
            reason: reason.into(),
            ..SceneError::default()
        }
    }

    fn note(&self, kind: NoteKind, element: impl Into<String>, reason: impl Into<String>) {
        self.sink.note(kind, self.error(element, reason));
    }
}

/// The name of something, for errors: `mesh 3 "Wall"`.
fn label(kind: &str, index: usize, name: Option<&str>) -> String {
    name.map_or_else(|| format!("{kind} {index}"), |name| format!("{kind} {index} \"{name}\""))
}

pub(super) fn read(file: &Path, options: &ReadOptions) -> Findings {
    match read_file(file) {
        Ok(bytes) => from_bytes(file, &bytes, options),
        Err(e) => Findings {
            scene: None,
            errors: vec![SceneError { file: file.to_owned(), reason: e.reason, ..SceneError::default() }],
            notes: Vec::new(),
        },
    }
}

pub(super) fn from_bytes(file: &Path, bytes: &[u8], options: &ReadOptions) -> Findings {
    let sink = Sink::new(options.is_lenient);
    let scene = sink.keep(read_scene(&Source { file, sink: &sink }, bytes, options));
    let (notes, errors) = sink.into_parts();
    Findings { scene: scene.filter(|_| errors.is_empty()), errors, notes }
}

/// As of Mitsuba's scenes: of the file, of all it names and of the fog; what only a camera would change counts here.
pub(super) fn fingerprint(file: &Path, options: &ReadOptions) -> Result<u64, SceneError> {
    let sink = Sink::new(options.is_lenient);
    let source = Source { file, sink: &sink };
    let bytes = read_file(file).map_err(|e| source.error("", e.reason))?;
    let (document, blob) = document(&source, &bytes)?;
    let data = Data::read(&source, &document, blob)?;
    let mut crc = Crc::new();
    let mut add = |bytes: &[u8]| {
        crc.add(&(bytes.len() as u64).to_le_bytes());
        crc.add(bytes);
    };
    add(&bytes);
    data.each_file(&mut add);
    if let Some(file) = fog_file(file, options) {
        add(&read_file(&file).map_err(|e| source.error("", e.reason))?);
        fog::each_file(&file, &mut add);
    }
    Ok(crc.value())
}

/// Length of the header of a binary file.
const GLB_HEADER_BYTES: u32 = 12;

/// The document, checked, and the bytes that a binary file holds beside it.
fn document(source: &Source<'_>, bytes: &[u8]) -> Result<(Document, Option<Vec<u8>>), SceneError> {
    let broken = |e: ::gltf::Error| source.error("", format!("is not usable glTF: {e}"));
    let (text, blob) = if bytes.starts_with(b"glTF") {
        // The crate subtracts the header from the length that it names.
        let length =
            bytes.get(8..12).map_or(0, |length| u32::from_le_bytes([length[0], length[1], length[2], length[3]]));
        if length < GLB_HEADER_BYTES {
            return Err(source.error("", "is not usable glTF: the file ends within its header".to_owned()));
        }
        let parts = ::gltf::Glb::from_slice(bytes).map_err(broken)?;
        (parts.json, parts.bin.map(std::borrow::Cow::into_owned))
    } else {
        (bytes.into(), None)
    };
    let unusable = |e| source.error("", format!("is not usable glTF: {e}"));
    let mut value: json::Value = json::deserialize::from_slice(&text).map_err(unusable)?;
    // A scene may be empty, which the crate has not heard of.
    let scenes = value.get_mut("scenes").and_then(json::Value::as_array_mut).into_iter().flatten();
    for scene in scenes.filter_map(json::Value::as_object_mut) {
        scene.entry("nodes").or_insert_with(|| json::Value::Array(Vec::new()));
    }
    let mut root: json::Root = json::deserialize::from_value(value).map_err(unusable)?;
    let mut missing = Ok(());
    for name in core::mem::take(&mut root.extensions_required) {
        let is_material = name.starts_with("KHR_materials_");
        if KNOWN.contains(&name.as_str()) {
            continue;
        }
        let error = source.error(format!("extension {name}"), "is required, but not supported");
        // Other materials are still materials.
        let replaced = if is_material { source.sink.instead(error, "left out", || ()) } else { Err(error) };
        missing = missing.and(replaced);
    }
    missing?;
    // The check of the document takes this for granted.
    let attributes = root.meshes.iter().flat_map(|mesh| &mesh.primitives).flat_map(|p| p.attributes.values());
    if let Some(bad) = attributes.map(json::Index::value).find(|index| *index >= root.accessors.len()) {
        return Err(
            source.error("meshes", format!("accessor {bad} does not exist: there are {}", root.accessors.len()))
        );
    }
    for name in root.extensions_used.iter().filter(|name| !KNOWN.contains(&name.as_str())) {
        source.note(NoteKind::Ignored, format!("extension {name}"), "is not supported; what it says is left out");
    }
    Document::from_json(root).map(|document| (document, blob)).map_err(broken)
}

fn read_scene(source: &Source<'_>, bytes: &[u8], options: &ReadOptions) -> Result<SceneFile, SceneError> {
    if let Some((name, _)) = options.parameters.first() {
        return Err(source.error("", format!("glTF has no parameters: -D {name} cannot be set")));
    }
    let (document, blob) = document(source, bytes)?;
    let data = Data::read(source, &document, blob)?;
    let scene = document.default_scene().or_else(|| document.scenes().next());
    let scene = scene.ok_or_else(|| source.error("", "holds no scene"))?;
    let mut found = Found::default();
    for node in scene.nodes() {
        visit(source, &node, &Transform::IDENTITY, 0, &mut found)?;
    }
    if document.animations().len() > 0 {
        source.note(NoteKind::Ignored, "animations", "are not played: the scene stands as its nodes say");
    }
    let materials = materials::Materials::new(source, &document, &data);
    let (mut shapes, mut media) = (Vec::new(), Vec::new());
    for (mesh, to_world) in &found.meshes {
        meshes::read(source, mesh, to_world, &data, &materials, (&mut shapes, &mut media))?;
    }
    let emitters = found.lights.iter().map(|(light, to_world)| emitter(source, light, to_world));
    let mut scene_file = SceneFile {
        file: source.file.to_owned(),
        integrator: Integrator::default(),
        sensor: default_sensor(Bounds::EMPTY),
        media,
        shapes,
        emitters: emitters.collect::<Result<Vec<_>, _>>()?,
    };
    match fog_file(source.file, options) {
        Some(file) => fog::read(source.sink, &file, &mut scene_file),
        // A fog file that was there, or is called otherwise, is missed here.
        None if scene_file.media.is_empty() && !options.is_without_fog => {
            let name = beside(source.file);
            let name = name.file_name().unwrap_or_default().display();
            let reason =
                format!("holds no fog, and there is no {name} beside it: rendered without (--fog FILE names one)");
            source.note(NoteKind::Suspicious, "", reason);
        }
        None => {}
    }
    for reason in scene_file.media.iter().filter_map(of_medium) {
        source.note(NoteKind::Suspicious, "", reason);
    }
    let is_lit = !scene_file.emitters.is_empty() || scene_file.shapes.iter().any(|shape| shape.radiance.is_some());
    if !is_lit {
        let reason = "holds no lights: a white sky lights it (give one as [sky] in a fog file)";
        source.note(NoteKind::Suspicious, "", reason);
        scene_file.emitters.push(Emitter::Constant { radiance: Spectrum::ONE });
    }
    scene_file.sensor = sensor(source, &found, options, &scene_file)?;
    Ok(scene_file)
}

/// The file of fog that was named, or the one that lies beside the scene, if any is wanted. One that cannot be asked for counts as there, and is an error
/// when it is read.
fn fog_file(file: &Path, options: &ReadOptions) -> Option<PathBuf> {
    if options.is_without_fog {
        return None;
    }
    options.fog.clone().or_else(|| Some(beside(file)).filter(|file| file.try_exists().unwrap_or(true)))
}

/// Where the fog of a scene is looked for.
fn beside(scene: &Path) -> PathBuf {
    scene.with_extension("fog.toml")
}

/// What nodes of the scene hold, and where.
#[derive(Default)]
struct Found<'a> {
    nodes: usize,
    meshes: Vec<(::gltf::Mesh<'a>, Transform)>,
    lights: Vec<(::gltf::khr_lights_punctual::Light<'a>, Transform)>,
    cameras: Vec<(::gltf::Camera<'a>, Transform)>,
}

fn visit<'a>(
    source: &Source<'_>,
    node: &Node<'a>,
    parent: &Transform,
    depth: u32,
    found: &mut Found<'a>,
) -> Result<(), SceneError> {
    let error = |reason: &str| source.error(label("node", node.index(), node.name()), reason);
    found.nodes += 1;
    if depth > MAX_DEPTH || found.nodes > MAX_NODES {
        return Err(error("nodes lie within each other without end"));
    }
    let columns = node.transform().matrix();
    let rows = [0, 1, 2].map(|row| [0, 1, 2, 3].map(|column: usize| f64::from(columns[column][row])));
    let to_world = Transform { rows }.then(parent);
    if !to_world.rows.iter().flatten().all(|c| c.is_finite()) {
        return Err(error("its transform is not finite"));
    }
    if let Some(mesh) = node.mesh() {
        found.meshes.push((mesh, to_world));
        if node.skin().is_some() {
            source.note(NoteKind::Ignored, "skins", "are not applied: meshes stand as they were modelled");
        }
    }
    found.lights.extend(node.light().map(|light| (light, to_world)));
    found.cameras.extend(node.camera().map(|camera| (camera, to_world)));
    node.children().try_for_each(|child| visit(source, &child, &to_world, depth + 1, found))
}

fn emitter(
    source: &Source<'_>,
    light: &::gltf::khr_lights_punctual::Light<'_>,
    to_world: &Transform,
) -> Result<Emitter, SceneError> {
    let element = || label("light", light.index(), light.name());
    let strength = Spectrum(light.color()) * light.intensity();
    if !strength.is_valid() {
        return Err(source.error(element(), format!("its intensity {strength:?} is negative or not finite")));
    }
    if light.range().is_some() {
        source.note(NoteKind::Ignored, element(), "\"range\" has no effect: light falls with the square of distance");
    }
    let position = to_world.column(3);
    let axis = normalized(to_world.column(2).map(|c| -c)).ok_or_else(|| source.error(element(), "it looks nowhere"));
    Ok(match light.kind() {
        Kind::Point => Emitter::Point { position, intensity: strength },
        Kind::Directional => Emitter::Directional { direction: axis?, irradiance: strength },
        Kind::Spot { inner_cone_angle, outer_cone_angle } => {
            let cutoff = f64::from(outer_cone_angle).to_degrees();
            let beam = f64::from(inner_cone_angle).to_degrees().clamp(0.0, cutoff.max(0.0));
            if !(cutoff > 0.0 && cutoff <= 90.0) {
                return Err(source.error(element(), format!("its outer cone of {cutoff} degrees is outside (0, 90]")));
            }
            Emitter::Spot { position, axis: axis?, beam, cutoff, intensity: strength }
        }
    })
}

fn default_sensor(bounds: Bounds) -> Sensor {
    let (fov, size) = (40.0_f64, bounds.size());
    let centre = if size.is_finite() && size.max_element() > 0.0 { bounds.centre() } else { fogbow::math::Vec3::ZERO };
    let reach = if size.is_finite() { f64::from(0.5 * size.length()).max(1e-3) } else { 1.0 };
    let centre = crate::transform::to_array(centre);
    // From the front, a little from above and from the right.
    let distance = 1.1 * reach / (fov.to_radians() / 2.0).sin();
    let eye = [centre[0] + 0.35 * distance, centre[1] + 0.25 * distance, centre[2] + 0.9 * distance];
    let to_world = Transform::look_at(eye, centre, [0.0, 1.0, 0.0]).unwrap_or(Transform::IDENTITY);
    Sensor {
        fov,
        fov_axis: FovAxis::Y,
        near: 1e-3 * distance,
        far: f64::INFINITY,
        to_world,
        width: WIDTH,
        height: HEIGHT,
        samples: SAMPLES,
        ..Sensor::default()
    }
}

fn sensor(
    source: &Source<'_>,
    found: &Found<'_>,
    options: &ReadOptions,
    scene: &SceneFile,
) -> Result<Sensor, SceneError> {
    let shapes = scene.shapes.iter().map(|shape| bounds_of(&shape.geometry));
    let bounds = shapes.chain(scene.media.iter().flat_map(fog::bounds)).fold(Bounds::EMPTY, Bounds::union);
    let Some((camera, to_world)) = found.cameras.get(options.sensor) else {
        if !found.cameras.is_empty() || options.sensor > 0 {
            let reason = format!("camera {} of {}, counted from 0", options.sensor, found.cameras.len());
            return Err(source.error("cameras", reason));
        }
        source.note(NoteKind::Suspicious, "", "holds no camera: one is placed that sees all of it");
        return Ok(default_sensor(bounds));
    };
    let error = |reason: String| source.error(label("camera", camera.index(), camera.name()), reason);
    let (fov, aspect, near, half_width) = match camera.projection() {
        Projection::Perspective(lens) => {
            let aspect = f64::from(lens.aspect_ratio().unwrap_or(WIDTH as f32 / HEIGHT as f32));
            (f64::from(lens.yfov()).to_degrees(), aspect, lens.znear(), None)
        }
        Projection::Orthographic(lens) => {
            let (across, up) = (f64::from(lens.xmag()).abs(), f64::from(lens.ymag()).abs());
            (40.0, across / up, lens.znear(), Some(across))
        }
    };
    let near = f64::from(near).max(1e-9);
    let is_view = fov > 0.0 && fov < 180.0 && aspect > 1e-2 && aspect < 1e2 && near < 1e18;
    if !(is_view && half_width.is_none_or(|half| half > 1e-18 && half < 1e18)) {
        return Err(error(format!("an angle of {fov} degrees, with sides of ratio {aspect}, is not a view")));
    }
    // It looks along −z, and is not scaled with what it hangs on.
    let axis = |index: usize, sign: f64| normalized(to_world.column(index).map(|c| c * sign));
    let (Some(left), Some(up), Some(forward)) = (axis(0, -1.0), axis(1, 1.0), axis(2, -1.0)) else {
        return Err(error("its axes have no length".to_owned()));
    };
    let eye = to_world.column(3);
    let to_world = Transform::from_columns(left, up, forward, eye);
    if !to_world.is_rigid() {
        return Err(error("it is sheared".to_owned()));
    }
    let width = ((f64::from(HEIGHT) * aspect).round() as u32).max(1);
    let sensor = Sensor {
        fov,
        fov_axis: FovAxis::Y,
        near,
        // Nothing is cut off, wherever `--camera` puts it.
        far: f64::INFINITY,
        to_world,
        width,
        height: HEIGHT,
        samples: SAMPLES,
        ..Sensor::default()
    };
    Ok(match half_width {
        None => sensor,
        // What is seen is the image of two units across.
        Some(half) => Sensor {
            projection: View::Parallel,
            to_world: Transform::scaling([half, half, 1.0]).then(&to_world),
            ..sensor
        },
    })
}
