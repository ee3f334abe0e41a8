#!/usr/bin/env python3
"""Holds the uses of covariance grids against uniform sampling: long runs, not part of CI.

    python3 tests/acceptance/covariance.py steps [--spp N] [--paths N]
    python3 tests/acceptance/covariance.py image [--spp N] [--paths N]
    python3 tests/acceptance/covariance.py beams [SCENE...] [--passes N]
    python3 tests/acceptance/covariance.py equal [SCENE...] [--size N]
    python3 tests/acceptance/covariance.py bias [SCENE...]
    python3 tests/acceptance/covariance.py determinism

Needs target/release/fogbow (or what FOGBOW_PROGRAM names), numpy and OpenEXR; scenes are those of examples/scenes at 128x128. Errors are measured against
two independent converged renders A and B: the squared error of an image I is the mean of (I - A)(I - B), over squared
light plus a twentieth of the picture's mean, so that the converged renders' own noise drops out.

steps        nave, light scattered once by the medium: samples and CPU seconds of uniform steps and of --step covariance at
             equal error (at least 5 times fewer, 3 times less; the grid's filling is told apart).
image        lantern, light scattered by the medium, --method march: 43 % of the pixels at most, half the error at most of all pixels with as
             many samples each, less CPU time with the grid's filling, and over 8 seeds a mean off by 1 % at most.
beams        lantern, caustic, nave: relMSE of --kernel covariance over that of progressive beams after equal passes, in the half of
             the picture where the predicted density of samples is below its median (at most 0.5), in the other and in the tenth
             where it is highest, which holds the borders of shafts (at most 1.1), and at equal CPU time (below 1), where progressive
             beams' error is taken to fall with time as measured from half as many passes.
equal        lantern, caustic, nave, two smoke boxes: relMSE of --kernel covariance over that of progressive beams in the CPU time that these take for
             16, 64 and 256 passes, the grid included: at most 1.0, in the lantern 0.6; and the mean of the longest, beside path tracing's.
bias         caustic: mean |relative difference| of blocks of 8x8 pixels in the smooth half of a mean of 8 seeds of --kernel covariance, whose
             pass radius does not narrow, to progressive beams of the same radius, at bounds of 0.32, 0.08, 0.02, 0.005: within the bound and
             two standard errors, and falling with it.
determinism  the same bytes with 1, 2 and 7 threads of every way that uses covariances.

Exit status 1 when a line fails.
"""
import argparse, hashlib, json, os, pathlib, subprocess, sys, tempfile
import numpy as np
import OpenEXR

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = os.environ.get("FOGBOW_PROGRAM") or pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release/fogbow"
FOLDER = pathlib.Path(tempfile.mkdtemp(prefix="fogbow-covariance-"))
MEDIUM = ("medium_single", "medium_multiple")


def render(scene, name, *arguments, size=128):
    image, statistics = FOLDER / f"{name}.exr", FOLDER / f"{name}.json"
    subprocess.run([PROGRAM, "render", ROOT / f"examples/scenes/{scene}.xml", "--size", f"{size}x{size}", "--aov", "-q", "-o", image,
                    "--stats", statistics, *map(str, arguments)], check=True)
    channels = OpenEXR.File(str(image)).channels()

    def layer(name):
        if name in channels:
            return channels[name].pixels[..., :3].astype(float)
        return np.stack([channels[f"{name}.{c}"].pixels for c in "RGB"], -1).astype(float)

    numbers = json.loads(statistics.read_text())
    seconds = {phase: numbers["seconds"][phase]["cpu"] for phase in numbers["seconds"]}
    return layer, seconds, numbers


def light(layer, names=MEDIUM):
    return sum(layer(name) for name in names).mean(-1)


def squared(image, halves, where=None):
    a, b = halves
    mean = 0.5 * (a + b)
    error = (image - a) * (image - b) / (mean ** 2 + (0.05 * mean.mean()) ** 2)
    return float(error[where].mean() if where is not None else error.mean())


def report(name, passed, text):
    print(f"{name:24s} {'ok  ' if passed else 'FAIL'} {text}", flush=True)
    return 0 if passed else 1


