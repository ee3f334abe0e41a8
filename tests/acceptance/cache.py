#!/usr/bin/env python3
"""Holds radiance caching against references and against path tracing: long runs, not part of CI.

    FOGBOW_REFERENCE=FOLDER python3 tests/acceptance/cache.py accuracy    [SCENE...] [--seed N]
    FOGBOW_REFERENCE=FOLDER python3 tests/acceptance/cache.py speed       [SCENE...] [--sizes 128,512,1024] [--samples N]
    FOGBOW_REFERENCE=FOLDER python3 tests/acceptance/cache.py flicker     [--frames N] [--store FOLDER]
    FOGBOW_REFERENCE=FOLDER python3 tests/acceptance/cache.py reuse       [--size WxH] [--noise E]
    FOGBOW_REFERENCE=FOLDER python3 tests/acceptance/cache.py determinism [SCENE...]
    FOGBOW_REFERENCE=FOLDER python3 tests/acceptance/cache.py cost        [SCENE...]
    FOGBOW_REFERENCE=FOLDER python3 tests/acceptance/cache.py levels      [SCENE...] [--plot FILE.svg]
    FOGBOW_REFERENCE=FOLDER python3 tests/acceptance/cache.py asked       [SCENE...] [--seed N] [--spp N]

FOLDER and what must be built and installed: see ground.py. SCENE is a name in public/. CPU seconds are those of all
phases of filling and of the rendering, without reading, building the tree and writing. --store keeps long renders.

accuracy     default settings: relRMSE_c <= 3 % (6 % in spot-shafts, nave-shafts, lantern and their -ss), |bias| <= 1 %,
             no 16x16 block off by more than 5 %; --seed is 1 unless told. `ref` is the mean standard error of the
             reference's own blocks. The worst block (row, column) is told with its distance in the reference's own standard
             errors there; where all blocks beyond 5 % lie within 3 of them the line says `noise`, and the blocks still count.
speed        CPU seconds to 2 % relRMSE_c, by the largest --error that reaches it, of LADDER and twice halfway back to the rung before (the error is the root mean
             square of three seeds; the audit's time counts), against path tracing and the peer, whose seconds to 2 % are
             c^2 / 0.02^2 of a run each of --samples. At least so many times faster than either as BOXES and SCENES say.
             At --sizes other than 128 those two take as many more seconds as there are more pixels, and the error of
             caching is that of means over pixels of 128 x 128, for which a reference is stored, and the noise of what is
             finer. Of an .xml file the truth is two independent path traced renders A and B of --spp samples, and the
             squared error of an image I the mean of (I - A)(I - B): their noise, being independent, drops out.
flicker      a fresh cache with other seeds for each of 12 frames of `fogbow plume`: the variance over frames of (frame -
             converged frame), at most a quarter of path tracing's at equal CPU time. Converged frames come in two
             halves as above, so that their noise drops out of the variance.
reuse        the walk through the atrium, every frame with the cache of the one before (--cache-in, --cache-out): every
             later frame takes at most a third of the first one's CPU seconds; --noise for all of them, else the default.
determinism  the same bytes of .pfm and .exr with 1, 2 and 7 threads, and from a cache saved and loaded.
cost         CPU time of a record and of a look-up, their ratio (100 to 1000 in Jarosz et al. 2008), and the share of
             look-ups in the render. A look-up is what the render takes more than one of --max-depth 2, which marches to
             the same points and connects the same lights, divided by the number of look-ups.
levels       error after --time 0.5 to 64 on one thread: it falls, and is 15 % at most after 2 s. On a machine that others use the clock is not
             processor time.
asked        --error E of 0.1, 0.05, 0.02 and 0.01: the error lies between 0.4 E and 1.2 E in at least 9 of 10 cases. Scenes: six references and six
             of the matrix (its make.py is run), of which truth is known as in `speed`.

Exit status 1 when a line fails; of `asked`, when too few are met.
"""
import argparse, os, subprocess, sys, tempfile
import numpy as np
from common import Halves, Stored, compare, cpu, every_scene, halves, matrix, peer_run, render, verdict
import common
from plot import plot

