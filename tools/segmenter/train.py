#!/usr/bin/python3
"""Trains the network of network.py on what make_data.py rendered, and writes it as ONNX.

    /usr/bin/python3 tools/segmenter/train.py --data out/segmenter/data --out out/segmenter/run [--minutes 600] [--seed 1]
        [--device cpu|cuda] [--batch 8] [--threads 2]

Needs Debian's python3-torch and python3-opencv. `--device cuda` trains where PyTorch finds a GPU. OUT gets last.pt (from which
it goes on), curve.csv (steps, minutes, loss; of every 10th scene, which is not trained on, the share of pixels that are a
thing's or not as they should be, and the panoptic quality of things; scenes that are) and segmenter.onnx; after training on a
GPU, whose PyTorch may write another ONNX than OpenCV reads, by `--export-only` with Debian's. Scenes that come into the folder
meanwhile are taken.
"""
import argparse
import copy
import multiprocessing
import pathlib
import queue
import time

import numpy as np
import torch
from torch import nn
from torch.nn import functional
from torch.nn.utils.fusion import fuse_conv_bn_eval

import frames
import instances
from network import Segmenter

SIZE = (240, 320)  # rows, columns of what is trained on
CHECKS = 10        # of the network, in all
HELD_OUT = 10
MOST_CHECKED = 24  # scenes that are held out


def loss_of(maps, thing, weight, bumps, way, way_weight):
    of_thing = functional.binary_cross_entropy_with_logits(maps[:, 0], thing, reduction="none")
    of_thing = (of_thing * weight).sum() / weight.sum()
    of_centre = functional.binary_cross_entropy_with_logits(maps[:, 1], bumps, reduction="none")
    # What is nearly all background must not drown the bumps.
    of_bumps = (weight > 0) * (0.1 + 10 * bumps)
    of_centre = (of_centre * of_bumps).sum() / of_bumps.sum()
    off = (maps[:, 2:] - way).abs().sum(dim=1) / 16
    of_way = (off * way_weight).sum() / way_weight.sum().clamp(min=1)
    return of_thing + of_centre + 0.3 * of_way


def held_out_scores(network, scenes, device):
    """Share of right pixels, and PQ of things, on the first and the last frame of each."""
    network.eval()
    right = pixels = 0
    quality = instances.Quality()
    with torch.no_grad():
        for scene in scenes[:MOST_CHECKED]:
            for frame in (scene[0], scene[-1]):
                ids = frame[2]
                maps = network(torch.from_numpy(frames.input_of(frame))[None].to(device))[0].cpu().numpy()
                maps = maps[:, :ids.shape[0], :ids.shape[1]]
                known = ids != frames.UNKNOWN
                right += ((maps[0] > 0) == (ids > 0))[known].sum()
                pixels += known.sum()
                quality.add(np.where(known, ids, 0), np.where(known, instances.of_maps(maps), 0))
    network.train()
    return right / max(pixels, 1), quality.pq()


def export(network, file):
    """Without the norms, which become part of the convolutions before them."""
    plain = copy.deepcopy(network).cpu().eval()
    for part in plain.modules():
        if isinstance(part, nn.Sequential) and len(part) == 3 and isinstance(part[1], nn.BatchNorm2d):
            part[0], part[1] = fuse_conv_bn_eval(part[0], part[1]), nn.Identity()
    torch.onnx.export(plain.to(memory_format=torch.contiguous_format), torch.zeros(1, 5, 192, 320), file,
                      input_names=["frame"], output_names=["maps"], opset_version=11)


def read_for_ever(folder, read, place, readers):
    """Every so-many-th of the folder's sequences, as they appear."""
    seen = set()
    while True:
        for path in sorted(folder.iterdir()):
            is_here = path.name.isdigit() and int(path.name) // HELD_OUT % readers == place
            if is_here and path.name not in seen and (path / "sequence.json").exists():
                seen.add(path.name)
                read.put((int(path.name), frames.read_sequence(path)))
        time.sleep(1)


