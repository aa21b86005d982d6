#!/usr/bin/env python3
"""Breaks the metrics, and what scores maps with them, on purpose, one sign, unit or set at a time,
and checks that a test notices.

    python3 scripts/mutate_metrics.py [--only PATTERN] [--page docs/metrics-mutations.md]
    python3 scripts/mutate_metrics.py --check

tests/mutations/*.txt list the mutations: a header line "# name | file | test", then the text to
replace after "- " and its replacement after "+ ". They are applied to a copy of the tree in
build/mutations, never here. `test` is a GoogleTest filter: one of its tests has to fail. Exit code 1
where none does, so that a mutation survives. --page FILE writes a table there; of mutations that
were not run it has the rows of docs/metrics-mutations.md. --check builds nothing: it looks whether
each mutation can still be made and names tests that there are; exit code 1 where one cannot.
"""

import argparse
import collections
import fnmatch
import os
import pathlib
import re
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
LISTS = ["metrics", "eval"]
WORK = ROOT / "build" / "mutations"
PAGE = "docs/metrics-mutations.md"
# Of the rooms all, though few are built: cmake/compiled_together.txt names files of each, which have to be there.
COPIED = ["CMakeLists.txt", "cmake", "core", "sim", "sequence", "mapper", "metrics", "eval", "cli", "bench", "tests"]
# The test binary of a room, with the sources it is made of: what the room's tests build without a
# simulator.
TARGETS = {"metrics": "metrics_tests", "eval": "score_tests"}
# A mutation may well make a loop endless.
TEST_LIMIT_S = 300

Mutation = collections.namedtuple("Mutation", "name file test before after")


def room_of(mutation):
    return mutation.file.split("/")[0]


def read_list(path):
    mutations = []
    for line in path.read_text().splitlines():
        if line.startswith("# "):
            parts = [part.strip() for part in line[2:].split("|")]
            if len(parts) != 3:
                sys.exit(f"{path}: cannot read the line '{line}', expected '# name | file | test'")
            mutations.append(Mutation(*parts, [], []))
        elif line.startswith("- ") and mutations:
            mutations[-1].before.append(line[2:])
        elif line.startswith("+ ") and mutations:
            mutations[-1].after.append(line[2:])
        elif line.strip():
            sys.exit(f"{path}: cannot read the line '{line}'")
    return [m._replace(before="\n".join(m.before), after="\n".join(m.after)) for m in mutations]


def read_lists(root=ROOT):
    return [m for name in LISTS for m in read_list(root / "tests" / "mutations" / f"{name}.txt")]


def tests_of(room, root=ROOT):
    """Suite.Name of the tests in the sources of the room's binary; of those with parameters as
    GoogleTest would call the first."""
    folder = root / "tests" / room
    cmake = (folder / "CMakeLists.txt").read_text()
    listed = re.search(r"tsdfpp_test\(\s*" + TARGETS[room] + r"\b(.*?)\bLINK\b", cmake, re.DOTALL)
    names = set()
    for source in re.findall(r"\b\w+_test\.cc\b", listed.group(1)):
        text = (folder / source).read_text()
        for kind, suite, name in re.findall(r"^TEST(_F|_P)?\(\s*(\w+),\s*(\w+)\)", text, re.MULTILINE):
            names.add(f"All/{suite}.{name}/0" if kind == "_P" else f"{suite}.{name}")
    return names


def faults_of(mutations, root=ROOT):
    """A sentence for each mutation that cannot be made, or that no test could notice."""
    tests = {room: tests_of(room, root) for room in {room_of(m) for m in mutations} if room in TARGETS}
    faults = []
    names = collections.Counter((m.name, m.file) for m in mutations)
    for m in mutations:
        path = root / m.file
        if names[m.name, m.file] > 1:
            faults.append(f"{m.name}: stands {names[m.name, m.file]} times in the lists")
        if room_of(m) not in TARGETS or not path.is_file():
            faults.append(f"{m.name}: {m.file} is no file of {' or '.join(TARGETS)}")
            continue
        found = path.read_text().count(m.before) if m.before else 0
        if found != 1:
            faults.append(f"{m.name}: its text is {found} times in {m.file}, expected once: {m.before}")
        if m.before == m.after:
            faults.append(f"{m.name}: changes nothing")
        for part in m.test.split(":"):
            if not fnmatch.filter(tests[room_of(m)], part):
                faults.append(f"{m.name}: '{part}' names no test of {TARGETS[room_of(m)]}")
    return faults


def run(command, limit_s=None):
    return subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                          timeout=limit_s)


def prepare():
    """The copy, configured. What has not changed since the last run is not built again."""
    tree = WORK / "tree"
    wanted = set()
    for name in COPIED:
        for source in [ROOT / name] if (ROOT / name).is_file() else (ROOT / name).rglob("*"):
            if source.is_dir() or "__pycache__" in source.parts:
                continue
            target = tree / source.relative_to(ROOT)
            wanted.add(target)
            if not target.exists() or target.read_bytes() != source.read_bytes():
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(source, target)
    for name in COPIED:
        for target in (tree / name).rglob("*"):
            if target.is_file() and target not in wanted:
                target.unlink()
    shared = WORK / "shared"
    if not shared.exists():
        os.symlink((ROOT / ".." / "shared").resolve(), shared)
    # Where a build lies in a tree decides what ccache knows of it: in the same place as ours.
    build = tree / "build" / "release"
    configured = run(["cmake", "-S", tree, "-B", build, "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release",
                      "-DTSDFPP_ROOMS=core;mapper;metrics;eval;tests"])
    if configured.returncode != 0:
        sys.exit(configured.stdout)
    return tree, build


