#!/usr/bin/env python3
"""Does the audit of radiance caching tell the truth?

  FOGBOW_REFERENCE=FOLDER python tests/acceptance/audit.py truth [SCENE ...] [--error E] [--seed N] [--seconds S]
  FOGBOW_REFERENCE=FOLDER python tests/acceptance/audit.py broken [SCENE ...] [--error E]

SCENE: a name of the references, or a file; without any, all references and all scenes of the matrix (its make.py is run).

truth:  the bias that a render states for what is cached, against that of its picture: from the stored reference, or from two path traced pictures of S CPU
        seconds (on one thread) each. At least 97 % within three standard errors, of statement and truth together.
broken: caches that were saved are spoiled in the file and read again: light of one scaled by 0.9, gradients turned round, one wild record; and a
        tolerance of 10. Where the picture is off because of it, that must be said, and what finer records can mend must be mended: bounds of radii and
        pilots see to it that a large tolerance alone does little in a box. (Walks cut after two vertices: `cargo test -p fogbow audit`.)
"""
import argparse, lzma, os, shutil, struct, subprocess, sys, tempfile
import numpy as np
import common
from common import compare, cpu, matrix, path_of, render, verdict

CACHED = ("--method", "radiance-cache")
KINDS = ("single", "surface", "multiple", "irradiance", "coarse irradiance")
BROKEN = ["cornell-homog-iso", "cornell-hetero-hg06"]

# A picture whose error is so many times that of right caches is off; repaired, it must be less, or near the error asked for.
WORSE = 1.5


def traced(scene, seconds, store):
    """Two path traced pictures of about so many CPU seconds each."""
    name = os.path.splitext(os.path.basename(scene))[0]
    pictures = []
    for seed in (7001, 7002):
        file = os.path.join(store, f"{name}-{seconds:g}-{seed}.npy")
        if not os.path.exists(file):
            _, trial = render(scene, "--method", "path", "--spp", 4, "--threads", 1)
            samples = max(int(4 * seconds / max(cpu(trial), 1e-3)), 4)
            image, _ = render(scene, "--method", "path", "--spp", samples, "--seed", seed, "--threads", 1)
            os.makedirs(store, exist_ok=True)
            np.save(file, image)
        pictures.append(np.load(file))
    return pictures


def spread(image):
    """Standard error of the sum of independent pixels, from neighbours, over the sum: what changes from pixel to pixel counts as noise."""
    light = image.mean(2)
    square = np.mean((light[:, 1:] - light[:, :-1]) ** 2) / 2
    return np.sqrt(square * light.size) / light.sum()


def truth(scenes, arguments):
    cases, held = 0, 0
    for scene in scenes or common.every_scene() + matrix(os.path.join(arguments.store, "matrix")):
        image, statistics = render(scene, *CACHED, "--error", arguments.error, "--seed", arguments.seed, "--spp", arguments.spp)
        if statistics.get("audit", {}).get("cached", {}).get("error") is None:
            print(f"{os.path.basename(scene):24s} --    {statistics['method']}: nothing is cached", flush=True)
            continue
        stated = statistics["audit"]["cached"]
        if scene.endswith(".xml"):
            first, second = traced(scene, arguments.seconds, arguments.store)
            mean = (first + second) / 2
            # Between two halves, and as pixels say: either alone may be too small.
            error = max(abs(first.sum() / second.sum() - 1) / 2, spread(mean))
        else:
            mean, of_pixels, _ = compare.load_ref(scene)
            error = np.sqrt((of_pixels.mean(2) ** 2).sum()) / mean.mean(2).sum()
        bias = image.sum() / mean.sum() - 1
        # Light that is not cached has noise of its own: as of as many path traced samples at most.
        noise = spread(image - compare.smooth(image) + image.mean())
        known = np.sqrt(error**2 + noise**2 + stated["error"] ** 2)
        passes = abs(stated["bias"] - bias) <= 3 * known
        cases, held = cases + 1, held + passes
        print(f"{os.path.basename(scene):24s} {verdict(passes)} stated {100 * stated['bias']:+.2f} ± {100 * stated['error']:.2f} %  true {100 * bias:+.2f} "
              f"± {100 * np.hypot(error, noise):.2f} %  ({abs(stated['bias'] - bias) / known:.1f} s.e.)  repaired {len(statistics['audit']['repaired'])}", flush=True)
    print(f"{held} of {cases} within three standard errors ({100 * held / max(cases, 1):.0f} %)")
    return held < 0.97 * cases


def crc64(data):
    """CRC-64/XZ: what an .xz file keeps of its only block, before the index that its footer tells the length of."""
    packed = lzma.compress(data, check=lzma.CHECK_CRC64, preset=0)
    index = 4 * (struct.unpack_from("<I", packed, len(packed) - 8)[0] + 1)
    return packed[len(packed) - 12 - index - 8 : len(packed) - 12 - index]


