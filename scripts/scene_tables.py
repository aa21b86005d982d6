"""What tables of scenes are made with: a comparison of tsdf++/anchored at the examined frame, and a CSV of rows."""
import csv
import json
import subprocess

LONG = 1_000_000  # frames between evaluations: the examined frame alone


def compare(program, scene, sensor, out, options):
    """The summary of `tsdfpp compare`, and the rows of its frames.csv."""
    command = [program, "compare", f"scenes/{scene}.toml", "--sensor", sensor, "--methods", "tsdf++/anchored", "--profiles",
               "close", "--every", str(LONG), "--out", str(out), *options]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    with open(out / "frames.csv", newline="") as file:
        return json.loads((out / "summary.json").read_text()), list(csv.DictReader(file))


def text(value, digits):
    return "-" if value in (None, "") else f"{round(float(value), digits) + 0.0:.{digits}f}"  # no -0


def write(rows, path):
    part = path.with_name(path.name + ".part")
    with open(part, "w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys(), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    part.rename(path)
