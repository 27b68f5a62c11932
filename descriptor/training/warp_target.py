# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""The true local warp around keypoints, which supervises the localisation network.

Around a keypoint the surface maps to the image by X(p), p in physical units on the chart. With
J = dX/dp = S Q (polar decomposition: S symmetric, Q a rotation) and s = det(J)^(-1/2), the warp is
    z(e) = (X(p0 + s R Q^T e) - x0) / R - e,
the displacement in radii that lets every view sample the same piece of surface, up to the rotation
that the descriptor does not see and the scale that the keypoint's size already carries.
"""

from __future__ import annotations

import numpy as np

from . import geometry
from .scenes import Scene, SurfacePoints

# 8 x 8 of the 32 x 32 grid points, between the innermost and the outermost radius.
SUPERVISED_POINTS = np.arange(geometry.GRID**2).reshape(geometry.GRID, -1)[::4, 1::4].reshape(-1)
MAX_ANISOTROPY = 5.0
MAX_DISPLACEMENT = 1.0  # radii; beyond, the target is clipped
_UNIT = geometry.unit_polar_grid()


def true_warp(scene: Scene, view: int, points: SurfacePoints, keypoints: np.ndarray,
              radius_per_size: float, grid_points: np.ndarray = SUPERVISED_POINTS) -> tuple[np.ndarray, np.ndarray]:
    """Returns displacement [N, G, 2] in radii and mask [N, G] of the points where it is known.

    A keypoint seen too obliquely, from behind or off the charts has an empty mask.
    """
    unit = _UNIT[grid_points]
    jacobian = np.nan_to_num(scene.jacobian(view, points).astype(np.float64))
    determinant = np.linalg.det(jacobian)
    u, singular, vt = np.linalg.svd(jacobian)
    sound = (determinant > 0) & (singular[:, 0] < MAX_ANISOTROPY * singular[:, 1])
    scale = 1 / np.sqrt(np.where(sound, determinant, 1.0))
    rotation_back = np.swapaxes(u @ vt, 1, 2)
    radius = keypoints[:, 2] * radius_per_size
    offsets = np.einsum("nij,mj->nmi", rotation_back, unit) * (radius * scale)[:, None, None]
    chart = np.minimum(points.chart, len(scene.grid_size) - 1)
    uv = points.uv[:, None] + offsets / scene.grid_size[chart][:, None]
    known = ((uv >= 0) & (uv <= 1)).all(-1) & sound[:, None]
    count = len(grid_points)
    spread = SurfacePoints(np.repeat(points.chart, count), uv.reshape(-1, 2))
    seen = scene.project(view, spread).reshape(-1, count, 2)
    centre = scene.project(view, points)[:, None]
    warp = (seen - centre) / np.maximum(radius, 1e-6)[:, None, None] - unit
    known &= np.isfinite(warp).all(-1)
    warp = np.where(known[..., None], warp, 0).clip(-MAX_DISPLACEMENT, MAX_DISPLACEMENT)
    return warp.astype(np.float32), known
