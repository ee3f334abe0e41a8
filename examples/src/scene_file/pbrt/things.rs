//! Materials, textures, lights, shapes and media of pbrt as elements.

use fogbow::math::{Vec2, Vec3};

use super::super::notes::NoteKind;
use super::super::spectra;
use super::super::tree::{Inline, NodeId};
use super::tokens::{Parameter, Parameters};
use super::{Material, Reader, cloud};
use crate::mesh::Mesh;
use crate::picture::Picture;
use crate::transform::{Transform, to_vec3};
use crate::volume::{Values, Volume};

/// A `Texture` directive.
#[derive(Debug, Clone)]
pub(super) struct Texture {
    pub(super) kind: String,
    pub(super) parameters: Parameters,
}

/// Indices of refraction (sodium line) of glasses by name.
const GLASSES: [(&str, f64); 10] = [
    ("glass-BK7", 1.5168),
    ("glass-BAF10", 1.67),
    ("glass-FK51A", 1.4866),
    ("glass-LASF9", 1.8503),
    ("glass-F5", 1.6034),
    ("glass-SF5", 1.6727),
    ("glass-F10", 1.6228),
    ("glass-SF10", 1.7283),
    ("glass-F11", 1.6206),
    ("glass-SF11", 1.7847),
];

/// Metals of pbrt, as Mitsuba calls them.
const METALS: [(&str, &str); 4] =
    [("metal-Ag-eta", "Ag"), ("metal-Al-eta", "Al"), ("metal-Au-eta", "Au"), ("metal-Cu-eta", "Cu")];

/// Below this roughness a coat or metal is smooth.
const SMOOTH: f64 = 1e-3;

