#!/usr/bin/python3
"""Writes eval/experiments/crowd.toml: sixty-four small toys on the table, each going to and fro in a cell of its own.

Usage: make_crowd.py FILE
The ids are spread over the table, so that the first n of them are.
"""
import sys

COLUMNS, ROWS = 8, 8
WIDTH, DEPTH = 1.36, 0.80  # of the part of the table that is used, metres
STEP = 0.04  # to either side of the cell's middle
MODELS = [("hexagon", 0.8), ("duck", 0.44), ("house", 0.47), ("pyramid", 0.75), ("truck", 0.25), ("cone", 0.68),
          ("bottle", 0.40), ("car", 0.30)]
TABLE_TOP = 0.74
FRAMES = 120


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    lines = [
        "# Made by scripts/make_crowd.py: sixty-four small toys, each going to and fro in a cell of its own.",
        'name = "crowd"', 'purpose = "Sixty-four small toys go to and fro; an experiment takes the first n of them."',
        f"frames = {FRAMES}", "rate_hz = 30", "", "[camera]", "width = 960", "height = 540", "f = 564.3", "cx = 480",
        "cy = 270", "target = [0.0, 0.0, 0.74]", "azimuth_deg = [-104.0, -90.0, -76.0]",
        "radius_m = [1.10, 1.05, 1.10]", "height_m = [0.95, 1.00, 0.95]"
    ]
    cells = COLUMNS * ROWS
    for number in range(cells):
        # 27 and 64 share no factor: every cell once, neighbours in number far apart on the table.
        cell = (number * 27 + 28) % cells
        x = (cell % COLUMNS + 0.5) / COLUMNS * WIDTH - WIDTH / 2
        y = (cell // COLUMNS + 0.5) / ROWS * DEPTH - DEPTH / 2
        model, scale = MODELS[number % len(MODELS)]
        keys = []
        for k, frame in enumerate(range(10, FRAMES, 25)):
            keys.append(f"  {{ frame = {frame}, position = [{x + (STEP if k % 2 else -STEP):.4f}, {y:.4f}, {TABLE_TOP}],"
                        f" rpy_deg = [0, 0, {(number * 50) % 360 - 180}] }},")
        lines += ["", "[[object]]", f'name = "{model}_{number + 1}"', f"id = {number + 1}", f'class = "{model}"',
                  f'model = "{model}"', f"scale = {scale}", f"x = {x - STEP:.4f}", f"y = {y:.4f}",
                  f"yaw_deg = {(number * 50) % 360 - 180}", "keyframe = ["] + keys + ["]"]
    with open(sys.argv[1], "w") as file:
        file.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
