//! A number for what a scene is, without who looks at it.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use fogbow::bytes::Crc;

use super::element::{Context, Element};
use super::{collect, document, file_error};
use crate::error::{SceneError, read_file};

/// The same number for two scenes whose light is the same everywhere: it depends on all elements in their order
/// and on the bytes of all files they name, but not on camera, film, integrator, white space or comments.
///
/// # Errors
/// A file that cannot be read.
pub fn fingerprint(file: &Path) -> Result<u64, SceneError> {
    let whole = |reason: String| file_error(file, None, reason);
    let bytes = read_file(file).map_err(|e| whole(e.reason))?;
    let text = String::from_utf8(bytes).map_err(|e| whole(format!("is not UTF-8 text: {e}")))?;
    let document = document(file, &text)?;
    let mut context = Context { file: file.to_owned(), defaults: BTreeMap::new(), ids: HashMap::new() };
    collect(&document, &mut context)?;
    let mut crc = Crc::new();
    for child in (Element { node: document.root_element(), context: &context }).children()? {
        match child.tag() {
            // Values of defaults count where they are used.
            "sensor" | "integrator" | "default" => {}
            _ => add(&child, &mut crc)?,
        }
    }
    Ok(crc.value())
}

fn add(element: &Element<'_>, crc: &mut Crc) -> Result<(), SceneError> {
    // Zero bytes keep neighbours apart: they do not occur in XML.
    let mut text = |text: &str| {
        crc.add(text.as_bytes());
        crc.add(&[0]);
    };
    text(element.tag());
    for attribute in element.node.attributes() {
        text(attribute.name());
        text(&element.optional(attribute.name())?.unwrap_or_default());
    }
    if element.node.attribute("name") == Some("filename") {
        let path = element.context.resolve(&element.required("value")?);
        let bytes = read_file(&path).map_err(|e| element.data_error(&e))?;
        crc.add(&(bytes.len() as u64).to_le_bytes());
        crc.add(&bytes);
    }
    for child in element.children()? {
        add(&child, crc)?;
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
