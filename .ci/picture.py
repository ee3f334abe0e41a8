"""Fails unless each file (.png or .pfm) is a finite picture that is neither black nor one colour."""

import math
import struct
import sys
import zlib


def png(data):
    """Samples of an 8- or 16-bit PNG without palette or interlacing, alpha included."""
    if data[:8] != b"\x89PNG\r\n\x1a\n":
        sys.exit("no PNG signature")
    at, packed, header = 8, b"", None
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at : at + 8])
        body = data[at + 8 : at + 8 + length]
        if kind == b"IHDR":
            header = struct.unpack(">IIBBBBB", body)
        elif kind == b"IDAT":
            packed += body
        at += 12 + length
    width, height, depth, colour, _, _, interlaced = header
    if depth not in (8, 16) or colour == 3 or interlaced:
        sys.exit(f"PNG of depth {depth}, colour type {colour}, interlacing {interlaced}")
    channels = {0: 1, 2: 3, 4: 2, 6: 4}[colour]
    step = channels * depth // 8
    stride = width * step
    raw, above, samples = zlib.decompress(packed), bytes(stride), []
    for row in range(height):
        start = row * (stride + 1)
        kind, line = raw[start], bytearray(raw[start + 1 : start + 1 + stride])
        for i in range(stride):
            left = line[i - step] if i >= step else 0
            up, corner = above[i], above[i - step] if i >= step else 0
            guess = left + up - corner
            paeth = min((left, up, corner), key=lambda v: abs(guess - v))
            line[i] = (line[i] + (0, left, up, (left + up) // 2, paeth)[kind]) & 255
        above = line
        samples += struct.unpack(f">{width * channels}{'B' if depth == 8 else 'H'}", line)
    if channels in (2, 4):
        samples = [v for i, v in enumerate(samples) if (i + 1) % channels]
    return width, height, [v / (2**depth - 1) for v in samples]


def pfm(data):
    kind, size, scale, rest = data.split(b"\n", 3)
    width, height = map(int, size.split())
    count = width * height * (3 if kind == b"PF" else 1)
    return width, height, struct.unpack(f"{'<' if float(scale) < 0 else '>'}{count}f", rest[: 4 * count])


def main():
    for name in sys.argv[1:]:
        with open(name, "rb") as file:
            data = file.read()
        width, height, samples = (png if name.endswith(".png") else pfm)(data)
        if not all(math.isfinite(v) for v in samples):
            sys.exit(f"{name}: not finite")
        mean, low, high = sum(samples) / len(samples), min(samples), max(samples)
        lit = sum(v > 0.01 for v in samples) / len(samples)
        print(f"{name}: {width}x{height}, mean {mean:.4f}, from {low:.4f} to {high:.4f}, {lit:.0%} lit")
        if lit < 0.2 or high - low < 0.05:
            sys.exit(f"{name}: black, or one colour")


main()