impl Reader<'_> {
    /// The parameter as a property of another name: a colour, a number or a texture; a grey where it is not given.
    fn colour(&mut self, parameters: &Parameters, name: &str, out: &str, default: Option<f64>) -> Option<NodeId> {
        let Some(parameter) = parameters.get(name) else { return default.map(|grey| self.nodes.float(out, grey)) };
        match (parameter.kind.as_str(), &parameter.numbers[..], parameter.texts.first()) {
            ("rgb" | "color", [r, g, b, ..], _) => Some(self.nodes.rgb(out, [*r, *g, *b])),
            ("texture", _, Some(texture)) => self.texture(texture, out, 0),
            ("spectrum", [], Some(file)) => {
                Some(self.nodes.node("spectrum", &[("name", out), ("filename", file)], Vec::new()))
            }
            ("spectrum", samples @ [_, first, ..], _) => {
                let is_even = samples.as_chunks::<2>().0.iter().all(|[_, value]| value == first);
                Some(if is_even { self.nodes.float(out, *first) } else { self.nodes.spectrum(out, samples) })
            }
            (_, [value, ..], _) => Some(self.nodes.float(out, *value)),
            _ => {
                self.error(name, "has no value that can be read");
                None
            }
        }
    }

    /// Light as red, green and blue: of luminance 1, times `scale`, but for what is given as a colour.
    fn emission(&mut self, parameters: &Parameters, name: &str) -> [f64; 3] {
        let scale = parameters.number("scale").unwrap_or(1.0);
        let normalized = |colour: [f64; 3]| {
            let luminance = 0.212_671 * colour[0] + 0.715_16 * colour[1] + 0.072_169 * colour[2];
            if luminance > 0.0 { colour.map(|c| c / luminance) } else { [0.0; 3] }
        };
        let colour = |spectrum: fogbow::spectrum::Spectrum| spectrum.0.map(f64::from);
        let value = match parameters.get(name) {
            None => [1.0; 3],
            Some(parameter) => match (parameter.kind.as_str(), &parameter.numbers[..]) {
                ("rgb" | "color", [r, g, b, ..]) => [*r, *g, *b],
                ("blackbody", [kelvin, ..]) if (1.0..=1e6).contains(kelvin) => {
                    normalized(colour(spectra::of_black_body(*kelvin)))
                }
                ("spectrum", samples @ [_, _, ..]) => {
                    let pairs = samples.as_chunks::<2>().0.iter().map(|[w, v]| (*w, *v)).collect();
                    match spectra::of_light(pairs) {
                        Ok(light) => normalized(colour(light)),
                        Err(reason) => {
                            self.error(name, reason);
                            [1.0; 3]
                        }
                    }
                }
                ("spectrum", []) if parameter.texts.first().is_some_and(|text| text.starts_with("stdillum-D65")) => {
                    [1.0; 3]
                }
                (kind, _) => {
                    self.instead(name, &format!("this \"{kind}\" is not supported as light"), "white");
                    [1.0; 3]
                }
            },
        };
        value.map(|c| c * scale)
    }

    fn texture(&mut self, name: &str, out: &str, depth: u32) -> Option<NodeId> {
        let Some(Texture { kind, parameters }) = self.textures.get(name).cloned() else {
            self.error("texture", format!("there is no texture \"{name}\""));
            return None;
        };
        if depth > 4 {
            self.error("texture", format!("\"{name}\" is nested too deep"));
            return None;
        }
        let number = |name: &str, usual: f64| parameters.number(name).unwrap_or(usual);
        let (su, sv, du, dv) =
            (number("uscale", 1.0), number("vscale", 1.0), number("udelta", 0.0), number("vdelta", 0.0));
        let node = match kind.as_str() {
            "imagemap" => {
                let mut children = vec![self.nodes.string("filename", parameters.text("filename").unwrap_or_default())];
                // The first row is at v = 1.
                let to_uv = Transform { rows: [[su, 0.0, 0.0, du], [0.0, -sv, 0.0, 1.0 - dv], [0.0, 0.0, 1.0, 0.0]] };
                children.push(self.nodes.transform("to_uv", &to_uv));
                if matches!(parameters.text("wrap"), Some("clamp" | "black")) {
                    children.push(self.nodes.string("wrap_mode", "clamp"));
                }
                if parameters.text("encoding") == Some("linear") {
                    children.push(self.nodes.boolean("raw", true));
                }
                parameters.get("filter");
                self.nodes.thing("texture", "bitmap", children)
            }
            "constant" => return self.colour(&parameters, "value", out, Some(1.0)),
            "scale" => {
                self.note(NoteKind::Ignored, "Texture", format!("\"{name}\": its scale is left out"));
                parameters.get("scale");
                return self.colour(&parameters, "tex", out, Some(1.0));
            }
            "checkerboard" => {
                let to_uv = Transform {
                    rows: [[0.5 * su, 0.0, 0.0, 0.5 * du], [0.0, 0.5 * sv, 0.0, 0.5 * dv], [0.0, 0.0, 1.0, 0.0]],
                };
                let mut children = vec![self.nodes.transform("to_uv", &to_uv)];
                children.extend(self.colour(&parameters, "tex1", "color0", Some(1.0)));
                children.extend(self.colour(&parameters, "tex2", "color1", Some(0.0)));
                self.nodes.thing("texture", "checkerboard", children)
            }
            // Whoever reads it says that it is not known.
            other => self.nodes.thing("texture", other, Vec::new()),
        };
        self.finish("Texture", &parameters);
        self.nodes.tree.node_mut(node).set("name", out.to_owned());
        Some(node)
    }

    /// Roughness α of Trowbridge and Reitz by these names; `None` where it is smooth.
    fn facets(&mut self, parameters: &Parameters, prefix: &str) -> Option<Vec<NodeId>> {
        let of = |name: &str| parameters.get(&format!("{prefix}{name}"));
        let both = of("roughness").and_then(|p| p.numbers.first().copied());
        let along = |own: Option<&Parameter>| own.and_then(|p| p.numbers.first().copied()).or(both).unwrap_or(0.0);
        let (u, v) = (along(of("uroughness")), along(of("vroughness")));
        let is_plain = parameters.get("remaproughness").and_then(|p| p.flags.first()) == Some(&false);
        let [u, v] = [u, v].map(|c| if is_plain { c } else { c.max(0.0).sqrt() });
        if of("roughness").is_some_and(|p| p.kind == "texture") {
            self.note(NoteKind::Ignored, "Material", "a texture of roughness is left out: 0.3 everywhere");
            return Some(vec![self.nodes.string("distribution", "ggx"), self.nodes.float("alpha", 0.3)]);
        }
        if u.max(v) < SMOOTH {
            return None;
        }
        let mut all = vec![self.nodes.string("distribution", "ggx")];
        if u == v {
            all.push(self.nodes.float("alpha", u));
        } else {
            all.extend([self.nodes.float("alpha_u", u.max(SMOOTH)), self.nodes.float("alpha_v", v.max(SMOOTH))]);
        }
        Some(all)
    }

    /// An index of refraction: a number, or a glass by name.
    fn index(&mut self, parameters: &Parameters, usual: f64) -> NodeId {
        let value = match parameters.get("eta") {
            Some(parameter) => match (parameter.numbers.first(), parameter.texts.first()) {
                (Some(number), _) => *number,
                (None, Some(name)) => match GLASSES.iter().find(|(glass, _)| glass == name) {
                    Some((_, index)) => *index,
                    None => {
                        self.instead("eta", &format!("\"{name}\" is not known"), "an index of 1.5");
                        1.5
                    }
                },
                (None, None) => usual,
            },
            None => usual,
        };
        self.nodes.float("int_ior", value)
    }

    /// A metal, with names of parameters that begin so.
    fn metal(&mut self, parameters: &Parameters, prefix: &str) -> NodeId {
        let facets = self.facets(parameters, prefix);
        let kind = if facets.is_some() { "roughconductor" } else { "conductor" };
        let mut children = facets.unwrap_or_default();
        let eta = format!("{prefix}eta");
        let reflectance = "reflectance";
        if parameters.get(reflectance).is_some() && parameters.get(&eta).is_none() {
            self.note(NoteKind::Ignored, "Material", "a conductor by its reflectance: the same at all angles");
            children.push(self.nodes.string("material", "none"));
            children.extend(self.colour(parameters, reflectance, "specular_reflectance", None));
        } else {
            let named = parameters.text(&eta).unwrap_or("metal-Cu-eta");
            match METALS.iter().find(|(name, _)| *name == named) {
                Some((_, metal)) => children.push(self.nodes.string("material", metal)),
                None if parameters.get(&eta).is_some_and(|p| !p.numbers.is_empty()) => {
                    children.extend(self.colour(parameters, &eta, "eta", None));
                    children.extend(self.colour(parameters, &format!("{prefix}k"), "k", Some(0.0)));
                }
                None => {
                    self.instead("Material", &format!("the metal \"{named}\" is not known"), "copper");
                    children.push(self.nodes.string("material", "Cu"));
                }
            }
        }
        parameters.get(&format!("{prefix}k"));
        self.nodes.thing("bsdf", kind, children)
    }

    pub(super) fn material(&mut self, kind: &str, parameters: &Parameters) -> NodeId {
        let opaque = |reader: &mut Self, bsdf: NodeId| reader.nodes.thing("bsdf", "twosided", vec![bsdf]);
        parameters.get("type");
        match kind {
            "" | "none" | "interface" => self.nodes.thing("bsdf", "null", Vec::new()),
            "diffuse" => {
                let children = self.colour(parameters, "reflectance", "reflectance", Some(0.5)).into_iter().collect();
                let bsdf = self.nodes.thing("bsdf", "diffuse", children);
                opaque(self, bsdf)
            }
            "coateddiffuse" => {
                let facets = self.facets(parameters, "");
                let kind = if facets.is_some() { "roughplastic" } else { "plastic" };
                let mut children = facets.unwrap_or_default();
                children.extend(self.colour(parameters, "reflectance", "diffuse_reflectance", Some(0.5)));
                children.push(self.index(parameters, 1.5));
                children.push(self.nodes.boolean("nonlinear", true));
                for name in ["thickness", "maxdepth", "nsamples", "g", "albedo"] {
                    parameters.get(name);
                }
                let bsdf = self.nodes.thing("bsdf", kind, children);
                opaque(self, bsdf)
            }
            "conductor" | "coatedconductor" => {
                let prefix = if kind == "conductor" { "" } else { "conductor." };
                if kind == "coatedconductor" {
                    self.note(NoteKind::Ignored, "Material", "the coat of a coated conductor is left out");
                }
                let bsdf = self.metal(parameters, prefix);
                opaque(self, bsdf)
            }
            "dielectric" => {
                let facets = self.facets(parameters, "");
                let kind = if facets.is_some() { "roughdielectric" } else { "dielectric" };
                let mut children = facets.unwrap_or_default();
                children.push(self.index(parameters, 1.5));
                children.push(self.nodes.float("ext_ior", 1.0));
                self.nodes.thing("bsdf", kind, children)
            }
            "thindielectric" => {
                let children = vec![self.index(parameters, 1.5), self.nodes.float("ext_ior", 1.0)];
                self.nodes.thing("bsdf", "thindielectric", children)
            }
            "diffusetransmission" => {
                self.instead("Material", "diffuse transmission is not supported", "what it reflects alone");
                let children = self.colour(parameters, "reflectance", "reflectance", Some(0.25)).into_iter().collect();
                parameters.get("transmittance");
                let bsdf = self.nodes.thing("bsdf", "diffuse", children);
                opaque(self, bsdf)
            }
            "mix" => {
                let named = parameters.get("materials").map(|p| p.texts.clone()).unwrap_or_default();
                let mut children: Vec<_> = self.colour(parameters, "amount", "weight", Some(0.5)).into_iter().collect();
                children.extend(named.iter().map(|name| self.nodes.reference(None, &format!("material {name}"))));
                self.nodes.thing("bsdf", "blendbsdf", children)
            }
            // Whoever reads it says that it is not known.
            other => self.nodes.thing("bsdf", other, Vec::new()),
        }
    }

    pub(super) fn light(&mut self, kind: &str, parameters: &Parameters) -> Option<NodeId> {
        let ctm = self.state.ctm;
        let place = |name: &str, usual: [f64; 3]| parameters.triple(name).unwrap_or(usual);
        let (from, to) = (place("from", [0.0; 3]), place("to", [0.0, 0.0, 1.0]));
        let tau = core::f64::consts::TAU;
        match kind {
            "point" => {
                let mut intensity = self.emission(parameters, "I");
                if let Some(power) = parameters.number("power") {
                    intensity = intensity.map(|c| c * power / (2.0 * tau));
                }
                let placed = Transform::translation(from).then(&ctm);
                let children = vec![self.nodes.transform("to_world", &placed), self.nodes.rgb("intensity", intensity)];
                Some(self.nodes.thing("emitter", "point", children))
            }
            "spot" => {
                let intensity = self.emission(parameters, "I");
                let cutoff = parameters.number("coneangle").unwrap_or(30.0);
                let beam = (cutoff - parameters.number("conedeltaangle").unwrap_or(5.0)).max(0.0);
                let up = if from[0] == to[0] && from[2] == to[2] { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
                let Some(placed) = Transform::look_at(from, to, up) else {
                    self.error("LightSource", "\"from\" and \"to\" are the same point");
                    return None;
                };
                let children = vec![
                    self.nodes.transform("to_world", &placed.then(&ctm)),
                    self.nodes.rgb("intensity", intensity),
                    self.nodes.float("cutoff_angle", cutoff),
                    self.nodes.float("beam_width", beam),
                ];
                Some(self.nodes.thing("emitter", "spot", children))
            }
            "distant" => {
                let mut irradiance = self.emission(parameters, "L");
                if let Some(illuminance) = parameters.number("illuminance") {
                    irradiance = irradiance.map(|c| c * illuminance);
                }
                let (start, end) = (ctm.point(from), ctm.point(to));
                let direction = [0, 1, 2].map(|i| end[i] - start[i]);
                let [x, y, z] = direction.map(|c| c.to_string());
                let direction = [("name", "direction"), ("x", &*x), ("y", &*y), ("z", &*z)];
                let children =
                    vec![self.nodes.node("vector", &direction, Vec::new()), self.nodes.rgb("irradiance", irradiance)];
                Some(self.nodes.thing("emitter", "directional", children))
            }
            "infinite" => {
                let mut radiance = self.emission(parameters, "L");
                if let Some(illuminance) = parameters.number("illuminance") {
                    radiance = radiance.map(|c| c * illuminance * 2.0 / tau);
                }
                let Some(name) = parameters.text("filename") else {
                    let children = vec![self.nodes.rgb("radiance", radiance)];
                    return Some(self.nodes.thing("emitter", "constant", children));
                };
                let here = self.last_node();
                let file = self.nodes.tree.resolve(self.nodes.tree.node(here), name);
                let picture = match Picture::read(&file) {
                    Ok(picture) => unfolded(&picture, &ctm),
                    Err(error) => {
                        self.error("LightSource", error.to_string());
                        return None;
                    }
                };
                let scale = parameters.number("scale").unwrap_or(1.0);
                let children = vec![self.nodes.inline(Inline::Picture(picture)), self.nodes.float("scale", scale)];
                Some(self.nodes.thing("emitter", "envmap", children))
            }
            other => {
                self.instead("LightSource", &format!("a \"{other}\" light is not supported"), "left out");
                None
            }
        }
    }

    pub(super) fn medium(&mut self, parameters: &Parameters) -> Option<NodeId> {
        let kind = parameters.text("type").unwrap_or("homogeneous").to_owned();
        if let Some(preset) = parameters.text("preset") {
            self.instead(
                "MakeNamedMedium",
                &format!("the preset \"{preset}\" is not known here"),
                "as if it were not given",
            );
        }
        let phase = vec![self.nodes.float("g", parameters.number("g").unwrap_or(0.0))];
        let mut children = vec![
            self.nodes.thing("phase", "hg", phase),
            self.nodes.float("scale", parameters.number("scale").unwrap_or(1.0)),
        ];
        let coefficient = |reader: &mut Self, name: &str, usual: [f64; 3]| {
            reader.colour(parameters, name, name, None).unwrap_or_else(|| reader.nodes.rgb(name, usual))
        };
        let strength = parameters.number("Lescale").or_else(|| parameters.number("LeScale"));
        if parameters.get("Le").is_some() {
            let glow = self.emission(parameters, "Le");
            // `scale` is that of the coefficients.
            let own = strength.unwrap_or(1.0) / parameters.number("scale").unwrap_or(1.0);
            let own = if own.is_finite() { own } else { 0.0 };
            children.push(self.nodes.rgb("glow", glow.map(|c| c * own)));
        }
        // Of skim milk per millimetre, as pbrt has them where nothing is said.
        let usual = if kind == "homogeneous" { [[0.0011, 0.0024, 0.014], [2.55, 3.21, 3.77]] } else { [[1.0; 3]; 2] };
        children.push(coefficient(self, "sigma_a", usual[0]));
        children.push(coefficient(self, "sigma_s", usual[1]));
        if kind == "homogeneous" {
            return Some(self.nodes.thing("medium", "homogeneous", children));
        }
        let corner = |name: &str, usual: f64| parameters.triple(name).unwrap_or([usual; 3]);
        let (low, high) = (corner("p0", 0.0), corner("p1", 1.0));
        let size = [0, 1, 2].map(|i| high[i] - low[i]);
        let boxed = Transform::scaling(size).then(&Transform::translation(low)).then(&self.state.ctm);
        let volume = match kind.as_str() {
            "uniformgrid" => {
                let count =
                    ["nx", "ny", "nz"].map(|name| parameters.number(name).unwrap_or(1.0).clamp(0.0, 1e6) as u32);
                let values: Vec<f32> = parameters
                    .get("density")
                    .map(|p| p.numbers.iter().map(|v| *v as f32).collect())
                    .unwrap_or_default();
                let cells = count.iter().map(|n| u64::from(*n)).product::<u64>();
                if cells == 0 || cells != values.len() as u64 {
                    let reason = format!("\"density\" has {} values where nx ny nz make {cells}", values.len());
                    self.error("MakeNamedMedium", reason);
                    return None;
                }
                if let Some(bad) = values.iter().find(|v| !(v.is_finite() && **v >= 0.0)) {
                    self.error("MakeNamedMedium", format!("\"density\" has the value {bad}"));
                    return None;
                }
                let volume = Volume { size: count, values: Values::F32(values) };
                vec![self.nodes.inline(Inline::Volume(volume)), self.nodes.transform("to_world", &boxed)]
            }
            "cloud" => {
                let number = |name: &str, usual: f64| parameters.number(name).unwrap_or(usual) as f32;
                let shape = cloud::Cloud {
                    density: number("density", 1.0),
                    wispiness: number("wispiness", 1.0),
                    frequency: number("frequency", 5.0),
                };
                vec![self.nodes.inline(Inline::Volume(shape.drawn())), self.nodes.transform("to_world", &boxed)]
            }
            "nanovdb" => {
                let ctm = self.state.ctm;
                vec![
                    self.nodes.string("filename", parameters.text("filename").unwrap_or_default()),
                    self.nodes.string("grid", "density"),
                    self.nodes.boolean("use_grid_bbox", true),
                    self.nodes.transform("to_world", &ctm),
                ]
            }
            other => {
                self.instead("MakeNamedMedium", &format!("a \"{other}\" medium is not supported"), "left out");
                return None;
            }
        };
        let names = ["temperature", "temperaturescale", "temperatureoffset", "temperaturecutoff"];
        let is_hot = names.map(|name| parameters.get(name).is_some()).contains(&true);
        if kind == "nanovdb" && (is_hot || strength.is_some()) {
            let offset = parameters.number("temperatureoffset").or_else(|| parameters.number("temperaturecutoff"));
            let numbers = [
                ("temperature_offset", offset.unwrap_or(0.0)),
                ("temperature_scale", parameters.number("temperaturescale").unwrap_or(1.0)),
                ("glow_scale", strength.unwrap_or(1.0)),
            ];
            children.extend(numbers.map(|(name, value)| self.nodes.float(name, value)));
            let ctm = self.state.ctm;
            let grid = vec![
                self.nodes.string("filename", parameters.text("filename").unwrap_or_default()),
                self.nodes.string("grid", "temperature"),
                self.nodes.boolean("use_grid_bbox", true),
                self.nodes.transform("to_world", &ctm),
            ];
            let grid = self.nodes.thing("volume", "gridvolume", grid);
            self.nodes.tree.node_mut(grid).set("name", "temperature".to_owned());
            children.push(grid);
        } else if is_hot {
            self.instead("MakeNamedMedium", "temperatures are read of NanoVDB files only", "it does not glow");
        }
        let volume = self.nodes.thing("volume", "gridvolume", volume);
        self.nodes.tree.node_mut(volume).set("name", "density".to_owned());
        children.push(volume);
        Some(self.nodes.thing("medium", "heterogeneous", children))
    }

    pub(super) fn shape(&mut self, kind: &str, parameters: &Parameters) -> Option<NodeId> {
        let ctm = self.state.ctm;
        let number = |name: &str, usual: f64| parameters.number(name).unwrap_or(usual);
        let (kind, mut children) = match kind {
            "sphere" => {
                let radius = number("radius", 1.0);
                let is_whole = number("zmin", -radius) <= -radius
                    && number("zmax", radius) >= radius
                    && number("phimax", 360.0) >= 360.0;
                if !is_whole {
                    self.instead("Shape", "a part of a sphere is not supported", "all of it");
                }
                ("sphere", vec![self.nodes.float("radius", radius), self.nodes.transform("to_world", &ctm)])
            }
            "disk" => {
                let radius = number("radius", 1.0);
                if number("innerradius", 0.0) > 0.0 || number("phimax", 360.0) < 360.0 {
                    self.instead("Shape", "a part of a disk is not supported", "all of it");
                }
                let placed = Transform::scaling([radius, radius, 1.0]);
                let placed = placed.then(&Transform::translation([0.0, 0.0, number("height", 0.0)])).then(&ctm);
                ("disk", vec![self.nodes.transform("to_world", &placed)])
            }
            "cylinder" => {
                if number("phimax", 360.0) < 360.0 {
                    self.instead("Shape", "a part of a cylinder is not supported", "all of it");
                }
                let (radius, low, high) = (number("radius", 1.0), number("zmin", -1.0), number("zmax", 1.0));
                let placed = Transform::scaling([radius, radius, high - low]);
                let placed = placed.then(&Transform::translation([0.0, 0.0, low])).then(&ctm);
                ("cylinder", vec![self.nodes.transform("to_world", &placed)])
            }
            "plymesh" => {
                let file = parameters.text("filename").unwrap_or_default();
                ("ply", vec![self.nodes.string("filename", file), self.nodes.transform("to_world", &ctm)])
            }
            "trianglemesh" | "bilinearmesh" | "loopsubdiv" => {
                if kind == "loopsubdiv" {
                    parameters.get("levels");
                    self.instead("Shape", "surfaces of subdivision are not supported", "their control mesh");
                }
                let mesh = match mesh(parameters, kind == "bilinearmesh") {
                    Ok(mesh) => mesh,
                    Err(reason) => {
                        self.error("Shape", reason);
                        return None;
                    }
                };
                ("mesh", vec![self.nodes.inline(Inline::Mesh(mesh)), self.nodes.transform("to_world", &ctm)])
            }
            other => {
                self.instead("Shape", &format!("a \"{other}\" is not supported"), "left out");
                return None;
            }
        };
        if self.state.is_reversed {
            children.push(self.nodes.boolean("flip_normals", true));
        }
        let is_shining = self.shine(parameters, &mut children);
        let bsdf = match self.state.material.clone() {
            Some(Material::Named(name)) => self.nodes.reference(None, &format!("material {name}")),
            // What shines shows no more.
            Some(Material::Of(kind, _)) if is_shining && matches!(&*kind, "" | "none" | "interface") => {
                let black = vec![self.nodes.float("reflectance", 0.0)];
                self.nodes.thing("bsdf", "diffuse", black)
            }
            Some(Material::Of(kind, parameters)) => {
                let bsdf = self.material(&kind, &parameters);
                self.finish("Material", &parameters);
                bsdf
            }
            None => self.material("diffuse", &Parameters::default()),
        };
        let alpha = self.colour(parameters, "alpha", "opacity", None);
        children.push(match alpha {
            Some(opacity) => self.nodes.thing("bsdf", "mask", vec![opacity, bsdf]),
            None => bsdf,
        });
        if self.state.inside != self.state.outside {
            for (side, name) in [("interior", self.state.inside.clone()), ("exterior", self.state.outside.clone())] {
                if !name.is_empty() {
                    children.push(self.nodes.reference(Some(side), &name));
                }
            }
        }
        Some(self.nodes.thing("shape", kind, children))
    }

    /// The emitter of a shape, if it has one.
    fn shine(&mut self, _: &Parameters, children: &mut Vec<NodeId>) -> bool {
        let Some(light) = self.state.area_light.clone() else { return false };
        let radiance = self.emission(&light, "L");
        if light.flag("twosided") {
            self.instead(
                "AreaLightSource",
                "light from both sides is not supported",
                "from the side of the normal alone",
            );
        }
        if light.get("power").is_some() || light.get("filename").is_some() {
            self.instead("AreaLightSource", "\"power\" and \"filename\" are not supported", "by L and scale");
        }
        self.finish("AreaLightSource", &light);
        let radiance = vec![self.nodes.rgb("radiance", radiance)];
        children.push(self.nodes.thing("emitter", "area", radiance));
        true
    }
}