def spoiled(file, spoil):
    """Lets `spoil(kind, records, attachments)` change what a file of caches holds."""
    with open(file, "rb") as f:
        data = bytearray(f.read())
    parts, views = struct.unpack_from("<II", data, 12)
    at = 40 + 40 * parts + 8 * views
    for part in range(parts):
        row = 40 + 40 * part
        kind, length = struct.unpack_from("<I", data, row)[0], struct.unpack_from("<Q", data, row + 32)[0]
        stride, count = struct.unpack_from("<II", data, at + 16)
        floats = np.frombuffer(data, "<f4", (length - 40) // 4, at + 40)
        records, attached = floats[: 16 * count].reshape(count, 16), floats[16 * count :].reshape(count, stride, 12)
        spoil(KINDS[kind], records, attached)
        del floats, records, attached
        data[at + 32 : at + 40] = crc64(bytes(data[at : at + 32] + data[at + 40 : at + length]))
        at += length
    with open(file, "wb") as f:
        f.write(data)


def darker(kind, records, attached):
    if kind == "multiple":
        records[:, 4:] *= np.float32(0.9)
        attached *= np.float32(0.9)


def turned(kind, records, attached):
    if kind in ("surface", "multiple", "irradiance"):
        records[:, 7:] *= -1


def wild(kind, records, _):
    if kind == "multiple":
        # One that many pixels see, a hundred times too bright.
        records[records[:, 3].argmax(), 4:] *= 100


def is_off(audit, error):
    """Whether an audit says that a picture is off by more than that, as a whole or in a region."""
    regions = [region["cached"] for region in audit["regions"]["by_row"]]
    # As many regions as there are may be off by chance.
    by_region = np.sqrt(9 + 2 * np.log(max(len(regions), 1)))
    found = [(audit["cached"], 3), (audit["all"], 3), *((region, by_region) for region in regions)]
    return has_blotches(audit, error) or any(f["error"] is not None and abs(f["bias"]) - sure * f["error"] > error for f, sure in found)


def has_blotches(audit, error):
    """Whether it says that what is cached has a greater error, with or without a mean."""
    squared = audit["squared"]
    return squared["error"] is not None and squared["mean"] - 3 * squared["error"] > error**2


def broken(scenes, arguments):
    failures, error = 0, arguments.error
    for scene in scenes or BROKEN:
        truth = common.Stored(scene)
        off = lambda image: np.sqrt(max(truth.relative_square(image), 0))
        with tempfile.TemporaryDirectory() as folder:
            right = os.path.join(folder, "right.cache")
            usual = (*CACHED, "--error", error, "--spp", 32)
            least = off(render(scene, *usual, "--audit", 0, "--cache-out", right)[0])
            cases = {"nothing": (None, ()), "0.9 times the light": (darker, ()), "gradients turned round": (turned, ()),
                     "a wild record": (wild, ()), "a tolerance of 10": (None, ("--tolerance", 10))}
            for what, (spoil, options) in cases.items():
                images = []
                # As it is without an audit, and after one with what it has repaired.
                for rays in (0, arguments.rays):
                    known = ()
                    if not options:
                        file = os.path.join(folder, "spoiled.cache")
                        shutil.copyfile(right, file)
                        if spoil:
                            spoiled(file, spoil)
                        known = ("--cache-in", file)
                    image, statistics = render(scene, *usual, "--audit", rays, *known, *options)
                    images.append(off(image))
                audit = statistics["audit"]
                is_left = is_off(audit, error)
                told = (audit["repaired"] or [audit])[0]
                first, root = told["cached"], np.sqrt(max(told["squared"]["mean"], 0))
                # Also of what is less than the error asked for it tells the bias.
                is_said = bool(audit["repaired"]) or is_left or abs(first["bias"]) > 3 * first["error"]
                is_true, bound = images[0] > WORSE * least, max(WORSE * least, 1.25 * error)
                passes = (not is_said) if what == "nothing" else (is_said or not is_true) and not is_left and images[1] <= bound
                failures += not passes
                print(f"{os.path.basename(scene):24s} {verdict(passes)} {what:24s} error {100 * images[0]:.1f} % instead of {100 * least:.1f} %; "
                      f"{'said' if is_said else 'not said'}: bias {100 * first['bias']:+.2f} ± {100 * first['error']:.2f} %, error {100 * root:.1f} %; after {len(audit['repaired'])} repairs "
                      f"{100 * audit['cached']['bias']:+.2f} ± {100 * audit['cached']['error']:.2f} %, error {100 * images[1]:.1f} % (stated {100 * np.sqrt(max(audit['squared']['mean'], 0)):.1f} ± {100 * np.sqrt(audit['squared']['error']) if audit['squared']['error'] else 0:.1f} %)", flush=True)
    return failures


if __name__ == "__main__":
    what = {f.__name__: f for f in (truth, broken)}
    parser = argparse.ArgumentParser(usage=__doc__.replace("%", "%%"))
    parser.add_argument("what", choices=what)
    parser.add_argument("scenes", nargs="*", metavar="SCENE")
    parser.add_argument("--error", type=float, default=0.05)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--rays", type=int, default=1 << 15)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--store", default=os.path.join(tempfile.gettempdir(), "fogbow-acceptance"))
    arguments = parser.parse_args()
    sys.exit(min(int(what[arguments.what](arguments.scenes, arguments)), 1))
