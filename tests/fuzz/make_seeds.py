#!/usr/bin/env python3
"""Makes the seeds tests/fuzz/corpus/<target>/good-* from scenes/, eval/, results/ and by hand: small sound inputs.

    python3 tests/fuzz/make_seeds.py [--maps FILE ...]

Saved maps cannot be made by hand: --maps takes files that `tsdfpp map --save` wrote, a method each. Other files of the
corpora (what fuzzing found) stay as they are.
"""
import argparse
import json
import pathlib
import re
import struct

from seed_files import COLOUR, ROOT, depth_exr, grid, has_object, packed, png, save
from seed_meshes import meshes, obj
from seed_sequences import sequences

# --- TOML -------------------------------------------------------------------------------------------------------------

SCENE = """name = "all"
purpose = "As many keys as there are."
frames = 30
rate_hz = 15
seed = 3
[camera]
width = 64
height = 48
f = 50.0
cx = 32
cy = 24
path = "recorded"
file = "path.txt"
start_s = 0
position = [0.0, -1.2, 1.5]
target = [0.0, 0.0, 0.74]
[camera.jitter]
position_mm = 1.5
rotation_deg = 0.2
[room]
table = true
furniture = true
half_x = 2.4
half_y = 2.2
height = 2.6
[physics]
timestep_s = 0.001
friction = 0.4
[[object]]
name = "mesh"
id = 7
class = "toy"
model = "toy.obj"
scale = 1.5
x = 0.0
y = 0.0
[[object]]
name = "falls"
id = 8
class = "toy"
model = "mug"
x = 0.2
y = 0.1
z = 1.0
[object.physics]
mass_kg = 0.3
friction = 0.5
start_frame = 2
velocity = [0.1, 0.0, 0.0]
[[object]]
name = "carried"
id = 9
class = "toy"
model = "ball"
x = -0.2
y = 0.1
[[object.keyframe]]
frame = 1
position = [-0.2, 0.1, 0.8]
[[object.keyframe]]
frame = 20
position = [-0.2, 0.3, 0.9]
[experiment]
reveal_frame = 20
removed = ["mesh"]
"""

BENCH = """name = "v1"
scale = 0.5
voxel_m = 0.01
trunc_front = 10
trunc_back = 3
metrics = ["table_preservation_behind_other", "visible_completion"]
[[sequence]]
name = "one"
scene = "one.toml"
scene_hash = "0123456789abcdef"
truth_hash = "0123456789abcdef"
"""

GATES = """[[experiment]]
name = "mini"
file = "mini.toml"
profiles = ["quick", "full"]
[[control]]
name = "same"
experiment = "mini"
metric = "table_visible_completion"
where = { profile = "close" }
methods = ["tsdf", "tsdf++"]
spread = 0.01
min = 0.98
why = "They are one map."
[[gate]]
name = "hidden"
experiment = "mini"
metric = "table_preservation_behind_other"
where = { method = "tsdf++", profile = "close" }
min = 0.99
confidence = 1
why = "Nothing is lost."
[[gate]]
name = "pays"
experiment = "mini"
metric = "table_preservation_behind_other"
where = { method = "tsdf++", profile = "close" }
against = { method = "tsdf" }
min = 0.1
confidence = 1
why = "It is better."
[[gate]]
name = "as-before"
experiment = "mini"
metric = "visible_completion"
where = { method = "tsdf++", profile = "close" }
tolerance = 0.01
confidence = 1
why = "It was so."
"""


def references():
    entry = {"question": "mini: x of method tsdf++", "values": {"seed=1;": 0.5}, "map_digests": {"seed=1;": "00ff"},
             "by_frame": {"seed=1;": {"8": 0.25, "16": 0.5}}, "program": "p", "renderer": "r", "mujoco": "3.1",
             "machine": "m", "command": "tsdfpp gate", "reason": "first", "date": "2026-01-01"}
    return json.dumps({"schema": 1, "gates": {"as-before": entry}})


def bench_result():
    scores = {"table_preservation_behind_other": 0.5, "visible_completion": {"value": None, "why": "nothing seen"}}
    return json.dumps({"schema": 1, "kind": "tsdfpp bench result", "bench_set": "v1", "bench_hash": "0123456789abcdef",
                       "method": {"name": "mine", "version": "1", "commit": "abc"},
                       "hardware": {"cpu": "c", "gpu": "none", "cores": 2, "memory_gb": 8},
                       "entries": [{"sequence": "one", "scores": scores}]})


