//! Scenes of pbrt-v4: the same scene as a Mitsuba one is the same description; what is wrong is told with its line.

use std::path::Path;

use fogbow::host::{Empty, Medium, Properties};
use fogbow::math::{Ray, Vec3};
use fogbow::path::{self, Settings};
use fogbow::sampling::Generator;
use fogbow::spectrum::Spectrum;
use fogbow::world::World as LitWorld;
use fogbow_examples::picture::Picture;
use fogbow_examples::scene_file::{Findings, NoteKind, ReadOptions, SceneFile};
use fogbow_examples::world::{Storage, WithMedium, World};

fn read(text: &str, is_lenient: bool) -> Findings {
    let options = ReadOptions { is_lenient, ..ReadOptions::default() };
    SceneFile::from_pbrt(Path::new("scenes/room.pbrt"), text, &options)
}

fn errors(findings: &Findings) -> Vec<String> {
    findings.errors.iter().map(ToString::to_string).collect()
}

/// All that a scene says but for lines and where it was read.
fn said(scene: &SceneFile) -> Vec<String> {
    let mut all = vec![format!("{:?} {:?}", scene.integrator, scene.sensor)];
    all.extend(scene.emitters.iter().map(|emitter| format!("{emitter:?}")));
    all.extend(scene.media.iter().map(|medium| format!("{medium:?}")));
    let shape = |s: &fogbow_examples::scene_file::Shape| {
        format!("{:?} {} {:?} {:?}", s.geometry, s.is_flipped, s.material, s.radiance)
    };
    all.extend(scene.shapes.iter().map(shape));
    all
}

/// A scene with one of most things.
pub(super) const ROOM: &str = r#"
# a room with fog in a ball
Film "rgb" "integer xresolution" 64 "integer yresolution" [ 48 ] "string filename" "room.exr"
PixelFilter "box"
Sampler "halton" "integer pixelsamples" 32
Integrator "volpath" "integer maxdepth" 7
Scale -1 1 1
LookAt 0 1 5  0 1 0  0 1 0
Camera "perspective" "float fov" 40
WorldBegin
LightSource "infinite" "rgb L" [ .1 .2 .3 ] "float scale" 2
LightSource "point" "point3 from" [ 0 2 1 ] "rgb I" [ 3 2 1 ]
LightSource "distant" "point3 from" [ 0 1 0 ] "point3 to" [ 0 0 0 ] "rgb L" [ 1 1 1 ]
MakeNamedMedium "fog" "string type" "homogeneous" "rgb sigma_a" [ .1 .2 .3 ] "spectrum sigma_s" [ 200 2 900 2 ] "float g" .5 "float scale" 3
MakeNamedMaterial "wall" "string type" "diffuse" "rgb reflectance" [ .5 .4 .3 ]
AttributeBegin
  NamedMaterial "wall"
  Rotate -90 1 0 0
  Shape "trianglemesh" "integer indices" [ 0 1 2 2 3 0 ]
    "point3 P" [ -4 -4 0  4 -4 0  4 4 0  -4 4 0 ] "point2 uv" [ 0 0 1 0 1 1 0 1 ]
AttributeEnd
AttributeBegin
  Translate 0 1 0
  Material "interface"
  MediumInterface "fog" ""
  Shape "sphere" "float radius" .75
AttributeEnd
AttributeBegin
  Material "conductor" "spectrum eta" "metal-Au-eta" "spectrum k" "metal-Au-k" "float roughness" .04
  Translate 1.5 .5 0
  Shape "sphere" "float radius" .5
  Material "dielectric" "float eta" 1.4
  Translate -3 0 0
  Shape "sphere" "float radius" .5
AttributeEnd
AttributeBegin
  AreaLightSource "diffuse" "rgb L" [ 4 4 4 ]
  Material "diffuse" "rgb reflectance" [ 0 0 0 ]
  Translate 0 3 0
  Rotate 90 1 0 0
  Shape "bilinearmesh" "point3 P" [ -1 -1 0  1 -1 0  -1 1 0  1 1 0 ]
