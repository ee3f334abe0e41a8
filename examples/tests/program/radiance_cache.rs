//! Radiance caching at its edges: options out of range, worlds that lack something.

use fogbow_std::film::Image;
use fogbow_std::image::read;

use super::{Folder, SCENE, said};

/// A scene of pieces: what the integrator limits, what the sensor stands in, and what is there.
struct World {
    depth: &'static str,
    sensor: &'static str,
    pieces: String,
}

const FOG: &str = r#"<medium type="homogeneous" id="fog"><float name="sigma_t" value="0.8"/>
    <rgb name="albedo" value="0.9 0.8 0.7"/><phase type="isotropic"/></medium>"#;
const HAZE: &str = r#"<medium type="homogeneous" id="fog"><float name="sigma_t" value="0.8"/>
    <rgb name="albedo" value="0.9 0.8 0.7"/><phase type="hg"><float name="g" value="0.6"/></phase></medium>"#;
const SOOT: &str = r#"<medium type="homogeneous" id="fog"><float name="sigma_t" value="0.8"/>
    <rgb name="albedo" value="0 0 0"/><phase type="isotropic"/></medium>"#;
const CONTAINER: &str = r#"<shape type="cube"><transform name="to_world"><scale value="1.5"/></transform>
    <bsdf type="null"/><ref name="interior" id="fog"/></shape>"#;
const WALLS: &str = r#"<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><translate y="-1"/>
    </transform><bsdf type="diffuse"><rgb name="reflectance" value="0.7 0.6 0.5"/></bsdf></shape>
    <shape type="rectangle"><transform name="to_world"><translate z="-1"/></transform>
    <bsdf type="diffuse"><rgb name="reflectance" value="0.5 0.6 0.7"/></bsdf></shape>"#;
const MIRROR: &str = r#"<shape type="sphere"><point name="center" x="-0.5" y="0" z="0"/><float name="radius" value="0.4"/>
    <bsdf type="conductor"><string name="material" value="none"/></bsdf></shape>"#;
const GLASS: &str = r#"<shape type="sphere"><point name="center" x="0.5" y="0" z="0"/><float name="radius" value="0.4"/>
    <bsdf type="dielectric"><string name="int_ior" value="water"/><float name="ext_ior" value="1"/></bsdf></shape>"#;
const LAMP: &str = r#"<shape type="rectangle">
    <transform name="to_world"><scale x="0.4" y="0.4"/><rotate x="1" angle="90"/><translate y="0.99"/></transform>
    <bsdf type="diffuse"><rgb name="reflectance" value="0 0 0"/></bsdf>
    <emitter type="area"><rgb name="radiance" value="9 8 7"/></emitter></shape>"#;
const SKY: &str = r#"<emitter type="constant"><rgb name="radiance" value="0.5 0.6 0.9"/></emitter>"#;
const SUN: &str = r#"<emitter type="directional"><vector name="direction" x="0.3" y="-1" z="-0.4"/>
    <rgb name="irradiance" value="3 3 2"/></emitter>"#;
const SPARK: &str = r#"<emitter type="point"><point name="position" x="0.1" y="0.4" z="0.2"/>
    <rgb name="intensity" value="1 1 0.8"/></emitter>"#;

impl World {
    fn of(pieces: &[&str]) -> Self {
        Self { depth: "-1", sensor: "", pieces: pieces.concat() }
    }

    fn text(&self) -> String {
        let Self { depth, sensor, pieces } = self;
        format!(
            r#"<scene version="3.0.0">
            <integrator type="volpath"><integer name="max_depth" value="{depth}"/><integer name="rr_depth" value="6"/>
            </integrator>
            {pieces}
            <sensor type="perspective"><float name="fov" value="36"/><string name="fov_axis" value="x"/>
            <float name="near_clip" value="0.01"/><float name="far_clip" value="1000"/>
            <transform name="to_world"><lookat origin="0.1, 0.1, {z}" target="0, 0, 0" up="0, 1, 0"/></transform>
            <film type="hdrfilm"><integer name="width" value="32"/><integer name="height" value="24"/>
            <rfilter type="box"/></film>
            <sampler type="independent"><integer name="sample_count" value="16"/></sampler>
            {sensor}
            </sensor></scene>"#,
            z = if sensor.is_empty() { "4" } else { "1.2" },
        )
    }
}

