# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Training batches: correspondences from many scenes, drawn as a pure function of (seed, step).

Because a batch depends on nothing else, a resumed run sees the same data and worker processes may
prepare batches ahead in any order.
"""

from __future__ import annotations

import dataclasses
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Iterator

import numpy as np
import torch
from torch.utils.data import DataLoader, Dataset

from .features import SceneFeatures, ViewFeatures, load_features
from .scenes import NO_CHART, Scene
from .teacher import Targets, Teacher
from .warp_target import SUPERVISED_POINTS, true_warp

_MIN_SPACING_PX = 3.0
_CROP_MARGIN_PX = 12


@dataclass(frozen=True)
class BatchOptions:
    correspondences: int = 256   # pairs of keypoints in a batch
    per_pair: int = 48           # at most, from one pair of images
    min_per_pair: int = 8        # fewer and the pair is skipped (except to fill up the batch)
    radius_per_size: tuple[float, float] = (6.0, 14.0)  # log-uniform, one value a batch
    size_jitter: float = 0.0     # largest random error of keypoint sizes, octaves
    max_gamma_log: float = 0.35  # photometric augmentation: grey^exp(U(-g, g))
    crop_px: int = 0             # side of the windows for the backbone; 0 = no windows
    extra_keypoints: int = 0     # further keypoints a window, for the supervised warp only


@dataclass
class Batch:
    """N correspondences: keypoints 0..N-1 and N..2N-1 belong together; E extra ones follow."""

    images: np.ndarray                 # U8 [2P, H, W]
    gamma: np.ndarray                    # F32 [2P]
    index: np.ndarray                    # I64 [2N] image of each keypoint
    keypoints: np.ndarray                # F32 [2N, 4] x, y, size, angle
    surface: np.ndarray                  # I64 [N] equal for points of one chart of one scene
    texture: np.ndarray                  # I64 [N] equal where surfaces look alike
    radius_per_size: float
    windows: np.ndarray | None = None    # I64 [2P, 2] x, y of the backbone's windows
    extra_index: np.ndarray | None = None
    extra_keypoints: np.ndarray | None = None
    warp: np.ndarray | None = None       # F32 [2N + E, G, 2] true displacement in radii
    warp_known: np.ndarray | None = None  # bool [2N + E, G]
    theta: np.ndarray | None = None      # F32 [2N + E, 66, 2] the teacher's
    descriptors: np.ndarray | None = None  # F32 [2N, D] the teacher's


@dataclass
class _Draft:
    """The lists from which a batch is put together."""

    images: list = field(default_factory=list)
    windows: list = field(default_factory=list)
    sides: tuple[list, list] = field(default_factory=lambda: ([], []))
    warps: tuple[list, list] = field(default_factory=lambda: ([], []))
    extra: list = field(default_factory=list)
    targets: tuple[list, list] = field(default_factory=lambda: ([], []))
    extra_targets: list = field(default_factory=list)
    surfaces: list = field(default_factory=list)
    textures: list = field(default_factory=list)
    counts: list = field(default_factory=list)


class SceneSet:
    """All scenes of some folders with the pairs of views that have enough correspondences; with a
    teacher, what it says of their keypoints."""

    def __init__(self, directories: list[Path], min_pairs: int = 12, teacher: Teacher | None = None):
        self.scenes: list[Scene] = []
        self.features: list[SceneFeatures] = []
        self.usable: list[list[tuple[int, int]]] = []
        self.texture_ids: list[np.ndarray] = []  # of each scene's charts
        self.targets: list[list[Targets]] = []   # of each scene's views; empty without a teacher
        known: dict[str, int] = {}
        for path in (p for d in directories for p in sorted(Path(d).glob("scene_*.safetensors"))):
            scene = Scene(path)
            features = load_features(scene)
            usable = [key for key, rows in features.pairs.items() if len(rows) >= min_pairs]
            if usable:
                self.scenes.append(scene)
                self.features.append(features)
                self.usable.append(usable)
                names = [known.setdefault(name, len(known)) for name in scene.textures]
                self.texture_ids.append(np.array(names))
                if teacher is not None:
                    self.targets.append(teacher.targets(scene))
        if not self.scenes:
            raise ValueError(f"no usable scene_*.safetensors in {', '.join(map(str, directories))}")

    def __len__(self) -> int:
        return len(self.scenes)

    def describe(self) -> str:
        pairs = sum(map(len, self.usable))
        matches = sum(len(f.pairs[key]) for f, keys in zip(self.features, self.usable) for key in keys)
        return f"{len(self)} scenes, {pairs} view pairs, {matches} correspondences"


def _spaced(rng: np.random.Generator, xy_a: np.ndarray, xy_b: np.ndarray, count: int) -> list[int]:
    """Random rows such that no two lie within 3 px of each other in either image."""
    kept: list[int] = []
    for row in rng.permutation(len(xy_a)):
        if len(kept) == count:
            break
        near = ((((xy_a[kept] - xy_a[row]) ** 2).sum(1) < _MIN_SPACING_PX**2)
                | (((xy_b[kept] - xy_b[row]) ** 2).sum(1) < _MIN_SPACING_PX**2))
        if not near.any():
            kept.append(int(row))
    return kept


def _window(rng: np.random.Generator, xy: np.ndarray, shape: tuple[int, int], side: int) -> np.ndarray:
    """Corner of a window of the given side near the keypoints' median, inside the image."""
    height, width = shape
    if side > min(height, width):
        raise ValueError(f"crop_px {side} exceeds the images ({width}x{height})")
    centre = np.median(xy, 0) + rng.uniform(-side / 5, side / 5, 2)
    return np.clip(np.rint(centre - side / 2), 0, [width - side, height - side]).astype(np.int64)


