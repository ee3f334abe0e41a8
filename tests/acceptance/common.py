"""What the acceptance scripts share: where things lie, one render, the error against a stored reference."""
import json, os, subprocess, sys, tempfile
import numpy as np

REFERENCE = os.environ.get("FOGBOW_REFERENCE") or sys.exit("FOGBOW_REFERENCE names no folder")
sys.path.insert(0, REFERENCE)
import compare  # noqa: E402

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
PROGRAM = os.environ.get("FOGBOW_PROGRAM") or os.path.join(os.environ.get("CARGO_TARGET_DIR", os.path.join(ROOT, "target")), "release", "fogbow")
PUBLIC = os.path.join(REFERENCE, "public")


def every_scene():
    return sorted(name[:-4] for name in os.listdir(PUBLIC) if name.endswith(".xml"))


def matrix(folder):
    """Makes the scenes of the matrix in a folder -> their files"""
    maker = os.path.join(REFERENCE, "matrix", "make.py")
    subprocess.run([sys.executable, maker, folder], check=True, stdout=subprocess.DEVNULL)
    with open(os.path.join(folder, "names.txt")) as file:
        return [os.path.join(folder, name + ".xml") for name in file.read().split()]


def path_of(scene):
    """A scene of the references by its name, any other by its path."""
    return scene if scene.endswith(".xml") else os.path.join(PUBLIC, scene + ".xml")


def render(scene, *options, files=None):
    """-> image, statistics; `files` (a dictionary) takes the bytes written, by extension"""
    with tempfile.TemporaryDirectory() as folder:
        stats = os.path.join(folder, "stats.json")
        images = [os.path.join(folder, "image." + kind) for kind in ("pfm", "exr")[: 1 if files is None else 2]]
        outputs = [word for image in images for word in ("-o", image)]
        subprocess.run([PROGRAM, "render", path_of(scene), *map(str, options), *outputs, "--stats", stats, "--quiet"], check=True)
        for image in images if files is not None else []:
            with open(image, "rb") as file:
                files[image[-3:]] = file.read()
        with open(stats) as file:
            return compare.read_image(images[0]), json.load(file)


def cpu(statistics, of=("fill", "render")):
    """CPU seconds of the phases whose names begin so, without reading, building and writing; null where nothing was done."""
    return sum(time["cpu"] or 0.0 for phase, time in statistics["seconds"].items() if phase.startswith(tuple(of)))


def peer_run(scene, samples, seed):
    """The peer's image and CPU seconds."""
    import peer
    image, _, seconds = peer.run(scene, samples, "llvm_ad_rgb", seed=seed)
    return image, seconds


class Stored:
    """The truth is a stored reference with a known standard error."""

    def __init__(self, scene):
        self.mean, self.error, self.kind = compare.load_ref(scene)

    def relative_square(self, image):
        """Mean relative squared error of `image`, the reference's own noise taken off; may be just below 0."""
        result = compare.stats(image, self.mean, self.error)
        return result["relMSE"] - result["floor"] ** 2


class Halves:
    """The truth is two independent long renders A and B: the mean of (I - A)(I - B) is that of (I - truth)^2."""

    def __init__(self, first, second):
        self.first, self.second = first, second
        mean = (first + second) / 2
        self.scale = compare.smooth(mean) ** 2 + 0.01 * mean.mean() ** 2

    def relative_square(self, image):
        return np.mean((image - self.first) * (image - self.second) / self.scale)


def halves(store, name, scene, samples, *options):
    """Long path traced renders for [`Halves`], kept in the folder `store`."""
    images = []
    for seed in (9001, 9002):
        file = os.path.join(store, f"{name}-{samples}-{seed}.npy")
        if not os.path.exists(file):
            os.makedirs(store, exist_ok=True)
            image, _ = render(scene, "--method", "path", "--spp", samples, "--seed", seed, *options)
            np.save(file, image.astype(np.float32))
        images.append(np.load(file).astype(np.float64))
    return images


def verdict(passes):
    return "ok  " if passes else "FAIL"
