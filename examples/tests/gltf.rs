//! glTF scenes: the same as those in Mitsuba's words.

use std::path::{Path, PathBuf};
use std::process::Command;

use fogbow::math::Vec3;
use fogbow::spectrum::Spectrum;
use fogbow::surface::{Conductor, Distribution, Plastic, RoughConductor, RoughPlastic, Roughness, Surface};
use fogbow_examples::scene_file::{
    Emitter, Findings, Geometry, Matter, Mix, ReadOptions, SceneFile, fingerprint, fingerprint_with,
};

/// A folder of its own, gone when dropped.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("fogbow-gltf-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let file = self.0.join(name);
        std::fs::write(&file, bytes).unwrap();
        file
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// A rectangle: a corner and two edges.
type Quad = [[f32; 3]; 3];

/// Floor, ceiling, back, left, right; and a lamp below the ceiling.
const QUADS: [Quad; 6] = [
    [[-1.0, 0.0, 1.0], [2.0, 0.0, 0.0], [0.0, 0.0, -2.0]],
    [[-1.0, 2.0, -1.0], [2.0, 0.0, 0.0], [0.0, 0.0, 2.0]],
    [[-1.0, 0.0, -1.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]],
    [[-1.0, 0.0, 1.0], [0.0, 0.0, -2.0], [0.0, 2.0, 0.0]],
    [[1.0, 0.0, -1.0], [0.0, 0.0, 2.0], [0.0, 2.0, 0.0]],
    [[-0.25, 1.96875, -0.25], [0.5, 0.0, 0.0], [0.0, 0.0, 0.5]],
];

const COLOURS: [[f32; 3]; 6] =
    [[0.7, 0.7, 0.7], [0.7, 0.7, 0.7], [0.7, 0.7, 0.7], [0.6, 0.1, 0.05], [0.1, 0.4, 0.1], [0.0, 0.0, 0.0]];

fn corners([corner, u, v]: Quad) -> [[f32; 3]; 4] {
    let at = |a: f32, b: f32| [0, 1, 2].map(|i| corner[i] + a * u[i] + b * v[i]);
    [at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)]
}

const SIDES: [u16; 6] = [0, 1, 2, 0, 2, 3];

/// The box as a binary file.
pub(crate) fn binary_box() -> Vec<u8> {
    let mut data: Vec<u8> = SIDES.iter().flat_map(|i| i.to_le_bytes()).collect();
    data.extend(QUADS.iter().flat_map(|q| corners(*q)).flatten().flat_map(f32::to_le_bytes));
    let accessors: Vec<String> = (0..QUADS.len())
        .map(|i| format!("{{\"bufferView\":1,\"byteOffset\":{},\"componentType\":5126,\"count\":4,\"type\":\"VEC3\",\"min\":[-1,0,-1],\"max\":[1,2,1]}}", 48 * i))
        .collect();
    let meshes: Vec<String> = (1..=QUADS.len())
        .map(|i| {
            format!("{{\"primitives\":[{{\"attributes\":{{\"POSITION\":{i}}},\"indices\":0,\"material\":{}}}]}}", i - 1)
        })
        .collect();
    let material = |i: usize| {
        let [r, g, b] = COLOURS[i];
        let glow = if i == 5 {
            ",\"emissiveFactor\":[1,0.8,0.6],\"extensions\":{\"KHR_materials_emissive_strength\":{\"emissiveStrength\":16}}"
        } else {
            ""
        };
        format!(
            "{{\"pbrMetallicRoughness\":{{\"baseColorFactor\":[{r},{g},{b},1],\"metallicFactor\":0,\"roughnessFactor\":1}}{glow}}}"
        )
    };
    let materials: Vec<String> = (0..QUADS.len()).map(material).collect();
    let nodes: Vec<String> = (0..QUADS.len()).map(|i| format!("{{\"mesh\":{i}}}")).collect();
    let text = format!(
        "{{\"asset\":{{\"version\":\"2.0\"}},\"scene\":0,\"scenes\":[{{\"nodes\":[0,1,2,3,4,5,6,7]}}],\
        \"extensionsUsed\":[\"KHR_lights_punctual\",\"KHR_materials_emissive_strength\"],\
        \"extensions\":{{\"KHR_lights_punctual\":{{\"lights\":[{{\"type\":\"point\",\"color\":[1,0.5,0.25],\"intensity\":2}}]}}}},\
        \"nodes\":[{},{{\"camera\":0,\"translation\":[0,1,4]}},\
        {{\"translation\":[0.5,0.5,0.5],\"extensions\":{{\"KHR_lights_punctual\":{{\"light\":0}}}}}}],\
        \"cameras\":[{{\"type\":\"perspective\",\"perspective\":{{\"yfov\":0.7,\"znear\":0.5}}}}],\
        \"buffers\":[{{\"byteLength\":{}}}],\
        \"bufferViews\":[{{\"buffer\":0,\"byteLength\":12}},{{\"buffer\":0,\"byteOffset\":12,\"byteLength\":288}}],\
        \"accessors\":[{{\"bufferView\":0,\"componentType\":5123,\"count\":6,\"type\":\"SCALAR\"}},{}],\
        \"meshes\":[{}],\"materials\":[{}]}}",
        nodes.join(","),
        data.len(),
        accessors.join(","),
        meshes.join(","),
        materials.join(",")
    );
    glb(&text, &data)
}

