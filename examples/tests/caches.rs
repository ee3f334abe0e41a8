//! Caches in files, as users of the program keep them: the same pictures, less work, clear refusals.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use fogbow_examples::picture::Picture;

const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/smoke-box-homogeneous-anisotropic.xml");

/// Few and rough records, few photons, and no audit: these tests are of files and not of pictures.
const ROUGH: [&str; 17] = [
    "--method",
    "radiance-cache",
    "--single",
    "cached",
    "--paths",
    "16",
    "--tolerance",
    "2",
    "--degree",
    "1",
    "--spp",
    "2",
    "-q",
    "--audit",
    "0",
    "--error",
    "0.2",
];

/// A folder of its own, gone when dropped.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("fogbow-program-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn run(&self, arguments: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_fogbow")).current_dir(&self.0).args(arguments).output().unwrap()
    }

    /// Renders 24 × 24 pixels to `picture.pfm`, and its bytes; how many records were computed.
    fn render(&self, more: &[&str]) -> (Vec<u8>, u64) {
        let files = ["-o", "picture.pfm", "--stats", "s.json"];
        let output = self.run(&[&["render", SCENE, "--size", "24x24"], &ROUGH[..], &files, more].concat());
        assert_eq!(output.status.code(), Some(0), "{more:?}: {}", said(&output));
        let statistics = String::from_utf8(self.bytes("s.json")).unwrap();
        let computed = statistics.split("\"computed\": ").nth(1).unwrap();
        (self.bytes("picture.pfm"), computed[..computed.find('}').unwrap()].parse().unwrap())
    }

    fn bytes(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.0.join(name)).unwrap()
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
fn a_complete_cache_makes_the_same_picture_with_no_new_record() {
    let folder = Folder::new("complete");
    let (plain, computed) = folder.render(&[]);
    let (first, _) = folder.render(&["--cache-out", "a.caches", "--threads", "1"]);
    let (again, none) = folder.render(&["--cache-in", "a.caches", "--cache-out", "b.caches", "--threads", "3"]);
    assert!(plain == first && first == again);
    assert!(computed > 20 && none == 0, "{computed}, {none}");
    assert!(folder.bytes("a.caches") == folder.bytes("b.caches"));
}

#[test]
fn another_view_adds_to_the_same_file_what_is_missing() {
    let folder = Folder::new("view");
    let camera = ["--camera", "0.4,0.1,3.9 0,0,0"];
    let (_, alone) = folder.render(&camera);
    let (first, _) = folder.render(&["--cache-out", "a.caches"]);
    let size = folder.bytes("a.caches").len();
    let both = [&camera[..], &["--cache-in", "a.caches", "--cache-out", "a.caches"]].concat();
    let (second, added) = folder.render(&both);
    assert!(added < alone / 2, "{added} of {alone}");
    assert!(folder.bytes("a.caches").len() >= size);
    assert!(first != second);
    assert_eq!(folder.render(&both), (second, 0));
    // What was added for the other view does not make the first one incomplete.
    assert_eq!(folder.render(&["--cache-in", "a.caches"]).1, 0);
}

