#!/usr/bin/python3
"""The whole pipeline from pixels: scenes mapped with a Kinect's noise, segments of depth and our own network joined, ids by
votes, objects tracked; beside it the same with the true masks.

    /usr/bin/python3 scripts/pixels.py --out out/pixels [--scenes toycar3,tumble] [--mask-repair on]
        [--program build/release/tsdfpp]

Runs `tsdfpp compare` twice a scene and writes OUT/pixels.csv, a row a scene, of tsdf++/anchored at the examined frame:
true objects that were found, of how many, those of which the map has anything at the end, and its objects that are nobody's;
the hidden table kept and the completion of the moving objects, from pixels and with true masks; the greatest unaligned ATE and
rotation error of the objects that moved, in the frames in which the map had them. --mask-repair on repairs the masks from
pixels (docs/segmentation.md, Wrong masks), not the true ones.
"""
import argparse
import pathlib
import sys

import scene_tables
from scene_tables import text, write

SCENES = "contact,container,fast,handheld,occlusion,reentry,stack,thin,toycar3,tumble"
SENSOR = "nguyen2012+colour_noise"


def compare(program, scene, out, options):
    summary, frames = scene_tables.compare(program, scene, SENSOR, out, ["--poses", "track", *options])
    return summary["runs"][0], frames[-1]


def worst(run, key, factor, digits):
    """Of the objects that moved and were found, the greatest."""
    values = [factor * track[key] for track in (run["trajectories"] or {}).values() if track.get(key) is not None]
    return text(max(values), digits) if values else "-"


def row_of(program, scene, out, repair):
    pixels, at_pixels = compare(program, scene, out / f"{scene}-pixels", ["--segmentation", "full", "--mask-repair", repair])
    masks, at_masks = compare(program, scene, out / f"{scene}-masks", [])
    matched = pixels["matched_ids"]
    true = {entry["object"] for entry in matched if entry["object"] is not None}
    objects = [entry for entry in pixels["examined"]["objects"] if entry["id"] != 0]
    there = sum(isinstance(entry["accuracy"]["mean_m"], float) for entry in objects)
    row = {"scene": scene, "objects found": f"{len(true)} of {len(objects)}", "there at the end": there,
           "nobody's": str(sum(entry["object"] is None for entry in matched))}
    for title, column in (("hidden table kept", "table_preservation_behind_other"), ("movers' completion", "movers_completion")):
        row[f"{title}: from pixels"] = text(at_pixels[column], 3)
        row[f"{title}: true masks"] = text(at_masks[column], 3)
    for title, key, factor, digits in (("worst ATE, mm", "ate_rmse_m", 1e3, 1), ("worst rotation, deg", "rotation_rmse_deg", 1, 2)):
        row[f"{title}: from pixels"] = worst(pixels, key, factor, digits)
        row[f"{title}: true masks"] = worst(masks, key, factor, digits)
    return row


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--scenes", default=SCENES)
    parser.add_argument("--mask-repair", choices=("off", "on"), default="off")
    parser.add_argument("--program", default="build/release/tsdfpp")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    rows = []
    for scene in options.scenes.split(","):
        rows.append(row_of(options.program, scene, options.out, options.mask_repair))
        print(", ".join(f"{key} {value}" for key, value in rows[-1].items()), flush=True)
    write(rows, options.out / "pixels.csv")


if __name__ == "__main__":
    sys.exit(main())
