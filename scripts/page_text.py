"""What a page shows of a command's output, as Markdown: one function a kind of output (docs/tables.toml, `as`)."""
import csv
import json
import pathlib
import re

import experiment_text
import page_prose


def markdown(rows):
    """A header and rows of cells."""
    lines = [rows[0], ["---"] * len(rows[0])] + rows[1:]
    return "".join("| " + " | ".join(row) + " |\n" for row in lines)


def of_csv(path):
    with open(path, newline="") as file:
        return markdown(list(csv.reader(file)))


def as_it_is(path):
    return path.read_text()


def fenced(path):
    return "```\n" + path.read_text().rstrip("\n") + "\n```\n"


def check_run(path):
    """Refuses a file that tsdfpp compare or map left where that run, or the next one, was interrupted (run.json)."""
    note, summary = path.with_name("run.json"), path.with_name("summary.json")
    again = f"the run in {path.parent} was interrupted: run the command again"
    if not note.exists():
        if path.with_name(".tsdfpp-moving").exists() or (summary.exists() and "run" in json.loads(summary.read_text())):
            raise ValueError(again)
        return
    for file in json.loads(note.read_text())["files"]:
        if file["name"] == path.name and file["bytes"] not in (None, path.stat().st_size):
            raise ValueError(f"{path} has {path.stat().st_size} bytes, expected {file['bytes']}; {again}")


def cells_of(line):
    """Of a table of aligned columns: they stand at least two blanks apart."""
    return re.split(r"\s{2,}", line.strip())


def is_figure(cell):
    """It begins with a number, and beyond numbers has no more than a unit."""
    return re.match(r"[-+]?\d", cell.strip("`* ")) is not None and len(re.findall(r"[^\W\d_]", cell)) <= 8


def is_row_of_figures(cells):
    return sum(map(is_figure, cells[1:])) > 1


def parts_of(path):
    """The tables of compare's table.txt; the front table comes first, and a blank line behind each."""
    parts = path.read_text().strip("\n").split("\n\n", 1)
    if len(parts) != 2:
        raise ValueError(f"{path} has no blank line between the front table and the whole one")
    return parts


def front(path):
    rows = [cells for cells in map(cells_of, parts_of(path)[0].splitlines()) if len(cells) > 2]  # without the title
    if len(rows) < 2 or len({len(row) for row in rows}) != 1:
        raise ValueError(f"{path} begins with rows of different lengths, expected the front table of tsdfpp compare")
    return markdown([rows[0]] + [[f"`{row[0]}`"] + row[1:] for row in rows[1:]])


def speed(path):
    """Of the table of times over all cases: its first case."""
    rows = [[cell.strip() for cell in line.strip().strip("|").split("|")] for line in path.read_text().splitlines()
            if line.startswith("|") and not line.startswith("|--")]
    if len(rows) < 2 or len(rows[0]) < 3 or len({len(row) for row in rows}) != 1:
        raise ValueError(f"{path} has no table of times as tsdfpp_bench side-by-side writes it")
    return markdown([row[:3] for row in rows])


def whole(path):
    return "```\n" + parts_of(path)[1].strip("\n") + "\n```\n"


FIGURES = (("kept", "table_preservation_behind_other"), ("retention", "table_retention_behind_other"),
           ("visible", "visible_completion"), ("movers", "movers_completion"), ("sane", "sanity_all"),
           ("sane least", "sanity_least"))


def titles_of(maps):
    """Of rows of frames.csv or runs of summary.json: method and profile, and the poses where one of these has several."""
    poses = {}
    for one in maps:
        poses.setdefault((one["method"], one["profile"]), set()).add(one.get("poses"))
    several = {which for which, of in poses.items() if len(of) > 1}
    named = ((one["method"], one["profile"], one.get("poses")) for one in maps)
    return [", ".join(filter(None, name if name[:2] in several else name[:2])) for name in named]


def maps_of(path):
    """Rows of frames.csv by the map's title, in their order."""
    maps = {}
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    for title, row in zip(titles_of(rows), rows):
        maps.setdefault(title, []).append(row)
    return maps


def least(path):
    """Of frames.csv: the least value of each figure over the evaluated frames."""
    rows = [["map"] + [title for title, _ in FIGURES]]
    for title, frames in maps_of(path).items():
        values = [[float(row[column]) for row in frames if row[column]] for _, column in FIGURES]
        rows.append([title] + [f"{min(of):.3f}" if of else "-" for of in values])
    return markdown(rows)


