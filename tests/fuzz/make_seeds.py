#!/usr/bin/env python3
"""Makes the seeds tests/fuzz/corpus/<target>/good-* from scenes/, eval/, results/ and by hand: small sound inputs.

    python3 tests/fuzz/make_seeds.py [--maps FILE ...]

Saved maps cannot be made by hand: --maps takes files that `tsdfpp map --save` wrote, a method each. Other files of the
corpora (what fuzzing found) stay as they are.
"""
import argparse
import json
import math
import pathlib
import struct
import zlib

ROOT = pathlib.Path(__file__).resolve().parents[2]
CORPUS = ROOT / "tests" / "fuzz" / "corpus"
WIDTH, HEIGHT = 12, 10
CAMERA = (12.0, 12.0, 5.5, 4.5)
IDENTITY = "0 0 0 0 0 0 1"
MATRIX = "1 0 0 {}\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"


def save(target, name, data):
    folder = CORPUS / target
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_bytes(data if isinstance(data, bytes) else data.encode())


def packed(files):
    """A set of files (tests/fuzz/file_set.h)."""
    out = b""
    for path, data in files.items():
        data = data if isinstance(data, bytes) else data.encode()
        out += b"file %s %d\n" % (path.encode(), len(data)) + data + b"\n"
    return out


# --- Images -----------------------------------------------------------------------------------------------------------


def png(rows, bits=8, kind=0):
    """Grey (kind 0) or RGB (2); `rows` of values, of triples for RGB."""
    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    raw = b""
    for row in rows:
        flat = [v for pixel in row for v in (pixel if kind == 2 else (pixel,))]
        raw += b"\0" + b"".join(struct.pack(">H" if bits == 16 else ">B", v) for v in flat)
    header = struct.pack(">IIBBBBB", len(rows[0]), len(rows), bits, kind, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(raw, 9)) + chunk(b"IEND", b"")


def exr(rows):
    """One channel Y of floats, not packed."""
    height, width = len(rows), len(rows[0])

    def attribute(name, kind, data):
        return name + b"\0" + kind + b"\0" + struct.pack("<i", len(data)) + data

    box = struct.pack("<iiii", 0, 0, width - 1, height - 1)
    header = struct.pack("<ii", 20000630, 2)
    header += attribute(b"channels", b"chlist", b"Y\0" + struct.pack("<iBBBBii", 2, 0, 0, 0, 0, 1, 1) + b"\0")
    header += attribute(b"compression", b"compression", b"\0")
    header += attribute(b"dataWindow", b"box2i", box) + attribute(b"displayWindow", b"box2i", box)
    header += attribute(b"lineOrder", b"lineOrder", b"\0")
    header += attribute(b"pixelAspectRatio", b"float", struct.pack("<f", 1))
    header += attribute(b"screenWindowCenter", b"v2f", struct.pack("<ff", 0, 0))
    header += attribute(b"screenWindowWidth", b"float", struct.pack("<f", 1)) + b"\0"
    line = 8 + 4 * width
    first = len(header) + 8 * height
    table = b"".join(struct.pack("<Q", first + y * line) for y in range(height))
    body = b"".join(struct.pack("<ii", y, 4 * width) + struct.pack("<%df" % width, *row) for y, row in enumerate(rows))
    return header + table + body


def grid(value, width=WIDTH, height=HEIGHT):
    return [[value(x, y) for x in range(width)] for y in range(height)]


def has_object(x, y, first=3):
    return first <= x < first + 4 and 3 <= y < 7


COLOUR = png(grid(lambda x, y: (20 * x, 20 * y, 99)), kind=2)
MASK = png(grid(lambda x, y: 1 if has_object(x, y) else 0))
WHITE = png(grid(lambda x, y: 255 if has_object(x, y) else 0))


def depth_png(units_per_m, width=WIDTH, height=HEIGHT):
    return png(grid(lambda x, y: int((0.8 if has_object(x, y) else 1.0) * units_per_m), width, height), bits=16)


def depth_exr():
    return exr(grid(lambda x, y: 0.8 if has_object(x, y) else 1.0))


