#!/usr/bin/python3
"""Knows the command behind each table, plot and picture of README.md, docs/ and results/: docs/tables.toml lists them.

    /usr/bin/python3 scripts/pages.py list [NAME ...]
    /usr/bin/python3 scripts/pages.py make NAME ...|all|scored|timed [-- OPTIONS]   run the commands, fill the pages
    /usr/bin/python3 scripts/pages.py fill NAME ...|all|scored|timed                from what the last runs left
    /usr/bin/python3 scripts/pages.py check NAME ...|scored [--scratch FOLDER]      run them there, compare, change nothing
    /usr/bin/python3 scripts/pages.py check --registry                              is all that has figures in the list?

NAME is a command of the list. OPTIONS go to the command's first program, of which `all` takes none. `check` prints page, table,
row, column, and what is said and found; differences of scored values make it end with exit code 1, while those of times, and
which program made a table, are printed alone. In a page a table stands between `<!-- table: NAME -->` (or text, or file) and
`<!-- end -->`. Programs are built first, by scripts/build.sh.
"""
import argparse
import fnmatch
import glob
import os
import pathlib
import re
import shlex
import shutil
import subprocess
import sys

sys.dont_write_bytecode = True
try:
    import tomllib
except ImportError:
    sys.exit("scripts/pages.py needs Python 3.11, which has tomllib; /usr/bin/python3 of Debian 12 is")

import page_compare  # noqa: E402
import page_text  # noqa: E402

REGISTRY = "docs/tables.toml"
PAGES = ["README.md", "docs/*.md", "results/**/*.md"]
FILES = ["docs/pictures/**", "docs/*/*.csv", "results/**"]  # what is no page, and has to be in the list
KINDS = ["scored", "timed", "picture"]
LINES = 60  # that check prints of a table's differences, those that are judged first
MARKER = re.compile(r"<!-- (?:(?:table|text|file): (?P<name>\S+)|(?P<audit>audit) begins) -->\n(?P<text>.*?)"
                    r"<!-- (?:end|audit ends) -->", re.DOTALL)
COMMAND_KEYS = {"name", "each", "target", "run", "draw", "out", "minutes", "pictures", "copies", "table", "file", "why"}
RULES = {"unjudged": list, "unjudged_rows": list, "judged": list, "tolerance": dict}
TABLE_KEYS = {"page", "name", "from", "as", "kind", *RULES}
FILE_KEYS = {"path", "from", "without", "kind", *RULES}
HAND_KEYS = {"page", "header", "files", "why"}


class Fault(Exception):
    """One sentence on what is wrong with the list or a page."""


# --- The list ---------------------------------------------------------------------------------------------------------


def with_name(value, name):
    """{each} in all texts of a value replaced."""
    if isinstance(value, str):
        return value.replace("{each}", name)
    if isinstance(value, list):
        return [with_name(one, name) for one in value]
    if isinstance(value, dict):
        return {with_name(key, name): with_name(one, name) for key, one in value.items()}
    return value


def expect_keys(what, entry, keys, required):
    for key in entry:
        if key not in keys:
            raise Fault(f"{REGISTRY}: {what} has the unknown key '{key}', expected one of {', '.join(sorted(keys))}")
    for key in required:
        if not entry.get(key):
            raise Fault(f"{REGISTRY}: {what} has no {key}")
    if "kind" in entry and entry["kind"] not in KINDS:
        raise Fault(f"{REGISTRY}: {what} is of kind '{entry['kind']}', expected {', '.join(KINDS)}")
    for key, kind in RULES.items():
        if key in entry and not isinstance(entry[key], kind):
            raise Fault(f"{REGISTRY}: {key} of {what} is {entry[key]!r}, expected a {'table' if kind is dict else 'list'}")


