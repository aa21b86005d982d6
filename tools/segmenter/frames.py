"""Frames to train on: read from the sequences of make_data.py, kept on a device, and changed by chance, many at a time."""
import os
import pathlib
import zlib

os.environ["OPENCV_IO_ENABLE_OPENEXR"] = "1"
import cv2  # noqa: E402
import numpy as np  # noqa: E402
import torch  # noqa: E402
from torch.nn import functional  # noqa: E402

NO_INSTANCE = 65535
UNKNOWN = 255
LEAST_PIXELS = 12    # a thing that shows less has no centre
BUMP_PX = 2.5        # standard deviation of a centre's bump
REACH_PX = 8         # a bump ends here
# A thing of so many pixels counts as often as its pixels; what is smaller more, what is larger less: by the square root of its
# share, within limits. Quality is counted by things, and a large one has a hundred times a small one's pixels.
WEIGHED_PIXELS = 600
LEAST_WEIGHT, MOST_WEIGHT = 0.5, 4.0


def read_exr(file):
    """A depth image as `tsdfpp generate` writes it: one channel of single precision, ZIP in parts of 16 rows."""
    values = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
    if values is not None:
        return values
    # OpenCV of PyPI has no OpenEXR.
    data = file.read_bytes()
    at, head = 8, {}
    while data[at]:
        name, kind, rest = data[at:].split(b"\0", 2)
        at += len(name) + len(kind) + 2
        size = int.from_bytes(data[at:at + 4], "little")
        head[name] = data[at + 4:at + 4 + size]
        at += 4 + size
    left, top, right, bottom = np.frombuffer(head[b"dataWindow"], "<i4")
    if head[b"compression"] != b"\3" or head[b"channels"][:6] != b"Y\0\2\0\0\0":
        raise ValueError(f"{file}: expected one channel Y of single precision, in ZIP")
    values = np.empty((bottom - top + 1, right - left + 1), np.float32)
    for start in np.frombuffer(data, "<u8", (len(values) + 15) // 16, at + 1).tolist():
        row, size = np.frombuffer(data, "<i4", 2, start).tolist()
        part = values[row - top:row - top + 16]
        packed = data[start + 8:start + 8 + size]
        if size < part.nbytes:
            steps = np.frombuffer(zlib.decompress(packed), np.uint8).astype(np.int64)
            steps[1:] -= 128
            halves = np.cumsum(steps).astype(np.uint8)
            whole = np.empty_like(halves)
            whole[0::2], whole[1::2] = halves[:(len(halves) + 1) // 2], halves[(len(halves) + 1) // 2:]
            packed = whole.tobytes()
        part[:] = np.frombuffer(packed, "<f4").reshape(part.shape)
    return values


def read_sequence(folder):
    """Its frames: colour (uint8, height x width x 3), inverse depth (float16, 1/m; 0: none), ids (uint8; 255: unknown)."""
    depths = next(path for path in sorted(pathlib.Path(folder).glob("depth_*")) if path.name != "depth_original"
                  or not any(pathlib.Path(folder).glob("depth_noise")))
    frames = []
    for colour in sorted((pathlib.Path(folder) / "colour").iterdir()):
        number = colour.stem[len("Color"):]
        depth = read_exr(depths / f"Depth{number}.exr")
        ids = cv2.imread(str(pathlib.Path(folder) / "mask_id" / f"Mask{number}.png"), cv2.IMREAD_UNCHANGED)
        picture = cv2.cvtColor(cv2.imread(str(colour)), cv2.COLOR_BGR2RGB)
        inverse = np.where(depth > 0, 1 / np.maximum(depth, 0.1), 0).astype(np.float16)
        frames.append((picture, inverse, np.where(ids == NO_INSTANCE, UNKNOWN, np.minimum(ids, 254)).astype(np.uint8)))
    return frames


class Store:
    """Frames on a device, up to `most` of them; what a frame lacks to height x width is unknown, and has no depth."""

    def __init__(self, most, height, width, device):
        self.colour = torch.empty((most, 3, height, width), dtype=torch.uint8, device=device)
        self.inverse = torch.empty((most, height, width), dtype=torch.float16, device=device)
        self.ids = torch.empty((most, height, width), dtype=torch.uint8, device=device)
        self.rows = torch.empty(most, dtype=torch.float32, device=device)
        self.count = 0

    def is_full(self):
        return self.count == len(self.rows)

    def add(self, frames):
        for picture, inverse, ids in frames[:len(self.rows) - self.count]:
            rows, columns = ids.shape
            at = self.count
            self.colour[at].zero_()
            self.inverse[at].zero_()
            self.ids[at].fill_(UNKNOWN)
            self.colour[at, :, :rows, :columns] = torch.from_numpy(picture.transpose(2, 0, 1).copy()).to(self.colour.device)
            self.inverse[at, :rows, :columns] = torch.from_numpy(inverse).to(self.inverse.device)
            self.ids[at, :rows, :columns] = torch.from_numpy(ids).to(self.ids.device)
            self.rows[at] = rows
            self.count = at + 1


def targets_of(ids):
    """Of ids (batch x height x width, integers): whether a pixel is a thing's, how much that counts (0: not known), the centres'
    bumps, the ways to them (columns, rows), and how much these count (0: there is none)."""
    batch, height, width = ids.shape
    device = ids.device
    thing = (ids > 0) & (ids != UNKNOWN)
    flat = (torch.arange(batch, device=device)[:, None, None] * 256 + ids).reshape(-1)
    row = torch.arange(height, device=device, dtype=torch.float32)[None, :, None].expand(batch, height, width).reshape(-1)
    column = torch.arange(width, device=device, dtype=torch.float32)[None, None, :].expand(batch, height, width).reshape(-1)
    count = torch.bincount(flat, minlength=256 * batch).float()
    u = (torch.bincount(flat, column, 256 * batch) / count.clamp(min=1)).float()
    v = (torch.bincount(flat, row, 256 * batch) / count.clamp(min=1)).float()
    number = torch.arange(256 * batch, device=device)
    counts = (count >= LEAST_PIXELS) & (number % 256 > 0) & (number % 256 != UNKNOWN)
    has_way = (thing.reshape(-1) & counts[flat]).reshape(ids.shape)
    of_thing = (WEIGHED_PIXELS / count.clamp(min=1)).sqrt().clamp(LEAST_WEIGHT, MOST_WEIGHT)[flat].reshape(ids.shape)
    weight = torch.where(thing, of_thing, (ids != UNKNOWN).float())
    way = torch.stack([(u[flat] - column).reshape(ids.shape), (v[flat] - row).reshape(ids.shape)], dim=1)
    way = way * has_way[:, None]
    things = torch.nonzero(counts)[:, 0]
    bumps = torch.zeros(batch * height * width, device=device)
    steps = torch.arange(-REACH_PX, REACH_PX + 1, device=device)
    to_v = v[things].round().long()[:, None, None] + steps[None, :, None]
    to_u = u[things].round().long()[:, None, None] + steps[None, None, :]
    value = torch.exp(-((to_u - u[things][:, None, None]) ** 2 + (to_v - v[things][:, None, None]) ** 2)
                      / (2 * BUMP_PX ** 2))
    to = ((things // 256)[:, None, None] * height + to_v) * width + to_u
    inside = (to_v >= 0) & (to_v < height) & (to_u >= 0) & (to_u < width)
    bumps = bumps.scatter_reduce(0, to[inside], value[inside], "amax").reshape(ids.shape)
    return thing.float(), weight, bumps, way, has_way * of_thing


class Draws:
    """Uniform numbers a frame."""

    def __init__(self, batch, device):
        self.batch, self.device = batch, device

    def within(self, low, high, sides=3):
        return low + (high - low) * torch.rand((self.batch,) + (1,) * sides, device=self.device)

    def chance(self, share, sides=3):
        return torch.rand((self.batch,) + (1,) * sides, device=self.device) < share


def change_colour(x, draws):
    """Another exposure, tint, order of channels, sharpness, light and noise of x (batch x 3 x height x width, 0 to 1)."""
    batch, _, height, width = x.shape
    order = torch.rand((batch, 3), device=x.device).argsort(dim=1)
    order = torch.where(draws.chance(0.3, 1), order, torch.arange(3, device=x.device)[None])
    x = x.gather(1, order[:, :, None, None].expand_as(x))
    x = torch.where(draws.chance(0.15), x.mean(dim=1, keepdim=True), x)
    tint = 0.8 + 0.4 * torch.rand((batch, 3, 1, 1), device=x.device)
    x = (x * draws.within(0.6, 1.4) * tint).clamp(0, 1) ** draws.within(0.6, 1.6)
    light = functional.interpolate(torch.rand((batch, 1, 4, 5), device=x.device), (height, width), mode="bicubic",
                                   align_corners=False)
    x = torch.where(draws.chance(0.4), x * (0.6 + 0.8 * light), x)
    soft = functional.avg_pool2d(x, 3, stride=1, padding=1, count_include_pad=False)
    x = torch.where(draws.chance(0.4), x + (soft - x) * draws.within(0.2, 1), x)
    x = x + torch.randn_like(x) * draws.within(0, 0.04)
    x = torch.where(draws.chance(0.06), torch.full_like(x, 0.5), x)
    return x.clamp(0, 1)


def change_depth(q, draws):
    """Another scale of the whole scene, and more holes, in inverse depth q (batch x height x width)."""
    _, height, width = q.shape
    q = q * torch.where(draws.chance(0.25, 2), draws.within(0.25, 0.7, 2), draws.within(0.7, 1.5, 2))
    rows = torch.arange(height, device=q.device)[None, :, None]
    columns = torch.arange(width, device=q.device)[None, None, :]
    for _ in range(3):
        v, u = draws.within(0, height, 2), draws.within(0, width, 2)
        hole = (rows >= v) & (rows < v + draws.within(4, 40, 2)) & (columns >= u) & (columns < u + draws.within(4, 40, 2))
        q = torch.where(hole & draws.chance(0.5, 2), torch.zeros_like(q), q)
    dots = (torch.rand_like(q) < draws.within(0, 0.1, 2)) & draws.chance(0.3, 2)
    return torch.where(dots, torch.zeros_like(q), q)


def examples_of(store, numbers, height, width):
    """Inputs (batch x 5 x height x width) and targets of parts of frames."""
    batch, device = len(numbers), store.ids.device
    draws = Draws(batch, device)
    zoom = torch.exp(draws.within(np.log(0.7), np.log(1.6), 0))
    rows, columns = height / zoom, width / zoom
    # A part larger than the frame has it whole, somewhere inside.
    room_v, room_u = store.rows[numbers] - rows, store.ids.shape[2] - columns
    v = torch.minimum(room_v, torch.zeros_like(room_v)) + room_v.abs() * draws.within(0, 1, 0)
    u = torch.minimum(room_u, torch.zeros_like(room_u)) + room_u.abs() * draws.within(0, 1, 0)
    at_v = v[:, None] + (torch.arange(height, device=device) + 0.5) * (rows / height)[:, None]
    at_u = u[:, None] + (torch.arange(width, device=device) + 0.5) * (columns / width)[:, None]
    at_u = torch.where(draws.chance(0.5, 1), at_u.flip(1), at_u)
    whole = store.ids.shape[1:]
    grid = torch.stack([(2 * at_u / whole[1] - 1)[:, None, :].expand(batch, height, width),
                        (2 * at_v / whole[0] - 1)[:, :, None].expand(batch, height, width)], dim=3)

    def sample(values, mode):
        return functional.grid_sample(values, grid, mode=mode, padding_mode="zeros", align_corners=False)

    colour = sample(store.colour[numbers].float() / 255, "bilinear")
    # Of ids their difference to "unknown", which is then what lies outside.
    both = torch.stack([store.inverse[numbers].float(), UNKNOWN - store.ids[numbers].float()], dim=1)
    both = sample(both, "nearest")
    ids = (UNKNOWN - both[:, 1]).round().long()
    q = change_depth(both[:, 0], draws)
    x = torch.cat([change_colour(colour, draws), q[:, None], (q > 0).float()[:, None]], dim=1)
    return (x, *targets_of(ids))


def input_of(frame):
    """A whole frame as the network gets it: sides filled up with nothing to multiples of 16."""
    picture, inverse, _ = frame
    q = inverse.astype(np.float32)
    x = np.concatenate([picture.astype(np.float32).transpose(2, 0, 1) / 255, q[None], (q > 0)[None].astype(np.float32)])
    return np.pad(x, ((0, 0), (0, -x.shape[1] % 16), (0, -x.shape[2] % 16)))
