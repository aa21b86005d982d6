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
import shlex
import shutil
import subprocess
import sys

sys.dont_write_bytecode = True  # the scripts' folder stays as it is
import page_compare  # noqa: E402
import page_text  # noqa: E402
from page_registry import GROUPS, MARKER, Fault, Registry, faults_of, judge_of, place_of, places_of  # noqa: E402

LINES = 60  # that check prints of a table's differences, those that are judged first


# --- Pages ------------------------------------------------------------------------------------------------------------


def made_text(out, entry):
    """What a page or a file should have, by the command's output."""
    source = out / entry["from"]
    kind = entry.get("as") or {".csv": "csv", ".txt": "fenced"}.get(source.suffix, "text")
    try:
        page_text.check_run(source)
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


def copy(source, path):
    """The file is there whole, as write() does it."""
    path = pathlib.Path(path)
    part = path.with_name(path.name + ".part")
    shutil.copyfile(source, part)
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
            shutil.copytree(source, path, copy_function=copy, dirs_exist_ok=True)
        else:
            copy(source, path)
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
    targets = sorted({target for command in commands for target in command.get("target", "").split()})
    if targets:
        subprocess.run(["bash", "scripts/build.sh", "--target", *targets], cwd=root, check=True)


def relative(root, path):
    """Below the root as a relative path, so that no output names the machine's folders."""
    path = pathlib.Path(path)
    return path if not path.is_absolute() else pathlib.Path(os.path.relpath(path, root))


def make(registry, names, options, run):
    root, status = registry.root, 0
    commands = registry.chosen(names)
    if options and len(commands) > 1 and set(names) & set(GROUPS):
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


def check_registry(registry):
    faults = faults_of(registry)
    for fault in faults:
        print(fault, file=sys.stderr)
    tables = sum(len(command["table"]) for command in registry.commands.values())
    print(f"{len(registry.commands)} commands, {tables} tables in pages; {len(faults)} faults")
    return 1 if faults else 0


def show(registry, names):
    for command in registry.chosen(names or ["all"]):
        kinds = [name for name, fits in GROUPS.items() if name != "all" and fits(command)]
        print(f"{command['name']}: {' and '.join(kinds)}, some {command['minutes']:g} min, into {command['out']}")
        for line in command["run"] + command.get("draw", []):
            print(f"  $ {line}")
        for table in command["table"]:
            print(f"  {table['page']}: table {table['name']} ({table['kind']})")
        for entry in command["file"]:
            print(f"  {entry['path']} ({entry['kind']})")
        for picture in command.get("pictures", []):
            print(f"  {picture} (picture)")
    print(f"some {sum(command['minutes'] for command in registry.chosen(names or ['all'])):g} min in all")
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
