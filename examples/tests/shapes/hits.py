#!/usr/bin/env python3
"""Writes the files beside it: small meshes and pictures, and hits.txt, which holds what the independent renderer (Python package
`mitsuba` 3.9.1) finds along rays through hits.xml. Each line: origin, direction; distance, geometric normal, shading normal,
reflectance; or origin, direction and `-` where nothing is hit.

    python3 hits.py
"""

import os
import random
import struct
import zlib

import mitsuba as mi
import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))


def png(name, width, height, rows):
    """An 8-bit RGB picture."""
    raw = b"".join(b"\0" + bytes(row) for row in rows)
    chunk = lambda kind, data: struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    data = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(raw, 9)) + chunk(b"IEND", b"")
    open(os.path.join(HERE, name), "wb").write(data)


def meshes(rng):
    """A bent sheet of 3 x 3 points: as PLY with everything a vertex and a face can have, and as OBJ without normals."""
    points = [(x, y, 0.3 * x * x - 0.2 * y * x) for y in (-1, 0, 1) for x in (-1, 0, 1)]
    faces = []
    for y in range(2):
        for x in range(2):
            a = 3 * y + x
            faces += [(a, a + 1, a + 4), (a, a + 4, a + 3)]
    normal = lambda p: (-0.6 * p[0] + 0.2 * p[1], 0.2 * p[0], 1.0)
    with open(os.path.join(HERE, "sheet.ply"), "wb") as ply:
        ply.write(b"ply\nformat binary_big_endian 1.0\ncomment a bent sheet\nelement vertex 9\n")
        for name in ("x", "y", "z", "nx", "ny", "nz", "u", "v", "r", "g", "b", "weight_x", "unused"):
            ply.write(b"property float %s\n" % name.encode())
        ply.write(b"element face 8\nproperty list uchar int vertex_indices\n")
        for name in ("r", "g", "b"):
            ply.write(b"property double %s\n" % name.encode())
        ply.write(b"end_header\n")
        for p in points:
            colour = [round(rng.random(), 3) for _ in range(3)]
            ply.write(struct.pack(">13f", *p, *normal(p), 0.5 + 0.4 * p[0], 0.5 - 0.3 * p[1], *colour, rng.random(), 7.0))
        for f in faces:
            ply.write(struct.pack(">B3i3d", 3, *f, *(round(rng.random(), 3) for _ in range(3))))
    with open(os.path.join(HERE, "sheet.obj"), "w") as obj:
        obj.write("# a bent sheet\no sheet\n")
        obj.writelines("v %g %g %g\n" % p for p in points)
        obj.writelines("vt %g %g\n" % (0.5 + 0.5 * p[0], 0.5 + 0.25 * p[1]) for p in points)
        obj.write("g left\n")
        obj.writelines("f " + " ".join("%d/%d" % (i + 1, i + 1) for i in f) + "\n" for f in faces)
    parts = []
    for number in range(2):
        flags, real = (0x2003, "d") if number else (0x1000, "f")
        data = struct.pack("<I", flags) + b"part\0" + struct.pack("<QQ", 9, 8)
        lists = [points, [normal(p) for p in points], [(0.5 + 0.4 * p[0], 0.5 - 0.3 * p[1]) for p in points]]
        for values in lists if number else lists[:1]:
            data += b"".join(struct.pack("<%d%s" % (len(v), real), *v) for v in values)
        data += b"".join(struct.pack("<3I", *f) for f in faces)
        parts.append(struct.pack("<HH", 0x041C, 4) + zlib.compress(data, 9))
    with open(os.path.join(HERE, "two.serialized"), "wb") as file:
        file.write(b"".join(parts) + struct.pack("<QQI", 0, len(parts[0]), 2))
    with open(os.path.join(HERE, "curve.txt"), "w") as file:
        file.write("-1 0 0 0.1\n-0.5 0.5 0.2 0.2\n0.5 -0.5 0 0.2\n1 0 0.3 0.1\n1.2 0.4 0 0.1\n\n0 1 0 0.1\n0 1 1 0.2\n1 1 1 0.1\n1 2 1 0.1\n")
    with open(os.path.join(HERE, "fold.obj"), "w") as obj:
        obj.write("v -1 -1 0\nv 1 -1 0\nv 1 1 0.5\nv -1 1 0.5\nvn 0.3 0 1\nvn -0.3 0.1 1\ng quad\nf 1//1 2//2 3//2 4//1\n")


def normal_seen(si, colour):
    """The normal that a diffuse bsdf goes by: what it reflects is that of Lambert, in three directions of which all are before it."""
    if mi.Frame3f.cos_theta(si.wi) <= 0:
        return si.sh_frame.n
    directions = [[x, y, 1] for x, y in ((0, 0), (0.2, 0.1), (-0.1, 0.2))]
    value = lambda d: si.bsdf().eval(mi.BSDFContext(), si, mi.Vector3f(d / np.linalg.norm(d)))[0] * np.pi / colour[0]
    local = np.linalg.solve([d / np.linalg.norm(d) for d in directions], [value(d) for d in directions])
    return si.to_world(mi.Vector3f(local))


def main():
    rng = random.Random(7)
    png("pattern.png", 5, 3, [[rng.randrange(256) for _ in range(15)] for _ in range(3)])
    meshes(rng)
    png("normals.png", 3, 2, [[rng.randrange(90, 166) if i % 3 < 2 else 240 for i in range(9)] for _ in range(2)])
    mi.set_variant("scalar_rgb")
    scene = mi.load_file(os.path.join(HERE, "hits.xml"))
    lines = []
    for shape in scene.shapes():
        box = shape.bbox()
        for _ in range(14):
            inside = [box.min[i] + (box.max[i] - box.min[i]) * rng.random() for i in range(3)]
            origin = [inside[i] + rng.gauss(0, 3) for i in range(3)]
            offset = [inside[i] - origin[i] for i in range(3)]
            length = sum(c * c for c in offset) ** 0.5
            # What the file holds is what both are asked.
            origin = [float("%.6g" % c) for c in origin]
            direction = mi.Vector3f([float("%.6g" % (c / length)) for c in offset])
            si = scene.ray_intersect(mi.Ray3f(origin, direction / mi.ScalarFloat(sum(c * c for c in direction) ** 0.5)))
            line = list(origin) + list(direction)
            if si.is_valid():
                # Seen from behind, a bent normal shows nowhere.
                if mi.Frame3f.cos_theta(si.wi) <= 0 and "Map" in str(si.bsdf())[:12]:
                    continue
                colour = si.bsdf().eval_diffuse_reflectance(si)
                line += [si.t, *si.n, *normal_seen(si, colour), *colour]
            lines.append(" ".join("%.6g" % c for c in line) + ("" if si.is_valid() else " -"))
    open(os.path.join(HERE, "hits.txt"), "w").write("\n".join(lines) + "\n")


main()
