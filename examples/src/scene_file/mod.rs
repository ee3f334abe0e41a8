//! Reads the scene files of Mitsuba 3, a subset of version 3.0.0 with the same meaning; and glTF 2.0 and pbrt-v4, see below the table.
//!
//! | element | types |
//! |---|---|
//! | `integrator` | `path`, `volpath`, `volpathmis`: `max_depth`, `rr_depth`, `hide_emitters`; `direct`; those that find the same picture in other ways; inside `moment`, `aov`, `stokes` |
//! | `sensor` | `perspective`, `thinlens`, `orthographic`: field of view or focal length, clip planes, `to_world`, principal point, medium |
//! | `film` | `hdrfilm`: size, crop |
//! | `rfilter` | `box`, `tent`, `gaussian`, `mitchell`, `catmullrom`, `lanczos` |
//! | `sampler` | any of Mitsuba's: `sample_count` |
//! | `medium` | `homogeneous` (`sigma_t` and `albedo`, or `sigma_a` and `sigma_s`; `scale`), `heterogeneous` (`sigma_t` and `albedo` as `gridvolume` or `constvolume`) |
//! | `volume` | `gridvolume` (`.vol`; `.vdb` and `.nvdb` with `grid`, `use_grid_bbox`), `constvolume` |
//! | `phase` | `isotropic`, `hg`, `rayleigh`, `blendphase` |
//! | `shape` | `rectangle`, `cube`, `sphere`, `disk`, `cylinder`, `ply`, `obj`, `serialized`, `linearcurve`, `bsplinecurve` (tubes of triangles), `shapegroup`, `instance`, `merge` |
//! | `bsdf` | `diffuse`, `twosided`, `null`, `conductor`, `roughconductor`, `dielectric`, `roughdielectric`, `thindielectric`, `plastic`, `roughplastic`, `principled`, `principledthin`, `blendbsdf`, `mask`; and `phong`, which Mitsuba 3 does not know |
//! | `texture` | `bitmap`, `checkerboard`, `mesh_attribute`, `volume`, `uniform`, `rawconstant`: on reflectances, `area` (of rectangles and meshes), `spot`, `projector` |
//! | `spectrum` | a number, pairs of wavelength and value, `filename`; `uniform`, `d65`, `srgb`, `blackbody`, `regular`, `irregular` |
//! | `emitter` | `point`, `spot`, `projector`, `area`, `directional`, `constant`, `envmap` |
//!
//! `<include>`, `<path>`, `<default>` with `$name`, `<alias>`, `<ref>` to anything, and all transforms are understood; files of
//! version 0.6 are upgraded. A medium fills the closed shape whose `interior` it is. What has no effect here is a
//! [`Note`]; anything else is a [`SceneError`]: nothing is skipped in silence.
//!
//! Of glTF are read: nodes with their transforms, triangles with normals and one set of texture coordinates, perspective cameras, base
//! colour, alpha and emission (`KHR_materials_emissive_strength`), their textures (PNG, JPEG; `KHR_texture_transform`), metal, gloss and glass
//! (`KHR_materials_transmission`, `volume`, `ior`), and points, spots and suns of `KHR_lights_punctual`. Fog stands in a TOML file
//! beside the scene, `SCENE.fog.toml`: boxes, balls, height fog, grids, and a sky.
//!
//! Of pbrt-v4 are read: transforms, attributes, objects and their instances, included files; perspective, thin-lens and orthographic cameras;
//! spheres, disks, cylinders, triangle and bilinear meshes, PLY; diffuse, coated (as plastic), metal, glass and mixed materials; image and
//! checkerboard textures; point, spot, distant, infinite and area lights; media that are `homogeneous`, `uniformgrid`, `nanovdb` or a `cloud`.

mod bsdfs;
mod cie;
mod description;
mod element;
mod emitters;
mod film;
mod fingerprint;
mod gltf_scene;
mod groups;
mod material;
mod materials;
mod media;
mod metals;
mod notes;
mod pbrt;
mod places;
mod plugin;
mod preprocess;
mod sensor;
mod shapes;
mod spectra;
mod suspicions;
mod textures;
mod transforms;
mod tree;
mod upgrade;

use std::collections::HashSet;
use std::path::{Path, PathBuf};