AttributeEnd
"#;

const SAME: &str = r#"<scene version="3.0.0">
<integrator type="volpath"><integer name="max_depth" value="8"/></integrator>
<emitter type="constant"><rgb name="radiance" value="0.2, 0.4, 0.6"/></emitter>
<emitter type="point"><point name="position" x="0" y="2" z="1"/><rgb name="intensity" value="3, 2, 1"/></emitter>
<emitter type="directional"><vector name="direction" x="0" y="-1" z="0"/><rgb name="irradiance" value="1"/></emitter>
<medium id="fog" type="homogeneous"><phase type="hg"><float name="g" value="0.5"/></phase><float name="scale" value="3"/>
  <rgb name="sigma_a" value="0.1, 0.2, 0.3"/><float name="sigma_s" value="2"/></medium>
<sensor type="perspective"><float name="fov" value="40"/><string name="fov_axis" value="smaller"/>
  <transform name="to_world"><matrix value="-1 0 0 0 0 1 0 1 0 0 -1 5 0 0 0 1"/></transform>
  <sampler type="independent"><integer name="sample_count" value="32"/></sampler>
  <film type="hdrfilm"><integer name="width" value="64"/><integer name="height" value="48"/><rfilter type="box"/></film></sensor>
<shape type="sphere"><float name="radius" value="0.75"/><transform name="to_world"><translate y="1"/></transform>
  <bsdf type="null"/><ref name="interior" id="fog"/></shape>
<shape type="sphere"><float name="radius" value="0.5"/><transform name="to_world"><translate x="1.5" y="0.5"/></transform>
  <bsdf type="twosided"><bsdf type="roughconductor"><string name="distribution" value="ggx"/><float name="alpha" value="0.2"/>
  <string name="material" value="Au"/></bsdf></bsdf></shape>
<shape type="sphere"><float name="radius" value="0.5"/><transform name="to_world"><translate x="-1.5" y="0.5"/></transform>
  <bsdf type="dielectric"><float name="int_ior" value="1.4"/><float name="ext_ior" value="1"/></bsdf></shape>
</scene>"#;

#[test]
fn a_room_is_the_same_scene_as_in_mitsubas_words() {
    let room = read(ROOM, false);
    assert!(room.errors.is_empty(), "{:?}", errors(&room));
    let room = room.scene.unwrap();
    let same = SceneFile::parse(Path::new("same.xml"), SAME).unwrap();
    let (mut found, truth) = (said(&room), said(&same));
    // The meshes, which no Mitsuba scene holds in itself.
    found.retain(|line| !line.contains("Mesh"));
    assert_eq!(found, truth);
    let meshes: Vec<_> =
        room.shapes.iter().filter(|shape| format!("{:?}", shape.geometry).starts_with("Mesh")).collect();
    assert_eq!(meshes.len(), 2);
    // The floor looks up, the lamp down.
    for (shape, up) in [(meshes[0], 1.0), (meshes[1], -1.0)] {
        let fogbow_examples::scene_file::Geometry::Mesh(mesh) = &shape.geometry else { unreachable!() };
        assert_eq!(mesh.triangles.len(), 2);
        for triangle in &mesh.triangles {
            let [a, b, c] = mesh.corners(*triangle);
            assert!(((b - a).cross(c - a).normalize().y - up).abs() < 1e-6);
        }
    }
    assert_eq!(meshes[1].radiance, Some(Spectrum::splat(4.0)));
}

