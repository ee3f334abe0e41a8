#!/usr/bin/env python3
"""A model of a farm of 10 to 10 000 nodes, fed with times measured on this machine, and checked against real runs with 1, 2 and 4 workers.

    python3 tests/acceptance/farm.py [--program P] [--scene FILE] [--method M] [--size WxH] [--measured FILE [--no-check]]

1. Measures, in CPU seconds so that other work on the machine does not count: what a part takes before its first sample, a sample, merging a part, a fill; bytes of part files.
2. Renders in parts with 1, 2 and 4 workers and compares with what the model says of them: at most 15 % off, or exit status 1.
3. Simulates frames of 3840 x 2160 on more and more nodes: nodes take the next part when they are free, are of different speeds, some of them slow by far; files go over one shared disk; the
   scheduler starts so many tasks a second. Says where it stops scaling and why, and what changes that: parts by samples or by tiles, their number, one merge or a tree of merges, a fill that is
   shared out round by round.

Everything that is assumed and not measured is in ASSUMED.
"""
import argparse, dataclasses, heapq, json, math, os, pathlib, random, subprocess, sys, tempfile, threading

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release/fogbow"

ASSUMED = {
    "cores": 32,            # of a node; a part uses all of them
    "serial": 0.6,          # share of what comes before the first sample that one thread does
    "disk": 2e9,            # bytes per second of the shared disk, over all nodes
    "link": 1e9,            # bytes per second to one node
    "starts": 50.0,         # tasks that the scheduler starts in a second
    "latency": 1.0,         # seconds from free to started
    "spread": 0.10,         # standard deviation of the logarithm of nodes' speeds
    "slow": 0.01,           # share of nodes that are ...
    "slow_by": 3.0,         # ... so many times slower: other work, heat
    "barrier": 0.5,         # seconds until all nodes know the end of a round, over a shared disk
    "rounds": 150,          # rounds of a fill, some of a few jobs
}


def words_of(*words):
    return [str(word) for word in words]


