//! `--method vpl` as users call it.

use super::{Folder, SCENE, said};

const QUICK: [&str; 11] =
    ["render", SCENE, "--method", "vpl", "--size", "16x12", "--lights", "100", "--candidates", "2", "-q"];

fn run(folder: &Folder, more: &[&str]) -> std::process::Output {
    folder.run(&[QUICK.as_slice(), more].concat())
}

#[test]
fn the_same_bits_come_from_any_number_of_threads_and_all_ways_of_compensation() {
    let folder = Folder::new("vpl");
    for way in ["none", "full", "n-to-1", "1-to-1", "abc"] {
        let mut images = Vec::new();
        for threads in ["1", "2", "7"] {
            let more =
                ["--compensation", way, "--threads", threads, "--pass-samples", "4", "--spp", "8", "-o", "a.pfm"];
            let output = run(&folder, &more);
            assert_eq!(output.status.code(), Some(0), "{way}: {}", said(&output));
            images.push(std::fs::read(folder.0.join("a.pfm")).unwrap());
        }
        assert!(images[0] == images[1] && images[1] == images[2], "{way}");
    }
}

#[test]
fn statistics_have_an_audit_of_energy() {
    let folder = Folder::new("vpl-audit");
    let output = run(&folder, &["--aov", "-o", "a.exr", "--stats", "s.json"]);
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let statistics: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(folder.0.join("s.json")).unwrap()).unwrap();
    let energy = &statistics["energy"];
    let number = |key: &str| energy[key].as_f64().unwrap_or_else(|| panic!("{key}: {statistics}"));
    let recovered: Vec<f64> = energy["recovered"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
    assert!(number("bound") > 0.0 && number("clamped_layer") > 0.0);
    assert!(recovered[0] > recovered[1] && recovered[1] > 0.0 && recovered[2] == 0.0, "{recovered:?}");
    let lost = number("left") + recovered.iter().sum::<f64>();
    assert!((number("clamped_away") / lost - 1.0).abs() < 1e-5);
    assert_eq!(statistics["bytes"]["virtual lights"].as_u64(), Some(14_000));
}

#[test]
fn time_may_end_a_pass() {
    let folder = Folder::new("vpl-time");
    let output = run(&folder, &["--lights", "4000", "--pass-samples", "4000", "--time", "0.5", "-o", "a.pfm"]);
    assert_eq!(output.status.code(), Some(2), "an option given twice");
    let more = ["--pass-samples", "4000", "--time", "0.5", "-o", "a.pfm", "--stats", "s.json"];
    let output = run(&folder, &more);
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let statistics = std::fs::read_to_string(folder.0.join("s.json")).unwrap();
    assert!(statistics.contains("\"ended\": \"time\""), "{statistics}");
}

#[test]
fn worlds_without_light_or_medium_are_pictures() {
    let folder = Folder::new("vpl-worlds");
    let scene = std::fs::read_to_string(SCENE).unwrap();
    // No light; nothing at all.
    let start = scene.find("<emitter").unwrap();
    let end = start + scene[start..].find("</emitter>").unwrap() + "</emitter>".len();
    std::fs::write(folder.0.join("dark.xml"), [&scene[..start], &scene[end..]].concat()).unwrap();
    let black = "<scene version=\"3.0.0\"><integrator type=\"volpath\"/><sensor type=\"perspective\">\
                 <float name=\"fov\" value=\"40\"/><film type=\"hdrfilm\">\
                 <integer name=\"width\" value=\"8\"/><integer name=\"height\" value=\"8\"/>\
                 <rfilter type=\"box\"/></film></sensor></scene>";
    std::fs::write(folder.0.join("nothing.xml"), black).unwrap();
    for name in ["dark.xml", "nothing.xml"] {
        for way in ["none", "full", "abc"] {
            let output = folder.run(&[
                "render",
                name,
                "--method",
                "vpl",
                "--size",
                "8x8",
                "--spp",
                "4",
                "--pass-samples",
                "4",
                "--compensation",
                way,
                "-q",
                "-o",
                "a.pfm",
            ]);
            assert_eq!(output.status.code(), Some(0), "{name}: {}", said(&output));
            let image = std::fs::read(folder.0.join("a.pfm")).unwrap();
            let pixels = &image[image.len() - 8 * 8 * 12..];
            assert!(pixels.iter().all(|&byte| byte == 0), "{name}, {way}: not black");
        }
    }
}

#[test]
fn bad_options_are_named() {
    let folder = Folder::new("vpl-bad");
    let cases: &[(&[&str], &str)] = &[
        (&["--clamp", "0"], "--clamp"),
        (&["--clamp", "-1"], "positive"),
        (&["--clamp", "nan"], "positive"),
        (&["--clamp", "inf"], "`auto` or `off`"),
        (&["--compensation", "none", "--steps", "2"], "--steps and --local-visibility need"),
        (&["--compensation", "full", "--local-visibility", "on"], "--compensation full"),
        (&["--compensation", "full", "--share", "2"], "--share needs"),
        (&["--clamp", "off", "--steps", "2"], "--clamp off"),
        (&["--steps", "0"], "--steps"),
        (&["--light-points", "0"], "--light-points"),
    ];
    for (more, word) in cases {
        let output = run(&folder, &[more, ["-o", "a.pfm"].as_slice()].concat());
        assert_eq!(output.status.code(), Some(2), "{more:?}: {}", said(&output));
        assert!(said(&output).contains(word), "{more:?}: {}", said(&output));
    }
    for (arguments, word) in [
        (["render", SCENE, "--lights", "0"], "--lights"),
        (["render", SCENE, "--lights", "10"], "--method vpl"),
        (["render", SCENE, "--clamp", "3"], "--method vpl"),
    ] {
        let output = folder.run(&arguments);
        assert_eq!(output.status.code(), Some(2));
        assert!(said(&output).contains(word), "{}", said(&output));
    }
    // A number of steps without end is a picture.
    let output = run(&folder, &["--steps", "4294967295", "--spp", "8", "--pass-samples", "8", "-o", "a.pfm"]);
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    assert_eq!(folder.names(), ["a.pfm"]);
}
