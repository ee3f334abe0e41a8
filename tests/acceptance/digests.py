#!/usr/bin/env python3
"""Tells whether two versions of the program write the same bits: every method on six scenes, some minutes, not part of CI.

    python3 tests/acceptance/digests.py [--program P] --record FILE.json  [--only REGEX] [--jobs N]
    python3 tests/acceptance/digests.py [--program P] --compare FILE.json [--only REGEX] [--jobs N] [--skip-files]
    python3 tests/acceptance/digests.py --list [--only REGEX]

Needs Python and the program (target/release/fogbow unless told) alone. Every case is run with 1 and with 2 threads, which must
write the same bytes. Names are SCENE/CASE.KIND; recorded are SHA-256 of

.pfm .exr      the picture; the picture with all components of light, and where a covariance grid is used its ellipsoids
.cache .grid   radiance caches and covariance grids as written; later cases of the scene read them, with another camera
.csv .png      what `probe` and `records` write

A program of another processor or of another version of its libraries may rightly write other bits: record and compare on one machine.
REGEX is searched for in SCENE/CASE. --skip-files leaves .cache and .grid out, for versions with other file formats; pictures
made from what is read are still compared.
Runs that fail are told and left out of a record. Names that are not in FILE are listed and pass: record it again with the
old program to hold them. Exit status 1 when a recorded digest differs or is missing, a run of --record fails, threads
disagree, or nothing was compared.
"""
import argparse, concurrent.futures, hashlib, json, os, pathlib, re, subprocess, sys, tempfile, time

ROOT = pathlib.Path(__file__).resolve().parents[2]
SCENES = ROOT / "examples/scenes"
PROGRAM = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release/fogbow"
THREADS = (1, 2)

# Sizes are no multiples of a tile's 8 pixels, so that its part beyond the picture counts, too.
# scene: why, size, its size for caches, their options, another camera
HOMES = {
    "thin-wall": ("thin homogeneous fog, isotropic; a box seen from outside", "36x28", "20x15", "--paths 32", "0.2,0,0.8 0,0,-0.5"),
    "smoke": ("a grid alone, dense, isotropic; nothing behind it, camera outside", "36x28", "28x21", "--paths 64", "0.5,0.3,0.7 0,0,-0.2"),
    "smoke-box-heterogeneous-anisotropic": ("a grid, g = 0.6; mirrors", "28x22", "14x11", "--paths 32", "0.2,0,0.8 0,0,-0.5"),
    "caustic": ("homogeneous, g = 0.3; glass with nothing inside, a spot", "36x28", "18x14", "--paths 32", "0.2,0,0.8 0,0,-0.5"),
    "atrium-smoke": ("a grid in a part of the scene; a sky from an image, a sun; meshes", "28x22", "14x11", "--paths 32", "-7.4,1.8,0.7 1,4,-0.7"),
    "foggy-road": ("60 lights, phong, camera in a grid, g = 0.6", "26x20", "10x7", "--paths 16 --tolerance 2", "0.4,2.4,-6 0.2,1.6,-25"),
}

# Options of each method; speed.py takes them, too.
METHODS = {
    "path": "--method path",
    "path-noise": "--method path --noise 0.1",
    "radiance-cache": "--method radiance-cache",
    "photon-beams": "--method photon-beams",
    "photon-beams-covariance": "--method photon-beams --kernel covariance",
    "vpl": "--method vpl",
    "march": "--method march",
    "march-covariance": "--method march --step covariance",
    "march-frequency": "--method march --step frequency",
    "image-sampling": "--method path --image-sampling covariance",
}