def run(*words):
    """CPU seconds of a process, and what it says."""
    with open(os.devnull) as nothing:
        child = subprocess.Popen(words_of(*words), stdin=nothing, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        out, err = child.stdout.read(), child.stderr.read()
        _, status, used = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        sys.exit(f"{' '.join(words_of(*words))}: {err.decode()}")
    return used.ru_utime + used.ru_stime, out


@dataclasses.dataclass
class Measured:
    pixels: int
    before: float        # seconds of a part before its first sample
    sample: float        # seconds of a sample of a pixel
    merge_start: float   # seconds of a merge of nothing
    merge_pixel: float   # seconds of a merge per pixel of a part's file
    write: float         # seconds per pixel of a part besides its samples: its film, written
    bytes_pixel: float   # of a part's file
    fill: float          # seconds


class Farm:
    """The program, a scene and options."""

    def __init__(self, arguments):
        self.program, self.scene = (pathlib.Path(f).resolve() for f in (arguments.program, arguments.scene))
        self.options = ["--method", arguments.method, *arguments.more.split(), "-q", "--threads", 1]

    def render(self, size, spp, part, file, fill=(), split="samples"):
        sampled = ["--size", "x".join(map(str, size)), "--spp", spp, "--part", part, "--split", split]
        return run(self.program, "render", self.scene, *self.options, *sampled, *fill, "-o", file)[0]

    def merge(self, files):
        return run(self.program, "merge", "-q", *files, "-o", "merged.exr")[0]

    def fill(self, size, spp):
        try:
            out = run(self.program, "fill", self.scene, *self.options, "--size", "x".join(map(str, size)), "--spp", spp, "-o", "fill.fogbow")
        except SystemExit:
            return 0.0, []
        return out[0], ["--fill", "fill.fogbow"]


def measure(farm, size):
    """Three parts of different sizes give what comes before, a pixel's cost and a sample's."""
    big, tiny = size, (size[0] // 4, size[1] // 4)
    pixels, few = big[0] * big[1], tiny[0] * tiny[1]
    fill_seconds, fill = farm.fill(big, 8)
    best = lambda times, *a: min(farm.render(*a) for _ in range(times))
    most = best(2, big, 8, "1/2", "a.fogbow", fill)                     # 4 samples
    least = best(3, big, 2, "1/2", "b.fogbow", fill) if not fill else best(3, big, 8, "1/8", "b.fogbow", fill)   # 1 sample
    sample = (most - least) / (3 * pixels)
    small_fill = farm.fill(tiny, 2)[1] if fill else []
    small = best(3, tiny, 2, "1/2", "c.fogbow", small_fill)
    write = max(0.0, (least - small) / (pixels - few) - sample)
    before = small - few * (sample + write)
    files = [f"m{k}.fogbow" for k in (1, 2)]
    for k, file in enumerate(files, 1):
        farm.render(big, 2, f"{k}/2", file, fill if not fill else farm.fill(big, 2)[1])
    merged = min(farm.merge(files) for _ in range(3))
    for k, file in enumerate(files, 1):
        farm.render(tiny, 2, f"{k}/2", file, fill if not fill else farm.fill(tiny, 2)[1])
    tiny_merged = min(farm.merge(files) for _ in range(3))
    merge_pixel = (merged - tiny_merged) / (2 * (pixels - few))
    size_of = os.path.getsize("a.fogbow") / pixels
    return Measured(pixels, before, sample, max(0.0, tiny_merged - 2 * few * merge_pixel), merge_pixel, write, size_of, fill_seconds)


def check(farm, measured, size, parts, spp):
    """Real runs, dealt out to workers in turn; the greatest error of the model."""
    pixels, worst = size[0] * size[1], 0.0
    fill = farm.fill(size, spp)[1] if measured.fill else []
    print(f"\nworkers  split    predicted s  measured s   error   ({parts} parts of {size[0]}x{size[1]}, {spp} spp; CPU seconds of the busiest worker, and the merge)")
    for split, workers in ((split, workers) for split in ("samples", "tiles") for workers in (1, 2, 4)):
        own = pixels if split == "samples" else pixels / parts
        each = measured.before + own * measured.write + pixels * measured.sample * spp / parts
        merge = measured.merge_start + parts * own * measured.merge_pixel
        files = [f"p{k}.fogbow" for k in range(1, parts + 1)]
        busy = [0.0] * workers

        def work(worker):
            for k in range(worker, parts, workers):
                busy[worker] += farm.render(size, spp, f"{k + 1}/{parts}", files[k], fill, split)

        threads = [threading.Thread(target=work, args=(worker,)) for worker in range(workers)]
        [thread.start() for thread in threads]
        [thread.join() for thread in threads]
        real = max(busy) + farm.merge(files)
        model = math.ceil(parts / workers) * each + merge
        error = model / real - 1
        worst = max(worst, abs(error))
        print(f"{workers:7}  {split:7}  {model:11.2f}  {real:10.2f}  {100 * error:+5.1f} %", flush=True)
    return worst


@dataclasses.dataclass
class Way:
    split: str = "samples"
    parts_per_node: float = 4
    tree: bool = False       # merges of merges, on many nodes
    shared_fill: bool = False


def queued(tasks, speeds):
    """Seconds until all tasks of (seconds, bytes) are done: a free node takes the next, and writes its bytes when it is done, over the disk that all share."""
    a, scheduler, disk, end, following = ASSUMED, 0.0, 0.0, 0.0, 0
    events = [(0.0, node, False) for node in range(len(speeds))]
    while events:
        at, node, is_done = heapq.heappop(events)
        if is_done:
            size = tasks[is_done - 1][1]
            disk = max(disk, at) + size / a["disk"]
            at = max(disk, at + size / a["link"])
            end = max(end, at)
        if following == len(tasks):
            continue
        if is_done:
            heapq.heappush(events, (at, node, False))
            continue
        scheduler = max(scheduler, at) + 1 / a["starts"]
        following += 1
        heapq.heappush(events, (scheduler + a["latency"] + tasks[following - 1][0] / speeds[node], node, following))
    return end


def simulate(m, nodes, pixels, spp, way, seed=1):
    """Seconds of a picture by stage."""
    a, rng = ASSUMED, random.Random(seed)
    cores, parts = a["cores"], max(1, round(nodes * way.parts_per_node))
    most = spp if way.split == "samples" else pixels // 64
    parts = min(parts, most)
    speeds = [math.exp(rng.gauss(0, a["spread"])) / (a["slow_by"] if rng.random() < a["slow"] else 1) for _ in range(nodes)]
    scale = pixels / m.pixels
    fill_work = m.fill * scale
    fill = fill_work / cores
    if way.shared_fill and nodes > 1:
        # All wait for the slowest in every round.
        fill = fill_work / cores / nodes / min(speeds) + a["rounds"] * a["barrier"]
    # By tiles, a part's file has its own pixels alone.
    own = pixels if way.split == "samples" else pixels / parts
    size = own * m.bytes_pixel
    writing = m.write * own
    before = m.before * (a["serial"] + (1 - a["serial"]) / cores)
    work = before + writing + m.sample * pixels * spp / parts / cores
    end = queued([(work, size)] * parts, speeds)
    merge_one = own * m.merge_pixel + size / a["link"]
    if way.tree and parts > 16:
        depth, merge = math.ceil(math.log(parts, 16)), 0.0
        for level in range(depth):
            groups = max(1, parts // 16 ** (level + 1))
            merge += 16 * merge_one + a["latency"] + max(0.0, 16 * groups * size / a["disk"] - 16 * size / a["link"])
    else:
        merge = m.merge_start + a["latency"] + parts * merge_one
    stages = {"fill": fill, "parts": end, "merge": merge}
    return {"parts": parts, "seconds": sum(stages.values()), **{f"{k}_seconds": v for k, v in stages.items()}}


def simulate_frames(m, nodes, pixels, spp, frames, seed=1):
    """Seconds of an animation: parts by tiles of all frames are one queue, and a frame is merged by the node that is free next; fills are the first parts of frames."""
    a, rng = ASSUMED, random.Random(seed)
    parts = min(max(1, round(2 * nodes / frames)), pixels // 64)
    speeds = [math.exp(rng.gauss(0, a["spread"])) / (a["slow_by"] if rng.random() < a["slow"] else 1) for _ in range(nodes)]
    own, before = pixels / parts, m.before * (a["serial"] + (1 - a["serial"]) / a["cores"])
    size, fill = own * m.bytes_pixel, m.fill * pixels / m.pixels / a["cores"]
    tasks = ([fill] * frames if fill else []) + [before + own * (m.write + m.sample * spp / a["cores"])] * (frames * parts)
    tasks += [m.merge_start + parts * (own * m.merge_pixel + size / a["link"])] * frames
    return queued([(work, size) for work in tasks], speeds), parts


def animation(m, spp, frames=1000):
    nodes = [1, 10, 30, 100, 300, 1000, 3000, 10000]
    one = simulate_frames(m, 1, 3840 * 2160, spp, frames)[0]
    print(f"\n{frames} frames of it, in parts by tiles; one node: {one / 3600:.0f} h")
    for n in nodes:
        seconds, parts = simulate_frames(m, n, 3840 * 2160, spp, frames)
        print(f"{n:>6} nodes, {parts:>3} parts a frame: {seconds:>9.0f} s ({100 * one / n / seconds:3.0f} %)")


def curve(m, spp):
    pixels, rows = 3840 * 2160, {}
    one = simulate(m, 1, pixels, spp, Way(parts_per_node=1))["seconds"]
    print(f"\n3840 x 2160 at {spp} spp, nodes of {ASSUMED['cores']} cores; one node: {one / 3600:.1f} h")
    ways = {
        "by samples, 4 parts a node": Way(),
        "by samples, 1 part a node": Way(parts_per_node=1),
        "by samples, a tree of merges": Way(tree=True),
        "by tiles, 4 parts a node": Way(split="tiles"),
        "by tiles, 8 parts a node, a tree": Way(split="tiles", tree=True, parts_per_node=8),
    }
    if m.fill:
        ways["by tiles, the fill shared out"] = Way(split="tiles", shared_fill=True)
    nodes = [1, 10, 30, 100, 300, 1000, 3000, 10000]
    print("seconds (efficiency)".ljust(40) + "".join(f"{n:>15}" for n in nodes))
    for name, way in ways.items():
        row = [simulate(m, n, pixels, spp, way) for n in nodes]
        print(name.ljust(40) + "".join(f"{r['seconds']:>8.0f} ({100 * one / n / r['seconds']:3.0f} %)" for n, r in zip(nodes, row)))
        rows[name] = [{"nodes": n, **r, "efficiency": one / n / r["seconds"]} for n, r in zip(nodes, row)]
        stop = next((i for i, (n, r) in enumerate(zip(nodes, row)) if one / n / r["seconds"] < 0.5), None)
        if stop is not None:
            stages = {k: row[stop][f"{k}_seconds"] for k in ("fill", "parts", "merge")}
            worst = max(stages, key=stages.get)
            print(f"    below half from {nodes[stop]} nodes: {', '.join(f'{k} {v:.0f} s' for k, v in stages.items())}; most is {worst}")
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default=str(PROGRAM))
    parser.add_argument("--scene", default=str(ROOT / "examples/scenes/atrium.xml"))
    parser.add_argument("--method", default="path")
    parser.add_argument("--more", default="", help="more options of fogbow render")
    parser.add_argument("--size", default="320x180", help="of what is measured")
    parser.add_argument("--parts", type=int, default=8, help="of what is checked")
    parser.add_argument("--spp", type=int, default=1024, help="of what is simulated")
    parser.add_argument("--measured", help="takes measurements of this file, or leaves them there")
    parser.add_argument("--no-check", action="store_true", help="simulates alone")
    arguments = parser.parse_args()
    size = tuple(int(side) for side in arguments.size.split("x"))
    farm, file = Farm(arguments), arguments.measured and pathlib.Path(arguments.measured).resolve()
    with tempfile.TemporaryDirectory(prefix="fogbow-farm-") as folder:
        os.chdir(folder)
        if file and file.exists():
            measured, worst = Measured(**json.loads(file.read_text())), 0.0
        else:
            measured = measure(farm, size)
            if file:
                file.write_text(json.dumps(dataclasses.asdict(measured)))
        m = measured
        print(f"measured, CPU seconds: before the first sample {m.before:.3f}; a million samples {1e6 * m.sample:.2f}; a part's film, a million pixels {1e6 * m.write:.2f}, "
              f"{m.bytes_pixel:.1f} bytes a pixel; merge {m.merge_start:.3f} and {1e6 * m.merge_pixel:.3f} a million pixels of a part; fill of {size[0]}x{size[1]} {m.fill:.1f}", flush=True)
        worst = 0.0 if arguments.no_check else check(farm, measured, size, arguments.parts, 2 * arguments.parts)
        os.chdir(ROOT)
    curve(measured, arguments.spp)
    animation(measured, arguments.spp)
    print(f"\ngreatest error of the model: {100 * worst:.1f} %")
    sys.exit(worst > 0.15)


if __name__ == "__main__":
    main()
