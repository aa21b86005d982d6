#!/usr/bin/python3
"""Draws the plots of docs/map-figures.md and docs/map.md from the tables of `tsdfpp_bench figures`.

Usage: plot_map_figures.py TABLES PICTURES
Every line has a colour and a marker of its own (scripts/method_rows.py).
"""
import csv
import os
import sys

import matplotlib

matplotlib.use("svg")
matplotlib.rcParams.update({
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#dddddd",
    "svg.fonttype": "none",
    "svg.hashsalt": "tsdfpp",  # the same bytes for the same tables
})
import matplotlib.pyplot as plt  # noqa: E402
from matplotlib.patches import Patch, Rectangle  # noqa: E402

from method_rows import method_line, method_styles  # noqa: E402

# Methods, and the settings of methods that have lines of their own.
STYLES = {
    **method_styles(),
    "tsdf++ observed": method_line("tsdf++", "P", "--", second=True),
    "tsdf observed": ("#666666", "d", "--"),
    "tsdf nearest": ("#CC79A7", "*", ":"),
    "tsdf++ nearest": ("#009E73", "X", ":"),
}


def rows_of(folder, name):
    with open(os.path.join(folder, name + ".csv"), newline="") as file:
        return list(csv.DictReader(file))


def draw_line(axes, name, x, y):
    colour, marker, line = STYLES[name]
    axes.plot(x, y, color=colour, marker=marker, linestyle=line, markersize=4.5, linewidth=1.4, label=name,
              clip_on=False, zorder=3)


def save(figure, folder, name, kind="svg"):
    metadata = {"Date": None} if kind == "svg" else None
    figure.savefig(os.path.join(folder, name + "." + kind), bbox_inches="tight", dpi=130, metadata=metadata)
    plt.close(figure)


def decay(tables, pictures):
    # tsdf++/literal resamples as tsdf++ does: one line for both.
    rows = [row for row in rows_of(tables, "decay") if row["moves"].isdigit() and row["map"] != "tsdf++/literal"]
    shown = sorted({int(row["moves"]) for row in rows})
    figure, all_axes = plt.subplots(1, 3, figsize=(9.6, 2.9), constrained_layout=True)
    titles = (("surface left", "surface left, share of what was seen"),
              ("distance error mm", "distance error, mm (RMSE)"),
              ("colour error levels", "change of colour, levels of 255"))
    for axes, (column, title) in zip(all_axes, titles):
        for name in dict.fromkeys(row["map"] for row in rows):
            line = [(shown.index(int(row["moves"])), float(row[column])) for row in rows
                    if row["map"] == name and row[column]]
            draw_line(axes, name, *zip(*line))
        if column == "surface left":
            axes.set_ylim(0, 1.02)
        elif column == "distance error mm":
            axes.set_yscale("log")
            axes.set_ylim(0.5, 300)
            axes.set_yticks([1, 10, 100], ["1", "10", "100"])
        else:
            axes.set_ylim(bottom=0)
        axes.set_xticks(range(len(shown)), [str(n) for n in shown])
        axes.set_xlabel("moves")
        axes.set_title(title, fontsize=9, loc="left")
    figure.legend(*all_axes[0].get_legend_handles_labels(), loc="upper center",
                  bbox_to_anchor=(0.5, 0.0), ncol=6, frameon=False, fontsize=8)
    save(figure, pictures, "map-decay")


def sweep(tables, pictures):
    rows = rows_of(tables, "sweep")
    figure, all_axes = plt.subplots(1, 4, figsize=(11.2, 2.8), constrained_layout=True)
    titles = (("table kept", "hidden table kept after removal"), ("visible completion", "visible completion"),
              ("movers completion", "completion of the moving car"), ("ghost cm2", "ghost area, cm²"))
    for axes, (column, title) in zip(all_axes, titles):
        for name in dict.fromkeys(row["map"] for row in rows):
            line = [(int(row["back voxels"]), float(row[column])) for row in rows if row["map"] == name]
            draw_line(axes, name, *zip(*line))
        axes.set_xticks(range(2, 11))
        axes.set_xlabel("truncation behind, voxels")
        axes.set_title(title, fontsize=9, loc="left")
        axes.set_ylim(bottom=0) if column in ("movers completion", "ghost cm2") else None
    figure.legend(*all_axes[0].get_legend_handles_labels(), loc="upper center", bbox_to_anchor=(0.5, 0.0), ncol=5,
                  frameon=False, fontsize=8)
    save(figure, pictures, "map-sweep")


