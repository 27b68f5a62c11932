# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Fits the localisation network on cached features of a frozen backbone: the warp for poor machines.

    python3 -m descriptor.training.warp_fit extract --scenes DIR --weights W --out features.safetensors
    python3 -m descriptor.training.warp_fit fit --features features.safetensors ... --weights W --out NEW

The backbone runs once over every image; after that a step of 512 keypoints costs a fifth of a
second on one core, a hundredth of a step through the backbone.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from . import losses, runtime, tensor_file
from .features import load_features
from .model import Deal, load_model, save_model
from .scenes import Scene, SurfacePoints
from .warp_target import SUPERVISED_POINTS, true_warp

_CLIP = 1.0


@dataclass(frozen=True)
class FitOptions:
    steps: int = 1500
    batch: int = 512
    learning_rate: float = 1e-3
    dropout: float = 0.2
    held_out: float = 0.1  # share of the scenes that measures R^2
    seed: int = 1


@torch.no_grad()
def extract(directory: Path, model: Deal, radius_per_size: float, per_view: int, first: int,
            last: int | None, seed: int = 0) -> dict[str, np.ndarray]:
    """Sampled features (float16), true warps and their masks of keypoints of the scenes' views."""
    rng = np.random.default_rng(seed)
    parts: dict[str, list[np.ndarray]] = {"features": [], "warp": [], "known": [], "scene": []}
    for number, path in enumerate(sorted(directory.glob("scene_*.safetensors"))[first:last], first):
        scene = Scene(path)
        found = load_features(scene)
        for view, table in enumerate(found.views):
            rows = rng.permutation(len(table.keypoints))[:per_view]
            if not len(rows):
                continue
            points = SurfacePoints(table.points.chart[rows], table.points.uv[rows])
            warp, known = true_warp(scene, view, points, table.keypoints[rows], radius_per_size)
            image = torch.from_numpy(scene.images[view].copy()).float()[None] / 255
            index = torch.zeros(len(rows), dtype=torch.long)
            sampled = model.features_at(image, index, torch.from_numpy(table.keypoints[rows]))
            parts["features"].append(sampled.half().numpy())
            parts["warp"].append(warp)
            parts["known"].append(known)
            parts["scene"].append(np.full(len(rows), number, np.int64))
    return {name: np.concatenate(arrays) for name, arrays in parts.items()}


class CachedFeatures:
    """Several extracted files as one table, split by scene into training and held-out rows."""

    def __init__(self, paths: list[Path], held_out: float):
        self.tables = [tensor_file.load(path)[0] for path in paths]
        training, rest = [], []
        for number, table in enumerate(self.tables):
            # Every k-th scene is held out.
            out = table["scene"] % max(round(1 / held_out), 2) == 0
            rows = np.arange(len(out))
            training += [np.stack([np.full((~out).sum(), number), rows[~out]], 1)]
            rest += [np.stack([np.full(out.sum(), number), rows[out]], 1)]
        self.training, self.held_out = np.concatenate(training), np.concatenate(rest)

    def take(self, rows: np.ndarray) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """features [N, 3200], warp [N, G, 2], known [N, G] of (table, row) pairs."""
        rows = rows[np.lexsort((rows[:, 1], rows[:, 0]))]
        parts = [[self.tables[n][key][rows[rows[:, 0] == n, 1]] for n in range(len(self.tables))]
                 for key in ("features", "warp", "known")]
        features, warp, known = (torch.from_numpy(np.concatenate(part)) for part in parts)
        return features.float(), warp, known


@torch.no_grad()
def held_out_r2(model: Deal, data: CachedFeatures, rows: np.ndarray, points: torch.Tensor) -> float:
    model.localization.eval()
    error = power = 0.0
    for start in range(0, len(rows), 1024):
        features, warp, known = data.take(rows[start:start + 1024])
        terms = losses.warp_r2_terms(model.displacement(model.localization(features), points), warp, known)
        error, power = error + terms[0].item(), power + terms[1].item()
    model.localization.train()
    return 1 - error / max(power, 1e-12)


def fit(model: Deal, data: CachedFeatures, options: FitOptions) -> float:
    """Trains model.localization; returns R^2 on the held-out scenes."""
    network = model.localization
    network.fc4.precondition()
    network.dropout = options.dropout
    points = torch.from_numpy(SUPERVISED_POINTS)
    optimizer = torch.optim.Adam(network.parameters(), lr=options.learning_rate)
    rng = np.random.default_rng(options.seed)
    torch.manual_seed(options.seed)
    held_out = rng.permutation(data.held_out)[:4096]
    network.train()
    for step in range(options.steps):
        cosine = 0.5 * (1 + math.cos(math.pi * step / options.steps))
        for group in optimizer.param_groups:
            group["lr"] = options.learning_rate * min(1.0, (step + 1) / 50) * (0.02 + 0.98 * cosine)
        features, warp, known = data.take(data.training[rng.integers(len(data.training), size=options.batch)])
        predicted = model.displacement(network(features), points)
        loss = losses.warp_loss(predicted, warp, known)
        optimizer.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), _CLIP)
        optimizer.step()
        if (step + 1) % 100 == 0:
            error, power = losses.warp_r2_terms(predicted.detach(), warp, known)
            r2 = held_out_r2(model, data, held_out[:1024], points)
            print(f"step {step + 1} loss {loss.item():.5f} R2 batch {1 - error / power:.4f} "
                  f"held out {r2:.4f}", flush=True)
    final = held_out_r2(model, data, held_out, points)
    model.eval()
    return final


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    one = commands.add_parser("extract")
    one.add_argument("--scenes", type=Path, required=True)
    one.add_argument("--per-view", type=int, default=100)
    one.add_argument("--first", type=int, default=0)
    one.add_argument("--last", type=int)
    two = commands.add_parser("fit")
    two.add_argument("--features", type=Path, nargs="+", required=True)
    two.add_argument("--steps", type=int, default=FitOptions.steps)
    two.add_argument("--dropout", type=float, default=FitOptions.dropout)
    two.add_argument("--learning-rate", type=float, default=FitOptions.learning_rate)
    two.add_argument("--fresh", action="store_true", help="start the localisation network at the identity")
    for command in (one, two):
        command.add_argument("--weights", type=Path, required=True)
        command.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    runtime.configure(1)
    model, metadata = load_model(arguments.weights)
    if arguments.command == "extract":
        tensors = extract(arguments.scenes, model, float(metadata["radius_per_size"]), arguments.per_view,
                          arguments.first, arguments.last)
        tensor_file.save(arguments.out, tensors, {"weights": tensor_file.sha256(arguments.weights)})
        print(f"{len(tensors['scene'])} keypoints")
        return
    options = FitOptions(steps=arguments.steps, dropout=arguments.dropout, learning_rate=arguments.learning_rate)
    if arguments.fresh:
        model.localization = Deal().localization
    r2 = fit(model, CachedFeatures(arguments.features, options.held_out), options)
    kept = {key: value for key, value in metadata.items() if key != "format"}
    save_model(arguments.out, model, {**kept, "warp_r2": f"{r2:.4f}"})
    print(f"held-out R2 {r2:.4f}")


if __name__ == "__main__":
    main()