pub use description::{
    Container, Emitter, Field, FovAxis, Geometry, Heat, Integrator, Matter, MediumDescription, Place, Projection,
    SceneFile, Sensor, Shape,
};
pub use film::MAX_PIXELS;
pub use fingerprint::{fingerprint, fingerprint_with};
pub use material::{Chosen, Material, Mix, Relief, ReliefForm, Slot};
pub use notes::{Note, NoteKind};

use crate::error::SceneError;
use element::{Context, Element};
use notes::Sink;

/// How a scene file is to be read.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ReadOptions {
    /// Values of parameters (`$name`), before those of `<default>`.
    pub parameters: Vec<(String, String)>,
    /// Which of several sensors, counted from 0.
    pub sensor: usize,
    /// Whether what is missing here may be replaced by the nearest there is.
    pub is_lenient: bool,
    /// Fog for a glTF scene, where it is not in the file beside it.
    pub fog: Option<PathBuf>,
    /// Whether a glTF scene has no fog, whatever lies beside it.
    pub is_without_fog: bool,
}

/// What was found in a scene file.
#[derive(Debug)]
pub struct Findings {
    /// The scene, if nothing is wrong with it.
    pub scene: Option<SceneFile>,
    /// All that keeps it from being used.
    pub errors: Vec<SceneError>,
    /// What a user should know of it all the same.
    pub notes: Vec<Note>,
}

impl SceneFile {
    /// Reads a scene file and all files it names.
    ///
    /// # Errors
    /// The first thing that cannot be read or used.
    pub fn read(file: &Path) -> Result<Self, SceneError> {
        Self::read_with(file, &ReadOptions::default()).into_scene()
    }

    /// Reads the bytes of a glTF scene, text or binary, and all files it names, as [`SceneFile::read_with`].
    #[must_use]
    pub fn from_gltf(file: &Path, bytes: &[u8], options: &ReadOptions) -> Findings {
        gltf_scene::from_bytes(file, bytes, options)
    }

    /// Reads the text of a pbrt scene and all files it names, as [`SceneFile::read_with`].
    #[must_use]
    pub fn from_pbrt(file: &Path, text: &str, options: &ReadOptions) -> Findings {
        pbrt::parse(file, text, options)
    }

    /// Reads a scene from the text of `file`.
    ///
    /// # Errors
    /// As [`SceneFile::read`].
    pub fn parse(file: &Path, text: &str) -> Result<Self, SceneError> {
        Self::parse_with(file, text, &ReadOptions::default()).into_scene()
    }

    /// Reads a scene file and all files it names, and goes on after errors to find them all.
    #[must_use]
    pub fn read_with(file: &Path, options: &ReadOptions) -> Findings {
        if gltf_scene::is_named(file) {
            return gltf_scene::read(file, options);
        }
        if options.fog.is_none() && pbrt::is_named(file) {
            return pbrt::read(file, options);
        }
        if options.fog.is_some() {
            let reason = "--fog is for glTF scenes; here fog is a <medium>".to_owned();
            let error = SceneError { file: file.to_owned(), reason, ..SceneError::default() };
            return Findings { scene: None, errors: vec![error], notes: Vec::new() };
        }
        match preprocess::text_of(file) {
            Ok(text) => Self::parse_with(file, &text, options),
            Err(error) => Findings { scene: None, errors: vec![error], notes: Vec::new() },
        }
    }

    /// Reads a scene from the text of `file`, as [`SceneFile::read_with`].
    #[must_use]
    pub fn parse_with(file: &Path, text: &str, options: &ReadOptions) -> Findings {
        let sink = Sink::new(options.is_lenient);
        let (scene, sink) = match preprocess::read(file, text, &options.parameters, &sink) {
            Ok(tree) => {
                let context = Context { tree, sink };
                let scene = context.sink.keep(read_scene(&Element::root(&context), options));
                (scene, context.sink)
            }
            Err(error) => {
                sink.error(error);
                (None, sink)
            }
        };
        let (notes, errors) = sink.into_parts();
        Findings { scene: scene.filter(|_| errors.is_empty()), errors, notes }
    }
}

impl Findings {
    /// # Errors
    /// The first thing that is wrong.
    pub fn into_scene(self) -> Result<SceneFile, SceneError> {
        match (self.scene, self.errors.into_iter().next()) {
            (Some(scene), _) => Ok(scene),
            (None, Some(error)) => Err(error),
            // Readers that return nothing leave an error behind.
            (None, None) => Err(SceneError { reason: "the scene was not read".to_owned(), ..SceneError::default() }),
        }
    }
}

