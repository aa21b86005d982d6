#!/usr/bin/env python3
"""What scripts say of the methods is what the program says: method_rows_test.py TSDFPP."""

import ast
import json
import pathlib
import re
import subprocess
import sys
import unittest

sys.dont_write_bytecode = True
SCRIPTS = pathlib.Path(__file__).resolve().parents[2] / "scripts"
sys.path.insert(0, str(SCRIPTS))
import method_rows  # noqa: E402
import old_against_new  # noqa: E402

PROGRAM = pathlib.Path(sys.argv.pop(1))


class MethodRows(unittest.TestCase):
    def setUp(self):
        printed = subprocess.run([PROGRAM, "methods", "--json"], check=True, capture_output=True, text=True).stdout
        self.colours = {row["name"]: row["on_light"] for row in json.loads(printed)}

    def test_a_line_has_its_methods_colour(self):
        styles = method_rows.method_styles(PROGRAM)
        self.assertEqual({name: style[0] for name, style in styles.items()}, self.colours)
        self.assertEqual(method_rows.method_line("volumes", "X", ":", program=PROGRAM), (self.colours["volumes"], "X", ":"))
        second = method_rows.method_line("volumes", "X", ":", second=True, program=PROGRAM)
        self.assertNotIn(second[0], self.colours.values())

    def test_a_marker_is_of_one_method(self):
        self.assertLessEqual(set(method_rows.MARKS), set(self.colours))
        self.assertEqual(len({marker for marker, _ in method_rows.MARKS.values()}), len(method_rows.MARKS))

    def test_no_script_types_a_methods_colour(self):
        """A method's name in a dictionary has no colour beside it."""
        for script in SCRIPTS.glob("*.py"):
            for node in ast.walk(ast.parse(script.read_text())):
                if not isinstance(node, ast.Dict):
                    continue
                for key, value in zip(node.keys, node.values):
                    if isinstance(key, ast.Constant) and key.value in self.colours:
                        self.assertIsNone(re.search("#[0-9a-fA-F]{6}", ast.unparse(value)), f"{script.name}: {key.value}")

    def test_the_methods_that_are_compared_for_speed_are_there(self):
        self.assertLessEqual(set(old_against_new.METHODS), set(self.colours))


if __name__ == "__main__":
    unittest.main()