#[test]
fn grids_clouds_and_objects_are_read() {
    let text = r#"LookAt 0 0 30 0 0 0 0 1 0
        Camera "perspective"
        WorldBegin
        MakeNamedMedium "smoke" "string type" "uniformgrid" "integer nx" 2 "integer ny" 1 "integer nz" 1
            "float density" [ 1 0.5 ] "point3 p0" [ -1 0 0 ] "point3 p1" [ 1 1 1 ] "rgb sigma_s" [ 1 2 3 ] "float scale" 2
        MakeNamedMedium "sky" "string type" "cloud" "float density" 2
        ObjectBegin "ball"
          Shape "sphere" "float radius" 0.1
        ObjectEnd
        AttributeBegin
          Translate 3 0 0
          ObjectInstance "ball"
          Translate 1 0 0
          ObjectInstance "ball"
        AttributeEnd
        LightSource "infinite" "blackbody L" 6500
        AttributeBegin
          MediumInterface "smoke" ""
          Material ""
          Shape "sphere" "float radius" 2
          Translate 0 9 0
          MediumInterface "sky" ""
          Shape "sphere" "float radius" 1
        AttributeEnd"#;
    let findings = read(text, false);
    assert!(findings.errors.is_empty(), "{:?}", errors(&findings));
    let scene = findings.scene.unwrap();
    assert_eq!((scene.media.len(), scene.shapes.len()), (2, 2));
    // A sphere of two instances, moved.
    assert!(format!("{:?}", scene.shapes[1].geometry).contains("4.0"), "{:?}", scene.shapes[1].geometry);
    let smoke = format!("{:?}", scene.media[0].matter);
    assert!(smoke.contains("F32([1.0, 0.5])") && smoke.contains("[2.0, 4.0, 6.0]"), "{smoke}");
    // As bright as white, and a little bluer than an even spectrum.
    let fogbow_examples::scene_file::Emitter::Constant { radiance } = scene.emitters[0] else { panic!() };
    assert!((0.9..1.1).contains(&radiance[0]) && (0.9..1.1).contains(&radiance[2]), "{radiance:?}");
}

/// The camera stands in the medium that is outside where it is named.
#[test]
fn a_camera_in_fog_says_so() {
    let text = r#"MakeNamedMedium "fog" "string type" "homogeneous"
        MediumInterface "" "fog"
        Camera "perspective"
        WorldBegin
        LightSource "infinite""#;
    let findings = read(text, false);
    assert!(findings.errors.is_empty(), "{:?}", errors(&findings));
    assert_eq!(findings.scene.unwrap().media.len(), 1);
}

#[test]
fn what_is_wrong_or_missing_is_told_with_its_line() {
    for (text, line, part) in [
        (
            "WorldBegin\nShape \"trianglemesh\" \"point3 P\" [ 0 0 0 ] \"integer indices\" [ 0 1 2 ]",
            2,
            "there are 1 points",
        ),
        ("WorldBegin\nShape \"sphere\" \"float radius\" [ 1", 2, "no value"),
        ("WorldBegin\n\nSpahe \"sphere\"", 3, "no directive"),
        ("WorldBegin\nNamedMaterial \"gold\"\nShape \"sphere\"", 3, "gold"),
        ("Translate 1 2\nWorldBegin", 1, "3 numbers"),
        ("WorldBegin\nShape \"curve\"", 2, "not supported"),
        ("WorldBegin\nAttributeEnd", 2, "nothing was begun"),
        ("WorldBegin\nMaterial \"diffuse", 2, "not closed"),
        (
            "WorldBegin\nMakeNamedMedium \"a\" \"string type\" \"uniformgrid\" \"integer nx\" 3 \"float density\" [ 1 ]",
            2,
            "make 3",
        ),
        ("WorldBegin\nInclude \"nowhere.pbrt\"", 2, "nowhere.pbrt"),
        ("LookAt 0 0 0 0 0 0 0 1 0", 1, "on one line"),
        ("Film \"rgb\"", 1, "no WorldBegin"),
        ("WorldBegin\nWorldEnd", 2, "pbrt --upgrade"),
        ("WorldBegin\nLightSource \"projection\"", 2, "filename"),
    ] {
        let all = errors(&read(text, false));
        let place = format!("room.pbrt:{line}");
        assert!(all.iter().any(|error| error.contains(&place) && error.contains(part)), "{text}: {all:?}");
    }
    let lenient =
        read("WorldBegin\nShape \"curve\"\nLightSource \"goniometric\"\nShape \"sphere\" \"float colour\" 3", true);
    assert!(lenient.scene.is_some(), "{:?}", errors(&lenient));
    let of = |kind| lenient.notes.iter().filter(|note| note.kind == kind).count();
    assert!(of(NoteKind::Replaced) == 2 && of(NoteKind::Ignored) == 1, "{:?}", lenient.notes);
}

