"""People's work is treated with care: what stops, fills or takes away costs no file that was there, and what was left is gone on with.

    FOGBOW_PROGRAM=target/release/fogbow tests/acceptance/care.py [stops] [resumes] [full] [read-only] [vanishing] [--only WORD]

With --only, just the runs whose name has the word in it, as in "bake".

  stops      renders by every method, fills and bakes; SIGINT, SIGTERM, SIGHUP and SIGKILL at once and in every stage that the program tells of, with
             old files in place: each is there afterwards, to the bit, or the finished new one in its place
  resumes    renders by every method and bakes, ended by SIGKILL, SIGTERM and SIGINT one after the other: the bits of an undisturbed run
  full       a file system without room for what is written: an error that names the file, the old file, and the picture elsewhere
  read-only  a folder that may not be written, by a user who is not root: an error that names the file, before anything is rendered
  vanishing  a mesh, a volume, the folder of the picture, taken away before and while the program runs

The third and fourth need root. Ten minutes on a quiet machine.
"""
import json, os, pathlib, shutil, signal, subprocess, sys, tempfile, threading, time

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = os.environ.get("FOGBOW_PROGRAM") or os.path.join(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"), "release", "fogbow")
PROGRAM = str(pathlib.Path(PROGRAM).resolve())
SCENES = ROOT / "examples" / "scenes"
SCENE = str(SCENES / "smoke-box-homogeneous-anisotropic.xml")
SMALL = ["--size", "24x24"]

# What is run, which file it writes, and whether it can be gone on with.
METHODS = {
    "path": ["--method", "path", "--spp", "256"],
    "path with a goal": ["--method", "path", "--noise", "0.1"],
    "radiance-cache": ["--method", "radiance-cache", "--error", "0.2", "--spp", "64"],
    "photon-beams": ["--method", "photon-beams", "--spp", "32", "--kernel", "covariance"],
    "vpl": ["--method", "vpl", "--spp", "64", "--lights", "64"],
    "march": ["--method", "march", "--step", "covariance", "--grid-paths", "20000", "--spp", "16"],
}
RUNS = {f"render, {name}": (["render", SCENE, *SMALL, *options], "a.pfm", ["--checkpoint", "kept", "--checkpoint-every", "0.05", "--resume"])
        for name, options in METHODS.items()}
RUNS |= {
    "fill, radiance-cache": (["fill", SCENE, *SMALL, *METHODS["radiance-cache"]], "a.fogbow", None),
    "fill, march": (["fill", SCENE, *SMALL, *METHODS["march"]], "a.fogbow", None),
    "bake, path": (["bake", SCENE, "--counts", "6x6x6", "--error", "0.04"], "a.bake", ["--resume", "--checkpoint-every", "0.05"]),
    "bake, photons": (["bake", SCENE, "--counts", "8x8x8", "--error", "0.1", "--method", "photons"], "a.bake", ["--resume", "--checkpoint-every", "0.05"]),
    "bake, radiance-cache": (["bake", SCENE, "--counts", "6x6x6", "--error", "0.2", "--method", "radiance-cache"], "a.bake", ["--resume", "--checkpoint-every", "0.05"]),
}

failures = []


def check(name, holds, told=""):
    print(f"{'ok ' if holds else 'OFF'} {name}{f': {told}' if told and not holds else ''}", flush=True)
    if not holds:
        failures.append(name)


class Folder(tempfile.TemporaryDirectory):
    def __enter__(self):
        return pathlib.Path(super().__enter__())


def start(folder, command, *more, **options):
    return subprocess.Popen([PROGRAM, *command, *more], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options)


def run(folder, command, *more, **options):
    child = start(folder, command, *more, **options)
    said = "".join(child.communicate())
    return child.returncode, said


def rescued(said):
    """Where the program says that it has put what had no place."""
    return [pathlib.Path(place.strip()) for line in said.splitlines() for place in line.split(" is in ")[1:]]


def finished(name):
    """-> the bytes that a run nobody disturbs writes, the stages it tells of, how long it takes"""
    command, file, _ = RUNS[name]
    with Folder() as folder:
        began = time.monotonic()
        events = ["--json"] if command[0] != "bake" else []
        code, said = run(folder, command, "-o", file, *events)
        assert code == 0, said
        stages = []
        for line in said.splitlines():
            stage = json.loads(line).get("stage") if line.startswith("{") else None
            if stage and stage not in stages:
                stages.append(stage)
        return (folder / file).read_bytes(), stages, time.monotonic() - began


def stopped(folder, command, number, stage=None, after=0.0, *more):
    """Runs and sends a signal: once a stage is told of and so many seconds have passed. -> exit code, what was said"""
    events = ["--json"] if stage else ["--quiet"]
    child = start(folder, command, *events, *more)
    said = []
    if stage:
        for line in child.stdout:
            said.append(line)
            if line.startswith("{") and json.loads(line).get("stage") == stage:
                break
    time.sleep(after)
    child.send_signal(number)
    said.extend(child.communicate())
    return child.returncode, "".join(said)


SIGNALS = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL]


