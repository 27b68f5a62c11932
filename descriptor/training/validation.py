# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Matching score and accuracy on development scenes (3 px, nearest neighbour, shared keypoints).

G: one-to-one true pairs of keypoints within 3 px, nearest first. A match of i is its nearest
neighbour over all keypoints on the surfaces of the second image; it is correct within 3 px.
    MS = correct / min(n1, n2)    MMA = correct among G / G    precision = correct mutual / mutual
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Callable

import numpy as np
import torch

from .features import detect
from .model import Deal
from .scenes import NO_CHART, Scene

TOLERANCE_PX = 3.0
_VISIBLE_PX = 4.0
_MIN_TRUE_PAIRS = 12


@dataclass(frozen=True)
class MatchingPair:
    images: tuple[np.ndarray, np.ndarray]
    keypoints: tuple[np.ndarray, np.ndarray]  # [n, 6], on the surfaces only
    distance: np.ndarray                      # [n1, n2] px from the true position, inf if hidden
    partners: np.ndarray                      # [G, 2]
    name: str


Describe = Callable[[np.ndarray, np.ndarray], np.ndarray]  # (image, keypoints [n, 6]) -> [n, D]


def one_to_one(distance: np.ndarray, tolerance_px: float) -> np.ndarray:
    """[G, 2] pairs within the tolerance, nearest first, each row and column used once."""
    rows, columns = np.nonzero(distance <= tolerance_px)
    order = np.argsort(distance[rows, columns], kind="stable")
    used_rows, used_columns, kept = set(), set(), []
    for row, column in zip(rows[order].tolist(), columns[order].tolist()):
        if row not in used_rows and column not in used_columns:
            used_rows.add(row)
            used_columns.add(column)
            kept.append((row, column))
    return np.array(kept, np.int64).reshape(-1, 2)


def matching_pair(scene: Scene, a: int, b: int, max_keypoints: int) -> MatchingPair:
    tables, located = [], []
    for view in (a, b):
        table = detect(scene.images[view], max_keypoints)
        points = scene.locate(view, table[:, :2])
        on = points.chart != NO_CHART
        tables.append(table[on])
        located.append(type(points)(points.chart[on], points.uv[on]))
    truth = scene.project(b, located[0])
    hidden = ~scene.visible(b, located[0], truth, _VISIBLE_PX)
    distance = np.linalg.norm(truth[:, None] - tables[1][None, :, :2], axis=2)
    distance[hidden] = np.inf
    distance = np.nan_to_num(distance, nan=np.inf, posinf=np.inf)
    return MatchingPair((scene.images[a], scene.images[b]), (tables[0], tables[1]), distance,
                        one_to_one(distance, TOLERANCE_PX), f"{scene.path.stem}:{a}-{b}")


def development_pairs(directory: Path, count: int, max_keypoints: int, seed: int = 0) -> list[MatchingPair]:
    """Seeded random view pairs, at most a few a scene, with at least 12 true pairs each."""
    rng = np.random.default_rng(seed)
    paths = sorted(Path(directory).glob("scene_*.safetensors"))
    if not paths:
        raise ValueError(f"no scene_*.safetensors in {directory}")
    pairs: list[MatchingPair] = []
    for _ in range(4):  # rounds over the scenes
        for path in (paths[i] for i in rng.permutation(len(paths))):
            if len(pairs) == count:
                return pairs
            scene = Scene(path)
            a, b = rng.choice(scene.views, 2, replace=False)
            pair = matching_pair(scene, int(a), int(b), max_keypoints)
            if len(pair.partners) >= _MIN_TRUE_PAIRS:
                pairs.append(pair)
    return pairs


def score(pair: MatchingPair, a: np.ndarray, b: np.ndarray) -> dict[str, float]:
    """Figures of one pair from its descriptors (Euclidean)."""
    squared = (a**2).sum(1)[:, None] + (b**2).sum(1)[None] - 2 * a @ b.T
    nearest, back = squared.argmin(1), squared.argmin(0)
    here = np.arange(len(a))
    correct = pair.distance[here, nearest] <= TOLERANCE_PX
    mutual = back[nearest] == here
    return {"ms": min(1.0, correct.sum() / min(squared.shape)),
            "mma": correct[pair.partners[:, 0]].mean(),
            "precision": (correct & mutual).sum() / max(mutual.sum(), 1)}


def evaluate(describe: Describe, pairs: list[MatchingPair]) -> dict[str, float]:
    """Means over the pairs."""
    rows = [score(pair, *(describe(image, table) for image, table in zip(pair.images, pair.keypoints)))
            for pair in pairs]
    return {key: float(np.mean([row[key] for row in rows])) for key in rows[0]}


def sift_describer(root: bool) -> Describe:
    import cv2  # only here: a bare training machine validates without the baselines

    def describe(image: np.ndarray, table: np.ndarray) -> np.ndarray:
        keypoints = [cv2.KeyPoint(*map(float, row[:5]), int(row[5])) for row in table]
        kept, descriptors = cv2.SIFT_create().compute(image, keypoints)
        if len(kept) != len(table):
            raise RuntimeError(f"SIFT described {len(kept)} of {len(table)} keypoints")
        if root:
            return np.sqrt(descriptors / np.maximum(descriptors.sum(1, keepdims=True), 1e-6))
        return descriptors
    return describe


def deal_describer(model: Deal, radius_per_size: float, warp: bool, device: torch.device) -> Describe:
    """Descriptors of a model in evaluation mode; its training modes are restored after each call."""
    def describe(image: np.ndarray, table: np.ndarray) -> np.ndarray:
        modes = [(module, module.training) for module in model.modules()]
        model.eval()
        grey = torch.from_numpy(np.array(image)).to(device).float().div_(255)
        _, rows = model.describe(grey, torch.from_numpy(table[:, :4].copy()).to(device), radius_per_size, warp)
        for module, mode in modes:
            module.training = mode
        return rows.cpu().numpy()
    return describe