TABLE = (0.0, 0.447, 0.698)  # blue
CAR = (0.835, 0.369, 0.0)  # vermilion


def shade(colour, distance, truncation=10.0):
    """Paler with the distance in front of the surface, darker with that behind it."""
    far = min(1.0, abs(distance) / truncation)
    if distance >= 0:
        return tuple(c + (1 - c) * (0.25 + 0.65 * far) for c in colour)
    return tuple(c * (1 - 0.45 * far) + (1 - c) * 0.15 * far for c in colour)


def slice_picture(tables, pictures):
    rows = rows_of(tables, "slice")
    ys = sorted({int(row["y"]) for row in rows})
    zs = sorted({int(row["z"]) for row in rows})
    methods = list(dict.fromkeys(row["map"] for row in rows))
    moments = list(dict.fromkeys(row["moment"] for row in rows))
    titles = {"before": "before the car comes", "during": "while the car is there", "after": "after it has left"}
    figure, all_axes = plt.subplots(len(methods), len(moments), figsize=(10.2, 5.4), constrained_layout=True)
    for m, method in enumerate(methods):
        for k, moment in enumerate(moments):
            axes = all_axes[m][k]
            axes.grid(False)
            cells = [row for row in rows if row["map"] == method and row["moment"] == moment]
            fields = {"table voxels": {}, "car voxels": {}}
            for row in cells:
                at = (int(row["y"]), int(row["z"]))
                for column, field in fields.items():
                    if row[column]:
                        field[at] = float(row[column])
                colours = {"0": (TABLE, "table voxels"), "1": (CAR, "car voxels")}
                if row["active"] in colours and row[colours[row["active"]][1]]:
                    colour, column = colours[row["active"]]
                    axes.add_patch(Rectangle((at[0] - 0.5, at[1] - 0.5), 1, 1, linewidth=0.3, edgecolor="white",
                                             facecolor=shade(colour, float(row[column]))))
                if row["inactive"] in colours:
                    axes.add_patch(Rectangle((at[0] - 0.22, at[1] - 0.22), 0.44, 0.44, linewidth=0,
                                             facecolor=colours[row["inactive"]][0]))
            for column, colour in (("table voxels", TABLE), ("car voxels", CAR)):
                field = [[fields[column].get((y, z), float("nan")) for y in ys] for z in zs]
                if fields[column] and min(fields[column].values()) < 0 < max(fields[column].values()):
                    axes.contour(ys, zs, field, levels=[0], colors=["white"], linewidths=3.2)
                    axes.contour(ys, zs, field, levels=[0], colors=[tuple(0.7 * c for c in colour)], linewidths=1.8)
            axes.set_xlim(ys[0] - 0.5, ys[-1] + 0.5)
            axes.set_ylim(zs[0] - 0.5, zs[-1] + 0.5)
            axes.set_aspect("equal")
            axes.set_xticks([])
            axes.set_yticks([])
            for side in axes.spines.values():
                side.set_visible(True)
                side.set_color("#999999")
            if m == 0:
                axes.set_title(titles[moment], fontsize=10)
            if k == 0:
                axes.set_ylabel(method, fontsize=11, family="monospace")
    handles = [Patch(facecolor=TABLE, label="table active"), Patch(facecolor=CAR, label="car active"),
               plt.Line2D([], [], marker="s", linestyle="", color=TABLE, markersize=4, label="table inactive"),
               plt.Line2D([], [], marker="s", linestyle="", color=CAR, markersize=4, label="car inactive"),
               plt.Line2D([], [], color="#333333", linewidth=1.8, label="surface (distance 0)"),
               Patch(facecolor="white", edgecolor="#999999", label="listed nowhere")]
    figure.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, 0.0), ncol=6, frameon=False, fontsize=9)
    save(figure, pictures, "map-slice", "png")  # thousands of squares: an SVG would be ten times as large


def main():
    """Draws the plots whose tables are there."""
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    tables, pictures = sys.argv[1:]
    os.makedirs(pictures, exist_ok=True)
    for name, draw in (("decay", decay), ("sweep", sweep), ("slice", slice_picture)):
        if os.path.exists(os.path.join(tables, name + ".csv")):
            draw(tables, pictures)


if __name__ == "__main__":
    main()
