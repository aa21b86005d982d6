#!/usr/bin/python3
"""Trains the network of network.py on what make_data.py rendered, and writes it as ONNX.

    /usr/bin/python3 tools/segmenter/train.py --data out/segmenter/data --out out/segmenter/run [--minutes 600] [--seed 1]

Needs Debian's python3-torch and python3-opencv. Minutes are those of a core. OUT gets last.pt (it goes on from there),
curve.csv (a line every 200 steps: steps, minutes, loss; of every 10th scene, which is not trained on, the share of pixels that
are a thing's or not as they should be, and the panoptic quality of things; scenes that are) and segmenter.onnx.
"""
import argparse
import copy
import pathlib
import time

import numpy as np
import torch
from torch import nn
from torch.nn import functional
from torch.nn.utils.fusion import fuse_conv_bn_eval

import frames
import instances
from network import Segmenter

BATCH = 8
SIZE = (192, 256)  # rows, columns of a part that is trained on
CHECK_EVERY = 200
HELD_OUT = 10


def loss_of(maps, thing, known, bumps, way):
    of_thing = functional.binary_cross_entropy_with_logits(maps[:, 0], thing, reduction="none")
    of_thing = (of_thing * known).sum() / known.sum()
    of_centre = functional.binary_cross_entropy_with_logits(maps[:, 1], bumps, reduction="none")
    # What is nearly all background must not drown the bumps.
    of_centre = (of_centre * known * (0.1 + 10 * bumps)).sum() / (known * (0.1 + 10 * bumps)).sum()
    off = (maps[:, 2:] - way).abs().sum(dim=1) / 16
    of_way = (off * thing).sum() / thing.sum().clamp(min=1)
    return of_thing + of_centre + 0.3 * of_way


def held_out_scores(network, scenes):
    """Share of right pixels, and PQ of things, on the first and the last frame of each."""
    network.eval()
    right = pixels = 0
    quality = instances.Quality()
    with torch.no_grad():
        for scene in scenes:
            for frame in (scene[0], scene[-1]):
                ids = frame[2]
                maps = network(torch.from_numpy(frames.input_of(frame))[None])[0].numpy()
                maps = maps[:, :ids.shape[0], :ids.shape[1]]
                known = ids != 255
                right += ((maps[0] > 0) == (ids > 0))[known].sum()
                pixels += known.sum()
                quality.add(np.where(known, ids, 0), np.where(known, instances.of_maps(maps), 0))
    network.train()
    return right / max(pixels, 1), quality.pq()


def export(network, file):
    """Without the norms, which become part of the convolutions before them."""
    plain = copy.deepcopy(network).eval()
    for part in plain.modules():
        if isinstance(part, nn.Sequential) and len(part) == 3 and isinstance(part[1], nn.BatchNorm2d):
            part[0], part[1] = fuse_conv_bn_eval(part[0], part[1]), nn.Identity()
    torch.onnx.export(plain.to(memory_format=torch.contiguous_format), torch.zeros(1, 5, 192, 320), file,
                      input_names=["frame"], output_names=["maps"], opset_version=11)


class Data:
    """Sequences as they appear in the folder; every tenth is held out."""

    def __init__(self, folder):
        self.folder, self.seen, self.train, self.held_out = folder, set(), [], []

    def look(self):
        for path in sorted(self.folder.iterdir()):
            if path.name in self.seen or not (path / "sequence.json").exists():
                continue
            self.seen.add(path.name)
            (self.held_out if int(path.name) % HELD_OUT == 0 else self.train).append(frames.read_sequence(path))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=pathlib.Path, required=True)
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--minutes", type=float, default=600)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--rate", type=float, default=2e-3, help="of learning, at first; it falls to 0 along a cosine")
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    torch.manual_seed(options.seed)
    options.out.mkdir(parents=True, exist_ok=True)
    draw = np.random.default_rng(options.seed)
    network = Segmenter().to(memory_format=torch.channels_last)
    optimiser = torch.optim.AdamW(network.parameters(), lr=options.rate, weight_decay=1e-4)
    step, spent_s = 0, 0.0
    last = options.out / "last.pt"
    if last.exists():
        state = torch.load(last)
        network.load_state_dict(state["network"])
        optimiser.load_state_dict(state["optimiser"])
        step, spent_s = state["step"], state["spent_s"]
        draw = np.random.default_rng([options.seed, step])
    data = Data(options.data)
    total = 0.0
    began = time.process_time()

    def spent():
        return spent_s + time.process_time() - began

    while spent() < 60 * options.minutes:
        if step % CHECK_EVERY == 0:
            data.look()
        share = spent() / (60 * options.minutes)
        for group in optimiser.param_groups:
            group["lr"] = options.rate * min(1, (step + 1) / 100) * 0.5 * (1 + np.cos(np.pi * min(1, share)))
        examples = []
        for _ in range(BATCH):
            scene = data.train[draw.integers(len(data.train))]
            examples.append(frames.example_of(scene[draw.integers(len(scene))], *SIZE, draw))
        x, thing, known, bumps, way = (torch.from_numpy(np.stack(part)) for part in zip(*examples))
        optimiser.zero_grad()
        loss = loss_of(network(x.to(memory_format=torch.channels_last)), thing, known, bumps, way)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 5)
        optimiser.step()
        total += loss.item()
        step += 1
        if step % CHECK_EVERY == 0:
            right, pq = held_out_scores(network, data.held_out)
            line = f"{step},{spent() / 60:.1f},{total / CHECK_EVERY:.4f},{right:.4f},{pq:.4f},{len(data.train)}"
            with open(options.out / "curve.csv", "a") as curve:
                curve.write(line + "\n")
            print(line, flush=True)
            total = 0.0
            torch.save({"network": network.state_dict(), "optimiser": optimiser.state_dict(), "step": step,
                        "spent_s": spent()}, last)
            export(network, options.out / "segmenter.onnx")
    export(network, options.out / "segmenter.onnx")


if __name__ == "__main__":
    main()
