//! Materials and textures of pbrt as elements.

use super::super::notes::NoteKind;
use super::super::tree::NodeId;
use super::Reader;
use super::tokens::{Parameter, Parameters};
use crate::transform::Transform;

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
    pub(super) fn colour(
        &mut self,
        parameters: &Parameters,
        name: &str,
        out: &str,
        default: Option<f64>,
    ) -> Option<NodeId> {
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
}
