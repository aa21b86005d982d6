"""How seeds are saved (make_seeds.py), and the images that several of them hold."""
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