fn glb(text: &str, data: &[u8]) -> Vec<u8> {
    let padded = |bytes: &[u8], with: u8| {
        let mut bytes = bytes.to_vec();
        bytes.resize(bytes.len().next_multiple_of(4), with);
        bytes
    };
    let (text, data) = (padded(text.as_bytes(), b' '), padded(data, 0));
    let word = |n: usize| (n as u32).to_le_bytes();
    let length = 12 + 8 + text.len() + 8 + data.len();
    let parts: [&[u8]; 9] =
        [b"glTF", &word(2), &word(length), &word(text.len()), b"JSON", &text, &word(data.len()), b"BIN\0", &data];
    parts.concat()
}

const FOG: &str = "[[fog]]\nshape = \"box\"\nmin = [-1, 0, -1]\nmax = [1, 2, 1]\nextinction = [0.3, 0.4, 0.5]\nalbedo = 0.9\ng = 0.5\n";

/// The same box in Mitsuba's words, with its meshes as PLY files.
fn written_box(folder: &Folder) -> PathBuf {
    let fov = f64::from(0.7_f32).to_degrees();
    let mut text = format!(
        "<scene version=\"3.0.0\"><integrator type=\"volpath\"/><sensor type=\"perspective\"><float name=\"fov\" value=\"{fov}\"/>\
        <string name=\"fov_axis\" value=\"y\"/><float name=\"near_clip\" value=\"0.5\"/>\
        <transform name=\"to_world\"><lookat origin=\"0, 1, 4\" target=\"0, 1, 0\" up=\"0, 1, 0\"/></transform>\
        <film type=\"hdrfilm\"><integer name=\"width\" value=\"1280\"/><integer name=\"height\" value=\"720\"/></film></sensor>\n"
    );
    for (i, quad) in QUADS.iter().enumerate() {
        let points: String = corners(*quad).iter().map(|[x, y, z]| format!("{x} {y} {z}\n")).collect();
        let ply = format!(
            "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
            element face 2\nproperty list uchar int vertex_indices\nend_header\n{points}3 0 1 2\n3 0 2 3\n"
        );
        folder.write(&format!("{i}.ply"), ply);
        let [r, g, b] = COLOURS[i];
        let glow =
            if i == 5 { "<emitter type=\"area\"><rgb name=\"radiance\" value=\"16 12.8 9.6\"/></emitter>" } else { "" };
        text += &format!(
            "<shape type=\"ply\"><string name=\"filename\" value=\"{i}.ply\"/><boolean name=\"face_normals\" value=\"true\"/>\
            <bsdf type=\"twosided\"><bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"{r} {g} {b}\"/></bsdf></bsdf>{glow}</shape>\n"
        );
    }
    text += "<shape type=\"cube\"><transform name=\"to_world\"><translate y=\"1\"/></transform><bsdf type=\"null\"/>\
        <medium name=\"interior\" type=\"homogeneous\"><rgb name=\"sigma_t\" value=\"0.3 0.4 0.5\"/><float name=\"albedo\" value=\"0.9\"/>\
        <phase type=\"hg\"><float name=\"g\" value=\"0.5\"/></phase></medium></shape>\n\
        <emitter type=\"point\"><point name=\"position\" x=\"0.5\" y=\"0.5\" z=\"0.5\"/><rgb name=\"intensity\" value=\"2 1 0.5\"/></emitter></scene>";
    folder.write("written.xml", text)
}