/// Renders by `method`; no sample may have been anything but a finite number.
fn picture(folder: &Folder, method: &str, options: &[&str]) -> Image {
    let common = ["render", "scene.xml", "--method", method, "-q", "-o", "a.pfm", "--stats", "s.json"];
    let output = folder.run(&[&common, options].concat());
    assert_eq!(output.status.code(), Some(0), "{method} {options:?}: {}", said(&output));
    let statistics = std::fs::read_to_string(folder.0.join("s.json")).unwrap();
    assert!(statistics.contains("\"non_finite\": 0}"), "{method} {options:?}: {statistics}");
    let image = read(folder.0.join("a.pfm")).unwrap();
    assert!(image.pixels.iter().all(|p| p.is_valid()), "{method} {options:?}");
    image
}

fn mean(image: &Image) -> f64 {
    image.pixels.iter().map(|p| f64::from(p.mean())).sum::<f64>() / image.pixels.len() as f64
}

/// Without an audit, which changes no picture (a test of its own says so) and would take most of the time of these small ones.
const UNAUDITED: [&str; 2] = ["--audit", "0"];

/// Mean radiance by caching and by path tracing.
fn means(name: &str, world: &World, samples: &str, options: &[&str]) -> [f64; 2] {
    let folder = Folder::new(&format!("edge-{name}"));
    std::fs::write(folder.0.join("scene.xml"), world.text()).unwrap();
    let cached =
        picture(&folder, "radiance-cache", &[&["--error", "0.05", "--seed", "3"], &UNAUDITED[..], options].concat());
    // Path tracing has nothing to do with how single scattering is cached.
    let at = options.iter().position(|option| *option == "--single").unwrap_or(options.len());
    let traced = picture(&folder, "path", &[&["--spp", samples], &options[..at]].concat());
    [mean(&cached), mean(&traced)]
}

/// The means agree within `tolerance`, a part of them.
fn agree(name: &str, world: &World, samples: &str, options: &[&str], tolerance: f64) {
    let [cached, traced] = means(name, world, samples, options);
    assert!(
        (cached - traced).abs() <= tolerance * traced,
        "{name} {options:?}: {cached} by caching, {traced} by paths"
    );
}

/// Of means over 768 pixels: caches for an error of 5 % are off by a per cent, and path tracing by one. Smaller
/// images would not do: no record's radius is less than one and a half pixels.
const FEW_PER_CENT: f64 = 0.05;

#[test]
fn options_out_of_range_are_errors() {
    let folder = Folder::new("cache-options");
    let cases: &[(&[&str], &str)] = &[
        (&["--error", "0"], "from 0.001 to 0.5"),
        (&["--error", "nan"], "from 0.001 to 0.5"),
        (&["--error", "0.6"], "from 0.001 to 0.5"),
        (&["--audit=-1"], "--audit"),
        (&["--tolerance", "0"], "greater than 0"),
        (&["--tolerance=-0.5"], "greater than 0"),
        (&["--tolerance", "nan"], "greater than 0"),
        (&["--tolerance", "inf"], "greater than 0"),
        (&["--tolerance", "fine"], "greater than 0"),
        (&["--tolerance-of", "multiple=0"], "greater than 0"),
        (&["--tolerance-of", "multiple=nan"], "greater than 0"),
        (&["--tolerance-of", "multiple"], "multiple=0.2"),
        (&["--tolerance-of", "magic=1"], "magic"),
        (&["--paths", "0"], "--paths"),
        (&["--paths=-1"], "--paths"),
        (&["--paths", "1000001"], "--paths"),
        (&["--degree", "17"], "--degree"),
        (&["--degree=-1"], "--degree"),
        (&["--uncached", "magic"], "magic"),
        (&["--single", "magic"], "magic"),
        (&["--max-depth", "3"], "not 3"),
        (&["--max-depth", "4294967295"], "not 4294967295"),
    ];
    for (options, word) in cases {
        let common = ["render", SCENE, "--method", "radiance-cache", "--size", "8x8", "-o", "a.pfm"];
        let output = folder.run(&[&common, *options].concat());
        assert_eq!(output.status.code(), Some(2), "{options:?}: {}", said(&output));
        assert!(said(&output).contains(word), "{options:?}: {}", said(&output));
        assert!(!said(&output).contains("panicked"));
    }
    assert!(folder.names().is_empty());
}

