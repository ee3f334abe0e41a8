//! Renders that are interrupted: nothing good is lost, and what was left is gone on with to the same bits.

#![cfg(unix)]

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use super::{Folder, SCENE, said};

/// Options of each method, for a picture that takes a second or so.
const METHODS: [&[&str]; 6] = [
    &["--method", "path", "--spp", "256"],
    &["--method", "path", "--noise", "0.06"],
    &["--method", "radiance-cache", "--error", "0.1", "--spp", "128"],
    &["--method", "photon-beams", "--spp", "128"],
    &["--method", "vpl", "--spp", "128", "--lights", "64"],
    &["--method", "march", "--spp", "128"],
];

fn size(file: &Path) -> u64 {
    std::fs::metadata(file).map_or(0, |meta| meta.len())
}

/// Starts a render in `folder` and ends it by a signal once its checkpoint has been written `checkpoints` times, as far as can be seen.
/// Whether it was still running.
fn killed(folder: &Folder, options: &[&str], signal: &str, checkpoints: u32) -> bool {
    let mut child = folder
        .fogbow()
        .args([
            "render",
            SCENE,
            "--size",
            "24x24",
            "-q",
            "-o",
            "a.pfm",
            "--checkpoint",
            "kept",
            "--checkpoint-every",
            "0.02",
            "--resume",
        ])
        .args(options)
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let (kept, began) = (folder.0.join("kept"), Instant::now());
    let time = |file: &Path| std::fs::metadata(file).and_then(|meta| meta.modified()).ok();
    let mut before = time(&kept);
    let mut seen = 0;
    while seen < checkpoints && began.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(2));
        let now = time(&kept);
        if now != before {
            (before, seen) = (now, seen + 1);
        }
        if child.try_wait().unwrap().is_some() {
            return false;
        }
    }
    let sent = Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
    child.wait().unwrap();
    true
}

#[test]
fn a_render_killed_in_the_middle_is_gone_on_with_to_the_same_bits() {
    for options in METHODS {
        let whole = Folder::new("care-whole");
        let render = |folder: &Folder, more: &[&str]| {
            let all = [&["render", SCENE, "--size", "24x24", "-q", "-o", "a.pfm"], options, more].concat();
            let output = folder.run(&all);
            assert_eq!(output.status.code(), Some(0), "{}", said(&output));
            std::fs::read(folder.0.join("a.pfm")).unwrap()
        };
        let due = render(&whole, &[]);
        let folder = Folder::new("care-killed");
        // By the system, by hand, and by a batch system.
        let stops = ["-KILL", "-INT", "-TERM"].map(|signal| killed(&folder, options, signal, 2));
        assert!(stops[0], "{options:?}: was done before it could be killed");
        assert!(size(&folder.0.join("kept")) > 0);
        let resumed = render(&folder, &["--checkpoint", "kept", "--resume", "--threads", "1"]);
        assert_eq!(resumed, due, "{options:?}");
        // A finished one is there at once, and may be refined.
        assert_eq!(render(&folder, &["--checkpoint", "kept", "--resume"]), due, "{options:?}");
    }
}

#[test]
fn a_finished_checkpoint_takes_more_samples() {
    let folder = Folder::new("care-more");
    let render = |spp: &str, more: &[&str]| {
        let all = [&["render", SCENE, "--size", "24x24", "--method", "path", "-q", "-o", "a.pfm", "--spp", spp], more]
            .concat();
        let output = folder.run(&all);
        assert_eq!(output.status.code(), Some(0), "{}", said(&output));
        std::fs::read(folder.0.join("a.pfm")).unwrap()
    };
    let due = render("20", &[]);
    let few = render("4", &["--checkpoint", "kept"]);
    assert_ne!(few, due);
    assert_eq!(render("20", &["--checkpoint", "kept", "--resume"]), due);
}

