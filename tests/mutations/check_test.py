#!/usr/bin/env python3
"""The list of mutations is checked without a build: what no longer fits is said, mutation by mutation. The page keeps what
was not run."""

import pathlib
import sys
import tempfile
import unittest
from unittest import mock

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts"))
import mutate_metrics  # noqa: E402

SOURCE = "double Half(double x) {\n  return x / 2;\n}\ndouble Same(double x) { return x; }\n"
CMAKE = "tsdfpp_test(\n  metrics_tests\n  SOURCES\n    half_test.cc\n  LINK tsdfpp::metrics)\n"
TESTS = "TEST(Half, IsHalf) {}\nTEST_P(Many, AreHalf) {}\n"


def write_tree(root, text):
    for name, content in {
        "metrics/half.cc": SOURCE,
        "core/half.cc": SOURCE,
        "tests/metrics/CMakeLists.txt": CMAKE,
        "tests/metrics/half_test.cc": TESTS,
        "tests/metrics/other_test.cc": "TEST(Other, IsInNoBinary) {}\n",
        "tests/mutations/metrics.txt": text,
        "tests/mutations/eval.txt": "",
    }.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content)


class Check(unittest.TestCase):
    def faults(self, text):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            write_tree(root, text)
            return mutate_metrics.faults_of(mutate_metrics.read_lists(root), root)

    def test_what_fits_is_fine(self):
        good = "# third | metrics/half.cc | Half.*:*/Many.*\n- return x / 2;\n+ return x / 3;\n"
        self.assertEqual(self.faults(good), [])
        two_lines = "# sum | metrics/half.cc | Half.IsHalf\n- double Half(double x) {\n-   return x / 2;\n+ double Half(double x) {\n+   return x + 2;\n"
        self.assertEqual(self.faults(two_lines), [])

    def test_what_does_not_is_said(self):
        header = "# third | metrics/half.cc | Half.*\n"
        change = "- return x / 2;\n+ return x / 3;\n"
        for text, fault in [
            (header + "- return x / 4;\n+ return x;\n", "its text is 0 times in metrics/half.cc"),
            (header + "- double x\n+ float x\n", "its text is 2 times in metrics/half.cc"),
            (header + "- return x / 2;\n+ return x / 2;\n", "changes nothing"),
            (header + change + header + change, "stands 2 times in the lists"),
            ("# third | metrics/whole.cc | Half.*\n" + change, "metrics/whole.cc is no file of"),
            ("# third | core/half.cc | Half.*\n" + change, "core/half.cc is no file of"),
            ("# third | metrics/half.cc | Half.*:Whole.*\n" + change, "'Whole.*' names no test of metrics_tests"),
            ("# third | metrics/half.cc | Other.*\n" + change, "'Other.*' names no test of metrics_tests"),
            ("# third | metrics/half.cc |\n" + change, "'' names no test of metrics_tests"),
        ]:
            faults = self.faults(text)
            self.assertTrue(faults, text)
            self.assertIn(fault, faults[0])

    def test_a_line_that_is_none_is_refused(self):
        for text in ["# third | metrics/half.cc\n", "return x;\n", "- return x;\n"]:
            with self.assertRaises(SystemExit) as refused:
                self.faults(text)
            self.assertIn("cannot read the line", str(refused.exception))


class Copy(unittest.TestCase):
    def test_has_what_configuring_asks_for(self):
        lines = (mutate_metrics.ROOT / "cmake" / "compiled_together.txt").read_text().splitlines()
        files = [file for line in lines if not line.startswith("#") for file in line.split()]
        self.assertTrue(files)
        self.assertEqual({file.split("/")[0] for file in files} - set(mutate_metrics.COPIED), set())


class Page(unittest.TestCase):
    def rows(self, root, options, caught):
        """What a run leaves of the page's table; building and running tests is left out."""
        path = root / "out" / "page.md"
        path.parent.mkdir(exist_ok=True)
        built = mock.Mock(returncode=0)
        failing = mock.Mock(side_effect=[[], *caught])  # none before anything is broken
        with mock.patch.multiple(mutate_metrics, prepare=lambda: (root, root / "build"), build_tests=lambda *_: built,
                                 failing_tests=failing, print=mock.DEFAULT, create=True):
            with self.assertRaises(SystemExit) as ended:
                mutate_metrics.main(["--page", str(path), *options], root)
        self.assertEqual(ended.exception.code, 0)
        return [line.split(" | ")[0][2:] + ": " + line.split(" | ")[-1][:-2]
                for line in path.read_text().splitlines() if line.startswith("| ") and "`" in line]

    def test_what_was_not_run_stays_in_it(self):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            by = [f"# by {n} | metrics/half.cc | Half.*\n- x / 2;\n+ x / {n};\n" for n in (3, 4, 5)]
            write_tree(root, "".join(by))
            everything = ["by 3: Half.A", "by 4: Half.B", "by 5: Half.C"]
            self.assertEqual(self.rows(root, [], [["Half.A"], ["Half.B"], ["Half.C"]]), everything)
            docs = root / mutate_metrics.PAGE
            docs.parent.mkdir()
            (root / "out" / "page.md").replace(docs)
            # As in a fresh clone, where nothing lies in out/.
            self.assertEqual(self.rows(root, ["--only", "by 4"], [["Half.D"]]),
                             ["by 3: Half.A", "by 4: Half.D", "by 5: Half.C"])
            # What an earlier run left there is not read.
            self.assertEqual(self.rows(root, ["--only", "by 5"], [["Half.E"]]),
                             ["by 3: Half.A", "by 4: Half.B", "by 5: Half.E"])
            # A mutation that is new gets its row; one that has changed, or is gone, loses it.
            write_tree(root, by[0].replace("+ x / 3", "+ x * 3") + by[2] + by[1].replace("by 4", "new"))
            self.assertEqual(self.rows(root, ["--only", "new"], [["Half.F"]]), ["by 5: Half.C", "new: Half.F"])


if __name__ == "__main__":
    unittest.main()
