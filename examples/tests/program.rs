//! The program as users call it: exit codes, files, messages.

mod bake;
mod care;
mod parts;
mod radiance_cache;
mod vpl;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use fogbow_examples::figures::{self, belcour, engelhardt};

const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/smoke-box-homogeneous-anisotropic.xml");

/// A folder of its own, gone when dropped.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("fogbow-program-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn fogbow(&self) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_fogbow"));
        command.current_dir(&self.0);
        command
    }

    fn run(&self, arguments: &[&str]) -> Output {
        self.fogbow().args(arguments).output().unwrap()
    }

    fn names(&self) -> Vec<String> {
        let mut names: Vec<String> = std::fs::read_dir(&self.0)
            .unwrap()
            .map(|e| e.unwrap().file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn a_render_leaves_its_images_and_a_summary() {
    let folder = Folder::new("render");
    let output = folder.run(&["render", SCENE, "--method", "path", "--size", "16x8", "--spp", "2"]);
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    assert_eq!(folder.names(), ["smoke-box-homogeneous-anisotropic.exr", "smoke-box-homogeneous-anisotropic.png"]);
    assert!(said(&output).contains("16 x 8 pixels, 2 samples per pixel"), "{}", said(&output));
}

#[test]
fn every_scene_here_renders_with_layers_and_statistics() {
    let folder = Folder::new("all");
    let scenes = Path::new(SCENE).parent().unwrap();
    let mut count = 0;
    for entry in std::fs::read_dir(scenes).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|e| e != "xml") {
            continue;
        }
        let scene = path.to_string_lossy();
        let arguments = [
            "render", &scene, "--method", "path", "--size", "32x32", "--spp", "1", "--aov", "-o", "a.exr", "-o",
            "a.pfm", "--stats", "s.json", "-q",
        ];
        let output = folder.run(&arguments);
        assert_eq!(output.status.code(), Some(0), "{scene}: {}", said(&output));
        assert!(output.stderr.is_empty(), "{}", said(&output));
        let statistics = std::fs::read_to_string(folder.0.join("s.json")).unwrap();
        for key in ["\"seconds\"", "\"rays\"", "\"cpu\"", "\"bytes\"", "\"ended\": \"done\""] {
            assert!(statistics.contains(key), "{statistics}");
        }
        count += 1;
    }
    assert_eq!(count, 18);
}

#[test]
fn a_camera_replaces_that_of_the_scene() {
    let folder = Folder::new("camera");
    let mut images = Vec::new();
    // The first is where the camera of the scene stands already.
    for camera in [None, Some("0,0,4 0,0,0"), Some("0.5,0,4 0,0,0")] {
        let mut command = folder.fogbow();
        command.args(["render", SCENE, "--method", "path", "--size", "16x16", "--spp", "2", "-q", "-o", "a.pfm"]);
        command.args(camera.iter().flat_map(|c| ["--camera", c]));
        let output = command.output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", said(&output));
        images.push(std::fs::read(folder.0.join("a.pfm")).unwrap());
    }
    assert!(images[0] == images[1] && images[0] != images[2]);
}

#[test]
fn the_walk_stays_in_the_atrium_and_takes_short_steps() {
    let folder = Folder::new("walk");
    let scenes = Path::new(SCENE).parent().unwrap();
    let atrium = scenes.join("atrium.xml").to_string_lossy().into_owned();
    let walk = std::fs::read_to_string(scenes.join("atrium-walk.txt")).unwrap();
    let origins: Vec<Vec<f64>> =
        walk.lines().map(|l| l.split(' ').next().unwrap().split(',').map(|c| c.parse().unwrap()).collect()).collect();
    assert_eq!(origins.len(), 10);
    for pair in origins.windows(2) {
        let step = (0..3).map(|i| (pair[1][i] - pair[0][i]).powi(2)).sum::<f64>().sqrt();
        assert!(step > 0.1 && step < 1.0, "{pair:?}");
    }
    for camera in walk.lines() {
        let small = ["--method", "path", "--size", "8x8", "--spp", "1", "-q", "-o", "a.pfm"];
        let output = folder.run(&[&["render", &atrium, "--camera", camera], &small[..]].concat());
        assert_eq!(output.status.code(), Some(0), "{camera}: {}", said(&output));
        assert!(output.stderr.is_empty(), "{}", said(&output));
    }
}

