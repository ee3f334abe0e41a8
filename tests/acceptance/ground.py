#!/usr/bin/env python3
"""Holds the path tracer against an independent renderer: long runs, not part of CI.

    FOGBOW_REFERENCE=FOLDER python3 tests/acceptance/ground.py accuracy [SCENE...]
    FOGBOW_REFERENCE=FOLDER python3 tests/acceptance/ground.py speed    [SCENE...]

FOLDER holds compare.py, peer.py and public/ with scenes and their references. `accuracy` needs numpy;
`speed` also the peer (pip install mitsuba==3.9.1). Build first: cargo build --release.

accuracy  every scene: |bias| <= 0.4 %, no 16x16 block beyond 5 combined standard errors. Point scenes: bias only
          (their variance is infinite). nave-shafts, lantern: |bias| <= 1 %, at most 3 % of blocks beyond 3.
speed     ours and the peer in turns, in one run: c^2 = relRMSE_c^2 * CPU seconds, and the ratio ours / peer.

Exit status 1 when a line fails.
"""
import json, os, subprocess, sys, tempfile
import numpy as np

REFERENCE = os.environ.get("FOGBOW_REFERENCE") or sys.exit("FOGBOW_REFERENCE names no folder")
sys.path.insert(0, REFERENCE)
import compare  # noqa: E402

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
PROGRAM = os.path.join(os.environ.get("CARGO_TARGET_DIR", os.path.join(ROOT, "target")), "release", "fogbow")
PUBLIC = os.path.join(REFERENCE, "public")
SAMPLES = {"nave-shafts": 1024, "lantern": 1024}  # heavy tails; 512 elsewhere


def render(scene, samples, seed):
    """-> image, CPU seconds of the rendering itself"""
    with tempfile.TemporaryDirectory() as folder:
        image, stats = os.path.join(folder, "image.pfm"), os.path.join(folder, "stats.json")
        subprocess.run([PROGRAM, "render", os.path.join(PUBLIC, scene + ".xml"), "--method", "path", "--spp", str(samples),
                        "--seed", str(seed), "-o", image, "--stats", stats, "--quiet"], check=True)
        with open(stats) as file:
            return compare.read_image(image), json.load(file)["seconds"]["render"]["cpu"]


def share_beyond(image, mean, error, sigmas):
    """Share of blocks and channels that differ by more than so many combined standard errors."""
    difference = image - mean
    own = np.zeros_like(difference)
    own[:, :-1] = (difference[:, 1:] - difference[:, :-1]) ** 2 / 2
    own[:, -1] = own[:, -2]
    own = np.maximum(own - error**2, 0)
    count = compare.blocks(image).shape[2]
    spread = np.sqrt((compare.blocks(error**2).mean(2) + compare.blocks(own).mean(2)) / count)
    apart = np.abs(compare.blocks(image).mean(2) - compare.blocks(mean).mean(2))
    return np.mean(np.where(spread > 0, apart / np.maximum(spread, 1e-300), 0) > sigmas)


def accuracy(scenes):
    failures = 0
    for scene in scenes:
        mean, error, kind = compare.load_ref(scene)
        image, seconds = render(scene, SAMPLES.get(scene, 512), 1)
        result = compare.stats(image, mean, error)
        beyond = share_beyond(image, mean, error, 3)
        is_heavy = scene in SAMPLES
        passes = abs(result["bias"]) <= (0.01 if is_heavy else 0.004)
        if kind != "exact":
            passes &= beyond <= 0.03 if is_heavy else result["block_sigma_max"] <= 5
        failures += not passes
        print(f"{scene:24s} {'ok  ' if passes else 'FAIL'} bias {100 * result['bias']:+.3f} % ({result['bias_sigma']:+.1f} s.e.)  "
              f"worst block {result['block_sigma_max']:.2f} s.e. ({100 * result['block_rel_max']:.1f} %), {100 * beyond:.1f} % beyond 3  "
              f"relRMSE_c {result['relRMSE_c']:.4f}  {seconds:.1f} CPU s", flush=True)
    return failures


def speed(scenes):
    import peer
    failures, turns = 0, 3
    for scene in scenes:
        mean, error, _ = compare.load_ref(scene)
        ours, theirs = [], []
        for turn in range(turns):
            image, seconds = render(scene, 64, 100 + turn)
            ours.append((compare.stats(image, mean, error)["relMSE"], seconds))
            image, _, seconds = peer.run(scene, 64, "llvm_ad_rgb", seed=200 + turn)
            theirs.append((compare.stats(image, mean, error)["relMSE"], seconds))
        floor = compare.stats(mean, mean, error)["floor"] ** 2

        def efficiency(runs):
            return (np.mean([r[0] for r in runs]) - floor) * np.mean([r[1] for r in runs])

        ratio = efficiency(ours) / efficiency(theirs)
        failures += ratio >= 1
        print(f"{scene:24s} {'ok  ' if ratio < 1 else 'FAIL'} ours: c^2 {efficiency(ours):.4f} ({np.mean([r[1] for r in ours]):.2f} CPU s)  "
              f"peer: {efficiency(theirs):.4f} ({np.mean([r[1] for r in theirs]):.2f} CPU s)  ratio {ratio:.3f}", flush=True)
    return failures


if __name__ == "__main__":
    what = {"accuracy": accuracy, "speed": speed}.get(sys.argv[1] if len(sys.argv) > 1 else "")
    if what is None:
        sys.exit(__doc__)
    every = sorted(name[:-4] for name in os.listdir(PUBLIC) if name.endswith(".xml"))
    if what is speed:
        every = [name for name in every if not name.startswith("point-")]
    sys.exit(min(what(sys.argv[2:] or every), 1))
