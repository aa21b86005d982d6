#!/usr/bin/python3
"""What tracking costs the surfaces: scenes mapped into tsdf++/anchored with tracked poses and with given ones, true masks.

    /usr/bin/python3 scripts/tracked_surfaces.py --out out/tracked-surfaces [--scenes toycar3,mini]
        [--program build/release/tsdfpp]

Runs `tsdfpp compare` once a scene and depth, exact or with the noise of nguyen2012; pixels that bleed wait with both kinds of
poses. Writes OUT/surfaces.csv, a row each, of the examined frame: the hidden table kept, and the completion and the mean
distance error of the moving objects, the mean over them; and of the object that loses most, by how much tracked is worse.
"""
import argparse
import csv
import json
import pathlib
import statistics
import subprocess
import sys

SCENES = "toycar3,handheld,container,contact,fast,mini"
SENSORS = {"exact": "exact", "noise": "nguyen2012"}
LONG = 1_000_000  # frames between evaluations: the examined frame alone


def compare(program, scene, sensor, out):
    command = [program, "compare", f"scenes/{scene}.toml", "--sensor", sensor, "--methods", "tsdf++/anchored", "--profiles",
               "close", "--poses", "gt,track", "--bleeding", "wait", "--every", str(LONG), "--out", str(out)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    summary = json.loads((out / "summary.json").read_text())
    with open(out / "frames.csv", newline="") as file:
        kept = {row["poses"]: row["table_preservation_behind_other"] for row in csv.DictReader(file)}
    return summary["removed"], {run["poses"]: run["examined"] for run in summary["runs"]}, kept


def surfaces_of(examined, movers):
    """Completion and mean distance error, mm, of each; None where the map has nothing of it."""
    objects = {entry["id"]: entry for entry in examined["objects"]}
    completion = [objects[mover]["completion"] for mover in movers]
    error = [objects[mover]["accuracy"]["mean_m"] for mover in movers]
    return completion, [1e3 * value if isinstance(value, float) else None for value in error]


def text(value, digits):
    return "-" if value in (None, "") else f"{round(float(value), digits) + 0.0:.{digits}f}"  # no -0


def mean(values):
    known = [value for value in values if value is not None]
    return statistics.fmean(known) if known else None


def most(differences):
    known = [value for value in differences if value is not None]
    return max(known) if known else None


def less(given, tracked):
    return None if given is None or tracked is None else given - tracked


def row_of(program, scene, depth, out):
    movers, examined, kept = compare(program, scene, SENSORS[depth], out / f"{scene}-{depth}")
    given = surfaces_of(examined["gt"], movers)
    tracked = surfaces_of(examined["track"], movers)
    row = {"scene": scene, "depth": depth, "objects": len(movers)}
    row["hidden table kept: given"] = text(kept["gt"], 3)
    row["hidden table kept: tracked"] = text(kept["track"], 3)
    for title, i, digits, sign in (("completion", 0, 3, 1), ("distance error, mm", 1, 2, -1)):
        row[f"{title}: given"] = text(mean(given[i]), digits)
        row[f"{title}: tracked"] = text(mean(tracked[i]), digits)
        worse = most(None if (by := less(a, b)) is None else sign * by for a, b in zip(given[i], tracked[i]))
        row[f"{title}: most worse"] = text(worse, digits)
    return row


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--scenes", default=SCENES)
    parser.add_argument("--program", default="build/release/tsdfpp")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    rows = []
    for scene in options.scenes.split(","):
        for depth in SENSORS:
            rows.append(row_of(options.program, scene, depth, options.out))
            print(", ".join(f"{key} {value}" for key, value in rows[-1].items()), flush=True)
    part = options.out / "surfaces.csv.part"
    with open(part, "w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys(), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    part.rename(options.out / "surfaces.csv")


if __name__ == "__main__":
    sys.exit(main())