def build_tests(build, room, jobs):
    return run(["ninja", "-C", build, f"-j{jobs}", TARGETS[room]])


def failing_tests(build, room, test):
    """Names of the tests of this filter that fail; ["(no end)"] where they do not come to one."""
    binary = build / "tests" / room / TARGETS[room]
    try:
        result = run([binary, f"--gtest_filter={test}"], TEST_LIMIT_S)
    except subprocess.TimeoutExpired:
        return ["(no end)"]
    if "Running 0 tests" in result.stdout:
        sys.exit(f"the filter '{test}' names no test")
    failed = re.findall(r"^\[  FAILED  \] ([\w./]+)(?: \(|$)", result.stdout, re.MULTILINE)
    if result.returncode != 0 and not failed:
        return ["(crash)"]
    return sorted(set(failed))


def apply(tree, mutation):
    path = tree / mutation.file
    text = path.read_text()
    path.write_text(text.replace(mutation.before, mutation.after))
    return text


def one_line(text):
    text = " ".join(text.split()).replace("|", "\\|")
    return f"`{text}`" if text else "(nothing)"


def row_begin(mutation):
    return (f"| {mutation.name} | `{mutation.file}` | {one_line(mutation.before)} | "
            f"{one_line(mutation.after)} | ")


def page(mutations, rows, old):
    """The table in the list's order; of mutations that were not run now, the row of the old page's
    lines, where that mutation has not changed since."""
    found = {row_begin(m): row_begin(m) + (", ".join(caught[:2]) or "**survived**") + " |"
             for m, caught in rows}
    lines = []
    for mutation in mutations:
        begin = row_begin(mutation)
        kept = [line for line in old if line.startswith(begin)]
        if begin in found or kept:
            lines.append(found.get(begin) or kept[0])
    survived = sum(1 for line in lines if "**survived**" in line)
    head = [
        "# Mutations of the metrics",
        "",
        "Each row breaks one sign, unit, set or definition in `metrics/` or in what scores a map with "
        "them (`eval/`), and names",
        "tests that then fail. Made by `python3 scripts/mutate_metrics.py --page "
        "docs/metrics-mutations.md` from",
        "`tests/mutations/*.txt` (`--only PATTERN` runs some of them); the script ends with exit code "
        "1 where a mutation",
        "survives. That each can still be made is a test of every build (`--check`); that each is "
        "still caught, of",
        "`scripts/nightly.sh`.",
        "",
        f"{len(lines)} mutations, {len(lines) - survived} caught.",
        "",
        "| mutation | file | was | becomes | caught by |",
        "|---|---|---|---|---|",
    ]
    return "\n".join(head + lines) + "\n"


def main(options=None, root=ROOT):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="", help="the mutations whose 'name file' matches this regular expression")
    parser.add_argument("--page", type=pathlib.Path, help="write the table here")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--check", action="store_true", help="build nothing: can each mutation still be made?")
    arguments = parser.parse_args(options)
    listed = read_lists(root)
    mutations = [m for m in listed if re.search(arguments.only, m.name + " " + m.file)]
    if not mutations:
        sys.exit(f"no mutation matches '{arguments.only}'")
    faults = faults_of(mutations, root)
    if faults:
        sys.exit("\n".join(faults))
    if arguments.check:
        print(f"{len(mutations)} mutations, each of them can be made")
        return

    tree, build = prepare()
    for room in sorted({room_of(m) for m in mutations}):
        built = build_tests(build, room, arguments.jobs)
        if built.returncode != 0:
            sys.exit(built.stdout)
        filters = sorted({m.test for m in mutations if room_of(m) == room})
        sound = failing_tests(build, room, ":".join(filters))
        if sound:
            sys.exit(f"fails before anything is broken: {', '.join(sound)}")

    # Not of the page that is written: `pages.py make` writes into out/, where there may be none, or
    # one of an earlier time.
    old = (root / PAGE).read_text().splitlines() if (root / PAGE).exists() else []
    rows = []
    uncompiled = []
    for mutation in mutations:
        room = room_of(mutation)
        original = apply(tree, mutation)
        built = build_tests(build, room, arguments.jobs)
        caught = failing_tests(build, room, mutation.test) if built.returncode == 0 else []
        (tree / mutation.file).write_text(original)
        if built.returncode != 0:
            uncompiled.append(mutation.name)
            print(f"{mutation.name} does not compile:\n{built.stdout}", flush=True)
            continue
        rows.append((mutation, caught))
        print(f"{mutation.name}: {', '.join(caught[:2]) or 'SURVIVED'}", flush=True)
        if arguments.page:
            arguments.page.write_text(page(listed, rows, old))
    survivors = [mutation.name for mutation, caught in rows if not caught]
    print(f"{len(rows)} mutations, {len(rows) - len(survivors)} caught; {len(uncompiled)} do not compile")
    sys.exit(1 if survivors or uncompiled else 0)


if __name__ == "__main__":
    main()
