#!/usr/bin/python3
"""Renders what the network of tools/segmenter is trained on: random scenes of things on a table, each with draws of its own.

    /usr/bin/python3 tools/segmenter/make_data.py --out out/segmenter/data [--seeds 1:600] [--jobs 2]

No named scene is looked at. Every seed gives a scene with its own field of view, distance, number and sizes of things,
patterns, lights and sensor, and of it 12 images, half a second apart. In a quarter of the scenes things stand apart and move, as
in scenes/random.toml; in a quarter many small and flat ones stand or lie close together; in a quarter they are set beside, on and
into one another so that they touch; in some they fall onto one another, or are large and stand on the floor of a room. The same
seeds give the same images. OUT/<seed>/ is a sequence as `tsdfpp generate` leaves it; seeds that are there already are left alone.
"""
import argparse
import concurrent.futures
import math
import pathlib
import random
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
FRAMES = 12
TABLE_TOP_M = 0.7437
SENSORS = ["exact+colour_noise", "nguyen2012+colour_noise", "nguyen2012+colour_noise", "kinect+colour_noise", "d435"]
# Length, width and height in metres (sim/models/model_catalogue.cc).
SOLIDS = {"cube": (0.06, 0.06, 0.06), "brick": (0.12, 0.06, 0.04), "domino": (0.012, 0.03, 0.06),
          "plank": (0.2, 0.06, 0.012), "cylinder": (0.07, 0.07, 0.1), "sphere": (0.07, 0.07, 0.07),
          "cone": (0.09, 0.09, 0.12), "capsule": (0.06, 0.06, 0.12), "pyramid": (0.11, 0.11, 0.1),
          "wedge": (0.14, 0.08, 0.06), "hexagon": (0.08, 0.0693, 0.1)}
TOYS = {"car": (0.271, 0.146, 0.12), "truck": (0.325, 0.156, 0.17), "mug": (0.156, 0.12, 0.121),
        "ball": (0.118, 0.118, 0.15), "house": (0.15, 0.172, 0.165), "blocks": (0.1, 0.1, 0.223),
        "duck": (0.188, 0.12, 0.144), "ship": (0.372, 0.126, 0.196), "bottle": (0.0746, 0.0746, 0.206),
        "torus": (0.164, 0.164, 0.044), "arch": (0.2, 0.06, 0.13), "cup": (0.104, 0.104, 0.105),
        "cover": (0.104, 0.104, 0.105), "book": (0.12, 0.17, 0.0323), "rocking_horse": (0.34, 0.122, 0.3),
        "knot": (0.193, 0.181, 0.097)}
# What others can stand on, with the share of its sides that is flat.
FLAT = {"cube": 1, "brick": 1, "plank": 1, "cylinder": 0.7, "hexagon": 0.7, "book": 1}
# What others can lie in: its sides, how high its bottom is, and the share of its sides that is inside.
OPEN = {"plate": ((0.22, 0.22, 0.02), 0.006, 0.55), "tray": ((0.32, 0.22, 0.026), 0.007, 0.8),
        "bowl": ((0.17, 0.17, 0.069), 0.008, 0.45), "crate": ((0.38, 0.26, 0.12), 0.012, 0.85),
        "card": ((0.088, 0.063, 0.0021), 0.0021, 1.0)}
APART = ["car", "truck", "mug", "ball", "house", "blocks", "duck", "ship", "bottle", "torus", "arch", "cup", "book",
         "rocking_horse", "cube", "brick", "cylinder", "sphere", "cone", "pyramid", "wedge", "hexagon", "capsule", "plate",
         "tray", "bowl", "card", "plank", "knot", "cover", "garage"]
PATTERNS = ["checker", "stripes", "dots", "bricks", "planks", "marble", "noise", "speckle", "weave"]


