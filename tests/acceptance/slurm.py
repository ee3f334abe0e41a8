#!/usr/bin/env python3
"""A picture in parts on a real Slurm of two nodes that lie on this machine, through what goes wrong on farms.

    python3 tests/acceptance/slurm.py [--program P] [--scene FILE] [--size WxH] [--spp N] [--parts N] [--method M] [--folder DIR] [--keep]

Installs Debian's slurm-wlm and munge if they are missing (as root), starts munged, slurmctld and two slurmd in a folder of their own, on ports of their own, renders the
picture once without Slurm and once by examples/slurm/submit.py, and meanwhile
  1. kills one slurmd by SIGKILL, with the part that runs there: a node that dies;
  2. damages a part that is done, by one bit;
  3. puts a copy of a part in place of another;
  4. sends SIGTERM to a part, as a preemption does: it goes on from its checkpoint.
Holds if the picture has the bits of the one without Slurm and no part was made twice but those that were lost. Prints a table of all runs of steps, and stops what it has started.
"""
import argparse, collections, json, os, pathlib, shutil, signal, subprocess, sys, tempfile, time

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release/fogbow"
PORT = 17610

CONF = """ClusterName=fogbow
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={port}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CredType=cred/munge
SlurmUser={user}
SlurmdUser={user}
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool-%n
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd-%n.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd-%n.log
ProctrackType=proctrack/pgid
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
MpiDefault=none
SwitchType=switch/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerParameters=batch_sched_delay=1,sched_interval=2
SlurmdTimeout=10
KillWait=10
ReturnToService=2
JobRequeue=1
NodeName=n1 NodeHostname={host} NodeAddr=127.0.0.1 Port={port1} CPUs=1
NodeName=n2 NodeHostname={host} NodeAddr=127.0.0.1 Port={port2} CPUs=1
PartitionName=all Nodes=n1,n2 Default=YES MaxTime=INFINITE State=UP
"""


def install():
    if shutil.which("slurmctld") and shutil.which("munged"):
        return
    if os.geteuid():
        sys.exit("slurm-wlm and munge are not installed, and only root can")
    print("installing slurm-wlm and munge", flush=True)
    env = {**os.environ, "DEBIAN_FRONTEND": "noninteractive", "RUNLEVEL": "1"}
    for words in (["apt-get", "update", "-q"], ["apt-get", "install", "-qy", "--no-install-recommends", "slurm-wlm", "munge"]):
        subprocess.run(words, check=True, env=env, stdout=subprocess.DEVNULL)


class Cluster:
    """Daemons in a folder, all of them children of this process."""

    def __init__(self, folder):
        self.folder, self.daemons = folder, {}
        for name in ("state", "spool-n1", "spool-n2"):
            (folder / name).mkdir(parents=True)
        folder.chmod(0o755)
        key = folder / "munge.key"
        key.write_bytes(os.urandom(1024))
        key.chmod(0o400)
        host = subprocess.run(["hostname", "-s"], capture_output=True, text=True, check=True).stdout.strip()
        user = subprocess.run(["id", "-un"], capture_output=True, text=True, check=True).stdout.strip()
        conf = CONF.format(host=host, user=user, folder=folder, port=PORT, port1=PORT + 1, port2=PORT + 2)
        (folder / "slurm.conf").write_text(conf)
        os.environ["SLURM_CONF"] = str(folder / "slurm.conf")

    def start(self, name, *words):
        with open(self.folder / f"{name}.out", "ab") as out:
            self.daemons[name] = subprocess.Popen(words, stdout=out, stderr=out, stdin=subprocess.DEVNULL, start_new_session=True)

    def up(self):
        f = self.folder
        self.start("munged", "munged", "-F", "-f", f"--key-file={f}/munge.key", f"--socket={f}/munge.socket", f"--pid-file={f}/munged.pid",
                   f"--log-file={f}/munged.log", f"--seed-file={f}/munged.seed")
        self.wait(lambda: (f / "munge.socket").exists(), "munged")
        self.start("slurmctld", "slurmctld", "-D", "-i", "-f", f"{f}/slurm.conf")
        for node in ("n1", "n2"):
            self.start(node, "slurmd", "-D", "-N", node, "-f", f"{f}/slurm.conf")
        self.wait(lambda: self.nodes().count("idle") == 2, "two idle nodes")

    def nodes(self):
        out = subprocess.run(["sinfo", "-hN", "-o", "%T"], capture_output=True, text=True)
        return [line.strip("*~#!%$@+-^ ") for line in out.stdout.split()]

    @staticmethod
    def wait(is_true, what, seconds=60):
        end = time.time() + seconds
        while not is_true():
            if time.time() > end:
                sys.exit(f"{what}: not there after {seconds} s")
            time.sleep(0.3)

    def lose(self, node):
        """A node dies: the daemon, and all that runs below it."""
        daemon = self.daemons.pop(node)
        for pid in [daemon.pid, *(p for p in stepds(self.folder, node))]:
            for child in [pid, *reversed(below(pid))]:
                kill(child, signal.SIGKILL)
        daemon.wait()

    def down(self):
        subprocess.run(["scancel", "-u", "root"] if not os.geteuid() else ["scancel", "--me"], stderr=subprocess.DEVNULL)
        time.sleep(1)
        for node in [name for name in self.daemons if name.startswith("n")]:
            for pid in stepds(self.folder, node):
                for child in [*below(pid), pid]:
                    kill(child, signal.SIGKILL)
        for daemon in reversed(list(self.daemons.values())):
            daemon.terminate()
            try:
                daemon.wait(10)
            except subprocess.TimeoutExpired:
                daemon.kill()
                daemon.wait()


