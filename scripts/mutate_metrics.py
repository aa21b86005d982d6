#!/usr/bin/env python3
"""Breaks the metrics on purpose, one sign, unit or set at a time, and checks that a test notices.

    python3 scripts/mutate_metrics.py [--only PATTERN] [--page docs/metrics-mutations.md]

tests/mutations/metrics.txt lists the mutations: a header line "# name | file | test", then the text
to replace after "- " and its replacement after "+ ". They are applied to a copy of the tree in
build/mutations, never here. `test` is a GoogleTest filter: one of its tests has to fail. Exit code 1
where none does, so that a mutation survives.
"""

import argparse
import collections
import os
import pathlib
import re
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
LIST = ROOT / "tests" / "mutations" / "metrics.txt"
WORK = ROOT / "build" / "mutations"
COPIED = ["CMakeLists.txt", "cmake", "core", "metrics", "tests"]
# A mutation may well make a loop endless.
TEST_LIMIT_S = 300

Mutation = collections.namedtuple("Mutation", "name file test before after")


def read_list():
    mutations = []
    for line in LIST.read_text().splitlines():
        if line.startswith("# "):
            name, file, test = (part.strip() for part in line[2:].split("|"))
            mutations.append(Mutation(name, file, test, [], []))
        elif line.startswith("- "):
            mutations[-1].before.append(line[2:])
        elif line.startswith("+ "):
            mutations[-1].after.append(line[2:])
        elif line.strip():
            sys.exit(f"{LIST}: cannot read the line '{line}'")
    return [m._replace(before="\n".join(m.before), after="\n".join(m.after)) for m in mutations]


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
                      "-DTSDFPP_ROOMS=core;metrics;tests"])
    if configured.returncode != 0:
        sys.exit(configured.stdout)
    return tree, build


def build_tests(build, jobs):
    return run(["ninja", "-C", build, f"-j{jobs}", "metrics_tests"])


def failing_tests(build, test):
    """Names of the tests of this filter that fail; ["(no end)"] where they do not come to one."""
    binary = build / "tests" / "metrics" / "metrics_tests"
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
    found = text.count(mutation.before)
    if found != 1:
        sys.exit(f"{mutation.name}: its text is {found} times in {mutation.file}, expected once:\n"
                 f"{mutation.before}")
    path.write_text(text.replace(mutation.before, mutation.after))
    return text


def one_line(text):
    text = " ".join(text.split()).replace("|", "\\|")
    return f"`{text}`" if text else "(nothing)"


def row_begin(mutation):
    return (f"| {mutation.name} | `{mutation.file}` | {one_line(mutation.before)} | "
            f"{one_line(mutation.after)} | ")


def page(mutations, rows, path):
    """The table in the list's order; of mutations that were not run now, the row of the page as it
    was, where that mutation has not changed since."""
    found = {row_begin(m): row_begin(m) + (", ".join(caught[:2]) or "**survived**") + " |"
             for m, caught in rows}
    old = path.read_text().splitlines() if path.exists() else []
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
        "Each row breaks one sign, unit, set or definition in `metrics/`, and names tests that then "
        "fail. Made by",
        "`python3 scripts/mutate_metrics.py --page docs/metrics-mutations.md` from "
        "`tests/mutations/metrics.txt` (`--only PATTERN` runs some of them); the script ends with "
        "exit code 1 where a mutation survives.",
        "",
        f"{len(lines)} mutations, {len(lines) - survived} caught.",
        "",
        "| mutation | file | was | becomes | caught by |",
        "|---|---|---|---|---|",
    ]
    return "\n".join(head + lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="", help="the mutations whose 'name file' matches this regular expression")
    parser.add_argument("--page", type=pathlib.Path, help="write the table here")
    parser.add_argument("--jobs", type=int, default=2)
    arguments = parser.parse_args()
    listed = read_list()
    mutations = [m for m in listed if re.search(arguments.only, m.name + " " + m.file)]
    if not mutations:
        sys.exit(f"no mutation matches '{arguments.only}'")

    tree, build = prepare()
    built = build_tests(build, arguments.jobs)
    if built.returncode != 0:
        sys.exit(built.stdout)
    sound = failing_tests(build, ":".join(sorted({m.test for m in mutations})))
    if sound:
        sys.exit(f"fails before anything is broken: {', '.join(sound)}")

    rows = []
    for mutation in mutations:
        original = apply(tree, mutation)
        built = build_tests(build, arguments.jobs)
        if built.returncode != 0:
            (tree / mutation.file).write_text(original)
            sys.exit(f"{mutation.name} does not compile:\n{built.stdout}")
        caught = failing_tests(build, mutation.test)
        (tree / mutation.file).write_text(original)
        rows.append((mutation, caught))
        print(f"{mutation.name}: {', '.join(caught[:2]) or 'SURVIVED'}", flush=True)
        if arguments.page:
            arguments.page.write_text(page(listed, rows, arguments.page))
    survivors = [mutation.name for mutation, caught in rows if not caught]
    print(f"{len(rows)} mutations, {len(rows) - len(survivors)} caught")
    sys.exit(1 if survivors else 0)


if __name__ == "__main__":
    main()
