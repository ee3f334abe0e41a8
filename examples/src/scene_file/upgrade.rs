//! Files of Mitsuba 0.5 and 0.6, written as Mitsuba 3 would have them.
//!
//! Names in camelCase become snake_case and some properties new ones, as Mitsuba 3 does itself. Beyond that, plugins that were
//! renamed or whose successor means the same get its name, and three numbers in a `<spectrum>` are a colour.

use super::tree::{Attribute, Node, NodeId, Tree};

/// An element by itself.
pub(super) fn element(node: &mut Node) {
    if let Some(name) = node.attribute("name").map(snake_case) {
        node.set("name", name);
    }
    match node.tag.as_str() {
        "lookAt" => node.tag = "lookat".to_owned(),
        "srgb" => {
            // Written as #rrggbb or as three numbers, both with the sRGB curve.
            if let Some(value) = node.attribute("value").and_then(linear) {
                node.set("value", value);
            }
            node.tag = "rgb".to_owned();
        }
        "blackbody" => {
            node.tag = "spectrum".to_owned();
            node.set("type", "blackbody".to_owned());
        }
        "spectrum" => {
            let value = node.attribute("value").unwrap_or_default();
            let numbers = value.split([',', ' ']).filter(|n| !n.is_empty()).count();
            if numbers == 3 && !value.contains(':') {
                node.tag = "rgb".to_owned();
            }
        }
        "subsurface" | "texture" | "bsdf" | "emitter" | "integrator" | "film" | "sampler" | "shape" | "rfilter" => {
            let kind = node.attribute("type").unwrap_or_default();
            if let Some(successor) = successor(&node.tag, kind) {
                node.set("type", successor.to_owned());
            }
        }
        _ => {}
    }
}

/// Plugins of version 0.6 under their names of today.
fn successor(tag: &str, kind: &str) -> Option<&'static str> {
    Some(match (tag, kind) {
        ("integrator", "volpath_simple") => "volpath",
        ("film", "ldrfilm" | "tiledhdrfilm" | "mfilm") => "hdrfilm",
        ("sampler", "halton" | "hammersley" | "sobol") => "independent",
        ("texture", "gridtexture") => "checkerboard",
        _ => return None,
    })
}

/// The properties of an element whose children are complete.
pub(super) fn properties(tree: &mut Tree, id: NodeId) {
    let node = tree.node(id);
    let (tag, kind) = (node.tag.clone(), node.attribute("type").unwrap_or_default().to_owned());
    let children = node.children.clone();
    let rename = |tree: &mut Tree, from: &str, to: &str| {
        for child in &children {
            let child = tree.node_mut(*child);
            if child.attribute("name") == Some(from) {
                child.set("name", to.to_owned());
            }
        }
    };
    match (tag.as_str(), kind.as_str()) {
        ("bsdf", "diffuse") => rename(tree, "diffuse_reflectance", "reflectance"),
        ("medium", "heterogeneous") => rename(tree, "density", "sigma_t"),
        ("texture", _) => {
            uv_transform(tree, id, &children);
            filter(tree, &children);
        }
        _ => {}
    }
}

/// Pictures were filtered by pyramids; what is left between pixels is the same.
fn filter(tree: &mut Tree, children: &[NodeId]) {
    for child in children {
        let node = tree.node_mut(*child);
        if node.attribute("name") == Some("filter_type") && matches!(node.attribute("value"), Some("ewa" | "trilinear"))
        {
            node.set("value", "bilinear".to_owned());
        }
    }
}

/// `uoffset`, `voffset`, `uscale` and `vscale` in one transform.
fn uv_transform(tree: &mut Tree, id: NodeId, children: &[NodeId]) {
    let mut take = |name: &str, usual: &str| {
        let found = children.iter().find(|c| tree.node(**c).attribute("name") == Some(name))?;
        tree.node_mut(id).children.retain(|c| c != found);
        Some(tree.node(*found).attribute("value").unwrap_or(usual).to_owned())
    };
    let offset = [take("uoffset", "0"), take("voffset", "0")];
    let scale = [take("uscale", "1"), take("vscale", "1")];
    if offset.iter().chain(&scale).all(Option::is_none) {
        return;
    }
    let (source, line) = (tree.node(id).source, tree.node(id).line);
    let mut add = |tag: &str, attributes: Vec<Attribute>, children: Vec<NodeId>| {
        let id = NodeId(tree.nodes.len() as u32);
        tree.nodes.push(Node { id, tag: tag.to_owned(), attributes, children, text: None, source, line });
        id
    };
    let xy = |[x, y]: [Option<String>; 2], usual: &str| {
        let value = |v: Option<String>| v.unwrap_or_else(|| usual.to_owned());
        vec![Attribute::new("x", value(x)), Attribute::new("y", value(y))]
    };
    let translate = add("translate", xy(offset, "0"), Vec::new());
    let scale = add("scale", xy(scale, "1"), Vec::new());
    let name = vec![Attribute::new("name", "to_uv".to_owned())];
    let transform = add("transform", name, vec![translate, scale]);
    tree.node_mut(id).children.push(transform);
}

/// `toWorld` as `to_world`, `intIOR` as `int_ior`.
fn snake_case(name: &str) -> String {
    let mut result = String::with_capacity(name.len() + 4);
    let mut before = ' ';
    let mut is_capital = false;
    for c in name.chars() {
        if c.is_ascii_uppercase() && before.is_ascii_lowercase() {
            result.push('_');
            is_capital = true;
        }
        is_capital &= c.is_ascii_uppercase();
        result.push(if is_capital { c.to_ascii_lowercase() } else { c });
        before = c;
    }
    result
}

/// An sRGB colour as three linear numbers.
fn linear(value: &str) -> Option<String> {
    let numbers: Vec<f64> = match value.trim().strip_prefix('#') {
        Some(hex) if hex.len() == 6 && hex.is_ascii() => {
            let byte = |i: usize| u8::from_str_radix(&hex[i..i + 2], 16).ok().map(|b| f64::from(b) / 255.0);
            [byte(0)?, byte(2)?, byte(4)?].to_vec()
        }
        Some(_) => return None,
        None => {
            let words = value.split([',', ' ']).filter(|n| !n.is_empty());
            words.map(|n| n.parse().ok()).collect::<Option<_>>()?
        }
    };
    let decode = |c: f64| if c <= 0.040_45 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) };
    Some(numbers.iter().map(|c| decode(*c).to_string()).collect::<Vec<_>>().join(" "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_those_of_today() {
        for (old, new) in [
            ("toWorld", "to_world"),
            ("intIOR", "int_ior"),
            ("maxDepth", "max_depth"),
            ("alphaU", "alpha_u"),
            ("sigmaT", "sigma_t"),
            ("to_world", "to_world"),
            ("Kd", "Kd"),
        ] {
            assert_eq!(snake_case(old), new);
        }
    }

    #[test]
    fn srgb_colours_become_linear() {
        let close = |text: &str, due: [f64; 3]| {
            let got: Vec<f64> = linear(text).unwrap().split(' ').map(|n| n.parse().unwrap()).collect();
            assert!(got.iter().zip(due).all(|(a, b)| (a - b).abs() < 1e-6), "{got:?}");
        };
        close("#ff0080", [1.0, 0.0, 0.215_860_5]);
        close("0.5, 0.5, 0.02", [0.214_041_1, 0.214_041_1, 0.001_547_99]);
        assert_eq!(linear("#ff"), None);
        assert_eq!(linear("#ÿ00ff"), None);
    }
}