#[test]
fn a_plume_is_a_folder_of_scenes_that_render() {
    let folder = Folder::new("plume");
    for name in ["a", "b"] {
        let output = folder.run(&["plume", "--frames", "3", "--resolution", "16", "-o", name]);
        assert_eq!(output.status.code(), Some(0), "{}", said(&output));
        assert!(said(&output).contains("plume-02.xml"), "{}", said(&output));
    }
    for frame in ["plume-00", "plume-01", "plume-02"] {
        for extension in ["vol", "xml"] {
            let file = |name: &str| std::fs::read(folder.0.join(format!("{name}/{frame}.{extension}"))).unwrap();
            assert!(file("a") == file("b"), "{frame}.{extension}");
        }
        let small = ["--method", "path", "--size", "32x32", "--spp", "1", "-q", "-o", "a.pfm"];
        let output = folder.run(&[&["render", &format!("a/{frame}.xml")], &small[..]].concat());
        assert_eq!(output.status.code(), Some(0), "{frame}: {}", said(&output));
    }
    assert_eq!(std::fs::read_dir(folder.0.join("a")).unwrap().count(), 6);
}

#[test]
fn figures_come_with_a_page_that_shows_them_all() {
    let folder = Folder::new("figures");
    let output = folder.run(&["figures", "jarosz", "--quick", "--only", "4", "--only", "5", "-o", "a/b"]);
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let page = std::fs::read_to_string(folder.0.join("a/b/README.md")).unwrap();
    let mut shown = 0;
    for entry in std::fs::read_dir(folder.0.join("a/b")).unwrap() {
        let name = entry.unwrap().file_name().to_string_lossy().into_owned();
        shown += usize::from(name != "README.md");
        assert!(name == "README.md" || page.contains(&format!("]({name})")), "{name} is not on the page");
    }
    assert_eq!(shown, page.matches("](fig-").count());
    let output = folder.run(&["figures", "jarosz", "--only", "8", "--scenes", "nowhere", "-o", "c"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(said(&output).contains("atrium.xml"), "{}", said(&output));
}

#[test]
fn the_pages_here_show_all_figures() {
    for (paper, numbers) in
        [("jarosz", figures::NUMBERS.as_slice()), ("belcour", &belcour::NUMBERS), ("engelhardt", &engelhardt::NUMBERS)]
    {
        let folder = Path::new(SCENE).parent().unwrap().join("../figures").join(paper);
        let page = std::fs::read_to_string(folder.join("README.md")).unwrap();
        let heads: Vec<&str> = page.lines().filter(|line| line.starts_with("## Fig")).collect();
        for number in numbers {
            let is_word =
                |head: &&str| head.split(|c: char| !c.is_ascii_digit()).any(|word| *word == number.to_string());
            assert!(heads.iter().any(is_word), "{paper} {number}");
        }
        for entry in std::fs::read_dir(&folder).unwrap() {
            let name = entry.unwrap().file_name().to_string_lossy().into_owned();
            assert!(name == "README.md" || page.contains(&format!("]({name})")), "{paper}: {name} is not on the page");
        }
        for name in page.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            assert!(folder.join(name).exists(), "{paper}: {name}");
        }
    }
}

#[test]
fn the_same_bits_come_from_any_number_of_threads() {
    let folder = Folder::new("threads");
    let mut images = Vec::new();
    for threads in ["1", "2", "7"] {
        let small = ["--method", "path", "--size", "24x24", "--spp", "4", "-q", "-o", "a.pfm"];
        let output = folder.run(&[&["render", SCENE, "--threads", threads], &small[..]].concat());
        assert_eq!(output.status.code(), Some(0), "{}", said(&output));
        images.push(std::fs::read(folder.0.join("a.pfm")).unwrap());
    }
    assert!(images[0] == images[1] && images[1] == images[2]);
}

#[test]
fn bad_input_is_exit_code_2_and_no_image() {
    let folder = Folder::new("bad");
    std::fs::write(
        folder.0.join("bad.xml"),
        "<scene version=\"3.0.0\"><shape type=\"sphere\"><bsdf type=\"magic\" id=\"x\"/></shape></scene>",
    )
    .unwrap();
    let cases: &[(&[&str], &str)] = &[
        (&["render", "none.xml"], "none.xml: cannot be read"),
        (&["render", "bad.xml"], "bad.xml:1: <bsdf type=\"magic\" id=\"x\">: attribute \"type\""),
        (&["render", SCENE, "-o", "a.tiff"], "a.tiff: the extension"),
        (&["render", SCENE, "-o", "none/a.png"], "cannot be written"),
        (&["render", SCENE, "--aov", "-o", "a.png"], "--aov"),
        (&["render", SCENE, "--size", "0x4"], "sides"),
        (&["render", SCENE, "--size", "4"], "640x480"),
        (&["render", SCENE, "--camera", "1,2,3"], "0,1.8,4 0,1,0"),
        (&["render", SCENE, "--camera", "-1,2,inf 0,0,0"], "0,1.8,4 0,1,0"),
        (&["render", SCENE, "--camera", "0,5,0 0,1,0"], "--camera: the target must lie apart"),
        (&["render", SCENE, "--camera", "0,1,0 0,1,0"], "--camera: the target must lie apart"),
        (&["render", SCENE, "--camera", "0,0,-4000 0,0,0"], "--camera: far_clip 1000 would cut"),
        (&["render", SCENE, "--size", "65536x65536"], "pixels"),
        (&["render", SCENE, "--spp", "0"], "--spp"),
        (&["render", SCENE, "--time=-3"], "--time"),
        (&["render", SCENE, "--noise", "0"], "--noise"),
        (&["render", SCENE, "--noise", "0.02", "--method", "vpl"], "--noise: the noise of photon beams"),
        (&["render", SCENE, "--time", "nan"], "--time"),
        (&["render", SCENE, "--max-depth", "0"], "--max-depth"),
        (&["render", SCENE, "--method", "magic"], "magic"),
        (&["render", SCENE, "--stats", "none/s.json"], "cannot be written"),
        (&["plume", "--frames", "0", "-o", "a"], "--frames"),
        (&["plume", "--resolution", "7", "-o", "a"], "--resolution"),
        (&["plume"], "--output"),
        (&["plume", "-o", "bad.xml"], "bad.xml: cannot be written"),
        (&["compare", "a.png", "b.png"], "a.png: cannot be read"),
        (&["compare", "a.gif", "b.png"], "kind of image"),
    ];
    for (arguments, word) in cases {
        let output = folder.run(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", said(&output));
        assert!(said(&output).contains(word), "{arguments:?}: {}", said(&output));
        assert!(!said(&output).contains("panicked"));
    }
    assert_eq!(folder.names(), ["bad.xml"]);
}

#[test]
fn an_image_equals_itself_and_time_limits_hold() {
    let folder = Folder::new("compare");
    let small = ["--method", "path", "--size", "16x16", "--time", "0.5", "-q", "-o", "a.exr", "-o", "b.pfm"];
    let output = folder.run(&[&["render", SCENE], &small[..]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let output = folder.run(&["compare", "a.exr", "b.pfm", "-o", "d.png"]);
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(text.contains("relRMSE      0.000000") && text.contains("worst block"), "{text}");
    assert!(folder.names().contains(&"d.png".to_owned()));
}

/// With limited time caches are filled for smaller and smaller errors, down to the one asked for.
#[test]
fn time_makes_pictures_from_caches_better() {
    let folder = Folder::new("time");
    let render = |options: &[&str]| -> serde_json::Value {
        let small = ["render", SCENE, "--size", "24x24", "--stats", "s.json", "-o", "a.pfm"];
        let output = folder.run(&[&small[..], options].concat());
        assert_eq!(output.status.code(), Some(0), "{}", said(&output));
        assert!(said(&output).contains("made for an error of"), "{}", said(&output));
        let stats = std::fs::read(folder.0.join("s.json")).unwrap();
        serde_json::from_slice(&stats).unwrap()
    };
    let error = |stats: &serde_json::Value| stats["audit"]["made_for"].as_f64().unwrap();
    let first = render(&["--time", "0.01"]);
    assert!(first["method"] == "radiance-cache" && first["ended"] == "time", "{first}");
    assert!((error(&first) - 0.16).abs() < 1e-6, "{first}");
    // Not nearly a minute.
    let asked = render(&["--time", "60", "--error", "0.1"]);
    assert!((error(&asked) - 0.1).abs() < 1e-6 && asked["ended"] == "done", "{asked}");
    // As long as this machine needs for another level, however fast it is.
    let wall = |phase: &serde_json::Value| phase["wall"].as_f64().unwrap();
    let seconds: f64 = first["seconds"].as_object().unwrap().values().map(wall).sum();
    let longer = render(&["--time", &format!("{:.1}", 4.0 * seconds)]);
    assert!(error(&longer) < 0.1 && longer["ended"] == "time", "{longer}");
}

/// What a long render to `a.pfm` leaves that is stopped after two seconds.
#[cfg(unix)]
fn interrupted(folder: &Folder, options: &[&str]) -> Output {
    let child = folder
        .fogbow()
        .args(["render", SCENE, "--size", "32x32", "-o", "a.pfm"])
        .args(options)
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    std::thread::sleep(core::time::Duration::from_secs(2));
    let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(killed.success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    output
}

#[cfg(unix)]
#[test]
fn ctrl_c_keeps_the_image_so_far() {
    let folder = Folder::new("stop");
    let output = interrupted(&folder, &["--method", "path", "--spp", "1000000"]);
    assert!(said(&output).contains("stopped early"), "{}", said(&output));
    assert_eq!(folder.names(), ["a.pfm"]);
}

/// Before the first sample there is no picture to keep.
#[cfg(unix)]
#[test]
fn ctrl_c_while_caches_are_filled_leaves_no_image() {
    let folder = Folder::new("stop-filling");
    let output = interrupted(&folder, &["--paths", "1000000"]);
    assert!(said(&output).contains("stopped before the caches had been filled"), "{}", said(&output));
    assert!(folder.names().is_empty());
}

#[test]
fn a_probe_writes_a_row_per_point_and_refuses_what_it_cannot_answer() {
    let folder = Folder::new("probe");
    let quick = ["--grid-paths", "2000", "--grid-cells", "24"];
    let run = |more: &[&str]| folder.run(&[&["probe", "hessian", SCENE], &quick[..], more].concat());
    let output = run(&["--line", "0,-0.5,0 0,0.5,0", "--samples", "5", "-o", "line.csv", "--grid-out", "grid"]);
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    assert!(said(&output).contains("5 points, in a grid of 24 x 24 x 24 cells filled by 2000 photons"));
    let text = std::fs::read_to_string(folder.0.join("line.csv")).unwrap();
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(rows.len(), 6);
    assert!(rows.iter().all(|row| row.len() == 25), "{text}");
    assert_eq!(
        (rows[0][4], rows[0][10], rows[0][13], rows[0][24]),
        ("bound_xx", "bound_1", "difference_xx", "filtered_zz")
    );
    assert_eq!(rows[5][..3], ["0", "0.5", "0"]);
    assert!(rows[1..].iter().flatten().all(|entry| entry.parse::<f64>().is_ok_and(f64::is_finite)), "{text}");

    // From the file, and on standard output: the same. What has no neighbours stays empty.
    let output = run(&["--at", "0,0.5,0", "--at", "-1,-1,-1", "-q", "--grid-in", "grid"]);
    assert!(output.status.success() && output.stderr.is_empty(), "{}", said(&output));
    let again = String::from_utf8(output.stdout).unwrap();
    assert_eq!(again.lines().nth(1), text.lines().nth(5));
    assert!(again.lines().nth(2).unwrap().contains(",,,,,,"), "{again}");
    let output = run(&["--grid", "2x3x4", "-q", "--threads", "2"]);
    assert_eq!(String::from_utf8(output.stdout).unwrap().lines().count(), 1 + 24);

    for (arguments, reason) in [
        (&["--at", "0,0,7"][..], "0,0,7 lies outside of the grid, which reaches from"),
        (&["--line", "0,0,0 0,0,7"][..], "lies outside of the grid"),
        (&["--at", "0,0"][..], "must look like \"0,1.8,4\""),
        (&["--line", "0,0,0"][..], "a point, a space, another point"),
        (&["--grid", "0x1x1"][..], "must look like 16x16x16"),
        (&["--grid", "1000x1000x1000"][..], "at most 4000000 points"),
        (&["--at", "0,0,0", "--grid", "2x2x2"][..], "cannot be used with"),
        (&[][..], "--at <X,Y,Z>|--line <FROM TO>|--grid <NxNxN>"),
        (&["--at", "0,0,0", "--grid-in", "grid", "--max-depth", "3"][..], "another scene, or with another --max-depth"),
        (&["--at", "0,0,0", "--grid-in", "line.csv"][..], "is no covariance grid"),
        (&["--at", "0,0,0", "-o", "nowhere/a.csv"][..], "cannot be written"),
    ] {
        let output = run(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(said(&output).contains(reason), "{arguments:?}: {}", said(&output));
    }
}

/// Fog too dense for the cells that caches end their walks in is told of before anybody believes its picture.
#[test]
fn clouds_of_very_many_free_paths_are_suspicious() {
    let folder = Folder::new("dense");
    let box_of_smoke = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/noise-box.xml");
    let text = std::fs::read_to_string(box_of_smoke).unwrap();
    let volumes = concat!("value=\"", env!("CARGO_MANIFEST_DIR"), "/scenes/volumes/");
    for (scale, is_told) in [("4", false), ("400", true)] {
        let scaled = text.replace("name=\"scale\" value=\"4\"", &format!("name=\"scale\" value=\"{scale}\""));
        std::fs::write(folder.0.join("scene.xml"), scaled.replace("value=\"volumes/", volumes)).unwrap();
        let output = folder.run(&["check", "scene.xml"]);
        let told = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        assert_eq!(told.contains("free paths across: radiance caching may leave blotches"), is_told, "{told}");
    }
}