# --- Sequences --------------------------------------------------------------------------------------------------------


def cofusion(with_json):
    files = {"calibration.txt": "{} {} {} {} {} {}\n".format(*CAMERA, WIDTH, HEIGHT)}
    cam, toy = "# camera\n", ""
    for i in (1, 2):
        files["colour/Color%04d.png" % i] = COLOUR
        files["depth_original/Depth%04d.exr" % i] = depth_exr()
        files["mask_id/Mask%04d.png" % i] = MASK
        cam += "%d 0.0%d 0 0 0 0 0 1\n" % (i, i)
        toy += "%d %.2f 0 0.8 0 0 %.1f %.3f\n" % (i, 0.05 * i, 0.1 * (i - 1), 1 - 0.005 * (i - 1))
    files["trajectories/gt-cam-0.txt"] = cam
    files["trajectories/gt-toy-1.txt"] = toy
    if with_json:
        files["models/toy-1.ply"] = ply_ascii()
        files["models/background-0.ply"] = ply_ascii()
        for i in (1, 2):
            files["depth_noise/Depth%04d.exr" % i] = depth_exr()
            files["mask_noise/Mask%04d.png" % i] = MASK
        files["trajectories/sensed-cam-0.txt"] = cam
        files["sequence.json"] = sequence_json([name for name in files if name != "calibration.txt"])
    return files


def sequence_json(files=("colour/Color0001.png",), version=2):
    residual = {"mean_m": 0.001, "p99_m": 0.002, "max_m": 0.003, "limit_m": 0.01, "checked": 9, "excluded": 1,
                "violations": 0}
    record = {
        "schema_version": version, "generator": "tsdfpp", "version": "0.1.0", "scene": "toys", "seed": 7,
        "intrinsics": {"width": WIDTH, "height": HEIGHT, "fx": CAMERA[0], "fy": CAMERA[1], "cx": CAMERA[2],
                       "cy": CAMERA[3]},
        "rate_hz": 30.0, "first_index": 1, "frame_count": 2,
        "objects": [{"id": 0, "name": "background", "class": "background"}, {"id": 1, "name": "toy", "class": "toy"}],
        "reveal": {"frame": 2, "removed": [1]}, "sensor": "none", "backend": "osmesa", "renderer": "softpipe",
        "certificate": {"frames": 2, "ray_frames": 1, "model": residual, "ray_depth": residual, "wrong_ids": 0},
        "files": {"fnv1a64": {name: "0123456789abcdef" for name in files}}}
    if version == 1:
        del record["certificate"]
        record["reveal"] = record["seed"] = None
    return json.dumps(record, indent=1)


def tum(associations=False, width=WIDTH, height=HEIGHT, masks=True):
    files, rgb, depth, both, poses = {}, "# colour\n", "# depth\n", "", ""
    frames = 2 if masks else 6
    for i in range(frames):
        time = 100 + i / 30
        files["rgb/%d.png" % i] = png(grid(lambda x, y: (9, 9, 9), width, height), kind=2)
        files["depth/%d.png" % i] = depth_png(5000, width, height)
        rgb += "%.4f rgb/%d.png\n" % (time, i)
        depth += "%.4f depth/%d.png\n" % (time + 0.001, i)
        both += "%.4f rgb/%d.png %.4f depth/%d.png\n" % (time, i, time + 0.001, i)
        # Sideways, by more each time than what agreement is judged by.
        poses += "%.4f %.3f 0 0 0 0 0 1\n" % (time, 0.01 * i if masks else 0.07 * i)
        if masks:
            files["mask/%d.png" % i] = MASK
    files["groundtruth.txt"] = poses
    scale = width / WIDTH
    files["calibration.txt"] = "{} {} {} {}\n".format(*(scale * c for c in CAMERA))
    if associations:
        files["associations.txt"] = both
    else:
        files.update({"rgb.txt": rgb, "depth.txt": depth})
    return files


