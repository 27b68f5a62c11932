#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Times the plain PyTorch model and the C++ network in turn on the same machine and prints both.

    python3 tests/bench/compare_pytorch.py --bench build/release/bin/bench_deal

One 640 x 480 image, SIFT detection not counted. Both sides run once before timing starts; then
they alternate, round by round, so that what else the machine does meets both. Needs PyTorch.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import torch

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))
from descriptor.training.model import load_model  # noqa: E402

WIDTH, HEIGHT = 640, 480


def scene(count: int) -> tuple[torch.Tensor, torch.Tensor]:
    rng = np.random.RandomState(1)
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    image = 128 + 90 * np.sin(x / 9) * np.cos(y / 7) + rng.randint(0, 30, x.shape)
    points = np.stack([rng.rand(count) * (WIDTH - 1), rng.rand(count) * (HEIGHT - 1),
                       rng.uniform(2, 12, count)], 1)
    as_tensor = lambda a: torch.from_numpy(a.astype(np.float32))  # noqa: E731
    return as_tensor(image.clip(0, 255) / 255)[None], as_tensor(points)


@torch.no_grad()
def pytorch_seconds(model: torch.nn.Module, radius: float, count: int) -> float:
    image, points = scene(count)
    index = torch.zeros(count, dtype=torch.long)
    start = time.perf_counter()
    model(image, index, points, radius)
    return time.perf_counter() - start


def cpp_seconds(bench: Path, count: int, threads: int, rounds: int) -> list[float]:
    command = [str(bench), "--json", str(count), str(threads), str(rounds)]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--bench", type=Path, default=ROOT / "build/release/bin/bench_deal")
    parser.add_argument("--model", type=Path, default=ROOT / "descriptor/model/deal.safetensors")
    parser.add_argument("--keypoints", type=int, nargs="+", default=[256, 1024, 2048])
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    model, metadata = load_model(arguments.model)
    radius = float(metadata["radius_per_size"])
    print(f"describe {WIDTH}x{HEIGHT}, {arguments.threads} threads, best (median) of "
          f"{arguments.rounds} alternating rounds")
    print(f"{'keypoints':>10} {'PyTorch s':>18} {'Pliant s':>18} {'ratio of best':>14}")
    for count in arguments.keypoints:
        pytorch_seconds(model, radius, count)
        plain, ours = [], []
        for _ in range(arguments.rounds):
            plain.append(pytorch_seconds(model, radius, count))
            ours += cpp_seconds(arguments.bench, count, arguments.threads, 1)
        cell = lambda s: f"{min(s):8.3f} ({np.median(s):.3f})"  # noqa: E731
        print(f"{count:>10} {cell(plain):>18} {cell(ours):>18} {min(plain) / min(ours):>13.1f}x",
              flush=True)


if __name__ == "__main__":
    main()
