#!/usr/bin/env python3
"""Holds virtual lights against references, path tracing and each other: long runs, not part of CI.

    FOGBOW_REFERENCE=FOLDER python3 tests/acceptance/vpl.py unbiased [SCENE...] [--seeds N]
    FOGBOW_REFERENCE=FOLDER python3 tests/acceptance/vpl.py quality [SCENE...] [--seeds N]
    FOGBOW_REFERENCE=FOLDER python3 tests/acceptance/vpl.py cost | visibility | statues | methods | scale | determinism

FOLDER holds compare.py and public/ with scenes and their references. Needs target/release/fogbow, numpy and OpenEXR.

unbiased    full compensation, exact transmittance, 64x64, mean of N seeds (16): |bias| <= 0.5 %, no block of 8x8 pixels
            beyond 5 standard errors, which come from the seeds' spread. Point scenes: bias only.
quality     the usual bound at 1000 lights: 99.9th percentile of the clamped layer at most twice the converged one's, at least 10 %
            lost; against full compensation with the same lights, mean |relative block difference| <= 1.5 % and none above 5 %
            with 2 steps, <= 4 % with 1. 1-to-1 beside abc tells what the assumption of local homogeneity costs.
cost        CPU time of a step of compensation over that of a clamped gather: at most 1.3.
visibility  what leaving local visibility out changes.
statues     three phase functions, 2 steps, against the references: mean |relative block difference| <= 2 %, |bias| <= 1 %.
methods     relRMSE_c of all methods at about equal CPU time, that of radiance caching with usual settings.
scale       10^3 to 10^5 lights: time over lights, bytes.
determinism the same bytes with 1, 2 and 7 threads.

Strategies of compensation at equal time are compared by `fogbow figures engelhardt --only 6`.

Exit status 1 when a line fails.
"""
import argparse, hashlib
import numpy as np
import OpenEXR
from common import ROOT, compare, cpu, every_scene, verdict
import common, os, tempfile

VPL = ("--method", "vpl")


def layers(scene, *options):
    """-> layers by name, CPU seconds of rendering, statistics"""
    files = {}
    _, statistics = common.render(scene, *VPL, *options, "--aov", files=files)
    with tempfile.NamedTemporaryFile(suffix=".exr") as file:
        file.write(files["exr"])
        file.flush()
        channels = OpenEXR.File(file.name).channels()
        found = {name: np.asarray(channel.pixels, float)[..., :3] for name, channel in channels.items()}
    found["total"] = found.pop("RGB", found.get("total"))
    return found, cpu(statistics), statistics