/// Elements inside `<scene>`, as far as they mean something there.
const TOP_LEVEL: [&str; 9] =
    ["integrator", "sensor", "medium", "shape", "bsdf", "emitter", "texture", "volume", "phase"];

fn read_scene(scene: &Element<'_>, options: &ReadOptions) -> Result<SceneFile, SceneError> {
    scene.keep(scene.allow(&["version", "type", "id", "name"]));
    let is_referred_to = referred_to(scene);
    let (mut integrators, mut sensors) = (Vec::new(), Vec::new());
    let (mut shapes, mut emitters, mut media) = (Vec::new(), Vec::new(), Vec::new());
    let mut lamps = Vec::new();
    let mut groups = groups::Groups::default();
    for child in scene.children()? {
        match child.tag() {
            "integrator" => integrators.push(child),
            "sensor" => sensors.push(child),
            "medium" => media.push(child),
            "shape" => shapes.extend(
                child
                    .keep(child.or_instead(shapes::read(&child, &mut groups), "left out", Vec::new))
                    .into_iter()
                    .flatten(),
            ),
            // Those that are used are read where they are used.
            "bsdf" if !is_referred_to.contains(&child.node.id()) => {
                if let Err(error) = materials::read(&child) {
                    child.suspicious(format!("no shape uses it, and it could not be read: {}", error.reason));
                }
            }
            "emitter" if !is_referred_to.contains(&child.node.id()) => {
                if let Some(emitter) = child.keep(read_emitter(&child, &emitters)).flatten() {
                    emitters.push(emitter);
                    lamps.push(child);
                }
            }
            "bsdf" | "emitter" | "texture" | "volume" | "phase" | "sampler" | "film" | "rfilter" | "spectrum" => {}
            other => {
                let near = plugin::suggestion(other, TOP_LEVEL.into_iter());
                child.context.sink.error(child.error(format!("unknown element inside <scene>{near}")));
            }
        }
    }
    for further in integrators.iter().skip(1) {
        further.ignored("is one more: the first counts");
    }
    let integrator = match integrators.first() {
        Some(element) => element.keep(sensor::read_integrator(element)),
        None => Some(Integrator::default()),
    };
    let (sensor_element, (sensor, sensor_medium)) = match (sensors.get(options.sensor), sensors.len()) {
        (Some(element), _) => (*element, sensor::read(element)?),
        (None, 0) => {
            scene.suspicious("there is no <sensor>: the camera looks at everything along +z");
            (*scene, (sensor::around(shapes.iter().filter_map(|s| s.shape.as_ref())), None))
        }
        (None, count) => {
            let reason = format!("there is no sensor {}: it has {count}, counted from 0", options.sensor);
            return Err(scene.error(reason));
        }
    };
    let media = places::read(&media, &shapes, &sensor, &sensor_element, sensor_medium)?;
    if let Some(element) = integrators.first().filter(|element| !media.is_empty() && sensor::ignores_media(element)) {
        element.suspicious(
            "in Mitsuba it leaves out media, which are rendered here: \"volpath\" is the one that means them",
        );
    }
    let file = scene.context.tree.file(scene.node).to_owned();
    let integrator = integrator.unwrap_or_default();
    let mut scene_file = SceneFile { file, integrator, sensor, media, shapes: Vec::new(), emitters };
    suspicions::look(scene, &scene_file, &shapes, &lamps);
    scene_file.shapes = shapes.into_iter().filter_map(|s| s.shape).collect();
    if let Err(error) = places::check_far_plane(&scene_file, &sensor_element) {
        sensor_element.instead(error, "nothing is cut off", || ())?;
    }
    Ok(scene_file)
}

/// Elements that a `<ref>` leads to.
fn referred_to(scene: &Element<'_>) -> HashSet<tree::NodeId> {
    let tree = &scene.context.tree;
    let references = tree.nodes.iter().filter(|n| n.tag == "ref");
    references.filter_map(|n| tree.ids.get(n.attribute("id")?).copied()).collect()
}

/// The emitter; none where a user wants what cannot be rendered left out.
fn read_emitter(element: &Element<'_>, others: &[Emitter]) -> Result<Option<Emitter>, SceneError> {
    let Some(emitter) = emitters::read(element)? else { return Ok(None) };
    let is_around = |e: &Emitter| matches!(e, Emitter::Constant { .. } | Emitter::Environment { .. });
    if is_around(&emitter) && others.iter().any(is_around) {
        return Err(element.error("only one emitter can surround the scene"));
    }
    Ok(Some(emitter))
}
