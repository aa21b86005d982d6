"""Seeds of sequences: a folder of each layout (make_seeds.py)."""
import json
import struct
import zlib

from seed_files import (CAMERA, COLOUR, HEIGHT, MASK, MATRIX, WHITE, WIDTH, depth_exr, depth_png, grid, has_object,
                        packed, png, save)
from seed_meshes import ply_ascii


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
