"""What a page says of an experiment: tables of the results.json of `tsdfpp sweep`."""

DIFFERENCES = 2  # of so many metrics the difference to the baseline has a column of its own


def number(value):
    return value if isinstance(value, (int, float)) else None


def title_of(results, metric):
    words = results["metrics"][metric]
    return words["words"] + (f", {words['unit']}" if words["unit"] else "")


def cell_text(results, figure, metric, key="mean", sign="", interval=True):
    mean = number(figure[key])
    if mean is None:
        return "-"
    decimals = results["metrics"][metric]["decimals"]
    text = f"{mean:{sign}.{decimals}f}"
    if interval and "low" in figure:
        text += f" [{figure['low']:.{decimals}f}, {figure['high']:.{decimals}f}]"
    return text


def difference_text(results, condition, method, metric):
    paired = condition["paired"].get(method, {}).get(metric)
    return "" if paired is None else cell_text(results, paired, metric, "mean_difference", "+")


def comparison_of(results):
    """The question; a row a condition and method: of the first metrics mean and paired difference to the baseline with
    their intervals, of the others the mean; and where a method is not ahead of the baseline in the first metric."""
    metrics = results["experiment"]["metrics"]
    baseline = results["experiment"]["baseline"]
    varied = [axis for axis in results["varied"] if axis != "scene"]
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
                row.append(cell_text(results, condition["means"][method][metric], metric, interval=i < DIFFERENCES))
                if i < DIFFERENCES:
                    row.append(difference_text(results, condition, method, metric))
            rows.append(row)
    lines = results["text"].rstrip("\n").split("\n")
    verdicts = [line for line in lines[2:] if line.startswith(tuple(results["conditions"][0]["methods"])) and "ahead" in line]
    return (f"{lines[0]} {lines[1]}\n\n" + "".join("| " + " | ".join(row) + " |\n" for row in rows) + "\n" +
            "".join("- " + line + "\n" for line in verdicts))


def table_of(results):
    """A row a condition and method, a column a metric of the experiment."""
    metrics = results["experiment"]["metrics"]
    # A grid has one scene, and says so.
    varied = [axis for axis in results["varied"] if axis != "scene"]
    titles = ["grid"] + varied + ["runs", "method"] + [title_of(results, m) for m in metrics]
    rows = [titles, ["---"] * len(titles)]
    for condition in results["conditions"]:
        for method in condition["methods"]:
            rows.append([condition["grid"]] + [f"{condition['settings'][a]}" for a in varied] +
                        [str(condition["replicates"]), f"`{method}`"] +
                        [cell_text(results, condition["means"][method][m], m) for m in metrics])
    made = results["experiment"]
    return "".join("| " + " | ".join(row) + " |\n" for row in rows) + (
        f"\nMade by tsdfpp {results['program']} with {results['renderer']}; images of {made['scale']} times the scenes' "
        f"size, stride {made['stride']}.\n")