def camera_of(draw):
    """Image and lens; and how far away a scene looks as large as with any other lens, in parts of what 220 pixels need."""
    height = draw.choice([180, 240])
    f = draw.uniform(165, 320)  # of images 320 wide: 53 to 88 degrees
    text = f"width = 320\nheight = {height}\nf = {f:.2f}\ncx = 159.5\ncy = {height / 2 - 0.5}\n"
    return text, f / 220


def head_of(seed):
    return f"""name = "random"
purpose = "A draw for training."
frames = {FRAMES}
rate_hz = 2
seed = {seed}

[camera]
"""


def apart(seed, draw):
    """Things that stand apart, and move: drawn by the program itself."""
    lens, far = camera_of(draw)
    radius = min(1.65, draw.uniform(0.75, 1.5) * far)
    most = draw.choice([3, 6, 10, 14])
    low, high = sorted((draw.uniform(0.35, 1.1), draw.uniform(0.35, 1.1)))
    models = APART if draw.random() < 0.7 else draw.sample(APART, 6)
    return f"""{head_of(seed)}{lens}
[random]
objects = [1, {most}]
models = {str(models).replace("'", '"')}
scale = [{low:.3f}, {high:.3f}]
size_m = [0.03, 0.16]
texture_share = {draw.uniform(0, 0.9):.2f}
room_texture_share = {draw.uniform(0, 1):.2f}
motions = ["rest", "rest", "drive", "carry", "drop"]
speed = [0.02, 0.1]
gap_m = {draw.choice([0.002, 0.01, 0.03])}
in_view = 0.6

[random.camera]
paths = ["arc", "orbit", "spline"]
radius_m = [{radius:.3f}, {1.15 * radius:.3f}]
height_m = [{0.35 * radius:.3f}, {0.8 * radius:.3f}]
azimuth_deg = [-180, 180]
sweep_deg = [30, 120]
handheld_share = 0.3
jitter_mm = [1, 4]
jitter_deg = [0.1, 2]

[random.lights]
count = [1, 3]
ambient = [0.15, 0.6]
strength = [0.3, 1.0]
"""


class Things:
    """Objects of a scene file, one after the other."""

    def __init__(self, draw):
        self.draw, self.texts = draw, []
        self.patterned = draw.uniform(0, 0.9)
        # Things of one colour lie beside each other as well as gay ones.
        self.few_paints = [self.paint() for _ in range(draw.choice([1, 2, 3]))] if draw.random() < 0.3 else None

    def paint(self):
        grey = self.draw.random() < 0.25
        level = self.draw.randint(30, 235)
        return [level] * 3 if grey else [self.draw.randint(20, 240) for _ in range(3)]

    def add(self, model, size, x, y, z, yaw_deg, solid=False, pitch_deg=0.0, roll_deg=0.0, physics=""):
        number = len(self.texts) + 1
        scale = f"size = [{size[0]:.4f}, {size[1]:.4f}, {size[2]:.4f}]" if solid else f"scale = {size:.4f}"
        paint = self.draw.choice(self.few_paints) if self.few_paints else self.paint()
        material = f'material = "{self.draw.choice(PATTERNS)}"\n' if self.draw.random() < self.patterned else ""
        self.texts.append(f"""
[[object]]
name = "{model}_{number}"
id = {number}
class = "thing"
model = "{model}"
{scale}
paint = {paint}
texture_seed = {self.draw.randint(1, 10**6)}
{material}x = {x:.4f}
y = {y:.4f}
z = {z:.4f}
yaw_deg = {yaw_deg:.2f}
pitch_deg = {pitch_deg:.2f}
roll_deg = {roll_deg:.2f}
{physics}""")


def solid_of(draw, name, factor, least, most):
    """Its length, width and height, each times `factor` and a draw of its own."""
    size = [max(0.012, side * factor * draw.uniform(least, most)) for side in SOLIDS[name]]
    if name in ("cylinder", "sphere", "cone", "capsule", "hexagon"):
        size[1] = size[0]
    if name == "sphere":
        size[2] = size[0]
    if name == "capsule":
        size[2] = max(size[2], 1.3 * size[0])
    return size