def configs():
    for name in ("mini", "random", "stack", "thin", "handheld", "tumble", "room"):
        text = "\n".join(line for line in (ROOT / "scenes" / (name + ".toml")).read_text().splitlines()
                         if line and not line.startswith("#"))
        save("scene", "good-" + name, packed({"scene.toml": text + "\n"}))
    path = "".join("%g %g 0 0 0 0 0 1\n" % (0.5 * i, 0.01 * i) for i in range(6))
    files = {"scene.toml": SCENE, "path.txt": path, "toy.obj": obj()["meshes/mesh.obj"],
             "mesh.mtl": obj()["meshes/mesh.mtl"]}
    save("scene", "good-files", packed(files))
    experiments = ROOT / "eval" / "experiments"
    for name in ("claim", "limits", "objects", "ci", "scenes"):
        save("experiment", "good-" + name, (experiments / (name + ".toml")).read_bytes())
    mini = (ROOT / "results" / "gates" / "mini.toml").read_bytes()
    save("gates", "good", packed({"gates.toml": GATES, "mini.toml": mini, "gates-references.json": references()}))
    adapter = (ROOT / "eval" / "adapters" / "open3d-python.toml").read_text()
    save("adapter", "good", adapter)
    save("adapter", "good-all", adapter.replace('layout = "tum"', 'layout = "klg"') + "process_limit = 3\n"
         "log_limit_mb = 0.5\ndisk_limit_mb = 100\nscale = 0.001\nmatch = \"overlap\"\n")
    save("bench_set", "good", packed({"v1/set.toml": BENCH, "results/mine.json": bench_result()}))


# --- Results ----------------------------------------------------------------------------------------------------------


def recording():
    end = 0

    def place(length):
        nonlocal end
        end += length
        return [end - length, length]

    def mesh(**more):
        return {"id": 1, "vertices": 3, "triangles": 1, "vertex_bytes": place(18), "index_bytes": place(6), **more}

    keys = [{"frame": f, "colour": place(4), "depth": place(4), "mask": place(4)} for f in (1, 5, 9)]
    run_keys = [{"frame": f, "picture": place(9), "picture_after": place(9), "chunks": [mesh(layer="visible")]}
                for f in (1, 5, 9)]
    record = {
        "schema": 1, "sequence": "toys", "error_step_m": 0.001, "age_step_frames": 1, "depth_range_m": [0.5, 2.5],
        "grid": {"origin_m": [0, 0, 0], "step_m": 0.001},
        "intrinsics": {"width": 4, "height": 3, "fx": 4, "fy": 4, "cx": 2, "cy": 1.5},
        "objects": [{"id": 1, "name": "toy", "removed": True, "colour": [1, 2, 3]}],
        "frames": [{"frame": 1, "T_WC": [0, 0, 0, 0, 0, 0, 1], "T_WO": {"1": [0, 0, 0, 0, 0, 0, 1]}}],
        "truth": [mesh()], "key_frames": keys, "stills": [1, 5],
        "runs": [{"folder": "tsdf", "memory_mb": [1], "track_ms": [1], "update_poses_ms": [1], "fuse_ms": [1],
                  "position_error_mm": {"1": [[1, 0.5]]}, "key_frames": run_keys}]}
    return {"record/record.json": json.dumps(record), "record/record.bin": bytes(i % 256 for i in range(end))}


def gate_results():
    gate = {"name": "hidden", "verdict": "fails", "of": "mini", "cells": "method tsdf", "bounds_because": "so",
            "bounds": {"min": 0.5}, "mean": 0.25, "explanation": {"picture": "hidden.png"}}
    return {"schema": 1, "profile": "quick", "sabotage": "none", "program": "p", "gates": [gate],
            "controls": [{"name": "same", "verdict": "holds", "metric": "m", "greatest_spread": 0.1,
                          "allowed_spread": 0.2}],
            "sabotages": [{"name": "swap", "words": "w", "caught": True, "gates": [gate]}]}


def coco():
    truth = {"categories": [{"id": 1, "isthing": 1}, {"id": 2, "isthing": 0}],
             "annotations": [{"file_name": "a.png", "image_id": 7, "segments_info": [
                 {"id": 1, "category_id": 1, "iscrowd": 0}, {"id": 2, "category_id": 2},
                 {"id": 3, "category_id": 1, "iscrowd": 1}]}]}
    ids = png(grid(lambda x, y: (1 if has_object(x, y) else (3 if x > 9 else 2), 0, 0)), kind=2)
    predicted = png(grid(lambda x, y: (1 if has_object(x, y, 4) else 2, 0, 0)), kind=2)
    prediction = {"annotations": [{"file_name": "a.png", "image_id": 7, "segments_info": [
        {"id": 1, "category_id": 1}, {"id": 2, "category_id": 2}]}]}
    return {"gt/a.png": ids, "pred/a.png": predicted, "gt.json": json.dumps(truth), "pred.json": json.dumps(prediction)}


def labels(encoding):
    def image(first, bits):
        return png(grid(lambda x, y: (1 if bits == 8 else 1001) if has_object(x, y, first) else (0 if bits == 8 else 2000)), bits)

    bits = 8 if encoding == "objects" else 16
    return {"@options": encoding, "gt/a.png": image(3, bits), "gt/b.png": image(4, bits), "pred/a.png": image(4, bits),
            "pred/b.png": image(4, bits)}


def metrics():
    """The names of all metrics, of evaluations and of whole runs, as docs/metrics.md lists them: first what an evaluation has."""
    page = (ROOT / "docs" / "metrics.md").read_text()
    table = page[page.index("<!-- table: metrics -->"):]
    names = re.findall(r"^\| `(\w+)` \|", table[:table.index("<!-- end -->")], re.MULTILINE)
    first_cost = names.index("frame_ms")
    return names[:first_cost], names[first_cost:]