def bop(nested):
    rotation = [1, 0, 0, 0, 1, 0, 0, 0, 1]
    at = "test/000001/" if nested else ""
    cameras, truth, files = {}, {}, {}
    for i in (3, 4):
        cameras[i] = {"cam_K": [12, 0, 5.5, 0, 12, 4.5, 0, 0, 1], "depth_scale": 0.1, "cam_R_w2c": rotation,
                      "cam_t_w2c": [10.0 * i, 0, 0]}
        truth[i] = [{"obj_id": 2, "cam_R_m2c": rotation, "cam_t_m2c": [0, 0, 800.0]},
                    {"obj_id": 2, "cam_R_m2c": rotation, "cam_t_m2c": [200, 0, 900.0]},
                    {"obj_id": 5, "cam_R_m2c": rotation, "cam_t_m2c": [-200, 0, 900.0]}]
        files[at + "rgb/%06d.png" % i] = COLOUR
        files[at + "depth/%06d.png" % i] = depth_png(10000)
        for k in range(3):
            files[at + "%s/%06d_%06d.png" % ("mask_visib" if nested else "mask", i, k)] = WHITE
    files[at + "scene_camera.json"] = json.dumps(cameras)
    files[at + "scene_gt.json"] = json.dumps(truth)
    files["models/models_info.json"] = json.dumps({"2": {"diameter": 9, "name": "toy", "class": "toy"}, "5": {}})
    for i in (2, 5):
        files["models/obj_%06d.ply" % i] = ply_ascii()
    return files


def klg(raw):
    frames = b""
    for i in range(2):
        depth = struct.pack("<%dH" % (WIDTH * HEIGHT), *(800 if has_object(x, y) else 1000 for y in range(HEIGHT)
                                                         for x in range(WIDTH)))
        depth = depth if raw else zlib.compress(depth)
        colour = bytes([9, 99, 199]) * (WIDTH * HEIGHT) if raw else COLOUR
        frames += struct.pack("<qii", 33333 * i, len(depth), len(colour)) + depth + colour
    files = {"sequence.klg": struct.pack("<i", 2) + frames,
             "calibration.txt": "{} {} {} {} {} {}\n".format(*CAMERA, WIDTH, HEIGHT),
             "groundtruth.txt": "0 0 0 0 0 0 0 1\n0.033333 0.01 0 0 0 0 0 1\n"}
    if raw:
        files.update({"mask/%06d.png" % i: MASK for i in range(2)})
    return files


def scannet():
    camera = "12 0 5.5 0\n0 12 4.5 0\n0 0 1 0\n0 0 0 1\n"
    files = {"intrinsic/intrinsic_depth.txt": camera, "intrinsic/intrinsic_color.txt": camera}
    for i in (0, 1, 10):
        files["color/%d.png" % i] = COLOUR
        files["depth/%d.png" % i] = depth_png(1000)
        files["pose/%d.txt" % i] = MATRIX.format(0.01 * i)
        files["instance-filt/%d.png" % i] = MASK
    files["depth/11.png"] = depth_png(1000)
    files["pose/11.txt"] = "-inf -inf -inf -inf\n" * 4
    return files


def replica(above):
    files = {"room0/traj.txt": "".join(" ".join(MATRIX.format(0.01 * i).split()) + "\n" for i in range(2))}
    camera = {"w": WIDTH, "h": HEIGHT, "fx": 12, "fy": 12, "cx": 5.5, "cy": 4.5, "scale": 6553.5}
    files["cam_params.json" if above else "room0/cam_params.json"] = json.dumps({"camera": camera} if above else camera)
    for i in range(2):
        files["room0/results/frame%06d.png" % i] = COLOUR
        files["room0/results/depth%06d.png" % i] = depth_png(6553.5)
    return files


def sevenscenes():
    files = {"camera-intrinsics.txt": "12 0 5.5\n0 12 4.5\n0 0 1\n"}
    for i in range(2):
        stem = "frame-%06d." % i
        files[stem + "color.png"] = COLOUR
        files[stem + "depth.png"] = depth_png(1000)
        files[stem + "pose.txt"] = MATRIX.format(0.01 * i)
        files[stem + "mask.png"] = MASK
    return files