def some_thing(draw, models=None):
    """A model, its factor (solids: its sides), its length, width and height, and whether it is a solid."""
    name = draw.choice(models or list(SOLIDS) + list(TOYS))
    if name in SOLIDS:
        size = solid_of(draw, name, draw.uniform(0.7, 1.8), 0.7, 1.4)
        return name, size, size, True
    sides = TOYS[name] if name in TOYS else OPEN[name][0]
    factor = draw.uniform(0.4, 1.0)
    return name, factor, [factor * side for side in sides], False


def rig(draw, radius, target):
    """Camera's path, room and lights."""
    azimuth = draw.uniform(-180, 180)
    sweep = draw.choice([-1, 1]) * draw.uniform(20, 150)
    azimuths = [azimuth + sweep * i / 2 for i in range(3)]
    radii = [radius * draw.uniform(1, 1.15) for _ in range(3)]
    heights = [radius * draw.uniform(0.3, 0.95) for _ in range(3)]
    kinds = []
    for _ in range(draw.choice([1, 2, 3])):
        angle, level = draw.uniform(0, 2 * math.pi), draw.uniform(0.3, 0.9)
        kinds.append(f"""
[[lights.light]]
kind = "directional"
position = [{2 * math.cos(angle):.3f}, {2 * math.sin(angle):.3f}, {draw.uniform(1.8, 2.4):.3f}]
target = [0, 0, 0.7]
colour = [{level * draw.uniform(0.85, 1):.3f}, {level * draw.uniform(0.85, 1):.3f}, {level * draw.uniform(0.85, 1):.3f}]
shadow = {str(draw.random() < 0.7).lower()}
""")
    jitter = ""
    if draw.random() < 0.3:
        jitter = f"\n[camera.jitter]\nposition_mm = {draw.uniform(1, 4):.2f}\nrotation_deg = {draw.uniform(0.1, 2):.2f}\n"
    textures = ""
    for part in ("table", "floor", "wall"):
        if draw.random() < 0.5:
            first, second = ([round(draw.uniform(0, 255)) for _ in range(3)] for _ in range(2))
            textures += f"""
[room.{part}_texture]
pattern = "{draw.choice(PATTERNS)}"
seed = {draw.randint(1, 10**6)}
first = {first}
second = {second}
size_m = {draw.uniform(0.1, 1):.3f}
"""
    ambient = draw.uniform(0.15, 0.6)
    path = f"""path = "arc"
target = [{target[0]:.3f}, {target[1]:.3f}, {target[2]:.3f}]
azimuth_deg = [{', '.join(f'{a:.2f}' for a in azimuths)}]
radius_m = [{', '.join(f'{r:.3f}' for r in radii)}]
height_m = [{', '.join(f'{h:.3f}' for h in heights)}]
{jitter}"""
    return path, textures, f"\n[lights]\nambient = {ambient:.3f}\n" + "".join(kinds)


def scene(draw, seed, lens, radius, target, things, room=""):
    path, textures, lights = rig(draw, radius, target)
    return f"""{head_of(seed)}{lens}{path}
[room]
{room}{textures}{lights}{"".join(things.texts)}"""


