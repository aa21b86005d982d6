#!/usr/bin/python3
"""Panoptic quality of what the program finds in the scenes that training held out: segments of depth, of its network, of both.

    /usr/bin/python3 tools/segmenter/held_out.py --data out/segmenter/data [--every 3] [--model FILE]
        [--tsdfpp build/release/tsdfpp]

Every tenth sequence of make_data.py, every third image; `tsdfpp segment --score`, the mean over sequences.
"""
import argparse
import concurrent.futures
import json
import pathlib
import subprocess
import tempfile

from train import HELD_OUT

ROOT = pathlib.Path(__file__).resolve().parents[2]


def quality(program, sequence, way, every, model):
    with tempfile.TemporaryDirectory() as folder:
        command = [program, "segment", sequence, "--segmentation", way, "--every", str(every), "--score", "--json", "--threads",
                   "1", "--out", f"{folder}/out"]
        if model and way != "depth":
            command += ["--model", model]
        ran = subprocess.run(command, capture_output=True, text=True, check=True)
    return json.loads(ran.stdout)["scores"]["all"]["pq"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=pathlib.Path, required=True)
    parser.add_argument("--every", type=int, default=3)
    parser.add_argument("--model", help="another network than the program's own")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--tsdfpp", default=ROOT / "build/release/tsdfpp")
    options = parser.parse_args()
    sequences = [path for path in sorted(options.data.iterdir())
                 if (path / "sequence.json").exists() and int(path.name) % HELD_OUT == 0]
    for way in ("depth", "network", "full"):
        with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
            found = list(pool.map(lambda path: quality(options.tsdfpp, path, way, options.every, options.model), sequences))
        print(f"{way}: {sum(found) / len(found):.3f} over {len(found)} sequences")


if __name__ == "__main__":
    main()
