//! `examples/READ.md` tells what is read of other programs' scenes: written from what reading does, kind by kind, and held to it.
//!
//! `FOGBOW_WRITE=1 cargo test -p fogbow-examples --test all reads` writes it anew.

use std::fmt::Write as _;
use std::path::Path;

use fogbow_examples::scene_file::{Findings, NoteKind, ReadOptions, SceneFile};

const FOLDER: &str = env!("CARGO_MANIFEST_DIR");

/// Elements of Mitsuba with the types that version 3.9 has of them, but for those of measurement and differentiation.
const MITSUBA: [(&str, &str); 12] = [
    ("integrator", "path volpath volpathmis direct ptracer prb prbvolpath aov moment stokes depth"),
    ("sensor", "perspective thinlens orthographic radiancemeter irradiancemeter distant batch"),
    ("film", "hdrfilm specfilm"),
    ("rfilter", "box tent gaussian mitchell catmullrom lanczos"),
    ("shape", "rectangle cube sphere disk cylinder ply obj serialized linearcurve bsplinecurve sdfgrid ellipsoids"),
    (
        "bsdf",
        "diffuse dielectric thindielectric roughdielectric conductor roughconductor plastic roughplastic principled \
         principledthin twosided mask blendbsdf bumpmap normalmap null hair measured pplastic polarizer retarder circular",
    ),
    ("emitter", "area point spot projector directional constant envmap directionalarea sunsky"),
    ("texture", "bitmap checkerboard mesh_attribute volume"),
    ("medium", "homogeneous heterogeneous"),
    ("volume", "constvolume gridvolume"),
    ("phase", "isotropic hg rayleigh blendphase sggx tabphase"),
    ("spectrum", "uniform d65 srgb blackbody regular irregular"),
];

/// Directives of pbrt-v4 with their types.
const PBRT: [(&str, &str); 10] = [
    ("Camera", "perspective orthographic realistic spherical"),
    ("Integrator", "volpath path bdpt sppm simplevolpath"),
    ("PixelFilter", "box triangle gaussian mitchell sinc"),
    ("Shape", "sphere disk cylinder trianglemesh bilinearmesh plymesh loopsubdiv curve"),
    (
        "Material",
        "diffuse coateddiffuse conductor coatedconductor dielectric thindielectric diffusetransmission mix interface hair \
         measured subsurface",
    ),
    ("Texture", "imagemap checkerboard constant scale fbm marble mix wrinkled"),
    ("LightSource", "point spot distant infinite goniometric projection"),
    ("AreaLightSource", "diffuse"),
    ("MakeNamedMedium", "homogeneous uniformgrid nanovdb cloud rgbgrid"),
    ("Sampler", "halton sobol independent zsobol"),
];

