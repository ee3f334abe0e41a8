//! Scenes of pbrt-v4: directives become the elements of a Mitsuba scene that means the same (decision 78), so whatever reads those reads both.
//!
//! | file | holds |
//! |---|---|
//! | `tokens` | words, parameters |
//! | `nodes` | writing elements |
//! | `cloud` | the procedural cloud, drawn on a grid |
//! | `materials`, `lights`, `shapes` | materials and textures, lights, shapes and media as elements |
//!
//! pbrt shows +x of its camera on the right, Mitsuba on the left. Brightness is that of pbrt's `cie1931` sensor: lights have the
//! luminance of their `scale`, other sensors' response and white balance are left out, with a note.

mod cloud;
mod lights;
mod materials;
mod nodes;
mod shapes;
mod tokens;

use std::collections::HashMap;
use std::path::Path;

use super::description::SceneFile;
use super::element::{Context, Element};
use super::notes::{NoteKind, Sink};
use super::preprocess::text_of;
use super::tree::NodeId;
use super::{Findings, ReadOptions, preprocess, read_scene};
use crate::error::SceneError;
use crate::transform::Transform;
use materials::Texture;
use nodes::Nodes;
use tokens::{Parameters, Token, Word, Words};

/// Files within files, and no further.
const MAX_DEPTH: u32 = 16;

/// Whether a file is one of pbrt, by its name.
pub(super) fn is_named(file: &Path) -> bool {
    file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("pbrt"))
}

/// What `AttributeBegin` keeps.
#[derive(Debug, Clone, Default)]
struct State {
    ctm: Transform,
    /// Kind and parameters, or the id of a named one.
    material: Option<Material>,
    area_light: Option<Parameters>,
    inside: String,
    outside: String,
    is_reversed: bool,
}

#[derive(Debug, Clone)]
enum Material {
    Of(String, Parameters),
    Named(String),
}

/// Reads directives.
#[derive(Debug)]
struct Reader<'s> {
    nodes: Nodes,
    sink: &'s Sink,
    state: State,
    stack: Vec<State>,
    systems: HashMap<String, Transform>,
    textures: HashMap<String, Texture>,
    /// Children of the scene.
    scene: Vec<NodeId>,
    /// The object that shapes go to: its name and they.
    object: Option<(String, Vec<NodeId>)>,
    camera: Option<(String, Parameters, State)>,
    film: Option<Parameters>,
    filter: Option<(String, Parameters)>,
    samples: f64,
    depth: f64,
    is_in_world: bool,
}

/// Reads a pbrt scene and all files it names.
pub(super) fn read(file: &Path, options: &ReadOptions) -> Findings {
    match text_of(file) {
        Ok(text) => parse(file, &text, options),
        Err(error) => Findings { scene: None, errors: vec![error], notes: Vec::new() },
    }
}

/// Reads a pbrt scene from the text of `file`.
pub(super) fn parse(file: &Path, text: &str, options: &ReadOptions) -> Findings {
    let sink = Sink::new(options.is_lenient);
    let mut reader = Reader {
        nodes: Nodes::default(),
        sink: &sink,
        state: State::default(),
        stack: Vec::new(),
        systems: HashMap::new(),
        textures: HashMap::new(),
        scene: Vec::new(),
        object: None,
        camera: None,
        film: None,
        filter: None,
        samples: 16.0,
        depth: 5.0,
        is_in_world: false,
    };
    let source = reader.nodes.file(file);
    (reader.nodes.source, reader.nodes.line) = (source, 1);
    // The first element is the scene.
    reader.nodes.node("scene", &[("version", "3.0.0")], Vec::new());
    let done = reader.run(text, 0);
    if done.is_ok() && !reader.is_in_world {
        reader.error("scene", "there is no WorldBegin");
    }
    let Reader { mut nodes, scene, .. } = reader;
    nodes.tree.node_mut(NodeId(0)).children = scene;
    let tree = nodes.tree;
    let checked = done.and_then(|()| preprocess::check_references(&tree, &sink));
    let context = Context { tree, sink };
    let scene: Option<SceneFile> = match checked {
        Ok(()) => context.sink.keep(read_scene(&Element::root(&context), options)),
        Err(error) => {
            context.sink.error(error);
            None
        }
    };
    let (notes, errors) = context.sink.into_parts();
    Findings { scene: scene.filter(|_| errors.is_empty()), errors, notes }
}

