#!/usr/bin/python3
"""Draws the plots of experiments (`tsdfpp sweep`).

Usage: plot_experiment.py FOLDER PICTURES
FOLDER holds results.json and results.csv. PICTURES gets experiment-NAME.svg and .png.
Every line has a colour, a marker and a dash of its own (scripts/method_rows.py). Bands and bars are the experiment's
confidence intervals.
"""
import csv
import json
import os
import sys
import textwrap

import matplotlib

matplotlib.use("Agg")
matplotlib.rcParams.update({
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#dddddd",
    "svg.fonttype": "none",
    "svg.hashsalt": "tsdfpp",  # the same bytes for the same results
})
import matplotlib.pyplot as plt  # noqa: E402
import matplotlib.ticker  # noqa: E402

from experiment_text import frame_lines, number, title_of  # noqa: E402
from method_rows import method_line, method_styles  # noqa: E402

METHODS = method_styles()
# Other people's maps beside the methods.
STYLES = {**METHODS, "open3d/3": ("#CC79A7", "X", ":"), "open3d/10": ("#A0527D", "x", ":")}
# Where there is no row.
PLAIN = ("#666666", ".", "-")
PLAIN_SECOND = ("#666666", "*", ":")


def save(figure, folder, name):
    for kind in ("svg", "png"):
        figure.savefig(os.path.join(folder, f"experiment-{name}.{kind}"), bbox_inches="tight", dpi=150,
                       metadata={"Date": None} if kind == "svg" else None)
    plt.close(figure)


class Panels:
    """A row of panels, one a metric, with a legend below."""

    def __init__(self, results, count):
        self.results = results
        columns = min(count, 4)
        rows = (count + columns - 1) // columns
        self.figure, axes = plt.subplots(rows, columns, figsize=(2.95 * columns + 0.4, 2.6 * rows),
                                         constrained_layout=True, squeeze=False)
        self.axes = [a for row in axes for a in row]
        for spare in self.axes[count:]:
            spare.set_visible(False)
        self.styles = {}

    def style(self, label):
        if label not in self.styles:
            method = label.split(",")[0]
            taken = [STYLES.get(known.split(",")[0]) for known in self.styles if known.split(",")[0] == method]
            style = STYLES.get(method, PLAIN)
            if taken:  # a second line of one method, of another setting
                style = method_line(method, "h", "--", second=True) if method in METHODS else PLAIN_SECOND
            self.styles[label] = style
        return self.styles[label]

    def line(self, axes, label, x, y, low=None, high=None, every=1):
        colour, marker, dash = self.style(label)
        axes.plot(x, y, color=colour, marker=marker, markevery=every, linestyle=dash, markersize=4.5,
                  linewidth=1.4, label=label, clip_on=False, zorder=3)
        if low and len(x) > 1:
            axes.fill_between(x, low, high, color=colour, alpha=0.13, linewidth=0, zorder=1)

    def finish(self, folder, name):
        handles = {}
        for axes in self.axes:
            for handle, label in zip(*axes.get_legend_handles_labels()):
                handles.setdefault(label, handle)
        self.figure.legend(handles.values(), handles.keys(), loc="upper center", bbox_to_anchor=(0.5, 0.0),
                           ncol=min(len(handles), 5), frameon=False, fontsize=8.5)
        save(self.figure, folder, name)


def limit_axis(axes, results, metric, values):
    """Shares begin at 0 and end at 1 where that shows anything."""
    words = results["metrics"][metric]
    if words["unit"] or not values:
        axes.set_ylim(bottom=0)
    elif min(values) > 0.6:
        axes.set_ylim(top=1 + 0.03 * (1 - min(values)))
    else:
        axes.set_ylim(-0.01, 1.02)


def label_of(varied, condition, method):
    """The method, and the settings that tell its lines apart."""
    parts = [method]
    for axis in varied:
        value = condition["settings"][axis]
        defaults = {"resampling": "all", "profile": None}
        if axis in defaults and value == defaults[axis]:
            continue
        parts.append(f"{value} neighbours" if axis == "resampling" else f"{axis} {value}")
    return ", ".join(parts)