fn mitsuba(tag: &str, kind: &str) -> String {
    let file = |name: &str| format!("<string name=\"filename\" value=\"{FOLDER}/tests/shapes/{name}\"/>");
    let diffuse = "<bsdf type=\"diffuse\"/>";
    let pattern = format!("<texture type=\"bitmap\">{}</texture>", file("pattern.png"));
    let inside = match (tag, kind) {
        ("integrator", "aov" | "moment" | "stokes") => "<integrator type=\"path\"/>".to_owned(),
        ("sensor", "thinlens") => "<float name=\"aperture_radius\" value=\"0.1\"/>".to_owned(),
        ("shape", "ply") => file("sheet.ply"),
        ("shape", "obj") => file("sheet.obj"),
        ("shape", "serialized") => file("two.serialized"),
        ("shape", "linearcurve" | "bsplinecurve") => file("curve.txt"),
        ("bsdf", "twosided" | "mask") => diffuse.to_owned(),
        ("bsdf", "blendbsdf") => format!("<float name=\"weight\" value=\"0.5\"/>{diffuse}<bsdf type=\"conductor\"/>"),
        ("bsdf", "bumpmap") => format!("{pattern}{diffuse}"),
        ("bsdf", "normalmap") => format!("{}{diffuse}", pattern.replace("<texture", "<texture name=\"normalmap\"")),
        ("emitter", "envmap") => {
            format!("<string name=\"filename\" value=\"{FOLDER}/scenes/textures/evening-sky-64x32.pfm\"/>")
        }
        ("texture", "bitmap") => file("pattern.png"),
        ("texture", "mesh_attribute") => "<string name=\"name\" value=\"vertex_color\"/>".to_owned(),
        ("texture", "volume") => "<volume type=\"constvolume\"><rgb name=\"value\" value=\"0.5\"/></volume>".to_owned(),
        ("medium", "heterogeneous") => {
            format!("<volume name=\"sigma_t\" type=\"gridvolume\">{}</volume>", file("grey.vol"))
        }
        ("volume", "constvolume") => "<float name=\"value\" value=\"1\"/>".to_owned(),
        ("volume", "gridvolume") => file("grey.vol"),
        ("phase", "blendphase") => {
            "<float name=\"weight\" value=\"0.5\"/><phase type=\"isotropic\"/><phase type=\"rayleigh\"/>".to_owned()
        }
        ("spectrum", "srgb") => "<rgb name=\"color\" value=\"0.1, 0.2, 0.3\"/>".to_owned(),
        ("spectrum", "blackbody") => "<float name=\"temperature\" value=\"5000\"/>".to_owned(),
        ("spectrum", "regular") => "<string name=\"values\" value=\"1, 2\"/>".to_owned(),
        ("spectrum", "irregular") => {
            "<string name=\"wavelengths\" value=\"400, 700\"/><string name=\"values\" value=\"1, 2\"/>".to_owned()
        }
        _ => String::new(),
    };
    let ball = |inside: &str| format!("<shape type=\"sphere\">{inside}</shape>");
    let name = match tag {
        "texture" => " name=\"reflectance\"",
        "volume" => " name=\"sigma_t\"",
        "spectrum" => " name=\"radiance\"",
        _ => "",
    };
    let element = format!("<{tag}{name} type=\"{kind}\">{inside}</{tag}>");
    let medium = |inside: &str| {
        ball(&format!("<bsdf type=\"null\"/><medium name=\"interior\" type=\"heterogeneous\">{inside}</medium>"))
    };
    let body = match (tag, kind) {
        ("film", _) => format!("<sensor type=\"perspective\">{element}</sensor>"),
        ("rfilter", _) => format!("<sensor type=\"perspective\"><film type=\"hdrfilm\">{element}</film></sensor>"),
        ("bsdf", _) | ("emitter", "area") => ball(&element),
        ("texture", "mesh_attribute") => {
            format!("<shape type=\"ply\">{}<bsdf type=\"diffuse\">{element}</bsdf></shape>", file("sheet.ply"))
        }
        ("texture", _) => ball(&format!("<bsdf type=\"diffuse\">{element}</bsdf>")),
        ("medium", _) => {
            ball(&format!("<bsdf type=\"null\"/>{}", element.replacen("<medium", "<medium name=\"interior\"", 1)))
        }
        ("volume", _) => medium(&element),
        ("phase", _) => medium(&format!(
            "{element}<volume name=\"sigma_t\" type=\"constvolume\"><float name=\"value\" value=\"1\"/></volume>"
        )),
        ("spectrum", _) => ball(&format!("<emitter type=\"area\">{element}</emitter>")),
        _ => element,
    };
    // Where it stands matters where there are media.
    let camera = match tag {
        "sensor" | "film" | "rfilter" => "",
        _ => "<sensor type=\"perspective\"><transform name=\"to_world\"><translate z=\"50\"/></transform></sensor>",
    };
    format!("<scene version=\"3.0.0\">{camera}{body}</scene>")
}

fn pbrt(directive: &str, kind: &str) -> String {
    let sphere = "Shape \"sphere\"";
    let ply = format!("\"string filename\" \"{FOLDER}/tests/shapes/sheet.ply\"");
    let triangle = "\"point3 P\" [ 0 0 0 1 0 0 0 1 0 ] \"integer indices\" [ 0 1 2 ]";
    let inside = match kind {
        "trianglemesh" | "loopsubdiv" => triangle.to_owned(),
        "bilinearmesh" => "\"point3 P\" [ 0 0 0 1 0 0 0 1 0 1 1 0 ]".to_owned(),
        "plymesh" => ply,
        "mix" if directive == "Material" => "\"string materials\" [ \"a\" \"a\" ]".to_owned(),
        "imagemap" | "projection" => format!("\"string filename\" \"{FOLDER}/tests/shapes/pattern.png\""),
        "uniformgrid" => "\"float density\" [ 1 ]".to_owned(),
        "nanovdb" => format!("\"string filename\" \"{FOLDER}/scenes/volumes/cloud-94x32x73.nvdb\""),
        _ => String::new(),
    };
    let thing = format!("{directive} \"{kind}\" {inside}");
    match directive {
        "Camera" | "Integrator" | "PixelFilter" | "Sampler" => format!("{thing}\nWorldBegin\n{sphere}"),
        "Material" => format!("WorldBegin\nMakeNamedMaterial \"a\" \"string type\" \"diffuse\"\n{thing}\n{sphere}"),
        "Texture" => format!(
            "WorldBegin\nTexture \"t\" \"spectrum\" \"{kind}\" {inside}\nMaterial \"diffuse\" \"texture reflectance\" \"t\"\n{sphere}"
        ),
        "AreaLightSource" => format!("WorldBegin\n{thing}\n{sphere}"),
        "MakeNamedMedium" => format!(
            "LookAt 0 0 9 0 0 0 0 1 0\nCamera \"perspective\"\nWorldBegin\nMakeNamedMedium \"m\" \"string type\" \"{kind}\" {inside}\nMediumInterface \"m\" \"\"\nMaterial \"interface\"\n{sphere}"
        ),
        _ => format!("WorldBegin\n{thing}"),
    }
}