#[test]
fn the_same_box_as_xml_and_as_gltf_gives_the_same_bits() {
    let folder = Folder::new("box");
    let written = written_box(&folder);
    let modelled = folder.write("modelled.glb", binary_box());
    folder.write("modelled.fog.toml", FOG);
    let picture = |scene: &Path| {
        let output = folder.0.join("picture.pfm");
        let run = Command::new(env!("CARGO_BIN_EXE_fogbow"))
            .args(["render", "--size", "24x16", "--spp", "4", "--method", "path", "-o"])
            .args([&output, scene])
            .output()
            .unwrap();
        assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
        std::fs::read(&output).unwrap()
    };
    let (a, b) = (picture(&written), picture(&modelled));
    assert!(a == b, "pictures differ");
    // There is something in them.
    assert!(a.iter().filter(|byte| **byte != 0).count() > a.len() / 2);
}

fn read(text: &str) -> Findings {
    SceneFile::from_gltf(Path::new("room.gltf"), text.as_bytes(), &ReadOptions::default())
}

/// A triangle in a text file, with `more` in its primitive and `rest` beside it; its points are (0,0,0), (1,0,0), (0,1,0), (1,1,0).
pub(crate) fn triangle(more: &str, rest: &str) -> String {
    let data = "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAACAPwAAgD8AAAAA";
    format!(
        "{{\"asset\":{{\"version\":\"2.0\"}},\"scenes\":[{{\"nodes\":[0]}}],\
        \"buffers\":[{{\"byteLength\":48,\"uri\":\"data:application/octet-stream;base64,{data}\"}}],\
        \"bufferViews\":[{{\"buffer\":0,\"byteLength\":48}}],\
        \"accessors\":[{{\"bufferView\":0,\"componentType\":5126,\"count\":4,\"type\":\"VEC3\",\"min\":[0,0,0],\"max\":[1,1,0]}}],\
        \"meshes\":[{{\"primitives\":[{{\"attributes\":{{\"POSITION\":0}}{more}}}]}}]{rest}}}"
    )
}

#[test]
fn nodes_move_what_hangs_on_them() {
    // Scaled by 2, then a quarter turn around z, then up by 3; all of it within a node that moves by 10 along x.
    let nodes = ",\"nodes\":[{\"translation\":[10,0,0],\"children\":[1]},\
        {\"mesh\":0,\"scale\":[2,2,2],\"rotation\":[0,0,0.70710678,0.70710678],\"translation\":[0,3,0],\"children\":[2]},\
        {\"camera\":0,\"translation\":[0,0,5]}],\
        \"cameras\":[{\"type\":\"perspective\",\"perspective\":{\"aspectRatio\":1.5,\"yfov\":0.5,\"znear\":0.1,\"zfar\":100}}]";
    for (mode, triangles) in [(5, vec![[0, 1, 2], [2, 1, 3]]), (6, vec![[1, 2, 0], [2, 3, 0]])] {
        let findings = read(&triangle(&format!(",\"mode\":{mode}"), nodes));
        let scene = findings.scene.unwrap_or_else(|| panic!("{:?}", findings.errors));
        let [shape] = &scene.shapes[..] else { panic!("{} shapes", scene.shapes.len()) };
        let Geometry::Mesh(mesh) = &shape.geometry else { panic!("no mesh") };
        assert_eq!(mesh.triangles, triangles);
        for (got, wanted) in mesh.vertices.iter().zip([[10.0, 3.0], [10.0, 5.0], [8.0, 3.0], [8.0, 5.0]]) {
            assert!((*got - Vec3::new(wanted[0], wanted[1], 0.0)).length() < 1e-5, "{got}");
        }
        // The camera turns with its node, is moved by its scale, and is not scaled itself.
        let sensor = &scene.sensor;
        assert_eq!((sensor.width, sensor.height), (1080, 720));
        let near = |a: [f64; 3], b: [f64; 3]| (0..3).all(|i| (a[i] - b[i]).abs() < 1e-6);
        let to_world = &sensor.to_world;
        assert!(near(to_world.column(3), [10.0, 3.0, 10.0]), "{to_world:?}");
        assert!(near(to_world.column(2), [0.0, 0.0, -1.0]) && near(to_world.column(1), [-1.0, 0.0, 0.0]));
    }
}

#[test]
fn a_camera_may_be_placed_anywhere() {
    // With a camera in the file, whose far plane was meant for its own place, and without.
    let camera = ",\"nodes\":[{\"mesh\":0,\"children\":[1]},{\"camera\":0,\"translation\":[0,0,5]}],\
        \"cameras\":[{\"type\":\"perspective\",\"perspective\":{\"yfov\":0.5,\"znear\":0.1,\"zfar\":100}}]";
    for rest in [camera, ",\"nodes\":[{\"mesh\":0}]"] {
        let scene = read(&triangle("", rest)).scene.unwrap();
        assert!(scene.seen_from([0.0, 1.0, 1e7], [0.0; 3]).is_ok());
    }
}

