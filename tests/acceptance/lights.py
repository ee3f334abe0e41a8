#!/usr/bin/env python3
"""Time to equal noise under 10 to 10 000 lamps: a foggy box, path tracing and radiance caching; half an hour, not part of CI.

    python3 tests/acceptance/lights.py PROGRAM [PROGRAM ...] [--counts 10,100,1000,10000] [--kinds point,sphere] [--methods path,cache]
                                       [--seconds 20] [--folder FOLDER] [--plot FILE.svg] [--scene FILE.xml]

Several programs take turns. The lamps lie evenly at random in the box and send as much light together, whatever their number. A row tells CPU seconds of the
fill and of a sample of the picture, the noise of a sample (from two pictures of other seeds), and from both the seconds to 2 %.
--seconds bounds each run. --scene takes a scene instead.
"""
import argparse, json, math, os, random, subprocess, tempfile
from plot import plot

HEAD = """<scene version="3.0.0">
  <medium type="homogeneous" id="fog"><float name="sigma_t" value="1"/><rgb name="albedo" value="0.9 0.9 0.9"/><float name="scale" value="1"/><phase type="isotropic"/></medium>
  <integrator type="volpath"><boolean name="hide_emitters" value="true"/><integer name="max_depth" value="-1"/><integer name="rr_depth" value="20"/></integrator>
  <sensor type="perspective">
    <float name="fov" value="36"/><string name="fov_axis" value="x"/><float name="near_clip" value="0.001"/><float name="far_clip" value="1000"/>
    <transform name="to_world"><lookat origin="0, 0, 4" target="0, 0, 0" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="64"/><integer name="height" value="64"/>
      <string name="pixel_format" value="rgb"/><string name="component_format" value="float32"/><rfilter type="box"/></film>
    <sampler type="independent"><integer name="sample_count" value="64"/></sampler>
  </sensor>
  <shape type="cube"><transform name="to_world"><scale value="1.001"/></transform><bsdf type="null"/><ref name="interior" id="fog"/></shape>
"""


def wall(steps, reflectance):
    bsdf = f'<bsdf type="diffuse"><rgb name="reflectance" value="{reflectance}"/></bsdf>'
    return f'  <shape type="rectangle"><transform name="to_world">{steps}</transform>{bsdf}</shape>\n'


def scene(count, kind):
    """The box with `count` lamps: points, or balls that are the smaller the more there are."""
    out = HEAD
    for steps, reflectance in [
        ('<rotate x="1" angle="-90"/><translate y="-1"/>', "0.7 0.7 0.7"),
        ('<rotate x="1" angle="90"/><translate y="1"/>', "0.7 0.7 0.7"),
        ('<translate z="-1"/>', "0.7 0.7 0.7"),
        ('<rotate y="1" angle="90"/><translate x="-1"/>', "0.63 0.1 0.08"),
        ('<rotate y="1" angle="-90"/><translate x="1"/>', "0.14 0.45 0.1"),
    ]:
        out += wall(steps, reflectance)
    out += ('  <shape type="cube"><transform name="to_world"><scale x="0.3" y="0.6" z="0.3"/><rotate y="1" angle="25"/><translate x="0.3" y="-0.4" z="-0.25"/></transform>'
            '<bsdf type="diffuse"><rgb name="reflectance" value="0.6 0.6 0.65"/></bsdf></shape>\n')
    rng, intensity = random.Random(1), 16.0 / count
    while count > 0:
        x, y, z = (rng.uniform(-0.95, 0.95) for _ in range(3))
        if math.hypot(x - 0.3, z + 0.25) < 0.5 and y < 0.25:
            continue   # not in the block
        count -= 1
        colour = [intensity * rng.uniform(0.5, 1.5) for _ in range(3)]
        if kind == "point":
            out += (f'  <emitter type="point"><point name="position" x="{x:.6g}" y="{y:.6g}" z="{z:.6g}"/>'
                    f'<rgb name="intensity" value="{" ".join(f"{c:.6g}" for c in colour)}"/></emitter>\n')
        else:
            radius = 0.05 * (intensity / 16.0) ** (1 / 2.0)
            radiance = " ".join(f"{c / (math.pi * radius * radius):.6g}" for c in colour)
            out += (f'  <shape type="sphere"><point name="center" x="{x:.6g}" y="{y:.6g}" z="{z:.6g}"/><float name="radius" value="{radius:.6g}"/>'
                    f'<bsdf type="diffuse"><rgb name="reflectance" value="0 0 0"/></bsdf><emitter type="area"><rgb name="radiance" value="{radiance}"/></emitter></shape>\n')
    return out + "</scene>\n"