# Those of a cell of which nothing was asked.
SETTINGS = {
    "scene": "", "seed": 1, "sensor": "scene", "noise": 1, "mask_faults": 0, "camera_error": 0, "object_error": 0,
    "speed": 1, "objects": 0, "fuse_until": 0, "method": "tsdf++", "profile": "close", "trunc_front": 0, "trunc_back": 0,
    "voxel_m": 0.01, "layers": 0, "poses": "gt", "segmentation": "gt", "mask_repair": "off", "resampling": "all",
    "moved_voxels": "all", "removed_voxels": "free", "vote_band": 100, "sabotage": "none"}


def cell():
    of_evaluations, of_runs = metrics()
    scores = {name: 0.5 for name in of_evaluations}
    scores["seam_share"] = {"value": None, "why": "no seam"}
    return {"schema": 2, "id": "0123456789abcdef", "sequence": "sequence", "key": "key", "settings": SETTINGS,
            "examined": {**scores, **{name: 1.5 for name in of_runs}}, "removed": [1],
            "frames": [{"frame": 8, "examined": True, "scores": scores, "map_digest": "00ff"}], "evaluation": {},
            "times": {"run": "r", "frame_ms": [1.0, 2.5], "steps": None}, "images": {"1": "00ff", "8": "ff00"}}


def results():
    save("cell", "good", json.dumps(cell()))
    save("recording", "good", packed(recording()))
    note = {"schema": 1, "generator": "tsdfpp", "command": "tsdfpp map", "run": "0123456789abcdef",
            "files": [{"name": "summary.json", "bytes": 2}, {"name": "mesh/scene.ply", "bytes": None}]}
    save("run_note", "good", packed({"run.json": json.dumps(note), "summary.json": "{}", "mesh/scene.ply": "ply"}))
    save("gate_results", "good", packed({"gates.json": json.dumps(gate_results()), "gates/hidden.png": COLOUR}))
    save("coco", "good-coco", packed(coco()))
    for encoding in ("objects", "class-instance"):
        save("coco", "good-" + encoding, packed(labels(encoding)))


# --- Text -------------------------------------------------------------------------------------------------------------


def texts():
    save("json", "good", json.dumps({"a": [1, -2.5e-3, 1e300, True, None, "\u00e9\n\\"], "b": {"c": [[], {}]}}))
    save("toml", "good", "whole = 1\nreal = 2.5e3\ntext = 'a'\nlong = \"\"\"a\\u00e9\nb\"\"\"\nyes = true\n"
         "day = 2026-01-01T00:00:00Z\nlist = [1.0, 2, 3]\nwords = ['a', 'b']\n[table]\na.b.c = {d = 1}\n[[tables]]\nx = 1\n[[tables]]\n")
    save("trajectory", "good", "# frame tx ty tz qx qy qz qw\n1 0 0 0 %s\n2 0.5 -1e-3 2 0 0 0 1\n3 1 1 1 0 0.6 0 0.8\n" % "0 0 0 1")
    save("trajectory", "good-near", "1 0 0 0 0 0 0 1\n1.05 1 0 0 0 0 0.1 0.995\n1.05 1 0 0 0 0 0.1 0.995\n".replace("1.05", "2"
         , 1).replace("1.05", "3"))
    save("image", "good-png", COLOUR)
    save("image", "good-exr", depth_exr())
    save("image", "good-pgm", b"P5\n# grey\n3 2\n255\n" + bytes(range(6)))
    save("image", "good-bmp", b"BM" + struct.pack("<IHHIIiiHHIIiiII", 62, 0, 0, 54, 40, 2, 1, 1, 24, 0, 8, 0, 0, 0, 0) + bytes(8))
    save("image", "good-tiff", tiff())
    # Headers alone, of what cannot be made here.
    save("image", "jpeg", bytes.fromhex("ffd8ffe000104a46494600010100000100010000ffc0001108000a000c03012200021101031101"))
    for kind in (b"VP8 ", b"VP8L", b"VP8X"):
        save("image", "webp-" + kind.decode().strip().lower(), b"RIFF\x1e\0\0\0WEBP" + kind + bytes.fromhex("12000000302f009d012a0c000a00") + bytes(8))


def tiff():
    entries = [(256, 3, 1, 3), (257, 3, 1, 2), (258, 3, 1, 8), (259, 3, 1, 1), (262, 3, 1, 1), (273, 4, 1, 8),
               (277, 3, 1, 1), (278, 3, 1, 2), (279, 4, 1, 6)]
    out = b"II*\0" + struct.pack("<I", 14) + bytes(range(6)) + struct.pack("<H", len(entries))
    return out + b"".join(struct.pack("<HHII", *entry) for entry in entries) + struct.pack("<I", 0)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--maps", nargs="*", default=[], metavar="FILE", help="saved maps, good-<stem> each")
    options = parser.parse_args()
    sequences()
    meshes()
    configs()
    results()
    texts()
    for file in options.maps:
        save("map", "good-" + pathlib.Path(file).stem, pathlib.Path(file).read_bytes())


if __name__ == "__main__":
    main()
