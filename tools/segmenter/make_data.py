#!/usr/bin/python3
"""Renders what the network of tools/segmenter is trained on: random scenes of things on a table, each with draws of its own.

    /usr/bin/python3 tools/segmenter/make_data.py --out out/segmenter/data [--seeds 1:600] [--jobs 2]

Every seed gives a scene of scenes/random.toml's kind (no named scene is looked at) with its own field of view, distance,
number and sizes of things, patterns, lights and sensor, and of it 12 images, half a second apart. The same seeds give the same
images. OUT/<seed>/ is a sequence as `tsdfpp generate` leaves it; seeds that are there already are left alone.
"""
import argparse
import concurrent.futures
import pathlib
import random
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
FRAMES = 12
SENSORS = ["exact+colour_noise", "nguyen2012+colour_noise", "nguyen2012+colour_noise", "kinect+colour_noise", "d435"]
MODELS = ["car", "truck", "mug", "ball", "house", "blocks", "duck", "ship", "bottle", "torus", "arch", "cup", "book",
          "rocking_horse", "cube", "brick", "cylinder", "sphere", "cone", "pyramid", "wedge", "hexagon", "capsule"]


def scene_of(seed):
    """The scene's text, and its sensor."""
    draw = random.Random(seed)
    height = draw.choice([180, 240])
    f = draw.uniform(165, 320)  # of images 320 wide: 53 to 88 degrees
    # Things fill about as much of the picture whatever the lens.
    radius = min(1.65, draw.uniform(0.75, 1.5) * f / 220)
    most = draw.choice([3, 6, 10, 14])
    low, high = sorted((draw.uniform(0.35, 1.1), draw.uniform(0.35, 1.1)))
    models = MODELS if draw.random() < 0.7 else draw.sample(MODELS, 6)
    text = f"""name = "random"
purpose = "A draw for training."
frames = {FRAMES}
rate_hz = 2
seed = {seed}

[camera]
width = 320
height = {height}
f = {f:.2f}
cx = 159.5
cy = {height / 2 - 0.5}

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
    return text, draw.choice(SENSORS)


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
