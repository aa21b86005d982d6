#!/usr/bin/python3
"""The record of fuzzing (docs/fuzzing.md), which scripts/fuzz.sh calls.

    /usr/bin/python3 scripts/fuzz.py record --build build/fuzz --out out/fuzz --record FILE [--targets a,b]
    /usr/bin/python3 scripts/fuzz.py table FILE

`record` adds the runs that are in out/fuzz/<target>/runs.tsv to the record and counts anew the lines that the corpora reach;
`table` prints the record as a table in Markdown.
"""
import argparse
import json
import os
import pathlib
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
SUMS = ("seconds", "executions", "finds")


def targets_of(lines_program):
    """The files of each target, as the program knows them."""
    said = subprocess.run([lines_program, "--sources"], check=True, capture_output=True, text=True).stdout
    return {words[0]: words[1:] for words in map(str.split, said.splitlines())}


def add_runs(folder, entry):
    """Adds what is in runs.tsv, and returns it."""
    runs = folder / "runs.tsv"
    text = runs.read_text() if runs.exists() else ""
    for line in text.splitlines():
        _, seconds, executions, edges, features, find = (int(word) for word in line.split("\t"))
        for name, value in zip(SUMS, (seconds, executions, find)):
            entry[name] = entry.get(name, 0) + value
        # Edges and features of a run are of all inputs that it began with and found.
        if executions > 0:
            entry["edges"] = max(edges, entry.get("edges", 0))
            entry["features"] = max(features, entry.get("features", 0))
    return text


def take_runs(folder, text):
    """What is in the record counts as taken: counted.tsv. A run that ended meanwhile stays."""
    if not text:
        return
    runs = folder / "runs.tsv"
    with open(folder / "counted.tsv", "a") as counted:
        counted.write(text)
    later = runs.read_text()[len(text):]
    if later:
        runs.write_text(later)
    else:
        runs.unlink()


def lines_of(program, target, sources, inputs):
    """Lines of the sources, and how many of these the inputs reach."""
    with tempfile.TemporaryDirectory() as scratch:
        profile = pathlib.Path(scratch) / "profile"
        environment = dict(os.environ, LLVM_PROFILE_FILE=str(profile) + ".raw")
        ran = subprocess.run([program, target, *inputs], env=environment, capture_output=True, text=True)
        if ran.returncode != 0:
            sys.exit(f"fuzz.py: {target}: an input ends the program:\n{ran.stderr[-2000:]}")
        subprocess.run(["llvm-profdata-14", "merge", "-sparse", f"{profile}.raw", "-o", profile], check=True)
        said = subprocess.run(
            ["llvm-cov-14", "export", "-summary-only", program, f"-instr-profile={profile}",
             *(str(ROOT / source) for source in sources)], check=True, capture_output=True, text=True).stdout
    files = {}
    for file in json.loads(said)["data"][0]["files"]:
        lines = file["summary"]["lines"]
        files[str(pathlib.Path(file["filename"]).relative_to(ROOT))] = [lines["covered"], lines["count"]]
    missing = set(sources) - set(files)
    if missing:
        sys.exit(f"fuzz.py: {target}: no lines are known of {', '.join(sorted(missing))}")
    return dict(sorted(files.items()))


def record(options):
    file = pathlib.Path(options.record)
    entries = json.loads(file.read_text())["targets"] if file.exists() else {}
    program = pathlib.Path(options.build) / "tsdfpp_fuzz_lines"
    targets = targets_of(program)
    chosen = options.targets.split(",") if options.targets else list(targets)
    taken = {}
    for target in chosen:
        if target not in targets:
            sys.exit(f"fuzz.py: there is no target '{target}'")
        entry = entries.setdefault(target, {name: 0 for name in SUMS})
        folder = pathlib.Path(options.out) / target
        taken[folder] = add_runs(folder, entry)
        kept = [ROOT / "tests" / "fuzz" / kind / target for kind in ("corpus", "crashes")]
        inputs = [path for path in (*kept, folder / "corpus") if path.is_dir()]
        grown = sum(1 for path in inputs for _ in path.iterdir())
        entry["inputs"] = grown
        entry["lines"] = lines_of(program, target, targets[target], inputs)
    for gone in set(entries) - set(targets):
        del entries[gone]
    file.parent.mkdir(parents=True, exist_ok=True)
    # The runs are taken last: whatever ends the program before leaves them for the next time.
    beside = file.with_name(file.name + ".new")
    beside.write_text(json.dumps({"schema": 1, "targets": dict(sorted(entries.items()))}, indent=1) + "\n")
    beside.replace(file)
    for folder, text in taken.items():
        take_runs(folder, text)


def table(options):
    """Open finds are none of a record's: finds are counted when they are made, and mended ones stay in it."""
    entries = json.loads(pathlib.Path(options.record).read_text())["targets"]
    print("| target | hours | million inputs tried | edges | inputs kept | finds, mended | lines of the reader reached |")
    print("|---|---|---|---|---|---|---|")
    for name, entry in entries.items():
        reached = sum(lines[0] for lines in entry["lines"].values())
        lines = sum(lines[1] for lines in entry["lines"].values())
        print(f"| `{name}` | {entry['seconds'] / 3600:.2f} | {entry['executions'] / 1e6:.2f} | {entry.get('edges', 0)} | "
              f"{entry['inputs']} | {mended(name)} | {reached} of {lines} ({100 * reached / lines:.0f} %) |")


def mended(target):
    folder = ROOT / "tests" / "fuzz" / "crashes" / target
    return sum(1 for _ in folder.iterdir()) if folder.is_dir() else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    of_record = commands.add_parser("record")
    for name in ("--build", "--out", "--record"):
        of_record.add_argument(name, required=True)
    of_record.add_argument("--targets", default="")
    of_record.set_defaults(run=record)
    of_table = commands.add_parser("table")
    of_table.add_argument("record")
    of_table.set_defaults(run=table)
    options = parser.parse_args()
    options.run(options)


if __name__ == "__main__":
    main()
