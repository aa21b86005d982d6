#!/usr/bin/python3
"""What settings of the map and the tracker that are off by default do for tracked objects, each beside those before it.

    /usr/bin/python3 scripts/tracking_switches.py --out out/tracking-switches [--scenes contact,toycar3] [--seeds 2]
        [--program build/release/tsdfpp_bench]

Runs `tsdfpp_bench track` once a row of SWITCHES, on exact depth and on SEEDS draws of noise. Writes OUT/switches.csv, a row
each scene, depth and row of SWITCHES: shifts (mm) and turns (degrees), the median over the objects and the worst.
"""
import argparse
import csv
import pathlib
import subprocess
import sys

from scene_tables import write

RUN = "track tsdf++/anchored"
MAP = 'distances = "surface"\n'
SWITCHES = [
    ("as it is", "", ""),
    ("distances from the surface", MAP, ""),
    ("and trend", MAP, "rest_trend = 5.0\n"),
    ("and turn at rest", MAP, "rest_trend = 5.0\nrest_turn_rad = 0.04\n"),
]


def measure(options, folder, map_settings, track_settings):
    """The rows of shifts.csv and turns.csv, by scene and depth."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "map.toml").write_text(map_settings)
    (folder / "track.toml").write_text(track_settings)
    subprocess.run([options.program, "track", "--only", options.scenes, "--seeds", str(options.seeds), "--runs", RUN,
                    "--map-config", str(folder / "map.toml"), "--track-config", str(folder / "track.toml"),
                    "--out", str(folder / "track")], check=True, stdout=subprocess.DEVNULL)
    tables = []
    for name in ("shifts.csv", "turns.csv"):
        with open(folder / "track" / name, newline="") as file:
            tables.append({(row["scene"], row["depth"]): row for row in csv.DictReader(file)})
    return tables


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--scenes", default="contact,toycar3")
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--program", default="build/release/tsdfpp_bench")
    options = parser.parse_args()
    rows = []
    for i, (name, map_settings, track_settings) in enumerate(SWITCHES):
        shifts, turns = measure(options, options.out / str(i), map_settings, track_settings)
        for (scene, depth), shift in shifts.items():
            row = {"scene": scene, "depth": depth, "settings": name}
            for title, of in (("shift, mm", shift), ("turn, deg", turns[scene, depth])):
                row[f"{title}: median"] = of[f"{RUN}: median"]
                row[f"{title}: worst"] = of[f"{RUN}: worst"]
            rows.append(row)
    rows.sort(key=lambda row: (row["scene"], row["depth"]))
    write(rows, options.out / "switches.csv")


if __name__ == "__main__":
    sys.exit(main())
