#!/usr/bin/python3
"""An adapter to copy: maps a TUM sequence with Open3D and writes what `tsdfpp evaluate` reads.

docs/adapters.md describes what comes in and what has to go out. The world is taken as static and
nothing is labelled, so the scores take faces of any label.
"""
import argparse
import json
import pathlib
import time

import numpy as np
import open3d as o3d

TUM_DEPTH_UNITS = 5000.0
FARTHEST_M = 100.0


def read_lines(path):
    """The words of each line that is no comment."""
    lines = path.read_text().splitlines()
    return [line.split() for line in lines if line.strip() and not line.startswith("#")]


def pose_matrix(words):
    """T_world_camera from tx ty tz qx qy qz qw."""
    tx, ty, tz, qx, qy, qz, qw = (float(word) for word in words)
    matrix = np.eye(4)
    matrix[:3, :3] = o3d.geometry.get_rotation_matrix_from_quaternion([qw, qx, qy, qz])
    matrix[:3, 3] = [tx, ty, tz]
    return matrix


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sequence", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--first", type=int, required=True, help="number of the first frame")
    parser.add_argument("--frames", required=True, help="after which meshes are wanted")
    parser.add_argument("--voxel", type=float, required=True)
    parser.add_argument("--truncation", type=float, required=True)
    arguments = parser.parse_args()
    wanted = {int(word) for word in arguments.frames.split(",")}

    fx, fy, cx, cy, width, height = (
        float(word) for word in read_lines(arguments.sequence / "calibration.txt")[0])
    camera = o3d.camera.PinholeCameraIntrinsic(int(width), int(height), fx, fy, cx, cy)
    poses = {line[0]: pose_matrix(line[1:8])
             for line in read_lines(arguments.sequence / "groundtruth.txt")}
    volume = o3d.pipelines.integration.ScalableTSDFVolume(
        voxel_length=arguments.voxel, sdf_trunc=arguments.truncation,
        color_type=o3d.pipelines.integration.TSDFVolumeColorType.RGB8)

    frame_ms = []
    pairs = read_lines(arguments.sequence / "associations.txt")
    for k, (_, colour_file, stamp, depth_file) in enumerate(pairs):
        depth = o3d.io.read_image(str(arguments.sequence / depth_file))
        colour = o3d.io.read_image(str(arguments.sequence / colour_file))
        image = o3d.geometry.RGBDImage.create_from_color_and_depth(
            colour, depth, depth_scale=TUM_DEPTH_UNITS, depth_trunc=FARTHEST_M,
            convert_rgb_to_intensity=False)
        start = time.perf_counter()
        volume.integrate(image, camera, np.linalg.inv(poses[stamp]))
        frame_ms.append(1e3 * (time.perf_counter() - start))
        frame = arguments.first + k
        if frame in wanted:
            folder = arguments.out / "meshes" / f"{frame:06d}"
            folder.mkdir(parents=True, exist_ok=True)
            mesh = volume.extract_triangle_mesh()
            if not o3d.io.write_triangle_mesh(str(folder / "scene.ply"), mesh):
                raise SystemExit(f"{folder}/scene.ply cannot be written")
    (arguments.out / "timing.json").write_text(json.dumps({"frame_ms": frame_ms}))


if __name__ == "__main__":
    main()
