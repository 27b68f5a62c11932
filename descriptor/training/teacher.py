# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""The warps and descriptors that a teacher gives a scene's keypoints, cached beside the scene file.

    python3 -m descriptor.training.teacher DIR --weights descriptor/model/deal.safetensors --jobs 2

A smaller network is distilled from them (stage "distill"): it sees the same keypoints under other
light, noise and errors of size, and is to give what the teacher gives without any of these, averaged
over three support radii.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from . import runtime, tensor_file
from .features import load_features
from .model import POOLED_SUPPORTS, load_model
from .scenes import Scene


@dataclass(frozen=True)
class Targets:
    """Of the keypoints of one view, float16."""

    theta: np.ndarray        # [N, 66, 2]
    descriptors: np.ndarray  # [N, 128]


class Teacher:
    """Weights that describe scenes. Raises TensorFileError if the file is none of a network."""

    def __init__(self, weights: Path, device: torch.device = torch.device("cpu")):
        self.model, metadata = load_model(weights)
        self.device, self.model = device, self.model.to(device)
        self.radius_per_size = float(metadata["radius_per_size"])
        self.sha256 = tensor_file.sha256(weights)

    def describe(self, image: np.ndarray, keypoints: np.ndarray) -> Targets:
        grey = torch.from_numpy(np.array(image)).to(self.device).float().div_(255)
        theta, rows = self.model.describe(grey, torch.from_numpy(np.array(keypoints)).to(self.device),
                                          self.radius_per_size, supports=POOLED_SUPPORTS)
        return Targets(theta.half().cpu().numpy(), rows.half().cpu().numpy())

    def targets(self, scene: Scene) -> list[Targets]:
        """Of each view; from the cache if it is of these weights and this scene file, else computed (and cached)."""
        path = scene.path.with_suffix(".teacher")
        stamp = {"weights": self.sha256, "supports": str(POOLED_SUPPORTS), "scene_bytes": str(scene.path.stat().st_size)}
        if path.exists():
            tensors, metadata = tensor_file.load(path)
            if metadata == stamp:
                return [Targets(tensors[f"theta{v}"], tensors[f"descriptors{v}"]) for v in range(scene.views)]
        found = load_features(scene)
        views = [self.describe(scene.images[v], view.keypoints) for v, view in enumerate(found.views)]
        tensors = {f"theta{v}": view.theta for v, view in enumerate(views)}
        tensors |= {f"descriptors{v}": view.descriptors for v, view in enumerate(views)}
        tensor_file.save(path, tensors, stamp)
        return views


def shared_components(descriptors: np.ndarray, dim: int) -> np.ndarray:
    """[D, dim] with orthonormal columns: what `dim` components keep most of the descriptors [N, D] (PCA around 0).

    The components are mixed such that all have the same variance, as a Hadamard matrix mixes them: batch normalisation
    changes nothing then, and few bits a component keep as much of each. Dim is a power of two.
    """
    _, directions = np.linalg.eigh(descriptors.T @ descriptors)
    directions = directions[:, ::-1][:, :dim]
    largest = np.take_along_axis(directions, np.abs(directions).argmax(0)[None], 0)
    mix = np.ones((1, 1))
    while len(mix) < dim:
        mix = np.block([[mix, mix], [mix, -mix]]) / np.sqrt(2)
    return directions * np.sign(largest) @ mix


def _prepare(path: Path, weights: Path) -> int:
    runtime.configure(1)
    return sum(len(view.descriptors) for view in Teacher(weights).targets(Scene(path)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("directory", type=Path)
    parser.add_argument("--weights", type=Path, required=True)
    parser.add_argument("--jobs", type=int, default=1)
    arguments = parser.parse_args()
    paths = sorted(arguments.directory.glob("scene_*.safetensors"))
    with ProcessPoolExecutor(arguments.jobs) as pool:
        counts = list(pool.map(_prepare, paths, [arguments.weights] * len(paths)))
    print(f"{len(paths)} scenes, {sum(counts)} keypoints")


if __name__ == "__main__":
    main()