def kill(pid, number):
    try:
        os.kill(pid, number)
    except ProcessLookupError:
        pass


def processes():
    """pid: (parent, command line, environment's SLURMD_NODENAME)"""
    found = {}
    for entry in pathlib.Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                parent = int((entry / "stat").read_text().rsplit(")", 1)[1].split()[1])
                words = (entry / "cmdline").read_bytes().split(b"\0")
                found[int(entry.name)] = (parent, [word.decode(errors="replace") for word in words], (entry / "environ").read_bytes())
            except (OSError, IndexError):
                pass
    return found


def below(pid):
    """All descendants of a process, the youngest first."""
    all_ = processes()
    found, front = [], [pid]
    while front:
        front = [child for child, (parent, *_) in all_.items() if parent in front]
        found = front + found
    return found


def stepds(folder, node):
    """slurmstepd of a node: those with a job that has its name and this cluster's file."""
    name, conf = f"SLURMD_NODENAME={node}".encode(), f"SLURM_CONF={folder}/slurm.conf".encode()
    all_ = processes()
    jobs = [pid for pid, (_, _, env) in all_.items() if name in env.split(b"\0") and conf in env.split(b"\0")]
    return {all_[pid][0] for pid in jobs if all_.get(all_[pid][0], (0, [""], b""))[1][0].startswith("slurmstepd")}


def log(parts):
    file = parts / "steps.jsonl"
    return [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default=str(PROGRAM))
    parser.add_argument("--scene", default=str(ROOT / "examples/scenes/atrium.xml"))
    parser.add_argument("--size", default="640x360")
    parser.add_argument("--spp", default="32")
    parser.add_argument("--parts", type=int, default=16)
    parser.add_argument("--method", default="path")
    parser.add_argument("--more", default="", help="more options of fogbow")
    parser.add_argument("--folder", help="a folder that does not exist yet, shared by the nodes")
    parser.add_argument("--keep", action="store_true", help="leaves the folder")
    arguments = parser.parse_args()
    install()
    folder = pathlib.Path(arguments.folder or tempfile.mkdtemp(prefix="fogbow-slurm-")).resolve()
    folder.mkdir(exist_ok=True)
    program, arguments.scene = (str(pathlib.Path(file).resolve()) for file in (arguments.program, arguments.scene))
    arguments.program = program
    os.chdir(folder)
    options = ["--size", arguments.size, "--spp", arguments.spp, "--method", arguments.method, *arguments.more.split()]
    begin = time.time()
    subprocess.run([program, "render", arguments.scene, *options, "-q", "-o", "due.exr"], check=True)
    alone = time.time() - begin
    print(f"without Slurm, on all processors: {alone:.1f} s", flush=True)
    cluster, good = Cluster(folder / "slurm"), False
    try:
        cluster.up()
        parts, begin = folder / "parts", time.time()
        subprocess.run([sys.executable, str(ROOT / "examples/slurm/submit.py"), "--program", program, "--sbatch=--cpus-per-task=1",
                        arguments.scene, *options, "--parts", str(arguments.parts), "-o", "merged.exr"], check=True)
        good = watch(cluster, parts, arguments, begin)
        seconds = time.time() - begin
        good &= (folder / "merged.exr").read_bytes() == (folder / "due.exr").read_bytes()
        print(f"with Slurm, two nodes, one of them dead after a while: {seconds:.1f} s; the same bits: {good}")
    finally:
        cluster.down()
        if not arguments.keep and good:
            shutil.rmtree(folder)
    sys.exit(not good)


