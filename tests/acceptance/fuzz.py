#!/usr/bin/env python3
"""Fuzzing of every reader: ten minutes each, in a process of its own, whose memory is watched. No panic, and no more than 1 GiB.

    tests/acceptance/fuzz.py [SECONDS] [WORD]

Only tests with the word in their name, if there is one: sparse, gltf, pbrt, fog, meshes, images, volumes, scenes.
"""
import json
import os
import pathlib
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parents[2]
MEMORY = 1024  # MB


def test_program():
    """The program of tests, built."""
    command = ["cargo", "test", "--release", "-p", "fogbow-examples", "--test", "all", "--no-run", "--message-format", "json"]
    lines = subprocess.run(command, cwd=HERE, check=True, stdout=subprocess.PIPE, text=True).stdout.splitlines()
    built = [json.loads(line) for line in lines if line.startswith("{")]
    return [b["executable"] for b in built if b.get("executable") and b["target"]["name"] == "all"][-1]


def main():
    seconds = int(sys.argv[1]) if len(sys.argv) > 1 else 600
    word = sys.argv[2] if len(sys.argv) > 2 else ""
    program = os.environ.get("FOGBOW_TESTS") or test_program()
    listed = subprocess.run([program, "fuzz", "--list"], check=True, stdout=subprocess.PIPE, text=True).stdout
    names = [line.removesuffix(": test") for line in listed.splitlines() if line.endswith(": test") and word in line]
    is_good = True
    for name in names:
        environment = {**os.environ, "FOGBOW_FUZZ_SECONDS": str(seconds)}
        process = subprocess.Popen([program, name, "--exact", "--nocapture"], env=environment, cwd=HERE / "examples", stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        said = process.stdout.read()
        _, status, usage = os.wait4(process.pid, 0)
        rounds = sum(int(line.split()[0]) for line in said.splitlines() if line.endswith(" rounds"))
        memory = usage.ru_maxrss / 1024
        holds = status == 0 and memory < MEMORY
        print(f"{name:40}{rounds:12d} rounds{memory:8.0f} MB  {'holds' if holds else 'DOES NOT HOLD'}", flush=True)
        if status:
            print(said)
        is_good &= holds
    sys.exit(0 if is_good else 1)


main()