def tracks(path):
    """Of summary.json, frames.csv beside it: figures at the examined frame, errors of the objects' trajectories."""
    summary = json.loads(path.read_text())
    examined = summary["last_frame"] if summary["reveal_frame"] is None else summary["reveal_frame"]
    maps = maps_of(path.with_name("frames.csv"))
    ids = [str(one) for one in summary["removed"]]
    names = {str(one["id"]): one["name"] for one in summary["runs"][0]["examined"]["objects"]}
    rows = [["map"] + [title for title, _ in FIGURES] +
            [f"{names.get(one, one)}, {unit}" for one in ids for unit in ("mm", "deg")]]
    for title, run in zip(titles_of(summary["runs"]), summary["runs"]):
        frames = {int(row["frame"]): row for row in maps[title]}
        row = frames.get(examined, maps[title][-1])
        cells = [title] + [f"{float(row[column]):.3f}" if row[column] else "-" for _, column in FIGURES]
        for one in ids:
            scores = (run["trajectories"] or {}).get(one, {})
            for key, scale in (("ate_rmse_m", 1000), ("rotation_rmse_deg", 1)):
                value = scores.get(key)
                value = value.get("value") if isinstance(value, dict) else value
                cells.append("-" if value is None else f"{scale * value:.1f}")
        rows.append(cells)
    return markdown(rows)


def fault_rows(title, lines, columns):
    """Of scripts/faults.py: a row a name, columns as pairs (title, key), and a row of their sums."""
    rows = [[title] + [column for column, _ in columns]]
    for name, line in lines:
        rows.append([name] + [str(line.get(key, 0)) for _, key in columns])
    return markdown(rows + [["all"] + [str(sum(line.get(key, 0) for _, line in lines)) for _, key in columns]])


def kills(path):
    """Of faults.json: a row a command."""
    lines = [(f"`{name}`", of["SIGKILL"]) for name, of in json.loads(path.read_text())["kills"].items()]
    return fault_rows("command", lines, (
        ("killed", "tried"), ("survived", "survived"), ("lost", "lost"), ("it left the older result", "before"),
        ("a part of both", "between"), ("the new result", "whole"), ("readers read one of them", "read"),
        ("readers refused", "refused")))


def added(lines):
    total = {}
    for line in lines:
        for key, value in line.items():
            total[key] = total.get(key, 0) + value
    return total


def faults(path):
    """Of faults.json: a row a fault, over all commands that met it."""
    found = json.loads(path.read_text())
    lines = [(name, added(of[name] for of in found["faults"].values() if name in of)) for name in found["order"]]
    return fault_rows("fault", [line for line in lines if line[1]], (
        ("tried", "tried"), ("survived", "survived"), ("lost", "lost"), ("the same bytes as ever", "same"),
        ("a sentence and its exit code", "said"), ("ended by the signal", "signal")))


def pairs(path):
    """Of faults.json: a row a command, with itself and with each of the others; each pair counts once, in its first row."""
    lines = [(f"`{name}`", added(of.values())) for name, of in json.loads(path.read_text())["pairs"].items()]
    return fault_rows("command, with itself and those below", lines, (
        ("pairs", "tried"), ("survived", "survived"), ("lost", "lost"), ("both did their work", "both"),
        ("one did, one was refused", "one"), ("both were refused", "neither")))


def faults_made(path):
    """Of faults.json: what was run and when."""
    found = json.loads(path.read_text())
    missing = "".join(f" Not tried: {name} ({why})." for name, why in sorted(found["not_tried"].items()))
    return (f"Made by tsdfpp {found['version']}, on {found['date']}, with seed {found['seed']}.{missing}\n")


def experiment(make):
    return lambda path: make(json.loads(path.read_text()))


KINDS = {
    "csv": of_csv,
    "text": as_it_is,
    "fenced": fenced,
    "front": front,
    "speed": speed,
    "whole": whole,
    "least": least,
    "tracks": tracks,
    "comparison": experiment(experiment_text.comparison_of),
    "scenes": experiment(experiment_text.scenes_of),
    "rules": experiment(experiment_text.rules_of),
    "kills": kills,
    "faults": faults,
    "pairs": pairs,
    "faults_made": faults_made,
}


def csv_without(path, columns):
    """A CSV file's text without some columns."""
    with open(path, newline="") as file:
        rows = list(csv.reader(file))
    missing = [column for column in columns if column not in rows[0]]
    if missing:
        raise ValueError(f"{path} has no column {missing[0]}")
    kept = [i for i, title in enumerate(rows[0]) if title not in columns]
    return "".join(",".join(row[i] for i in kept) + "\n" for row in rows)


def text_of(source, kind=None, without=()):
    """What is made of the file `source`; kind: a name in KINDS, by default the file's own text."""
    source = pathlib.Path(source)
    if without:
        return csv_without(source, without)
    text = KINDS[kind or "text"](source)
    return page_prose.wrapped(text) if kind or source.suffix == ".md" else text
