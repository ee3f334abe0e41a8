"""Checks the stated minimum Rust version against the packages in the lock file.

Reads `cargo metadata`; walks what the published crates and the program build from (tests of their
own apart), on every platform; fails if a package asks for a newer Rust than the workspace states.
"""

import json
import sys

CRATES = {"fogbow", "fogbow-std", "fogbow-examples"}


def version(text):
    return tuple(int(part) for part in (text or "0").split(".")[:2])


def main():
    metadata = json.load(sys.stdin)
    packages = {p["id"]: p for p in metadata["packages"]}
    nodes = {n["id"]: n for n in metadata["resolve"]["nodes"]}
    rest = [p["id"] for p in packages.values() if p["name"] in CRATES]
    stated = {packages[i]["rust_version"] for i in rest}
    if len(rest) != len(CRATES) or len(stated) != 1:
        sys.exit(f"expected one rust-version in {CRATES}, found {stated}")
    stated = stated.pop()

    reached = set()
    while rest:
        package = rest.pop()
        if package in reached:
            continue
        reached.add(package)
        for dependency in nodes[package]["deps"]:
            if any(kind["kind"] != "dev" for kind in dependency["dep_kinds"]):
                rest.append(dependency["pkg"])

    ours = {p["id"] for p in packages.values() if p["source"] is None}
    asked = sorted(
        ((version(packages[i]["rust_version"]), packages[i]["name"], packages[i]["version"]) for i in reached - ours),
        reverse=True,
    )
    silent = sorted(name for wanted, name, _ in asked if wanted == (0,) or wanted == (0, 0))
    print(f"stated: {stated}; {len(asked)} packages; the most demanding:")
    for wanted, name, number in asked[:4]:
        print(f"  {'.'.join(map(str, wanted))} {name} {number}")
    print(f"say nothing of their Rust version: {', '.join(silent) or 'none'}")
    if asked and asked[0][0] > version(stated):
        sys.exit(f"rust-version = \"{stated}\" is not true")


main()