def stops():
    for name, (command, file, _) in RUNS.items():
        due, stages, seconds = finished(name)
        # What tells of no stages is stopped at quarters of its time.
        moments = [(None, 0.0), *((stage, 0.0) for stage in stages)]
        moments += [(None, seconds * share / 4) for share in (1, 2, 3)] if not stages else []
        off, ended = [], {"stopped": 0, "finished": 0}
        # The worst that an old file can be: one that had all its time, of the same run.
        for old in (due, b"an old file of another kind"):
            for stage, after in moments:
                for number in SIGNALS:
                    with Folder() as folder:
                        (folder / file).write_bytes(old)
                        code, said = stopped(folder, command, number, stage, after, "-o", file)
                        kept = (folder / file).read_bytes()
                        # SIGKILL may come between the renaming and the end.
                        is_done = kept == due and (code == 0 or number == signal.SIGKILL and kept != old)
                        ended["finished" if is_done else "stopped"] += 1
                        where = f"{number.name} in {stage or f'{after:.1f} s'}: exit code {code}"
                        if kept != old and not is_done:
                            off.append(f"{where}, the old file is another")
                        # Nothing else but what is announced; a write that is killed may leave its beginning.
                        for other in folder.iterdir():
                            is_part = other.name.endswith(".new") and number == signal.SIGKILL
                            if other.name not in (file, f"a.stopped{pathlib.Path(file).suffix}") and not is_part:
                                off.append(f"{where}, leaves {other.name}")
                        beside = folder / f"a.stopped{pathlib.Path(file).suffix}"
                        if beside.exists() and b"NaN" in beside.read_bytes():
                            off.append(f"{where}, {beside.name} holds no picture")
        check(f"{name} ({', '.join(stages) or 'quarters'}; {ended['stopped']} times stopped, {ended['finished']} finished)", not off, "; ".join(off))


def resumes():
    for name, (command, file, keep) in RUNS.items():
        if keep is None:
            continue
        due, _, seconds = finished(name)
        with Folder() as folder:
            ended = 0
            for share, number in ((0.6, signal.SIGKILL), (0.5, signal.SIGTERM), (0.4, signal.SIGINT), (0.3, signal.SIGKILL)):
                code, _ = stopped(folder, command, number, None, share * seconds, "-o", file, *keep)
                ended += code != 0
            code, said = run(folder, command, "-o", file, "--quiet", "--threads", "1", *keep)
            check(f"{name}: the bits of an undisturbed run ({ended} times stopped)", code == 0 and (folder / file).read_bytes() == due, said)


def full():
    if os.geteuid() != 0:
        return print("    full: needs root")
    for name, (command, file, keep) in RUNS.items():
        with Folder() as folder:
            room = folder / "room"
            room.mkdir()
            if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", room], capture_output=True).returncode != 0:
                return print("    full: no file system can be mounted here")
            try:
                old = b"old" * 1000
                (room / file).write_bytes(old)
                # Room for a page or two, not for what is written.
                (room / "filling").write_bytes(bytes(56 * 1024))
                code, said = run(folder, command, "-o", f"room/{file}", "--quiet")
                elsewhere = rescued(said)
                kept = (room / file).read_bytes()
                if kept != old and code == 0:
                    # It had room after all.
                    check(f"{name}, no room: written all the same", True)
                    continue
                names = sorted(entry.name for entry in room.iterdir())
                check(f"{name}, no room: an error", code == 2 and f"room/{file}" in said and "No space left" in said, f"{code}: {said}")
                check(f"{name}, no room: the old file, and nothing else", kept == old and names == sorted([file, "filling"]), names)
                check(f"{name}, no room: what was made lies elsewhere", len(elsewhere) == 1 and elsewhere[0].stat().st_size > 0, said)
                for other in elsewhere:
                    other.unlink()
                if command[0] == "render":
                    code, said = run(folder, command, "-o", file, "--quiet", "--checkpoint", f"room/{file}.kept", "--checkpoint-every", "0.05")
                    check(f"{name}, no room for checkpoints: the picture is there, and the problem told",
                          (folder / file).stat().st_size > 0 and "No space left" in said, f"{code}: {said}")
            finally:
                subprocess.run(["umount", room], check=True)


