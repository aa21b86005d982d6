#!/usr/bin/python3
"""What tracking costs the surfaces: scenes mapped into tsdf++/anchored with tracked poses and with given ones, true masks.

    /usr/bin/python3 scripts/tracked_surfaces.py --out out/tracked-surfaces [--scenes toycar3,mini]
        [--program build/release/tsdfpp]

Runs `tsdfpp compare` once a scene and depth, exact or with the noise of nguyen2012; pixels that bleed wait with both kinds of
poses. Writes OUT/surfaces.csv, a row each, of the examined frame: the hidden table kept, and the completion and the mean
distance error of the moving objects, the mean over them; and of the object that loses most, by how much tracked is worse.
"""
import argparse
import pathlib
import statistics
import sys

import scene_tables
from scene_tables import text, write

SCENES = "toycar3,handheld,container,contact,fast,mini"
SENSORS = {"exact": "exact", "noise": "nguyen2012"}


def compare(program, scene, sensor, out):
    summary, frames = scene_tables.compare(program, scene, sensor, out, ["--poses", "gt,track", "--bleeding", "wait"])
    kept = {row["poses"]: row["table_preservation_behind_other"] for row in frames}
    return summary["removed"], {run["poses"]: run["examined"] for run in summary["runs"]}, kept


def surfaces_of(examined, movers):
    """Completion and mean distance error, mm, of each; None where the map has nothing of it."""
    objects = {entry["id"]: entry for entry in examined["objects"]}
    completion = [objects[mover]["completion"] for mover in movers]
    error = [objects[mover]["accuracy"]["mean_m"] for mover in movers]
    return completion, [1e3 * value if isinstance(value, float) else None for value in error]


def mean(values):
    known = [value for value in values if value is not None]
    return statistics.fmean(known) if known else None


def most_worse(given, tracked, sign):
    known = [sign * (a - b) for a, b in zip(given, tracked) if a is not None and b is not None]
    return max(known) if known else None


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
        row[f"{title}: most worse"] = text(most_worse(given[i], tracked[i], sign), digits)
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
    write(rows, options.out / "surfaces.csv")


if __name__ == "__main__":
    sys.exit(main())