def plot_conditions(results, folder):
    plot = results["plot"]
    x_axis = plot["x"]
    conditions = [c for c in results["conditions"] if c["settings"].get(x_axis) is not None]
    values_of = lambda axis, of: {c["settings"][axis] for c in of}  # noqa: E731
    # A grid in which x does not vary has no line.
    conditions = [c for c in conditions if len(values_of(x_axis, [d for d in conditions if d["grid"] == c["grid"]])) > 1]
    varied = [axis for axis in results["varied"] if axis != x_axis and len(values_of(axis, conditions)) > 1]
    many = {c["settings"][x_axis] for c in conditions}
    words = not all(isinstance(value, (int, float)) for value in many)
    places = {value: i for i, value in enumerate(dict.fromkeys(c["settings"][x_axis] for c in conditions))}
    panels = Panels(results, len(plot["metrics"]))
    for axes, metric in zip(panels.axes, plot["metrics"]):
        lines = {}
        for condition in conditions:
            for method in condition["methods"]:
                figure = condition["means"][method][metric]
                mean = number(figure["mean"])
                if mean is None:
                    continue
                value = condition["settings"][x_axis]
                label = label_of(varied, condition, method)
                if len({c["grid"] for c in conditions}) > 1 and condition["grid"] != conditions[0]["grid"] and words:
                    label += f", {condition['grid']}"
                lines.setdefault(label, []).append((places[value] if words else value, mean, figure.get("low", mean),
                                                    figure.get("high", mean)))
        for label, points in lines.items():
            x, y, low, high = zip(*sorted(points))
            panels.line(axes, label, x, y, low, high)
        if plot["log_x"]:
            axes.set_xscale("log")
        if words:
            axes.set_xticks(range(len(places)), list(places))
            axes.set_xlim(-0.3, len(places) - 0.7)
        else:
            ticks = sorted(many)
            axes.set_xticks(ticks, [f"{t:g}" for t in ticks], rotation=45 if max(len(f"{t:g}") for t in ticks) > 4 else 0)
            axes.minorticks_off()
        axes.set_xlabel(textwrap.fill(plot["x_label"], 34))
        axes.set_title(title_of(results, metric), fontsize=9, loc="left")
        limit_axis(axes, results, metric, [p[1] for points in lines.values() for p in points])
    panels.finish(folder, results["experiment"]["name"])


def condition_text(results, condition):
    shown = [f"{axis} {condition['settings'][axis]}" for axis in results["varied"] if axis != "scene"]
    return condition["grid"] + (": " + ", ".join(shown) if shown else "")


def plot_differences(results, folder):
    """Each method's paired difference to the baseline, with its interval, a row a condition."""
    plot = results["plot"]
    conditions = [c for c in results["conditions"] if c["paired"]]
    metrics = plot["metrics"]
    figure, all_axes = plt.subplots(1, len(metrics), figsize=(2.1 * len(metrics) + 2.6, 0.42 * len(conditions) + 1.2),
                                    constrained_layout=True, squeeze=False, sharey=True)
    methods = list(dict.fromkeys(m for c in conditions for m in c["methods"] if m in c["paired"]))
    for axes, metric in zip(all_axes[0], metrics):
        axes.axvline(0, color="#555555", linewidth=1)
        axes.grid(False, axis="y")
        axes.xaxis.set_major_locator(matplotlib.ticker.MaxNLocator(4))
        for row in range(0, len(conditions), 2):
            axes.axhspan(row - 0.5, row + 0.5, color="#f2f2f2", linewidth=0, zorder=0)
        for k, method in enumerate(methods):
            colour, marker, _ = STYLES.get(method, PLAIN)
            for row, condition in enumerate(conditions):
                paired = condition["paired"].get(method, {}).get(metric)
                if paired is None or number(paired["mean_difference"]) is None:
                    continue
                y = row + 0.72 / len(methods) * (k - (len(methods) - 1) / 2)
                mean = paired["mean_difference"]
                if "low" in paired:
                    axes.plot([paired["low"], paired["high"]], [y, y], color=colour, linewidth=1.6, zorder=2)
                axes.plot([mean], [y], color=colour, marker=marker, linestyle="", markersize=5, zorder=3,
                          label=method if row == 0 else None)
        words = results["metrics"][metric]
        axes.set_title(textwrap.fill(title_of(results, metric), 22), fontsize=9, loc="left")
        axes.set_xlabel("better →" if words["better"] == "higher" else "← better")
    all_axes[0][0].set_yticks(range(len(conditions)), [condition_text(results, c) for c in conditions])
    all_axes[0][0].invert_yaxis()
    handles = {}
    for axes in all_axes[0]:
        for handle, label in zip(*axes.get_legend_handles_labels()):
            handles.setdefault(label, handle)
    figure.legend(handles.values(), [f"{label} minus {results['experiment']['baseline']}" for label in handles],
                  loc="upper center", bbox_to_anchor=(0.5, 0.0), ncol=3, frameon=False, fontsize=8.5)
    save(figure, folder, results["experiment"]["name"])


