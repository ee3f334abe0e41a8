#!/usr/bin/env python3
"""Renders the gallery and writes its page: python3 examples/gallery/make.py PROGRAM [NAME...]

Of each picture the file NAME.log keeps what the program said, so that the page can be written again; with --page nothing is rendered.
Needs Pillow. Run from the root of the repository.
"""

import pathlib
import re
import subprocess
import sys

from PIL import Image

FOLDER = pathlib.Path("examples/gallery")

# Name, scene and options, what is seen.
PICTURES = [
    ("atrium", "examples/scenes/atrium.xml --size 1280x720", "Sunlight in a hazy atrium."),
    ("smoke", "examples/scenes/noise-box.xml --size 1280x720", "Patchy smoke from a voxel grid, between a red and a green wall."),
    ("statue", "examples/scenes/statue-forward.xml --size 1280x720", "A statue in fog that scatters forwards."),
    ("room", "examples/scenes/room.glb --size 1280x720 --spp 32 --exposure -1", "A room from a modelling program, with fog from the file beside it."),
    ("cloud", "examples/scenes/cloud.xml --size 1280x720", "A cloud of 96 free paths from a NanoVDB file, in the sun."),
    ("plume", "examples/scenes/room-plume.xml --size 1280x720", "A plume of smoke in a room."),
    ("lantern", "examples/scenes/lantern.xml --size 1280x720", "A lantern with holes throws shafts of light into fog."),
]


def render(program, name, what):
    png = FOLDER / f"{name}.png"
    ran = subprocess.run([program, "render", *what.split(), "-o", png], capture_output=True, text=True, check=False)
    if ran.returncode:
        sys.exit(f"{name}: {ran.stderr}")
    (FOLDER / f"{name}.log").write_text("".join(line + "\n" for line in ran.stderr.splitlines() if re.match(r"\d+ x|.* in all|bias", line)))
    keep(png)


def keep(png):
    # As good as fits into 150 kB.
    picture = Image.open(png).convert("RGB")
    for quality in range(90, 20, -5):
        picture.save(png.with_suffix(".jpg"), quality=quality, optimize=True, progressive=True)
        if png.with_suffix(".jpg").stat().st_size < 150_000:
            break
    png.unlink()


def page():
    lines = ["# Gallery", ""]
    lines += ["By the default method, radiance caching. Under each picture: the command, and what the program said of its time and of its own error.", ""]
    for name, what, seen in PICTURES:
        if not (FOLDER / f"{name}.jpg").exists():
            continue
        said = (FOLDER / f"{name}.log").read_text().splitlines()
        lines += [f"![{seen}]({name}.jpg)", "", seen, "", "```sh", f"fogbow render {what} -o {name}.png", "```", "", "```text", *said, "```", ""]
    lines += ["Times are from a machine of two cores that was busy with other work: those on the clock are longer than they would be alone.", ""]
    lines += ["`python3 examples/gallery/make.py target/release/fogbow` makes all of it anew.", ""]
    (FOLDER / "README.md").write_text("\n".join(lines))


if __name__ == "__main__":
    arguments = sys.argv[1:]
    if arguments != ["--page"]:
        program, *names = arguments
        for name, what, _ in PICTURES:
            if not names or name in names:
                render(program, name, what)
    page()
