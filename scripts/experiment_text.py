"""What a page says of an experiment: tables of the results.json of `tsdfpp sweep`."""
import textwrap

DIFFERENCES = 2  # of so many metrics the difference to the baseline has a column of its own


def number(value):
    return value if isinstance(value, (int, float)) else None


def title_of(results, metric):
    words = results["metrics"][metric]
    return words["words"] + (f", {words['unit']}" if words["unit"] else "")


def cell_text(results, figure, metric, key="mean", sign="", interval=True, runs=0):
    """runs: how many the condition has; a mean of fewer says so."""
    mean = number(figure[key])
    if mean is None:
        return "-"
    decimals = results["metrics"][metric]["decimals"]
    text = f"{mean:{sign}.{decimals}f}"
    if interval and "low" in figure:
        text += f" [{figure['low']:.{decimals}f}, {figure['high']:.{decimals}f}]"
    of = figure.get("count", figure.get("pairs"))
    if of is not None and of < runs:
        text += f" (of {of} of {runs})"
    return text


def difference_text(results, condition, method, metric):
    paired = condition["paired"].get(method, {}).get(metric)
    if paired is None:
        return ""
    return cell_text(results, paired, metric, "mean_difference", "+", runs=condition["replicates"])


def mean_text(results, condition, method, metric, interval=False):
    figure = condition["means"][method][metric]
    return cell_text(results, figure, metric, interval=interval, runs=condition["replicates"])


def place(cells, key, condition):
    """One condition a cell: of two the table would show the last alone."""
    if key in cells:
        other = cells[key]["settings"]
        axes = [axis for axis, value in condition["settings"].items() if other.get(axis) != value]
        raise ValueError(f"grid '{condition['grid']}' has several conditions in the cell of {', '.join(map(str, key))}, "
                         f"which differ in {', '.join(axes) or 'nothing'}; expected one")
    cells[key] = condition


def axes_shown(results):
    """Those that vary inside a grid; what a grid fixes its name says."""
    def varies(axis):
        values = {}
        for condition in results["conditions"]:
            values.setdefault(condition["grid"], set()).add(f"{condition['settings'][axis]}")
        return len(values) == 1 or any(len(of_grid) > 1 for of_grid in values.values())
    return [axis for axis in results["varied"] if axis != "scene" and varies(axis)]


def comparison_of(results):
    """The question; a row a condition and method: of the first metrics mean and paired difference to the baseline with
    their intervals, of the others the mean."""
    metrics = results["experiment"]["metrics"]
    baseline = results["experiment"]["baseline"]
    varied = axes_shown(results)
    has_grids = len({condition["grid"] for condition in results["conditions"]}) > 1
    titles = (["grid"] if has_grids else []) + varied + ["method"]
    for i, metric in enumerate(metrics):
        titles += [title_of(results, metric)] + ([f"to {baseline}"] if i < DIFFERENCES else [])
    rows = [titles, ["---"] * len(titles)]
    for condition in results["conditions"]:
        for method in condition["methods"]:
            row = [condition["grid"]] if has_grids else []
            row += [f"{condition['settings'][axis]}" for axis in varied] + [f"`{method}`"]
            for i, metric in enumerate(metrics):
                row.append(mean_text(results, condition, method, metric, interval=i < DIFFERENCES))
                if i < DIFFERENCES:
                    row.append(difference_text(results, condition, method, metric))
            rows.append(row)
    lines = results["text"].rstrip("\n").split("\n")
    lead = "\n".join(textwrap.wrap(f"{lines[0]} {lines[1]}", 120))
    return lead + "\n\n" + "".join("| " + " | ".join(row) + " |\n" for row in rows)


def scenes_of(results):
    """For each profile and metric a table of means: a row a method, a column a grid, which is a scene."""
    shown = {}
    for condition in results["conditions"]:
        for method in condition["methods"]:
            place(shown, (condition["settings"]["profile"], method, condition["grid"]), condition)
    profiles, methods, grids = ([*dict.fromkeys(key[i] for key in shown)] for i in range(3))
    text = ""
    for profile in profiles:
        for metric in results["experiment"]["metrics"]:
            title = title_of(results, metric)
            lines = [[f"`{profile}`: {title}"] + grids, ["---"] * (1 + len(grids))]
            for method in methods:
                conditions = [shown.get((profile, method, grid)) for grid in grids]
                if any(conditions):
                    lines.append([f"`{method}`"] + [mean_text(results, of, method, metric) if of else ""
                                                    for of in conditions])
            text += "".join("| " + " | ".join(line) + " |\n" for line in lines) + "\n"
    made = results["experiment"]
    return text + (f"Made by tsdfpp {results['program']} with {results['renderer']}; images of {made['scale']} times the "
                   f"scenes' size, stride {made['stride']}.\n")


def rules_of(results):
    """Of grids named `SCENE` and `SCENE, RULE`: a row a rule and method, a column a profile and scene, each cell with the
    means of the first two metrics; then the same with the others."""
    metrics = results["experiment"]["metrics"]
    cells, rows, columns = {}, [], []
    for condition in results["conditions"]:
        scene, _, rule = condition["grid"].partition(", ")
        profile = condition["settings"]["profile"]
        if (profile, scene) not in columns:
            columns.append((profile, scene))
        for method in condition["methods"]:
            if (rule, method) not in rows:
                rows.append((rule, method))
            place(cells, (rule or "as it is", method, profile, scene), condition)
    profiles, rules = [profile for profile, _ in columns], [rule for rule, _ in rows]
    columns = sorted(columns, key=lambda column: profiles.index(column[0]))
    rows = sorted(rows, key=lambda row: rules.index(row[0]))
    parts = []
    for shown in filter(None, (metrics[:DIFFERENCES], metrics[DIFFERENCES:])):
        lines = [["rule", "method"] + [f"{profile}: {scene}" for profile, scene in columns]]
        lines.append(["---"] * len(lines[0]))
        for rule, method in rows:
            line = [rule or "as it is", f"`{method}`"]
            for profile, scene in columns:
                of = cells.get((rule or "as it is", method, profile, scene))
                line.append("" if of is None else " / ".join(mean_text(results, of, method, metric) for metric in shown))
            lines.append(line)
        words = " / ".join(title_of(results, metric) for metric in shown)
        parts.append(f"{words[0].upper()}{words[1:]}:\n\n" + "".join("| " + " | ".join(line) + " |\n" for line in lines))
    return "\n".join(parts)


def label_of_row(varied, row):
    """Of results.csv: the method, and the settings that tell its lines in a plot apart."""
    parts = [row["method"]] + (["observed neighbours"] if row["resampling"] == "observed" else [])
    for axis in varied:
        if axis != "resampling":
            parts.append(f"{axis} {row[axis]}")
        elif row[axis] not in ("all", "observed"):
            parts.append(f"{row[axis]} neighbours")
    return ", ".join(parts)


def frame_lines(results, rows, metric):
    """By label and frame the values of a metric in the rows of results.csv, one a replicate."""
    lines = {}
    for row in rows:
        if row[metric] != "":
            label = label_of_row(results["varied"], row)
            lines.setdefault(label, {}).setdefault(int(row["frame"]), []).append(float(row[metric]))
    return lines
