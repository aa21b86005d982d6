"""The commands that scripts/faults.py disturbs: small inputs, and for each what it is run on, beside what, and read by whom."""
import dataclasses
import json
import math
import os
import random
import shutil
import struct
import sys
import zlib

import fault_process
import page_text

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))


@dataclasses.dataclass
class Command:
    """A command line; it works in a folder of its own and writes to `out` there, if at all."""
    name: str
    words: list
    before: list = None  # makes what lies in `out` already, which is of another run; None: nothing does
    given: str = ""  # a folder that is copied to `out` before that: what the command reads and adds to
    readers: list = dataclasses.field(default_factory=list)  # command lines, which write to `read` at most
    notes: list = dataclasses.field(default_factory=list)  # files that scripts/page_text.py would take figures from
    writes: bool = True
    kills: int = 0  # of 200
    pairs: bool = False  # takes part in: two processes in one folder
    replaces: bool = False  # what is there of its own kind or another's
    done_is_refused: bool = False  # a rerun over what is whole says so, with exit code 2
    ours: bool = True  # tsdfpp, no script
    variant: bool = False  # of a command that meets every fault; meets those of writers alone
    quick: bool = False  # short; longer ones a build's tests kill in tests/kill and tests/eval/sweep_test.cc
    goes_on: str = ""  # what it prints where it goes on without a child that was killed


SCENE = """name = "{name}"
purpose = "A car turns beside a mug, in a few small frames."
frames = {frames}
rate_hz = 10
[camera]
width = 128
height = 96
f = 90.0
cx = 63.0
cy = 48.5
target = [0.0, 0.0, 0.74]
azimuth_deg = [{azimuth}, -92.0, -70.0]
radius_m = [0.85, 0.80, 0.85]
height_m = [0.52, 0.58, 0.52]
[room]
furniture = false
half_x = 2.4
half_y = 2.2
height = 2.6
[[object]]
name = "car"
id = 1
class = "car"
model = "car"
x = -0.20
y = -0.10
yaw_deg = -10
[object.drive]
start_frame = 1
end_frame = {frames}
ramp_s = 0.05
x = [0.02, 0.18]
y = [-0.12, 0.02]
[[object]]
name = "mug"
id = 2
class = "mug"
model = "mug"
x = 0.10
y = 0.16
[experiment]
reveal_frame = {reveal}
removed = ["car"]
"""

EXPERIMENT = """name = "tiny"
question = "Does it come back?"
metrics = ["visible_completion", "movers_completion"]
baseline = "tsdf"
replicates = ["seed"]
[frames]
scale = 1
stride = {stride}
every = 0
[statistics]
resamples = 200
[[grid]]
scene = "tiny.toml"
seed = {seeds}
sensor = "nguyen2012"
method = ["tsdf", "tsdf++"]
"""

GATES = """[[experiment]]
name = "tiny"
file = "experiment.toml"
profiles = ["quick"]
[[control]]
name = "agree"
experiment = "tiny"
metric = "table_visible_completion"
methods = ["tsdf", "tsdf++"]
spread = 0.9
min = 0.01
why = "the same frames"
[[gate]]
name = "completion"
experiment = "tiny"
metric = "movers_completion"
where = {{ method = "{method}" }}
min = 0.01
confidence = 0.5
why = "it is seen"
"""

SET = """name = "tiny"
scale = {scale}
voxel_m = 0.01
trunc_front = 10
trunc_back = 3
metrics = ["visible_completion", "movers_completion"]
[[sequence]]
name = "tiny"
scene = "tiny.toml"
scene_hash = "{scene_hash}"
truth_hash = "{truth_hash}"
"""

ADAPTER = '''"""A mapper that takes its time and answers with the same square."""
import pathlib, struct, sys, time
out, frames = pathlib.Path(sys.argv[1]), sys.argv[2].split(",")
for frame in frames:
    time.sleep(0.1)
    folder = out / "meshes" / frame
    folder.mkdir(parents=True)
    points = [(-.3, -.3, .7), (.3, -.3, .7), (.3, .3, .7), (-.3, .3, .7)]
    head = ("ply\\nformat binary_little_endian 1.0\\nelement vertex 4\\nproperty float x\\nproperty float y\\n"
            "property float z\\nelement face 2\\nproperty list uchar int vertex_indices\\nend_header\\n")
    (folder / "scene.ply").write_bytes(head.encode() + b"".join(struct.pack("<3f", *p) for p in points)
                                       + struct.pack("<B3iB3i", 3, 0, 1, 2, 3, 0, 2, 3))
    print("frame", frame, flush=True)
'''

