#!/usr/bin/python3
"""Draws the plots of docs/scaling.md from the tables of `tsdfpp_bench scaling`, and adds one to them, surface_fit.csv.

Usage: plot_scaling_figures.py TABLES PICTURES
"""
import os
import sys

from method_rows import method_line
from plot_map_figures import STYLES, plt, rows_of, save

STYLES.update({
    "volumes": method_line("volumes", "X", "-"),
    "tsdf++/anchored moved": method_line("tsdf++/anchored", "^", "--"),
    "volumes moved": method_line("volumes", "X", "--"),
})


def draw(axes, name, x, y):
    colour, marker, line = STYLES[name]
    axes.plot(x, y, color=colour, marker=marker, linestyle=line, markersize=4.5, linewidth=1.4, label=name, zorder=3)


def names_of(rows, column="map"):
    return list(dict.fromkeys(row[column] for row in rows))


def legend(figure, axes, columns=5):
    figure.legend(*axes.get_legend_handles_labels(), loc="upper center", bbox_to_anchor=(0.5, 0.0), ncol=columns,
                  frameon=False, fontsize=8)


def frames(tables, pictures):
    rows = rows_of(tables, "frames")
    scenes = names_of(rows, "scene")
    figure, all_axes = plt.subplots(1, 2 * len(scenes), figsize=(11.2, 2.8), constrained_layout=True)
    for s, scene in enumerate(scenes):
        for k, (column, title) in enumerate((("CPU ms", "CPU ms a frame"), ("blocks", "blocks, thousands"))):
            axes = all_axes[2 * s + k]
            for name in names_of(rows):
                line = [row for row in rows if row["scene"] == scene and row["map"] == name]
                scale = 1 if k == 0 else 1e-3
                draw(axes, name, [int(row["tenth"]) for row in line], [scale * float(row[column]) for row in line])
            axes.set_ylim(bottom=0)
            axes.set_xticks(range(1, 11))
            axes.set_xlabel("tenth of the run")
            axes.set_title(scene + ": " + title, fontsize=9, loc="left")
    legend(figure, all_axes[0])
    save(figure, pictures, "scaling-frames")


def line_through(x, y):
    """Least squares: slope, intercept, and the share of the variance that the line explains."""
    n = len(x)
    mean_x, mean_y = sum(x) / n, sum(y) / n
    slope = sum((a - mean_x) * (b - mean_y) for a, b in zip(x, y)) / sum((a - mean_x) ** 2 for a in x)
    start = mean_y - slope * mean_x
    left = sum((b - start - slope * a) ** 2 for a, b in zip(x, y))
    return slope, start, 1 - left / sum((b - mean_y) ** 2 for b in y)


def surface(tables, pictures):
    rows = rows_of(tables, "surface")
    voxels = names_of(rows, "voxel mm")
    figure, all_axes = plt.subplots(1, len(voxels), figsize=(8.4, 3.0), constrained_layout=True)
    fits = ["voxel mm,map,CPU ms a square metre,CPU ms at none,R2\n"]
    for axes, voxel in zip(all_axes, voxels):
        for name in names_of(rows):
            line = [row for row in rows if row["voxel mm"] == voxel and row["map"] == name]
            x, y = ([float(row[column]) for row in line] for column in ("visible m2", "CPU ms"))
            draw(axes, name, x, y)
            slope, start, explained = line_through(x, y)
            axes.plot([0, max(x)], [start, start + slope * max(x)], color=STYLES[name][0], linewidth=0.6, zorder=2)
            fits.append("%s,%s,%.2f,%.2f,%.3f\n" % (voxel, name, slope, start, explained))
        axes.set_xlim(left=0)
        axes.set_ylim(bottom=0)
        axes.set_xlabel("visible surface, m²")
        axes.set_title("CPU ms a frame, voxels of %s mm" % voxel, fontsize=9, loc="left")
    legend(figure, all_axes[0])
    save(figure, pictures, "scaling-surface")
    with open(os.path.join(tables, "surface_fit.csv"), "w") as file:
        file.writelines(fits)


def ids(tables, pictures):
    rows = rows_of(tables, "ids")
    figure, all_axes = plt.subplots(1, 2, figsize=(8.4, 3.0), constrained_layout=True)
    counts = [int(count) for count in names_of(rows, "ids")]
    for axes, (column, title) in zip(all_axes, (("CPU ms", "ray cast 960x540, CPU ms"), ("CPU over one id", "times the cost of one id"))):
        for name in names_of(rows):
            draw(axes, name, range(len(counts)), [float(row[column]) for row in rows if row["map"] == name])
        axes.set_ylim(bottom=0)
        axes.set_xticks(range(len(counts)), [str(count) for count in counts])
        axes.set_xlabel("ids that the same geometry is split into")
        axes.set_title(title, fontsize=9, loc="left")
    all_axes[1].axhline(1.3, color="#777777", linewidth=0.9, linestyle=":")
    all_axes[1].set_ylim(top=max(1.4, all_axes[1].get_ylim()[1]))
    legend(figure, all_axes[0], 3)
    save(figure, pictures, "scaling-ids")


def main():
    """Draws the plots whose tables are there."""
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    tables, pictures = sys.argv[1:]
    os.makedirs(pictures, exist_ok=True)
    for name, plot in (("frames", frames), ("surface", surface), ("ids", ids)):
        if os.path.exists(os.path.join(tables, name + ".csv")):
            plot(tables, pictures)


if __name__ == "__main__":
    main()