def _inside(xy: np.ndarray, corner: np.ndarray, side: int) -> np.ndarray:
    local = xy - corner
    return ((local >= _CROP_MARGIN_PX) & (local <= side - 1 - _CROP_MARGIN_PX)).all(1)


def _add_pair(draft: _Draft, data: SceneSet, which: int, options: BatchOptions, radius: float,
              rng: np.random.Generator) -> None:
    scene, features = data.scenes[which], data.features[which]
    wanted = options.correspondences - sum(draft.counts)
    if draft.images and scene.images.shape[1:] != draft.images[0].shape:
        return  # images of a batch are of one size
    a, b = data.usable[which][rng.integers(len(data.usable[which]))]
    rows = features.pairs[a, b]
    if rng.random() < 0.5:
        a, b, rows = b, a, rows[:, ::-1]
    views = features.views[a], features.views[b]
    tables = [view.keypoints[rows[:, side]] for side, view in enumerate(views)]
    corners: list[np.ndarray] = []
    if options.crop_px:
        shape = scene.images.shape[1:]
        corners = [_window(rng, table[:, :2], shape, options.crop_px) for table in tables]
        usable = np.logical_and(*(_inside(t[:, :2], c, options.crop_px) for t, c in zip(tables, corners)))
        rows, tables = rows[usable], [table[usable] for table in tables]
    kept = _spaced(rng, tables[0][:, :2], tables[1][:, :2], min(options.per_pair, wanted))
    if len(kept) < min(options.min_per_pair, wanted):
        return
    for side, (number, view) in enumerate(((a, views[0]), (b, views[1]))):
        draft.images.append(scene.images[number])
        table = _jittered(tables[side][kept], options.size_jitter, rng)
        draft.sides[side].append(table)
        if data.targets:
            targets, own = data.targets[which][number], rows[kept, side]
            draft.targets[side].append((targets.theta[own], targets.descriptors[own]))
        if options.crop_px:
            draft.windows.append(corners[side])
            draft.warps[side].append(_supervision(scene, number, view, rows[kept, side], table, radius))
            more, extra = _extra(scene, number, view, corners[side], options, radius, rng)
            draft.extra.append(extra)
            if data.targets:
                draft.extra_targets.append(data.targets[which][number].theta[more])
    charts = views[0].points.chart[rows[kept, 0]].astype(np.int64)
    draft.surfaces.append(which * NO_CHART + charts)
    draft.textures.append(data.texture_ids[which][charts])
    draft.counts.append(len(kept))


def _jittered(keypoints: np.ndarray, octaves: float, rng: np.random.Generator) -> np.ndarray:
    if octaves == 0:
        return keypoints
    moved = keypoints.copy()
    moved[:, 2] *= np.exp2(rng.uniform(-octaves, octaves, len(moved)))
    return moved


