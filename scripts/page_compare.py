"""Compares what a page says with what was found, value by value: tables by row and column, sentences by their parts."""
import collections
import csv
import fnmatch
import io
import json
import re

import page_prose
import page_text

# What names the program that made something is printed, never judged.
MADE_BY = re.compile(r"^Made by tsdfpp\b|\btsdfpp \d+\.\d+\.\d+ [0-9a-f]{16}\b")
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e-?\d+)?")

Table = collections.namedtuple("Table", "header rows")
# judged: whether it counts; row and column: where; said, found: None where it is not there.
Difference = collections.namedtuple("Difference", "judged row column said found")


class Judge:
    """What counts: patterns of columns and rows that do not, and how far values may be apart, by column."""

    def __init__(self, kind="scored", unjudged=(), unjudged_rows=(), judged=(), tolerance=None):
        self.timed = kind != "scored"
        self.unjudged, self.unjudged_rows, self.judged = unjudged, unjudged_rows, judged
        self.tolerance = tolerance or {}

    def judges_any(self):
        return not self.timed or bool(self.judged)

    def judges(self, row, column):
        def fits(name, patterns):
            return any(fnmatch.fnmatchcase(name, pattern) for pattern in patterns)

        if fits(row, self.unjudged_rows) or fits(column, self.unjudged):
            return False
        return not self.timed or fits(column, self.judged)

    def same(self, column, said, found):
        if said == found:
            return True
        far = next((far for pattern, far in self.tolerance.items() if fnmatch.fnmatchcase(column, pattern)), None)
        if far is None or NUMBER.sub("#", said) != NUMBER.sub("#", found):
            return False
        # A rounding of the sum is no difference.
        return all(abs(float(a) - float(b)) <= far * (1 + 1e-9)
                   for a, b in zip(NUMBER.findall(said), NUMBER.findall(found)))


def cells_of_row(line):
    """Of a row of a Markdown table; a bar after a backslash or in a formula's quotes belongs to the cell."""
    return [cell.strip() for cell in re.split(r"(?<!\\)\|", line.strip().strip("|"))]


def is_row(line):
    return line.lstrip().startswith("|")


def is_rule(line):
    return is_row(line) and re.fullmatch(r"[|:\- ]+", line.strip()) is not None and "-" in line


def read(text):
    """The tables of Markdown, fenced tables of aligned columns too, and the other lines; of prose, paragraphs."""
    tables, sentences = [], []
    lines = text.splitlines()
    for paragraph in reversed(page_prose.paragraphs_of(lines)):
        lines[paragraph.start:paragraph.stop] = [" ".join(line.strip() for line in lines[paragraph.start:paragraph.stop])]
    fenced = False
    i = 0
    while i < len(lines):
        line = lines[i]
        i += 1
        if line.startswith("```"):
            fenced = not fenced
        elif fenced and max(map(len, map(page_text.cells_of, lines[i - 1:i + 1]))) >= 3 and "  " in line:
            rows = [page_text.cells_of(line)]
            if i < len(lines) and len(page_text.cells_of(lines[i])) == len(rows[0]) + 1:
                rows[0].insert(0, "")  # names have no title
            while i < len(lines) and len(page_text.cells_of(lines[i])) == len(rows[0]):
                rows.append(page_text.cells_of(lines[i]))
                i += 1
            if page_text.is_row_of_figures(rows[0]) and rows[0][0]:
                rows.insert(0, [""] * len(rows[0]))  # its titles stand too near to each other to be told apart
            if len(rows) > 1:
                tables.append(Table(rows[0], rows[1:]))
            else:
                sentences.append(line.strip())
        elif not fenced and is_row(line) and i < len(lines) and is_rule(lines[i]):
            header, rows = cells_of_row(line), []
            i += 1
            while i < len(lines) and is_row(lines[i]):
                rows.append(cells_of_row(lines[i]))
                i += 1
            tables.append(Table(header, rows))
        elif line.strip():
            sentences.append(line.strip())
    return tables, sentences


def read_csv(text):
    rows = list(csv.reader(io.StringIO(text)))
    return ([Table(rows[0], rows[1:])] if rows else []), []


def values_of(value, name=""):
    """What a JSON value holds, by its path; things in a list by their name, if they have one."""
    if isinstance(value, dict):
        for key, one in value.items():
            yield from values_of(one, f"{name}.{key}" if name else key)
    elif isinstance(value, list):
        for i, one in enumerate(value):
            named = one.get("sequence") or one.get("name") if isinstance(one, dict) else None
            yield from values_of(one, f"{name}.{named or i}")
    else:
        yield [name, json.dumps(value)]