/// Triangles, or patches of four points as two triangles each.
fn mesh(parameters: &Parameters, is_bilinear: bool) -> Result<Mesh, String> {
    let numbers = |name: &str| parameters.get(name).map(|p| p.numbers.as_slice()).unwrap_or_default();
    let triples = |name: &str| numbers(name).as_chunks::<3>().0.iter().map(|p| to_vec3(*p)).collect::<Vec<Vec3>>();
    let vertices = triples("P");
    if vertices.is_empty() {
        return Err("\"point3 P\" is missing".to_owned());
    }
    let corners = if is_bilinear { 4 } else { 3 };
    let given: Vec<f64> = numbers("indices").to_vec();
    let indices: Vec<f64> =
        if given.is_empty() && vertices.len() == corners { (0..corners).map(|i| i as f64).collect() } else { given };
    if let Some(bad) = indices.iter().find(|i| !(**i >= 0.0 && **i < vertices.len() as f64 && i.fract() == 0.0)) {
        return Err(format!("\"indices\" has {bad}, but there are {} points", vertices.len()));
    }
    let indices: Vec<u32> = indices.into_iter().map(|i| i as u32).collect();
    let triangles = if is_bilinear {
        indices.as_chunks::<4>().0.iter().flat_map(|[a, b, c, d]| [[*a, *b, *d], [*a, *d, *c]]).collect()
    } else {
        indices.as_chunks::<3>().0.to_vec()
    };
    let (normals, uv) = (triples("N"), numbers("uv"));
    let uv = if uv.is_empty() { numbers("st") } else { uv };
    let texcoords: Vec<Vec2> = uv.as_chunks::<2>().0.iter().map(|[u, v]| Vec2::new(*u as f32, *v as f32)).collect();
    for (name, length) in [("N", normals.len()), ("uv", texcoords.len())] {
        if length != 0 && length != vertices.len() {
            return Err(format!("\"{name}\" has {length} values, but there are {} points", vertices.len()));
        }
    }
    for name in ["S", "faceIndices", "emissionfilename"] {
        parameters.get(name);
    }
    Ok(Mesh { vertices, triangles, normals, texcoords, ..Mesh::default() })
}