def heap(seed, draw):
    """Things that fall onto one another, into what is open, and roll apart."""
    lens, far = camera_of(draw)
    things = Things(draw)
    spread = draw.uniform(0.06, 0.22)
    z = TABLE_TOP_M
    if draw.random() < 0.4:
        name = draw.choice(["tray", "bowl", "crate", "plate"])
        factor = draw.uniform(0.7, 1.0)
        things.add(name, factor, draw.uniform(-0.05, 0.05), draw.uniform(-0.05, 0.05), TABLE_TOP_M, draw.uniform(-180, 180))
        z += 0.08
    for _ in range(draw.randint(3, 14)):
        name, factor, size, solid = some_thing(draw, list(SOLIDS) + list(TOYS) + ["plate", "bowl", "tray", "card"])
        reach = 0.5 * math.hypot(*size) + 0.01
        z += reach
        if z > 2.4:
            break
        physics = f"""
[object.physics]
mass_kg = {draw.uniform(0.05, 0.4):.3f}
friction = {draw.uniform(0.4, 1):.2f}
rolling_friction_m = 0.002
"""
        things.add(name, factor, draw.uniform(-spread, spread), draw.uniform(-spread, spread), z, draw.uniform(-180, 180), solid,
                   draw.uniform(-40, 40), draw.uniform(-40, 40), physics)
        z += reach
    radius = min(1.6, draw.uniform(0.55, 1.2) * far)
    return scene(draw, seed, lens, radius, (0, 0, TABLE_TOP_M + 0.03), things)


def touching(seed, draw):
    """Rows of things side by side, with things on and in them."""
    lens, far = camera_of(draw)
    things = Things(draw)
    gap = draw.choice([0.0008, 0.002, 0.006])

    def pile(x, y, z, yaw, name, factor, size, solid, level):
        things.add(name, factor, x, y, z, yaw, solid)
        inside = None
        if name in FLAT:
            inside = z + size[2] + 0.0005, [FLAT[name] * side for side in size[:2]]
        elif name in OPEN:
            inside = z + factor * OPEN[name][1] + 0.0005, [OPEN[name][2] * side for side in size[:2]]
        if inside is None or level > 2 or draw.random() > (0.85 if name in OPEN else 0.4):
            return
        bottom, room = inside
        for _ in range(30):
            upper = some_thing(draw, list(SOLIDS) + ["cup", "cover", "mug", "ball", "book", "bottle", "duck", "house", "torus",
                                                     "plate", "card", "bowl"])
            if max(upper[2][:2]) < 1.05 * min(room) or (upper[0] in ("card", "book", "plank", "plate") and level == 0
                                                        and max(upper[2][:2]) < 1.4 * min(room)):
                pile(x + draw.uniform(-0.05, 0.05) * room[0], y + draw.uniform(-0.05, 0.05) * room[1], bottom,
                     draw.uniform(-180, 180), *upper, level + 1)
                return

    for _ in range(draw.randint(1, 4)):
        yaw = draw.uniform(-180, 180)
        along = (math.cos(math.radians(yaw)), math.sin(math.radians(yaw)))
        across = (-along[1], along[0])
        x, y = draw.uniform(-0.25, 0.1), draw.uniform(-0.2, 0.2)
        side = 0.0
        for _ in range(draw.randint(1, 5)):
            kind = list(OPEN) if draw.random() < 0.3 else None
            name, factor, size, solid = some_thing(draw, kind)
            turned = draw.random() < 0.25  # then it touches at a corner, about
            length = math.hypot(size[0], size[1]) if turned else size[0]
            side += length / 2
            slip = draw.uniform(-0.02, 0.02)
            pile(x + along[0] * side + across[0] * slip, y + along[1] * side + across[1] * slip, TABLE_TOP_M,
                 yaw + (draw.uniform(-45, 45) if turned else draw.choice([0, 180])), name, factor, size, solid, 0)
            side += length / 2 + gap
    radius = min(1.6, draw.uniform(0.6, 1.3) * far)
    return scene(draw, seed, lens, radius, (draw.uniform(-0.05, 0.1), draw.uniform(-0.1, 0.1), TABLE_TOP_M + 0.02), things)


