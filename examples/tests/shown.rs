//! Lights that show textures, held to what the independent renderer (Mitsuba 3.9.1, `path`) finds along the same rays.

use std::path::Path;

use fogbow::host::Empty;
use fogbow::math::{Ray, Vec3};
use fogbow::path::{self, Settings};
use fogbow::sampling::Generator;
use fogbow::world::World as LitWorld;
use fogbow_examples::scene_file::SceneFile;
use fogbow_examples::world::{Storage, World};

const SHEET: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/shapes/sheet.obj");

/// A wide white wall at z = 0 and an emitter, which shows 1.5 by 1 boards of two by two squares.
fn scene(emitter: &str, name: &str) -> SceneFile {
    let board = format!(
        "<texture name=\"{name}\" type=\"checkerboard\"><rgb name=\"color0\" value=\"1, 0.5, 0.25\"/>\
         <float name=\"color1\" value=\"0.125\"/><transform name=\"to_uv\"><scale x=\"1.5\" y=\"1\"/></transform></texture>"
    );
    let text = format!(
        "<scene version=\"3.0.0\"><shape type=\"rectangle\"><transform name=\"to_world\"><scale value=\"10\"/></transform>\
         <bsdf type=\"diffuse\"><float name=\"reflectance\" value=\"1\"/></bsdf></shape>{}</scene>",
        emitter.replace("BOARD", &board)
    );
    SceneFile::parse(Path::new("shown.xml"), &text).unwrap()
}

/// Radiance that comes to a point from a direction, of light scattered once at most: the mean of some paths.
fn seen(scene: &SceneFile, from: [f32; 3], direction: Vec3, count: u32) -> [f32; 3] {
    let mut storage = Storage::new(scene);
    let world = World::new(scene, &mut storage).unwrap();
    let lights = world.lights();
    let lit = LitWorld { medium: &Empty, scene: &world, lights: lights.as_slice().into() };
    let (settings, mut rng) = (Settings { max_scatterings: 1, ..Settings::default() }, Generator::new(5));
    let ray = Ray::new(Vec3::from_array(from), direction);
    let sum: fogbow::spectrum::Spectrum =
        (0..count).map(|_| path::radiance(&ray, &lit, &settings, &mut rng).total()).sum();
    sum.0.map(|c| c / count as f32)
}

fn assert_near(found: [f32; 3], truth: [f32; 3], most: f32, what: &str) {
    for (found, truth) in found.into_iter().zip(truth) {
        assert!((found - truth).abs() < most * truth, "{what}: {found} for {truth}");
    }
}

#[test]
fn projectors_and_spots_throw_their_textures_where_the_independent_renderer_has_them() {
    let at =
        "<transform name=\"to_world\"><lookat origin=\"0, 0, 2\" target=\"0.3, 0, 0\" up=\"0, 1, 0\"/></transform>";
    let projector = format!(
        "<emitter type=\"projector\"><float name=\"fov\" value=\"70\"/><float name=\"scale\" value=\"2\"/>{at}BOARD</emitter>"
    );
    let spot = format!(
        "<emitter type=\"spot\"><float name=\"cutoff_angle\" value=\"40\"/><float name=\"beam_width\" value=\"10\"/>\
         <float name=\"intensity\" value=\"3\"/>{at}BOARD</emitter>"
    );
    let even = |value: f32| [value; 3];
    let places = [[0.4, 0.3], [0.4, -0.3], [-0.5, 0.3], [-0.1, -0.7]];
    let projected = [
        even(0.059_137_6),
        [0.4731, 0.236_55, 0.118_275],
        [0.579_779, 0.289_89, 0.144_945],
        [0.528_778, 0.264_389, 0.132_195],
    ];
    let lit = [[0.217_981, 0.108_99, 0.054_495_2], even(0.027_247_6), even(0.014_114_8), even(0.014_777_3)];
    for (emitter, name, truths) in [(projector, "irradiance", projected), (spot, "texture", lit)] {
        let scene = scene(&emitter, name);
        for ([x, y], truth) in places.into_iter().zip(truths) {
            let found = seen(&scene, [x, y, 1.0], Vec3::NEG_Z, 1);
            assert_near(found, truth, 1e-4, &format!("{name} at {x}, {y}"));
        }
    }
    // Without an angle, that of a lens of 50 mm, along the diagonal.
    let lens = scene(
        &format!("<emitter type=\"projector\"><float name=\"scale\" value=\"2\"/>{at}BOARD</emitter>"),
        "irradiance",
    );
    for ([x, y], truth) in [
        ([0.4, -0.3], [0.4731, 0.236_55, 0.118_275]),
        ([-0.1, 0.3], [0.528_778, 0.264_389, 0.132_194]),
        ([0.75, -0.4], even(0.054_837_1)),
    ] {
        assert_near(seen(&lens, [x, y, 1.0], Vec3::NEG_Z, 1), truth, 1e-4, &format!("by a lens at {x}, {y}"));
    }
    for [x, y] in [[-0.5, 0.3], [0.3, 0.64]] {
        assert_eq!(seen(&lens, [x, y, 1.0], Vec3::NEG_Z, 1), [0.0; 3], "beyond its picture at {x}, {y}");
    }
}