/// The audit is in the summary and in the statistics, whatever the number of threads; the picture does not depend on it.
#[test]
fn every_picture_from_caches_says_how_far_it_is_off() {
    let folder = Folder::new("cache-audit");
    std::fs::write(folder.0.join("scene.xml"), World::of(&[FOG, CONTAINER, WALLS, SPARK]).text()).unwrap();
    let render = |options: &[&str]| {
        // What is to be right, roughly, for that is quicker.
        let is_coarse = options.contains(&"--extrapolation");
        let walks = if is_coarse { ["--paths", "1"] } else { ["--error", "0.1"] };
        let common = ["render", "scene.xml", "--method", "radiance-cache", "--spp", "1", "-o", "a.pfm"];
        let output = folder.run(&[&common[..], &walks, &["--stats", "s.json"], options].concat());
        assert_eq!(output.status.code(), Some(0), "{options:?}: {}", said(&output));
        let statistics = std::fs::read_to_string(folder.0.join("s.json")).unwrap();
        let audit =
            statistics.lines().find(|line| line.contains("\"audit\": {\"made_for\": 0.1, \"rays\"")).map(str::to_owned);
        (said(&output), audit, std::fs::read(folder.0.join("a.pfm")).unwrap())
    };
    let (told, audit, image) = render(&["--threads", "1"]);
    assert!(told.contains("% of what is cached") && told.contains("along 4096 eye rays"), "{told}");
    let found = audit.clone().unwrap();
    for name in ["all", "cached", "surface", "multiple", "irradiance"] {
        assert!(found.contains(&format!("\"{name}\": {{\"bias\": ")), "{found}");
    }
    // 4096 rays are told apart in 4 by 4 regions.
    assert!(
        found.contains("\"regions\": {\"side\": 4, ") && found.matches("\"traced\": {\"mean\": ").count() == 16,
        "{found}"
    );
    let (_, again, same) = render(&["--threads", "3"]);
    assert!(again == audit && same == image);
    // So coarse that light around the lamp and in corners is wrong, and somewhere more than elsewhere: that is mended.
    let coarse = ["--tolerance", "30", "--extrapolation", "constant", "--audit", "49152"];
    let (told, ..) = render(&[&coarse[..], &["--aov", "-o", "a.exr"]].concat());
    assert!(told.contains("repaired: bias was ") && told.contains("; in places, most in columns "), "{told}");
    assert!(!told.contains("warning: "), "{told}");
    let layers = std::fs::read(folder.0.join("a.exr")).unwrap();
    for name in [&b"bias.R"[..], b"bias_error.R"] {
        assert!(layers.windows(name.len()).any(|bytes| bytes == name));
    }
    let (told, none, same) = render(&["--audit", "0"]);
    assert!(none.is_none() && !told.contains("bias") && same == image, "{told}");
}

