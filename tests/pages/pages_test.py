#!/usr/bin/env python3
"""scripts/pages.py on small pages: a wrong value is found, a wrong time is not judged, an unknown table is refused."""

import contextlib
import io
import json
import os
import pathlib
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts"))
import page_compare  # noqa: E402
import page_prose  # noqa: E402
import page_text  # noqa: E402
import pages  # noqa: E402

LIST = """
[[command]]
name = "planted"
run = ["cp planted/* {out}"]
out = "out/planted"
minutes = 0.1

[[command.table]]
page = "README.md"
name = "speeds"
from = "speeds.csv"
kind = "scored"
unjudged = ["* ms"]

[[command.file]]
path = "docs/numbers/speeds.csv"
from = "speeds.csv"
kind = "scored"
unjudged = ["* ms"]

[[command]]
name = "clock"
run = ["printf 'map,fuse ms,hits\\\\ntsdf,1.5,7\\\\n' > {out}/clock.csv"]
out = "out/clock"
minutes = 0.1

[[command.table]]
page = "docs/clock.md"
name = "clock"
from = "clock.csv"
kind = "timed"

[[by_hand]]
page = "docs/clock.md"
header = "| bytes | what |"
why = "a layout"
"""
CSV = "map,kept,fuse ms\ntsdf,0.801,7.0\ntsdf++,0.992,6.1\n"
TABLE = "| map | kept | fuse ms |\n| --- | --- | --- |\n| tsdf | 0.801 | 7.0 |\n| tsdf++ | 0.992 | 6.1 |\n"
README = "# A page\n\nWords.\n\n<!-- table: speeds -->\n" + TABLE + "<!-- end -->\n\nMore words.\n"
CLOCK = ("<!-- table: clock -->\n| map | fuse ms | hits |\n| --- | --- | --- |\n| tsdf | 99 | 9 |\n<!-- end -->\n\n"
         "| bytes | what |\n|---|---|\n| 1 | 8 |\n")