def read(path):
    """The mean of the channels of every pixel."""
    import numpy
    with open(path, "rb") as file:
        file.readline()
        width, height = map(int, file.readline().split())
        scale = float(file.readline())
        return numpy.frombuffer(file.read(), ("<" if scale < 0 else ">") + "f4").reshape(height, width, 3).astype(float).mean(axis=2)


def run(program, file, options, seed, folder):
    """-> picture, seconds before the samples, seconds of samples, samples of a pixel"""
    picture, stats = os.path.join(folder, "picture.pfm"), os.path.join(folder, "stats.json")
    subprocess.run([program, "render", file, *options, "--seed", str(seed), "--threads", "1", "--quiet", "-o", picture, "--stats", stats],
                   check=True, capture_output=True)
    with open(stats) as opened:
        told = json.load(opened)
    fill = sum(time["cpu"] or 0.0 for phase, time in told["seconds"].items() if phase.startswith("fill"))
    render = told["seconds"]["render"]["cpu"]
    return read(picture), fill, render, told["samples_per_pixel"]


def measure(program, file, method, seconds, size, folder):
    """-> seconds of fill, of a sample of a pixel, relative noise of a picture with one, mean"""
    options = ["--size", size, "--time", str(seconds), "--spp", "100000"]
    options += ["--method", "path"] if method == "path" else ["--method", "radiance-cache"]
    runs = [run(program, file, options, seed, folder) for seed in (1, 2)]
    (a, *first), (b, *second) = runs
    fill, render, samples = ((x + y) / 2 for x, y in zip(first, second))
    mean = ((a + b) / 2).mean()
    # A pixel in a thousand may hold a spike that says more of luck than of the method.
    import numpy
    squares = numpy.sort(((a - b) ** 2 / 2).ravel())
    noise2 = squares[: len(squares) - len(squares) // 1000].mean() / ((a + b) / 2).mean() ** 2
    return fill, render / samples, math.sqrt(noise2 * samples), mean


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("programs", nargs="+")
    parser.add_argument("--counts", default="10,100,1000,10000")
    parser.add_argument("--kinds", default="point,sphere")
    parser.add_argument("--methods", default="path,cache")
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--size", default="64x64")
    parser.add_argument("--folder")
    parser.add_argument("--plot")
    parser.add_argument("--scene")
    arguments = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.folder or temporary
        os.makedirs(folder, exist_ok=True)
        print(f"{'scene':>14} {'method':>6} {'program':>10}  {'fill':>8} {'sample':>9} {'noise':>8} {'to 2 %':>9}  mean")
        for kind in arguments.kinds.split(","):
            for count in [0] if arguments.scene else map(int, arguments.counts.split(",")):
                file = arguments.scene or os.path.join(folder, f"{kind}-{count}.xml")
                if not arguments.scene:
                    with open(file, "w") as opened:
                        opened.write(scene(count, kind))
                for method in arguments.methods.split(","):
                    for program in arguments.programs:
                        fill, sample, noise, mean = measure(program, file, method, arguments.seconds, arguments.size, temporary)
                        seconds = fill + sample * (noise / 0.02) ** 2
                        rows.append((f"{kind}, {method}, {program}", count or 1, seconds))
                        print(f"{os.path.basename(file)[:-4]:>14} {method:>6} {program[-10:]:>10}  {fill:7.2f}s {sample:8.4f}s {100 * noise:7.1f}% {seconds:8.2f}s  {mean:.5f}", flush=True)
    if arguments.plot:
        series = {}
        for name, count, seconds in rows:
            series.setdefault(name, []).append((count, seconds))
        plot(series, arguments.plot, "s")


if __name__ == "__main__":
    main()