#[test]
fn lights_and_materials_mean_what_they_say() {
    let rest = ",\"nodes\":[{\"mesh\":0,\"rotation\":[0,1,0,0],\"extensions\":{\"KHR_lights_punctual\":{\"light\":0}},\"children\":[1]},\
        {\"extensions\":{\"KHR_lights_punctual\":{\"light\":1}}}],\
        \"extensionsUsed\":[\"KHR_lights_punctual\",\"KHR_materials_transmission\",\"KHR_materials_volume\",\"KHR_materials_ior\",\"ACME_x\"],\
        \"extensions\":{\"KHR_lights_punctual\":{\"lights\":[\
        {\"type\":\"spot\",\"color\":[1,1,0.5],\"intensity\":10,\"spot\":{\"innerConeAngle\":0.25,\"outerConeAngle\":0.5}},\
        {\"type\":\"directional\",\"intensity\":3}]}},\
        \"materials\":[{\"pbrMetallicRoughness\":{\"baseColorFactor\":[0.5,0.6,0.7,1],\"roughnessFactor\":0},\
        \"extensions\":{\"KHR_materials_transmission\":{\"transmissionFactor\":1},\"KHR_materials_volume\":{\"thicknessFactor\":1},\
        \"KHR_materials_ior\":{\"ior\":1.25}}}]";
    let findings = read(&triangle(",\"material\":0", rest));
    let notes: Vec<String> = findings.notes.iter().map(|n| n.to_string()).collect();
    assert!(notes.iter().any(|note| note.contains("ACME_x")), "{notes:?}");
    let scene = findings.scene.unwrap_or_else(|| panic!("{:?}", findings.errors));
    let glass =
        Surface::Dielectric { eta: 1.25, reflectance: Spectrum::ONE, transmittance: Spectrum::new(0.5, 0.6, 0.7) };
    assert_eq!(scene.shapes[0].material.surface, glass);
    let [Emitter::Spot { axis, beam, cutoff, intensity, .. }, Emitter::Directional { direction, irradiance }] =
        &scene.emitters[..]
    else {
        panic!("{:?}", scene.emitters)
    };
    // A half turn around y: from −z to +z.
    assert!((axis[2] - 1.0).abs() < 1e-6 && (direction[2] - 1.0).abs() < 1e-6);
    assert!((beam - 0.25_f64.to_degrees()).abs() < 1e-5 && (cutoff - 0.5_f64.to_degrees()).abs() < 1e-5);
    assert_eq!((*intensity, *irradiance), (Spectrum::new(10.0, 10.0, 5.0), Spectrum::splat(3.0)));
}

#[test]
fn metal_and_gloss_become_facets() {
    let surface = |pbr: &str| {
        let rest = format!(
            ",\"nodes\":[{{\"mesh\":0}}],\"materials\":[{{\"pbrMetallicRoughness\":{{\"baseColorFactor\":[0.5,0.6,0.7,1],{pbr}}}}}]"
        );
        let findings = read(&triangle(",\"material\":0", &rest));
        let scene = findings.scene.unwrap_or_else(|| panic!("{:?}", findings.errors));
        assert!(scene.shapes[0].material.is_two_sided);
        scene.shapes[0].material.surface
    };
    let colour = Spectrum::new(0.5, 0.6, 0.7);
    let facets = |roughness: f32| Roughness::even(Distribution::Ggx, roughness * roughness);
    let metal = RoughConductor { conductor: Conductor::mirror(colour), roughness: facets(0.5) };
    assert_eq!(surface("\"metallicFactor\":1,\"roughnessFactor\":0.5"), Surface::RoughConductor(metal));
    assert_eq!(surface("\"metallicFactor\":1,\"roughnessFactor\":0"), Surface::Mirror { reflectance: colour });
    let plastic = Plastic { eta: 1.5, diffuse: colour, specular: Spectrum::ONE, nonlinear: false };
    let rough = RoughPlastic::new(plastic, Distribution::Ggx, 0.25);
    assert_eq!(surface("\"metallicFactor\":0,\"roughnessFactor\":0.5"), Surface::RoughPlastic(rough));
    assert_eq!(surface("\"metallicFactor\":0,\"roughnessFactor\":0"), Surface::Plastic(plastic));
    // What scatters evenly has no coat.
    assert_eq!(surface("\"metallicFactor\":0"), Surface::Lambert { reflectance: colour });
}

