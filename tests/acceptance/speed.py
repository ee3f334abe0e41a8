#!/usr/bin/env python3
"""Compares the CPU seconds of two versions of the program, side by side in one run: every method on four scenes, half an hour,
not part of CI.

    python3 tests/acceptance/speed.py OLD NEW [--only REGEX] [--repeat N] [--limit R]

OLD and NEW are programs built with the same profile. They take turns, with one thread, because cores are shared and noisy; of each
the least time of --repeat runs counts. Times are of the whole program, reading the scene included. Exit status 1 where NEW takes more than
--limit times as long (1.02), or a run fails.
"""
import argparse, os, re, subprocess, sys, tempfile

from digests import METHODS, SCENES

# scene: size, and the samples that make a run a few seconds long
HOMES = {
    "smoke-box-homogeneous-isotropic": "64x64",
    "smoke-box-heterogeneous-anisotropic": "64x64",
    "room-plume": "64x48",
    "lantern": "64x48",
}
SAMPLES = {
    "path": "--spp 64",
    "path-noise": "--spp 256",
    "radiance-cache": "--paths 256 --spp 8",
    "photon-beams": "--spp 32",
    "photon-beams-covariance": "--spp 32",
    "vpl": "--lights 256 --spp 64",
    "march": "--spp 16",
    "march-covariance": "--spp 16",
    "march-frequency": "--spp 16",
    "image-sampling": "--spp 64",
}


def seconds(program, scene, size, options, folder):
    """CPU seconds of one run."""
    command = [program, "render", str(SCENES / f"{scene}.xml"), "--size", size, "--threads", "1", "--quiet"]
    process = subprocess.Popen([*command, *options.split(), "-o", os.path.join(folder, "picture.pfm")])
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        sys.exit(f"{program} {scene} {options}: exit status {process.returncode}")
    return usage.ru_utime + usage.ru_stime


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old")
    parser.add_argument("new")
    parser.add_argument("--only", default="", metavar="REGEX", help="of SCENE/METHOD")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--limit", type=float, default=1.02)
    arguments = parser.parse_args()
    ratios = []
    print(f"{'':52} {'old s':>7} {'new s':>7} {'ratio':>6}  spread of old")
    with tempfile.TemporaryDirectory() as folder:
        for scene, size in HOMES.items():
            for method, options in METHODS.items():
                name = f"{scene}/{method}"
                if not re.search(arguments.only, name):
                    continue
                turns = [arguments.old, arguments.new]
                times = [[], []]
                for turn in range(arguments.repeat):
                    # Whoever comes second has warm caches: they take turns in that, too.
                    for i in (0, 1) if turn % 2 == 0 else (1, 0):
                        times[i].append(seconds(turns[i], scene, size, f"{options} {SAMPLES[method]}", folder))
                old, new = map(min, times)
                ratios.append((new / old, name))
                spread = max(times[0]) / old
                print(f"{name:52} {old:7.2f} {new:7.2f} {new / old:6.3f}  {spread:.3f}", flush=True)
    if not ratios:
        sys.exit("nothing was compared")
    worst, name = max(ratios)
    product = 1.0
    for ratio, _ in ratios:
        product *= ratio
    print(f"mean {product ** (1 / len(ratios)):.3f}, worst {worst:.3f} ({name})")
    return int(worst > arguments.limit)


if __name__ == "__main__":
    sys.exit(main())