def steps(options):
    march = ("--method", "march", "--max-depth", 2)
    one = ("medium_single",)
    halves = [light(render("nave", f"truth-{s}", *march, "--step-length", 0.25, "--spp", 128, "--seed", s)[0], one) for s in (101, 102)]

    def curve(name, ways):
        points = []
        for i, way in enumerate(ways):
            layer, seconds, numbers = render("nave", f"{name}-{i}", *march, "--spp", spp, *way)
            samples = float(layer("steps").mean()) * spp
            error = max(squared(light(layer, one), halves), 1e-9) ** 0.5
            points.append((error, samples, seconds["render"], seconds.get("fill grid", 0.0)))
            print(f"  {name:12s} {' '.join(map(str, way)):40s} error {error:.4f}  {samples:.1f} samples  {seconds['render']:.2f} CPU s")
        return sorted(points)

    uniform = curve("uniform", [("--step-length", length) for length in (1.2, 0.6, 0.3, 0.15, 0.075)])
    spp = options.spp or 4
    grid = ("--grid-paths", options.paths or 1_000_000, "--step-length", 8)
    ours = curve("covariance", [("--step", "covariance", "--step-count", n, *grid) for n in (8, 16, 32)])
    curve("frequency", [("--step", "frequency", *grid)])
    curve("64 against", [("--step", "covariance", *grid, "--grid-cells", n) for n in (32, 128)])
    errors, samples, seconds, _ = map(np.log, np.maximum(np.array(uniform).T, 1e-9))
    failures = 0
    for error, count, cpu, fill in ours:
        if not errors[0] <= np.log(error) <= errors[-1]:
            print(f"  error {error:.4f} is outside what uniform steps reached")
            continue
        fewer = np.exp(np.interp(np.log(error), errors, samples)) / count
        less = np.exp(np.interp(np.log(error), errors, seconds)) / cpu
        failures += report("steps", fewer >= 5 and less >= 3, f"error {error:.4f}: {fewer:.2f} times fewer samples, {less:.2f} times less CPU time "
                           f"(and {fill:.2f} s to fill the grid)")
    return failures


def image(options):
    spp = options.spp or 16
    grid, seeds = FOLDER / "lantern.grid", range(1, 9)
    ours = ("--image-sampling", "covariance", *(("--grid-paths", options.paths) if options.paths else ()))
    shot = lambda name, seed, spp, *ways: render("lantern", f"{name}-{seed}", "--method", "march", "--spp", spp, "--seed", seed, *ways)
    halves = [light(render("lantern", f"truth-{s}", "--spp", 2048, "--seed", s)[0]) for s in (101, 102)]
    first = shot("part", 1, spp, *ours, "--grid-out", grid)
    share = float(first[0]("computed").mean())
    runs = {
        "part": [first, *(shot("part", seed, spp, *ours, "--grid-in", grid) for seed in seeds[1:])],
        "full": [shot("full", seed, spp) for seed in seeds],
        "equal": [shot("equal", seed, max(1, round(share * spp))) for seed in seeds],
    }
    mean = np.mean(halves)
    error, bias = {}, {}
    for name, shots in runs.items():
        lights = [light(layer) for layer, _, _ in shots]
        error[name] = float(np.mean([squared(one, halves) for one in lights])) ** 0.5
        biases = np.array([one.mean() / mean - 1 for one in lights])
        bias[name] = (100 * biases.mean(), 100 * biases.std(ddof=1) / len(biases) ** 0.5)
        print(f"  {name:5s} error {error[name]:.3f}  bias {bias[name][0]:+.2f} ± {bias[name][1]:.2f} %", flush=True)
    part, full = (sum(runs[name][0][1].values()) for name in ("part", "full"))
    passed = share <= 0.43 and error["part"] <= 0.5 * error["full"] and part < full and abs(bias["part"][0]) <= 1 + 2 * bias["part"][1]
    return report("image", passed, f"{100 * share:.1f} % of pixels: error {error['part']:.3f} instead of {error['full']:.3f} (and of {error['equal']:.3f} with "
                  f"as many samples), {part:.2f} CPU s instead of {full:.2f}")