# A copy of the pages' machinery with pages of its own: what replaces pages is killed, too.
PAGES = 60
PAGE_LIST = """[[command]]
name = "planted"
run = ["true"]
out = "made"
minutes = 1
copies = {{ "picture.png" = "docs/pictures/picture.png" }}
pictures = ["docs/pictures/picture.png"]
{tables}"""
PAGE_TABLE = """[[command.table]]
page = "docs/page-{k}.md"
name = "numbers"
from = "numbers.csv"
kind = "scored"
"""


def write(path, content):
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(path, "wb") as file:
        file.write(content if isinstance(content, bytes) else content.encode())


def trajectory(seed, count):
    draw, lines = random.Random(seed), []
    for k in range(count):
        angle = 0.001 * k
        x, y, z = (math.cos(angle) + draw.gauss(0, 0.003), math.sin(angle) + draw.gauss(0, 0.003), 0.1 * math.sin(3 * angle))
        lines.append(f"{k / 30:.6f} {x:.6f} {y:.6f} {z:.6f} 0 0 {math.sin(angle / 2):.9f} {math.cos(angle / 2):.9f}")
    return "\n".join(lines) + "\n"


def label_image(seed, width, height):
    """An 8-bit PNG of rectangles with ids."""
    draw, rows = random.Random(seed), [bytearray(width) for _ in range(height)]
    for name in range(1, 9):
        x, y = draw.randrange(width - 60), draw.randrange(height - 60)
        for row in rows[y:y + 60]:
            row[x:x + 60] = bytes([name]) * 60

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    data = zlib.compress(b"".join(b"\0" + bytes(row) for row in rows))
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)) + chunk(b"IDAT", data)
            + chunk(b"IEND", b""))


