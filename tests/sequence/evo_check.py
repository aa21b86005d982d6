"""Compares the trajectory of a TUM export, read by evo, with the one of the sequence exported.

    python3 -m venv evo && evo/bin/pip install evo
    tsdfpp generate scenes/mini.toml --out seq && tsdfpp export seq --to tum --out tum
    evo/bin/python tests/sequence/evo_check.py seq tum

Not part of the test suite: it needs evo.
"""
import sys

import numpy as np
from evo.core import metrics
from evo.core.trajectory import PoseTrajectory3D
from evo.tools import file_interface


def main(sequence, exported):
    read = file_interface.read_tum_trajectory_file(f"{exported}/groundtruth.txt")
    valid, details = read.check()
    assert valid, details
    # Lines "frame tx ty tz qx qy qz qw" of a Co-Fusion set.
    rows = np.loadtxt(f"{sequence}/trajectories/gt-cam-0.txt")
    truth = PoseTrajectory3D(rows[:, 1:4], np.roll(rows[:, 4:8], 1, axis=1), read.timestamps)
    assert read.num_poses == len(rows), (read.num_poses, len(rows))
    ape = metrics.APE(metrics.PoseRelation.full_transformation)
    ape.process_data((truth, read))
    worst = ape.get_statistic(metrics.StatisticsType.max)
    print(f"{read.num_poses} poses, {read.path_length:.3f} m, largest difference {worst:.3g}")
    return 0 if worst < 1e-8 else 1  # nine decimals of text


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