CACHED = ("--method", "radiance-cache")
SHARP = ("spot-shafts", "nave-shafts", "lantern")  # borders of light no wider than a pixel, heavy tails
CORNELL = [f"cornell-{medium}-{phase}" for medium in ("homog", "hetero") for phase in ("iso", "hg06")]

# Of which the error is compared with what was asked for.
ASKED = ["cornell-homog-iso", "cornell-hetero-hg06", "point-homog-iso-lo", "room-plume", "statue-g06", "lantern"]
ASKED_OF_MATRIX = ["thickness-2", "thickness-8", "g-08", "centimetre", "sky", "spot"]

# What --error is asked for; the cheapest first.
LADDER = (0.03, 0.025, 0.02, 0.015, 0.01)
# Rungs between the first that is good enough and the one before it: path tracing and the peer are told at the goal itself.
HALVINGS = 2

# How many times faster than path tracing and than the peer, by the size of the picture and, where not a box, by the scene.
BOXES = {128: 100, 512: 400, 1024: 800}
SCENES = {"room-plume": 30, "statue": 30, "atrium": 30, "nave": 10, "lantern": 10, "spot": 10}


def accuracy(scenes, arguments):
    failures = 0
    for scene in scenes or every_scene():
        mean, error, kind = compare.load_ref(scene)
        image, statistics = render(scene, *CACHED, "--seed", arguments.seed)
        result = compare.stats(image, mean, error)
        bound = 0.06 if scene.removesuffix("-ss") in SHARP else 0.03
        misses = [name for name, is_missed in [
            ("relRMSE_c", result["relRMSE_c"] > bound),
            ("bias", abs(result["bias"]) > 0.01),
            ("block", result["block_rel_max"] > 0.05),
            ("non_finite", statistics["counts"]["non_finite"] > 0),
        ] if is_missed]
        worst, distance, is_noise = doubtful(image, mean, error)
        noise = " noise" if "block" in misses and kind != "exact" and is_noise else ""
        failures += bool(misses)
        print(f"{scene:24s} {verdict(not misses)} relRMSE_c {100 * result['relRMSE_c']:.2f} % (floor {100 * result['floor']:.2f})  "
              f"bias {100 * result['bias']:+.2f} %  worst block {100 * result['block_rel_max']:.1f} % (at {worst}, {distance:.1f} s.e., "
              f"rms {100 * result['block_rel_rms']:.2f} %, ref {100 * result['block_rel_ref_se']:.2f} %)  "
              f"{cpu(statistics, ['fill']):.2f} + {cpu(statistics, ['render']):.2f} CPU s  {' '.join(misses)}{noise}", flush=True)
    return failures


def doubtful(image, mean, error, bound=0.05):
    """Place of the worst block, its distance in standard errors of the reference, whether all beyond `bound` are within 3."""
    truth, squares = compare.blocks(mean).mean(2), compare.blocks(error**2)
    apart = np.abs(compare.blocks(image).mean(2) - truth)
    relative = apart / np.maximum(truth, 0.05 * mean.mean())
    with np.errstate(divide="ignore"):
        distance = apart / np.sqrt(squares.mean(2) / squares.shape[2])
    row, column, channel = (int(i) for i in np.unravel_index(relative.argmax(), relative.shape))
    return (row, column), distance[row, column, channel], (distance[relative > bound] <= 3).all()


