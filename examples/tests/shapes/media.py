#!/usr/bin/env python3
"""Writes media.txt beside it: what the independent renderer (Python package `mitsuba` 3.9.1) makes of the scenes media-*.xml. Each
line: scene, quadrant (row, column), mean radiance in three channels, their standard errors.

    python3 media.py [SCENE...]
"""

import glob
import os
import random
import struct
import sys

import mitsuba as mi
import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
RUNS, SAMPLES = 16, 256


def grid(name, size, channels, seed, box):
    """A volume of Mitsuba's format, version 3, of 32-bit floats."""
    rng = random.Random(seed)
    count = size[0] * size[1] * size[2] * channels
    values = [round(rng.random(), 3) for _ in range(count)]
    data = b"VOL\x03" + struct.pack("<iiiii6f", 1, *size, channels, *box) + struct.pack("<%df" % count, *values)
    open(os.path.join(HERE, name), "wb").write(data)


def main():
    grid("grey.vol", (3, 2, 4), 1, 1, (0, 0, 0, 1, 1, 1))
    grid("colour.vol", (2, 3, 3), 3, 2, (-0.8, -0.7, -0.9, 0.8, 0.9, 0.7))
    mi.set_variant("llvm_ad_rgb")
    names = sys.argv[1:] or sorted(os.path.basename(f)[6:-4] for f in glob.glob(os.path.join(HERE, "media-*.xml")))
    lines = []
    for name in names:
        scene = mi.load_file(os.path.join(HERE, "media-%s.xml" % name))
        images = [np.array(mi.render(scene, spp=SAMPLES, seed=seed))[..., :3] for seed in range(RUNS)]
        half = images[0].shape[0] // 2
        means = np.array([[[i[half * r : half * (r + 1), half * c : half * (c + 1)].mean((0, 1)) for c in (0, 1)] for r in (0, 1)] for i in images])
        for r in (0, 1):
            for c in (0, 1):
                values = means[:, r, c]
                error = values.std(0, ddof=1) / RUNS**0.5
                lines.append(" ".join([name, str(r), str(c)] + ["%.6g" % v for v in (*values.mean(0), *error)]))
    open(os.path.join(HERE, "media.txt"), "w").write("\n".join(lines) + "\n")


main()