class Registry:
    def __init__(self, root):
        self.root = pathlib.Path(root)
        try:
            with open(self.root / REGISTRY, "rb") as file:
                found = tomllib.load(file)
        except (OSError, tomllib.TOMLDecodeError) as error:
            raise Fault(f"{REGISTRY}: cannot be read: {error}") from error
        expect_keys("the file", found, {"command", "by_hand"}, ["command"])
        self.commands = {}
        for entry in found["command"]:
            for name in entry.get("each", [entry.get("name")]):
                self.add(with_name({**entry, "name": name}, name or ""))
        self.by_hand = found.get("by_hand", [])
        for entry in self.by_hand:
            what = f"a by_hand entry ({entry.get('page') or entry.get('files')})"
            expect_keys(what, entry, HAND_KEYS, ["why"])
            if ("page" in entry) == ("files" in entry) or ("page" in entry) != ("header" in entry):
                raise Fault(f"{REGISTRY}: {what} needs a page and a header, or files")
        places = [(table["page"], table["name"]) for command in self.commands.values() for table in command["table"]]
        for place in places:
            if places.count(place) > 1:
                raise Fault(f"{REGISTRY}: the table {place[1]} of {place[0]} stands {places.count(place)} times in the list")

    def add(self, command):
        name = command["name"]
        expect_keys(f"the command {name}", command, COMMAND_KEYS, ["name", "run", "out", "minutes"])
        if name in self.commands:
            raise Fault(f"{REGISTRY}: the command {name} stands twice in the list")
        for key, keys, required in (("table", TABLE_KEYS, ["page", "name", "from", "kind"]),
                                    ("file", FILE_KEYS, ["path", "from", "kind"])):
            command.setdefault(key, [])
            for entry in command[key]:
                expect_keys(f"a {key} of {name} ({entry.get('name') or entry.get('path')})", entry, keys, required)
                if entry.get("as", "text") not in page_text.KINDS:
                    raise Fault(f"{REGISTRY}: the table {entry['name']} is made as '{entry['as']}', expected one of "
                                f"{', '.join(page_text.KINDS)}")
        self.commands[name] = command

    def chosen(self, names):
        """By name, or by what is in them."""
        chosen = []
        for name in names:
            if name in ("all", "scored", "timed"):
                chosen += [c for c in self.commands.values() if name == "all" or is_scored(c) == (name == "scored")]
            elif name in self.commands:
                chosen.append(self.commands[name])
            else:
                raise Fault(f"'{name}' is no command of {REGISTRY}, expected all, scored, timed or one of "
                            f"{', '.join(self.commands)}")
        return list({command["name"]: command for command in chosen}.values())

    def pages(self):
        return sorted({str(pathlib.Path(path).relative_to(self.root))
                       for pattern in PAGES for path in glob.glob(str(self.root / pattern), recursive=True)})


def judge_of(entry):
    return page_compare.Judge(entry["kind"], **{key: entry[key] for key in RULES if key in entry})


def is_scored(command):
    return any(judge_of(entry).judges_any() for entry in command["table"] + command["file"])


# --- Pages ------------------------------------------------------------------------------------------------------------


def places_of(root, page):
    """What stands between markers, by name: matches. Fault where a marker is wrong."""
    try:
        text = (root / page).read_text()
    except OSError as error:
        raise Fault(f"{page}: cannot be read: {error.strerror}") from error
    places = {}
    for match in MARKER.finditer(text):
        name = match["name"] or match["audit"]
        if name in places:
            raise Fault(f"{page}: the marker of {name} stands twice")
        if re.search(r"<!-- (?:table|text|file):", match["text"]):
            raise Fault(f"{page}: the marker of {name} has no <!-- end --> before the next one begins")
        places[name] = match
    begun = re.findall(r"<!-- (?:table|text|file): .*?-->", text)
    if len(begun) > sum(match["name"] is not None for match in places.values()):
        known = {f"<!-- {kind}: {name} -->" for name in places for kind in ("table", "text", "file")}
        odd = next((marker for marker in begun if marker not in known), begun[-1])
        raise Fault(f"{page}: '{odd}' is no marker, expected <!-- table: NAME --> alone in its line, and <!-- end -->")
    return text, places