impl Reader<'_> {
    fn at(&self, element: &str, reason: impl Into<String>) -> SceneError {
        let file = self.nodes.tree.sources[self.nodes.source as usize].path.clone();
        let line = Some(self.nodes.line);
        SceneError { file, line, element: element.to_owned(), reason: reason.into(), ..SceneError::default() }
    }

    fn error(&self, element: &str, reason: impl Into<String>) {
        self.sink.error(self.at(element, reason));
    }

    fn note(&self, kind: NoteKind, element: &str, reason: impl Into<String>) {
        self.sink.note(kind, self.at(element, reason));
    }

    /// What is missing here: an error, or a note where the user allows the nearest there is.
    fn instead(&self, element: &str, reason: &str, nearest: &str) {
        if self.sink.is_lenient {
            self.note(NoteKind::Replaced, element, format!("{reason}: {nearest}"));
        } else {
            self.error(element, reason);
        }
    }

    /// Parameters that nothing asked for.
    fn finish(&self, element: &str, parameters: &Parameters) {
        for parameter in parameters.unused() {
            let reason = format!("\"{} {}\" has no effect here", parameter.kind, parameter.name);
            let place = SceneError { line: Some(parameter.line), ..self.at(element, reason) };
            self.sink.note(NoteKind::Ignored, place);
        }
    }

    /// All directives of a file. An error ends the reading where the rest cannot be told apart.
    fn run(&mut self, text: &str, depth: u32) -> Result<(), SceneError> {
        let mut words = Words::new(text);
        loop {
            self.nodes.line = words.line();
            let token = words.next().map_err(|reason| self.at("", reason))?;
            let Some(Token { word, line }) = token else { return Ok(()) };
            self.nodes.line = line;
            let Word::Bare(directive) = word else {
                return Err(self.at("", format!("{word:?} stands where a directive is due")));
            };
            self.directive(directive, &mut words, depth)?;
        }
    }

    fn directive(&mut self, directive: &str, words: &mut Words<'_>, depth: u32) -> Result<(), SceneError> {
        let fail = |reader: &Self, reason: String| reader.at(directive, reason);
        match directive {
            "WorldBegin" => self.world_begin(),
            "AttributeBegin" | "TransformBegin" => self.stack.push(self.state.clone()),
            "AttributeEnd" | "TransformEnd" => match self.stack.pop() {
                // Of version 3: the transform alone comes back.
                Some(state) if directive == "TransformEnd" => self.state.ctm = state.ctm,
                Some(state) => self.state = state,
                None => return Err(fail(self, "nothing was begun that could end".to_owned())),
            },
            "ReverseOrientation" => self.state.is_reversed = !self.state.is_reversed,
            "Identity" => self.state.ctm = Transform::IDENTITY,
            "Translate" | "Scale" | "Rotate" | "LookAt" | "Transform" | "ConcatTransform" => {
                let numbers = numbers(words, directive).map_err(|reason| fail(self, reason))?;
                let (moved, replaces) = moved(directive, &numbers).map_err(|reason| fail(self, reason))?;
                self.state.ctm = if replaces { moved } else { moved.then(&self.state.ctm) };
            }
            "CoordinateSystem" | "CoordSysTransform" | "NamedMaterial" | "Include" | "Import" | "ObjectBegin"
            | "ObjectInstance" => {
                let name = text(words).map_err(|reason| fail(self, reason))?;
                self.named(directive, &name, depth)?;
            }
            "ObjectEnd" => self.end_object(),
            "MediumInterface" => {
                self.state.inside = text(words).map_err(|reason| fail(self, reason))?;
                let is_pair = matches!(words.peek(), Ok(Some(Token { word: Word::Text(_), .. })));
                self.state.outside =
                    if is_pair { text(words).map_err(|reason| fail(self, reason))? } else { self.state.inside.clone() };
            }
            "Texture" => {
                let read = |words: &mut Words<'_>| Ok::<_, String>([text(words)?, text(words)?, text(words)?]);
                let [name, _, kind] = read(words).map_err(|reason| fail(self, reason))?;
                let parameters = Parameters::read(words).map_err(|reason| fail(self, reason))?;
                self.textures.insert(name, Texture { kind, parameters });
            }
            "Attribute" => {
                let target = text(words).map_err(|reason| fail(self, reason))?;
                Parameters::read(words).map_err(|reason| fail(self, reason))?;
                self.instead(directive, &format!("defaults for \"{target}\" are not supported"), "left out");
            }
            "ColorSpace" | "ActiveTransform" | "TransformTimes" => {
                while matches!(words.peek(), Ok(Some(Token { word: Word::Text(_) | Word::Number(_), .. }))) {
                    words.next().map_err(|reason| fail(self, reason))?;
                }
                self.note(NoteKind::Ignored, directive, "has no effect here");
            }
            "Option" => {
                Parameters::read(words).map_err(|reason| fail(self, reason))?;
            }
            "Camera" | "Film" | "Sampler" | "Integrator" | "PixelFilter" | "Filter" | "Accelerator" | "Material"
            | "MakeNamedMaterial" | "MakeNamedMedium" | "LightSource" | "AreaLightSource" | "Shape" => {
                let kind = text(words).map_err(|reason| fail(self, reason))?;
                let parameters = Parameters::read(words).map_err(|reason| fail(self, reason))?;
                self.thing(directive, &kind, parameters);
            }
            "WorldEnd" => {
                let hint =
                    "is of an older pbrt; pbrt-v4 makes a scene of its own from one of pbrt-v3: pbrt --upgrade FILE";
                return Err(fail(self, hint.to_owned()));
            }
            _ => return Err(fail(self, "is no directive that is known here".to_owned())),
        }
        Ok(())
    }

    fn named(&mut self, directive: &str, name: &str, depth: u32) -> Result<(), SceneError> {
        match directive {
            "CoordinateSystem" => {
                self.systems.insert(name.to_owned(), self.state.ctm);
            }
            "CoordSysTransform" => match self.systems.get(name) {
                Some(system) => self.state.ctm = *system,
                None => self.error(directive, format!("there is no coordinate system \"{name}\"")),
            },
            "NamedMaterial" => self.state.material = Some(Material::Named(name.to_owned())),
            "ObjectBegin" => {
                self.stack.push(self.state.clone());
                self.object = Some((name.to_owned(), Vec::new()));
            }
            "ObjectInstance" => {
                let children = vec![
                    self.nodes.reference(None, &format!("object {name}")),
                    self.nodes.transform("to_world", &self.state.ctm),
                ];
                let instance = self.nodes.thing("shape", "instance", children);
                self.scene.push(instance);
            }
            _ => {
                if depth >= MAX_DEPTH {
                    return Err(self.at(directive, format!("files are included more than {MAX_DEPTH} deep")));
                }
                let here = self.last_node();
                let path = self.nodes.tree.resolve(self.nodes.tree.node(here), name);
                let text =
                    text_of(&path).map_err(|e| self.at(directive, format!("{}: {}", path.display(), e.reason)))?;
                let place = (self.nodes.source, self.nodes.line);
                self.nodes.source = self.nodes.file(&path);
                self.run(&text, depth + 1)?;
                (self.nodes.source, self.nodes.line) = place;
            }
        }
        Ok(())
    }

    /// An element of the file that is read, for paths relative to it.
    fn last_node(&mut self) -> NodeId {
        self.nodes.node("path", &[], Vec::new())
    }

    fn end_object(&mut self) {
        let Some((name, shapes)) = self.object.take() else {
            self.error("ObjectEnd", "no object was begun");
            return;
        };
        if let Some(state) = self.stack.pop() {
            self.state = state;
        }
        let group = self.nodes.thing("shape", "shapegroup", shapes);
        self.nodes.name(group, format!("object {name}"));
        self.scene.push(group);
    }

    fn thing(&mut self, directive: &str, kind: &str, parameters: Parameters) {
        match directive {
            "Camera" => {
                self.systems.insert("camera".to_owned(), self.state.ctm.inverse().unwrap_or_default());
                self.camera = Some((kind.to_owned(), parameters, self.state.clone()));
            }
            "Film" => self.film = Some(parameters),
            "PixelFilter" | "Filter" => self.filter = Some((kind.to_owned(), parameters)),
            "Sampler" => self.samples = parameters.number("pixelsamples").unwrap_or(16.0),
            "Integrator" => {
                self.depth = parameters.number("maxdepth").unwrap_or(5.0);
                if !matches!(kind, "path" | "volpath" | "simplepath" | "simplevolpath") {
                    self.note(NoteKind::Ignored, directive, format!("\"{kind}\" means the picture of \"volpath\""));
                }
            }
            "Accelerator" => {}
            "Material" => self.state.material = Some(Material::Of(kind.to_owned(), parameters)),
            "AreaLightSource" => self.state.area_light = Some(parameters),
            // Here the kind is the name.
            "MakeNamedMaterial" => {
                let of = parameters.text("type").unwrap_or("diffuse").to_owned();
                let material = self.material(&of, &parameters);
                self.finish(directive, &parameters);
                self.nodes.name(material, format!("material {kind}"));
                self.scene.push(material);
            }
            "MakeNamedMedium" => {
                if let Some(medium) = self.medium(&parameters) {
                    self.finish(directive, &parameters);
                    self.nodes.name(medium, kind.to_owned());
                    self.scene.push(medium);
                }
            }
            "LightSource" => {
                if let Some(light) = self.light(kind, &parameters) {
                    self.finish(directive, &parameters);
                    self.scene.push(light);
                }
            }
            _ => {
                if let Some(shape) = self.shape(kind, &parameters) {
                    self.finish(directive, &parameters);
                    match &mut self.object {
                        Some((_, shapes)) => shapes.push(shape),
                        None => self.scene.push(shape),
                    }
                }
            }
        }
    }

    /// The camera with its film, and the integrator.
    fn world_begin(&mut self) {
        self.is_in_world = true;
        self.state.ctm = Transform::IDENTITY;
        self.systems.insert("world".to_owned(), Transform::IDENTITY);
        // A path of that many scatterings has one segment more.
        let depth = self.nodes.integer("max_depth", self.depth.clamp(0.0, 1e6) as i64 + 1);
        let integrator = self.nodes.thing("integrator", "volpath", vec![depth]);
        self.scene.push(integrator);
        let film = self.film.take().unwrap_or_default();
        let size = ["xresolution", "yresolution"].map(|name| film.number(name).map_or(0, |n| n as i64));
        let [width, height] = [if size[0] > 0 { size[0] } else { 1280 }, if size[1] > 0 { size[1] } else { 720 }];
        film.get("filename");
        if let Some(sensor) = film.text("sensor").filter(|sensor| *sensor != "cie1931") {
            self.note(NoteKind::Ignored, "Film", format!("the response of the sensor \"{sensor}\" is left out"));
        }
        self.finish("Film", &film);
        let filter = match self.filter.as_ref().map(|(kind, _)| kind.as_str()) {
            Some("box") => "box",
            Some("mitchell") => "mitchell",
            Some("triangle") => "tent",
            Some("sinc") => "lanczos",
            _ => "gaussian",
        };
        let children = vec![
            self.nodes.integer("width", width),
            self.nodes.integer("height", height),
            self.nodes.thing("rfilter", filter, Vec::new()),
        ];
        let film = self.nodes.thing("film", "hdrfilm", children);
        let samples = vec![self.nodes.integer("sample_count", self.samples.clamp(1.0, 1e9) as i64)];
        let sampler = self.nodes.thing("sampler", "independent", samples);
        let (kind, parameters, state) =
            self.camera.take().unwrap_or_else(|| ("perspective".to_owned(), Parameters::default(), State::default()));
        let Some(to_world) = state.ctm.inverse() else {
            self.error("Camera", "its transform cannot be undone");
            return;
        };
        // +x is on the right.
        let mut to_world = Transform::scaling([-1.0, 1.0, 1.0]).then(&to_world);
        let mut children = vec![film, sampler];
        if !state.outside.is_empty() {
            children.push(self.nodes.reference(Some("medium"), &state.outside));
        }
        let kind = match kind.as_str() {
            "perspective" => {
                children.push(self.nodes.float("fov", parameters.number("fov").unwrap_or(90.0)));
                children.push(self.nodes.string("fov_axis", "smaller"));
                match parameters.number("lensradius").filter(|radius| *radius > 0.0) {
                    Some(radius) => {
                        children.push(self.nodes.float("aperture_radius", radius));
                        let focus = parameters.number("focaldistance").unwrap_or(1e6);
                        children.push(self.nodes.float("focus_distance", focus));
                        "thinlens"
                    }
                    None => "perspective",
                }
            }
            "orthographic" => {
                // The shorter side of the film is from -1 to 1.
                let wide = (width as f64 / height as f64).max(1.0);
                to_world = Transform::scaling([wide, wide, 1.0]).then(&to_world);
                "orthographic"
            }
            other => {
                self.instead("Camera", &format!("a \"{other}\" camera is not supported"), "a pinhole");
                "perspective"
            }
        };
        parameters.get("focaldistance");
        self.finish("Camera", &parameters);
        children.push(self.nodes.transform("to_world", &to_world));
        let sensor = self.nodes.thing("sensor", kind, children);
        self.scene.push(sensor);
    }
}

