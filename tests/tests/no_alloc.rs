//! A program that links the core without the standard library and without an allocator runs, and
//! computes the same bits as the core with feature `alloc`.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Runs cargo on the program of `tests/no_alloc`, in a target directory of its own: the one in use
/// is locked by the cargo that runs this test.
fn cargo(arguments: &[&str]) -> Output {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| OsString::from("cargo"));
    Command::new(cargo)
        .args(arguments)
        .args(["--release", "--locked", "--offline", "--manifest-path"])
        .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("no_alloc/Cargo.toml"))
        .arg("--target-dir")
        .arg(target())
        .output()
        .expect("cargo starts")
}

fn target() -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join("no_alloc")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

// One test, because two cargos would wait for each other anyway.
#[test]
fn the_core_links_and_runs_without_an_allocator() {
    let with_alloc = cargo(&["build", "--features", "alloc"]);
    let complaint = text(&with_alloc.stderr);
    assert!(
        !with_alloc.status.success() && complaint.contains("no global memory allocator found"),
        "with feature `alloc` the program must not link, or the proof proves nothing:\n{complaint}"
    );

    let build = cargo(&["build"]);
    assert!(build.status.success(), "{}", text(&build.stderr));

    let program = target().join("release/fogbow-no-alloc");
    let run = Command::new(&program).output().expect("the program starts");
    assert!(run.status.success(), "{}: {}", program.display(), run.status);

    let mut expected = String::new();
    fogbow_kernel::report(&mut expected).expect("a string takes any text");
    assert!(expected.lines().count() > 5, "the kernel computes nothing:\n{expected}");
    assert_eq!(text(&run.stdout), expected, "without `alloc` (left) and with it (right)");
}