def place_of(root, table):
    text, places = places_of(root, table["page"])
    if table["name"] not in places:
        raise Fault(f"{table['page']} has no place for {table['name']}, expected <!-- table: {table['name']} --> and "
                    "<!-- end -->")
    return text, places[table["name"]]


def made_text(out, entry):
    """What a page or a file should have, by the command's output."""
    source = out / entry["from"]
    kind = entry.get("as") or {".csv": "csv", ".txt": "fenced"}.get(source.suffix, "text")
    try:
        return page_text.text_of(source, kind if "page" in entry else None, entry.get("without", ()))
    except (OSError, ValueError, KeyError) as error:
        raise Fault(f"{entry.get('name') or entry['path']} cannot be made of {entry['from']}: {error}") from error


def files_of(root, out, entry):
    """Pairs (path in the tree, source below out) of a file entry, whose path may be a pattern with one star."""
    if "*" not in entry["path"]:
        return [(entry["path"], entry["from"])]
    names = {pathlib.Path(path).name for path in glob.glob(str(out / entry["from"]))}
    names |= {pathlib.Path(path).name for path in glob.glob(str(root / entry["path"]))}
    folder, source = os.path.dirname(entry["path"]), os.path.dirname(entry["from"])
    return [(os.path.join(folder, name), os.path.join(source, name)) for name in sorted(names)]


