//! A program that links the core without the standard library and without an allocator runs, and
//! computes the same bits as the core with feature `alloc`.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use fogbow::beams;
use fogbow::cache::RadianceCaches;
use fogbow::picture::Tiles;
use fogbow::sampling::Independent;
use fogbow::vpl;
use fogbow::work::Rounds;
use fogbow_kernel::lent::{self, Foggy};
use fogbow_kernel::{Digest, SECTIONS};
use fogbow_std::progress::Control;
use fogbow_std::threads::{Ending, Threads, run};

/// Runs cargo on the program of `tests/no_alloc`, in a target directory of its own: the one in use
/// is locked by the cargo that runs this test.
fn cargo(arguments: &[&str]) -> Output {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| OsString::from("cargo"));
    Command::new(cargo)
        .args(arguments)
        .args(["--locked", "--offline", "--manifest-path"])
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
    // The compiler looks for an allocator before it makes any code, so a check is enough.
    let with_alloc = cargo(&["check", "--features", "alloc"]);
    let complaint = text(&with_alloc.stderr);
    assert!(
        !with_alloc.status.success() && complaint.contains("no global memory allocator found"),
        "with feature `alloc` the program must not build, or the proof proves nothing:\n{complaint}"
    );

    let build = cargo(&["build", "--release"]);
    assert!(build.status.success(), "{}", text(&build.stderr));

    let program = target().join("release/fogbow-no-alloc");
    let run = Command::new(&program).output().expect("the program starts");
    assert!(run.status.success(), "{}: {}", program.display(), run.status);

    let mut expected = String::new();
    fogbow_kernel::report(&mut expected).expect("a string takes any text");
    assert!(expected.lines().count() > 5, "the kernel computes nothing:\n{expected}");
    assert_eq!(text(&run.stdout), expected, "without `alloc` (left) and with it (right)");
}

/// Does `work` on two threads, in memory that grows: as the program does it.
fn driven<W, R>(mut work: R, world: &W) -> R
where
    W: Sync + ?Sized,
    R: Rounds<W> + Sync,
    R::Output<'static>: Default + Send,
{
    let ran = run(&mut work, world, &Threads::new(2).unwrap(), &Control::default(), None, |_| {});
    assert_eq!(ran.ending, Ending::Done);
    work
}

/// The bits of a section of the kernel, which has lent memory and one thread.
fn of_kernel(name: &str) -> u64 {
    SECTIONS.iter().find(|section| section.name == name).expect("there is such a section").bits()
}

/// What `fold` leaves in the world of the kernel.
fn folded(fold: impl FnOnce(&mut Digest, &Foggy<'_>)) -> u64 {
    let mut digest = Digest::default();
    lent::with_world(|world| fold(&mut digest, world)).expect("the world can be made");
    // As sections do at their end.
    digest.int(1);
    digest.bits()
}

#[test]
fn hosts_give_the_bits_that_the_program_gives() {
    let cache = folded(|out, world| {
        let filling = RadianceCaches::new(lent::cache_settings()).fill(lent::ASKED);
        lent::read_caches(out, &driven(filling, world).finish(), world);
    });
    let beams = folded(|out, world| {
        let pass = beams::BeamPass::new(&lent::beam_settings(world), 0, |_, pass| pass);
        lent::gather_beams(out, &driven(pass, world).finish().unwrap(), world);
    });
    let vpl = folded(|out, world| {
        let mut witnesses = Vec::new();
        lent::each_witness(world, |witness| witnesses.push(witness));
        let pass = vpl::VplPass::new(&lent::light_settings(world), 0, Independent, &witnesses);
        lent::see_lights(out, driven(pass, world).finish().unwrap().as_slice(), world);
    });
    let picture = folded(|out, world| {
        let tiles = driven(Tiles::new(lent::PICTURE, Independent), &lent::pixel(world));
        let (sums, counts) = tiles.into_sums();
        lent::see_picture(out, &sums, &counts);
    });
    assert_eq!([cache, beams, vpl, picture], ["cache", "beams", "vpl", "picture"].map(of_kernel));
}
