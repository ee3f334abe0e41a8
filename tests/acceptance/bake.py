#!/usr/bin/env python3
"""Baked light against what must hold of it: python3 tests/acceptance/bake.py [leaks | truth | pictures | speed | refine | flicker | kill | schema] …

    leaks       behind the thin wall: what look-ups find, with planes of surfaces and as hardware mixes, of the light before it
    truth       probes against path tracing of the same probes with many more samples: four boxes and the atrium
    pictures    the atrium and a smoke box marched from 32³, 64³, 128³ probes against path tracing; a plot
    speed       32³ probes of degree 2 in the atrium: processor seconds, beside path tracing the same probes
    refine      bricks of half the spacing against a grid that has all: the same probes, what is left between probes, processor seconds
    flicker     frames of a plume: how much probes flicker beside what light does, with a seed each, with one, and each after the one before; processor seconds
    kill        killed with -9 at any time and gone on with: the same bytes
    schema      descriptions against examples/shaders/bake.schema.json (needs Python's jsonschema)

Needs a built program (cargo build --release --bin fogbow, or FOGBOW=path) and numpy; pictures also matplotlib.
"""

import json
import os
import pathlib
import re
import resource
import signal
import subprocess
import sys
import tempfile
import time

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
SCENES = ROOT / "examples/scenes"
FOGBOW = os.environ.get("FOGBOW", str(ROOT / "target/release/fogbow"))