def write(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(path.name + ".part")
    part.write_text(text)
    part.replace(path)


def without_what_is_missing(out, command):
    """After a run with options, which may have made a part: what is not there stays in the pages as it is."""
    def is_there(entry):
        there = bool(glob.glob(str(out / entry["from"])))
        if not there:
            print(f"{entry.get('name') or entry['path']}: left as it is, {out / entry['from']} is not there")
        return there

    return {**command, "table": [entry for entry in command["table"] if is_there(entry)],
            "file": [entry for entry in command["file"] if is_there(entry)]}


def fill(root, out, command):
    """Makes all texts before it writes one."""
    texts, copies = {}, []
    for table in command["table"]:
        text = made_text(out, table)
        if table["page"] not in texts:
            texts[table["page"]] = places_of(root, table["page"])[0]
        place_of(root, table)
        # A marker is looked for again in the page as filled so far.
        texts[table["page"]] = next(
            texts[table["page"]][:m.start("text")] + text + texts[table["page"]][m.end("text"):]
            for m in MARKER.finditer(texts[table["page"]]) if (m["name"] or m["audit"]) == table["name"])
    for entry in command["file"]:
        for path, source in files_of(root, out, entry):
            texts[path] = made_text(out, {**entry, "path": path, "from": source})
    for source, path in command.get("copies", {}).items():
        if not (out / source).exists():
            raise Fault(f"{path} is copied from {out / source}, which is not there")
        copies.append((out / source, root / path))
    for path, text in texts.items():
        write(root / path, text)
    for source, path in copies:
        if source.is_dir():
            shutil.copytree(source, path, dirs_exist_ok=True)
        else:
            shutil.copyfile(source, path)
    return list(texts)


# --- Commands ---------------------------------------------------------------------------------------------------------


def run_lines(root, lines, out, pictures, options=()):
    out.mkdir(parents=True, exist_ok=True)
    for i, line in enumerate(lines):
        line = line.replace("{out}", shlex.quote(str(out))).replace("{pictures}", shlex.quote(str(pictures)))
        if "{options}" in line:
            line = line.replace("{options}", shlex.join(options))
        elif i == 0 and options:
            line += " " + shlex.join(options)
        print(f"$ {line}", flush=True)
        status = subprocess.run(["bash", "-o", "pipefail", "-c", line], cwd=root, check=False).returncode
        if status != 0:
            raise Fault(f"'{line}' ended with exit code {status}")


def forget(out, command):
    """What an earlier run left is no result of the next one."""
    for entry in command["table"] + command["file"]:
        for path in glob.glob(str(out / entry["from"])):
            os.remove(path)


def build(root, commands):
    targets = sorted({command["target"] for command in commands if "target" in command})
    if targets:
        subprocess.run(["bash", "scripts/build.sh", "--target", *targets], cwd=root, check=True)


def relative(root, path):
    """Below the root as a relative path, so that no output names the machine's folders."""
    path = pathlib.Path(path)
    return path if not path.is_absolute() else pathlib.Path(os.path.relpath(path, root))


def make(registry, names, options, run):
    root, status = registry.root, 0
    commands = registry.chosen(names)
    if options and len(commands) > 1 and set(names) & {"all", "scored", "timed"}:
        raise Fault("options are those of one program, and cannot go to all of them")
    if run:
        build(root, commands)
    for command in commands:
        out = pathlib.Path(command["out"])
        try:
            if run:
                if not options:  # which may be to make a part
                    forget(root / out, command)
                run_lines(root, command["run"], out, "docs/pictures", options)
            try:
                run_lines(root, command.get("draw", []), out, "docs/pictures")
            finally:  # a picture that cannot be drawn leaves the tables to be filled
                part = without_what_is_missing(root / out, command) if options else command
                print(f"{command['name']}: filled {', '.join(fill(root, root / out, part))}", flush=True)
        except Fault as fault:
            print(f"{command['name']}: {fault}", file=sys.stderr)
            status = 1
    return status


def shown(value):
    return "nothing" if value is None else f"'{value}'"


def check_pictures(root, command, out, say):
    """Says which pictures are not, byte by byte, what these results draw; another matplotlib may draw other bytes."""
    drawn = {os.path.join("docs/pictures", path.name): path for path in (root / out / "pictures").glob("*")}
    drawn |= {path: root / out / source for source, path in command.get("copies", {}).items()}
    for path, made in drawn.items():
        if made.is_file() and any(fnmatch.fnmatchcase(path, pattern) for pattern in command.get("pictures", [])):
            if not (root / path).exists() or (root / path).read_bytes() != made.read_bytes():
                say(f"not judged: {path} is another picture than {made.relative_to(root)}")


def check_command(registry, command, out, say=print):
    """Runs a command into a folder of its own; the number of judged values that differ."""
    root = registry.root
    forget(root / out, command)
    (root / out / "pictures").mkdir(parents=True, exist_ok=True)
    run_lines(root, command["run"], out, out / "pictures")
    # A line that knows no other place than the pages' draws nothing.
    run_lines(root, [line for line in command.get("draw", []) if "{pictures}" in line], out, out / "pictures")
    check_pictures(root, command, out, say)
    wrong = 0
    entries = [(table["page"], table["name"], table, None) for table in command["table"]]
    for entry in command["file"]:
        entries += [(path, "", {**entry, "from": source}, path) for path, source in files_of(root, root / out, entry)]
    for page, name, entry, path in entries:
        if entry["kind"] == "picture":
            continue
        found = made_text(root / out, entry)
        if path is None:
            said = place_of(root, entry)[1]["text"]
        else:
            said = (root / path).read_text() if (root / path).exists() else ""
        differences, equal = page_compare.compare(said, found, judge_of(entry), ending=os.path.splitext(page)[1])
        differences.sort(key=lambda d: not d.judged)
        for d in differences[:LINES]:
            where = ", ".join(filter(None, (page, name and f"table {name}", f"row {d.row}", d.column and f"column {d.column}")))
            say(f"{'differs' if d.judged else 'not judged'}: {where}: said {shown(d.said)}, found {shown(d.found)}")
        if len(differences) > LINES:
            say(f"and {len(differences) - LINES} more")
        bad = sum(d.judged for d in differences)
        say(f"{page}{name and ', table ' + name}: {equal} values as found, {bad} differ, "
            f"{len(differences) - bad} differ and are not judged")
        wrong += bad
    return wrong


def check(registry, names, scratch):
    commands, wrong, failed = registry.chosen(names), 0, []
    build(registry.root, commands)
    for command in commands:
        try:
            wrong += check_command(registry, command, scratch_of(scratch, command))
        except Fault as fault:
            print(f"{command['name']}: {fault}", file=sys.stderr)
            failed.append(command["name"])
    print(f"{wrong} values differ, of {len(commands)} commands" + (f"; failed: {', '.join(failed)}" if failed else ""))
    return 1 if wrong or failed else 0


def scratch_of(scratch, command):
    """out/... below the scratch folder; cells of experiments are there for whoever runs them below it again."""
    return pathlib.Path(scratch) / pathlib.Path(command["out"]).relative_to("out")


# --- What is not in the list ------------------------------------------------------------------------------------------


def tables_of(text):
    """(header line, rows, line number) of all tables, of Markdown or of aligned columns in fences, in which a row is one with
    two figures and more."""
    lines, fenced = text.splitlines(), False
    for i, line in enumerate(lines):
        if line.lstrip().startswith("```"):
            fenced = not fenced
        elif fenced:
            cells = page_text.cells_of(line)
            if sum(is_figure(cell) for cell in cells[1:]) > 1:
                yield lines[i - 1].strip(), ["| " + " | ".join(cells)], i + 1
        elif page_compare.is_rule(line) and i > 0 and page_compare.is_row(lines[i - 1]):
            end = i + 1
            while end < len(lines) and page_compare.is_row(lines[end]):
                end += 1
            yield lines[i - 1].strip(), lines[i + 1:end], i


def is_figure(cell):
    """It begins with a number, and beyond numbers has no more than a unit."""
    return re.match(r"[-+]?\d", cell.strip("`* ")) is not None and len(re.findall(r"[^\W\d_]", cell)) <= 8


def has_figures(rows):
    return any(is_figure(cell) for row in rows for cell in page_compare.cells_of_row(row)[1:])


def faults_of_page(registry, page, whole_pages, hand_used):
    text, places = places_of(registry.root, page)
    if page in whole_pages:
        return []
    known = {table["name"] for command in registry.commands.values() for table in command["table"] if table["page"] == page}
    faults = [f"{page}: the marker of {name} is of no table in {REGISTRY}" for name in places if name not in known]
    faults += [f"{page} has no place for {name}, expected <!-- table: {name} --> and <!-- end -->"
               for name in sorted(known - set(places))]
    # Lines stay where they are, so that what is said of the others counts.
    for match in places.values():
        blank = "\n" * match["text"].count("\n")
        text = text[:match.start("text")] + blank.rjust(len(match["text"])) + text[match.end("text"):]
    for header, rows, number in tables_of(text):
        of_hand = [k for k, entry in enumerate(registry.by_hand)
                   if entry.get("page") == page and header.startswith(entry["header"])]
        hand_used.update(of_hand)
        if has_figures(rows) and not of_hand:
            faults.append(f"{page}:{number}: the table '{header[:60]}' has figures and no command in {REGISTRY}, which may "
                          "also list it under by_hand")
    for picture in re.findall(r"!\[[^\]]*\]\(([^)#]+)\)", text):
        path = os.path.normpath(os.path.join(os.path.dirname(page), picture))
        if "://" not in picture and not (registry.root / path).exists():
            faults.append(f"{page}: the picture {path} is not there")
    return faults


def faults_of_files(registry, hand_used):
    """Files that no command makes, and what commands should have made."""
    root, faults = registry.root, []
    made = {pattern: command["name"] for command in registry.commands.values()
            for pattern in command.get("pictures", []) + [entry["path"] for entry in command["file"]]}
    seen = set()
    for pattern in FILES:
        for path in glob.glob(str(root / pattern), recursive=True):
            path = str(pathlib.Path(path).relative_to(root))
            if not (root / path).is_file():
                continue
            fits = {of for of in made if fnmatch.fnmatchcase(path, of)}
            of_hand = [k for k, entry in enumerate(registry.by_hand)
                       if any(fnmatch.fnmatchcase(path, of) for of in entry.get("files", []))]
            seen |= fits
            hand_used.update(of_hand)
            is_page = path.endswith(".md") and path in registry.pages()
            if not fits and not of_hand and not is_page:
                faults.append(f"{path} is made by no command of {REGISTRY}, which may also list it under by_hand")
    for pattern, name in made.items():
        if pattern not in seen and not glob.glob(str(root / pattern)):
            faults.append(f"{pattern}, which the command {name} makes, is not there")
    for command in registry.commands.values():
        for path in command.get("copies", {}).values():
            if not any(fnmatch.fnmatchcase(path, of) or of.startswith(path + "/") for of in command.get("pictures", [])):
                faults.append(f"{path} is copied by {command['name']} and is not among its pictures")
    return faults


def faults_of(registry):
    hand_used, faults = set(), []
    whole_pages = {entry["path"] for command in registry.commands.values() for entry in command["file"]}
    pages = registry.pages()
    for command in registry.commands.values():
        for table in command["table"]:
            if table["page"] not in pages:
                faults.append(f"{table['page']}, which has the table {table['name']}, is not there")
    for page in pages:
        try:
            faults += faults_of_page(registry, page, whole_pages, hand_used)
        except Fault as fault:
            faults.append(str(fault))
    faults += faults_of_files(registry, hand_used)
    faults += [f"{REGISTRY}: the by_hand entry of {entry.get('page') or ', '.join(entry['files'])} "
               f"({entry.get('header', 'files')}) fits nothing" for k, entry in enumerate(registry.by_hand) if k not in hand_used]
    return faults


def check_registry(registry):
    faults = faults_of(registry)
    for fault in faults:
        print(fault, file=sys.stderr)
    tables = sum(len(command["table"]) for command in registry.commands.values())
    print(f"{len(registry.commands)} commands, {tables} tables in pages; {len(faults)} faults")
    return 1 if faults else 0


def show(registry, names):
    for command in registry.chosen(names or ["all"]):
        kind = "scored" if is_scored(command) else "timed" if command["table"] + command["file"] else "pictures"
        print(f"{command['name']}: {kind}, some {command['minutes']:g} min, into {command['out']}")
        for line in command["run"] + command.get("draw", []):
            print(f"  $ {line}")
        for table in command["table"]:
            print(f"  {table['page']}: table {table['name']} ({table['kind']})")
        for entry in command["file"]:
            print(f"  {entry['path']} ({entry['kind']})")
        for picture in command.get("pictures", []):
            print(f"  {picture} (picture)")
    return 0


def main(arguments, root=pathlib.Path(__file__).resolve().parent.parent):
    options = []
    if "--" in arguments:
        at = arguments.index("--")
        arguments, options = arguments[:at], arguments[at + 1:]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("do", choices=["list", "make", "fill", "check"])
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--scratch", default="out/pages", metavar="FOLDER", help="where check runs commands")
    parser.add_argument("--registry", action="store_true", help="with check: look at the list and the pages alone")
    parsed = parser.parse_args(arguments)
    if parsed.registry and (parsed.do != "check" or parsed.names):
        parser.error("--registry is for check alone, without names")
    if not parsed.names and parsed.do != "list" and not parsed.registry:
        parser.error(f"{parsed.do} needs NAME, e.g. all, or scored")
    if options and parsed.do != "make":
        parser.error("options after -- are for make alone")
    os.chdir(root)
    try:
        registry = Registry(root)
        if parsed.do == "list":
            return show(registry, parsed.names)
        if parsed.registry:
            return check_registry(registry)
        if parsed.do == "check":
            return check(registry, parsed.names, relative(root, parsed.scratch))
        return make(registry, parsed.names, options, run=parsed.do == "make")
    except Fault as fault:
        print(f"pages: {fault}", file=sys.stderr)
        return 1
    except subprocess.CalledProcessError as error:
        print(f"pages: the build ended with exit code {error.returncode}", file=sys.stderr)
        return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