#[test]
fn caches_of_anything_else_are_refused() {
    let folder = Folder::new("refused");
    folder.render(&["--cache-out", "a.caches"]);
    let scene = std::fs::read_to_string(SCENE).unwrap();
    let other = scene.replacen("<float name=\"g\" value=\"0.", "<float name=\"g\" value=\"0.1", 1);
    assert_ne!(other, scene);
    std::fs::write(folder.0.join("other.xml"), other).unwrap();
    let moved = scene.replacen("<lookat origin=\"0", "<lookat origin=\"0.1", 1);
    assert_ne!(moved, scene);
    std::fs::write(folder.0.join("moved.xml"), moved).unwrap();
    std::fs::write(folder.0.join("a.png"), b"\x89PNG\r\n\x1a\n").unwrap();
    std::fs::write(folder.0.join("empty"), b"").unwrap();
    let whole = folder.bytes("a.caches");
    std::fs::write(folder.0.join("cut"), &whole[..whole.len() / 2]).unwrap();
    let mut flipped = whole.clone();
    flipped[whole.len() / 2] ^= 16;
    std::fs::write(folder.0.join("flipped"), flipped).unwrap();
    fn with(file: &'static str, more: &[&'static str]) -> Vec<&'static str> {
        [&["render", SCENE, "--size", "24x24", "--cache-in", file], &ROUGH[..], more].concat()
    }
    let cases: &[(Vec<&str>, &[&str])] = &[
        (with("none", &[]), &["none: ", "No such file"]),
        (with(".", &[]), &[".: is not a file"]),
        (with("empty", &[]), &["empty: is cut off after 0 bytes"]),
        (with("a.png", &[]), &["a.png: is no file of radiance caches"]),
        (with("cut", &[]), &["cut: is cut off"]),
        (with("flipped", &[]), &["flipped: ", "damaged"]),
        (
            with("a.caches", &["--max-depth", "1"]),
            &["a.caches: was made for another scene, or with another --max-depth"],
        ),
        (
            with("a.caches", &["--tolerance-of", "irradiance=0.5"]),
            &["a.caches: ", "\"irradiance\"", "tolerance 2; 0.5"],
        ),
        (with("a.caches", &["--uncached", "surface"]), &["a.caches: ", "\"surface\"", "not asked for"]),
        (with("a.caches", &["--cache-out", "none/b"]), &["none/b: cannot be written"]),
        (with("a.caches", &["--cache-out", "."]), &[".: cannot be written"]),
        (vec!["render", SCENE, "--method", "path", "--cache-in", "a.caches"], &["--method radiance-cache"]),
        (vec!["render", SCENE, "--method", "path", "--cache-out", "b.caches"], &["--method radiance-cache"]),
        (
            vec!["render", SCENE, "--max-depth", "5", "--cache-out", "b.caches"],
            &["--cache-out has no effect with --method path", "any depth", "--method radiance-cache"],
        ),
        (vec!["records", SCENE, "--cache-in", "a.caches", "-o", "a.gif"], &["a.gif: the extension"]),
        (vec!["records", SCENE, "--cache-in", "a.png", "-o", "b.png"], &["a.png: is no file of radiance caches"]),
        (vec!["records", SCENE, "--height", "1", "-o", "b.png"], &["--section"]),
        (vec!["records", SCENE, "--section", "--height", "nan", "-o", "b.png"], &["--height"]),
        (vec!["records", SCENE, "--kind", "magic", "-o", "b.png"], &["magic"]),
        (vec!["records", SCENE, "--dot", "0", "-o", "b.png"], &["--dot"]),
    ];
    let refused = |arguments: &[&str], words: &[&str]| {
        let output = folder.run(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", said(&output));
        for word in words {
            assert!(said(&output).contains(word), "{arguments:?}: {}", said(&output));
        }
        assert!(!said(&output).contains("panicked"));
    };
    for (arguments, words) in cases {
        refused(arguments, words);
    }
    let swapped =
        |name: &'static str| with("a.caches", &[]).iter().map(|a| if *a == SCENE { name } else { a }).collect();
    let (other, moved): (Vec<&str>, Vec<&str>) = (swapped("other.xml"), swapped("moved.xml"));
    refused(&other, &["a.caches: was made for another scene"]);
    // Another camera is not another scene.
    let output = folder.run(&moved);
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    assert!(folder.bytes("a.caches") == whole);
    assert!(!Path::new(&folder.0.join("b.png")).exists());
}

#[test]
fn records_are_drawn_by_kind_and_in_section() {
    let folder = Folder::new("records");
    let size = ["--size", "32x24"];
    let rough = [&ROUGH[2..12], &["--error", "0.2"]].concat();
    let draw = |more: &[&str]| {
        let output = folder.run(&[&["records", SCENE, "-o", "r.png"], &size[..], &rough, more].concat());
        assert_eq!(output.status.code(), Some(0), "{more:?}: {}", said(&output));
        (Picture::read(&folder.0.join("r.png")).unwrap(), said(&output))
    };
    let (all, words) = draw(&["--cache-out", "a.caches"]);
    assert_eq!((all.width, all.height), (32, 24));
    assert!(["Single: ", "Surface: ", "Multiple: ", "Irradiance: "].iter().all(|kind| words.contains(kind)), "{words}");
    let (black, words) = draw(&["--cache-in", "a.caches", "--black", "--dot", "1", "--kind", "irradiance"]);
    let is_red = |p: &[f32; 3]| p[0] > 2.0 * p[1] && p[0] > 2.0 * p[2];
    let (dots, gaps) = black.pixels.iter().partition::<Vec<_>, _>(|&p| is_red(p));
    assert!(!dots.is_empty() && gaps.contains(&&[0.0; 3]));
    assert!(words.contains("Irradiance: ") && !words.contains("Surface: "), "{words}");
    let (section, words) = draw(&["--cache-in", "a.caches", "--section", "--kind", "single", "--kind", "surface"]);
    assert!(section.pixels.iter().any(|p| p[0] > 0.1) && !words.contains("Multiple"), "{words}");
}