def beams(options):
    failures = 0
    for scene in options.scenes or ("lantern", "caustic", "nave"):
        method, spp = ("--method", "photon-beams"), 8 * options.passes
        truth = (*method, "--spp", 1536, "--radius", {"nave": 0.1}.get(scene, 0.008))
        halves = [light(render(scene, f"{scene}-truth-{s}", *truth, "--seed", s)[0]) for s in (101, 102)]
        plan = render(scene, f"{scene}-plan", "--spp", 1, "--image-sampling", "covariance")[0]
        density = plan("density").mean(-1)
        smooth, borders = density <= np.median(density), density >= np.quantile(density, 0.9)
        early = render(scene, f"{scene}-early", *method, "--spp", spp // 2)
        old = render(scene, f"{scene}-old", *method, "--spp", spp)
        new = render(scene, f"{scene}-new", *method, "--spp", spp, "--kernel", "covariance")
        of = lambda rendered, where: max(squared(light(rendered[0]), halves, where), 1e-9)
        times = [sum(rendered[1].values()) for rendered in (old, new)]
        for name, where, bound in (("smooth half", smooth, 0.5), ("other half", ~smooth, 1.1), ("borders", borders, 1.1)):
            ratio = of(new, where) / of(old, where)
            power = np.log(of(early, where) / of(old, where)) / np.log(2)
            equal = ratio * (times[1] / times[0]) ** power
            passed = ratio <= bound and (equal < 1 or where is not smooth)
            failures += report(f"{scene} {name}", passed, f"relMSE {of(new, where):.4f} instead of {of(old, where):.4f}: ratio {ratio:.2f}, at equal "
                               f"CPU time {equal:.2f} ({times[1]:.1f} s, {times[0]:.1f} s)")
    return failures


def equal(options):
    failures, method, size = 0, ("--method", "photon-beams"), options.size
    for scene in options.scenes or ("lantern", "caustic", "nave", "smoke-box-homogeneous-anisotropic", "smoke-box-heterogeneous-isotropic"):
        shot = lambda name, *ways: render(scene, f"{scene}-{name}", *ways, size=size)
        truth = (*method, "--spp", 2048, "--radius", {"nave": 0.1}.get(scene, 0.008))
        halves = [light(shot(f"truth-{s}", *truth, "--seed", s)[0]) for s in (101, 102)]
        covariance = (*method, "--kernel", "covariance", "--seed", 7)
        trial = shot("trial", *covariance, "--spp", 64)[1]
        grid, each = trial["fill grid"], trial["render"] / 8
        for passes in (16, 64, 256):
            old = shot("old", *method, "--spp", 8 * passes, "--seed", 6)
            time = sum(old[1].values())
            new = shot("new", *covariance, "--spp", 8 * max(round((time - grid) / each), 1))
            found = [max(squared(light(rendered[0]), halves), 1e-9) for rendered in (new, old)]
            ratio, bound = found[0] / found[1], 0.6 if scene == "lantern" else 1.0
            failures += report(f"{scene} {passes} passes", ratio <= bound, f"relMSE {found[0]:.5f} instead of {found[1]:.5f}: {ratio:.2f} "
                               f"({sum(new[1].values()):.1f} s, {time:.1f} s)")
        if scene == "caustic":
            continue  # Paths from the eye never meet its lamp, which is a point behind glass.
        paths = [light(shot(f"paths-{s}", "--method", "path", "--spp", 512, "--seed", s)[0]).mean() for s in (201, 202)]
        known = np.mean(paths)
        means = light(new[0]).mean(), light(old[0]).mean(), np.mean(halves)
        print(f"  {scene}: off path tracing's mean by " + ", ".join(f"{100 * (mean / known - 1):+.2f} %" for mean in means) +
              f" (covariance, progressive, truth; halves of path tracing differ by {100 * abs(paths[0] / paths[1] - 1):.2f} %)", flush=True)
    return failures


def bias(options):
    failures = 0
    for scene in options.scenes or ("caustic",):
        method, seeds = ("--method", "photon-beams", "--alpha", 1, "--spp", 64), range(1, 9)
        density = render(scene, f"{scene}-plan", "--spp", 1, "--image-sampling", "covariance")[0]("density").mean(-1)
        blocks = lambda image: image.reshape(16, 8, 16, 8).mean((1, 3))
        smooth = blocks(density) <= np.median(blocks(density))

        def mean(name, *ways):
            found = np.array([blocks(light(render(scene, name, *method, *ways, "--seed", seed)[0])) for seed in seeds])
            return found.mean(0), found.std(0, ddof=1) / len(seeds) ** 0.5

        truth, own = mean("old")
        scale = truth + 0.05 * truth.mean()
        last = np.inf
        for bound in (0.32, 0.08, 0.02, 0.005):
            image, spread = mean("new", "--kernel", "covariance", "--bias", bound)
            found = np.abs(image - truth)[smooth] / scale[smooth]
            # Mean of |noise| were there no bias: √(2/π) standard errors.
            noise = 0.8 * (np.hypot(spread, own) / scale)[smooth].mean()
            passed = found.mean() <= bound + 2 * noise and found.mean() <= last + noise
            failures += report(f"{scene}, bound {bound}", passed, f"off by {100 * found.mean():.2f} % in the mean of smooth blocks, of which about "
                               f"{100 * noise:.2f} % is noise")
            last = found.mean()
    return failures


def determinism(_):
    ways = {
        "march": ("--method", "march", "--step", "covariance"),
        "beams": ("--method", "photon-beams", "--kernel", "covariance"),
        "image": ("--method", "path", "--image-sampling", "covariance"),
    }
    failures = 0
    for name, way in ways.items():
        found = set()
        for threads in (1, 2, 7):
            render("noise-box", name, *way, "--spp", 8, "--grid-paths", 20000, "--threads", threads)
            found.add(hashlib.sha256((FOLDER / f"{name}.exr").read_bytes()).hexdigest())
        failures += report(name, len(found) == 1, f"{len(found)} different files with 1, 2 and 7 threads")
    return failures


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("steps", "image", "beams", "equal", "bias", "determinism"))
    parser.add_argument("scenes", nargs="*")
    parser.add_argument("--spp", type=int, help="samples per pixel [default: steps 4, image 16]")
    parser.add_argument("--paths", type=int, help="photons of the grid [default: steps 1000000, image what the program takes]")
    parser.add_argument("--passes", type=int, default=8)
    parser.add_argument("--size", type=int, default=64, help="of equal [default: 64]")
    options = parser.parse_args()
    return 1 if globals()[options.what](options) else 0


if __name__ == "__main__":
    sys.exit(main())