#[test]
fn alpha_lets_light_pass() {
    let weight = |mode: &str, alpha: f32| {
        let rest = format!(
            ",\"nodes\":[{{\"mesh\":0}}],\"materials\":[{{{mode}\"pbrMetallicRoughness\":{{\"metallicFactor\":0,\"baseColorFactor\":[1,1,1,{alpha}]}}}}]"
        );
        let findings = read(&triangle(",\"material\":0", &rest));
        let scene = findings.scene.unwrap_or_else(|| panic!("{:?}", findings.errors));
        let Some(mix) = &scene.shapes[0].material.mix else { return 1.0 };
        let Mix::Blend { weight, parts } = &**mix else { panic!("{mix:?}") };
        assert_eq!(
            (parts[0].surface, parts[1].surface),
            (Surface::Null, Surface::Lambert { reflectance: Spectrum::ONE })
        );
        weight.mean()[0]
    };
    assert_eq!(weight("", 0.25), 1.0);
    assert_eq!(weight("\"alphaMode\":\"BLEND\",", 0.25), 0.25);
    assert_eq!(weight("\"alphaMode\":\"MASK\",", 0.25), 0.0);
    assert_eq!(weight("\"alphaMode\":\"MASK\",\"alphaCutoff\":0.2,", 0.25), 1.0);
}

