# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""DEAL on a regular grid: the first row of the paper's ablation (section 4.3, "Cartesian NRW").

A square of the disc's area replaces the polar grid. It is turned by the keypoint's angle, because
a regular grid does not get rotation invariance from pooling; HardNet has its published form. The
warp is the same field of displacements, read at the square's points.
"""

from __future__ import annotations

import dataclasses
import math

import torch

from . import geometry
from .hardnet import CARTESIAN_HEAD
from .model import Deal, Shape

_HALF_SIDE = math.sqrt(math.pi) / 2  # radii


def unit_square_grid() -> torch.Tensor:
    """[1024, 2] offsets (x, y) in units of the radius R, row-major."""
    ramp = ((torch.arange(geometry.GRID) + 0.5) / geometry.GRID * 2 - 1) * _HALF_SIDE
    y, x = torch.meshgrid(ramp, ramp, indexing="ij")
    return torch.stack([x, y], -1).reshape(-1, 2)


def turned(points: torch.Tensor, degrees: torch.Tensor) -> torch.Tensor:
    """points [M, 2] turned by each of degrees [N], from x towards y -> [N, M, 2]."""
    angle = torch.deg2rad(degrees)[:, None]
    cosine, sine = torch.cos(angle), torch.sin(angle)
    x, y = points[None, :, 0], points[None, :, 1]
    return torch.stack([cosine * x - sine * y, sine * x + cosine * y], -1)


def displacement_at(displacement: torch.Tensor, points: torch.Tensor) -> torch.Tensor:
    """A field known on the polar grid [N, 1024, 2], read bilinearly in (angle, radius) at points
    [N, M, 2] in radii; beyond the outermost ring it keeps that ring's value."""
    size = geometry.GRID
    row = torch.atan2(points[..., 1], points[..., 0]) / (2 * math.pi) * size - 0.5
    column = (points.norm(dim=-1) * size - 0.5).clamp(0, size - 1)
    row0, column0 = row.floor(), column.floor().clamp(max=size - 2)
    across, along = (row - row0)[..., None], (column - column0)[..., None]
    first, left = row0.long(), column0.long()

    def take(rows: torch.Tensor, columns: torch.Tensor) -> torch.Tensor:
        cells = (torch.remainder(rows, size) * size + columns)[..., None].expand(-1, -1, 2)
        return torch.gather(displacement, 1, cells)

    near = take(first, left) * (1 - along) + take(first, left + 1) * along
    far = take(first + 1, left) * (1 - along) + take(first + 1, left + 1) * along
    return near * (1 - across) + far * across


class CartesianDeal(Deal):
    """Keypoints [N, 4] = x, y, size, angle in degrees."""

    format = "pliant-deal-cartesian"

    def __init__(self, shape: Shape = Shape()):
        # Linear: the rings on which displacement_at reads.
        super().__init__(dataclasses.replace(shape, head=CARTESIAN_HEAD))
        self.register_buffer("unit_square", unit_square_grid(), persistent=False)

    def offsets(self, keypoints: torch.Tensor, displacement: torch.Tensor | None) -> torch.Tensor:
        points = turned(self.unit_square, keypoints[:, 3])
        return points if displacement is None else points + displacement_at(displacement, points)
