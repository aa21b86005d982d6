"""What a command has left in a folder, as content by which two runs are compared: bytes, without times and a run's name."""
import csv
import fnmatch
import hashlib
import io
import json
import os
import re

# What differs from run to run and is no result. Everything else has to be the same bytes.
TIMES = {"times", "read_s", "total_s", "mesh_s", "evaluate_s", "render_s", "verify_s", "frames_per_s", "wall_s", "cpu_s",
         "peak_bytes", "process_growth_bytes", "track_ms", "update_poses_ms", "fuse_ms", "frame_ms", "move_ms", "mesh_ms"}
ASIDE = [
    ("JSON", "the members " + ", ".join(sorted(TIMES)), "times and memory of that run"),
    ("JSON", "the member `run`, a text of 16 hexadecimal digits", "a run's name is drawn anew for each"),
    ("`run.json`", "`files[].bytes`", "files with times have other sizes"),
    ("`run.json`", "` --threads N` in `command`", "a fault that is tried"),
    ("`resumed_frames`, `run_now`, `jobs` on stdout", "", "how much a rerun found done is what it is for"),
    ("`frames.csv`, `results.csv`", "the columns `mesh_s`, `evaluate_s` and `*_ms`", "times"),
    ("`table-*.png`", "all but that it is a whole PNG", "a picture of a table that has times"),
    ("`report.html` of `compare`", "its numbers", "a table that has times; the file must be whole"),
    ("`report.html` of `report`", "the above inside of it, and the files' sizes and hashes", "the same, shown"),
    ("`log.txt` of an adapter", "its numbers", "what other programs print"),
]
RUN_NAME = re.compile(r"[0-9a-f]{16}")
STDOUT_ONLY = {"resumed_frames", "run_now", "jobs"}
REPORT_DATA = re.compile(r'(<script type="application/json" id="report-data">)(.*?)(</script>)', re.DOTALL)


class Broken(Exception):
    """A file is not whole."""


def without_times(value, drop=TIMES):
    if isinstance(value, dict):
        return {key: without_times(one, drop) for key, one in value.items()
                if key not in drop and not (key == "run" and isinstance(one, str) and RUN_NAME.fullmatch(one))}
    if isinstance(value, list):
        return [without_times(one, drop) for one in value]
    return value


def csv_without_times(text):
    if not text.endswith("\n"):
        raise Broken("ends in the middle of a line")
    rows = list(csv.reader(io.StringIO(text)))
    kept = [i for i, title in enumerate(rows[0]) if title not in TIMES and not title.endswith("_ms")]
    if any(len(row) != len(rows[0]) for row in rows):
        raise Broken("has rows of different lengths")
    return [[row[i] for i in kept] for row in rows]


def page_without_times(text):
    if not text.rstrip().endswith("</html>"):
        raise Broken("does not end with </html>")
    found = REPORT_DATA.search(text)
    if found is None:
        return re.sub(r"\d+(\.\d+)?", "#", text)
    data = without_times(json.loads(found[2]))
    for report in data["reports"]:
        report["frames_csv"] = csv_without_times(report["frames_csv"])
        report["files"] = [file["name"] for file in report["files"]]
        for picture in report["pictures"]:
            if picture["file"].startswith("table-"):
                picture["data"] = "a table with times"
    return text[:found.start()] + json.dumps(data, sort_keys=True) + text[found.end():]


def png(content):
    if not content.startswith(b"\x89PNG") or not content.endswith(b"IEND\xaeB`\x82"):
        raise Broken("is no whole PNG")
    return "a PNG with times"


def run_note(content):
    note = without_times(json.loads(content))
    note["command"] = re.sub(r" --threads \d+", "", note["command"])
    for file in note["files"]:
        file.pop("bytes")
    return note


READERS = [
    ("run.json", run_note),
    (".tsdfpp-moving", run_note),
    ("*.json", lambda content: without_times(json.loads(content))),
    ("frames.csv", lambda content: csv_without_times(content.decode())),
    ("results.csv", lambda content: csv_without_times(content.decode())),
    ("table-*.png", png),
    ("*.html", lambda content: page_without_times(content.decode())),
    ("log.txt", lambda content: re.sub(rb"\d+(\.\d+)?", b"#", content).decode()),
]


def content_of_file(path, content):
    """A digest of what counts of a file, or 'broken: WHY'."""
    name = os.path.basename(path)
    for pattern, read in READERS:
        if fnmatch.fnmatchcase(name, pattern):
            try:
                content = json.dumps(read(content), sort_keys=True).encode()
            except (ValueError, KeyError, TypeError, IndexError, UnicodeDecodeError, Broken) as error:
                return f"broken: {error}"
            break
    return hashlib.sha256(content).hexdigest()


def stdout_content(text):
    """What counts of a command's result: JSON without times, else the text."""
    try:
        return json.dumps(without_times(json.loads(text), TIMES | STDOUT_ONLY), sort_keys=True)
    except ValueError:
        return text


def content_of(folder):
    """Digests by path of all files below, hidden ones too; what is no file is named."""
    content = {}
    for base, folders, files in os.walk(folder):
        for name in files + [one for one in folders if os.path.islink(os.path.join(base, one))]:
            path = os.path.join(base, name)
            where = os.path.relpath(path, folder)
            if os.path.islink(path):
                content[where] = "a link to " + os.readlink(path)
            elif os.path.isfile(path):
                with open(path, "rb") as file:
                    content[where] = content_of_file(path, file.read())
            else:
                content[where] = "odd"
        if not files and not folders and base != folder:
            content[os.path.relpath(base, folder)] = "a folder"
    return content


def is_part_of_a_run(folder):
    """Whether a comparison says of itself that a map failed or that frames ended early, and all that its note lists is
    there in its size, and nothing else: it keeps what was finished."""
    try:
        with open(os.path.join(folder, "summary.json"), encoding="utf-8") as file:
            summary = json.load(file)
        with open(os.path.join(folder, "run.json"), encoding="utf-8") as file:
            listed = {entry["name"]: entry["bytes"] for entry in json.load(file)["files"]}
    except (OSError, ValueError, KeyError, TypeError):
        return False
    if not (summary.get("failed") or summary.get("stopped")):
        return False
    found = {}
    for place, _, names in os.walk(folder):
        for name in names:
            path = os.path.relpath(os.path.join(place, name), folder)
            if not is_hidden(path):
                found[path] = os.path.getsize(os.path.join(folder, path))
    found.pop("run.json", None)
    return found.keys() == listed.keys() and all(size in (None, found[name]) for name, size in listed.items())


def is_hidden(path):
    """Hidden, or the name of a file that is being written: nobody takes it for a result."""
    return any(part.startswith(".") or part.endswith(".part") for part in path.split(os.sep))


def visible(content):
    """Without what is hidden, and without empty folders, which say nothing."""
    return {path: of for path, of in content.items() if not is_hidden(path) and of != "a folder"}


def differences(found, expected, most=3):
    """In a few words; empty where there are none."""
    lines = [f"{path} is missing" for path in expected if path not in found]
    lines += [f"{path} is too much" for path in found if path not in expected]
    lines += [f"{path} differs" + (f" ({found[path]})" if found[path].startswith("broken") else "")
              for path in found if path in expected and found[path] != expected[path]]
    return "; ".join(sorted(lines)[:most]) + (f"; and {len(lines) - most} more" if len(lines) > most else "")
