#!/usr/bin/env python3
"""Pictures in parts: the same bits in any order by every method, and what parts cost.

    python3 tests/acceptance/parts.py [--program P] bits [--scene FILE] [--only REGEX]      about ten minutes
    python3 tests/acceptance/parts.py [--program P] cost [--scene FILE] [--size WxH] [--parts N] [--only REGEX]
    python3 tests/acceptance/parts.py [--program P] frames [--scene FILE]

bits: every method, as a whole and in 2, 5 and 16 parts, of samples and of tiles, merged forwards, backwards and shuffled: pictures and films are compared byte by byte.
frames: a walk of five frames by radiance caching, whose caches are handed on in groups of two, as `fogbow plan` has it: steps in the plan's order, and backwards as far as they
may, groups too, give the same pictures; and the last frame alone, with what it waits for, does. Says how much of the fills the groups have spared.
cost: CPU seconds (user and system, of the processes) of one run, and of a fill, all parts and the merge; holds if the sum is at most 5 % above the one run.
"""
import argparse, json, os, pathlib, random, re, resource, subprocess, sys, tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release/fogbow"
BITS = {
    "path": "--method path --spp 16",
    "path-layers": "--method path --spp 16 --aov",
    "radiance-cache": "--method radiance-cache --error 0.1 --spp 16 --paths 32",
    "photon-beams": "--method photon-beams --spp 36 --beams 2000",
    "photon-beams-covariance": "--method photon-beams --kernel covariance --spp 16 --beams 2000 --grid-paths 5000",
    "vpl": "--method vpl --spp 128 --lights 64 --pass-samples 8",
    "march": "--method march --spp 16",
    "march-covariance": "--method march --step covariance --spp 16 --grid-paths 5000",
}
COST = {
    "path": "--method path --spp 32",
    "radiance-cache": "--method radiance-cache --error 0.05 --spp 64",
    "photon-beams": "--method photon-beams --spp 128",
    "vpl": "--method vpl --spp 256 --pass-samples 16",
    "march": "--method march --spp 32",
}
failed = []