def finely(truth, images):
    """Mean relative squared error of pictures of other seeds, of `truth`'s size or a multiple: of means over its pixels, and of what
    is finer the noise, which the seeds tell."""
    images = np.array(images)
    side = images.shape[1] // truth.mean.shape[0]
    blocks = images.reshape(len(images), *sum(((n // side, side) for n in images.shape[1:3]), ()), 3).mean((2, 4))
    finer = images - blocks.repeat(side, 1).repeat(side, 2)
    scale = (compare.smooth(truth.mean) ** 2 + 0.01 * truth.mean.mean() ** 2).repeat(side, 0).repeat(side, 1)
    noise = np.mean(finer.var(0, ddof=1) / scale) if side > 1 else 0.0
    return np.mean([truth.relative_square(image) for image in blocks]) + noise


def climb(scene, truth, size, goal):
    """The CPU seconds of the largest `--error` at which a picture is off by at most `goal`: of the ladder, then twice halfway back to the rung before; None if there is none"""
    def seconds_at(rung):
        runs = [render(scene, *CACHED, "--error", rung, "--seed", seed, *size) for seed in (1, 2, 3)]
        squared = finely(truth, [image for image, _ in runs]) if size else np.mean([truth.relative_square(image) for image, _ in runs])
        seconds = np.mean([cpu(statistics, ["fill", "audit", "render"]) for _, statistics in runs])
        print(f"    {' '.join(size)} --error {rung:.4g}: {100 * np.sqrt(max(squared, 0)):.2f} % in {seconds:.2f} CPU s", flush=True)
        return seconds if squared <= goal**2 else None

    before = None
    for rung in LADDER:
        if (seconds := seconds_at(rung)) is not None:
            break
        before = rung
    for _ in range(HALVINGS if seconds is not None and before else 0):
        halfway = np.sqrt(before * rung)
        if (less := seconds_at(halfway)) is None:
            before = halfway
        else:
            rung, seconds = halfway, less
    return seconds


def truth_of(scene, arguments):
    """Of a scene of the references what is stored, of any other file two path traced pictures."""
    if not scene.endswith(".xml"):
        return Stored(scene)
    name = os.path.splitext(os.path.basename(scene))[0]
    return Halves(*halves(arguments.store, name, scene, arguments.spp))


def speed(scenes, arguments):
    failures, goal = 0, 0.02
    for scene in scenes or CORNELL:
        name, is_stored = os.path.splitext(os.path.basename(scene))[0], not scene.endswith(".xml")
        truth = truth_of(scene, arguments)
        image, statistics = render(scene, "--method", "path", "--spp", arguments.samples, "--seed", 100)
        path = truth.relative_square(image) * cpu(statistics) / goal**2
        peer = np.inf
        if is_stored:
            image, seconds = peer_run(scene, arguments.samples, 200)
            peer = truth.relative_square(image) * seconds / goal**2
        for side in arguments.sizes.split(",") if is_stored else [None]:
            ours = climb(scene, truth, ("--size", f"{side}x{side}") if side else (), goal)
            # As many samples of as many more pixels.
            more = int(side or 128) ** 2 / 128**2
            asked = next((times for start, times in SCENES.items() if name.startswith(start)), BOXES.get(int(side or 128), 100))
            passes = ours is not None and min(path, peer) * more >= asked * ours
            failures += not passes
            text = "2 % not reached" if ours is None else f"{ours:.2f} CPU s: {path * more / ours:.0f} and {peer * more / ours:.0f} times as fast (asked {asked})"
            print(f"{name:24s} {verdict(passes)} to 2 % at {side or 'its size'}: path tracing {path * more:.0f}, peer {peer * more:.0f}, caching {text}", flush=True)
    return failures


def flicker(_, arguments):
    size = ("--size", arguments.size or "128x96")
    frames = os.path.join(arguments.store, "plume")
    subprocess.run([common.PROGRAM, "plume", "--frames", str(arguments.frames), "-o", frames, "--quiet"], check=True)
    cached, traced, truths = [], [], []
    times = {"cached": 0.0, "traced": 0.0}
    for frame in range(arguments.frames):
        scene = os.path.join(frames, f"plume-{frame:02d}.xml")
        truths.append(halves(arguments.store, f"plume-{frame:02d}-{size[1]}", scene, arguments.spp, *size))
        image, statistics = render(scene, *CACHED, "--seed", 1000 + frame, *size)
        cached.append(image)
        times["cached"] += cpu(statistics)
        if frame == 0:
            _, trial = render(scene, "--method", "path", "--spp", 8, *size)
            samples = max(round(8 * cpu(statistics) / cpu(trial)), 1)
        image, statistics = render(scene, "--method", "path", "--spp", samples, "--seed", 2000 + frame, *size)
        traced.append(image)
        times["traced"] += cpu(statistics)
    mean = np.mean(truths, (0, 1))
    scale = compare.smooth(mean) ** 2 + 0.01 * mean.mean() ** 2

    def variance(images):
        apart = [np.array(images) - np.array([halves[i] for halves in truths]) for i in (0, 1)]
        first, second = (a - a.mean(0) for a in apart)
        return np.mean((first * second).sum(0) / (len(images) - 1) / scale)

    # A path tracer's variance falls with its time: brought to the very same.
    path = variance(traced) * times["traced"] / times["cached"]
    ratio = variance(cached) / path
    print(f"plume {verdict(ratio <= 0.25)} relative variance over {arguments.frames} frames at {times['cached'] / arguments.frames:.2f} CPU s each: "
          f"caching {variance(cached):.3e}, path tracing {path:.3e} ({samples} samples), ratio {ratio:.3f}")
    return ratio > 0.25


def reuse(_, arguments):
    scenes = os.path.join(common.ROOT, "examples", "scenes")
    with open(os.path.join(scenes, "atrium-walk.txt")) as file:
        walk = file.read().splitlines()
    size = ("--size", arguments.size) if arguments.size else ()
    noise = ("--noise", arguments.noise) if arguments.noise else ()
    failures, first = 0, None
    with tempfile.TemporaryDirectory() as folder:
        cache = os.path.join(folder, "walk.cache")
        for number, camera in enumerate(walk):
            known = ("--cache-in", cache) if number else ()
            _, statistics = render(os.path.join(scenes, "atrium.xml"), *CACHED, "--camera", camera, "--seed", number, *size, *noise,
                                   *known, "--cache-out", cache)
            seconds = cpu(statistics)
            first = first or seconds
            passes = number == 0 or seconds <= first / 3
            failures += not passes
            print(f"frame {number:2d} {verdict(passes)} {seconds:.2f} CPU s ({seconds / first:.2f} of the first): filling {cpu(statistics, ['fill']):.2f}, "
                  f"{statistics['records']['computed']} records computed, rendering {cpu(statistics, ['render']):.2f}", flush=True)
    return failures


def determinism(scenes, _):
    failures = 0
    for scene in scenes or ["cornell-hetero-hg06", "spot-shafts", "room-plume"]:
        few = (*CACHED, "--size", "64x64", "--spp", 4, "--paths", 128)
        with tempfile.TemporaryDirectory() as folder:
            cache = os.path.join(folder, "scene.cache")
            runs = {f"{threads} threads": ("--threads", threads) for threads in (1, 2, 7)}
            runs["saved"] = ("--cache-out", cache)
            runs["loaded"] = ("--cache-in", cache)
            expected = None
            for run, options in runs.items():
                files = {}
                try:
                    render(scene, *few, *options, files=files)
                except subprocess.CalledProcessError as error:
                    files = {"": f"exit code {error.returncode}"}
                expected = expected or files
                passes = files == expected
                failures += not passes
                print(f"{scene:24s} {verdict(passes)} {run} {files.get('', '')}", flush=True)
    return failures


def levels(scenes, arguments):
    failures, series = 0, {}
    for scene in scenes or CORNELL:
        truth, last = Stored(scene), np.inf
        for time in (0.5, 1, 2, 4, 8, 16, 32, 64):
            image, statistics = render(scene, *CACHED, "--time", time, "--threads", 1)
            error, audit = 100 * np.sqrt(max(truth.relative_square(image), 0)), statistics.get("audit")
            made_for = "" if audit is None else f"made for {100 * audit['made_for']:.1f} %, "
            # The first picture is always finished, so short times may give the same.
            passes = error <= 1.02 * last and (time < 2 or error <= 15)
            failures += not passes
            print(f"{scene:24s} {verdict(passes)} --time {time:4g}: {error:6.2f} % in {cpu(statistics, ['fill', 'audit', 'render']):.1f} CPU s, {made_for}"
                  f"{statistics['samples_per_pixel']:g} samples", flush=True)
            last = error
            series.setdefault(scene, []).append((cpu(statistics, ["fill", "audit", "render"]), error))
    if arguments.plot:
        plot(series, arguments.plot, "%", "s")
    return failures


def asked(scenes, arguments):
    if not scenes:
        of_matrix = matrix(os.path.join(arguments.store, "matrix"))
        scenes = ASKED + [file for file in of_matrix if os.path.basename(file)[:-4] in ASKED_OF_MATRIX]
    met = []
    for scene in scenes:
        truth = truth_of(scene, arguments)
        for goal in (0.1, 0.05, 0.02, 0.01):
            image, statistics = render(scene, *CACHED, "--error", goal, "--seed", arguments.seed)
            times = np.sqrt(max(truth.relative_square(image), 0)) / goal
            met.append(0.4 <= times <= 1.2)
            print(f"{os.path.basename(scene):24s} {verdict(met[-1])} --error {goal}: {times:.2f} of it in {cpu(statistics, ['fill', 'audit', 'render']):.1f} CPU s", flush=True)
    print(f"{sum(met)} of {len(met)} between 0.4 and 1.2 of what was asked")
    return sum(met) < 0.9 * len(met)


def cost(scenes, _):
    for scene in scenes or CORNELL + ["spot-shafts", "room-plume", "nave-shafts"]:
        # As many samples for both: by default there are more where nothing is cached.
        _, whole = render(scene, *CACHED, "--spp", 64)
        _, single = render(scene, *CACHED, "--spp", 64, "--max-depth", 2)
        records, counts = whole["records"], whole["counts"]
        record = cpu(whole, ["fill"]) / max(records["computed"], 1)
        lookups = cpu(whole, ["render"]) - cpu(single, ["render"])
        lookup = lookups / max(counts["cache_lookups"], 1)
        kept = ", ".join(f"{name} {count}" for name, count in records.items() if name != "computed" and count)
        print(f"{scene:24s} record {1e6 * record:.0f} us ({records['computed']} computed; kept: {kept})  look-up {1e9 * lookup:.0f} ns "
              f"({counts['cache_lookups'] / 1e6:.1f} million, {100 * counts['cache_misses'] / max(counts['cache_lookups'], 1):.2f} % missed)  "
              f"ratio {record / lookup:.0f}  look-ups {100 * lookups / cpu(whole, ['render']):.0f} % of {cpu(whole, ['render']):.2f} CPU s", flush=True)
    return 0


if __name__ == "__main__":
    what = {f.__name__: f for f in (accuracy, speed, flicker, reuse, determinism, cost, levels, asked)}
    parser = argparse.ArgumentParser(usage=__doc__.replace("%", "%%"))
    parser.add_argument("what", choices=what)
    parser.add_argument("scenes", nargs="*", metavar="SCENE")
    parser.add_argument("--size")
    parser.add_argument("--noise", type=float)
    parser.add_argument("--plot")
    parser.add_argument("--frames", type=int, default=12)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--spp", type=int, default=512)
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--sizes", default="128")
    parser.add_argument("--store", default=os.path.join(tempfile.gettempdir(), "fogbow-acceptance"))
    arguments = parser.parse_args()
    sys.exit(min(int(what[arguments.what](arguments.scenes, arguments)), 1))