def watch(cluster, parts, arguments, begin):
    """Does what goes wrong, and waits for the picture; whether only what was lost was made again."""
    plan = json.loads((parts / "plan.json").read_text())["steps"]
    ids = [step["id"] for step in plan if step["kind"] == "part"]
    home, lost, told = parts.parent, {}, set()
    file = lambda id_: next(home / step["writes"][0] for step in plan if step["id"] == id_)
    due, end = arguments.parts, begin + 3600
    while not (home / "merged.exr").exists():
        if time.time() > end:
            print("not done after an hour")
            return False
        runs = log(parts)
        done = [run["step"] for run in runs if run["end"] == "done" and run["step"] in ids]
        begun = [run for run in runs if run["end"] == "began" and run["step"] in ids]
        if len(done) >= due // 8 and "preempted" not in told:
            ended = [run["step"] for run in runs if run["end"] in ("done", "stopped")]
            running = [run for run in begun if run["step"] not in ended and run["node"] == "n1"]
            kept = [run for run in running if (home / f"parts/{run['step']}.kept").exists() or time.time() - run["begin"] > 1]
            if kept:
                step = kept[-1]["step"]
                for pid, (_, words, _) in processes().items():
                    if "--checkpoint" in words and words[0] == str(pathlib.Path(arguments.program).resolve()) and f"parts/{step}.kept" in words:
                        parent = processes()[pid][0]
                        kill(parent, signal.SIGTERM)  # to the script, as Slurm does
                        told.add("preempted")
                        lost[step] = "preempted: goes on from its checkpoint"
        if len(done) >= due // 4 and "damaged" not in told:
            victim = done[0]
            data = bytearray(file(victim).read_bytes())
            data[len(data) // 2] ^= 4
            file(victim).write_bytes(data)
            lost[victim] = "damaged by one bit"
            shutil.copy(file(done[1]), file(done[2]))
            lost[done[2]] = f"overwritten by a copy of {done[1]}"
            told.add("damaged")
        if len(done) >= due * 3 // 8 and "killed" not in told:
            ended = {run["step"] for run in runs if run["end"] in ("done", "stopped")}
            there = [run for run in begun if run["node"] == "n2" and run["step"] not in ended]
            if there:
                cluster.lose("n2")
                lost[there[-1]["step"]] = "its node died"
                told.add("killed")
        time.sleep(0.2)
    runs = log(parts)
    table = collections.defaultdict(list)
    for run in runs:
        if run["end"] != "began":
            table[run["step"]].append(f"{run['end']} on {run.get('node', '')} {run.get('seconds', 0):.1f} s, CPU {run.get('cpu', 0):.1f} s"
                                      if "seconds" in run else f"{run['end']} {run.get('file', '')} {run.get('why', '')}")
    for step, ends in table.items():
        print(f"  {step}: {'; '.join(ends)}{'   <- ' + lost[step] if step in lost else ''}")
    begun = collections.Counter(run["step"] for run in runs if run["end"] == "began" and run["step"] in ids)
    again = sorted(step for step, count in begun.items() if count > 1)
    cpu = sum(run.get("cpu", 0) for run in runs)
    print(f"done again: {', '.join(again)}; lost: {', '.join(sorted(lost))}; CPU of all steps that ended: {cpu:.1f} s")
    return again == sorted(lost) and told == {"preempted", "damaged", "killed"}


if __name__ == "__main__":
    main()