#[test]
fn area_lights_glow_as_their_textures_say_and_light_what_is_before_them() {
    // A mirrored rectangle, turned to the wall, and a sheet of triangles.
    let rectangle = "<shape type=\"rectangle\"><transform name=\"to_world\"><scale x=\"-0.7\" y=\"0.5\"/>\
        <rotate y=\"1\" angle=\"170\"/><translate z=\"1.5\"/></transform><emitter type=\"area\">BOARD</emitter></shape>";
    let sheet = format!(
        "<shape type=\"obj\"><string name=\"filename\" value=\"{SHEET}\"/><transform name=\"to_world\"><scale value=\"0.6\"/>\
         <rotate y=\"1\" angle=\"170\"/><translate z=\"1.5\"/></transform><emitter type=\"area\">BOARD</emitter></shape>"
    );
    let (dark, bright) = ([0.125; 3], [1.0, 0.5, 0.25]);
    let of_rectangle = [
        ([0.4, 0.3], [0.077_864, 0.043_449, 0.026_242]),
        ([0.4, -0.3], [0.080_626, 0.044_624, 0.026_624]),
        ([-0.5, 0.3], [0.072_172, 0.040_341, 0.024_425]),
        ([-0.1, -0.7], [0.069_03, 0.037_995, 0.022_477]),
    ];
    let of_sheet = [([0.4, 0.3], [0.100_115, 0.055_059, 0.032_532]), ([-0.1, -0.7], [0.071_888, 0.040_771, 0.025_213])];
    let seen_rectangle = [([0.3, 0.2], dark), ([0.3, -0.2], bright), ([-0.3, 0.2], dark), ([-0.3, -0.2], bright)];
    let seen_sheet = [([0.3, 0.2], bright), ([0.3, -0.2], dark), ([-0.3, 0.2], bright), ([-0.3, -0.2], dark)];
    let all: [(&str, &[_], &[_]); 2] = [(rectangle, &of_rectangle, &seen_rectangle), (&sheet, &of_sheet, &seen_sheet)];
    for (emitter, on_wall, looked_at) in all {
        let scene = scene(emitter, "radiance");
        for ([x, y], truth) in on_wall {
            // The truths are known to half a hundredth.
            let found = seen(&scene, [*x, *y, 0.5], Vec3::NEG_Z, 40_000);
            assert_near(found, *truth, 0.02, &format!("below {x}, {y}"));
        }
        for ([x, y], truth) in looked_at {
            assert_near(seen(&scene, [*x, *y, 0.5], Vec3::Z, 1), *truth, 1e-5, &format!("at {x}, {y}"));
        }
    }
}
