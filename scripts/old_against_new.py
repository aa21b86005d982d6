#!/usr/bin/python3
"""Compares this program with that of an older commit: is the new one slower, and are its maps the same?

    python3 scripts/old_against_new.py OLD [--new build/release] [--pairs 11] [--only fusion,...]
        [--methods tsdf,...] [--out FOLDER]
    python3 scripts/old_against_new.py OLD --only maps [--until 64] [--methods tsdf,...] [--out FOLDER]

OLD is a revision, which is built in a copy of its own below out/old (a quarter of an hour on two cores), or a build folder.
Both programs do the same work at the same time, but only one of them runs: each in turn for TURN_S, some ten frames, while
the other is stopped. So what slows the machine for a while slows both. That is one pair; who begins changes from pair to
pair. Printed are, for each measure, the median over the pairs of new over old, with the bounds of its 95 % interval
(bootstrap over the pairs, fixed seed). Exits with 1 where an upper bound is above LIMIT. Use an otherwise idle machine.

Measures: fusion (milliseconds a frame of fusion and pose updates in `map`, medians, by method), rays and meshes (milliseconds
of `tsdfpp_bench rays` and `mesh`, by method), generation (processor seconds of `generate`).

`--only maps` measures no time: both programs map the sequence up to frame --until, and every mesh (each object's, and the
visible scene's) is compared byte by byte. Exits with 1 where one differs.
"""
import argparse
import hashlib
import json
import os
import pathlib
import random
import re
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time

from method_rows import method_rows

TURN_S = 0.3
FRAMES = "40"  # of the scene, that are mapped
RAY_FRAMES = "24"
SMALL_SCENE = ["scenes/mini.toml", "--scale", "3"]  # for `generate`, which makes a whole scene: 48 frames of 960x540
LIMIT = 1.05
ROOMS = "core;sim;sequence;mapper;metrics;eval;cli;bench"  # of an old program, whose tests are not asked for
# Those that are asked for by default; of rays and meshes, of which a bench measures all methods, the only ones.
METHODS = ("tsdf", "tsdf/guarded", "tsdf++", "tsdf++/literal", "tsdf++/anchored", "volumes")
NUMBER = re.compile(r"^[0-9.]+$")


class Fault(Exception):
    pass


def stop(process, number):
    """Sends the signal to the process and all that it started."""
    try:
        os.killpg(process.pid, number)
    except ProcessLookupError:
        pass


def in_turns(commands, log):
    """Runs the commands, one at a time in turns; returns each one's processor seconds, children among them."""
    running, seconds = [], {}
    try:
        start_all(commands, log, running)
        take_turns(commands, log, running, seconds)
    finally:
        for _, process in running:
            stop(process, signal.SIGKILL)
    return [seconds[index] for index in range(len(commands))]


def start_all(commands, log, running):
    """Starts the commands, stopped."""
    for index, command in enumerate(commands):
        with open(log / f"{index}.txt", "w", encoding="utf-8") as text:
            process = subprocess.Popen(command, stdout=text, stderr=subprocess.STDOUT, start_new_session=True)
        stop(process, signal.SIGSTOP)
        running.append((index, process))


def take_turns(commands, log, running, seconds):
    """Lets each run for a turn until all have ended."""
    while running:
        for index, process in list(running):
            stop(process, signal.SIGCONT)
            end = time.monotonic() + TURN_S
            while time.monotonic() < end:
                pid, status, usage = os.wait4(process.pid, os.WNOHANG)
                if pid:
                    if status:
                        raise Fault(f"{' '.join(map(str, commands[index]))} ended with status {status}: "
                                    f"{(log / f'{index}.txt').read_text()[-400:]}")
                    seconds[index] = usage.ru_utime + usage.ru_stime
                    running.remove((index, process))
                    break
                time.sleep(0.005)
            else:
                stop(process, signal.SIGSTOP)


def rows_of(text, heading):
    """{method: numbers of its row} of the table of a bench's output that follows a line that begins so."""
    lines = text.splitlines()
    start = next((i for i, line in enumerate(lines) if line.startswith(heading)), None)
    if start is None:
        raise Fault(f"no line '{heading}...' in the bench's output: {text[-400:]}")
    rows = {}
    for line in lines[start + 1:]:
        if not line.strip():
            break
        name, *numbers = line.split()
        if name in METHODS and all(NUMBER.match(number) for number in numbers):
            rows[name] = [float(number) for number in numbers]
    return rows


