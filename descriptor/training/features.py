# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""SIFT keypoints and correspondences of a scene, cached beside the scene file.

    python3 -m descriptor.training.features DIR --jobs 2

Keypoints are detected independently in every view. A correspondence is a pair of keypoints
within 3 px of the true position whose sizes agree with the local scale of the surface within an octave.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np

from . import dog, tensor_file
from .scenes import NO_CHART, Scene, SurfacePoints

try:
    import cv2
except ImportError:  # a bare training machine
    cv2 = None

CACHE_VERSION = "6"
MAX_KEYPOINTS = 1024
POSITION_TOLERANCE_PX = 3.0
_LOW_CONTRAST = 0.02  # threshold of contrast in training: the service's (descriptor/features/keypoints.h)
SCALE_TOLERANCE_LOG2 = 1.0  # beyond, two different things share a place


@dataclass(frozen=True)
class ViewFeatures:
    """Keypoints on the surfaces of one view, strongest first, and where they lie."""

    keypoints: np.ndarray  # [N, 4] x, y, size, angle in degrees (-1: the detector gives none)
    points: SurfacePoints


@dataclass(frozen=True)
class SceneFeatures:
    views: list[ViewFeatures]
    pairs: dict[tuple[int, int], np.ndarray]  # (a, b), a < b -> [M, 2] rows of the two views


def detect(image: np.ndarray, count: int = MAX_KEYPOINTS, one_per_place: bool = True,
           contrast: float = dog.CONTRAST) -> np.ndarray:
    """[N, 6] x, y, size, angle, response, octave; response descending, then y, x, size, angle.

    With one_per_place, repeats of a keypoint with another orientation are dropped. Without OpenCV
    there are no orientations (angle -1) and no octaves.
    """
    if cv2 is None:
        rows = [[x, y, size, -1, response, 0] for x, y, size, response in dog.detect(image, contrast)]
    else:
        found = cv2.SIFT_create(2 * count, contrastThreshold=contrast).detect(image, None)
        rows = [[k.pt[0], k.pt[1], k.size, k.angle, k.response, k.octave] for k in found]
    table = np.array(rows, np.float32).reshape(-1, 6)
    order = np.lexsort((table[:, 3], table[:, 2], table[:, 0], table[:, 1], -table[:, 4]))
    table = table[order]
    if one_per_place and len(table):
        _, first = np.unique(table[:, :3], axis=0, return_index=True)
        table = table[np.sort(first)]
    return table[:count]


def corresponding(scene: Scene, a: int, b: int, features: list[ViewFeatures],
                  tolerance_px: float = POSITION_TOLERANCE_PX) -> np.ndarray:
    """[M, 2] mutually nearest keypoints of views a and b, by position and scale."""
    first, second = features[a], features[b]
    if not len(first.keypoints) or not len(second.keypoints):
        return np.zeros((0, 2), np.int32)
    truth = scene.project(b, first.points)
    area_a = np.linalg.det(scene.jacobian(a, first.points))
    area_b = np.linalg.det(scene.jacobian(b, first.points))
    with np.errstate(invalid="ignore"):
        usable = (scene.visible(b, first.points, truth, tolerance_px) & (area_a * area_b > 0)
                  & (np.minimum(abs(area_a), abs(area_b)) > 1e-9))
    rows = np.flatnonzero(usable)
    if not len(rows):
        return np.zeros((0, 2), np.int32)
    growth = 0.5 * np.log2(area_b[rows] / area_a[rows])
    distance = np.linalg.norm(truth[rows, None] - second.keypoints[None, :, :2], axis=2)
    sizes = np.log2(second.keypoints[None, :, 2] / first.keypoints[rows, None, 2])
    mismatch = np.abs(sizes - growth[:, None])
    cost = distance / tolerance_px + mismatch / SCALE_TOLERANCE_LOG2
    cost[(distance > tolerance_px) | (mismatch > SCALE_TOLERANCE_LOG2)] = np.inf
    best, best_back = cost.argmin(1), cost.argmin(0)
    here = np.arange(len(rows))
    mutual = np.isfinite(cost[here, best]) & (best_back[best] == here)
    return np.stack([rows[mutual], best[mutual]], 1).astype(np.int32)


def compute(scene: Scene) -> SceneFeatures:
    views = []
    for view in range(scene.views):
        table = detect(scene.images[view], contrast=_LOW_CONTRAST)[:, :4]
        points = scene.locate(view, table[:, :2])
        on = points.chart != NO_CHART
        views.append(ViewFeatures(table[on], SurfacePoints(points.chart[on], points.uv[on])))
    pairs = {(a, b): corresponding(scene, a, b, views) for a, b in combinations(range(scene.views), 2)}
    return SceneFeatures(views, pairs)


def cache_path(scene_path: Path) -> Path:
    return scene_path.with_suffix(".features")


def load_features(scene: Scene) -> SceneFeatures:
    """From the cache if it is of this version and of this scene file, else computed (and cached)."""
    path = cache_path(scene.path)
    stamp = {"version": CACHE_VERSION, "scene_bytes": str(scene.path.stat().st_size)}
    if path.exists():
        tensors, metadata = tensor_file.load(path)
        if metadata == stamp:
            views = [ViewFeatures(tensors[f"keypoints{v}"], SurfacePoints(tensors[f"chart{v}"], tensors[f"uv{v}"]))
                     for v in range(scene.views)]
            pairs = {(a, b): tensors[f"pair{a}_{b}"] for a, b in combinations(range(scene.views), 2)}
            return SceneFeatures(views, pairs)
    features = compute(scene)
    tensors = {f"pair{a}_{b}": rows for (a, b), rows in features.pairs.items()}
    for v, view in enumerate(features.views):
        tensors |= {f"keypoints{v}": view.keypoints, f"chart{v}": view.points.chart, f"uv{v}": view.points.uv}
    tensor_file.save(path, tensors, stamp)
    return features


def _prepare(path: Path) -> int:
    if cv2 is not None:
        cv2.setNumThreads(1)
    return sum(len(rows) for rows in load_features(Scene(path)).pairs.values())


def prepare(directory: Path, jobs: int) -> tuple[int, int]:
    """Fills the caches of a folder; returns (scenes, correspondences)."""
    paths = sorted(directory.glob("scene_*.safetensors"))
    with ProcessPoolExecutor(jobs) as pool:
        counts = list(pool.map(_prepare, paths, chunksize=4))
    return len(paths), sum(counts)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("directory", type=Path)
    parser.add_argument("--jobs", type=int, default=1)
    arguments = parser.parse_args()
    scenes, correspondences = prepare(arguments.directory, arguments.jobs)
    print(f"{scenes} scenes, {correspondences} correspondences")


if __name__ == "__main__":
    main()