def plot_methods(results, folder):
    """A row a method; the conditions beside each other, each with a colour and a marker of its own."""
    plot = results["plot"]
    conditions = results["conditions"]
    metrics = plot["metrics"]
    looks = [("#0072B2", "o"), ("#56B4E9", "o"), ("#D55E00", "^"), ("#E69F00", "^"), ("#009E73", "s"), ("#CC79A7", "D")]
    methods = list(dict.fromkeys(m for c in conditions for m in c["methods"]))
    figure, all_axes = plt.subplots(1, len(metrics), figsize=(2.3 * len(metrics) + 1.4, 0.42 * len(methods) + 1.2),
                                    constrained_layout=True, squeeze=False, sharey=True)
    for axes, metric in zip(all_axes[0], metrics):
        axes.grid(False, axis="y")
        axes.xaxis.set_major_locator(matplotlib.ticker.MaxNLocator(5))
        for row in range(0, len(methods), 2):
            axes.axhspan(row - 0.5, row + 0.5, color="#f2f2f2", linewidth=0, zorder=0)
        for k, condition in enumerate(conditions):
            colour, marker = looks[k % len(looks)]
            rows, means = [], []
            for row, method in enumerate(methods):
                figure_of = condition["means"].get(method, {}).get(metric)
                if figure_of is None or number(figure_of["mean"]) is None:
                    continue
                y = row + 0.72 / len(conditions) * (k - (len(conditions) - 1) / 2)
                if "low" in figure_of:
                    axes.plot([figure_of["low"], figure_of["high"]], [y, y], color=colour, linewidth=1.6, zorder=2)
                rows.append(y)
                means.append(figure_of["mean"])
            axes.plot(means, rows, color=colour, marker=marker, linestyle="", markersize=5, zorder=3,
                      markerfacecolor=colour if k % 2 == 0 else "white", label=condition_text(results, condition))
        axes.set_title(title_of(results, metric), fontsize=9, loc="left")
    all_axes[0][0].set_yticks(range(len(methods)), methods)
    all_axes[0][0].set_ylim(len(methods) - 0.5, -0.5)
    figure.legend(*all_axes[0][0].get_legend_handles_labels(), loc="upper center", bbox_to_anchor=(0.5, 0.0), ncol=4,
                  frameon=False, fontsize=8.5)
    save(figure, folder, results["experiment"]["name"])


def plot_frames(results, rows, folder):
    plot = results["plot"]
    panels = Panels(results, len(plot["metrics"]))
    for axes, metric in zip(panels.axes, plot["metrics"]):
        lines = frame_lines(results, rows, metric)
        for label, points in lines.items():
            frames = sorted(points)
            panels.line(axes, label, frames, [sum(points[f]) / len(points[f]) for f in frames],
                        every=max(1, len(frames) // 8))
        axes.set_xlabel(textwrap.fill(plot["x_label"], 34))
        axes.set_title(title_of(results, metric), fontsize=9, loc="left")
        limit_axis(axes, results, metric, [v for points in lines.values() for vs in points.values() for v in vs])
    panels.finish(folder, results["experiment"]["name"])


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    folder, pictures = sys.argv[1:]
    with open(os.path.join(folder, "results.json")) as file:
        results = json.load(file)
    if "plot" in results:
        os.makedirs(pictures, exist_ok=True)
        if results["plot"]["x"] == "frame":
            with open(os.path.join(folder, "results.csv"), newline="") as file:
                plot_frames(results, list(csv.DictReader(file)), pictures)
        elif results["plot"]["x"] == "difference":
            plot_differences(results, pictures)
        elif results["plot"]["x"] == "method":
            plot_methods(results, pictures)
        else:
            plot_conditions(results, pictures)


if __name__ == "__main__":
    main()
