"""The list of what stands in the pages and which command makes it, docs/tables.toml, and what is missing in it."""
import fnmatch
import glob
import os
import pathlib
import re
import sys

try:
    import tomllib
except ImportError:
    sys.exit("scripts/pages.py needs Python 3.11, which has tomllib; /usr/bin/python3 of Debian 12 is")

import page_compare
import page_text

REGISTRY = "docs/tables.toml"
PAGES = ["README.md", "docs/*.md", "results/**/*.md"]
FILES = ["docs/pictures/**", "docs/*/*.csv", "results/**"]  # what is no page, and has to be in the list
KINDS = ["scored", "timed"]
MARKER = re.compile(r"<!-- (?:(?:table|text|file): (?P<name>\S+)|(?P<audit>audit) begins) -->\n(?P<text>.*?)"
                    r"<!-- (?:end|audit ends) -->", re.DOTALL)
COMMAND_KEYS = {"name", "each", "target", "run", "draw", "out", "minutes", "pictures", "copies", "table", "file", "why"}
RULES = {"unjudged": list, "unjudged_rows": list, "judged": list, "tolerance": dict}
TABLE_KEYS = {"page", "name", "from", "as", "kind", *RULES}
FILE_KEYS = {"path", "from", "without", "kind", *RULES}
HAND_KEYS = {"page", "header", "files", "why"}


class Fault(Exception):
    """One sentence on what is wrong with the list or a page."""


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
            if name in GROUPS:
                chosen += filter(GROUPS[name], self.commands.values())
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


def is_timed(command):
    return any(entry["kind"] == "timed" for entry in command["table"] + command["file"])


# Some commands are of both kinds.
GROUPS = {"all": lambda command: True, "scored": is_scored, "timed": is_timed}


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


def tables_of(text):
    """(header line, rows, line number) of all tables, of Markdown or of aligned columns in fences, in which a row is one with
    two figures and more."""
    lines, fenced = text.splitlines(), False
    for i, line in enumerate(lines):
        if line.lstrip().startswith("```"):
            fenced = not fenced
        elif fenced:
            cells = page_text.cells_of(line)
            if page_text.is_row_of_figures(cells):
                yield lines[i - 1].strip(), ["| " + " | ".join(cells)], i + 1
        elif page_compare.is_rule(line) and i > 0 and page_compare.is_row(lines[i - 1]):
            end = i + 1
            while end < len(lines) and page_compare.is_row(lines[end]):
                end += 1
            yield lines[i - 1].strip(), lines[i + 1:end], i


def has_figures(rows):
    return any(page_text.is_figure(cell) for row in rows for cell in page_compare.cells_of_row(row)[1:])


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