def run(*arguments, check=True):
    """Runs the program; what it says, and its processor seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([FOGBOW, *map(str, arguments)], capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if check and done.returncode != 0:
        sys.exit(f"{arguments}: {done.stderr}")
    return done.stderr, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


class Probes:
    """A bake, as its JSON file and the numbers beside it tell it."""

    def __init__(self, file):
        file = pathlib.Path(file)
        self.about = json.loads(file.read_text())
        data = (file.parent / self.about["data"]).read_bytes()
        nx, ny, nz = self.counts = self.about["counts"]
        self.arrays = {}
        for a in self.about["arrays"]:
            kind = {"f32": "<f4", "u8": "u1"}[a["type"]]
            numbers = np.frombuffer(data, kind, a["bytes"] // np.dtype(kind).itemsize, a["offset"])
            self.arrays[a["name"]] = numbers.reshape(nz, ny, nx, a["components"])
        self.low = np.array(self.about["box"]["min"])
        self.size = np.array(self.about["box"]["max"]) - self.low
        self.valid = self.arrays["state"][..., 0] == 1

    def numbers(self):
        """All numbers of all probes: z, y, x, number, colour."""
        names = [n for n in self.arrays if re.fullmatch(r"sh\d+|[+-][xyz]|fluence", n)]
        return np.stack([self.arrays[n] for n in names], axis=-2)

    def errors(self):
        names = [n for n in self.arrays if n.startswith("error of ")]
        return np.stack([self.arrays[n][..., 0] for n in names], axis=-1)

    def mean(self, points, by_planes):
        """The first number at points: by look-ups as in fog.wgsl, or mixed from all eight probes as hardware does."""
        counts = np.array(self.counts)
        at = np.clip((points - self.low) / self.size * counts - 0.5, 0, counts - 1)
        low = np.minimum(np.floor(at), np.maximum(counts - 2, 0)).astype(int)
        share = at - low
        first = self.numbers()[..., 0, :]
        light, total = np.zeros((len(points), 3)), np.zeros((len(points), 1))
        for corner in range(8):
            high = np.array([corner & 1, corner >> 1 & 1, corner >> 2 & 1])
            x, y, z = np.minimum(low + high, counts - 1).T
            weight = np.prod(np.where(high, share, 1 - share), axis=1, keepdims=True)
            if by_planes:
                offset = share - high
                s = np.maximum(*[(offset * self.arrays[f"wall{i}"][z, y, x]).sum(1, keepdims=True) for i in (0, 1)])
                weight = weight * self.valid[z, y, x][:, None] * (np.clip((1 - s) * 10, 0, 1) + 1e-6 / np.maximum(s, 1) ** 8)
            light += weight * first[z, y, x]
            total += weight
        return light / total


def leaks(folder):
    """The wall is 8 mm thick at x = 0 below y = 0.6; the lamp is on its right."""
    held = True
    for side in (16, 32):
        run("bake", SCENES / "thin-wall.xml", "--counts", f"{side}x{side}x{side}", "--error", 0.02, "-o", folder / "wall.json")
        probes = Probes(folder / "wall.json")
        # Deep below the gap, where next to no light comes over the wall.
        y, z = (a.ravel() for a in np.meshgrid(np.linspace(-0.9, 0, 19), np.linspace(-0.9, 0.9, 19)))
        at = lambda x: np.stack([np.full_like(y, x), y, z], axis=1)
        before = probes.mean(at(0.02), True).mean()
        # What is truly there: of the probes' own light, before they are mixed.
        first = probes.numbers()[..., 0, :].mean(-1)
        behind_probes = first[:, : side // 2, side // 2 - 1].mean()
        for name, by_planes in (("by planes of surfaces", True), ("as hardware mixes, dilated", False)):
            found = {x: probes.mean(at(-x), by_planes).mean() for x in (0.005, 0.02, 0.05)}
            told = ", ".join(f"{1000 * x:.0f} mm behind {100 * v / before:.2f} %" for x, v in found.items())
            print(f"thin-wall {side}³ {name}: of the light before the wall {told}; probes behind it hold {100 * behind_probes / before:.2f} %")
            if by_planes:
                held &= all(v - behind_probes < 0.01 * before for v in found.values())
    return held


def slab(scene, counts, folder):
    """The bounds of the grid that a bake of a scene takes, and of its cells in a slab across it: all of x, the middle four of y, four of z beside the middle."""
    run("bake", scene, "--counts", "1x1x1", "--passes", 2, "--basis", "sh0", "-o", folder / "one.json")
    box = json.loads((folder / "one.json").read_text())["box"]
    low, high = np.array(box["min"]), np.array(box["max"])
    first, count = np.array([0, counts // 2 - 2, counts // 4]), np.array([counts, 4, 4])
    cell = (high - low) / counts
    corner = lambda v: ",".join(f"{c:.7f}" for c in v)
    part = f"{corner(low + first * cell)} {corner(low + (first + count) * cell)}"
    return part, tuple(slice(f, f + c) for f, c in zip(first[::-1], count[::-1]))


def apart(probes, where, due, name):
    """How far numbers are off, in per cent of the mean: root mean squares of all and of degree 0, without what their standard errors explain, and how many are within three."""
    valid = probes.valid[where] & due.valid
    off = (probes.numbers()[where] - due.numbers())[valid]
    squares = (off**2).mean(-1)
    variances = (probes.errors()[where] ** 2 + due.errors() ** 2)[valid]
    level = due.numbers()[due.valid][:, 0].mean()
    share = lambda squares: 100 * np.sqrt(max(squares.mean(), 0)) / level
    # A probe in light that is far brighter than the mean, or at the edge of a shadow, is off by more than all the rest: the median tells of the usual one.
    each = [share(squares[:, k] - variances[:, k]) for k in range(squares.shape[1])]
    within = 100 * (squares <= 9 * variances + (1e-4 * level) ** 2).mean()
    usual = 100 * np.median(np.sqrt(squares)) / level
    print(
        f"{name}: {valid.sum()} probes, numbers off by {share(squares):.2f} % (noise {share(variances):.2f} %), beyond noise at most {max(each):.2f} % in one coefficient, "
        f"median {usual:.2f} %; {within:.1f} % within three standard errors; mean {100 * off[:, 0].mean() / level:+.2f} %",
        flush=True,
    )
    return max(each) < 2, within


def truth(folder):
    """Probes of a slab through each scene, of 32³, against the same probes path traced to a third of the error."""
    held = True
    public = pathlib.Path(os.environ.get("FOGBOW_REFERENCE", "/nowhere")) / "public"
    boxes = [public / f"cornell-{name}.xml" for name in ("homog-iso", "homog-hg06", "hetero-iso", "hetero-hg06")]
    for scene in [*[box for box in boxes if box.exists()], SCENES / "atrium.xml"]:
        part, where = slab(scene, 32, folder)
        run("bake", scene, "--box", part, "--counts", "32x4x4", "--error", 0.007, "--passes", 100000, "--seed", 7, "-o", folder / "due.json")
        due = Probes(folder / "due.json")
        _, seconds = run("bake", scene, "--box", part, "--counts", "32x4x4", "--error", 0.02, "-o", folder / "paths.json")
        near, within = apart(Probes(folder / "paths.json"), np.s_[:, :, :], due, f"{scene.stem} by paths ({seconds:.1f} s)")
        held &= near and within >= 97
        # To a third of the error, too: what photons have wrong would not show through noise of 2 %.
        _, seconds = run("bake", scene, "--counts", "32x32x32", "--error", 0.007, "--passes", 100000, "--method", "photons", "-o", folder / "photons.json")
        near, _ = apart(Probes(folder / "photons.json"), where, due, f"{scene.stem} by photons, all 32³ ({seconds:.1f} s)")
        held &= near
    return held


def speed(folder):
    """Processor seconds to 2 % in the atrium; of paths those of 16³, eight times, since each probe has paths of its own."""
    scene, seconds = SCENES / "atrium.xml", {}
    for method, side, times in (("photons", 16, 1), ("photons", 32, 1), ("photons", 64, 1), ("path", 16, 8)):
        _, took = run("bake", scene, "--counts", f"{side}x{side}x{side}", "--error", 0.02, "--method", method, "--threads", 1, "-o", folder / "speed.json")
        error = Probes(folder / "speed.json").about["relative_error"]
        # At equal error: what is sampled goes as its inverse square.
        seconds[method, side] = took * (error / 0.02) ** 2 * times
        print(f"atrium {side}³ by {method}: {took:.1f} s, error {100 * error:.2f} %", flush=True)
    ratio = seconds["path", 16] / seconds["photons", 32]
    print(f"32³ at 2 %: photons {seconds['photons', 32]:.1f} s, paths {seconds['path', 16]:.0f} s: {ratio:.0f} times")
    return ratio >= 50


def refine(folder):
    """A smoke box by paths: 16³ with bricks of half the spacing, and 32³. Probes of bricks must be those of 32³ with the mean of 16³; times are of bakes that know no mean beforehand."""
    scene = SCENES / "smoke-box-homogeneous-anisotropic.xml"
    asked = [scene, "--basis", "sh0", "--error", 0.1, "--threads", 1]
    _, coarse = run("bake", *asked, "--counts", "16x16x16", "-o", folder / "even.bake", "-o", folder / "even.json")
    _, seconds = run("bake", *asked, "--counts", "16x16x16", "--refine", 0.2, "--levels", 1, "-o", folder / "bricks.json")
    _, due = run("bake", *asked, "--counts", "32x32x32", "-o", folder / "all.json")
    run("bake", *asked, "--counts", "32x32x32", "--level", folder / "even.bake", "-o", folder / "same.json")
    about = json.loads((folder / "bricks.json").read_text())
    data = (folder / about["data"]).read_bytes()
    array = next(a for a in about["arrays"] if a["name"] == "level 1: sh0")
    found = np.frombuffer(data, "<f4", array["bytes"] // 4, array["offset"]).reshape(-1, 4, 4, 4, 3)
    level = about["levels"][0]
    same = Probes(folder / "same.json").arrays["sh0"]
    nx, ny, _ = (n // 4 for n in level["counts"])
    equal = 0
    for brick, place in zip(found, level["bricks"]):
        x, y, z = (4 * n for n in (place % nx, place // nx % ny, place // (nx * ny)))
        equal += (brick == same[z : z + 4, y : y + 4, x : x + 4]).all((-1)).sum()
    # Probes in walls have the light of neighbours, of which bricks do not have all.
    share = equal / (64 * len(level["bricks"]))
    left = {name: 100 * json.loads((folder / f"{name}.json").read_text())["relative_coarseness"]["root_mean_square"] for name in ("even", "bricks", "all")}
    print(
        f"smoke box: {len(level['bricks'])} bricks, {6400 * len(level['bricks']) / 32**3:.0f} % of 32³; {100 * share:.1f} % of their probes have its bits; "
        f"between probes {left['even']:.1f} % at 16³, {left['bricks']:.1f} % with bricks, {left['all']:.1f} % at 32³; {seconds:.1f} s ({coarse:.1f} s without bricks), {due:.1f} s for 32³"
    )
    return share > 0.9 and seconds < due and left["bricks"] < 1.2 * left["all"]


def flicker(folder):
    """Frames of a plume, 1/12 s apart: how much probes flicker beside what light does, as far better bakes have it; a seed each, one seed, and each frame after the one before.

    Flicker is the standard deviation over time of what a probe is off by: what it is off by in all frames alike is not seen. Still is where light itself changes by less than half of the error asked for."""
    count, error, held = 6, 0.03, True
    run("plume", "--frames", count, "--resolution", 32, "-o", folder / "plume", "-q")
    frames = [folder / f"plume/plume-{i:02}.xml" for i in range(count)]
    asked = ["--counts", "16x16x16", "--threads", 1, "-q"]

    def light(file):
        probes = Probes(file)
        return probes.numbers()[..., 0, :].mean(-1)[probes.valid]

    due = []
    for i, frame in enumerate(frames):
        run("bake", frame, *asked, "--method", "photons", "--error", 0.005, "--seed", 1000 + i, "-o", folder / "due.json")
        due.append(light(folder / "due.json"))
    due = np.array(due)
    level, moved = due.mean(), due.std(0)
    still = moved < 0.5 * error * level
    share = lambda squares: 100 * np.sqrt(squares.mean()) / level
    print(f"plume: {100 * still.mean():.0f} % of the probes are still; light of the others has a deviation of {share(moved[~still]**2):.1f} % of the mean over {count} frames")
    for method in ("path", "photons"):
        found = {}
        for name, seeds in (("a seed each", range(count)), ("one seed", [0] * count)):
            all, seconds = [], 0
            for frame, seed in zip(frames, seeds):
                seconds += run("bake", frame, *asked, "--method", method, "--error", error, "--seed", seed, "-o", folder / "frame.json")[1]
                all.append(light(folder / "frame.json"))
            found[name] = np.array(all), seconds, ""
        told, seconds = run("bake", *frames, *asked[:-1], "--method", method, "--error", error, "-o", folder / "kept.json")
        kept = [int(n) for n in re.findall(r"(\d+) of \d+ bricks of 64 probes are those", told)]
        all = np.array([light(folder / f"kept-{frame.stem}.json") for frame in frames])
        found["after the frame before"] = all, seconds, f", kept {kept} of 64 bricks"
        flickers = {}
        for name, (all, seconds, more) in found.items():
            extra = (all - due).std(0)
            of_still, of_moving = flickers[name] = share(extra[still] ** 2), share(extra[~still] ** 2)
            print(f"{method}, {name}: still probes flicker by {of_still:.2f} %, moving ones by {of_moving:.2f} %; off by {share((all - due) ** 2):.2f} %; {seconds:.1f} s{more}", flush=True)
        held &= flickers["after the frame before"][0] < flickers["a seed each"][0]
    return held


def kill(folder):
    """Ended without a word at ten times, and gone on with; by paths and by photons."""
    held = True
    for method, passes in (("path", 40), ("photons", 24)):
        asked = [FOGBOW, "bake", SCENES / "smoke-box-homogeneous-isotropic.xml", "--counts", "12x12x12", "--error", 0.001, "--passes", passes, "--method", method, "-q"]
        asked = [*map(str, asked)]
        subprocess.run([*asked, "-o", folder / "whole.bake"], check=True)
        file = folder / f"killed-{method}.bake"
        again = [*asked, "--resume", "--checkpoint-every", "0.05", "-o", file]
        kills = 0
        for i in range(10):
            child = subprocess.Popen(again)
            time.sleep(0.3 + 0.17 * i)
            kills += child.poll() is None
            child.send_signal(signal.SIGKILL)
            child.wait()
        subprocess.run([*again, "--threads", "1"], check=True)
        same = file.read_bytes() == (folder / "whole.bake").read_bytes()
        print(f"{method}: killed {kills} times, then gone on with by one thread: {'the same bytes' if same else 'OTHER bytes'}")
        held &= same and kills > 0
    return held


def schema(folder):
    import jsonschema

    due = json.loads((ROOT / "examples/shaders/bake.schema.json").read_text())
    jsonschema.Draft202012Validator.check_schema(due)
    scene = SCENES / "smoke-box-homogeneous-isotropic.xml"
    for options in ([], ["--basis", "ambient-cube", "--quantity", "irradiance"], ["--basis", "fluence", "--method", "photons"], ["--method", "radiance-cache", "--error", "0.2"]):
        outputs = [word for kind in ("json", "ktx2", "exr") for word in ("-o", folder / f"a.{kind}")]
        run("bake", scene, "--counts", "4x4x4", "--passes", 2, *options, *outputs)
        for name in ("a.json", "a.ktx2.json", "a.exr.json"):
            jsonschema.validate(json.loads((folder / name).read_text()), due)
    print("12 descriptions are what the schema says")
    return True


def pictures(folder):
    """The medium's light marched from probes against path tracing, blocks of 8 × 8 pixels; a plot of error over resolution."""
    held, curves = True, {}
    for scene in (SCENES / "atrium.xml", SCENES / "smoke-box-heterogeneous-isotropic.xml"):
        size = ["--size", "64x64", "--aov"]
        for seed in (1, 2):
            run("render", scene, *size, "--method", "path", "--spp", 1024, "--seed", seed, "-o", folder / f"due{seed}.exr")
        due = [medium(folder / f"due{seed}.exr") for seed in (1, 2)]
        noise = np.sqrt(((due[0] - due[1]) ** 2).mean()) / 2
        due = (due[0] + due[1]) / 2
        for side in (16, 32, 64, 128):
            counts = f"{side}x{side}x{side}"
            asked = ["bake", scene, "--counts", counts, "--orders", "indirect", "--method", "photons", "--error", 0.05 if side > 64 else 0.02]
            text, seconds = run(*asked, "-o", folder / "probes.bake", "-o", folder / "probes.json")
            coarse = json.loads((folder / "probes.json").read_text())["relative_coarseness"]["root_mean_square"]
            run("render", scene, *size, "--method", "march", "--bake", folder / "probes.bake", "--spp", 256, "-o", folder / "marched.exr")
            off = medium(folder / "marched.exr") - due
            error = np.sqrt(max((off**2).mean() - noise**2, 0)) / due.mean()
            curves.setdefault(scene.stem, []).append((side, 100 * error))
            print(
                f"{scene.stem} {side}³ ({seconds:.0f} s): blocks off by {100 * error:.2f} % of the mean (noise of the truth {100 * noise / due.mean():.2f} %), mean {100 * off.mean() / due.mean():+.2f} %; "
                f"the grid says {100 * coarse:.0f} % between probes",
                flush=True,
            )
            held &= side != 64 or error < 0.05
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    for name, points in curves.items():
        plt.semilogx(*zip(*points), "o-", label=name)
    plt.xlabel("probes along a side")
    plt.ylabel("error of 8 x 8 blocks (% of the mean)")
    plt.xticks([16, 32, 64, 128], ["16", "32", "64", "128"])
    plt.minorticks_off()
    plt.ylim(bottom=0)
    plt.grid(True, which="both", alpha=0.3)
    plt.legend()
    plot = pathlib.Path(os.environ.get("FOLDER", ".")) / "error-over-resolution.png"
    plt.savefig(plot, dpi=120, bbox_inches="tight")
    print(f"to be looked at: {plot}")
    return held


def medium(file):
    """The medium's layers of a picture, in blocks of 8 × 8 pixels."""
    import OpenEXR

    channels = OpenEXR.File(str(file)).channels()
    layers = [c.pixels for name, c in channels.items() if name.startswith(("medium_single", "medium_multiple"))]
    assert layers, list(channels)
    light = sum(layer if layer.ndim == 3 else np.repeat(layer[..., None], 3, -1) / 3 for layer in layers).mean(-1)
    return light.reshape(light.shape[0] // 8, 8, light.shape[1] // 8, 8).mean((1, 3))


def main():
    tasks = {"leaks": leaks, "truth": truth, "pictures": pictures, "speed": speed, "refine": refine, "flicker": flicker, "kill": kill, "schema": schema}
    asked = sys.argv[1:] or list(tasks)
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(os.environ.get("FOLDER", folder))
        results = {name: tasks[name](folder) for name in asked}
    for name, held in results.items():
        print(f"{'holds' if held else 'FAILS'}: {name}")
    sys.exit(not all(results.values()))


if __name__ == "__main__":
    main()