def read_json(text):
    return ([Table(["value of", "value"], list(values_of(json.loads(text))))] if text else []), []


READERS = {".csv": read_csv, ".json": read_json}


def keys_of(said, found):
    """The rows of both by name, and how many cells it has: as few from the left as tell all rows apart; else the row's number
    tells them apart."""
    for width in range(1, max(2, len(said.header))):
        named = [[" ".join(filter(None, row[:width])) for row in table.rows] for table in (said, found)]
        if all(len(set(names)) == len(names) for names in named):
            return *named, width
    return *([f"{row[0] if row else ''} (row {i + 1})" for i, row in enumerate(table.rows)] for table in (said, found)), 0


def compare_tables(said, found, judge):
    differences, equal = [], 0
    for column in said.header:
        if column not in found.header:
            differences.append(Difference(True, "header", column, column, None))
    for column in found.header:
        if column not in said.header:
            differences.append(Difference(True, "header", column, None, column))
    names, names_found, width = keys_of(said, found)
    rows = dict(zip(names_found, found.rows))
    for name, row in zip(names, said.rows):
        if name not in rows:
            differences.append(Difference(True, name, "", "; ".join(row), None))
            continue
        other = rows.pop(name)
        for k, column in enumerate(said.header):
            if column not in found.header:
                continue
            # Columns may have one name; then they are told apart by their order.
            same_name = [i for i, title in enumerate(found.header) if title == column]
            place = said.header[:k].count(column)
            at = same_name[min(place, len(same_name) - 1)]
            a, b = (cells[i] if i < len(cells) else "" for cells, i in ((row, k), (other, at)))
            judged = judge.judges(name, column)
            if judge.same(column, a, b):
                equal += judged and k >= width
            else:
                differences.append(Difference(judged, name, column, a, b))
    differences += [Difference(True, name, "", None, "; ".join(row)) for name, row in rows.items()]
    if names != names_found and not any(d.said is None or d.found is None for d in differences):
        differences.append(Difference(True, "order of the rows", "", ", ".join(names), ", ".join(names_found)))
    return differences, equal


def parts_of(sentence):
    """"- where: what: one; another" as its beginning and its parts."""
    head, colon, tail = sentence.rpartition(": ")
    return (head, [part.strip(" .") for part in tail.split(";")]) if colon and ";" in tail else (sentence, [""])


def compare_sentences(said, found, judge):
    differences, equal = [], 0
    by_head = collections.defaultdict(list)
    for sentence in found:
        by_head[parts_of(sentence)[0]].append(sentence)
    for sentence in said:
        made_by = MADE_BY.search(sentence)
        judged = not judge.timed and not made_by
        head, parts = parts_of(sentence)
        if made_by:
            same = [s for of in by_head.values() for s in of if MADE_BY.search(s)]
            other = same[0] if same else None
        else:
            other = by_head[head][0] if by_head[head] else None
        if other is None:
            differences.append(Difference(judged, "text", "", sentence, None))
            continue
        by_head[parts_of(other)[0]].remove(other)
        others = parts_of(other)[1]
        if sentence == other:
            equal += judged * len(parts)
        elif made_by or len(parts) != len(others):
            differences.append(Difference(judged, "text", "", sentence, other))
        else:
            for a, b in zip(parts, others):
                if judge.same("", a, b):
                    equal += judged
                else:
                    differences.append(Difference(judged, head.lstrip("- "), "", a, b))
    differences += [Difference(not judge.timed and not MADE_BY.search(s), "text", "", None, s)
                    for of in by_head.values() for s in of]
    return differences, equal


def compare(said, found, judge, ending=".md"):
    """The differences of two texts, by their files' ending, and how many judged values are equal."""
    reader = READERS.get(ending, read)
    (tables, sentences), (tables_found, sentences_found) = reader(said), reader(found)
    differences, equal = [], 0
    if len(tables) != len(tables_found):
        differences.append(Difference(judge.judges_any(), "tables", "", str(len(tables)), str(len(tables_found))))
    pairs = [compare_tables(a, b, judge) for a, b in zip(tables, tables_found)]
    for more, count in pairs + [compare_sentences(sentences, sentences_found, judge)]:
        differences += more
        equal += count
    if not judge.judges_any():
        differences = [difference._replace(judged=False) for difference in differences]
    return differences, equal
