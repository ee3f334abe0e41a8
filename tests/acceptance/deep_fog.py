"""Fog many free paths deep, where path tracing has 20 to 80 % of noise: pictures against walks of light by a program of their own.

python3 deep_fog.py [THICKNESS:ALBEDO …] [--seconds 60] [--seed 0] [-- OPTION …]   (options of `fogbow render`; `--method radiance-cache --audit 0` unless given)

`cargo run --release -p fogbow-tests --example deep_fog` is the program (FOGBOW_DEEP_FOG names one that is built)."""
import argparse, os, subprocess, sys, tempfile
import numpy as np
from common import ROOT, compare, cpu, render, verdict

SCENE = """<scene version="3.0.0">
  <medium type="homogeneous" id="fog"><float name="sigma_t" value="{extinction}"/><float name="albedo" value="{albedo}"/></medium>
  <sensor type="perspective"><float name="fov" value="36"/><transform name="to_world"><lookat origin="0, 0, 4" target="0, 0, 0" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="64"/><integer name="height" value="64"/><rfilter type="box"/></film></sensor>
  <shape type="cube"><transform name="to_world"><scale value="1.001"/></transform><bsdf type="null"/><ref name="interior" id="fog"/></shape>
{walls}
  <shape type="cube"><transform name="to_world"><scale x="0.3" y="0.6" z="0.3"/><rotate y="1" angle="25"/><translate x="0.3" y="-0.4" z="-0.25"/></transform>
    <bsdf type="diffuse"><rgb name="reflectance" value="0.6 0.6 0.65"/></bsdf></shape>
  <shape type="rectangle"><transform name="to_world"><scale x="0.35" y="0.35" z="1"/><rotate x="1" angle="90"/><translate y="0.995"/></transform>
    <bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf><emitter type="area"><rgb name="radiance" value="20 18 15"/></emitter></shape>
</scene>"""
GREY = "0.7 0.7 0.7"
WALLS = (('<rotate x="1" angle="-90"/><translate y="-1"/>', GREY), ('<rotate x="1" angle="90"/><translate y="1"/>', GREY), ('<translate z="-1"/>', GREY),
         ('<rotate y="1" angle="90"/><translate x="-1"/>', "0.63 0.1 0.08"), ('<rotate y="1" angle="-90"/><translate x="1"/>', "0.14 0.45 0.1"))
WALL = '  <shape type="rectangle"><transform name="to_world">{0}</transform><bsdf type="diffuse"><rgb name="reflectance" value="{1}"/></bsdf></shape>'
WORDS = "thickness {0:>4} albedo {1:<6} {2} bias {3:+.2f} %, error {4:.2f} %, blocks {5:.2f} % (worst {6:+.1f} ± {7:.1f}), truth known to {8:.2f} %, {9:.1f} CPU s"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("fogs", nargs="*", default=["8:0.97", "25:0.985", "30:0.995", "60:0.999", "80:0.95"])
    parser.add_argument("--seconds", default="60")
    parser.add_argument("--seed", type=int, default=0)
    words = sys.argv[1:]
    options = words[words.index("--") + 1 :] if "--" in words else ["--method", "radiance-cache", "--audit", "0"]
    arguments = parser.parse_args(words[: words.index("--")] if "--" in words else words)
    program = os.environ.get("FOGBOW_DEEP_FOG")
    program = [program] if program else ["cargo", "run", "--release", "--quiet", "--manifest-path", os.path.join(ROOT, "Cargo.toml"), "-p", "fogbow-tests", "--example", "deep_fog", "--"]
    failures = 0
    with tempfile.TemporaryDirectory() as folder:
        for fog in arguments.fogs:
            thickness, albedo = fog.split(":")
            scene, images = os.path.join(folder, "box.xml"), [os.path.join(folder, f"{half}.pfm") for half in (1, 2)]
            with open(scene, "w") as file:
                file.write(SCENE.format(extinction=float(thickness) / 2, albedo=albedo, walls="\n".join(WALL.format(*wall) for wall in WALLS)))
            for half, image in enumerate(images):
                subprocess.run([*program, thickness, albedo, arguments.seconds, str(1000 + half), image], check=True, stdout=subprocess.DEVNULL)
            halves = np.array([compare.read_image(image) for image in images])
            image, statistics = render(scene, *options, "--seed", arguments.seed)
            failures += not judge(thickness, albedo, image, halves, cpu(statistics))
    return failures


def judge(thickness, albedo, image, halves, seconds):
    truth = halves.mean(0)
    blocks = lambda picture: picture.mean(2).reshape(8, 8, 8, 8).mean((1, 3))
    scale = np.maximum(blocks(truth), 0.05 * truth.mean())
    off, noise = (blocks(image) - blocks(truth)) / scale, abs(blocks(halves[0]) - blocks(halves[1])) / 2 / scale
    bias = image.mean() / truth.mean() - 1
    error = np.sqrt(max(0, ((image - halves[0]) * (image - halves[1])).mean() / (halves[0] * halves[1]).mean()))
    worst = np.unravel_index(np.argmax(abs(off) - 2 * noise), off.shape)
    holds = abs(bias) <= 0.01 and error <= 0.03 and abs(off[worst]) - 2 * noise[worst] <= 0.05
    print(WORDS.format(thickness, albedo, verdict(holds), 100 * bias, 100 * error, 100 * np.sqrt((off**2).mean()), 100 * off[worst], 100 * noise[worst],
                       100 * np.sqrt((noise**2).mean()), seconds), flush=True)
    return holds


if __name__ == "__main__":
    raise SystemExit(main())
