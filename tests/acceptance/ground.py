#!/usr/bin/env python3
"""Holds the path tracer against an independent renderer: long runs, not part of CI.

    FOGBOW_REFERENCE=FOLDER python3 tests/acceptance/ground.py accuracy [SCENE...]
    FOGBOW_REFERENCE=FOLDER python3 tests/acceptance/ground.py speed    [SCENE...]

FOLDER holds compare.py, peer.py and public/ with scenes and their references. `accuracy` needs numpy;
`speed` also the peer (pip install mitsuba==3.9.1; where its compiler
stumbles over the processor, DRJIT_LIBLLVM_PATH names another libLLVM). Build first: cargo build --release.

accuracy  every scene: |bias| <= 0.4 %, no 16x16 block beyond 5 combined standard errors. Point scenes: bias only
          (their variance is infinite). nave-shafts, lantern: |bias| <= 1 %, at most 3 % of blocks beyond 3.
speed     ours and the peer in turns, in one run: c^2 = relRMSE_c^2 * CPU seconds, and the ratio ours / peer.

Exit status 1 when a line fails.
"""
import sys
import numpy as np
from common import compare, every_scene, verdict
import common

SAMPLES = {"nave-shafts": 1024, "lantern": 1024}  # heavy tails; 512 elsewhere


def render(scene, samples, seed):
    """-> image, CPU seconds of the rendering itself"""
    image, statistics = common.render(scene, "--method", "path", "--spp", samples, "--seed", seed)
    return image, common.cpu(statistics)


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
        print(f"{scene:24s} {verdict(passes)} bias {100 * result['bias']:+.3f} % ({result['bias_sigma']:+.1f} s.e.)  "
              f"worst block {result['block_sigma_max']:.2f} s.e. ({100 * result['block_rel_max']:.1f} %), {100 * beyond:.1f} % beyond 3  "
              f"relRMSE_c {result['relRMSE_c']:.4f}  {seconds:.1f} CPU s", flush=True)
    return failures


def speed(scenes):
    failures, turns = 0, 3
    for scene in scenes:
        mean, error, _ = compare.load_ref(scene)
        ours, theirs = [], []
        for turn in range(turns):
            image, seconds = render(scene, 64, 100 + turn)
            ours.append((compare.stats(image, mean, error)["relMSE"], seconds))
            image, seconds = common.peer_run(scene, 64, 200 + turn)
            theirs.append((compare.stats(image, mean, error)["relMSE"], seconds))
        floor = compare.stats(mean, mean, error)["floor"] ** 2

        def efficiency(runs):
            return (np.mean([r[0] for r in runs]) - floor) * np.mean([r[1] for r in runs])

        ratio = efficiency(ours) / efficiency(theirs)
        failures += ratio >= 1
        print(f"{scene:24s} {verdict(ratio < 1)} ours: c^2 {efficiency(ours):.4f} ({np.mean([r[1] for r in ours]):.2f} CPU s)  "
              f"peer: {efficiency(theirs):.4f} ({np.mean([r[1] for r in theirs]):.2f} CPU s)  ratio {ratio:.3f}", flush=True)
    return failures


if __name__ == "__main__":
    what = {"accuracy": accuracy, "speed": speed}.get(sys.argv[1] if len(sys.argv) > 1 else "")
    if what is None:
        sys.exit(__doc__)
    every = every_scene()
    if what is speed:
        every = [name for name in every if not name.startswith("point-")]
    sys.exit(min(what(sys.argv[2:] or every), 1))