def crowd(seed, draw):
    """Many things close together, small ones as seen; a good part of them lies flat."""
    lens, far = camera_of(draw)
    things = Things(draw)
    flat = draw.uniform(0.1, 0.6)
    factor = draw.uniform(0.45, 1.0)
    gap = draw.choice([0.002, 0.008, 0.02, 0.04])
    reach_x, reach_y = draw.uniform(0.15, 0.42), draw.uniform(0.12, 0.3)
    placed = []
    for _ in range(draw.choice([8, 16, 24, 34])):
        if draw.random() < flat:
            name = draw.choice(["card", "card", "card", "book", "plate", "tray", "plank", "domino"])
        else:
            name = draw.choice(list(SOLIDS) + list(TOYS))
        if name in SOLIDS:
            size = how = solid_of(draw, name, factor, 0.6, 1.3)
            solid = True
        else:
            # A card is as small as it is.
            how = draw.uniform(0.7, 1.3) if name == "card" else factor * draw.uniform(0.7, 1.1)
            size, solid = [how * side for side in (TOYS[name] if name in TOYS else OPEN[name][0])], False
        radius = 0.5 * math.hypot(size[0], size[1])
        for _ in range(20):
            x, y = draw.uniform(-reach_x, reach_x), draw.uniform(-reach_y, reach_y)
            if all(math.hypot(x - other[0], y - other[1]) > radius + other[2] + gap for other in placed):
                placed.append((x, y, radius))
                things.add(name, how, x, y, TABLE_TOP_M, draw.uniform(-180, 180), solid)
                break
    radius = min(1.6, draw.uniform(0.5, 1.15) * far)
    return scene(draw, seed, lens, radius, (draw.uniform(-0.05, 0.05), draw.uniform(-0.05, 0.05), TABLE_TOP_M), things)


def floor(seed, draw):
    """Large things on the floor of a room without a table."""
    lens, far = camera_of(draw)
    things = Things(draw)
    for _ in range(draw.randint(1, 5)):
        name = draw.choice(["car", "truck", "ship", "rocking_horse", "house", "duck", "arch", "garage", "mug", "ball", "book",
                            "crate", "bottle"])
        things.add(name, draw.uniform(1.2, 3), draw.uniform(-1.4, 1.4), draw.uniform(-1.4, 1.4), 0.001,
                   draw.uniform(-180, 180))
    room = (f"table = false\nhalf_x = {draw.uniform(2.4, 3.2):.2f}\nhalf_y = {draw.uniform(2.3, 3.2):.2f}\n"
            f"height = {draw.uniform(2.6, 3):.2f}\n")
    radius = min(1.7, draw.uniform(1.2, 1.7) * max(1, far))
    return scene(draw, seed, lens, radius, (0, 0, draw.uniform(0.2, 0.4)), things, room)


def scene_of(seed):
    """The scene's text, and its sensor."""
    draw = random.Random(seed)
    (kind,) = draw.choices([apart, crowd, touching, heap, floor], [22, 24, 22, 14, 18])
    return kind(seed, draw), draw.choice(SENSORS)


def render(program, out, seed):
    folder = out / f"{seed:05d}"
    if folder.exists():
        return ""
    text, sensor = scene_of(seed)
    with tempfile.NamedTemporaryFile("w", suffix=".toml") as file:
        file.write(text)
        file.flush()
        command = [program, "generate", file.name, "--out", folder, "--sensor", sensor, "--jobs", "1", "--share", "0"]
        ran = subprocess.run(command, capture_output=True, text=True)
    # Draws that no scene can hold (too many things that may not touch) are refused, and left out.
    return "" if ran.returncode == 0 else f"seed {seed}: {ran.stderr.strip()}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--seeds", default="1:600", metavar="FIRST:END")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--tsdfpp", default=ROOT / "build/release/tsdfpp")
    options = parser.parse_args()
    first, end = map(int, options.seeds.split(":"))
    options.out.mkdir(parents=True, exist_ok=True)
    refused = 0
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        for words in pool.map(lambda seed: render(options.tsdfpp, options.out, seed), range(first, end)):
            if words:
                refused += 1
                print(words, file=sys.stderr)
    print(f"{end - first - refused} scenes of {FRAMES} images in {options.out}, {refused} draws refused")


if __name__ == "__main__":
    main()
