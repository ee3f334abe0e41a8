#!/usr/bin/env python3
"""Values of surfaces by Mitsuba 3 (3.9.1, scalar_rgb), for tests/tests/surfaces.rs.

Reads the bsdfs of surfaces.xml, writes surfaces.f32, little endian: 1000 pairs of directions (eye, light; x y z each), then
for each bsdf 1000 times (value × cosine: r g b; density).
"""
import pathlib
import xml.etree.ElementTree as ElementTree

import mitsuba
import numpy

mitsuba.set_variant("scalar_rgb")
HERE = pathlib.Path(__file__).parent
PAIRS = 1000


def directions(rng):
    """Half of the pairs anywhere, the others near mirrors and near what glass of 1.5 refracts; eyes mostly above.

    None within three degrees of the surface: there Mitsuba's single precision is off its own formulas by more than 1e-4.
    """
    def unit(count):
        v = rng.normal(size=(count, 3))
        return v / numpy.linalg.norm(v, axis=1, keepdims=True)

    eye = unit(PAIRS)
    eye[: 4 * PAIRS // 5, 2] = abs(eye[: 4 * PAIRS // 5, 2])
    light = unit(PAIRS)
    above = rng.random(PAIRS) < 0.7
    light[above, 2] = numpy.copysign(light[above, 2], eye[above, 2])
    for i in range(0, PAIRS, 2):
        normal = numpy.array([0.0, 0.0, 1.0]) + rng.normal(size=3) * 0.1 * rng.random()
        normal /= numpy.linalg.norm(normal)
        cosine = normal @ eye[i]
        light[i] = 2 * cosine * normal - eye[i]
        if i % 6 == 0:
            eta = 1.5 if cosine > 0 else 1 / 1.5
            inside = 1 - (1 - cosine**2) / eta**2
            if inside > 0:
                light[i] = (normal * cosine - eye[i]) / eta - normal * numpy.copysign(numpy.sqrt(inside), cosine)
    for v in (eye, light):
        v[:, 2] = numpy.copysign(numpy.maximum(abs(v[:, 2]), 0.05), v[:, 2])
        v /= numpy.linalg.norm(v, axis=1, keepdims=True)
    return eye.astype("<f4"), light.astype("<f4")


def main():
    eye, light = directions(numpy.random.default_rng(1))
    parts = [numpy.concatenate([eye, light], axis=1)]
    context = mitsuba.BSDFContext()
    scene = ElementTree.parse(HERE / "surfaces.xml").getroot()
    for element in scene.findall("bsdf"):
        element.set("version", "3.0.0")
        bsdf = mitsuba.load_string(ElementTree.tostring(element, encoding="unicode"))
        rows = numpy.zeros((PAIRS, 4), "<f4")
        for i in range(PAIRS):
            at = mitsuba.SurfaceInteraction3f()
            at.wi = eye[i].tolist()
            at.uv = [0.5, 0.5]
            to_light = light[i].tolist()
            rows[i, :3] = numpy.array(bsdf.eval(context, at, to_light))
            rows[i, 3] = bsdf.pdf(context, at, to_light)
        assert numpy.isfinite(rows).all(), element.get("id")
        parts.append(rows)
    with open(HERE / "surfaces.f32", "wb") as file:
        for part in parts:
            file.write(part.tobytes())


main()
