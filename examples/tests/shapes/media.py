#!/usr/bin/env python3
"""Writes media.txt beside it: what the independent renderer (Python package `mitsuba` 3.9.1) makes of the scenes media-*.xml. Each
line: scene, quadrant (row, column), mean radiance in three channels, their standard errors.

    python3 media.py [SCENE...]
"""

import glob
import os
import sys

import mitsuba as mi
import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
RUNS, SAMPLES = 16, 256


def main():
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