/// As `ProjectionLight` of pbrt-v4 (`lights.cpp`): the picture is radiant intensity, its first row is above, its rows begin at -x, and the field of
/// view is that of its shorter side.
#[test]
fn projections_throw_their_picture() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/shapes/pattern.png");
    let text = format!(
        "WorldBegin\nTranslate 0 0 1\nLightSource \"projection\" \"string filename\" \"{file}\" \"float scale\" 3 \"float fov\" 60"
    );
    let findings = read(&text, false);
    let scene = findings.scene.as_ref().unwrap_or_else(|| panic!("{:?}", errors(&findings)));
    let mut storage = Storage::new(scene);
    let world = World::new(scene, &mut storage).unwrap();
    let lights = world.lights();
    let [fogbow::light::Light::Projector(projector)] = lights.as_slice() else { panic!("{lights:?}") };
    assert_eq!(projector.position, Vec3::Z);
    let picture = Picture::read(Path::new(file)).unwrap();
    let [width, height] = [picture.width as f32, picture.height as f32];
    let tangent = 30_f32.to_radians().tan();
    for (row, column) in (0..picture.height).flat_map(|row| (0..picture.width).map(move |column| (row, column))) {
        let across = (2.0 * (column as f32 + 0.5) / width - 1.0) * tangent * width / height;
        let up = 1.0 - 2.0 * (row as f32 + 0.5) / height;
        let found = projector.intensity(Vec3::new(across, up * tangent, 1.0).normalize());
        let due = Spectrum(picture.pixels[row * picture.width + column]) * 3.0;
        assert!((found - due).0.iter().all(|off| off.abs() < 1e-4), "{row} {column}: {found:?} for {due:?}");
    }
    assert_eq!(projector.intensity(Vec3::new(0.0, 1.01 * tangent, 1.0).normalize()), Spectrum::ZERO);
}