def sequences():
    save("cofusion", "good-own", packed(cofusion(True)))
    save("cofusion", "good-other", packed(cofusion(False)))
    save("tum", "good-lists", packed(tum()))
    save("tum", "good-associations", packed(tum(associations=True)))
    save("tum", "good-moving", packed(tum(width=60, height=50, masks=False)))
    fixed = tum()
    del fixed["groundtruth.txt"]
    save("tum", "good-fixed", packed({"@options": "f", **fixed}))
    save("tum", "good-detected", packed({"@options": "d", **tum()}))
    save("bop", "good-scene", packed(bop(False)))
    save("bop", "good-below", packed(bop(True)))
    save("klg", "good-packed", packed(klg(False)))
    save("klg", "good-raw", packed(klg(True)))
    save("scannet", "good", packed(scannet()))
    save("replica", "good-here", packed(replica(False)))
    save("replica", "good-above", packed(replica(True)))
    save("sevenscenes", "good", packed(sevenscenes()))
    save("sevenscenes", "good-mirrored", packed({"@options": "i", **sevenscenes()}))
    save("sequence_json", "good-2", sequence_json())
    save("sequence_json", "good-1", sequence_json(version=1))


# --- Meshes -----------------------------------------------------------------------------------------------------------

CORNERS = [(0, 0, 0), (0.1, 0, 0), (0, 0.1, 0), (0, 0, 0.1)]
FACES = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)]


def ply_ascii():
    text = "ply\nformat ascii 1.0\ncomment region 0 whole\nelement vertex 4\n"
    text += "".join("property float %s\n" % axis for axis in "xyz")
    text += "".join("property uchar %s\n" % colour for colour in ("red", "green", "blue"))
    text += "element face 4\nproperty list uchar int vertex_indices\nproperty ushort region\nend_header\n"
    text += "".join("%g %g %g 200 100 50\n" % corner for corner in CORNERS)
    return text + "".join("3 %d %d %d 0\n" % face for face in FACES)


def ply_binary():
    text = "ply\nformat binary_little_endian 1.0\nobj_info none\nelement vertex 4\n"
    text += "".join("property double %s\n" % axis for axis in "xyz")
    text += "property uchar flags\nelement face 1\nproperty list uchar uint vertex_indices\nproperty int object_id\n"
    text += "element edge 1\nproperty int vertex1\nproperty int vertex2\nend_header\n"
    body = b"".join(struct.pack("<dddB", *corner, 1) for corner in CORNERS)
    return text.encode() + body + struct.pack("<BIIIIi", 4, 0, 1, 2, 3, 7) + struct.pack("<ii", 0, 1)


def obj():
    text = "# a tetrahedron\nmtllib mesh.mtl\no thing\n"
    text += "".join("v %g %g %g 0.5 0.25 1\n" % corner for corner in CORNERS)
    text += "vt 0 0\nvt 1 0\nvt 0 1 0\nvn 0 0 1\nusemtl paint\n"
    text += "f 1/1 3/2 2/3\nf 1/1/1 2/2/1 4/3/1\nusemtl plain\ns off\nf 2//1 3//1 4//1\nf -4 -1 \\\n -2\n"
    mtl = "newmtl paint\nKd 0.8 0.2 0.1\nmap_Kd -o 0 0 0 ../textures/picture.png\nnewmtl plain\nKd 0 1 0\nKa 0 0 0\n"
    return {"meshes/mesh.obj": text, "meshes/mesh.mtl": mtl, "textures/picture.png": COLOUR}


def obj_plain():
    text = "".join("v %g %g %g\n" % corner for corner in CORNERS + [(0.1, 0.1, 0)])
    text += "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 5/3 3/4\nf 1/1 4/2 2/3\n"
    return {"meshes/mesh.obj": text, "textures/picture.png": COLOUR}


def stl_binary():
    out = b"binary" + bytes(74) + struct.pack("<I", len(FACES))
    for face in FACES:
        out += struct.pack("<fff", 0, 0, 1) + b"".join(struct.pack("<fff", *CORNERS[v]) for v in face) + b"\0\0"
    return out