class Work:
    """What is measured: for each measure the command of a build and its figures."""

    def __init__(self, scene, folder, methods):
        self.scene, self.folder, self.methods = scene, folder, methods
        self.sequence = folder / "sequence"

    def prepare(self, build):
        subprocess.run([build / "tsdfpp", "generate", self.scene, "--out", self.sequence, "--share", "0"], check=True,
                       stdout=subprocess.DEVNULL)

    def fusion(self, pair):
        for method in self.methods:
            def command(build, index, method=method):
                return [build / "tsdfpp", "map", self.sequence, "--method", method, "--threads", "2", "--until", FRAMES,
                        "--out", self.folder / f"map{index}"]

            def figures(index, _, __, method=method):
                times = json.loads((self.folder / f"map{index}" / "stats.json").read_text())["times"]
                shutil.rmtree(self.folder / f"map{index}")
                return {f"fusion, {method}": times["fuse"]["median_ms"] + times["update_poses"]["median_ms"]}

            yield command, figures

    def rays(self, pair):
        def command(build, _):
            return [build / "tsdfpp_bench", "rays", "--scene", self.scene, "--frames", RAY_FRAMES]

        def figures(_, __, text):
            return {f"rays, {name}": row[0] for name, row in rows_of(text, " " * 31 + "wall ms").items()}

        yield command, figures

    def meshes(self, pair):
        def command(build, _):
            return [build / "tsdfpp_bench", "mesh", "--scene", self.scene, "--frames", FRAMES]

        def figures(_, __, text):
            rows = rows_of(text, "kept meshes, frame by frame")
            return {f"meshes from scratch, {name}": row[1] for name, row in rows.items()} | {
                f"meshes kept, {name}": row[3] for name, row in rows.items()}

        yield command, figures

    def generation(self, pair):
        def command(build, index):
            return [build / "tsdfpp", "generate", *SMALL_SCENE, "--share", "0", "--jobs", "1", "--out",
                    self.folder / f"generated{index}"]

        def figures(index, seconds, _):
            shutil.rmtree(self.folder / f"generated{index}")
            return {"generation": seconds}

        yield command, figures


def digests(folder):
    """{file: SHA-256} of the meshes of a run."""
    files = sorted((folder / "mesh").iterdir())
    return {file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in files}


def compare_maps(builds, work, until):
    """The table of methods, and those of which a mesh differs."""
    lines, different = ["| method | meshes | vertices and triangles as before, byte by byte |", "|---|---|---|"], []
    for method in work.methods:
        runs = []
        for index, build in enumerate(builds):
            out = work.folder / f"map{index}"
            subprocess.run([build / "tsdfpp", "map", work.sequence, "--method", method, "--until", str(until), "--out", out],
                           check=True, stdout=subprocess.DEVNULL)
            runs.append(digests(out))
            shutil.rmtree(out)
        old, new = runs
        same = [name for name in old if new.get(name) == old[name]]
        lines.append(f"| {method} | {len(old)} | {len(same)} |")
        if len(same) < len(old) or len(new) != len(old):
            different.append(method)
    return "\n".join(lines), different


def built(old):
    """The build folder that `old` is, or that of the revision, built where it is not yet."""
    if pathlib.Path(old).is_dir():
        return pathlib.Path(old)
    found = subprocess.run(["git", "rev-parse", "--verify", "--quiet", "--end-of-options", old + "^{commit}"],
                           capture_output=True, text=True, check=False)
    if found.returncode:
        raise Fault(f"{old}: expected a build folder or a revision, found neither")
    revision = found.stdout.strip()
    tree = pathlib.Path("out/old") / revision
    if not tree.is_dir():
        subprocess.run(["git", "worktree", "add", "--quiet", "--detach", tree, revision], check=True)
    deps = tree / ".deps"
    if not deps.exists():
        deps.symlink_to(pathlib.Path(".deps").resolve())
    for command in (["cmake", "--preset", "release", f"-DTSDFPP_ROOMS={ROOMS}"],
                    ["cmake", "--build", "--preset", "release", "--target", "tsdfpp_command", "tsdfpp_bench"]):
        subprocess.run(command, cwd=tree, check=True, stdout=sys.stderr)
    return (tree / "build/release").resolve()