# More ways through the methods, each where it is cheap, and what the six scenes have not: a negative g, light from everywhere.
# {grid} is the grid that the scene's march-covariance writes.
MORE = {
    "smoke": {
        # As few options as may be: what the program chooses by itself.
        "default-radiance-cache": "--method radiance-cache --size 12x9",
        "default-photon-beams": "--method photon-beams --size 20x15",
        "default-vpl": "--method vpl --size 12x9",
        "default-march-covariance": "--method march --step covariance --spp 1 --size 12x9",
        "radiance-cache-noise": "--method radiance-cache --paths 32 --noise 0.1 --size 20x15",
        "radiance-cache-cached": "--method radiance-cache --single cached --paths 32 --spp 2 --size 20x15",
        "march-noise": "--method march --noise 0.1 --spp 32",
        "march-image-sampling": "--method march --image-sampling covariance --spp 2 --grid-paths 5000 --grid-cells 24 --image-share 0.2",
        "image-sampling-noise": "--method path --image-sampling covariance --noise 0.2 --spp 32 --grid-paths 5000",
    },
    "thin-wall": {
        "path-seed": "--method path --spp 2 --seed 7",
        "path-depth": "--method path --spp 2 --max-depth 3",
        "radiance-cache-uncached": "--method radiance-cache --uncached multiple --uncached irradiance --paths 32 --spp 1 --size 14x11",
        "radiance-cache-image-sampling": "--method radiance-cache --image-sampling covariance --paths 16 --spp 1 --size 10x7 --grid-paths 3000",
        "photon-beams-radius": "--method photon-beams --spp 24 --radius 0.05 --alpha 0.8 --beams 300",
        "photon-beams-bias": "--method photon-beams --kernel covariance --spp 16 --bias 0.1 --radius-most 0.2 --grid-paths 5000",
        "march-steps": "--method march --step covariance --spp 1 --step-length 0.3 --step-count 8 --step-least 0.02 --grid-paths 3000",
        "march-length": "--method march --spp 2 --step-length 0.3",
    },
    "smoke-box-heterogeneous-anisotropic": {
        "default-radiance-cache": "--method radiance-cache --spp 2 --paths 64 --size 8x6",
        **{f"radiance-cache-{way}": f"--method radiance-cache --extrapolation {way} --paths 16 --spp 2 --size 9x7"
           for way in ("exponential", "linear", "constant")},
        "radiance-cache-degree": "--method radiance-cache --degree 3 --tolerance-of multiple=0.6 --uncached surface --paths 16 --spp 2 --size 9x7",
        "vpl-exact": "--method vpl --spp 4 --pass-samples 4 --lights 60 --clamp off --compensation none --candidates 1 --light-points 2",
        **{f"vpl-{way}": f"--method vpl --spp 4 --pass-samples 4 --lights 60 --compensation {way}" for way in ("full", "n-to-1", "1-to-1")},
        "vpl-clamp": "--method vpl --spp 4 --pass-samples 4 --lights 60 --clamp 2 --steps 1 --local-visibility off --share 1",
    },
    "caustic": {
        "photon-beams-covariance-in": "--method photon-beams --kernel covariance --spp 8 --grid-in {grid} --camera '{camera}'",
    },
    "statue-backward": {
        "path": "--method path --spp 2",
        "radiance-cache": "--method radiance-cache --paths 16 --spp 1 --size 10x7",
        "vpl": "--method vpl --spp 4 --pass-samples 4 --lights 60",
    },
    "nave": {
        "path": "--method path --spp 2",
        "photon-beams": "--method photon-beams --spp 16",
        "march-covariance": "--method march --step covariance --spp 1 --grid-paths 3000 --grid-cells 40",
        "vpl": "--method vpl --spp 4 --pass-samples 4 --lights 60",
    },
}


def path_of(scene):
    return SCENES / f"{scene}.xml"


def run_of(scene, case, size, options, **written):
    """-> name, command, options, files written"""
    size = "" if "--size" in options else f" --size {size}"
    return f"{scene}/{case}", "render", f"{options}{size} --aov", {"pfm": "-o", "exr": "-o", **written}


def groups():
    """-> scene, list of runs; later ones may read files of earlier ones of their list"""
    for scene, (_, size, cache_size, cache, _) in HOMES.items():
        def run(case, method, options, size=size, *, scene=scene, **written):
            return run_of(scene, case, size, f"{METHODS[method]} {options}", **written)

        yield scene, [run("path", "path", "--spp 4")]
        yield scene, [run("path-noise", "path-noise", "--spp 48")]
        yield scene, [
            run("radiance-cache", "radiance-cache", f"--spp 2 {cache}", cache_size, cache="--cache-out"),
            run("radiance-cache-in", "radiance-cache", f"--spp 2 {cache} --cache-in {{cache}} --camera '{{camera}}'", cache_size, cache="--cache-out"),
        ]
        # Three passes: the radius narrows twice.
        yield scene, [run("photon-beams", "photon-beams", "--spp 24")]
        yield scene, [run("photon-beams-covariance", "photon-beams-covariance", "--spp 16")]
        yield scene, [run("vpl", "vpl", "--spp 16 --pass-samples 8 --lights 80")]
        yield scene, [run("march", "march", "--spp 2")]
        grid = "--grid-paths 8000 --grid-cells 40"
        more = MORE.get(scene, {})
        yield scene, [
            run("march-covariance", "march-covariance", f"--spp 2 {grid}", grid="--grid-out"),
            run("march-frequency-in", "march-frequency", "--spp 2 --grid-in {grid} --camera '{camera}'"),
            run("image-sampling-in", "image-sampling", "--spp 4 --grid-in {grid} --camera '{camera}'"),
            *(run_of(scene, case, size, options) for case, options in more.items() if "{grid}" in options),
        ]
        yield scene, [run("march-frequency", "march-frequency", f"--spp 2 {grid}")]
        yield scene, [run("image-sampling", "image-sampling", f"--spp 4 {grid} --seed 3", grid="--grid-out")]
        for case, options in more.items():
            if "{grid}" not in options:
                yield scene, [run_of(scene, case, size, options)]
    for scene in sorted(MORE.keys() - HOMES.keys()):
        for case, options in MORE[scene].items():
            yield scene, [run_of(scene, case, "28x22", options)]
    records = "--paths 32 --spp 1 --size 20x15"
    yield "smoke", [("smoke/records", "records", records, {"png": "-o"})]
    yield "smoke", [("smoke/records-section", "records", f"{records} --section --kind multiple", {"png": "-o"})]
    yield "thin-wall", [("thin-wall/probe-hessian", "probe hessian", "--grid 5x5x5 --grid-paths 5000 --grid-cells 32", {"csv": "-o"})]