/// Fog in a ball of glass, lit by a lamp without extent outside: photons get in, paths do not find the lamp. No repair changes that.
#[test]
fn light_that_no_path_can_find_is_told() {
    let folder = Folder::new("cache-hidden");
    let ball = r#"<shape type="sphere"><point name="center" x="0" y="0" z="0"/><float name="radius" value="0.8"/>
        <bsdf type="dielectric"/><ref name="interior" id="fog"/></shape>"#;
    let outside = SPARK.replace(r#"x="0.1" y="0.4" z="0.2""#, r#"x="1" y="1" z="1""#);
    let render = |lamp: &str| {
        std::fs::write(folder.0.join("scene.xml"), World::of(&[FOG, WALLS, ball, lamp]).text()).unwrap();
        let options = ["--error", "0.2", "--spp", "1", "--size", "16x12", "--audit", "2048", "-o", "a.pfm"];
        let output = folder.run(&[&["render", "scene.xml", "--method", "radiance-cache"], &options[..]].concat());
        assert_eq!(output.status.code(), Some(0), "{}", said(&output));
        said(&output)
    };
    let told = render(&outside);
    assert!(told.contains("warning: ") && told.contains("note: mirrors or glass send on light of lamps"), "{told}");
    assert!(!told.contains("repaired: "), "{told}");
    let told = render(LAMP);
    assert!(!told.contains("note: mirrors"), "{told}");
}

/// Without a method: by caching where it can, else by path tracing, and the reason. Which it is stands in the statistics, too.
#[test]
fn caching_is_what_is_taken_unless_something_speaks_against_it() {
    let folder = Folder::new("cache-default");
    let foggy = World::of(&[FOG, CONTAINER, WALLS, LAMP]);
    let limited = World { depth: "8", ..World::of(&[FOG, CONTAINER, WALLS, LAMP]) };
    let polished = World::of(&[MIRROR, GLASS, SKY]);
    let cached = "by radiance caching; --method takes others";
    let traced = "by path tracing and not by radiance caching: ";
    let cases: &[(&World, &[&str], &[&str])] = &[
        (&foggy, &[], &[cached]),
        (&World::of(&[WALLS, LAMP]), &[], &[cached]),
        (&World::of(&[FOG, CONTAINER, SUN]), &["--uncached", "surface"], &[cached]),
        (&foggy, &["--noise", "0.5"], &[cached]),
        (&limited, &[], &[traced, "not of at most 8"]),
        (&foggy, &["--max-depth", "3"], &[traced, "not of at most 3"]),
        (&foggy, &["--max-depth", "2"], &[traced, "nothing is left to cache of paths of depth 2"]),
        (&foggy, &["--max-depth", "1"], &[traced, "nothing is left to cache of paths of depth 1"]),
        (&foggy, &["--time", "0.1"], &[cached]),
        (&polished, &[], &[traced, "but mirrors and glass"]),
    ];
    for (world, options, words) in cases {
        std::fs::write(folder.0.join("scene.xml"), world.text()).unwrap();
        let render = |more: &[&str]| {
            let common = ["render", "scene.xml", "--spp", "1", "--stats", "s.json", "-o", "a.pfm"];
            let is_cached = words[0] == cached && !more.contains(&"--method");
            let quick: &[&str] = if is_cached { &["--paths", "16", "--error", "0.5"] } else { &[] };
            let options: Vec<&str> = if is_cached {
                options.to_vec()
            } else {
                options.iter().copied().filter(|option| !["--uncached", "surface"].contains(option)).collect()
            };
            let output = folder.run(&[&common, quick, &options, more].concat());
            assert_eq!(output.status.code(), Some(0), "{options:?} {more:?}: {}", said(&output));
            (said(&output), std::fs::read_to_string(folder.0.join("s.json")).unwrap())
        };
        let (told, statistics) = render(&[]);
        let (method, other) = if words[0] == cached { ("radiance-cache", "path") } else { ("path", "photon-beams") };
        assert!(words.iter().all(|word| told.contains(word)), "{options:?}: {told}");
        assert!(statistics.contains(&format!("\"method\": \"{method}\"")), "{options:?}: {statistics}");
        assert_eq!(statistics.contains("\"why_path\": "), method == "path", "{options:?}: {statistics}");
        // Who names a method is not told why.
        if !options.contains(&"--noise") {
            let (told, statistics) = render(&["--method", other]);
            assert!(!told.contains("by radiance caching") && !told.contains("by path tracing and"), "{told}");
            assert!(statistics.contains(&format!("\"method\": \"{other}\"")), "{options:?}: {statistics}");
        }
        assert!(render(&["-q"]).0.is_empty());
    }
}

#[test]
fn extreme_but_lawful_options_give_finite_images() {
    let folder = Folder::new("cache-extremes");
    std::fs::write(folder.0.join("scene.xml"), World::of(&[HAZE, CONTAINER, WALLS, LAMP]).text()).unwrap();
    // An extreme itself; and most of the time would go into photons.
    let few = ["--spp", "1", "--paths", "1", "--error", "0.5"];
    let audited: &[&[&str]] =
        &[&["--tolerance", "1e300"], &["--degree", "16"], &["--size", "1x1"], &["--threads", "5"]];
    let unaudited: &[&[&str]] = &[
        &["--tolerance", "1e30"],
        &["--degree", "0"],
        &["--uncached", "multiple"],
        &["--uncached", "surface", "--uncached", "irradiance"],
        &["--uncached", "single", "--uncached", "surface", "--uncached", "multiple", "--uncached", "irradiance"],
        &["--single", "cached"],
        &["--single", "cached", "--uncached", "single"],
        &["--size", "2x1"],
    ];
    for options in audited {
        picture(&folder, "radiance-cache", &[&few, *options].concat());
    }
    for options in unaudited {
        picture(&folder, "radiance-cache", &[&few, &UNAUDITED[..], *options].concat());
    }
}

#[test]
fn a_world_without_light_is_black() {
    for pieces in [&[FOG, CONTAINER, WALLS][..], &[WALLS], &[]] {
        assert_eq!(means("dark", &World::of(pieces), "4", &[]), [0.0, 0.0], "{pieces:?}");
    }
}

#[test]
fn worlds_that_lack_a_medium_or_surfaces_look_as_path_traced() {
    agree("clear", &World::of(&[WALLS, LAMP]), "256", &[], FEW_PER_CENT);
    agree("soot", &World::of(&[SOOT, CONTAINER, WALLS, LAMP]), "256", &[], FEW_PER_CENT);
    agree("fog-only", &World::of(&[FOG, CONTAINER, SUN]), "256", &[], FEW_PER_CENT);
    agree("haze-only", &World::of(&[HAZE, CONTAINER, SUN]), "256", &[], FEW_PER_CENT);
    agree("soot-only", &World::of(&[SOOT, CONTAINER, SKY]), "64", &[], FEW_PER_CENT);
    agree("sky-only", &World::of(&[SKY]), "4", &[], 1e-5);
}

#[test]
fn worlds_of_mirrors_and_glass_look_as_path_traced() {
    agree("mirror", &World::of(&[MIRROR, SKY]), "256", &[], FEW_PER_CENT);
    agree("glass", &World::of(&[MIRROR, GLASS, SKY]), "256", &[], FEW_PER_CENT);
    agree("mirror-in-fog", &World::of(&[FOG, CONTAINER, MIRROR, GLASS, SUN]), "512", &[], FEW_PER_CENT);
}

#[test]
fn light_from_everywhere_or_within_the_medium_looks_as_path_traced() {
    agree("sky", &World::of(&[FOG, CONTAINER, WALLS, SKY]), "256", &[], FEW_PER_CENT);
    agree("spark", &World::of(&[FOG, CONTAINER, WALLS, SPARK]), "512", &[], FEW_PER_CENT);
    agree("sparks", &World::of(&[FOG, CONTAINER, SPARK]), "512", &["--single", "cached"], FEW_PER_CENT);
}

#[test]
fn a_camera_in_the_medium_and_single_pixels_look_as_path_traced() {
    let inside = World { sensor: r#"<ref name="medium" id="fog"/>"#, ..World::of(&[HAZE, CONTAINER, WALLS, LAMP]) };
    agree("inside", &inside, "256", &[], FEW_PER_CENT);
    let pixel = ["--size", "1x1"];
    // As many samples in one pixel as elsewhere in all.
    let world = World::of(&[FOG, CONTAINER, WALLS, LAMP]);
    let folder = Folder::new("edge-pixel");
    std::fs::write(folder.0.join("scene.xml"), world.text()).unwrap();
    let options = [&pixel[..], &UNAUDITED, &["--spp", "512", "--error", "0.05"]].concat();
    let cached = mean(&picture(&folder, "radiance-cache", &options));
    let traced = mean(&picture(&folder, "path", &[&pixel[..], &["--spp", "100000"]].concat()));
    assert!((cached - traced).abs() <= FEW_PER_CENT * traced, "{cached} by caching, {traced} by paths");
}

#[test]
fn limits_on_depth_are_kept() {
    let lit = World::of(&[FOG, CONTAINER, WALLS, LAMP, SUN]);
    agree("depth-1", &lit, "256", &["--max-depth", "1"], FEW_PER_CENT);
    agree("depth-2", &lit, "512", &["--max-depth", "2"], FEW_PER_CENT);
    // The scene may say so, too.
    agree(
        "depth-2-scene",
        &World { depth: "2", ..World::of(&[HAZE, CONTAINER, WALLS, LAMP]) },
        "256",
        &[],
        FEW_PER_CENT,
    );
    let folder = Folder::new("depth-of-scene");
    std::fs::write(folder.0.join("scene.xml"), World { depth: "8", ..lit }.text()).unwrap();
    let output = folder.run(&["render", "scene.xml", "--method", "radiance-cache", "-o", "a.pfm"]);
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    assert!(said(&output).contains("max_depth of the scene"), "{}", said(&output));
}
