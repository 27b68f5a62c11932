# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Writes the golden tensors that the C++ tests compare with.

    python3 -m descriptor.training.goldens --model descriptor/model/deal.safetensors --out tests/data

Everything is computed in double precision and stored as float32, so the file holds the true values
and not one implementation's rounding. Images are drawn procedurally. README.md lists the tensors.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np
import torch

from . import geometry, tensor_file
from .model import Deal, load_model

SIZES = ((75, 53), (163, 117))  # width, height: no multiples of 8 or 32
_DETAILED = 6                   # keypoints whose large per-stage tensors are stored


def draw_image(width: int, height: int, seed: int) -> np.ndarray:
    """[height, width] uint8: smooth shading, discs, bars and letters, a little noise."""
    rng = np.random.RandomState(seed)
    y, x = np.mgrid[0:height, 0:width]
    canvas = 128 + 50 * np.sin(x / 17.0 + rng.rand()) * np.cos(y / 11.0 + rng.rand())
    canvas = canvas.astype(np.uint8)
    point = lambda: (int(rng.randint(width)), int(rng.randint(height)))  # noqa: E731
    for _ in range(max(6, width * height // 900)):
        grey = int(rng.randint(256))
        kind = rng.randint(3)
        if kind == 0:
            cv2.circle(canvas, point(), int(rng.randint(2, 12)), grey, -1, cv2.LINE_AA)
        elif kind == 1:
            cv2.line(canvas, point(), point(), grey, int(rng.randint(1, 4)), cv2.LINE_AA)
        else:
            letter = chr(int(rng.randint(65, 91)))
            cv2.putText(canvas, letter, point(), cv2.FONT_HERSHEY_SIMPLEX, 0.7, grey, 2, cv2.LINE_AA)
    noisy = canvas + rng.normal(0, 3, canvas.shape)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def choose_keypoints(width: int, height: int, count: int, seed: int) -> np.ndarray:
    """[count, 3] float32 x, y, size: corners, borders, a tiny and a huge one, the rest anywhere."""
    rng = np.random.RandomState(seed)
    fixed = [(width / 2 + 0.25, height / 2 - 0.4, 3.1), (0, 0, 4.0), (width - 1, height - 1, 5.5),
             (width - 1.3, 2.6, 2.0), (1.5, height - 1.2, 30.0), (width / 3, height / 3, 1.0)]
    places = rng.rand(count - len(fixed), 3) * [width - 1, height - 1, 1]
    places[:, 2] = np.exp(rng.uniform(np.log(1.8), np.log(12), len(places)))
    return np.concatenate([np.array(fixed), places]).astype(np.float32)


@torch.no_grad()
def compute_stages(model: Deal, image: np.ndarray, keypoints: np.ndarray,
                   radius_per_size: float) -> dict[str, np.ndarray]:
    """Values after each stage of a model in double precision, by golden tensor name."""
    image = torch.from_numpy(image / 255.0)[None]
    points = torch.from_numpy(keypoints.astype(np.float64))
    index = torch.zeros(len(points), dtype=torch.long)
    maps = model.backbone(image)
    sampled = model.sample(maps, image.shape[1:], index, points)
    theta = model.localization(sampled)
    displacement = model.displacement(theta)
    radius = (points[:, 2] * radius_per_size)[:, None, None]
    warped = model.patches(image, index, points, radius_per_size, displacement)
    fixed = model.patches(image, index, points, radius_per_size)
    stages = {
        "backbone": maps[0],
        "sampled_features": sampled[:_DETAILED],
        "theta": theta,
        "displacement_in_radii": displacement[:_DETAILED],
        "displacement_px": (displacement * radius)[:_DETAILED],
        "patches": warped[:_DETAILED],
        "patches_fixed": fixed[:_DETAILED],
        "descriptors": model.hardnet(warped),
        "descriptors_fixed": model.hardnet(fixed),
    }
    arrays = {name: value.numpy().astype(np.float32) for name, value in stages.items()}
    return {"keypoints_x_y_size": keypoints, **arrays}


def write_goldens(model_path: Path, out: Path) -> list[Path]:
    """Writes golden_<W>x<H>.png and golden_<MODEL>_<W>x<H>.safetensors for each size, and golden_tps.safetensors."""
    model, metadata = load_model(model_path)
    model = model.double().eval()
    # The buffers came through float32: take the constants afresh.
    model.unit_grid = torch.from_numpy(geometry.unit_polar_grid(model.spacing))
    model.basis = torch.from_numpy(geometry.tps_basis(model.spacing))
    radius_per_size = float(metadata["radius_per_size"])
    common = {"model_sha256": tensor_file.sha256(model_path), "radius_per_size": radius_per_size}
    out.mkdir(parents=True, exist_ok=True)
    written = []
    for i, (width, height) in enumerate(SIZES):
        picture = out / f"golden_{width}x{height}.png"
        tensors = out / f"golden_{model_path.stem}_{width}x{height}.safetensors"
        image = draw_image(width, height, seed=11 + i)
        keypoints = choose_keypoints(width, height, count=12 + 8 * i, seed=23 + i)
        stages = compute_stages(model, image, keypoints, radius_per_size)
        if not cv2.imwrite(str(picture), image):
            raise OSError(f"cannot write {picture}")
        tensor_file.save(tensors, stages, {**common, "image": f"{picture.name}, grey, values / 255"})
        written += [picture, tensors]
    constants = {}
    for spacing in geometry.SPACINGS:
        constants[f"unit_polar_grid_{spacing}"] = geometry.unit_polar_grid(spacing).astype(np.float32)
        constants[f"tps_basis_{spacing}"] = geometry.tps_basis(spacing).astype(np.float32)
    tensor_file.save(out / "golden_tps.safetensors", constants,
                     {"displacement_gain": repr(geometry.displacement_gain())})
    return [*written, out / "golden_tps.safetensors"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--model", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    for path in write_goldens(arguments.model, arguments.out):
        print(f"{path}  {path.stat().st_size} bytes")


if __name__ == "__main__":
    main()
