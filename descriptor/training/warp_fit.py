# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Fits the localisation network on cached features of a frozen backbone: the warps of the ablation.

The backbone runs once over every image; after that a step of 512 keypoints costs a fifth of a
second on one core, a hundredth of a step through the backbone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from . import losses
from .features import load_features
from .model import Deal
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
def extract(directory: Path, model: Deal, radius_per_size: float, per_view: int, scenes: int,
            seed: int = 0) -> dict[str, np.ndarray]:
    """Sampled features (float16), true warps and their masks of keypoints of the first scenes' views."""
    rng = np.random.default_rng(seed)
    parts: dict[str, list[np.ndarray]] = {"features": [], "warp": [], "known": [], "scene": []}
    for number, path in enumerate(sorted(directory.glob("scene_*.safetensors"))[:scenes]):
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
    """An extracted table, split by scene into training and held-out rows."""

    def __init__(self, table: dict[str, np.ndarray], held_out: float):
        self.table = table
        # Every k-th scene is held out.
        out = table["scene"] % max(round(1 / held_out), 2) == 0
        self.training, self.held_out = np.flatnonzero(~out), np.flatnonzero(out)

    def take(self, rows: np.ndarray) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """features [N, 3200], warp [N, G, 2], known [N, G] of the rows, sorted."""
        rows = np.sort(rows)
        features, warp, known = (torch.from_numpy(self.table[key][rows]) for key in ("features", "warp", "known"))
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
