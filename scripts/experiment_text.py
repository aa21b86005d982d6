"""What a page says of an experiment: sentences or a table of the results.json of `tsdfpp sweep`."""


def number(value):
    return value if isinstance(value, (int, float)) else None


def title_of(results, metric):
    words = results["metrics"][metric]
    return words["words"] + (f", {words['unit']}" if words["unit"] else "")


def text_of(results):
    """The question, the experiment's first two metrics, and the verdicts; summary.txt has all metrics."""
    lines = results["text"].rstrip("\n").split("\n")
    others = [results["metrics"][m]["words"] + ":" for m in results["experiment"]["metrics"][2:]]
    kept = [line for line in lines[2:] if not any(other in line.split(" tsdf")[0] for other in others)]
    return "\n\n".join(lines[:2]) + "\n\n" + "".join("- " + line + "\n" for line in kept)


def cell_text(results, figure, metric):
    mean = number(figure["mean"])
    if mean is None:
        return "-"
    decimals = results["metrics"][metric]["decimals"]
    text = f"{mean:.{decimals}f}"
    if "low" in figure:
        text += f" [{figure['low']:.{decimals}f}, {figure['high']:.{decimals}f}]"
    return text


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
