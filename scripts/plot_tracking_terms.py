#!/usr/bin/python3
"""Draws the plot of docs/tracking.md from the table of `tsdfpp_bench terms`.

Usage: plot_tracking_terms.py TABLES PICTURES
A column is a shape. Lines are paints and depths; along them terms are added one by one, and the last points are the
distances with what is expected, and what is added to these: the outline, which is the default, colour, or both.
"""
import sys

from plot_map_figures import plt, rows_of, save

LINES = {
    ("plain", "exact"): ("#0072B2", "o", "-"),
    ("plain", "noise"): ("#0072B2", "o", ":"),
    ("pattern", "exact"): ("#D55E00", "s", "-"),
    ("pattern", "noise"): ("#D55E00", "s", ":"),
}
ADDED = 5  # the sets that grow one by one come first
MEASURES = (("shift mm", "shift, mm"), ("turn deg", "turn, degrees"), ("ADD-S mm", "ADD-S, mm"))
LEAST = 0.02  # what is less is drawn there: the axis is logarithmic


def main():
    tables, pictures = sys.argv[1:3]
    rows = rows_of(tables, "terms")
    shapes = list(dict.fromkeys(row["shape"] for row in rows))
    sets = list(dict.fromkeys(row["terms"] for row in rows))
    figure, all_axes = plt.subplots(len(MEASURES), len(shapes), figsize=(2.3 * len(shapes), 7.4), sharex=True, sharey="row",
                                    constrained_layout=True)
    for column, shape in enumerate(shapes):
        for line, (column_name, title) in enumerate(MEASURES):
            axes = all_axes[line][column]
            for (paint, depth), (colour, marker, style) in LINES.items():
                values = {row["terms"]: max(LEAST, float(row[column_name])) for row in rows
                          if (row["shape"], row["paint"], row["depth"]) == (shape, paint, depth)}
                for part in (range(ADDED), range(ADDED, len(sets))):
                    axes.plot(list(part), [values[sets[i]] for i in part], color=colour, marker=marker, linestyle=style,
                              markersize=4, linewidth=1.3, label=f"{paint}, {depth}" if part[0] == 0 else None)
            axes.set_yscale("log")
            if line == 0:
                axes.set_title(shape, loc="left", fontsize=10)
            if column == 0:
                axes.set_ylabel(title)
        all_axes[-1][column].set_xticks(range(len(sets)), sets, rotation=90, fontsize=8)
    figure.legend(*all_axes[0][0].get_legend_handles_labels(), loc="upper center", bbox_to_anchor=(0.5, 0.0), ncol=4,
                  frameon=False)
    save(figure, pictures, "tracking-terms")


if __name__ == "__main__":
    main()