class Data:
    """Sequences as they appear in the folder, read by processes of their own; every tenth is held out."""

    def __init__(self, folder, most, device, readers):
        self.read = multiprocessing.Queue(maxsize=32)
        # Before a GPU is looked at: what has one cannot be forked.
        for place in range(readers):
            multiprocessing.Process(target=read_for_ever, args=(folder, self.read, place, readers), daemon=True).start()
        self.store = frames.Store(most, *SIZE, device)
        self.scenes, self.held_out = 0, []

    def take(self, at_least=0):
        """What was read by now; waits where there are fewer scenes than `at_least`."""
        while True:
            try:
                number, sequence = self.read.get(block=self.scenes < at_least and not self.store.is_full())
            except queue.Empty:
                return
            if number % HELD_OUT == 0:
                if len(self.held_out) < MOST_CHECKED:
                    self.held_out.append(sequence)
            elif not self.store.is_full():
                self.store.add(sequence)
                self.scenes += 1


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=pathlib.Path, required=True)
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--minutes", type=float, default=600)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--batch", type=int, default=8)
    parser.add_argument("--most-frames", type=int, default=12000, help="that are kept; further scenes are left out")
    parser.add_argument("--readers", type=int, default=1, help="processes that read scenes")
    parser.add_argument("--wait-for", type=int, default=20, help="scenes to begin with")
    parser.add_argument("--export-only", action="store_true", help="write segmenter.onnx of last.pt")
    parser.add_argument("--start", type=pathlib.Path, help="last.pt of an earlier run, whose network this one begins with")
    parser.add_argument("--rate", type=float, default=2e-3, help="of learning, at first; it falls to 0 along a cosine")
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    torch.backends.cudnn.benchmark = True
    options.out.mkdir(parents=True, exist_ok=True)
    draw = np.random.default_rng(options.seed)
    on_gpu = options.device != "cpu"
    data = None if options.export_only else Data(options.data, options.most_frames, options.device, options.readers)
    torch.manual_seed(options.seed)
    network = Segmenter().to(options.device, memory_format=torch.channels_last)
    optimiser = torch.optim.AdamW(network.parameters(), lr=options.rate, weight_decay=1e-4)
    step, spent_s = 0, 0.0
    last = options.out / "last.pt"
    if last.exists():
        state = torch.load(last, map_location=options.device)
        network.load_state_dict(state["network"])
        optimiser.load_state_dict(state["optimiser"])
        step, spent_s = state["step"], state["spent_s"]
        draw = np.random.default_rng([options.seed, step])
        torch.manual_seed(options.seed + step)
    elif options.start:
        network.load_state_dict(torch.load(options.start, map_location=options.device)["network"])
    elif options.export_only:
        parser.error(f"--export-only: there is no {last}")
    if options.export_only:
        export(network, options.out / "segmenter.onnx")
        return
    began = time.monotonic()
    print(f"waits for {options.wait_for} scenes in {options.data}", flush=True)
    data.take(options.wait_for)
    total, since = torch.zeros((), device=options.device), 0
    length_s = 60 * options.minutes
    next_check_s = length_s / CHECKS

    def spent():
        return spent_s + time.monotonic() - began

    while spent_s > next_check_s:
        next_check_s += length_s / CHECKS
    while True:
        if step % 20 == 0:
            data.take()
        now_s = spent()
        share = min(1.0, now_s / length_s)
        if since > 0 and (now_s >= next_check_s or share == 1):
            next_check_s += length_s / CHECKS
            right, pq = held_out_scores(network, data.held_out, options.device)
            line = f"{step},{now_s / 60:.1f},{total.item() / since:.4f},{right:.4f},{pq:.4f},{data.scenes}"
            with open(options.out / "curve.csv", "a") as curve:
                curve.write(line + "\n")
            print(line, flush=True)
            total, since = torch.zeros((), device=options.device), 0
            torch.save({"network": network.state_dict(), "optimiser": optimiser.state_dict(), "step": step,
                        "spent_s": float(spent())}, options.out / "next.pt")
            (options.out / "next.pt").replace(last)
            if share == 1:
                break
        for group in optimiser.param_groups:
            # A number of Python's own: newer PyTorch reads no other from a file.
            group["lr"] = float(options.rate * min(1, (step + 1) / 100) * 0.5 * (1 + np.cos(np.pi * share)))
        numbers = torch.from_numpy(draw.integers(data.store.count, size=options.batch)).to(options.device)
        x, *targets = frames.examples_of(data.store, numbers, *SIZE)
        optimiser.zero_grad(set_to_none=True)
        with torch.autocast("cuda" if on_gpu else "cpu", dtype=torch.bfloat16, enabled=on_gpu):
            maps = network(x.to(memory_format=torch.channels_last))
        loss = loss_of(maps.float(), *targets)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 5)
        optimiser.step()
        total += loss.detach()
        since += 1
        step += 1
    if not on_gpu:
        export(network, options.out / "segmenter.onnx")


if __name__ == "__main__":
    main()
