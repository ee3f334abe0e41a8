//! Broken scene files: every one is an error that says where and what.

use super::common::{Folder, SCENE};

/// The scene with one piece replaced, and what the error must mention.
const CASES: &[(&str, &str, &[&str])] = &[
    // The file.
    ("</scene>", "", &["scene.xml:", "not well-formed"]),
    ("<scene version=\"3.0.0\">", "<picture version=\"3.0.0\">", &["scene.xml", "well-formed"]),
    ("version=\"3.0.0\"", "version=\"0.4\"", &["<scene>", "\"version\"", "0.4"]),
    (" version=\"3.0.0\"", "", &["<scene>", "\"version\"", "missing"]),
    ("<default name=\"spp\" value=\"4\"/>", "", &["$spp", "\"value\"", "<default>"]),
    ("<default name=\"spp\" value=\"4\"/>", "<default name=\"spp\" value=\"many\"/>", &["sample_count", "many"]),
    ("<default name=\"spp\"", "<textur/><default name=\"spp\"", &["<textur>", "unknown element inside <scene>"]),
    ("<default name=\"spp\"", "hello <default name=\"spp\"", &["<scene>", "unexpected text \"hello\""]),
    // Elements, properties and their types.
    ("type=\"volpath\"", "type=\"guess\"", &["scene.xml:3: <integrator type=\"guess\">", "\"type\"", "volpath"]),
    ("name=\"max_depth\" value=\"8\"", "name=\"max_depth\" value=\"-2\"", &["<integer name=\"max_depth\">", "-2"]),
    ("name=\"max_depth\" value=\"8\"", "name=\"max_depth\" value=\"1.5\"", &["max_depth", "not a whole number"]),
    ("name=\"max_depth\"", "name=\"max_dept\"", &["<integer name=\"max_dept\">", "no property \"max_dept\""]),
    (
        "<integer name=\"max_depth\" value=\"8\"/>",
        "<float name=\"max_depth\" value=\"8\"/>",
        &["<float name=\"max_depth\">", "must be a <integer>"],
    ),
    (
        "<float name=\"fov\" value=\"36\"/>",
        "<string name=\"fov\" value=\"36\"/>",
        &["<string name=\"fov\">", "must be a <float>"],
    ),
    (
        "<float name=\"fov\" value=\"36\"/>",
        "<float name=\"fov\" value=\"36\" unit=\"deg\"/>",
        &["<float name=\"fov\">", "\"unit\""],
    ),
    ("<float name=\"fov\" value=\"36\"/>", "<float name=\"fov\"/>", &["<float name=\"fov\">", "\"value\"", "missing"]),
    ("<float name=\"fov\" value=\"36\"/>", "<float value=\"36\"/>", &["<float>", "\"name\"", "missing"]),
    (
        "<float name=\"fov\" value=\"36\"/>",
        "<string name=\"focal_length\" value=\"long\"/>",
        &["<string name=\"focal_length\">", "50mm"],
    ),
    ("name=\"fov\" value=\"36\"", "name=\"fov\" value=\"180\"", &["<float name=\"fov\">", "180", "(0, 180)"]),
    ("name=\"fov\" value=\"36\"", "name=\"fov\" value=\"0\"", &["<float name=\"fov\">", "(0, 180)"]),
    ("name=\"fov\" value=\"36\"", "name=\"fov\" value=\"nan\"", &["<float name=\"fov\">", "not a finite number"]),
    ("name=\"fov\" value=\"36\"", "name=\"fov\" value=\"wide\"", &["<float name=\"fov\">", "\"wide\" is not a number"]),
    (
        "name=\"fov\" value=\"36\"/>",
        "name=\"fov\" value=\"36\"/><float name=\"fov\" value=\"40\"/>",
        &["<float name=\"fov\">", "twice"],
    ),
    ("value=\"x\"", "value=\"z\"", &["<string name=\"fov_axis\">", "smaller"]),
    ("name=\"near_clip\" value=\"0.01\"", "name=\"near_clip\" value=\"0\"", &["near_clip", "greater than 0"]),
    ("name=\"far_clip\" value=\"1000\"", "name=\"far_clip\" value=\"0.001\"", &["far_clip", "beyond near_clip"]),
    ("name=\"far_clip\" value=\"1000\"", "name=\"far_clip\" value=\"4\"", &["<sensor", "far_clip", "cut the scene"]),
    ("target=\"0, 0, 0\" up=\"0, 1, 0\"", "target=\"0, 0, 4\" up=\"0, 1, 0\"", &["<lookat>", "coincide"]),
    ("target=\"0, 0, 0\" up=\"0, 1, 0\"", "target=\"0, 0, 0\" up=\"0, 0, 1\"", &["<lookat>", "parallel"]),
    ("origin=\"0, 0, 4\"", "origin=\"0, 0\"", &["<lookat>", "\"origin\"", "three"]),
    ("origin=\"0, 0, 4\"", "origin=\"0, inf, 4\"", &["<lookat>", "\"origin\"", "finite"]),
    (
        "up=\"0, 1, 0\"/></transform>",
        "up=\"0, 1, 0\"/><scale value=\"2\"/></transform>",
        &["<transform name=\"to_world\">", "camera", "scaled"],
    ),
    ("name=\"width\" value=\"8\"", "name=\"width\" value=\"0\"", &["<integer name=\"width\">", "0 is outside"]),
    ("name=\"width\" value=\"8\"", "name=\"width\" value=\"70000\"", &["<integer name=\"width\">", "65536"]),
    (
        "\"width\" value=\"8\"/><integer name=\"height\" value=\"6\"",
        "\"width\" value=\"60000\"/><integer name=\"height\" value=\"60000\"",
        &["<film type=\"hdrfilm\">", "pixels"],
    ),
    ("<rfilter type=\"box\"/>", "<rfilter type=\"gauss\"/>", &["<rfilter type=\"gauss\">", "\"gaussian\" meant"]),
    ("<sensor type=\"perspective\">", "<sensor type=\"thinlens\">", &["<sensor type=\"thinlens\">", "aperture_radius"]),
    // Media.
    ("value=\"0.9 0.8 0.7\"", "value=\"2 2 2\"", &["<rgb name=\"albedo\">", "2 is outside [0, 1]"]),
    ("value=\"0.9 0.8 0.7\"", "value=\"0.9 0.8\"", &["<rgb name=\"albedo\">", "2 numbers"]),
    ("value=\"0.9 0.8 0.7\"", "value=\"-1 0 0\"", &["<rgb name=\"albedo\">", "negative"]),
    ("name=\"g\" value=\"0.6\"", "name=\"g\" value=\"1\"", &["<float name=\"g\">", "anisotropy 1 is outside (-1, 1)"]),
    ("name=\"g\" value=\"0.6\"", "name=\"g\" value=\"-1.5\"", &["<float name=\"g\">", "anisotropy"]),
    ("name=\"scale\" value=\"3.5\"", "name=\"scale\" value=\"-1\"", &["<float name=\"scale\">", "-1 is outside"]),
    ("<phase type=\"rayleigh\"/>", "", &["<phase type=\"blendphase\">", "two"]),
    ("type=\"rayleigh\"", "type=\"mie\"", &["<phase type=\"mie\">", "rayleigh"]),
    ("<rgb name=\"sigma_s\" value=\"1 1 1\"/>", "", &["sigma_a", "needs sigma_s"]),
    (
        "<rgb name=\"sigma_s\" value=\"1 1 1\"/>",
        "<rgb name=\"sigma_s\" value=\"1e39 1 1\"/>",
        &["<rgb name=\"sigma_s\">", "finite"],
    ),
    ("value=\"grid.vol\"", "value=\"none.vol\"", &["<string name=\"filename\">", "none.vol", "cannot be read"]),
    ("<translate x=\"-0.5\" y=\"-0.5\" z=\"-0.5\"/>", "<scale x=\"0\"/>", &["<scale>", "scale of 0"]),
    (
        "<translate x=\"-0.5\" y=\"-0.5\" z=\"-0.5\"/>",
        "<matrix value=\"1 0 0 1 0 0 0 0 1\"/>",
        &["<transform name=\"to_world\">", "undone"],
    ),
    ("<translate x=\"-0.5\" y=\"-0.5\" z=\"-0.5\"/>", "<rotate angle=\"20\"/>", &["<rotate>", "axis"]),
    ("<translate x=\"-0.5\" y=\"-0.5\" z=\"-0.5\"/>", "<shear/>", &["<shear>", "unknown element inside <transform>"]),
    ("id=\"drink\">", "id=\"smoke\">", &["<medium type=\"homogeneous\" id=\"smoke\">", "\"id\"", "twice"]),
    (
        "<ref name=\"interior\" id=\"smoke\"/>",
        "<ref name=\"interior\" id=\"fume\"/>",
        &["<ref name=\"interior\" id=\"fume\">", "\"id\"", "fume"],
    ),
    (
        "<ref name=\"interior\" id=\"smoke\"/>",
        "<ref name=\"interior\" id=\"grey\"/>",
        &["<ref name=\"interior\" id=\"grey\">", "<bsdf>"],
    ),
    ("<ref name=\"exterior\" id=\"smoke\"/>", "", &["<shape type=\"sphere\">", "exterior"]),
    (
        "value=\"0.3\"/>\n    <bsdf type=\"dielectric\">",
        "value=\"0.9\"/>\n    <bsdf type=\"dielectric\">",
        &["<shape type=\"sphere\">", "overlaps in part"],
    ),
    (
        "<shape type=\"cube\" id=\"container\">",
        "<shape type=\"rectangle\" id=\"container\">",
        &["<shape type=\"rectangle\" id=\"container\">", "only a closed shape"],
    ),
    ("origin=\"0, 0, 4\"", "origin=\"0, 0, 0.9\"", &["<sensor type=\"perspective\">", "medium", "smoke"]),
    // Shapes and what they are made of.
    (
        "<shape type=\"cube\" id=\"container\">",
        "<shape type=\"torus\" id=\"container\">",
        &["<shape type=\"torus\" id=\"container\">", "\"type\""],
    ),
    (
        "<float name=\"radius\" value=\"0.3\"/>\n    <bsdf type=\"conductor\">",
        "<float name=\"radius\" value=\"0\"/>\n    <bsdf type=\"conductor\">",
        &["<float name=\"radius\">", "greater than 0"],
    ),
    (
        "<string name=\"material\" value=\"none\"/>",
        "<string name=\"material\" value=\"Aurum\"/>",
        &["<string name=\"material\">", "Aurum"],
    ),
    ("value=\"water\"", "value=\"wine\"", &["<string name=\"int_ior\">", "wine", "water"]),
    (
        "<float name=\"ext_ior\" value=\"1\"/>",
        "<float name=\"ext_ior\" value=\"0\"/>",
        &["<float name=\"ext_ior\">", "outside"],
    ),
    ("value=\"0.5 0.5 0.5\"", "value=\"0.5 1.5 0.5\"", &["<rgb name=\"reflectance\">", "1.5 is outside [0, 1]"]),
    ("<bsdf type=\"diffuse\">", "<bsdf type=\"velvet\">", &["<bsdf type=\"velvet\">", "diffuse"]),
    (
        "<bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"0.5 0.5 0.5\"/></bsdf>",
        "<bsdf type=\"null\"/>",
        &["<bsdf type=\"null\">", "two-sided"],
    ),
    (
        "<boolean name=\"face_normals\" value=\"true\"/>",
        "<boolean name=\"face_normals\" value=\"yes\"/>",
        &["<boolean name=\"face_normals\">", "yes"],
    ),
    ("value=\"mesh.ply\"", "value=\"grid.vol\"", &["grid.vol", "header", "ply"]),
    ("<ref id=\"grey\"/>", "<ref id=\"grey\" colour=\"red\"/>", &["<ref id=\"grey\">", "\"colour\""]),
    ("<ref id=\"grey\"/>", "<ref id=\"grey\"/><ref id=\"grey\"/>", &["<ref id=\"grey\">", "once more"]),
    // Lights.
    ("value=\"15 13 10\"", "value=\"15 -13 10\"", &["<rgb name=\"radiance\">", "-13 is negative"]),
    ("<emitter type=\"area\">", "<emitter type=\"point\">", &["<emitter type=\"point\">", "area"]),
    (
        "name=\"cutoff_angle\" value=\"30\"",
        "name=\"cutoff_angle\" value=\"0\"",
        &["<float name=\"cutoff_angle\">", "outside"],
    ),
    (
        "name=\"beam_width\" value=\"20\"",
        "name=\"beam_width\" value=\"40\"",
        &["<float name=\"beam_width\">", "[0, 30]"],
    ),
    (
        "<emitter type=\"envmap\">",
        "<emitter type=\"constant\"/><emitter type=\"envmap\">",
        &["<emitter type=\"envmap\">", "only one"],
    ),
    ("value=\"sky.pfm\"", "value=\"sky.gif\"", &["sky.gif", "kind of image"]),
    ("<emitter type=\"envmap\">", "<emitter type=\"sunsky\">", &["<emitter type=\"sunsky\">", "\"type\""]),
];

