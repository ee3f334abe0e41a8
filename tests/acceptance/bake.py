#!/usr/bin/env python3
"""Baked light against what must hold of it: python3 tests/acceptance/bake.py [leaks | truth | pictures | speed | kill | schema] …

    leaks       behind the thin wall: what look-ups find, with planes of surfaces and as hardware mixes, of the light before it
    truth       probes against path tracing of the same probes with many more samples: four boxes and the atrium
    pictures    the atrium and a smoke box marched from 32³, 64³, 128³ probes against path tracing; a plot
    speed       32³ probes of degree 2 in the atrium: processor seconds, beside path tracing the same probes
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


def main():
    tasks = {"leaks": leaks}
    asked = sys.argv[1:] or list(tasks)
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(os.environ.get("FOLDER", folder))
        results = {name: tasks[name](folder) for name in asked}
    for name, held in results.items():
        print(f"{'holds' if held else 'FAILS'}: {name}")
    sys.exit(not all(results.values()))


if __name__ == "__main__":
    main()