def _supervision(scene: Scene, number: int, view: ViewFeatures, rows: np.ndarray,
                 keypoints: np.ndarray, radius: float):
    """True warps around keypoints `rows` of a view, whose sizes may differ from the detector's."""
    points = type(view.points)(view.points.chart[rows], view.points.uv[rows])
    return true_warp(scene, number, points, keypoints, radius)


def _extra(scene: Scene, number: int, view: ViewFeatures, corner: np.ndarray, options: BatchOptions,
           radius: float, rng: np.random.Generator):
    rows = np.flatnonzero(_inside(view.keypoints[:, :2], corner, options.crop_px))
    rows = rng.permutation(rows)[:options.extra_keypoints]
    table = _jittered(view.keypoints[rows], options.size_jitter, rng)
    return rows, (table, *_supervision(scene, number, view, rows, table, radius))


def draw_batch(data: SceneSet, options: BatchOptions, seed: int, step: int) -> Batch:
    """The batch of one step. Raises ValueError if the scenes cannot fill it."""
    rng = np.random.default_rng([seed, step])
    low, high = np.log(options.radius_per_size)
    radius = float(np.exp(rng.uniform(low, high)))
    draft = _Draft()
    for which in rng.permutation(len(data)):
        _add_pair(draft, data, int(which), options, radius, rng)
        if sum(draft.counts) >= options.correspondences:
            break
    if sum(draft.counts) < 2:
        raise ValueError("the scenes have too few correspondences for a batch")
    return _assemble(draft, options, radius, rng)


def _assemble(draft: _Draft, options: BatchOptions, radius: float, rng: np.random.Generator) -> Batch:
    counts = np.array(draft.counts)
    pair = np.repeat(np.arange(len(counts)), counts)
    batch = Batch(
        images=np.stack(draft.images),
        gamma=np.exp(rng.uniform(-1, 1, 2 * len(counts)) * options.max_gamma_log).astype(np.float32),
        index=np.concatenate([2 * pair, 2 * pair + 1]),
        keypoints=np.concatenate([*draft.sides[0], *draft.sides[1]]).astype(np.float32),
        surface=np.concatenate(draft.surfaces), texture=np.concatenate(draft.textures),
        radius_per_size=radius)
    if options.crop_px:
        batch.windows = np.stack(draft.windows)
        sizes = [len(table) for table, _, _ in draft.extra]
        batch.extra_index = np.repeat(np.arange(len(sizes)), sizes)
        batch.extra_keypoints = np.concatenate([table for table, _, _ in draft.extra]).astype(np.float32)
        supervised = [*draft.warps[0], *draft.warps[1], *(rest for _, *rest in draft.extra)]
        batch.warp = np.concatenate([warp for warp, _ in supervised])
        batch.warp_known = np.concatenate([known for _, known in supervised])
        assert batch.warp.shape[1] == len(SUPERVISED_POINTS)
    if draft.targets[0]:
        pairs = [*draft.targets[0], *draft.targets[1]]
        batch.theta = np.concatenate([*(theta for theta, _ in pairs), *draft.extra_targets]).astype(np.float32)
        batch.descriptors = np.concatenate([rows for _, rows in pairs]).astype(np.float32)
    return batch


def to_tensors(batch: Batch) -> Batch:
    """The same with tensors instead of arrays: they pass between processes through shared memory."""
    arrays = {name: torch.from_numpy(np.ascontiguousarray(value)) for name, value in vars(batch).items()
              if isinstance(value, np.ndarray)}
    return dataclasses.replace(batch, **arrays)


class _Steps(Dataset):
    """The batch of step i at i."""

    def __init__(self, data: SceneSet, options: BatchOptions, seed: int):
        self.data, self.options, self.seed = data, options, seed

    def __getitem__(self, step: int) -> Batch:
        return to_tensors(draw_batch(self.data, self.options, self.seed, step))


def _itself(batch: Batch) -> Batch:
    return batch


def batches(data: SceneSet, options: BatchOptions, seed: int, first_step: int,
            workers: int) -> Iterator[Batch]:
    """Yields the batches of first_step, first_step + 1, ... for ever, as tensors."""
    # A generator of its own: the loader draws from it, and the training's noise must not depend on that.
    loader = DataLoader(_Steps(data, options, seed), batch_size=None, sampler=range(first_step, sys.maxsize),
                        num_workers=workers, collate_fn=_itself, generator=torch.Generator(),
                        multiprocessing_context="fork" if workers > 0 else None)
    yield from loader