def bounds(ratios):
    """The median, and the 2.5 and 97.5 percentiles of medians of samples drawn again."""
    draw = random.Random(20210531)
    medians = sorted(statistics.median(draw.choices(ratios, k=len(ratios))) for _ in range(4000))
    return statistics.median(ratios), medians[100], medians[3899]


def write(table, out, name):
    """Prints the table and, where asked for, leaves it in a folder."""
    print(table)
    if out:
        out.mkdir(parents=True, exist_ok=True)
        part = out / f"{name}.part"
        part.write_text(table + "\n", encoding="utf-8")
        part.replace(out / name)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old")
    parser.add_argument("--new", type=pathlib.Path, default=pathlib.Path("build/release"))
    parser.add_argument("--out", type=pathlib.Path, help="folder for turns.md, the table")
    parser.add_argument("--pairs", type=int, default=11)
    parser.add_argument("--only", default="fusion,rays,meshes,generation")
    parser.add_argument("--methods", default=",".join(METHODS), help=f"of fusion; rays and meshes are of {', '.join(METHODS)}")
    parser.add_argument("--until", type=int, default=64, help="the last frame of maps")
    parser.add_argument("--scene", default="scenes/toycar3.toml")
    options = parser.parse_args()
    measures = [] if options.only == "maps" else options.only.split(",")
    unknown = [name for name in measures if name not in ("fusion", "rays", "meshes", "generation")]
    if unknown:
        parser.error(f"--only: expected maps or some of fusion, rays, meshes, generation, found '{unknown[0]}'")
    methods = options.methods.split(",")
    known = [row["name"] for row in method_rows(options.new / "tsdfpp")]
    unknown = [name for name in methods if name not in known]
    if unknown:
        parser.error(f"--methods: expected some of {', '.join(known)}, found '{unknown[0]}'")
    if options.pairs < 2:
        parser.error(f"--pairs: expected 2 or more, found {options.pairs}")
    builds = [built(options.old), options.new]
    for build in builds:
        for program in ("tsdfpp", "tsdfpp_bench"):
            if not (build / program).is_file():
                parser.error(f"{build / program}: expected a program, found none")
    if not measures:
        with tempfile.TemporaryDirectory() as folder:
            work = Work(options.scene, pathlib.Path(folder), methods)
            work.prepare(options.new)
            table, different = compare_maps(builds, work, options.until)
        write(table, options.out, "maps.md")
        if different:
            print(f"other meshes than before: {', '.join(different)}")
        return 1 if different else 0
    ratios = {}
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        work = Work(options.scene, folder, methods)
        if "fusion" in measures:
            work.prepare(options.new)
        for pair in range(options.pairs):
            order = [0, 1] if pair % 2 == 0 else [1, 0]
            for measure in measures:
                for command, figures in getattr(work, measure)(pair):
                    seconds = in_turns([command(builds[which], index) for index, which in enumerate(order)], folder)
                    found = [figures(index, seconds[index], (folder / f"{index}.txt").read_text()) for index in (0, 1)]
                    old, new = found if order[0] == 0 else found[::-1]
                    for name in old.keys() & new.keys():
                        ratios.setdefault(name, []).append(new[name] / old[name])
            print(f"pair {pair + 1} of {options.pairs}", file=sys.stderr, flush=True)
    lines = ["| measure | pairs | new over old, median | 95 % interval |", "|---|---|---|---|"]
    slower = []
    for name in sorted(ratios):
        median, low, high = bounds(ratios[name])
        lines.append(f"| {name} | {len(ratios[name])} | {median:.3f} | {low:.3f} to {high:.3f} |")
        if high > LIMIT:
            slower.append(name)
    write("\n".join(lines), options.out, "turns.md")
    if slower:
        print(f"upper bound above {LIMIT}: {', '.join(slower)}")
        return 1
    return 0


if __name__ == "__main__":
    os.chdir(pathlib.Path(__file__).resolve().parent.parent)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(2))
    try:
        sys.exit(main())
    except Fault as fault:
        print(f"old_against_new.py: {fault}", file=sys.stderr)
        sys.exit(2)