#[test]
fn checkpoints_of_other_renders_and_damaged_ones_are_refused() {
    let folder = Folder::new("care-other");
    let render = |options: &[&str]| {
        let all =
            [&["render", SCENE, "--method", "path", "-q", "-o", "a.pfm", "--checkpoint", "kept", "--resume"], options]
                .concat();
        folder.run(&all)
    };
    let done = render(&["--size", "24x24", "--spp", "4"]);
    assert_eq!(done.status.code(), Some(0), "{}", said(&done));
    for other in [["--size", "32x16"], ["--seed", "1"], ["--max-depth", "2"]] {
        let size: &[&str] = if other[0] == "--size" { &[] } else { &["--size", "24x24"] };
        let refused = render(&[size, &other[..], &["--spp", "4"]].concat());
        assert_eq!(refused.status.code(), Some(2), "{other:?}");
        assert!(
            said(&refused).contains("kept: was left by a render of another scene, or with other options"),
            "{}",
            said(&refused)
        );
    }
    let file = folder.0.join("kept");
    let bytes = std::fs::read(&file).unwrap();
    for (damaged, word) in [
        (bytes[..bytes.len() - 9].to_vec(), "cut off"),
        (bytes.iter().enumerate().map(|(i, b)| if i == 999 { b ^ 1 } else { *b }).collect(), "damaged"),
        (b"PNG".to_vec(), "neither a checkpoint"),
    ] {
        std::fs::write(&file, &damaged).unwrap();
        let refused = render(&["--size", "24x24", "--spp", "4"]);
        assert_eq!(refused.status.code(), Some(2));
        assert!(said(&refused).contains(word), "{}", said(&refused));
        assert_eq!(std::fs::read(&file).unwrap(), damaged, "a refused file is left alone");
    }
}

/// In every phase of every method: the old picture is there whatever ends the program, and nothing else but what is announced.
#[test]
fn an_old_picture_survives_whatever_stops_the_next() {
    let old = Folder::new("care-old");
    let made = old.run(&["render", SCENE, "--size", "24x24", "--method", "path", "--spp", "4", "-q", "-o", "a.pfm"]);
    assert_eq!(made.status.code(), Some(0), "{}", said(&made));
    let old_bytes = std::fs::read(old.0.join("a.pfm")).unwrap();
    let long: [&[&str]; 5] = [
        &["--method", "path", "--spp", "100000000"],
        &["--method", "radiance-cache", "--error", "0.05", "--spp", "100000000"],
        &["--method", "photon-beams", "--spp", "100000000", "--beams", "100000"],
        &["--method", "vpl", "--spp", "100000000"],
        &["--method", "march", "--step", "covariance", "--spp", "100000000"],
    ];
    let signals = [("-TERM", 60), ("-HUP", 700), ("-INT", 400), ("-KILL", 500)];
    for (number, options) in long.into_iter().enumerate() {
        // Two each, so that every method and every signal has its turns.
        for (signal, after) in [signals[number % 4], signals[(number + 2) % 4]] {
            let mut child = old
                .fogbow()
                .args(["render", SCENE, "--size", "24x24", "-q", "-o", "a.pfm"])
                .args(options)
                .stderr(Stdio::null())
                .spawn()
                .unwrap();
            std::thread::sleep(Duration::from_millis(after));
            assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
            let ended = child.wait().unwrap();
            // Before the program listens, the signal ends it.
            assert!(matches!(ended.code(), Some(1) | None), "{options:?} {signal}: {ended:?}");
            assert_eq!(std::fs::read(old.0.join("a.pfm")).unwrap(), old_bytes, "{options:?} {signal}");
            // Beside it, what there is so far.
            let _ = std::fs::remove_file(old.0.join("a.stopped.pfm"));
            let names: Vec<String> = old.names().into_iter().filter(|name| !name.ends_with(".new")).collect();
            assert_eq!(names, ["a.pfm"], "{options:?} {signal}");
        }
    }
}