def read_only():
    if os.geteuid() != 0:
        return print("    read-only: needs root, to be somebody else")
    nobody = {"user": 65534, "group": 65534, "extra_groups": []}
    with Folder() as top:
        # Where anybody may read.
        top.chmod(0o755)
        program = shutil.copy(PROGRAM, top / "fogbow")
        scenes = top / "scenes"
        shutil.copytree(SCENES, scenes)
        folder = top / "folder"
        folder.mkdir(mode=0o755)
        for name, (command, file, keep) in RUNS.items():
            words = [str(program), *(word.replace(str(SCENES), str(scenes)) for word in command)]
            began = time.monotonic()
            child = subprocess.run([*words, "-o", f"folder/{file}"], cwd=top, capture_output=True, text=True, **nobody)
            took = time.monotonic() - began
            said = child.stdout + child.stderr
            check(f"{name}, a read-only folder: an error before anything is done",
                  child.returncode == 2 and f"folder/{file}" in said and "ermission denied" in said and not list(folder.iterdir()),
                  f"{child.returncode} after {took:.1f} s: {said}")
            (folder / file).write_bytes(b"old")
            child = subprocess.run([*words, "-o", f"folder/{file}"], cwd=top, capture_output=True, text=True, **nobody)
            said = child.stdout + child.stderr
            check(f"{name}, a read-only file: an error, and the file",
                  child.returncode == 2 and f"folder/{file}" in said and (folder / file).read_bytes() == b"old", f"{child.returncode}: {said}")
            (folder / file).unlink()
        # A scene that may not be read.
        secret = scenes / "secret.xml"
        shutil.copy(SCENE, secret)
        secret.chmod(0o600)
        anybody = top / "anybody"
        anybody.mkdir()
        anybody.chmod(0o777)
        child = subprocess.run([str(program), "render", str(secret), "-o", str(anybody / "a.pfm")], capture_output=True, text=True, **nobody)
        check("a scene that may not be read", child.returncode == 2 and "secret.xml" in child.stderr and "ermission denied" in child.stderr, child.stderr)


def vanishing():
    with Folder() as folder:
        shutil.copytree(SCENES, folder / "scenes")
        for scene, part in (("statue-isotropic.xml", "meshes"), ("smoke.xml", "volumes"), ("room.glb", "room.fog.toml")):
            command = ["render", f"scenes/{scene}", *SMALL, "--method", "path", "--spp", "1", "-o", "a.pfm"]
            began = time.monotonic()
            code, said = run(folder, command)
            seconds = time.monotonic() - began
            if code != 0:
                check(f"{scene} renders", False, said)
                continue
            due = (folder / "a.pfm").read_bytes()
            away = folder / "away"
            if part != "room.fog.toml":
                (folder / "scenes" / part).rename(away)
                code, said = run(folder, command)
                check(f"{scene} without its {part}: an error that names a file", code == 2 and part in said, f"{code}: {said}")
                away.rename(folder / "scenes" / part)
            off, seen = [], {0: 0, 2: 0}
            for step in range(16):
                child = start(folder, command)
                time.sleep(seconds * step / 32)
                (folder / "scenes" / part).rename(away)
                said = "".join(child.communicate())
                away.rename(folder / "scenes" / part)
                seen[child.returncode] = seen.get(child.returncode, 0) + 1
                is_told = child.returncode == 2 and part in said
                # Without its fog beside it, a glTF scene is one without fog, and says so.
                is_clear = part == "room.fog.toml" and f"no {part} beside it" in said
                is_right = child.returncode == 0 and (is_clear or (folder / "a.pfm").read_bytes() == due)
                if not is_told and not is_right:
                    off.append(f"after {seconds * step / 32:.2f} s: {child.returncode}: {said}")
            check(f"{scene}, {part} taken away while it runs ({seen.get(2)} times an error, {seen.get(0)} times a picture)", not off, "; ".join(off))
        # A file that is cut off while it is read.
        text = (folder / "scenes" / "smoke.xml").read_text()
        for file in [file for file in (folder / "scenes" / "volumes").iterdir() if file.name in text]:
            whole = file.read_bytes()
            for size in (0, 3, 47, len(whole) // 2, len(whole) - 1):
                file.write_bytes(whole[:size])
                code, said = run(folder, ["render", "scenes/smoke.xml", *SMALL, "--method", "path", "--spp", "1", "-o", "b.pfm"])
                check(f"{file.name} cut to {size} bytes: an error that names it", code == 2 and file.name in said, f"{code}: {said}")
            file.write_bytes(whole)
        # The folder of the picture.
        for name in [name for name in ("render, path", "fill, radiance-cache", "bake, path") if name in RUNS]:
            command, file, _ = RUNS[name]
            place = folder / "place"
            place.mkdir()
            asked = [*command, "--quiet", "-o", f"place/{file}"]
            began = time.monotonic()
            run(folder, asked)
            seconds = time.monotonic() - began
            child = start(folder, asked)
            threading.Timer(seconds / 3, lambda: shutil.rmtree(place)).start()
            said = "".join(child.communicate())
            elsewhere = rescued(said)
            is_told = child.returncode == 2 and f"place/{file}" in said
            check(f"{name}, whose folder is taken away: an error, and what was made lies elsewhere",
                  is_told and len(elsewhere) == 1 and elsewhere[0].stat().st_size > 0, f"{child.returncode}: {said}")
            for other in elsewhere:
                other.unlink()
            shutil.rmtree(place, ignore_errors=True)


STEPS = {"stops": stops, "resumes": resumes, "full": full, "read-only": read_only, "vanishing": vanishing}

if __name__ == "__main__":
    words = sys.argv[1:]
    if "--only" in words[:-1]:
        at = words.index("--only")
        RUNS = {name: what for name, what in RUNS.items() if words[at + 1] in name}
        del words[at : at + 2]
    asked = words or list(STEPS)
    for step in asked:
        if step not in STEPS:
            sys.exit(f"{step}: there are {', '.join(STEPS)}")
        STEPS[step]()
    sys.exit(1 if failures else 0)
