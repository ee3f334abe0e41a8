#!/usr/bin/env python3
"""Sparse volumes: a cloud of 1 000³ voxels of which 2 % are filled. What it takes to read, in memory, and what a collision costs beside
a dense grid of 64³ cells of about the same optical thickness.

    apt-get install python3-openvdb libnanovdb-tools
    tests/acceptance/volumes.py [FOLDER]

The folder (by default a temporary one) keeps the cloud, which takes two minutes to make.
"""
import json
import os
import pathlib
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parents[2]
# Thick, so that collisions are what takes time: what a ray through empty space costs is another matter.
SPARSE = ["cloud.vdb", "cloud.nvdb", "cloud-blosc.nvdb", "cloud-zip.nvdb", "cloud-fp16.nvdb"]
MEMORY = 400  # MB, at most
SLOWER = 1.5  # times, per collision

MAKE = r"""
import sys
import numpy as np
import pyopenvdb as vdb

# Puffs: balls with ripples, until a fiftieth of all voxels is filled.
SIDE = 1000
rng = np.random.default_rng(7)
grid = vdb.FloatGrid()
grid.name = "density"
filled, wanted = 0, 0.02 * SIDE ** 3
# Along a helix, so that they touch and still leave most of the box empty.
puffs = []
turn = 0.0
while filled < wanted:
    radius = int(rng.uniform(20, 60))
    turn += 0.35
    middle = np.array([500 + 380 * np.cos(turn), 500 + 380 * np.sin(turn * 0.77), 500 + 380 * np.sin(turn * 1.31)]) + rng.normal(0, 25, 3)
    low = np.clip(middle - radius, 0, SIDE).astype(int)
    high = np.clip(middle + radius, 0, SIDE).astype(int)
    x, y, z = np.meshgrid(*(np.arange(l, h) for l, h in zip(low, high)), indexing="ij")
    r = np.sqrt((x - middle[0]) ** 2 + (y - middle[1]) ** 2 + (z - middle[2]) ** 2) / radius
    v = np.clip(1.2 * (1 - r), 0, 1) * (0.75 + 0.25 * np.sin(x * 0.31) * np.sin(y * 0.23) * np.sin(z * 0.27))
    v = v.astype(np.float32)
    if v.size:
        puffs.append((low, high, v))
        filled += np.count_nonzero(v)
# Slabs of a dense array, because combining grids from Python takes hours.
STEP = 50
for start in range(0, SIDE, STEP):
    slab = np.zeros((STEP, SIDE, SIDE), np.float32)
    for low, high, v in puffs:
        a, b = max(start, low[0]), min(start + STEP, high[0])
        if a < b:
            part = slab[a - start:b - start, low[1]:high[1], low[2]:high[2]]
            np.maximum(part, v[a - low[0]:b - low[0]], out=part)
    if slab.any():
        grid.copyFromArray(slab, ijk=(start, 0, 0))
grid.transform = vdb.createLinearTransform(voxelSize=0.001)
print(f"{100 * grid.activeVoxelCount() / SIDE ** 3:.2f} % of all voxels are filled")
vdb.write(sys.argv[1], grids=[grid])
"""

# The same picture of both: lit by a sky, so that paths scatter until they leave.
SCENE = """<scene version="3.0.0">
  <integrator type="volpath"><integer name="max_depth" value="64"/></integrator>
  <sensor type="perspective">
    <float name="fov" value="50"/>
    <transform name="to_world"><lookat origin="0.5, 0.6, 2" target="0.5, 0.5, 0.5" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="160"/><integer name="height" value="160"/><rfilter type="box"/></film>
    <sampler type="independent"><integer name="sample_count" value="16"/></sampler>
  </sensor>
  <shape type="cube">
    <transform name="to_world"><translate x="1" y="1" z="1"/><scale value="0.5"/></transform>
    <bsdf type="null"/>
    <medium name="interior" type="heterogeneous">
      <volume name="sigma_t" type="gridvolume"><string name="filename" value="{file}"/></volume>
      <float name="scale" value="{scale}"/>
      <rgb name="albedo" value="0.99 0.99 0.99"/>
    </medium>
  </shape>
  <emitter type="constant"/>
</scene>
"""


def render(program, folder, file, scale):
    """Statistics of a render, with the largest memory (MB) the program took."""
    scene = folder / f"{pathlib.Path(file).stem}-{pathlib.Path(file).suffix[1:]}.xml"
    scene.write_text(SCENE.format(file=file, scale=scale))
    picture, stats = scene.with_suffix(".png"), scene.with_suffix(".json")
    command = [program, "render", scene, "--method", "path", "--threads", "1", "-q", "-o", picture, "--stats", stats]
    process = subprocess.Popen([str(word) for word in command])
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        sys.exit(f"{file}: the program ended with {status}")
    return json.loads(stats.read_text()), usage.ru_maxrss / 1024


def dense(folder):
    """A ball with ripples, of 64³ cells."""
    import numpy as np

    side = 64
    x, y, z = np.meshgrid(*[np.linspace(-1, 1, side)] * 3, indexing="ij")
    value = np.clip(1.3 * (1 - np.sqrt(x**2 + y**2 + z**2)), 0, 1) * (0.75 + 0.25 * np.sin(9 * x) * np.sin(7 * y) * np.sin(8 * z))
    with open(folder / "dense.vol", "wb") as file:
        file.write(b"VOL\x03" + np.array([1, side, side, side, 1], "<i4").tobytes() + np.array([0, 0, 0, 1, 1, 1], "<f4").tobytes())
        file.write(value.astype("<f4").tobytes())


def main():
    folder = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="fogbow-volumes-"))
    folder.mkdir(parents=True, exist_ok=True)
    program = os.environ.get("FOGBOW") or HERE / "target/release/fogbow"
    if not (folder / "cloud.vdb").exists():
        subprocess.run(["/usr/bin/python3", "-c", MAKE, str(folder / "cloud.vdb")], check=True)
    for option in ["", "--blosc", "--zip", "--fp16"]:
        target = folder / f"cloud{option[1:]}.nvdb"
        if not target.exists():
            subprocess.run(["nanovdb_convert", *([option] if option else []), folder / "cloud.vdb", target], check=True)
    dense(folder)
    is_good = True
    rows = []
    for file, scale in [("dense.vol", 60), *((name, 900) for name in SPARSE)]:
        stats, memory = render(program, folder, file, scale)
        counts = stats["counts"]
        each = 1e9 * stats["seconds"]["render"]["cpu"] / counts["collisions"]
        rows.append((file, (folder / file).stat().st_size / 1e6, memory, stats["seconds"]["read"]["wall"], counts, each))
    base = rows[0][-1]
    print("file                  MB  memory MB  read s  collisions   lookups  segments  ns per collision  times the dense grid")
    for file, size, memory, read, counts, each in rows:
        numbers = [counts[name] for name in ("collisions", "medium_lookups", "medium_segments")]
        print(f"{file:18}{size:6.1f}{memory:11.0f}{read:8.2f}{numbers[0]:12d}{numbers[1]:10d}{numbers[2]:10d}{each:18.0f}{each / base:22.2f}")
        is_good &= memory < MEMORY and each < SLOWER * base
    print("holds" if is_good else "DOES NOT HOLD")
    sys.exit(0 if is_good else 1)


main()