/// An environment that pbrt keeps on a square by an equal-area map of the sphere (Clarberg 2008, "Fast Equal-Area Mapping of the (Hemi)Sphere
/// using SIMD"), turned by a transform, as latitude by longitude.
fn unfolded(square: &Picture, to_world: &Transform) -> Picture {
    let height = square.height.clamp(2, 1024);
    let width = 2 * height;
    let to_local = to_world.inverse().unwrap_or(Transform::IDENTITY);
    let origin = to_local.point([0.0; 3]);
    let mut pixels = Vec::with_capacity(width * height);
    for (row, column) in (0..height).flat_map(|row| (0..width).map(move |column| (row, column))) {
        let polar = core::f64::consts::PI * row as f64 / (height - 1) as f64;
        let longitude = core::f64::consts::TAU * (column as f64 + 0.5) / width as f64;
        let direction = [polar.sin() * longitude.sin(), polar.cos(), -polar.sin() * longitude.cos()];
        let local = to_local.point(direction);
        let at = on_square(to_vec3([0, 1, 2].map(|i| local[i] - origin[i])).normalize_or(Vec3::Z));
        pixels.push(bilinear(square, at));
    }
    Picture { width, height, pixels }
}

/// Where a direction (unit) lies on the square.
fn on_square(d: Vec3) -> Vec2 {
    let size = d.abs();
    let r = (1.0 - size.z).max(0.0).sqrt();
    let (a, b) = (size.x.max(size.y), size.x.min(size.y));
    let angle = if a == 0.0 { 0.0 } else { (b / a).atan() * core::f32::consts::FRAC_2_PI };
    let angle = if size.x < size.y { 1.0 - angle } else { angle };
    let (mut u, mut v) = (r - angle * r, angle * r);
    if d.z < 0.0 {
        (u, v) = (1.0 - v, 1.0 - u);
    }
    Vec2::new(u.copysign(d.x), v.copysign(d.y)) * 0.5 + 0.5
}

