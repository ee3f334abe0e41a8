//! Shapes and media of pbrt as elements.

use fogbow::math::{Vec2, Vec3};

use super::super::tree::{Inline, NodeId};
use super::tokens::Parameters;
use super::{Material, Reader, cloud};
use crate::mesh::Mesh;
use crate::transform::{Transform, to_vec3};
use crate::volume::{Values, Volume};

impl Reader<'_> {
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
        let is_shining = self.shine(&mut children);
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
