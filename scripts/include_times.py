#!/usr/bin/python3
"""Says what headers cost: how long a plain build reads those of each library, by clang's -ftime-trace.

    python3 scripts/include_times.py [--jobs N] [--every N] [--out FILE] [SOURCE ...]

Compiles the sources (all of the build by default), one by one, without precompiled headers and optimisation, into a folder
that is thrown away. Printed are, for each group of headers, the sources that read it, and its share of the seconds of all
sources. Headers that others of the group include are part of it; what a group includes of another group counts for both.
Needs clang-14 (`bash scripts/setup.sh --fuzz`). Every tenth source takes some two minutes on two cores.
"""
import argparse
import concurrent.futures
import json
import os
import pathlib
import shlex
import subprocess
import sys
import tempfile

COMPILER = "clang++-14"
OPENMP = "/usr/lib/gcc/x86_64-linux-gnu/12/include"  # where GCC has the header of OpenMP
GROUPS = {
    "C++ standard library": "/include/c++/",
    "Eigen": "/eigen3/",
    "OpenCV": "/opencv4/",
    "PCL": "/pcl-",
    "Open3D": "/open3d/",
    "JSON (nlohmann)": "/nlohmann/",
    "TOML (toml++)": "/toml++/",
    "fmt and spdlog": ("/fmt/", "/spdlog/"),
    "oneTBB": ("/tbb/", "/oneapi/"),
    "CLI11": "/CLI/",
    "GoogleTest": ("/gtest/", "/gmock/"),
    "RapidCheck": "/rapidcheck",
    "MuJoCo": "/mujoco/",
}


class Fault(Exception):
    pass


def is_of(group, header):
    parts = GROUPS[group]
    return any(part in header for part in ([parts] if isinstance(parts, str) else parts))


def traced(entry, folder, number):
    """The events of compiling one source."""
    words = shlex.split(entry["command"])
    kept, skip = [], False
    for word in words[words.index(next(word for word in words if word.endswith("c++"))) + 1:]:
        if skip or word.startswith(("-W", "-O", "-g")) or word in ("-c", "-fopenmp", entry["file"]):
            skip = False
        elif word == "-o":
            skip = True
        else:
            kept.append(word)
    out = folder / f"{number}.o"
    command = [COMPILER, *kept, "-idirafter", OPENMP, "-w", "-O0", "-ftime-trace", "-c", entry["file"], "-o", out]
    done = subprocess.run(command, cwd=entry["directory"], capture_output=True, text=True, check=False)
    if done.returncode:
        raise Fault(f"{entry['file']}: {COMPILER} ended with {done.returncode}: {done.stderr[-400:]}")
    events = json.loads(out.with_suffix(".json").read_text(encoding="utf-8"))["traceEvents"]
    out.unlink()
    return events


def seconds_by_group(events):
    """{group: seconds} of the outermost headers of each group, and of all under 'all'."""
    sources = sorted(((e["ts"], -e["dur"], e["args"]["detail"]) for e in events if e["name"] == "Source"))
    found = {"all": next(e["dur"] for e in events if e["name"] == "Total ExecuteCompiler") / 1e6}
    for group in GROUPS:
        end = -1
        for begin, minus_duration, header in sources:
            if begin >= end and is_of(group, header):
                end = begin - minus_duration
                found[group] = found.get(group, 0) - minus_duration / 1e6
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sources", nargs="*")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--every", type=int, default=1, help="take only every Nth source, in the order of their names")
    parser.add_argument("--out", type=pathlib.Path, help="file for the table")
    options = parser.parse_args()
    root = str(pathlib.Path.cwd())
    subprocess.run(["cmake", "--preset", "release", "-B", "build/plain", "-DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON",
                    "-DCMAKE_UNITY_BUILD=OFF"], check=True, stdout=subprocess.DEVNULL)
    entries = json.loads(pathlib.Path("build/plain/compile_commands.json").read_text(encoding="utf-8"))
    known = {os.path.relpath(entry["file"], root): entry for entry in entries if entry["file"].endswith(".cc")}
    known.pop("viewer/report_template.cc")  # takes in the report's page, which is not built here
    unknown = [source for source in options.sources if source not in known]
    if unknown:
        parser.error(f"{unknown[0]}: expected a source of the build, such as mapper/pipeline.cc")
    if options.every < 1:
        parser.error(f"--every: expected 1 or more, found {options.every}")
    chosen = [known[source] for source in (options.sources or sorted(known))[::options.every]]
    totals, counts = {}, {}
    with tempfile.TemporaryDirectory() as folder, concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        tasks = [pool.submit(traced, entry, pathlib.Path(folder), i) for i, entry in enumerate(chosen)]
        for task in tasks:
            for group, seconds in seconds_by_group(task.result()).items():
                totals[group] = totals.get(group, 0) + seconds
                counts[group] = counts.get(group, 0) + 1
    lines = ["| headers | sources that read them | seconds | share of all |", "|---|---|---|---|"]
    for group in sorted(totals, key=totals.get, reverse=True):
        lines.append(f"| {group} | {counts[group]} | {totals[group]:.0f} | {totals[group] / totals['all']:.2f} |")
    table = "\n".join(lines)
    print(table)
    if options.out:
        options.out.parent.mkdir(parents=True, exist_ok=True)
        part = options.out.with_name(options.out.name + ".part")
        part.write_text(table + "\n", encoding="utf-8")
        part.replace(options.out)


if __name__ == "__main__":
    os.chdir(pathlib.Path(__file__).resolve().parent.parent)
    try:
        main()
    except Fault as fault:
        print(f"include_times.py: {fault}", file=sys.stderr)
        sys.exit(2)