def run(program, *words):
    """CPU seconds, and the exit code."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    code = subprocess.run([str(program), *map(str, words)], stderr=subprocess.PIPE).returncode
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, code


def must(program, *words):
    seconds, code = run(program, *words)
    if code:
        sys.exit(f"exit code {code}: {' '.join(map(str, words))}")
    return seconds


def filled(program, scene, options):
    """Seconds of the fill, and the words by which parts take it; none where there is nothing to fill."""
    seconds, code = run(program, "fill", scene, *options, "-o", "fill.fogbow")
    return (seconds, ["--fill", "fill.fogbow"]) if code == 0 else (0.0, [])


def bits(program, scene, name, options):
    options = [*options.split(), "--size", "40x28", "-q"]
    must(program, "render", scene, *options, "-o", "whole.exr", "-o", "whole.fogbow")
    _, fill = filled(program, scene, options)
    same = 0
    for split in ("samples", "tiles"):
        for count in (2, 5, 16):
            files = [f"part-{k}.fogbow" for k in range(1, count + 1)]
            for k, file in enumerate(files, 1):
                must(program, "render", scene, *options, *fill, "--part", f"{k}/{count}", "--split", split, "-o", file)
            for order in (files, files[::-1], random.Random(count).sample(files, count)):
                must(program, "merge", "-q", *order, "-o", "merged.exr", "-o", "merged.fogbow")
                for kind in ("exr", "fogbow"):
                    is_same = pathlib.Path(f"merged.{kind}").read_bytes() == pathlib.Path(f"whole.{kind}").read_bytes()
                    same += is_same
                    if not is_same:
                        failed.append(f"{name}: {count} parts of {split}, .{kind}")
    print(f"{name}: {same} of 36 files are those of one run", flush=True)


def cost(program, scene, name, options, size, count):
    options = [*options.split(), "--size", size, "-q"]
    whole = must(program, "render", scene, *options, "-o", "whole.exr")
    fill_seconds, fill = filled(program, scene, options)
    files, parts = [f"part-{k}.fogbow" for k in range(1, count + 1)], []
    for k, file in enumerate(files, 1):
        parts.append(must(program, "render", scene, *options, *fill, "--part", f"{k}/{count}", "-o", file))
    merge = must(program, "merge", "-q", *files, "-o", "merged.exr")
    total = fill_seconds + sum(parts) + merge
    is_same = pathlib.Path("merged.exr").read_bytes() == pathlib.Path("whole.exr").read_bytes()
    over = total / whole - 1
    print(f"{name}: one run {whole:.1f} s; fill {fill_seconds:.1f} + {count} parts {sum(parts):.1f} (least {min(parts):.2f}, most {max(parts):.2f}) + merge {merge:.2f}"
          f" = {total:.1f} s: {100 * over:+.1f} %; part files {sum(os.path.getsize(f) for f in files) / 1e6:.0f} MB; same bits: {is_same}", flush=True)
    if over > 0.05 or not is_same:
        failed.append(f"{name}: {100 * over:+.1f} %")


def frames(program, scene):
    walk = (ROOT / "examples/scenes/atrium-walk.txt").read_text().splitlines()[:5]
    pathlib.Path("walk.txt").write_text("\n".join(walk))

    def planned(group):
        words = [program, "plan", scene, "--method", "radiance-cache", "--error", "0.2", "--spp", "2", "--size", "48x27", "--cameras", "walk.txt", "--group", group,
                 "--parts", "2", "--folder", ".", "-o", "frame.exr"]
        return json.loads(subprocess.run(list(map(str, words)), stdout=subprocess.PIPE, check=True).stdout)["steps"]

    def ran(steps):
        done, seconds = set(), 0.0
        while len(done) < len(steps):
            step = next(s for s in steps if s["id"] not in done and done.issuperset(s["after"]))
            spent = must(program, *step["run"])
            seconds += spent if step["kind"] == "fill" else 0.0
            done.add(step["id"])
        pictures = {file: pathlib.Path(file).read_bytes() for s in steps if s["kind"] == "merge" for file in s["writes"]}
        for file in pathlib.Path().iterdir():
            if file.name != "walk.txt":
                file.unlink()
        return pictures, seconds

    steps = planned(2)
    forwards, seconds = ran(steps)
    backwards, _ = ran(steps[::-1])
    wanted, needed = ["frame-0004-merge"], []
    while wanted:
        due = wanted.pop()
        step = next(s for s in steps if s["id"] == due)
        if step not in needed:
            needed.append(step)
            wanted += step["after"]
    alone, _ = ran(needed)
    _, single = ran(planned(1))
    print(f"CPU seconds of five fills: {single:.1f} alone, {seconds:.1f} in groups of two")
    if forwards != backwards or alone["frame-0004.exr"] != forwards["frame-0004.exr"] or len(set(forwards.values())) != 5:
        failed.append("frames depend on the order of steps")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["bits", "cost", "frames"])
    parser.add_argument("--program", default=str(PROGRAM))
    parser.add_argument("--scene")
    parser.add_argument("--size", default="640x360")
    parser.add_argument("--parts", type=int, default=16)
    parser.add_argument("--only", default="")
    arguments = parser.parse_args()
    program = pathlib.Path(arguments.program).resolve()
    scenes = ROOT / "examples/scenes"
    scene = pathlib.Path(arguments.scene or scenes / ("lantern.xml" if arguments.what == "bits" else "atrium.xml")).resolve()
    with tempfile.TemporaryDirectory(prefix="fogbow-parts-") as folder:
        os.chdir(folder)
        if arguments.what == "frames":
            frames(program, scene)
            os.chdir(ROOT)
            print("\n".join(failed) or "all hold")
            sys.exit(bool(failed))
        for name, options in (BITS if arguments.what == "bits" else COST).items():
            if re.search(arguments.only, name):
                if arguments.what == "bits":
                    bits(program, scene, name, options)
                else:
                    cost(program, scene, name, options, arguments.size, arguments.parts)
        os.chdir(ROOT)
    print("\n".join(failed) or "all hold")
    sys.exit(bool(failed))


if __name__ == "__main__":
    main()