/// Absorption times the radiance of a black body, wherever there is fog; a ray through even fog sees `L (1 − e^{−τ})`.
#[test]
fn hot_media_glow_by_their_temperature() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/volumes/cloud-94x32x73.nvdb");
    let grid = |name: &str| {
        format!(
            "<volume name=\"{name}\" type=\"gridvolume\"><string name=\"filename\" value=\"{file}\"/><string name=\"grid\" value=\"density\"/>\
             <boolean name=\"use_grid_bbox\" value=\"true\"/></volume>"
        )
    };
    let text = format!(
        "<scene version=\"3.0.0\"><sensor type=\"perspective\"><transform name=\"to_world\"><translate z=\"5000\"/></transform></sensor>\
         <shape type=\"cube\"><transform name=\"to_world\"><scale value=\"1000\"/></transform><bsdf type=\"null\"/>\
         <medium name=\"interior\" type=\"heterogeneous\"><rgb name=\"sigma_a\" value=\"1, 2, 3\"/><float name=\"sigma_s\" value=\"0.5\"/>\
         <float name=\"temperature_offset\" value=\"0.1\"/><float name=\"temperature_scale\" value=\"6000\"/><float name=\"glow_scale\" value=\"2\"/>\
         {}{}</medium></shape></scene>",
        grid("density"),
        grid("temperature")
    );
    let scene = SceneFile::parse(Path::new("hot.xml"), &text).unwrap();
    let heat = scene.media[0].heat.clone().unwrap();
    // Nothing below 100 K, red below 2000 K, white around 6000 K and as bright as twice an even spectrum of 1, at most.
    assert_eq!(heat.radiance(0.1), Spectrum::ZERO);
    let kelvin = |t: f32| heat.radiance(0.1 + t / 6000.0);
    let (ember, noon) = (kelvin(1800.0), kelvin(4500.0));
    assert!(ember[0] > 3.0 * ember[1] && ember[1] > 3.0 * ember[2].max(0.0), "{ember:?}");
    assert!(noon[0] > noon[2] && (1.0..2.4).contains(&noon[1]), "{noon:?}");
    let mut storage = Storage::new(&scene);
    let world = World::new(&scene, &mut storage).unwrap();
    let (mut glowing, mut cold) = (0, 0);
    let bounds = heat.to_world;
    for i in 0..4000_u32 {
        let share = |k: u32| f64::from(i.wrapping_mul(2_654_435_761).rotate_left(7 * k) >> 8) / f64::from(1 << 24);
        let point = bounds.point([share(0), share(1), share(2)]).map(|c| c as f32);
        let properties = seen_at(&world, Vec3::from_array(point));
        // The same grid is the density.
        let expected = properties.absorption * heat.radiance(properties.scattering[0] / 0.5);
        for c in 0..3 {
            assert!(
                (properties.emission[c] - expected[c]).abs() <= 1e-4 * expected[c] + 1e-6,
                "{properties:?} {expected:?}"
            );
        }
        *(if properties.emission.is_black() { &mut cold } else { &mut glowing }) += 1;
    }
    assert!(glowing > 100 && cold > 100 && world.media().glow(), "{glowing} {cold}");
    // Fog of 0.5 m⁻¹ that absorbs only, two metres of it.
    let text = "LookAt 0 0 9 0 0 0 0 1 0\nCamera \"perspective\"\nWorldBegin\nMakeNamedMedium \"ember\" \"string type\" \"homogeneous\" \"rgb sigma_a\" [ .25 .25 .25 ] \"rgb sigma_s\" [ 0 0 0 ]
        \"float scale\" 2 \"rgb Le\" [ 3 2 1 ] \"float Lescale\" 2\nMediumInterface \"ember\" \"\"\nMaterial \"interface\"\nShape \"sphere\"";
    let scene = read(text, false).scene.unwrap();
    let mut storage = Storage::new(&scene);
    let world = World::new(&scene, &mut storage).unwrap();
    let found = world.media().with(Along(Ray::new(Vec3::new(0.0, 0.0, -3.0), Vec3::Z)));
    let truth = 1.0 - (-1.0_f32).exp();
    assert!((0..3).all(|c| (found[c] / ([6.0, 4.0, 2.0][c] * truth) - 1.0).abs() < 0.02), "{found:?}");
    // Files without temperatures say so.
    let text = format!("WorldBegin\nMakeNamedMedium \"fire\" \"string type\" \"nanovdb\" \"string filename\" \"{file}\" \"float Lescale\" 2
        MediumInterface \"fire\" \"\"\nMaterial \"interface\"\nShape \"sphere\"");
    let all = errors(&read(&text, false));
    assert!(all.iter().any(|error| error.contains("temperature")), "{all:?}");
}

struct At(Vec3);

impl WithMedium for At {
    type Output = Properties;

    fn with<M: Medium + Sync>(self, medium: &M) -> Properties {
        medium.properties(self.0)
    }
}

fn seen_at(world: &World<'_>, point: Vec3) -> Properties {
    world.media().with(At(point))
}

/// Radiance that arrives along a ray of which nothing is behind: the mean of many paths.
struct Along(Ray);

impl WithMedium for Along {
    type Output = Spectrum;

    fn with<M: Medium + Sync>(self, medium: &M) -> Spectrum {
        let world = LitWorld { medium, scene: &Empty, lights: (&[]).into() };
        let (mut rng, count) = (Generator::new(3), 20_000);
        let path = |_| path::radiance(&self.0, &world, &Settings::default(), &mut rng).total();
        let sum: Spectrum = (0..count).map(path).sum();
        sum * (1.0 / count as f32)
    }
}
