#!/usr/bin/env python3
"""Renders on a Slurm cluster: runs `fogbow plan`, and submits its steps as job arrays that wait for each other.

    submit.py [--program FOGBOW] [--retries N] [--sbatch="OPTIONS"] SCENE --parts 16 --spp 256 [options of fogbow plan]

Steps that are on one level of the plan are one array: fills, parts, merges. A part that is preempted, or near its time limit, leaves a checkpoint and is put back
into the queue; a part whose node dies is put back by Slurm, and goes on from its last checkpoint; a part that fails is put back by itself. The job that merges first
checks all parts, sets damaged, foreign and doubled ones aside and sends only these off again. Everything lies in the plan's folder, on a disk that all nodes share:
plan.json, steps.jsonl (a line per run of a step: who, where, how long, how it ended), logs.
Needs Python 3.8 and the commands of Slurm.
"""
import argparse, fcntl, json, os, pathlib, resource, shlex, signal, subprocess, sys, time

HERE = pathlib.Path(__file__).resolve()
DONE, STOPPED, WRONG = 0, 1, 2  # exit codes of fogbow


def levels(steps):
    """Steps by how many others come before them, those of a kind together: each level waits for the one before."""
    depth = {}
    for step in steps:
        depth[step["id"]] = 1 + max((depth[i] for i in step["after"]), default=-1)
    parts = max((depth[s["id"]] for s in steps if s["kind"] == "part"), default=0)
    for step in steps:  # parts of all frames are one array, behind all fills
        if step["kind"] != "fill":
            depth[step["id"]] = parts + (step["kind"] == "merge")
    return [[i for i, s in enumerate(steps) if depth[s["id"]] == level] for level in range(max(depth.values()) + 1)]


def ranges(numbers):
    """1,2,3,7 as 1-3,7."""
    runs = []
    for number in sorted(numbers):
        if runs and runs[-1][1] == number - 1:
            runs[-1][1] = number
        else:
            runs.append([number, number])
    return ",".join(str(a) if a == b else f"{a}-{b}" for a, b in runs)


