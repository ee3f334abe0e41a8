#!/usr/bin/env python3
"""What becomes of scenes that others wrote: a table of every XML file under some folders.

    python3 tests/acceptance/public_scenes.py FOLDER... [--fogbow target/release/fogbow] [--markdown FILE] [-D NAME=VALUE]

Each scene is rendered at 16 x 16 with one sample per pixel, as it stands and, where that is refused, with --lenient. Files that only serve
others (those that another one includes, and those without a shape) are no scenes and are not counted. Scenes whose files
are missing in the folder, and those that ask for polarised, measured or differentiable things, are counted apart.
"""

import argparse
import collections
import pathlib
import re
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET

# What asks for light that has a polarisation, materials that were measured, or derivatives.
APART = re.compile(r'type="(stokes|polarizer|retarder|circular|measured|measured_polarized|pplastic|direct_projective|prb\w*|emission_volprb)"')


def includes(file):
    """Files that a scene includes, as far as they can be told without its parameters."""
    try:
        root = ET.parse(file).getroot()
    except ET.ParseError:
        return set()
    folders = [file.parent] + [(file.parent / p.get("value", "")) for p in root.iter("path")]
    named = [e.get("filename", "") for e in root.iter("include")]
    return {(folder / name).resolve() for name in named for folder in folders if (folder / name).exists()}


def whole_text(file, seen=()):
    text = file.read_text(errors="replace")
    for other in includes(file):
        if other not in seen:
            text += whole_text(other, (*seen, file))
    return re.sub(r"<!--.*?-->", "", text, flags=re.S)


def missing_files(said):
    return "cannot be read: No such file" in said or "there is no folder" in said or "Git LFS" in said


def run(fogbow, file, options):
    with tempfile.TemporaryDirectory() as folder:
        command = [fogbow, "render", str(file), "--method", "path", "--size", "16x16", "--spp", "1", "--threads", "1"]
        command += ["-o", f"{folder}/a.pfm", *options]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=120)
        except subprocess.TimeoutExpired:
            return False, "took more than two minutes"
        return done.returncode == 0, done.stderr


def reasons(said):
    """Lines without their place."""
    lines = [line for line in said.splitlines() if ".xml" in line or ": " in line]
    return [re.sub(r"^(fogbow: )?(replaced: )?\S*?\.xml(:\d+)?: ", "", line) for line in lines]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("folders", nargs="+", type=pathlib.Path)
    parser.add_argument("--fogbow", default="target/release/fogbow")
    parser.add_argument("--markdown", type=pathlib.Path)
    parser.add_argument("-D", action="append", default=[], metavar="NAME=VALUE")
    arguments = parser.parse_args()
    files = sorted({f.resolve() for folder in arguments.folders for f in folder.rglob("*.xml")})
    included = set().union(*(includes(f) for f in files)) if files else set()
    rows, counts, why = [], collections.Counter(), collections.Counter()
    options = [part for d in arguments.D for part in ("-D", d)]
    for file in files:
        text = whole_text(file)
        if file in included or "<scene" not in text or "<shape" not in text:
            counts["fragments"] += 1
            continue
        done, said = run(arguments.fogbow, file, options)
        verdict, detail = "unmodified", ""
        if not done:
            is_missing = missing_files(said)
            is_apart = APART.search(text) is not None
            done, lenient = run(arguments.fogbow, file, [*options, "--lenient"])
            detail = "; ".join(dict.fromkeys(reasons(said)))
            if is_missing:
                verdict = "files missing"
            elif is_apart:
                verdict = "apart, lenient" if done else "apart, refused"
            elif done:
                verdict = "lenient"
                replaced = [line for line in lenient.splitlines() if line.startswith("replaced")]
                detail = "; ".join(dict.fromkeys(reasons("\n".join(replaced))))
            else:
                verdict = "refused"
            if verdict in ("lenient", "refused"):
                for reason in dict.fromkeys(reasons(said)):
                    why[reason] += 1
        counts[verdict] += 1
        rows.append((file, verdict, detail))
    root = pathlib.Path(*[part for part in files[0].parts][: 1]) if files else pathlib.Path("/")
    folders = [folder.resolve() for folder in arguments.folders]

    def short(file):
        base = next((f for f in folders if f in file.parents), root)
        return f"{base.name}/{file.relative_to(base)}"

    lines = ["| scene | result | why |", "|---|---|---|"]
    lines += [f"| {short(file)} | {verdict} | {detail.replace('|', '/')} |" for file, verdict, detail in rows]
    if arguments.markdown:
        arguments.markdown.write_text("\n".join(lines) + "\n")
    else:
        print("\n".join(lines))
    print("\nwhat is in the way, by scenes:")
    for reason, count in why.most_common(60):
        print(f"{count:5} {reason[:200]}")
    counted = sum(counts[v] for v in ("unmodified", "lenient", "refused"))
    print("\n" + ", ".join(f"{verdict}: {count}" for verdict, count in counts.most_common()))
    print(f"{counts['unmodified']} of {counted} render unmodified ({100 * counts['unmodified'] / max(counted, 1):.0f} %)")
    return 0 if counts["unmodified"] >= 0.9 * counted else 1


if __name__ == "__main__":
    sys.exit(main())
