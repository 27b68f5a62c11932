# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Small scene files with known geometry: a textured plane seen through homographies."""

import json
import tempfile
from pathlib import Path

import cv2
import numpy as np

from descriptor.training import tensor_file
from descriptor.training.goldens import draw_image

SIZE = 160
GRID = 9


def homographies(rng, views):
    """View 0 is the plane scaled into the image; the others rotate, scale and tilt it."""
    matrices = []
    for view in range(views):
        angle = rng.uniform(-0.5, 0.5) if view else 0.0
        scale = rng.uniform(0.75, 0.9) if view else 0.85
        c, s = np.cos(angle) * scale * SIZE, np.sin(angle) * scale * SIZE
        matrix = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
        if view:
            matrix[2, :2] = rng.uniform(-0.15, 0.15, 2)
        centre = matrix @ [0.5, 0.5, 1]
        shift = np.eye(3)
        shift[:2, 2] = SIZE / 2 - centre[:2] / centre[2]
        matrices.append(shift @ matrix)
    return matrices


def apply(matrix, points):
    homogeneous = np.concatenate([points, np.ones((*points.shape[:-1], 1))], -1) @ matrix.T
    return homogeneous[..., :2] / homogeneous[..., 2:]


def write_scene(path, seed, views=3):
    """Returns the homographies from uv to pixels."""
    rng = np.random.default_rng(seed)
    texture = draw_image(2 * SIZE, 2 * SIZE, seed)
    matrices = homographies(rng, views)
    ramp = np.linspace(0, 1, GRID)
    vertices = np.stack(np.meshgrid(ramp, ramp), -1)
    pixels = np.stack(np.meshgrid(np.arange(SIZE), np.arange(SIZE)), -1).astype(np.float64)
    images, charts, uvs, grids = [], [], [], []
    for matrix in matrices:
        uv = apply(np.linalg.inv(matrix), pixels)
        inside = ((uv >= 0) & (uv <= 1)).all(-1)
        map_xy = (uv * (2 * SIZE - 1)).astype(np.float32)
        image = cv2.remap(texture, map_xy[..., 0], map_xy[..., 1], cv2.INTER_LINEAR)
        images.append(np.where(inside, image, 90).astype(np.uint8))
        charts.append(np.where(inside, 0, 255).astype(np.uint8))
        uvs.append(np.rint(np.clip(uv, 0, 1) * 65535).astype(np.uint16))
        grids.append(apply(matrix, vertices)[None].astype(np.float32))
    tensor_file.save(path, {
        "images": np.stack(images), "chart": np.stack(charts), "uv": np.stack(uvs),
        "grid_xy": np.stack(grids), "grid_size": np.array([[1.0, 1.0]], np.float32),
    }, {"textures": json.dumps([f"drawn-{seed}"]), "seed": str(seed)})
    return matrices


def folder_of_scenes(case, count):
    """A folder for a test class that goes with it, with scenes in its folder "scenes"."""
    folder = tempfile.TemporaryDirectory()
    case.addClassCleanup(folder.cleanup)
    write_scenes(Path(folder.name) / "scenes", count)
    return Path(folder.name)


def write_scenes(directory, count):
    Path(directory).mkdir(parents=True, exist_ok=True)
    for i in range(count):
        write_scene(Path(directory) / f"scene_{i:06d}.safetensors", seed=100 + i)