#[test]
fn the_scene_itself_is_sound() {
    let folder = Folder::new("sound");
    folder.build(SCENE).unwrap();
}

#[test]
fn every_broken_scene_is_an_error_that_says_where() {
    let folder = Folder::new("broken-scenes");
    assert!(CASES.len() >= 40);
    let mut failures = Vec::new();
    for (whole, broken, mentions) in CASES {
        assert!(SCENE.contains(whole), "the scene does not hold {whole}");
        let text = SCENE.replacen(whole, broken, 1);
        let error = match folder.build(&text) {
            Ok(()) => "nothing: it was accepted".to_owned(),
            Err(error) => error.to_string(),
        };
        let missing: Vec<_> = ["scene.xml"].iter().chain(*mentions).filter(|m| !error.contains(**m)).collect();
        if !missing.is_empty() {
            failures.push(format!("{broken}\n    gives \"{error}\", which does not mention {missing:?}"));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn lines_are_counted_from_one() {
    let folder = Folder::new("lines");
    let error = folder.build(&SCENE.replacen("value=\"36\"", "value=\"x\"", 1)).unwrap_err();
    assert_eq!(error.line, Some(5));
    assert_eq!(error.attribute.as_deref(), Some("value"));
    assert!(
        error.to_string().ends_with("scene.xml:5: <float name=\"fov\">: attribute \"value\": \"x\" is not a number")
    );
}

#[test]
fn missing_folders_and_other_files_are_errors() {
    let folder = Folder::new("missing");
    let read = |name: &str| fogbow_examples::scene_file::SceneFile::read(&folder.path(name)).unwrap_err().to_string();
    assert!(read("none.xml").contains("none.xml: cannot be read"));
    assert!(read(".").contains("is not a file"));
    folder.write("latin.xml", b"<scene version=\"3.0.0\" \xFF/>");
    assert!(read("latin.xml").contains("UTF-8"));
    folder.write("empty.xml", b"");
    assert!(read("empty.xml").contains("well-formed"));
}

#[test]
fn deep_nesting_and_many_elements_are_survived() {
    let folder = Folder::new("deep");
    let deep = format!("<scene version=\"3.0.0\">{}{}</scene>", "<a>".repeat(200_000), "</a>".repeat(200_000));
    assert!(folder.build(&deep).is_err());
}
