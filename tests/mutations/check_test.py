#!/usr/bin/env python3
"""The list of mutations is checked without a build: what no longer fits is said, mutation by mutation."""

import pathlib
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts"))
import mutate_metrics  # noqa: E402

SOURCE = "double Half(double x) {\n  return x / 2;\n}\ndouble Same(double x) { return x; }\n"
CMAKE = "tsdfpp_test(\n  metrics_tests\n  SOURCES\n    half_test.cc\n  LINK tsdfpp::metrics)\n"
TESTS = "TEST(Half, IsHalf) {}\nTEST_P(Many, AreHalf) {}\n"


class Check(unittest.TestCase):
    def faults(self, text):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
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


if __name__ == "__main__":
    unittest.main()