fn bilinear(picture: &Picture, at: Vec2) -> [f32; 3] {
    let place = at * Vec2::new(picture.width as f32, picture.height as f32) - 0.5;
    let low = place.floor();
    let share = place - low;
    let pixel = |x: f32, y: f32| {
        // Half a pixel beyond the border lies elsewhere on the sphere; the border's own is as near as matters.
        let x = (x.max(0.0) as usize).min(picture.width - 1);
        let y = (y.max(0.0) as usize).min(picture.height - 1);
        Vec3::from_array(picture.pixels[y * picture.width + x])
    };
    let row = |y: f32| pixel(low.x, y) * (1.0 - share.x) + pixel(low.x + 1.0, y) * share.x;
    (row(low.y) * (1.0 - share.y) + row(low.y + 1.0) * share.y).to_array()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The map is one to one and keeps areas: as many directions fall into each part of the square.
    #[test]
    fn directions_spread_evenly_over_the_square() {
        let mut counts = [0_u32; 64];
        let total = 64_000;
        for i in 0..total {
            let z = 1.0 - 2.0 * (i as f32 + 0.5) / total as f32;
            let (sin, cos) = (i as f32 * 2.399_963_1).sin_cos();
            let r = (1.0 - z * z).sqrt();
            let at = on_square(Vec3::new(r * cos, r * sin, z)) * 8.0;
            counts[(at.y as usize).min(7) * 8 + (at.x as usize).min(7)] += 1;
        }
        assert!(counts.iter().all(|count| (900..1100).contains(count)), "{counts:?}");
        assert!((on_square(Vec3::Z) - Vec2::splat(0.5)).length() < 1e-6);
    }
}
