//! A number for what a scene is, without who looks at it.

use std::path::Path;

use fogbow::bytes::Crc;

use super::element::{Context, Element};
use super::notes::Sink;
use super::tree::Node;
use super::{ReadOptions, gltf_scene, preprocess};
use crate::error::{SceneError, read_file};

/// The same number for two scenes whose light is the same everywhere: it depends on all elements in their order
/// and on the bytes of all files they name, but not on camera, film, integrator, white space or comments.
///
/// # Errors
/// A file that cannot be read.
pub fn fingerprint(file: &Path) -> Result<u64, SceneError> {
    fingerprint_with(file, &ReadOptions::default())
}

/// [`fingerprint`] of a scene that is read with options.
///
/// # Errors
/// A file that cannot be read.
pub fn fingerprint_with(file: &Path, options: &ReadOptions) -> Result<u64, SceneError> {
    if gltf_scene::is_named(file) {
        return gltf_scene::fingerprint(file, options);
    }
    let sink = Sink::new(options.is_lenient);
    let tree = preprocess::read(file, &preprocess::text_of(file)?, &options.parameters, &sink)?;
    let context = Context { tree, sink };
    let mut crc = Crc::new();
    let root = Element::root(&context);
    for child in &root.node.children {
        let child = context.tree.node(*child);
        // Values of parameters count where they are used.
        if child.tag != "sensor" && child.tag != "integrator" {
            add(child, &context, &mut crc)?;
        }
    }
    Ok(crc.value())
}

fn add(node: &Node, context: &Context, crc: &mut Crc) -> Result<(), SceneError> {
    // Zero bytes keep neighbours apart: they do not occur in XML.
    let mut text = |text: &str| {
        crc.add(text.as_bytes());
        crc.add(&[0]);
    };
    text(&node.tag);
    for attribute in node.attributes() {
        text(attribute.name());
        text(attribute.value());
    }
    let named = match node.attribute("name") {
        Some("filename") => node.attribute("value"),
        _ => node.attribute("filename"),
    };
    if let Some(name) = named {
        let bytes =
            read_file(&context.tree.resolve(node, name)).map_err(|e| preprocess::error_at(&context.tree, node, e))?;
        crc.add(&(bytes.len() as u64).to_le_bytes());
        crc.add(&bytes);
    }
    for child in &node.children {
        add(context.tree.node(*child), context, crc)?;
    }
    crc.add(&[1]);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_tells_scenes_apart_and_not_cameras() {
        let folder = std::env::temp_dir().join(format!("fogbow-fingerprint-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let file = folder.join("scene.xml");
        let of = |text: &str| {
            std::fs::write(&file, text).unwrap();
            fingerprint(&file).unwrap()
        };
        std::fs::write(folder.join("a.ply"), "one").unwrap();
        std::fs::write(folder.join("b.ply"), "two").unwrap();
        let scene = r#"<scene version="3.0.0"><default name="mesh" value="a.ply"/><sensor type="perspective"><float name="fov"
            value="36"/></sensor><shape type="ply"><string name="filename" value="$mesh"/></shape></scene>"#;
        let first = of(scene);
        for same in
            [scene.replace("36", "40"), scene.replace("<shape", "<!-- a shape --> <shape"), scene.replace("\n", " ")]
        {
            assert_eq!(of(&same), first, "{same}");
        }
        let with = |from: &str, to: &str| scene.replace(from, to);
        for other in [with("a.ply", "b.ply"), with("\"ply\"", "\"obj\""), with("<shape type", "<shape id=\"x\" type")] {
            assert_ne!(of(&other), first, "{other}");
        }
        std::fs::write(folder.join("a.ply"), "two").unwrap();
        assert_ne!(of(scene), first);
        std::fs::write(&file, with("a.ply", "c.ply")).unwrap();
        assert!(fingerprint(&file).unwrap_err().to_string().contains("c.ply"));
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