class Pages(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.addCleanup(os.chdir, os.getcwd())
        self.root = pathlib.Path(folder.name).resolve()
        for path, text in {"docs/tables.toml": LIST, "README.md": README, "docs/clock.md": CLOCK, "planted/speeds.csv": CSV,
                           "docs/numbers/speeds.csv": CSV}.items():
            self.put(path, text)

    def put(self, path, text):
        (self.root / path).parent.mkdir(parents=True, exist_ok=True)
        (self.root / path).write_text(text)

    def replace(self, path, old, new):
        text = (self.root / path).read_text()
        self.assertIn(old, text)
        self.put(path, text.replace(old, new))

    def run_it(self, *arguments):
        """Exit code and all that is printed."""
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
            status = pages.main(list(arguments), self.root)
        return status, printed.getvalue()

    def test_what_is_true_passes_and_nothing_is_changed(self):
        status, printed = self.run_it("check", "scored")
        self.assertEqual(status, 0, printed)
        self.assertIn("README.md, table speeds: 2 values as found, 0 differ", printed)
        self.assertNotIn("clock", printed)  # a timed command is not run
        self.assertEqual((self.root / "README.md").read_text(), README)

    def test_a_wrong_value_is_found(self):
        self.replace("README.md", "0.992", "0.993")
        status, printed = self.run_it("check", "planted")
        self.assertEqual(status, 1)
        self.assertIn("differs: README.md, table speeds, row tsdf++, column kept: said '0.993', found '0.992'", printed)
        self.assertIn("1 values differ", printed)

    def test_a_wrong_value_of_a_file_is_found(self):
        self.replace("docs/numbers/speeds.csv", "0.801", "0.8")
        status, printed = self.run_it("check", "planted")
        self.assertEqual(status, 1)
        self.assertIn("differs: docs/numbers/speeds.csv, row tsdf, column kept: said '0.8', found '0.801'", printed)

    def test_a_wrong_time_is_printed_and_not_judged(self):
        self.replace("README.md", "6.1", "5.5")
        status, printed = self.run_it("check", "scored")
        self.assertEqual(status, 0, printed)
        self.assertIn("not judged: README.md, table speeds, row tsdf++, column fuse ms: said '5.5', found '6.1'", printed)
        status, printed = self.run_it("check", "clock")
        self.assertEqual(status, 0, printed)
        self.assertIn("not judged: docs/clock.md, table clock, row tsdf, column hits: said '9', found '7'", printed)

    def test_a_judged_column_of_a_timed_table(self):
        self.replace("docs/tables.toml", 'kind = "timed"', 'kind = "timed"\njudged = ["hits"]')
        status, printed = self.run_it("check", "scored")
        self.assertEqual(status, 1)
        self.assertIn("differs: docs/clock.md, table clock, row tsdf, column hits: said '9', found '7'", printed)
        self.assertIn("not judged: docs/clock.md, table clock, row tsdf, column fuse ms: said '99', found '1.5'", printed)

    def test_a_row_or_a_column_that_is_not_there(self):
        self.put("planted/speeds.csv", "map,fuse ms,sane\ntsdf,7.0,1\nvolumes,4.0,1\n")
        status, printed = self.run_it("check", "planted")
        self.assertEqual(status, 1)
        for place in ["row tsdf++: said 'tsdf++; 0.992; 6.1', found nothing", "row volumes: said nothing",
                      "row header, column kept: said 'kept', found nothing",
                      "row header, column sane: said nothing, found 'sane'"]:
            self.assertIn(place, printed)

    def test_an_interrupted_run_is_no_source(self):
        self.put("planted/summary.json", '{"run": "0123456789abcdef"}')
        status, printed = self.run_it("check", "planted")
        self.assertEqual(status, 1)
        self.assertIn("was interrupted: run the command again", printed)
        self.put("planted/run.json", '{"files": [{"name": "speeds.csv", "bytes": 3}]}')
        status, printed = self.run_it("check", "planted")
        self.assertEqual(status, 1)
        self.assertIn("bytes, expected 3", printed)
        size = (self.root / "planted/speeds.csv").stat().st_size
        self.put("planted/run.json", '{"files": [{"name": "speeds.csv", "bytes": %d}]}' % size)
        status, printed = self.run_it("check", "planted")
        self.assertEqual(status, 0, printed)

    def test_a_command_that_fails(self):
        self.replace("docs/tables.toml", "cp planted/*", "exit 3; cp planted/*")
        for do in ("check", "make"):
            status, printed = self.run_it(do, "planted")
            self.assertEqual(status, 1)
            self.assertIn("ended with exit code 3", printed)
        self.assertEqual((self.root / "README.md").read_text(), README)

    def test_make_fills_what_check_then_finds(self):
        self.put("planted/speeds.csv", CSV.replace("0.992", "0.5"))
        status, printed = self.run_it("make", "all")
        self.assertEqual(status, 0, printed)
        self.assertEqual((self.root / "README.md").read_text(), README.replace("0.992", "0.5"))
        self.assertIn("| tsdf | 1.5 | 7 |\n<!-- end -->", (self.root / "docs/clock.md").read_text())
        self.assertEqual((self.root / "docs/numbers/speeds.csv").read_text(), CSV.replace("0.992", "0.5"))
        self.assertEqual(self.run_it("check", "scored")[0], 0)
        self.put("planted/speeds.csv", CSV)  # fill runs nothing
        self.assertEqual(self.run_it("fill", "planted")[0], 0)
        self.assertEqual((self.root / "README.md").read_text(), README.replace("0.992", "0.5"))

    def test_an_output_that_is_not_there_leaves_the_page(self):
        self.replace("docs/tables.toml", 'from = "speeds.csv"\nkind = "scored"\nunjudged = ["* ms"]\n\n[[command]]',
                     'from = "slow.csv"\nkind = "scored"\n\n[[command]]')
        self.put("planted/speeds.csv", CSV.replace("0.992", "0.5"))
        status, printed = self.run_it("make", "planted")
        self.assertEqual(status, 1)
        self.assertIn("cannot be made of slow.csv", printed)
        self.assertEqual((self.root / "README.md").read_text(), README)

    def test_an_output_of_an_earlier_run_is_none(self):
        self.assertEqual(self.run_it("check", "planted")[0], 0)
        self.replace("docs/tables.toml", "cp planted/* {out}", "true")
        status, printed = self.run_it("check", "planted")
        self.assertEqual(status, 1)
        self.assertIn("speeds cannot be made of speeds.csv", printed)

    def test_a_picture_that_cannot_be_drawn_leaves_the_tables_filled(self):
        self.replace("docs/tables.toml", 'run = ["cp planted/* {out}"]', 'run = ["cp planted/* {out}"]\ndraw = ["exit 5"]')
        self.put("planted/speeds.csv", CSV.replace("0.992", "0.5"))
        status, printed = self.run_it("make", "planted")
        self.assertEqual(status, 1)
        self.assertIn("ended with exit code 5", printed)
        self.assertIn("| tsdf++ | 0.5 |", (self.root / "README.md").read_text())

    def test_a_picture_of_other_results_is_printed_and_not_judged(self):
        self.replace("docs/tables.toml", 'run = ["cp planted/* {out}"]',
                     'run = ["cp planted/* {out}"]\ndraw = ["cp planted/*.csv {pictures}/a.svg", "touch here"]\n'
                     'pictures = ["docs/pictures/a.svg"]')
        self.put("docs/pictures/a.svg", CSV)
        status, printed = self.run_it("check", "planted")
        self.assertEqual(status, 0, printed)
        self.assertNotIn("another picture", printed)
        self.put("docs/pictures/a.svg", "old")
        status, printed = self.run_it("check", "planted")
        self.assertEqual(status, 0)
        self.assertIn("not judged: docs/pictures/a.svg is another picture than", printed)
        self.assertFalse((self.root / "here").exists())

    def test_options_go_to_the_program_and_may_make_a_part(self):
        self.replace("docs/tables.toml", "cp planted/* {out}", "printf '%s;' {options} > {out}/said; true")
        status, printed = self.run_it("make", "planted", "--", "--part", "a b")
        self.assertEqual(status, 0, printed)
        self.assertEqual((self.root / "out/planted/said").read_text(), "--part;a b;")
        self.assertIn("speeds: left as it is, ", printed)
        self.assertEqual((self.root / "README.md").read_text(), README)

    def test_a_page_that_is_still_to_be_filled(self):
        self.put("README.md", "# A page\n\n<!-- table: speeds -->\n(Run it.)\n<!-- end -->\n")
        status, printed = self.run_it("check", "planted")
        self.assertEqual(status, 1)
        self.assertIn("differs: README.md, table speeds, row tables: said '0', found '1'", printed)

    def test_names_and_options(self):
        self.assertIn("'plant' is no command", self.run_it("check", "plant")[1])
        status, printed = self.run_it("list")
        self.assertEqual(status, 0)
        self.assertIn("docs/clock.md: table clock (timed)", printed)
        self.assertIn("options are those of one program", self.run_it("make", "all", "--", "--fast")[1])

    def test_the_registry_is_whole(self):
        status, printed = self.run_it("check", "--registry")
        self.assertEqual(status, 0, printed)

    def test_what_the_registry_refuses(self):
        unknown = "\n| map | kept |\n|---|---|\n| tsdf | 0.8 |\n"
        fenced = "\n```\nmap    kept  sane\ntsdf  0.801  0.97\n```\n"
        for path, old, new, fault in [
            ("README.md", "More words.\n", unknown, "README.md:13: the table '| map | kept |' has figures and no command"),
            ("README.md", "More words.\n", fenced, "the table 'map    kept  sane' has figures and no command"),
            ("README.md", "More words.\n", "<!-- table: odd -->\n<!-- end -->\n", "the marker of odd is of no table"),
            ("README.md", "More words.\n", "<!-- table: an odd one -->\n<!-- end -->\n", "'<!-- table: an odd one -->' is no marker"),
            ("README.md", "<!-- end -->\n", "", "'<!-- table: speeds -->' is no marker"),
            ("README.md", "<!-- end -->\n", "<!-- table: odd -->\n<!-- end -->\n", "speeds has no <!-- end --> before the next"),
            ("README.md", "More words.\n", README[README.index("<!--"):], "the marker of speeds stands twice"),
            ("README.md", "table: speeds", "table: speed", "README.md has no place for speeds"),
            ("README.md", "Words.", "![a](docs/a.png)", "the picture docs/a.png is not there"),
            ("docs/clock.md", "| bytes | what |", "| bits | what |", "the by_hand entry of docs/clock.md (| bytes | what |) fits nothing"),
            ("docs/tables.toml", 'name = "planted"', 'name = "clock"', "the command clock stands twice"),
            ("docs/tables.toml", 'name = "planted"', 'nam = "planted"', "has the unknown key 'nam'"),
            ("docs/tables.toml", 'kind = "timed"', 'kind = "slow"', "is of kind 'slow', expected scored, timed"),
            ("docs/tables.toml", 'kind = "timed"', 'kind = "timed"\nas = "art"', "is made as 'art', expected one of"),
            ("docs/tables.toml", 'why = "a layout"', "", "has no why"),
            ("docs/tables.toml", 'minutes = 0.1', "minutes = ", "cannot be read"),
            ("docs/tables.toml", "docs/numbers/speeds.csv", "docs/numbers/slow.csv",
             "docs/numbers/speeds.csv is made by no command"),
        ]:
            with self.subTest(fault):
                before = (self.root / path).read_text()
                self.replace(path, old, new)
                status, printed = self.run_it("check", "--registry")
                self.put(path, before)
                self.assertEqual(status, 1, new)
                self.assertIn(fault, printed)


class Compare(unittest.TestCase):
    def differences(self, said, found, **rules):
        return page_compare.compare(said, found, page_compare.Judge(**rules))[0]

    def test_tolerance_is_of_its_column(self):
        said = "| map | ghost cm2 | kept |\n|---|---|---|\n| tsdf | 58 ±0.6 | 0.8 |\n"
        found = said.replace("58 ±0.6", "60 ±0.5")
        self.assertEqual(len(self.differences(said, found)), 1)
        self.assertEqual(self.differences(said, found, tolerance={"ghost*": 2}), [])
        self.assertEqual(len(self.differences(said, found, tolerance={"ghost*": 1.9})), 1)
        self.assertEqual(len(self.differences(said, found.replace("0.8", "0.9"), tolerance={"ghost*": 2})), 1)
        self.assertEqual(len(self.differences(said, said.replace("58 ±0.6", "-"), tolerance={"ghost*": 99})), 1)

    def test_rows_are_told_apart_by_as_many_cells_as_needed(self):
        said = "| scene | map | kept |\n|---|---|---|\n| a | x | 1 |\n| a | y | 2 |\n| b | x | 3 |\n"
        (difference,) = self.differences(said, said.replace("| 3 |", "| 4 |"))
        self.assertEqual((difference.row, difference.column), ("b x", "kept"))
        swapped = "| scene | map | kept |\n|---|---|---|\n| a | y | 2 |\n| a | x | 1 |\n| b | x | 3 |\n"
        (difference,) = self.differences(said, swapped)
        self.assertEqual(difference.row, "order of the rows")

    def test_two_columns_of_one_name(self):
        said = "| map | ratio | ratio |\n|---|---|---|\n| x | 1 | 2 |\n"
        (difference,) = self.differences(said, said.replace("| 2 |", "| 3 |"))
        self.assertEqual((difference.said, difference.found), ("2", "3"))

    def test_rows_that_are_not_judged(self):
        said = "| gate | now |\n|---|---|\n| size | 1 |\n| time | 2 |\n"
        (difference,) = self.differences(said, said.replace("2", "3"), unjudged_rows=["time"])
        self.assertFalse(difference.judged)
        (difference,) = self.differences(said, said.replace("1", "3"), unjudged_rows=["time"])
        self.assertTrue(difference.judged)

    def test_sentences_part_by_part(self):
        said = "toys: a question?\n\n- toys: kept: tsdf 0.9; tsdf++ 0.99 (+0.09 to tsdf).\n- tsdf++ is ahead everywhere.\n"
        (difference,) = self.differences(said, said.replace("0.99 (+0.09", "0.98 (+0.08"))
        self.assertEqual(tuple(difference), (True, "toys: kept", "", "tsdf++ 0.99 (+0.09 to tsdf)", "tsdf++ 0.98 (+0.08 to tsdf)"))
        self.assertEqual(len(self.differences(said, said.replace("ahead", "behind"))), 2)

    def test_the_programs_hash_is_not_judged(self):
        said = "\nMade by tsdfpp 0.1.0 c807c91d8aff790c with egl.\n"
        (difference,) = self.differences(said, said.replace("c807", "d917"))
        self.assertFalse(difference.judged)

    def test_json_by_path(self):
        said = json.dumps({"method": {"version": "1"}, "entries": [{"sequence": "mini", "scores": {"kept": 0.5, "sane": 0.9}}]})
        judge = page_compare.Judge(unjudged_rows=["method.version"])
        differences, equal = page_compare.compare(said, said.replace('"1"', '"2"').replace("0.5", "0.6"), judge, ".json")
        self.assertEqual([(d.judged, d.row) for d in differences], [(False, "method.version"), (True, "entries.mini.scores.kept")])
        self.assertEqual(equal, 2)


ROOT = pathlib.Path(__file__).resolve().parents[2]
NO_PAGES = {"build", "out", "node_modules", "shared"}  # and what begins with a dot


def pages_below(folder):
    for path in sorted(folder.iterdir()):
        if path.is_dir() and not path.name.startswith(".") and path.name not in NO_PAGES:
            yield from pages_below(path)
        elif path.suffix == ".md":
            yield path


class Prose(unittest.TestCase):
    WORDS = "some words " * 15  # 165 characters

    def test_no_page_has_prose_that_is_too_wide(self):
        paths = list(pages_below(ROOT))
        self.assertGreater(len(paths), 30)
        for path in paths:
            self.assertEqual(page_prose.too_wide(path.read_text()), [], f"{path.relative_to(ROOT)}: lines above {page_prose.WIDTH}")

    def test_what_is_too_wide(self):
        words, word = self.WORDS, "x" * 130
        for text, lines in [
            (f"{words}\n", [1]), (f"A page.\n{words}\n\n{words}", [2, 4]), (f"- {words}\n  {words}", [1, 2]),
            (f"Of\n    {words}", [2]), ("é" * 60 + " " + "é" * 60, [1]), ("é" * 60 + " " + "é" * 59, []),
            (f"| a | b |\n|---|---|\n| {words} | 1 |", []), (f"```\n{words}\n```\n", []), (f"\n    {words}", []),
            (f"## [{words}](a.md)", []), (f"![{words}](a.png)", []), (f"<!-- {words} -->", []), (word, []), (f"- {words}", [1]),
        ]:
            with self.subTest(text):
                self.assertEqual(page_prose.too_wide(text), lines)
                self.assertEqual(page_prose.too_wide(page_prose.wrapped(text)), [])
                if not lines:
                    self.assertEqual(page_prose.wrapped(text), text)

    def test_a_paragraph_keeps_its_words_and_its_indent(self):
        text = f"# A page\n\nShort.\n\n1. {self.WORDS}\n   end\n2. short\n"
        wrapped = page_prose.wrapped(text)
        self.assertEqual(wrapped.split(), text.split())
        self.assertEqual([line[:3] for line in wrapped.splitlines()[4:]], ["1. ", "   ", "2. "])

    def test_a_line_does_not_begin_with_a_mark(self):
        for mark in ("-", "1.", "#"):
            lines = page_prose.wrapped("x" * 117 + f" a {mark} b").splitlines()
            self.assertEqual(lines, ["x" * 117, f"a {mark} b"])

    def test_a_generated_page_is_wrapped_and_its_breaks_are_not_judged(self):
        with tempfile.TemporaryDirectory() as folder:
            for name, kind in [("a.md", None), ("a.txt", "text")]:
                path = pathlib.Path(folder) / name
                path.write_text(self.WORDS)
                text = page_text.text_of(path, kind)
                self.assertEqual(page_prose.too_wide(text), [])
                differences, _ = page_compare.compare(text, self.WORDS, page_compare.Judge())
                self.assertEqual(differences, [])


class Texts(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def made(self, name, text, kind, **more):
        (self.folder / name).write_text(text)
        return page_text.text_of(self.folder / name, kind, **more)

    def test_the_tables_of_a_comparison(self):
        text = ("mini at frame 4: words, and words\nmap     paper: table kept  close: worst object\ntsdf                0.996"
                "               0.881\ntsdf++                  -               0.960\n\nmini at frame 4\n"
                "map            ghost cm2  fuse ms\ntsdf, paper   3628 ±6.2      1.2\n")
        self.assertEqual(self.made("table.txt", text, "front"),
                         "| map | paper: table kept | close: worst object |\n| --- | --- | --- |\n| `tsdf` | 0.996 | 0.881 |\n"
                         "| `tsdf++` | - | 0.960 |\n")
        whole = self.made("table.txt", text, "whole")
        self.assertTrue(whole.startswith("```\nmini at frame 4\nmap  ") and whole.endswith("1.2\n```\n"), whole)
        (table,), _ = page_compare.read(whole)
        self.assertEqual(table.rows, [["tsdf, paper", "3628 ±6.2", "1.2"]])

    def test_the_speed_in_short(self):
        text = "| 2 threads | 1 cm: equal | alone | 5 mm: equal |\n|---|---|---|---|\n| `tsdf` | 1 ms, 2 [1, 3] | 1 ms | 9 ms |\n"
        self.assertEqual(self.made("summary.md", text, "speed"),
                         "| 2 threads | 1 cm: equal | alone |\n| --- | --- | --- |\n| `tsdf` | 1 ms, 2 [1, 3] | 1 ms |\n")
        with self.assertRaises(ValueError):
            self.made("summary.md", "| a | b |\n", "speed")

    def test_the_least_of_the_frames(self):
        columns = [column for _, column in page_text.FIGURES]
        text = "frame,method,profile," + ",".join(columns) + "\n1,tsdf,paper,0.5,,1,1,1,0.25\n2,tsdf,paper,0.75,0.5,1,1,0.5,1\n"
        self.assertEqual(self.made("frames.csv", text, "least").splitlines()[2],
                         "| tsdf, paper | 0.500 | 0.500 | 1.000 | 1.000 | 0.500 | 0.250 |")

    def test_aligned_columns_whose_names_have_no_title(self):
        text = "a bench, 2 threads\n                 wall ms  error mm\nOpen3D 8^3         107.0      4.72\ntsdf                17.4      0.13\n"
        judge = page_compare.Judge("timed", judged=["error mm"], unjudged_rows=["Open3D *"])
        said = self.made("rays.txt", text, "fenced")
        found = said.replace("107.0", "108.0").replace("4.72", "4.73").replace("0.13", "0.14").replace("2 threads", "3 threads")
        differences, _ = page_compare.compare(said, found, judge)
        self.assertEqual([(d.row, d.column) for d in differences if d.judged], [("tsdf", "error mm")])
        self.assertEqual(len(differences), 5)  # of the sentence two

    def test_aligned_columns_whose_titles_touch(self):
        text = "            share   ratio + taking    ratio\ntsdf        0.991     1.04   291.06     1.34\nvolumes     0.990     0.95   180.01     1.2\n"
        said = self.made("mesh.txt", text, "fenced")
        differences, _ = page_compare.compare(said, said.replace("291", "292").replace("0.95", "0.96"), page_compare.Judge())
        self.assertEqual([(d.judged, d.row, d.said) for d in differences], [(True, "tsdf", "291.06"), (True, "volumes", "0.95")])
        differences, _ = page_compare.compare(said, said.replace("291", "292"), page_compare.Judge("timed", judged=["triangles"]))
        self.assertEqual([d.judged for d in differences], [False])

    def test_a_csv_without_its_times(self):
        self.assertEqual(self.made("a.csv", "map,kept,s\nx,1,2\n", None, without=["s"]), "map,kept\nx,1\n")
        with self.assertRaisesRegex(ValueError, "has no column t"):
            self.made("a.csv", "map,kept,s\nx,1,2\n", None, without=["t"])


if __name__ == "__main__":
    unittest.main()