#[test]
fn coloured_glass_absorbs_within() {
    let points = [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let sides = [0_u16, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3];
    let mut data: Vec<u8> = sides.iter().flat_map(|i| i.to_le_bytes()).collect();
    data.extend(points.iter().flatten().flat_map(|c| c.to_le_bytes()));
    let glass = |count: usize| {
        let text = format!(
            "{{\"asset\":{{\"version\":\"2.0\"}},\"scenes\":[{{\"nodes\":[0]}}],\"nodes\":[{{\"mesh\":0}}],\
            \"buffers\":[{{\"byteLength\":72}}],\"bufferViews\":[{{\"buffer\":0,\"byteLength\":24}},{{\"buffer\":0,\"byteOffset\":24,\"byteLength\":48}}],\
            \"accessors\":[{{\"bufferView\":0,\"componentType\":5123,\"count\":{count},\"type\":\"SCALAR\"}},\
            {{\"bufferView\":1,\"componentType\":5126,\"count\":4,\"type\":\"VEC3\",\"min\":[0,0,0],\"max\":[1,1,1]}}],\
            \"meshes\":[{{\"primitives\":[{{\"attributes\":{{\"POSITION\":1}},\"indices\":0,\"material\":0}}]}}],\
            \"materials\":[{{\"pbrMetallicRoughness\":{{\"roughnessFactor\":0.5}},\"extensions\":{{\
            \"KHR_materials_transmission\":{{\"transmissionFactor\":1}},\"KHR_materials_volume\":{{\"thicknessFactor\":1,\
            \"attenuationDistance\":2,\"attenuationColor\":[1,0.5,0.25]}}}}}}]}}"
        );
        let findings = SceneFile::from_gltf(Path::new("room.glb"), &glb(&text, &data), &ReadOptions::default());
        let notes: Vec<String> = findings.notes.iter().map(|n| n.to_string()).collect();
        (findings.scene.unwrap_or_else(|| panic!("{:?}", findings.errors)), notes)
    };
    let (scene, _) = glass(12);
    assert!(matches!(scene.shapes[0].material.surface, Surface::RoughDielectric(_)));
    let [medium] = &scene.media[..] else { panic!("{} media", scene.media.len()) };
    let Matter::Homogeneous { absorption, scattering, .. } = medium.matter else { panic!("{medium:?}") };
    // After two metres, a half and a quarter are left.
    let left = absorption.map(|a| (-2.0 * a).exp());
    assert!(
        (left - Spectrum::new(1.0, 0.5, 0.25)).map(f32::abs).max_element() < 1e-6 && scattering.is_black(),
        "{left:?}"
    );
    let inside = [[0.1, 0.1, 0.1], [0.5, 0.5, 0.5]].map(|point| medium.places[0].container.contains(point));
    assert_eq!(inside, [true, false]);
    // Without its last side, it is not closed.
    let (scene, notes) = glass(9);
    assert!(scene.media.is_empty() && notes.iter().any(|note| note.contains("not closed")), "{notes:?}");
}

#[test]
fn broken_files_say_what_is_wrong() {
    let good = triangle("", ",\"nodes\":[{\"mesh\":0}]");
    assert!(read(&good).scene.is_some_and(|scene| matches!(scene.emitters[..], [Emitter::Constant { .. }])));
    let cases: &[(&str, &str, &[&str])] = &[
        ("\"count\":4", "\"count\":5", &["mesh 0, primitive 0", "POSITION", "5 elements lie beyond the end"]),
        ("\"count\":4", "\"count\":18446744073709551615", &["room.gltf"]),
        ("\"byteLength\":48,\"uri\"", "\"byteLength\":49,\"uri\"", &["buffer 0", "holds 48 bytes where 49 are due"]),
        ("base64,", "base65,", &["buffer 0", "base64"]),
        ("\"mesh\":0}", "\"mesh\":7}", &["not usable glTF"]),
        ("\"POSITION\":0", "\"POSITION\":4294967295", &["accessor 4294967295 does not exist: there are 1"]),
        ("\"componentType\":5126", "\"componentType\":5125", &["POSITION", "holds indices"]),
        ("\"VEC3\"", "\"VEC2\"", &["POSITION", "where 3 numbers are due"]),
        ("\"nodes\":[{\"mesh\":0}]", "\"nodes\":[{\"mesh\":0,\"children\":[0]}]", &["node 0", "without end"]),
        ("\"nodes\":[{\"mesh\":0}]", "\"nodes\":[{\"mesh\":0,\"scale\":[1e39,1,1]}]", &["room.gltf"]),
        ("\"asset\"", "\"extensionsRequired\":[\"KHR_draco_mesh_compression\"],\"asset\"", &["KHR_draco", "required"]),
        ("\"scenes\":[{\"nodes\":[0]}],", "", &["holds no scene"]),
        ("data:application/octet-stream;base64,", "nowhere.bin?", &["buffer 0", "nowhere.bin"]),
        ("{\"asset\"", "{\"asset\"\"", &["not usable glTF"]),
    ];
    for (whole, broken, words) in cases {
        assert!(good.contains(whole), "{whole}");
        let findings = read(&good.replacen(whole, broken, 1));
        let errors: Vec<String> = findings.errors.iter().map(|e| e.to_string()).collect();
        assert!(!errors.is_empty(), "{broken} was accepted");
        assert!(words.iter().all(|word| errors.iter().any(|e| e.contains(word))), "{errors:?} for {words:?}");
    }
}

fn with_fog(name: &str, fog: &str) -> Result<SceneFile, String> {
    let folder = Folder::new(name);
    folder.write("cloud.nvdb", crate::vdb::file("fp16.nvdb"));
    let fog = folder.write("my.toml", fog);
    let options = ReadOptions { fog: Some(fog), ..ReadOptions::default() };
    let text = triangle("", ",\"nodes\":[{\"mesh\":0}]");
    let findings = SceneFile::from_gltf(&folder.0.join("room.gltf"), text.as_bytes(), &options);
    findings.into_scene().map_err(|e| e.to_string())
}

/// A file of fog with every form.
pub(crate) const ALL_FORMS: &str = "sky.radiance = 0.5\n[[fog]]\nshape = \"sphere\"\ncentre = [0, 1, 2]\nradius = 3\nvisibility = 39.12\nalbedo = [1, 0.5, 0]\n\
        [[fog]]\nshape = \"height\"\nmin = [-1, 0, -1]\nmax = [1, 4, 1]\nground = 1\nfall_off = 0.5\nextinction = 2\n\
        [[fog]]\nshape = \"grid\"\nfile = \"cloud.nvdb\"\nextinction = 20\nscale = 2\nrotate = { axis = [0, 1, 0], degrees = 90 }\ntranslate = [1, 0, 0]\n";

#[test]
fn fog_comes_in_all_forms() {
    let scene = with_fog("forms", ALL_FORMS).unwrap();
    assert!(matches!(scene.emitters[..], [Emitter::Constant { radiance }] if radiance == Spectrum::splat(0.5)));
    let [ball, layers, cloud] = &scene.media[..] else { panic!("{} media", scene.media.len()) };
    let Matter::Homogeneous { absorption, scattering, .. } = ball.matter else { panic!("{ball:?}") };
    assert!((scattering - Spectrum::new(0.1, 0.05, 0.0)).map(f32::abs).max_element() < 1e-6, "{scattering:?}");
    assert!((absorption - Spectrum::new(0.0, 0.05, 0.1)).map(f32::abs).max_element() < 1e-6, "{absorption:?}");
    // Full at the ground and below, 1/e of that half a metre above.
    let Matter::Grid { volume, scattering, .. } = &layers.matter else { panic!("{layers:?}") };
    let fogbow_examples::volume::Values::F32(values) = &volume.values else { panic!("bytes") };
    assert_eq!((volume.size, *scattering, values[10]), ([1, 256, 1], Spectrum::splat(2.0), 1.0));
    let at = |height: f64| 0.5 * (values[(height * 64.0) as usize - 1] + values[(height * 64.0) as usize]);
    // Between two layers a thirty-second of the fall-off apart, a line is above the curve by (1/32)²/8.
    assert!((at(1.5) / (-1.0_f32).exp() - 1.0 - 1.22e-4).abs() < 2e-6, "{}", at(1.5));
    // Voxel (7, 8, 13) of 0.1 m lies at (0.7, 0.8, 1.3); twice as far, turned, moved: (3.6, 1.6, −1.4).
    let Matter::Sparse { bricks, to_world, .. } = &cloud.matter else { panic!("{cloud:?}") };
    let point = to_world.point(bricks.in_file().inverse().unwrap().point([0.7, 0.8, 1.3]));
    assert!((0..3).all(|i| (point[i] - [3.6, 1.6, -1.4][i]).abs() < 1e-9), "{point:?}");
    assert!(cloud.places[0].container.contains(point));
}

#[test]
fn fog_without_a_place_fills_the_scene_and_the_sun_stands_where_it_is_said_to() {
    let folder = Folder::new("everywhere");
    let fog =
        folder.write("my.toml", "sun = { from = [0, 2, 0], irradiance = [3, 2, 1] }\n[[fog]]\nvisibility = 39.12\n");
    let options = ReadOptions { fog: Some(fog), ..ReadOptions::default() };
    let findings = SceneFile::from_gltf(&folder.0.join("box.glb"), &binary_box(), &options);
    let scene = findings.into_scene().unwrap();
    let sun = scene.emitters.iter().find_map(|e| match e {
        Emitter::Directional { direction, irradiance } => Some((*direction, *irradiance)),
        _ => None,
    });
    assert_eq!(sun, Some(([-0.0, -1.0, -0.0], Spectrum::new(3.0, 2.0, 1.0))));
    let surfaces = scene.shapes.iter().map(|shape| fogbow_examples::world::bounds_of(&shape.geometry));
    let all = surfaces.fold(fogbow::math::Bounds::EMPTY, fogbow::math::Bounds::union);
    let [low, high] = scene.media[0].bounds();
    for axis in 0..3 {
        let (least, most) = (f64::from(all.min[axis]), f64::from(all.max[axis]));
        assert!(
            low[axis] < least && high[axis] > most && high[axis] - low[axis] < 1.01 * (most - least),
            "{low:?}, {high:?}"
        );
    }
    let due = 0.1 * (0..3).map(|i| high[i] - low[i]).fold(0.0, f64::max);
    assert!((scene.media[0].thickness() - due).abs() < 1e-6 * due);
}

#[test]
fn fog_that_cannot_be_is_said() {
    let cases: &[(&str, &[&str])] = &[
        ("[[fog]]\nshape = \"cone\"\n", &["my.toml:2", "cone"]),
        ("\n[[fog]]\nshape = \"box\"\nmin = [0, 0, 0]\n", &["my.toml:2", "[[fog]] 1", "extinction"]),
        ("[[fog]]\nshape = \"box\"\nmin = [0, 0, 0]\nextinction = 1\n", &["needs \"max\""]),
        ("[[fog]]\nshape = \"box\"\nmin = [0, 0, 0]\nmax = [1, 0, 1]\nextinction = 1\n", &["must be greater"]),
        ("[[fog]]\nshape = \"box\"\nradius = 2\nextinction = 1\n", &["\"radius\" has no meaning"]),
        ("[[fog]]\nshape = \"sphere\"\ncentre = [0, 0, 0]\nradius = -1\nextinction = 1\n", &["radius must be"]),
        ("[[fog]]\nshape = \"sphere\"\ncentre = [0, 0, 0]\nradius = 1\nextinction = -1\n", &["negative"]),
        ("[[fog]]\nshape = \"sphere\"\ncentre = [0, 0, 0]\nradius = 1\nextinction = 1\nalbedo = 1.5\n", &["albedo"]),
        ("[[fog]]\nshape = \"sphere\"\ncentre = [0, 0, 0]\nradius = 1\nextinction = 1\ng = 1\n", &["1"]),
        ("[[fog]]\nshape = \"grid\"\nfile = \"none.vdb\"\n", &["none.vdb", "cannot be read"]),
        ("[[fog]]\nshape = \"grid\"\nfile = \"cloud.nvdb\"\ngrid = \"smoke\"\n", &["there is no grid \"smoke\""]),
        ("[sky]\n", &["[sky]", "radiance"]),
        ("[sun]\nfrom = [0, 0, 0]\nirradiance = 1\n", &["[sun]", "no direction"]),
        ("[sun]\nfrom = [0, 1, 0]\nirradiance = -1\n", &["[sun]", "negative"]),
        ("fog = 3\n", &["my.toml:1"]),
        ("[[fog]\n", &["my.toml:1"]),
    ];
    for (fog, words) in cases {
        let error = with_fog("errors", fog).map(|_| ()).unwrap_err();
        assert!(words.iter().all(|word| error.contains(word)), "{error} for {words:?}");
    }
}

#[test]
fn fingerprints_know_the_fog() {
    let folder = Folder::new("print");
    let scene = folder.write("room.gltf", triangle("", ",\"nodes\":[{\"mesh\":0}]"));
    let without = fingerprint(&scene).unwrap();
    let named = folder.write("my.toml", FOG);
    let options = ReadOptions { fog: Some(named), ..ReadOptions::default() };
    assert_ne!(fingerprint_with(&scene, &options).unwrap(), without);
    assert_eq!(fingerprint(&scene).unwrap(), without);
    folder.write("room.fog.toml", FOG);
    assert_ne!(fingerprint(&scene).unwrap(), without);
}

/// A fog file that has gone, or was never there, is told of; where it is, or was not meant to be, nothing is.
#[test]
fn a_scene_without_fog_says_so() {
    let folder = Folder::new("fogless");
    let scene = folder.write("room.gltf", triangle("", ",\"nodes\":[{\"mesh\":0}]"));
    let told = || {
        let notes = SceneFile::read_with(&scene, &ReadOptions::default()).notes;
        notes.iter().filter(|note| note.to_string().contains("no room.fog.toml beside it")).count()
    };
    assert_eq!(told(), 1);
    let fog = folder.write("room.fog.toml", FOG);
    assert_eq!(told(), 0);
    let media = |options: &ReadOptions| SceneFile::read_with(&scene, options).into_scene().unwrap().media.len();
    let without = ReadOptions { is_without_fog: true, ..ReadOptions::default() };
    assert_eq!([media(&ReadOptions::default()), media(&without)], [1, 0]);
    assert_ne!(fingerprint_with(&scene, &without).unwrap(), fingerprint(&scene).unwrap());
    std::fs::remove_file(fog).unwrap();
    assert_eq!(told(), 1);
    assert!(SceneFile::read_with(&scene, &without).notes.iter().all(|note| !note.to_string().contains("fog.toml")));
}

/// No mistake in a file of fog hides another.
#[test]
fn all_mistakes_in_a_fog_file_are_told_at_once() {
    let folder = Folder::new("mistakes");
    let scene = folder.write("room.gltf", triangle("", ",\"nodes\":[{\"mesh\":0}]"));
    let fog = "[sky]\nradiance = \"blue\"\n[moon]\n[sun]\nfrom = [0, 1, 0]\n\
        [[fog]]\nvisibilty = 3\nalbedo = true\ng = 0.5\n[[fog]]\nshape = \"sphere\"\nmin = [0, 0, 0]\nground = 1\n\
        [[fog]]\nshape = \"sphere\"\ncentre = [0, 0, 0]\nradius = 1\nextinction = 1\n";
    folder.write("room.fog.toml", fog);
    let errors = SceneFile::read_with(&scene, &ReadOptions::default()).errors;
    let expected = [
        "fog.toml:2: [sky]: must be a number, or three",
        "fog.toml:3: nothing is called \"moon\" here",
        "fog.toml:7: [[fog]] 1: unknown field `visibilty`, expected one of",
        "fog.toml:8: [[fog]] 1: must be a number, or three",
        "[sun]: needs \"from\" and \"irradiance\"",
        "[[fog]] 2: \"min\", \"ground\" have no meaning for this shape",
    ];
    let told: Vec<_> = errors.iter().map(ToString::to_string).collect();
    assert_eq!(told.len(), expected.len(), "{told:#?}");
    for (told, words) in told.iter().zip(expected) {
        assert!(told.contains(words), "{words} in {told:#?}");
    }
    assert!(told.iter().any(|told| told.contains("(is \"visibility\" meant?)")), "{told:#?}");
}

/// A scene of glTF may have no nodes: an empty room with fog from a file.
#[test]
fn a_scene_may_be_empty() {
    let folder = Folder::new("empty");
    let scene = folder.write("cloud.gltf", r#"{"asset":{"version":"2.0"},"scenes":[{}],"scene":0}"#);
    folder.write("cloud.fog.toml", "[[fog]]\nshape = \"sphere\"\ncentre = [0, 0, 0]\nradius = 1\nextinction = 1\n");
    let findings = SceneFile::read_with(&scene, &ReadOptions::default());
    assert_eq!(findings.errors, []);
    assert_eq!(findings.scene.unwrap().media.len(), 1);
}
