"""Lines between points, both axes logarithmic, as a picture."""
import math


def plot(series, path, y_unit="", x_unit=""):
    """`series`: names with lists of (x, y)."""
    points = [(math.log10(max(x, 1e-6)), math.log10(max(y, 1e-6))) for line in series.values() for x, y in line]
    xs, ys = zip(*points)
    low, high = min(math.floor(min(ys)), math.ceil(max(ys)) - 1), math.ceil(max(ys))
    place = lambda x, y: (60 + 400 * (x - min(xs)) / (max(xs) - min(xs) or 1), 320 - 280 * (y - low) / (high - low))
    out = '<svg xmlns="http://www.w3.org/2000/svg" width="700" height="370" font-family="sans-serif" font-size="12">\n'
    out += '<rect width="100%" height="100%" fill="#fff"/>\n'
    for decade in range(low, high + 1):
        for value in (1, 2, 5) if decade < high else (1,):
            x, y = place(min(xs), decade + math.log10(value))
            out += f'<line x1="{x}" y1="{y:.1f}" x2="{x + 400}" y2="{y:.1f}" stroke="#ddd"/>'
            out += f'<text x="8" y="{y + 4:.1f}">{value * 10.0**decade:g} {y_unit}</text>\n'
    for i, (name, line) in enumerate(series.items()):
        colour = ["#1b6", "#e63", "#36c", "#939", "#c90", "#0aa", "#777", "#c36"][i % 8]
        at = [place(math.log10(max(x, 1e-6)), math.log10(max(y, 1e-6))) for x, y in line]
        out += f'<polyline points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in at)}" fill="none" stroke="{colour}" stroke-width="2"/>'
        out += "".join(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="{colour}"/>' for x, y in at)
        out += f'<text x="480" y="{40 + 18 * i}" fill="{colour}">{name}</text>\n'
    for exponent in range(math.floor(min(xs)), math.ceil(max(xs)) + 1):
        for value in (1, 2, 5):
            x = exponent + math.log10(value)
            if min(xs) - 0.01 <= x <= max(xs) + 0.01:
                out += f'<text x="{place(x, low)[0]:.1f}" y="345" text-anchor="middle">{value * 10.0**exponent:g} {x_unit}</text>\n'
    with open(path, "w") as file:
        file.write(out + "</svg>\n")