/// Whether it is read; if not, what becomes of it.
fn verdict(read: impl Fn(bool) -> Findings) -> Result<(), String> {
    let strict = read(false);
    let reason = |text: &str| text.split(';').next().unwrap_or(text).replace('|', "/").replace(FOLDER, "");
    let Some(error) = strict.errors.first() else { return Ok(()) };
    let lenient = read(true);
    let replaced = lenient.notes.iter().find(|note| note.kind == NoteKind::Replaced);
    Err(match (lenient.scene, replaced) {
        (Some(_), Some(note)) => format!("with `--lenient`: {}", reason(&note.text.reason)),
        _ => format!("refused: {}", reason(&error.reason)),
    })
}

fn table(kinds: &[(&str, &str)], what: &str, read: impl Fn(&str, &str, bool) -> Findings) -> String {
    let (mut page, mut others) = (format!("| {what} | read |\n|---|---|\n"), String::new());
    for (element, kinds) in kinds {
        let mut known = Vec::new();
        for kind in kinds.split_whitespace() {
            match verdict(|is_lenient| read(element, kind, is_lenient)) {
                Ok(()) => known.push(format!("`{kind}`")),
                Err(reason) => writeln!(others, "| `{element}` | `{kind}` | {reason} |").unwrap(),
            }
        }
        writeln!(page, "| `{element}` | {} |", known.join(", ")).unwrap();
    }
    format!("{page}\n| {what} | type | what becomes of it |\n|---|---|---|\n{others}")
}

fn page() -> String {
    let options = |is_lenient| ReadOptions { is_lenient, ..ReadOptions::default() };
    let of_mitsuba = table(&MITSUBA, "element", |tag, kind, is_lenient| {
        SceneFile::parse_with(Path::new("a.xml"), &mitsuba(tag, kind), &options(is_lenient))
    });
    let of_pbrt = table(&PBRT, "directive", |directive, kind, is_lenient| {
        SceneFile::from_pbrt(Path::new("a.pbrt"), &pbrt(directive, kind), &options(is_lenient))
    });
    format!(
        "# What is read of other programs' scenes\n\n\
         Written by a test (`examples/tests/reads.rs`) from what reading does with the smallest scene of each type, so it is true. What a\n\
         scene holds beyond, `fogbow check SCENE` tells with file and line.\n\n\
         ## Mitsuba 3 (2 and 0.6 are upgraded)\n\n{of_mitsuba}\n\
         ## pbrt-v4\n\n{of_pbrt}\n\
         ## glTF 2.0, OpenVDB, NanoVDB\n\n\
         glTF: [its section](README.md#gltf-scenes-and-fog). OpenVDB and NanoVDB: grids of numbers (`float`, `half`, `double`, and\n\
         NanoVDB's of fewer bits), any transform without perspective; packed by zip, Blosc or not. Held to 21 grids of Debian's tools\n\
         by `examples/tests/vdb.rs`.\n"
    )
}

#[test]
fn the_page_of_what_is_read_is_true() {
    let file = Path::new(FOLDER).join("READ.md");
    let page = page();
    if std::env::var_os("FOGBOW_WRITE").is_some() {
        std::fs::write(&file, &page).unwrap();
    }
    let committed = std::fs::read_to_string(&file).unwrap();
    for (line, (found, truth)) in committed.lines().zip(page.lines()).enumerate() {
        assert_eq!(found, truth, "READ.md:{}: FOGBOW_WRITE=1 writes it anew", line + 1);
    }
    assert_eq!(committed.len(), page.len());
}