class Inputs:
    """Files below a folder, made once by the command itself."""

    def __init__(self, tsdfpp, folder, frames):
        self.tsdfpp, self.folder, self.frames = tsdfpp, folder, frames
        os.makedirs(folder, exist_ok=True)

    def at(self, *names):
        return os.path.join(self.folder, *names)

    def run(self, *words):
        ending = fault_process.run([self.tsdfpp, *words], self.folder, self.at(".said"), limit_s=900)
        if ending.signal or ending.code or ending.hung:
            raise RuntimeError(f"'tsdfpp {' '.join(words)}' {ending.text()}: {ending.err.strip()}")
        return ending.out

    def make(self, quick=False):
        """All, or what the quick commands read."""
        self.make_sequence()
        if quick:
            self.program, self.cells, self.frame = self.run("--version").strip(), [""], self.frames
        else:
            self.make_results()
            self.look()
        shutil.rmtree(self.at(".said"))

    def make_sequence(self):
        frames, reveal = self.frames, self.frames
        for name, azimuth in (("tiny", -112.0), ("other", -105.0)):
            scene = SCENE.format(name=name, frames=frames, azimuth=azimuth, reveal=reveal)
            write(self.at(name + ".toml"), scene)
            write(self.at("scenes", name + ".toml"), scene)
        write(self.at("scenes-before", "tiny.toml"), SCENE.format(name="tiny", frames=frames, azimuth=-100.0, reveal=reveal))
        self.run("generate", "tiny.toml", "--out", "seq", "--share", "0")

    def make_results(self):
        frames = self.frames
        self.run("compare", "seq", "--methods", "tsdf,tsdf++/anchored", "--profiles", "close", "--every", str(frames),
                 "--record", "--keep-meshes", "--out", "compared")
        self.run("compare", "seq", "--methods", "tsdf++", "--profiles", "close", "--every", str(frames), "--record", "--out",
                 "compared-before")
        self.run("map", "seq", "--until", str(frames // 2), "--save", "half.map", "--out", "half")
        for name, stride, seeds in (("experiment", 1, [1, 2]), ("experiment-before", 2, [1])):
            write(self.at(name + ".toml"), EXPERIMENT.format(stride=stride, seeds=seeds))
        self.run("sweep", "experiment.toml", "--out", "swept")
        for name, method in (("gates", "tsdf++"), ("gates-before", "tsdf")):
            write(self.at(name + ".toml"), GATES.format(method=method))
        self.make_set("set", 1)
        self.make_set("set-before", 0.5)
        self.run("bench-set", "tiny", "--sets", "set", "--run", "tsdf,tsdf++", "--out", "benched")
        for name, seed in (("true", 1), ("found", 2)):
            write(self.at(name + ".txt"), trajectory(seed, 10000))
            write(self.at(name + "-few.txt"), trajectory(seed, 200))
            for k in range(40):
                write(self.at("masks-" + name, f"{k:03d}.png"), label_image(100 * seed + k, 640, 480))
        write(self.at("adapter", "slow.py"), ADAPTER)
        write(self.at("adapter", "slow.toml"), f'name = "slow"\ncommand = ["{sys.executable}", "{{adapter}}/slow.py", "{{out}}", '
                                               '"{frames}"]\nmatch = "overlap"\n')
        self.make_pages()

    def look(self):
        """What commands have to be told of what was made."""
        with open(self.at("swept", "results.json"), encoding="utf-8") as file:
            results = json.load(file)
        self.program = results["program"]
        self.cells = sorted(results["cells"])
        self.frame = max(results["sequences"][results["cells"][self.cells[0]]["sequence"]]["frames"])

    def make_set(self, name, scale):
        write(self.at(name, "tiny", "tiny.toml"), SCENE.format(name="tiny", frames=self.frames, azimuth=-112.0,
                                                                   reveal=self.frames))
        place = self.at(name, "tiny", "set.toml")
        write(place, SET.format(scale=scale, scene_hash="?", truth_hash="?"))
        found = json.loads(self.run("bench-set", "tiny", "--sets", name, "--json"))["sequences"][0]
        write(place, SET.format(scale=scale, scene_hash=found["scene_hash"], truth_hash=found["truth_hash"]))

    def make_pages(self):
        for name, factor in (("pages", 1), ("pages-before", 2)):
            for script in os.listdir(os.path.join(ROOT, "scripts")):
                if script.startswith(("page", "experiment_text")) and script.endswith(".py"):
                    with open(os.path.join(ROOT, "scripts", script), "rb") as file:
                        write(self.at(name, "scripts", script), file.read())
            write(self.at(name, "docs", "tables.toml"),
                  PAGE_LIST.format(tables="".join(PAGE_TABLE.format(k=k) for k in range(PAGES))))
            numbers = "name,number\n" + "".join(f"row {k},{factor * k}\n" for k in range(3000))
            write(self.at(name, "made", "numbers.csv"), numbers)
            write(self.at(name, "made", "picture.png"), label_image(factor, 640, 480))
            rows = "".join(f"| row {k} | {3 * k} |\n" for k in range(3000))
            for k in range(PAGES):
                write(self.at(name, "docs", f"page-{k}.md"),
                      f"# Page {k}\n\n<!-- table: numbers -->\n| name | number |\n| --- | --- |\n{rows}<!-- end -->\n")
            write(self.at(name, "docs", "pictures", "picture.png"), label_image(3, 640, 480))


def commands_of(inputs):
    """All that tsdfpp can do, and what replaces pages. Kills add up to 200."""
    at, t = inputs.at, inputs.tsdfpp
    cell, other = inputs.cells[0], inputs.cells[-1]
    seq, last = at("seq"), str(inputs.frames - 1)

    def exported(layout, kills, **more):
        return Command(f"export {layout}", [t, "export", seq, "--to", layout, "--out", "out"], kills=kills, done_is_refused=True,
                       **more)

    def mapped(*more):
        return [t, "map", seq, "--remove", "car", "--out", "out", *more]

    compare = [t, "compare", seq, "--every", str(inputs.frames), "--out", "out", "--profiles", "close"]
    compare_before = [*compare, "--methods", "tsdf++", "--keep-meshes"]
    surface = [at("compared", "tsdf_close_gt", "mesh", "scene.ply"),
               at("compared", "tsdf++-anchored_close_gt", "mesh", "scene.ply")]
    return [
        Command("generate", [t, "generate", at("tiny.toml"), "--out", "out", "--overwrite", "--jobs", "2"],
                before=[t, "generate", at("other.toml"), "--out", "out", "--overwrite", "--share", "0"],
                readers=[[t, "verify", "out", "--share", "0", "--json"]], kills=20, pairs=True, replaces=True, quick=True),
        Command("generate --page", [t, "generate", "--page", "out", "--scenes", at("scenes")],
                before=[t, "generate", "--page", "out", "--scenes", at("scenes-before")], kills=5, pairs=True),
        exported("tum", 6, pairs=True),
        exported("bop", 6, variant=True),
        exported("klg", 6, quick=True),
        exported("7scenes", 6, variant=True),
        Command("map", mapped("--method", "tsdf++/anchored"),
                before=mapped("--method", "tsdf", "--mesh-format", "glb", "--views", "1", "--until", last),
                notes=["stats.json"], kills=20, pairs=True, replaces=True, quick=True),
        Command("map --save --views", mapped("--views", "2", "--mesh-format", "glb", "--save", "out.map"),
                before=mapped("--method", "tsdf", "--save", "out.map"), notes=["stats.json"],
                readers=[[t, "map", "--load", "out.map", "--out", "read", "--json"]], kills=12),
        Command("map --load", [t, "map", seq, "--load", at("half.map"), "--save", "out.map", "--out", "out"],
                before=mapped("--method", "tsdf"), notes=["stats.json"], kills=6, variant=True),
        Command("compare", [*compare, "--methods", "tsdf,tsdf++/anchored", "--record"], before=compare_before,
                readers=[[t, "report", "out", "--out", "read/page.html"]], notes=["summary.json", "frames.csv", "table.txt"],
                kills=24, pairs=True, replaces=True),
        Command("compare --adapter", [*compare, "--methods", "tsdf", "--adapter", at("adapter", "slow.toml")],
                before=compare_before, readers=[[t, "report", "out", "--out", "read/page.html"]],
                notes=["summary.json", "frames.csv"], kills=10, variant=True, goes_on="\nfailed: slow: "),
        Command("report", [t, "report", "out"], given=at("compared"), before=[t, "report", "out", "--compare", at("compared-before")],
                notes=["summary.json"], kills=6),
        Command("report --video", [t, "report", "out", "--video", "--out", "out/film.mp4"], given=at("compared"),
                before=[t, "report", at("compared-before"), "--video", "--out", "out/film.mp4"], kills=8),
        Command("sweep", [t, "sweep", at("experiment.toml"), "--out", "out", "--jobs", "2"],
                before=[t, "sweep", at("experiment-before.toml"), "--out", "out"],
                readers=[[t, "replay", "out", "--cell", cell, "--frame", str(inputs.frame), "--out", "read"]], kills=16,
                pairs=True),
        Command("replay", [t, "replay", at("swept"), "--cell", cell, "--frame", str(inputs.frame), "--out", "out"],
                before=[t, "replay", at("swept"), "--cell", other, "--frame", str(inputs.frame - 4), "--out", "out"],
                notes=["replay.json"], kills=8, pairs=True, replaces=True),
        Command("gate", [t, "gate", at("gates.toml"), "--out", "out", "--jobs", "2"],
                before=[t, "gate", at("gates-before.toml"), "--out", "out"],
                readers=[[t, "report", at("compared"), "--gates", "out/gates.json", "--out", "read/page.html"]], kills=8,
                pairs=True),
        Command("gate --explain", [t, "gate", at("gates.toml"), "--explain", "completion", "--out", "out"],
                before=[t, "gate", at("gates-before.toml"), "--out", "out"], kills=3, variant=True),
        Command("bench-set --run", [t, "bench-set", "tiny", "--sets", at("set"), "--run", "tsdf,tsdf++", "--out", "out"],
                before=[t, "bench-set", "tiny", "--sets", at("set-before"), "--run", "tsdf,tsdf++", "--out", "out"],
                readers=[[t, "bench-set", "tiny", "--sets", at("set"), "--leaderboard", "out"],
                         [t, "bench-set", "tiny", "--sets", at("set-before"), "--leaderboard", "out"]], kills=8, pairs=True),
        Command("bench-set --leaderboard",
                [t, "bench-set", "tiny", "--sets", at("set"), "--leaderboard", at("benched"), "--out", "out/page.md"], kills=1),
        Command("evaluate", [t, "evaluate", seq, "--meshes", at("compared", "tsdf_close_gt", "frames"), "--at",
                             str(inputs.frames), "--removed", "car", "--json"], writes=False, kills=4),
        Command("verify", [t, "verify", seq, "--all", "--json"], writes=False, kills=4),
        Command("metric trajectory", [t, "metric", "trajectory", at("true.txt"), at("found.txt"), "--align", "se3", "--delta",
                                      "10f,0.1m,1s", "--all-pairs", "--json"], writes=False, kills=2),
        Command("metric surface", [t, "metric", "surface", *surface, "--density", "10", "--json"], writes=False, kills=2),
        Command("metric panoptic", [t, "metric", "panoptic", at("masks-true"), at("masks-found"), "--encoding", "objects",
                                    "--json"], writes=False, kills=2),
        Command("metric pose", [t, "metric", "pose", at("seq", "models", "car-1.ply"), at("true-few.txt"), at("found-few.txt"),
                                "--json"],
                writes=False, kills=2),
        Command("pages.py fill", [sys.executable, "out/scripts/pages.py", "fill", "planted"], given=at("pages"),
                before=[sys.executable, at("pages-before", "scripts", "pages.py"), "list"], kills=5, ours=False),
    ]


def read_notes(folder, names):
    """What scripts/page_text.py says of files that it would take figures from; nothing where it would take them."""
    import pathlib
    for name in names:
        try:
            page_text.check_run(pathlib.Path(folder) / name)
        except (ValueError, OSError, KeyError) as error:
            return str(error) or "refused"
    return ""