fn text(words: &mut Words<'_>) -> Result<String, String> {
    match words.next()? {
        Some(Token { word: Word::Text(text), .. }) => Ok(text.to_owned()),
        _ => Err("a name in quotation marks is due".to_owned()),
    }
}

/// The numbers of a transform, in brackets or not.
fn numbers(words: &mut Words<'_>, directive: &str) -> Result<Vec<f64>, String> {
    let count = match directive {
        "Translate" | "Scale" => 3,
        "Rotate" => 4,
        "LookAt" => 9,
        _ => 16,
    };
    let is_list = matches!(words.peek()?, Some(Token { word: Word::Open, .. }));
    if is_list {
        words.next()?;
    }
    let mut numbers = Vec::with_capacity(count);
    for _ in 0..count {
        match words.next()? {
            Some(Token { word: Word::Number(number), .. }) => numbers.push(number),
            _ => return Err(format!("{count} numbers are due")),
        }
    }
    if is_list && !matches!(words.next()?, Some(Token { word: Word::Close, .. })) {
        return Err(format!("{count} numbers are due in the brackets, and no more"));
    }
    Ok(numbers)
}

/// What a directive moves, and whether it replaces what was before.
fn moved(directive: &str, n: &[f64]) -> Result<(Transform, bool), String> {
    let triple = |from: usize| [n[from], n[from + 1], n[from + 2]];
    Ok(match directive {
        "Translate" => (Transform::translation(triple(0)), false),
        "Scale" => (Transform::scaling(triple(0)), false),
        "Rotate" => (Transform::rotation(triple(1), n[0]).ok_or("the axis has no length")?, false),
        "LookAt" => {
            let seen =
                Transform::look_at(triple(0), triple(3), triple(6)).ok_or("eye, target and up are on one line")?;
            (seen.inverse().ok_or("eye, target and up are on one line")?, false)
        }
        _ => {
            // Column by column.
            let matrix = Transform::from_columns(triple(0), triple(4), triple(8), triple(12));
            if n[3] != 0.0 || n[7] != 0.0 || n[11] != 0.0 || n[15] == 0.0 {
                return Err("a transform with perspective is not supported".to_owned());
            }
            (matrix.then(&Transform::scaling([1.0 / n[15]; 3])), directive == "Transform")
        }
    })
}
