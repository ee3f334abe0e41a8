//! Lights of pbrt as elements.

use fogbow::math::{Vec2, Vec3};

use super::super::spectra;
use super::super::tree::{Inline, NodeId};
use super::Reader;
use super::tokens::Parameters;
use crate::picture::Picture;
use crate::transform::{Transform, to_vec3};

impl Reader<'_> {
    /// Light as red, green and blue: of luminance 1, times `scale`, but for what is given as a colour.
    pub(super) fn emission(&mut self, parameters: &Parameters, name: &str) -> [f64; 3] {
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
            "projection" => {
                let scale = parameters.number("scale").unwrap_or(1.0);
                if parameters.get("power").is_some() {
                    self.instead("LightSource", "the \"power\" of a projection is not supported", "by scale");
                }
                let Some(file) = parameters.text("filename") else {
                    self.error("LightSource", "a projection needs a \"filename\"");
                    return None;
                };
                // Rows begin at -x, and not at +x as those of a Mitsuba projector.
                let mirrored = Transform { rows: [[-1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]] };
                let of_picture = vec![self.nodes.string("filename", file), self.nodes.string("filter_type", "nearest")];
                let picture = self.nodes.thing("texture", "bitmap", of_picture);
                self.nodes.tree.node_mut(picture).set("name", "intensity".to_owned());
                let children = vec![
                    self.nodes.transform("to_world", &mirrored.then(&ctm)),
                    picture,
                    self.nodes.float("scale", scale),
                    self.nodes.float("fov", parameters.number("fov").unwrap_or(90.0)),
                    self.nodes.string("fov_axis", "smaller"),
                ];
                Some(self.nodes.thing("emitter", "projector", children))
            }
            other => {
                self.instead("LightSource", &format!("a \"{other}\" light is not supported"), "left out");
                None
            }
        }
    }

    /// The emitter of a shape, if it has one.
    pub(super) fn shine(&mut self, children: &mut Vec<NodeId>) -> bool {
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