def words(text):
    """The words of a line of options; a word in quotes may hold spaces."""
    return [quoted or word for quoted, word in re.findall(r"'([^']*)'|(\S+)", text)]


def digests(program, scene, group, is_wanted):
    """-> digests by name; the failed cases with what they said; names that depend on the number of threads"""
    found, failed, apart = {}, {}, set()
    with tempfile.TemporaryDirectory(prefix="fogbow-digests-") as folder:
        for threads in THREADS:
            known = {"camera": HOMES[scene][-1]} if scene in HOMES else {}
            for name, command, options, written in group:
                try:
                    arguments = [word.format(**known) for word in words(options)]
                except KeyError as absent:
                    failed[name] = f"no {absent.args[0]} to read"
                    continue
                outputs = {kind: os.path.join(folder, f"{name.replace('/', '-')}-{threads}.{kind}") for kind in written}
                for kind, option in written.items():
                    arguments += [option, outputs[kind]]
                run = subprocess.run([program, *command.split(), path_of(scene), *arguments, "--threads", str(threads), "--quiet"],
                                     stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
                absent = [kind for kind, file in outputs.items() if not os.path.exists(file)]
                if run.returncode or absent:
                    said = run.stderr.strip().splitlines() or [f"status {run.returncode}, no {', '.join(absent)}"]
                    failed[name] = said[0].replace(f"{folder}/", "")
                    continue
                known.update(outputs)
                for kind, file in outputs.items():
                    digest = hashlib.sha256(pathlib.Path(file).read_bytes()).hexdigest()
                    if found.setdefault(f"{name}.{kind}", digest) != digest:
                        apart.add(f"{name}.{kind}")
    found = {name: digest for name, digest in found.items() if is_wanted(case_of(name)) and case_of(name) not in failed}
    return found, {name: said for name, said in failed.items() if is_wanted(name)}, {name for name in apart if is_wanted(case_of(name))}


def case_of(name):
    return name.rpartition(".")[0]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", type=pathlib.Path, default=PROGRAM)
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--record", type=pathlib.Path, metavar="FILE")
    what.add_argument("--compare", type=pathlib.Path, metavar="FILE")
    what.add_argument("--list", action="store_true", help="names and options of the cases")
    parser.add_argument("--only", type=re.compile, metavar="REGEX", default=re.compile(""), help="of SCENE/CASE")
    parser.add_argument("--skip-files", action="store_true", help="do not compare .cache and .grid")
    parser.add_argument("--jobs", type=int, default=1, help="programs at a time")
    options = parser.parse_args()

    def is_wanted(name):
        return options.only.search(name) is not None

    wanted = [(scene, group) for scene, group in groups() if any(is_wanted(name) for name, *_ in group)]
    if options.list:
        for name, command, arguments, _ in (run for _, group in wanted for run in group if is_wanted(run[0])):
            print(f"{name}: {command} {arguments}")
        return 0
    program = options.program.resolve()
    if not program.is_file():
        parser.error(f"no program {program}")
    found, failed, apart = {}, {}, set()
    before, start = os.times(), time.monotonic()
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        for result in pool.map(lambda work: digests(program, *work, is_wanted), wanted):
            for all_of_it, some in zip((found, failed, apart), result):
                all_of_it.update(some)
    after = os.times()
    seconds = after.children_user + after.children_system - before.children_user - before.children_system
    print(f"{len(found)} digests, {time.monotonic() - start:.0f} s, {seconds:.0f} CPU s")
    for name, said in sorted(failed.items()):
        print(f"fails: {name}: {said}")
    for name in sorted(apart):
        print(f"depends on the number of threads: {name}")
    if options.record:
        options.record.write_text(json.dumps({name: found[name] for name in found.keys() - apart}, indent=0, sort_keys=True) + "\n")
        return 1 if failed or apart or not found else 0

    def is_held(name):
        return is_wanted(case_of(name)) and not (options.skip_files and name.endswith((".cache", ".grid")))

    recorded = {name: digest for name, digest in json.loads(options.compare.read_text()).items() if is_held(name)}
    found = {name: digest for name, digest in found.items() if is_held(name)}
    both = recorded.keys() & found.keys()
    differences = {name for name in both if recorded[name] != found[name]}
    missing = recorded.keys() - found.keys()
    for label, names in (("not recorded", found.keys() - both), ("missing", missing), ("differs", differences)):
        for name in sorted(names):
            print(f"{label}: {name}")
    print(f"{len(both) - len(differences)} the same, {len(differences)} different, {len(missing)} missing")
    return 1 if differences or missing or any(map(is_held, apart)) or not both else 0


if __name__ == "__main__":
    sys.exit(main())