def blocks(image, side):
    height, width, _ = image.shape
    return image.reshape(height // side, side, width // side, side, 3).mean((1, 3))


def differences(image, truth, side):
    """|relative differences| of blocks; dim ones count as a tenth of the mean."""
    ours, theirs = blocks(image, side), blocks(truth, side)
    return np.abs(ours - theirs) / np.maximum(theirs, 0.1 * theirs.mean())


def unbiased(scenes, options):
    failures = 0
    for scene in scenes or every_scene():
        mean, error, kind = compare.load_ref(scene)
        size, side = 64, 8
        images = np.array([
            common.render(scene, *VPL, "--compensation", "full", "--size", f"{size}x{size}", "--seed", seed, "--pass-samples", 32,
                          *options.more)[0] for seed in range(1, options.seeds + 1)])
        ours = np.array([blocks(image, side) for image in images])
        truth, own = blocks(mean, 2 * side), np.sqrt(blocks(error**2, 2 * side) / (2 * side) ** 2)
        spread = np.sqrt(ours.var(0, ddof=1) / len(ours) + own**2)
        worst = np.max(np.abs(ours.mean(0) - truth) / np.maximum(spread, 1e-9 * truth.mean()))
        means = images.mean((1, 2, 3))
        bias = means.mean() / mean.mean() - 1
        sigma = means.std(ddof=1) / np.sqrt(len(means)) / mean.mean()
        passes = abs(bias) <= 0.005 and (kind == "exact" or worst <= 5)
        failures += not passes
        print(f"{scene:24s} {verdict(passes)} bias {100 * bias:+.3f} +- {100 * sigma:.3f} %  worst block {worst:.2f} s.e.", flush=True)
    return failures


def quality(scenes, options):
    failures = 0
    for scene in scenes or ["cornell-hetero-iso", "cornell-homog-iso", "room-plume"]:
        size = ("--size", "64x64")
        single, many, energy = [], [], []
        sums = {}
        for seed in range(1, options.seeds + 1):
            for name, way in {"full": ("full",), "2": ("abc",), "1": ("abc", "--steps", 1), "exact": ("1-to-1",)}.items():
                seen, _, statistics = layers(scene, *size, "--seed", seed, "--compensation", *way)
                sums[name] = sums.get(name, 0) + seen["total"] / options.seeds
                sums[name + "-medium"] = sums.get(name + "-medium", 0) + seen["medium_multiple"] / options.seeds
                if name == "full":
                    single.append(np.percentile(seen["clamped"].mean(-1), 99.9))
                    many.append(seen["clamped"].mean(-1))
                    energy.append(statistics["energy"])
        peak = np.mean(single) / np.percentile(np.mean(many, 0), 99.9)
        lost = np.mean([e["clamped_away"] for e in energy]) / np.mean([e["clamped_away"] + e["clamped_layer"] for e in energy])
        by = {name: differences(sums[name], sums["full"], 8) for name in ("2", "1", "exact")}
        passes = peak <= 2 and lost >= 0.1 and by["2"].mean() <= 0.015 and by["2"].max() <= 0.05 and by["1"].mean() <= 0.04
        failures += not passes
        local = sums["2-medium"].mean() / sums["exact-medium"].mean() - 1
        print(f"{scene:24s} {verdict(passes)} peak {peak:.2f}, lost {100 * lost:.1f} %; blocks: 2 steps {100 * by['2'].mean():.2f} % (worst "
              f"{100 * by['2'].max():.1f} %), 1 step {100 * by['1'].mean():.2f} %, 2 exact {100 * by['exact'].mean():.2f} %; local homogeneity "
              f"changes the medium's light by {100 * local:+.2f} %", flush=True)
    return failures


def cost(scenes, options):
    failures = 0
    for scene in scenes or ["cornell-homog-iso", "cornell-hetero-iso"]:
        seconds = {}
        for name, way in {"base": ("none", "--lights", 1), "none": ("none",), "1": ("abc", "--steps", 1), "2": ("abc", "--steps", 2),
                          "1-to-1": ("1-to-1", "--steps", 1), "n-to-1": ("n-to-1", "--steps", 1)}.items():
            runs = [layers(scene, "--size", "64x64", "--threads", 1, "--candidates", 1, "--seed", seed, "--compensation", *way)[1]
                    for seed in range(1, 4)]
            seconds[name] = np.median(runs)
        gather = seconds["none"] - seconds["base"]
        step = {name: (seconds[name] - seconds["none"]) / gather for name in ("1", "1-to-1", "n-to-1")}
        second = (seconds["2"] - seconds["1"]) / gather
        passes = step["1"] <= 1.3
        failures += not passes
        count = 64 * 64 * 1000
        print(f"{scene:24s} {verdict(passes)} clamped gather {1e9 * gather / count:.0f} ns per (pixel, light), medium and surface; first step of abc "
              f"{step['1']:.2f}, second {second:.2f}, 1-to-1 {step['1-to-1']:.2f}, n-to-1 {step['n-to-1']:.2f} of that; all else "
              f"{seconds['base']:.2f} s", flush=True)
    return failures


def visibility(scenes, options):
    for scene in scenes or ["room-plume", "cornell-hetero-iso", "cornell-homog-iso"]:
        ways = [layers(scene, "--size", "64x64", "--local-visibility", switch)[0]["total"] for switch in ("on", "off")]
        by = differences(ways[1], ways[0], 8)
        print(f"{scene:24s} without local visibility {100 * (ways[1].mean() / ways[0].mean() - 1):+.2f} %, blocks {100 * by.mean():.2f} %, worst "
              f"{100 * by.max():.1f} %", flush=True)
    return 0


def statues(scenes, options):
    failures = 0
    for scene in scenes or ["statue-g-06", "statue-g00", "statue-g06"]:
        mean, error, _ = compare.load_ref(scene)
        image = np.mean([common.render(scene, *VPL, "--size", "64x64", "--seed", seed, "--lights", 2000)[0]
                         for seed in range(1, options.seeds + 1)], 0)
        traced, _ = common.render(scene, "--method", "path", "--size", "64x64", "--spp", 1024)
        by = differences(image, np.asarray([blocks(mean, 2)])[0], 8)
        beside = differences(image, traced, 8)
        bias = image.mean() / mean.mean() - 1
        passes = by.mean() <= 0.02 and beside.mean() <= 0.02 and abs(bias) <= 0.01
        failures += not passes
        print(f"{scene:24s} {verdict(passes)} blocks {100 * by.mean():.2f} % (worst {100 * by.max():.1f} %), against path tracing "
              f"{100 * beside.mean():.2f} %, bias {100 * bias:+.2f} %", flush=True)
    return failures


def methods(scenes, options):
    for scene in scenes or ["cornell-hetero-iso", "cornell-hetero-hg06", "cornell-homog-iso", "room-plume"]:
        mean, error, _ = compare.load_ref(scene)
        line = []
        _, first = common.render(scene, "--method", "radiance-cache", "--threads", 1)
        budget = cpu(first)
        for name in ("path", "photon-beams", "vpl", "radiance-cache"):
            limit = ()
            if name != "radiance-cache":
                # By samples, not by --time: what else runs on the machine must not count.
                _, pilot = common.render(scene, "--method", name, "--threads", 1, "--spp", 64)
                limit = ("--spp", 64 * max(1, round(budget / cpu(pilot))))
            image, statistics = common.render(scene, "--method", name, "--threads", 1, *limit)
            line.append(f"{name} {100 * compare.stats(image, mean, error)['relRMSE_c']:.2f} % ({cpu(statistics):.0f} s)")
        print(f"{scene:24s} {', '.join(line)}", flush=True)
    return 0


def scale(scenes, options):
    scene, found = (scenes or ["cornell-hetero-iso"])[0], []
    for lights in (1000, 10_000, 100_000):
        _, spent, statistics = layers(scene, "--size", "16x16", "--lights", lights, "--threads", 1, "--candidates", 1)
        found.append((lights, spent, statistics["bytes"]["virtual lights"]))
    per = [(b[1] - a[1]) / (b[0] - a[0]) for a, b in zip(found, found[1:])]
    passes = found[-1][2] < 16e6 and 0.7 < per[1] / per[0] < 1.4
    print(f"{scene:24s} {verdict(passes)} " + ", ".join(f"{n} lights {t:.2f} s, {b / 1e6:.1f} MB" for n, t, b in found)
          + f"; per further light {1e6 * per[0]:.0f} and {1e6 * per[1]:.0f} us", flush=True)
    return not passes


def determinism(scenes, options):
    failures = 0
    for scene in scenes or [os.path.join(ROOT, "examples/scenes/smoke-box-heterogeneous-anisotropic.xml"), "room-plume"]:
        for way in ("abc", "full", "1-to-1"):
            sums = set()
            for threads in (1, 2, 7):
                files = {}
                common.render(scene, *VPL, "--size", "32x24", "--lights", 200, "--spp", 16, "--pass-samples", 8, "--threads", threads,
                              "--compensation", way, "--aov", files=files)
                sums.add(hashlib.sha256(files["exr"]).hexdigest())
            failures += len(sums) > 1
            print(f"{os.path.basename(scene):48s} {way:8s} {verdict(len(sums) == 1)}", flush=True)
    return failures


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ways = {f.__name__: f for f in (unbiased, quality, cost, visibility, statues, methods, scale, determinism)}
    parser.add_argument("what", choices=ways)
    parser.add_argument("scenes", nargs="*")
    parser.add_argument("--seeds", type=int)
    parser.add_argument("--more", nargs="*", default=[], help="further options of the program")
    options = parser.parse_args()
    options.seeds = options.seeds or {"unbiased": 16, "quality": 4, "statues": 4}.get(options.what, 1)
    raise SystemExit(bool(ways[options.what](options.scenes, options)))
