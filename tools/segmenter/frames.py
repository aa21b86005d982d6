"""Frames to train on: read from the sequences of make_data.py, then changed by chance."""
import os
import pathlib

os.environ["OPENCV_IO_ENABLE_OPENEXR"] = "1"
import cv2  # noqa: E402
import numpy as np  # noqa: E402

NO_INSTANCE = 65535


def read_sequence(folder):
    """Its frames: colour (uint8, height x width x 3), inverse depth (float16, 1/m; 0: none), ids (uint8; 255: unknown)."""
    depths = next(path for path in sorted(pathlib.Path(folder).glob("depth_*")) if path.name != "depth_original"
                  or not any(pathlib.Path(folder).glob("depth_noise")))
    frames = []
    for colour in sorted((pathlib.Path(folder) / "colour").iterdir()):
        number = colour.stem[len("Color"):]
        depth = cv2.imread(str(depths / f"Depth{number}.exr"), cv2.IMREAD_UNCHANGED)
        ids = cv2.imread(str(pathlib.Path(folder) / "mask_id" / f"Mask{number}.png"), cv2.IMREAD_UNCHANGED)
        picture = cv2.cvtColor(cv2.imread(str(colour)), cv2.COLOR_BGR2RGB)
        inverse = np.where(depth > 0, 1 / np.maximum(depth, 0.1), 0).astype(np.float16)
        frames.append((picture, inverse, np.where(ids == NO_INSTANCE, 255, np.minimum(ids, 254)).astype(np.uint8)))
    return frames


def targets_of(ids):
    """Whether a pixel is a thing's, whether that is known, the centres' bumps, and the ways to them (rows last)."""
    height, width = ids.shape
    known = ids != 255
    thing = (ids > 0) & known
    bumps = np.zeros((height, width), np.float32)
    way = np.zeros((2, height, width), np.float32)
    rows, columns = np.mgrid[0:height, 0:width].astype(np.float32)
    for number in np.unique(ids[thing]):
        there = ids == number
        if there.sum() < 12:
            continue
        u, v = columns[there].mean(), rows[there].mean()
        bumps = np.maximum(bumps, np.exp(-((columns - u) ** 2 + (rows - v) ** 2) / (2 * 2.5 ** 2)))
        way[0][there] = u - columns[there]
        way[1][there] = v - rows[there]
    return thing.astype(np.float32), known.astype(np.float32), bumps, way


def change_colour(picture, draw):
    """Another exposure, tint, order of channels, sharpness and noise."""
    x = picture.astype(np.float32) / 255
    if draw.random() < 0.3:
        x = x[..., draw.permutation(3)]
    if draw.random() < 0.15:
        x = np.repeat(x.mean(axis=2, keepdims=True), 3, axis=2)
    x = np.clip(x * draw.uniform(0.6, 1.4) * draw.uniform(0.8, 1.2, 3).astype(np.float32), 0, 1) ** draw.uniform(0.6, 1.6)
    if draw.random() < 0.3:
        x = cv2.GaussianBlur(x, (3, 3), draw.uniform(0.3, 1.2))
    x = x + draw.normal(0, draw.uniform(0, 0.04), x.shape).astype(np.float32)
    if draw.random() < 0.06:
        x = np.full_like(x, 0.5)
    return np.clip(x, 0, 1).astype(np.float32)


def change_depth(inverse, draw):
    """Another scale of the whole scene, and more holes."""
    q = inverse.astype(np.float32) * draw.uniform(0.7, 1.4)
    for _ in range(draw.integers(0, 4)):
        u, v = draw.integers(0, q.shape[1]), draw.integers(0, q.shape[0])
        q[v:v + draw.integers(4, 40), u:u + draw.integers(4, 40)] = 0
    if draw.random() < 0.3:
        q[draw.random(q.shape) < draw.uniform(0, 0.1)] = 0
    return q


def example_of(frame, height, width, draw):
    """Input and targets of a part of a frame, of height x width."""
    picture, inverse, ids = frame
    zoom = draw.uniform(0.75, 1.3)
    rows, columns = min(int(height / zoom), ids.shape[0]), min(int(width / zoom), ids.shape[1])
    v, u = draw.integers(0, ids.shape[0] - rows + 1), draw.integers(0, ids.shape[1] - columns + 1)
    part = np.s_[v:v + rows, u:u + columns]
    size = (width, height)
    picture = cv2.resize(picture[part], size, interpolation=cv2.INTER_AREA if zoom < 1 else cv2.INTER_LINEAR)
    inverse = cv2.resize(inverse[part].astype(np.float32), size, interpolation=cv2.INTER_NEAREST)
    ids = cv2.resize(ids[part], size, interpolation=cv2.INTER_NEAREST)
    if draw.random() < 0.5:
        picture, inverse, ids = picture[:, ::-1], inverse[:, ::-1], ids[:, ::-1]
    q = change_depth(inverse.copy(), draw)
    x = np.concatenate([change_colour(picture, draw).transpose(2, 0, 1), q[None], (q > 0)[None].astype(np.float32)])
    return (x.astype(np.float32), *targets_of(np.ascontiguousarray(ids)))


def input_of(frame):
    """A whole frame as the network gets it: sides filled up with nothing to multiples of 16."""
    picture, inverse, _ = frame
    q = inverse.astype(np.float32)
    x = np.concatenate([picture.astype(np.float32).transpose(2, 0, 1) / 255, q[None], (q > 0)[None].astype(np.float32)])
    return np.pad(x, ((0, 0), (0, -x.shape[1] % 16), (0, -x.shape[2] % 16)))