#[test]
fn a_picture_that_cannot_be_written_does_not_cost_the_others() {
    let folder = Folder::new("care-full");
    // Every write to this device fails: no room.
    if !Path::new("/dev/full").exists() {
        return;
    }
    std::os::unix::fs::symlink("/dev/full", folder.0.join("full.pfm")).unwrap();
    let options =
        ["render", SCENE, "--size", "16x16", "--method", "path", "--spp", "1", "-o", "full.pfm", "-o", "a.pfm"];
    let output = folder.run(&options);
    assert_eq!(output.status.code(), Some(2));
    assert!(said(&output).contains("full.pfm: No space left"), "{}", said(&output));
    assert!(said(&output).contains("wrote a.pfm") && folder.0.join("a.pfm").exists(), "{}", said(&output));
    // Where nothing can be written at all, it is not lost either.
    let output = folder.run(&options[..options.len() - 2]);
    let said = said(&output);
    let rescued = said.lines().find_map(|line| line.strip_prefix("wrote ")).unwrap_or_else(|| panic!("{said}"));
    assert!(size(Path::new(rescued)) > 0, "{said}");
    std::fs::remove_file(rescued).unwrap();
}

#[test]
fn a_preview_and_events_tell_how_far_it_is() {
    let folder = Folder::new("care-preview");
    let output = folder.run(&[
        "render",
        SCENE,
        "--size",
        "600x20",
        "--method",
        "path",
        "--spp",
        "64",
        "--json",
        "--preview",
        "small.png",
        "-o",
        "a.pfm",
    ]);
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let events: Vec<serde_json::Value> =
        String::from_utf8(output.stdout).unwrap().lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let last = events.last().unwrap();
    assert!(last["event"] == "end" && last["ended"] == "done", "{last}");
    assert!(events.iter().any(|event| event["event"] == "wrote" && event["file"] == "a.pfm"));
    let preview = image::open(folder.0.join("small.png")).unwrap();
    assert_eq!((preview.width(), preview.height()), (300, 10));
    let refused = folder.run(&["render", SCENE, "--preview", "small.jpg"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(said(&refused).contains("--preview: small.jpg must end in .png"), "{}", said(&refused));
}

#[test]
fn a_scene_alone_is_a_hint_and_idle_options_are_refused() {
    let folder = Folder::new("care-hints");
    let hint = folder.run(&["box.xml"]);
    assert_eq!(
        (hint.status.code(), said(&hint).as_str()),
        (Some(2), "fogbow: to render a scene: fogbow render box.xml\n")
    );
    for (options, word) in [
        (
            &["--method", "path", "--tolerance", "1"][..],
            "--tolerance has no effect with --method path; it belongs to --method radiance-cache",
        ),
        (
            &["--max-depth", "4", "--error", "0.1"],
            "--error has no effect with --method path (taken because caches hold light of paths of any depth",
        ),
        (&["--method", "vpl", "--alpha", "0.5"], "it belongs to --method photon-beams"),
        (
            &["--method", "march", "--grid-cells", "9"],
            "--grid-cells has no effect without something that uses covariances",
        ),
        (&["--image-share", "0.5"], "--image-share has no effect"),
    ] {
        let refused = folder.run(&[&["render", SCENE, "--size", "8x8", "-o", "a.pfm"], options].concat());
        assert_eq!(refused.status.code(), Some(2), "{options:?}");
        assert!(said(&refused).contains(word), "{options:?}: {}", said(&refused));
    }
    assert!(folder.names().is_empty());
    let help = folder.run(&["render", "--help", "vpl"]);
    assert!(help.status.success() && String::from_utf8_lossy(&help.stdout).contains("--light-points"));
    assert!(folder.run(&["man", "."]).status.success() && folder.names().contains(&"fogbow-render.1".to_owned()));
    let completions = folder.run(&["completions", "bash"]);
    assert!(completions.status.success() && String::from_utf8_lossy(&completions.stdout).contains("--light-points"));
}

/// `fogbow render … 2>&1 | head -1`: what is written has no reader any more.
#[test]
fn who_stops_reading_ends_no_render() {
    let folder = Folder::new("unread");
    let file = folder.0.join("a.pfm");
    for option in ["--json", "--lenient"] {
        let mut child = folder
            .fogbow()
            .args(["render", SCENE, "--size", "16x16", "--method", "path", "--spp", "4", "-o", "a.pfm", option])
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        drop((child.stdout.take(), child.stderr.take()));
        assert!(child.wait().unwrap().success() && size(&file) > 0, "{option}");
        std::fs::remove_file(&file).unwrap();
    }
}