class Farm:
    def __init__(self, plan_file):
        self.file = pathlib.Path(plan_file).resolve()
        self.plan = json.loads(self.file.read_text())
        self.steps, self.settings = self.plan["steps"], self.plan["farm"]
        self.home = pathlib.Path(self.settings["home"])

    def array(self, indices, after="", attempt=0):
        """Submits steps as an array; the number of the job."""
        kind = self.steps[indices[0]]["kind"]
        inner = f"{shlex.quote(sys.executable)} {shlex.quote(str(HERE))} --step {shlex.quote(str(self.file))} {attempt}"
        words = ["sbatch", "--parsable", f"--job-name=fogbow-{kind}", f"--array={ranges(indices)}", "--requeue", "--open-mode=append",
                 "--signal=B:TERM@60", "--kill-on-invalid-dep=yes", f"--output={self.file.parent}/log-{kind}-%a.txt", f"--chdir={self.home}"]
        words += self.settings["sbatch"] + ([f"--dependency={after}"] if after else [])
        # exec: the signal reaches Python, which passes it on.
        out = subprocess.run(words + [f"--wrap=exec {inner}"], check=True, capture_output=True, text=True)
        return out.stdout.strip().split(";")[0]

    def submit(self, stages, attempt=0, after=""):
        for indices in stages:
            # A merge comes in any case: it finds out what is missing, and has it made.
            word = "afterany" if self.steps[indices[0]]["kind"] == "merge" else "afterok"
            job = self.array(indices, f"{word}:{after}" if after else "", attempt)
            print(f"{self.steps[indices[0]]['kind']}: job {job}, steps {ranges(indices)}", flush=True)
            after = job
        return after

    def note(self, **what):
        with open(self.file.parent / "steps.jsonl", "a") as log:
            fcntl.flock(log, fcntl.LOCK_EX)
            log.write(json.dumps(what) + "\n")

    def run(self, index, attempt):
        """Runs a step; the exit code of this process."""
        step, env = self.steps[index], os.environ
        begin, restarts = time.time(), int(env.get("SLURM_RESTART_COUNT", 0))
        who = {"step": step["id"], "node": env.get("SLURMD_NODENAME", ""), "attempt": attempt, "restart": restarts, "begin": round(begin, 2)}
        if step["kind"] == "merge" and not self.complete(step, attempt):
            self.note(**who, end="sent off again")
            return DONE
        kept = [pathlib.Path(a) for word, a in zip(step["run"], step["run"][1:]) if word == "--checkpoint"]
        words = [self.settings["program"]] + step["run"]
        if step["kind"] != "merge":
            words += ["--threads", env.get("SLURM_CPUS_PER_TASK", env.get("SLURM_CPUS_ON_NODE", "0"))]
        stopped = []
        child = subprocess.Popen(words)
        self.note(**who, end="began")

        def stop(number, frame):
            stopped.append(number)
            child.send_signal(signal.SIGTERM)  # fogbow leaves a checkpoint

        signal.signal(signal.SIGTERM, stop)
        code = child.wait()
        spent = resource.getrusage(resource.RUSAGE_CHILDREN)
        cpu = round(spent.ru_utime + spent.ru_stime, 2)
        end = {DONE: "done", STOPPED: "stopped"}.get(code, f"failed ({code})")
        self.note(**who, end=end, seconds=round(time.time() - begin, 2), cpu=cpu)
        if code == DONE:
            for file in kept:
                file.unlink(missing_ok=True)  # the part itself is there
            return DONE
        if code == WRONG:
            for file in kept:
                if file.exists():
                    file.rename(f"{file}.refused")  # if that was wrong, the next run begins afresh
        if stopped or restarts < self.settings["retries"]:
            job = env.get("SLURM_ARRAY_JOB_ID", ""), env.get("SLURM_ARRAY_TASK_ID", "")
            # Where Slurm itself puts the job back, as after a preemption, this is refused and does no harm.
            subprocess.run(["scontrol", "requeue", "_".join(job)], stderr=subprocess.DEVNULL)
        return code or 1

    def complete(self, step, attempt):
        """Whether all parts of a merge are there; sends off those that are not."""
        due = {s["writes"][0]: i for i, s in enumerate(self.steps) if s["id"] in step["after"]}
        there = [file for file in due if (self.home / file).exists()]
        told = {"refused": [], "there": []}
        if there:
            out = subprocess.run([self.settings["program"], "merge", "--check", *there], stdout=subprocess.PIPE, text=True)
            told = json.loads(out.stdout)
        for refused in told["refused"]:
            file = self.home / refused["file"]
            file.rename(file.with_suffix(f".refused-{attempt}"))
            print(f"{refused['file']}: {refused['why']}", flush=True)
            self.note(step=step["id"], end="refused", file=refused["file"], why=refused["why"])
        lost = [i for file, i in due.items() if not (self.home / file).exists()]
        if not lost:
            return True
        if attempt >= self.settings["retries"]:
            sys.exit(f"{len(lost)} parts are missing after {attempt + 1} attempts: {', '.join(self.steps[i]['id'] for i in lost)}")
        self.submit([lost, [self.steps.index(step)]], attempt + 1)
        return False


def main():
    if sys.argv[1:2] == ["--step"]:
        farm = Farm(sys.argv[2])
        sys.exit(farm.run(int(os.environ["SLURM_ARRAY_TASK_ID"]), int(sys.argv[3])))
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="fogbow", help="the program, on every node [fogbow]")
    parser.add_argument("--retries", type=int, default=3, help="how often a part is tried again [3]")
    parser.add_argument("--sbatch", default="", help='more options of sbatch, such as "--partition=night --cpus-per-task=16 --time=60"')
    arguments, words = parser.parse_known_args()
    out = subprocess.run([arguments.program, "plan", *words], stdout=subprocess.PIPE, text=True)
    if out.returncode:
        sys.exit(out.returncode)
    plan = json.loads(out.stdout)
    folder = pathlib.Path(plan["folder"])
    folder.mkdir(parents=True, exist_ok=True)
    plan["farm"] = {"program": arguments.program, "retries": arguments.retries, "sbatch": shlex.split(arguments.sbatch), "home": os.getcwd()}
    (folder / "plan.json").write_text(json.dumps(plan, indent=1))
    farm = Farm(folder / "plan.json")
    stages = levels(farm.steps)
    farm.submit(stages)


if __name__ == "__main__":
    main()
