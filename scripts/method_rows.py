"""The methods, asked of the program (`tsdfpp methods --json`, mapper/method_info.cc), and how plots draw them: in the row's
colour, as in the report, with a marker and a dash of the plots' own, so that neither colour-blind readers nor a
black-and-white printer lose a line.
"""
import functools
import json
import pathlib
import subprocess
import sys

PROGRAM = pathlib.Path(__file__).resolve().parents[1] / "build" / "release" / "tsdfpp"
MARKS = {
    "tsdf": ("s", "-"),
    "tsdf/min": ("D", "--"),
    "tsdf/guarded": ("p", "-"),
    "tsdf/static": ("x", ":"),
    "tsdf++": ("o", "-"),
    "tsdf++/literal": ("v", "-."),
    "tsdf++/anchored": ("^", "-"),
    "volumes": ("P", "--"),
    "surfels": ("*", "-."),
}
PLAIN = (".", "-")  # of a method without marks of its own


@functools.cache
def method_rows(program=PROGRAM):
    """The methods' rows, in the program's order."""
    if not program.exists():
        sys.exit(f"there is no {program} to ask for the methods: run bash scripts/build.sh --target tsdfpp_command")
    printed = subprocess.run([program, "methods", "--json"], check=True, capture_output=True, text=True).stdout
    return tuple(json.loads(printed))


def method_styles(program=PROGRAM):
    """{name: (colour, marker, dash)} of all methods."""
    return {row["name"]: (row["on_light"], *MARKS.get(row["name"], PLAIN)) for row in method_rows(program)}


def method_line(name, marker, dash, second=False, program=PROGRAM):
    """The style of the method with other marks; of a second line beside its own, in the row's colour for dark ground."""
    row = next(row for row in method_rows(program) if row["name"] == name)
    return (row["on_dark" if second else "on_light"], marker, dash)
