#!/usr/bin/env python3
"""What pages and plots say of runs that differ: means of fewer runs say so, and no cell or line has runs of two kinds."""

import copy
import json
import pathlib
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts"))
import experiment_text  # noqa: E402
import page_text  # noqa: E402

KEPT = "table_preservation_behind_other"


def condition(grid, profile, count, mean, **settings):
    """Of three runs, in `count` of which the figure is defined."""
    return {"grid": grid, "replicates": 3, "methods": ["tsdf", "tsdf++"],
            "settings": {"profile": profile, "resampling": "all", "speed": 1, **settings},
            "means": {"tsdf": {KEPT: {"count": 3, "mean": 0.5}}, "tsdf++": {KEPT: {"count": count, "mean": mean}}},
            "paired": {"tsdf++": {KEPT: {"pairs": count, "mean_difference": mean - 0.5}}}}


def results(*conditions, varied=("profile",)):
    return {"text": "e: Is it said?\nTwo lines.\n", "program": "0.1.0", "renderer": "none", "varied": list(varied),
            "experiment": {"metrics": [KEPT], "baseline": "tsdf", "scale": 1, "stride": 1},
            "metrics": {KEPT: {"words": "kept", "unit": "", "better": "higher", "decimals": 3}},
            "conditions": list(conditions)}


class Experiments(unittest.TestCase):
    def test_a_mean_of_fewer_runs_says_so(self):
        made = results(condition("a", "paper", 3, 0.9), condition("a", "close", 1, 0.25))
        rows = experiment_text.comparison_of(made).splitlines()
        self.assertIn("| paper | `tsdf++` | 0.900 | +0.400 |", rows)
        self.assertIn("| close | `tsdf++` | 0.250 (of 1 of 3) | -0.250 (of 1 of 3) |", rows)
        self.assertIn("| `tsdf++` | 0.250 (of 1 of 3) |", experiment_text.scenes_of(made).splitlines())
        self.assertIn("| as it is | `tsdf++` | 0.900 | 0.250 (of 1 of 3) |", experiment_text.rules_of(made).splitlines())

    def test_a_cell_is_of_one_condition(self):
        made = results(condition("a", "paper", 3, 0.9), condition("a", "paper", 3, 0.1, speed=2))
        for kind in (experiment_text.scenes_of, experiment_text.rules_of):
            with self.assertRaisesRegex(ValueError, "grid 'a' has several conditions .* which differ in speed; expected one"):
                kind(made)
        self.assertIn("| as it is | `tsdf++` | 0.900 |", experiment_text.rules_of(results(made["conditions"][0])).splitlines())

    def test_a_line_of_frames_is_of_one_setting(self):
        rows = [{"method": "tsdf++", "resampling": resampling, "speed": speed, "frame": "1", KEPT: value}
                for resampling, speed, value in (("all", "1", "0.5"), ("all", "2", "0.25"), ("observed", "1", "0.75"),
                                                 ("nearest", "1", "0.125"), ("all", "1", "1"), ("all", "1", ""))]
        lines = experiment_text.frame_lines(results(varied=("resampling", "speed")), rows, KEPT)
        self.assertEqual(lines, {"tsdf++, speed 1": {1: [0.5, 1]}, "tsdf++, speed 2": {1: [0.25]},
                                 "tsdf++, observed neighbours, speed 1": {1: [0.75]},
                                 "tsdf++, nearest neighbours, speed 1": {1: [0.125]}})
        lines = experiment_text.frame_lines(results(varied=("resampling",)), rows[:1] + rows[2:3], KEPT)
        self.assertEqual(list(lines), ["tsdf++", "tsdf++, observed neighbours"])


class Comparisons(unittest.TestCase):
    """A comparison with two sources of poses: each is a map of its own."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        columns = [column for _, column in page_text.FIGURES]
        self.frames = "frame,method,profile,poses," + ",".join(columns) + "\n"
        for poses, value in (("gt", "0.75"), ("icp", "0.25")):
            self.frames += f"1,tsdf,paper,{poses}," + ",".join([value] * len(columns)) + "\n"
        runs = [{"method": "tsdf", "profile": "paper", "poses": poses, "examined": {"objects": [{"id": 2, "name": "car"}]},
                 "trajectories": {"2": {"ate_rmse_m": error, "rotation_rmse_deg": 1.0}}}
                for poses, error in (("gt", 0.0), ("icp", 0.002))]
        self.summary = {"last_frame": 1, "reveal_frame": 1, "removed": [2], "runs": runs}

    def rows(self, kind):
        (self.folder / "frames.csv").write_text(self.frames)
        (self.folder / "summary.json").write_text(json.dumps(self.summary))
        name = "frames.csv" if kind == "least" else "summary.json"
        return page_text.text_of(self.folder / name, kind).splitlines()[2:]

    def test_poses_are_told_apart(self):
        high, low = " | ".join(["0.750"] * 6), " | ".join(["0.250"] * 6)
        self.assertEqual(self.rows("least"), [f"| tsdf, paper, gt | {high} |", f"| tsdf, paper, icp | {low} |"])
        self.assertEqual(self.rows("tracks"), [f"| tsdf, paper, gt | {high} | 0.0 | 1.0 |",
                                               f"| tsdf, paper, icp | {low} | 2.0 | 1.0 |"])

    def test_one_source_of_poses_is_not_named(self):
        self.frames = "".join(self.frames.splitlines(keepends=True)[:2])
        self.summary = copy.deepcopy(self.summary)
        del self.summary["runs"][1]
        high = " | ".join(["0.750"] * 6)
        self.assertEqual(self.rows("least"), [f"| tsdf, paper | {high} |"])
        self.assertEqual(self.rows("tracks"), [f"| tsdf, paper | {high} | 0.0 | 1.0 |"])


if __name__ == "__main__":
    unittest.main()