def stl_ascii():
    text = "solid thing\n"
    for face in FACES:
        text += " facet normal 0 0 1\n  outer loop\n"
        text += "".join("   vertex %g %g %g\n" % CORNERS[v] for v in face) + "  endloop\n endfacet\n"
    return text + "endsolid thing\n"


def glb(indexed):
    positions = b"".join(struct.pack("<fff", *corner) for corner in CORNERS)
    colours = b"".join(struct.pack("<HHHH", 65535, 0, 30000, 65535) for _ in CORNERS)
    indices = struct.pack("<12H", *(v for face in FACES for v in face))
    body = positions + colours + indices
    accessors = [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0],
                  "max": [0.1, 0.1, 0.1]},
                 {"bufferView": 1, "componentType": 5123, "normalized": True, "count": 4, "type": "VEC4"},
                 {"bufferView": 2, "componentType": 5123, "count": 12, "type": "SCALAR", "byteOffset": 0}]
    primitive = {"attributes": {"POSITION": 0, "COLOR_0": 1}, "mode": 4}
    if indexed:
        primitive["indices"] = 2
    else:
        accessors[0]["count"] = accessors[1]["count"] = 3
    document = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 2]}],
        "nodes": [{"name": "root", "rotation": [-math.sqrt(0.5), 0, 0, math.sqrt(0.5)], "children": [1]},
                  {"name": "toy", "mesh": 0, "extras": {"object_id": 3}},
                  {"name": "m", "mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 2, 3, 1]}],
        "meshes": [{"primitives": [primitive]}],
        "accessors": accessors,
        "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 48},
                        {"buffer": 0, "byteOffset": 48, "byteLength": 32, "byteStride": 8},
                        {"buffer": 0, "byteOffset": 80, "byteLength": 24}],
        "buffers": [{"byteLength": len(body)}]}
    if not indexed:
        document["nodes"][0] = {"name": "root", "translation": [0, 1, 0], "scale": [2, 2, 2], "children": [1]}
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(body), 0x004E4942) + body
    return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks


def meshes():
    save("ply", "good-ascii", ply_ascii())
    save("ply", "good-binary", ply_binary())
    save("obj", "good-materials", packed(obj()))
    save("obj", "good-plain", packed(obj_plain()))
    save("stl", "good-binary", stl_binary())
    save("stl", "good-ascii", stl_ascii())
    save("gltf", "good-indexed", glb(True))
    save("gltf", "good-plain", glb(False))


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
        "grid": {"origin_m": [0, 0, 0], "step_m": 0.001}, "intrinsics": {"width": 4, "height": 3},
        "objects": [{"id": 1, "name": "toy", "removed": True, "colour": [1, 2, 3]}],
        "frames": [{"frame": 1, "T_WC": [0, 0, 0, 0, 0, 0, 1], "T_WO": {"1": [0, 0, 0, 0, 0, 0, 1]}}],
        "truth": [mesh()], "key_frames": keys, "stills": [1, 5], "runs": [{"folder": "tsdf", "key_frames": run_keys}]}
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


METRICS = ["table_preservation_behind_other", "table_retention_behind_other", "table_hole_area_cm2", "visible_completion",
           "table_visible_completion", "movers_completion", "ghost_area_cm2", "revealed_ghost_area_cm2",
           "revealed_unseen_area_cm2", "sanity_all", "sanity_least", "seam_share", "seam_area_cm2", "bulge_share",
           "table_preservation_any_label", "table_label_purity", "movers_accuracy_rmse_mm", "table_accuracy_rmse_mm"]
COSTS = ["frame_ms", "move_ms", "fuse_ms", "mesh_ms", "map_mb"]


def cell():
    scores = {name: 0.5 for name in METRICS}
    scores["seam_share"] = {"value": None, "why": "no seam"}
    return {"schema": 2, "id": "0123456789abcdef", "sequence": "sequence", "key": "key", "settings": {},
            "examined": {**scores, **{name: 1.5 for name in COSTS}}, "removed": [1],
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
