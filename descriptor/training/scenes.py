# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Simulated scenes: several views of the same surfaces with exact surface coordinates.

File (safetensors, written by the simulator): V views, C surface charts
  images    U8  [V, H, W]            grey
  chart     U8  [V, H, W]            chart seen at the pixel, 255 = none
  uv        U16 [V, H, W, 2]         position in the chart, value / 65535
  grid_xy   F32 [V, C, GH, GW, 2]    projected pixel position of vertex (v, u) of the chart; NaN = none
  grid_size F32 [C, 2]               width and height of the chart in physical units
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from . import tensor_file

NO_CHART = 255
_RANKS = {"images": 3, "chart": 3, "uv": 4, "grid_xy": 5, "grid_size": 2}


def interpolate(grid: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """Bilinear value of a vertex grid [GH, GW, K] at uv [..., 2] in [0, 1] -> [..., K]."""
    rows, columns = grid.shape[:2]
    x = np.clip(uv[..., 0], 0, 1) * (columns - 1)
    y = np.clip(uv[..., 1], 0, 1) * (rows - 1)
    x0 = np.minimum(x.astype(np.int64), columns - 2)
    y0 = np.minimum(y.astype(np.int64), rows - 2)
    fx, fy = (x - x0)[..., None], (y - y0)[..., None]
    top = grid[y0, x0] * (1 - fx) + grid[y0, x0 + 1] * fx
    bottom = grid[y0 + 1, x0] * (1 - fx) + grid[y0 + 1, x0 + 1] * fx
    return top * (1 - fy) + bottom * fy


@dataclass(frozen=True)
class SurfacePoints:
    """Points of one view on surfaces: chart [N] (NO_CHART where none) and uv [N, 2]."""

    chart: np.ndarray
    uv: np.ndarray


class Scene:
    """One scene file, mapped into memory. Raises TensorFileError if the layout is wrong."""

    def __init__(self, path: Path):
        self.path = Path(path)
        tensors, self.metadata = tensor_file.load(path)
        for name, rank in _RANKS.items():
            if name not in tensors or tensors[name].ndim != rank:
                raise tensor_file.TensorFileError(f"{path}: tensor '{name}' is missing or not of rank {rank}")
        self.images, self.chart, self.uv = tensors["images"], tensors["chart"], tensors["uv"]
        self.grid_xy, self.grid_size = tensors["grid_xy"], tensors["grid_size"]
        if self.images.shape != self.chart.shape or self.uv.shape[:3] != self.images.shape:
            raise tensor_file.TensorFileError(f"{path}: images, chart and uv differ in shape")

    @property
    def views(self) -> int:
        return len(self.images)

    @cached_property
    def textures(self) -> tuple[str, ...]:
        """The texture's name of each chart: surfaces with the same name look alike."""
        charts = len(self.grid_size)
        names = json.loads(self.metadata.get("textures", "null")) or [str(self.path)]
        return tuple(str(names[min(chart, len(names) - 1)]) for chart in range(charts))

    def locate(self, view: int, xy: np.ndarray) -> SurfacePoints:
        """Surface under sub-pixel positions xy [N, 2]: bilinear in uv inside one chart, else the
        nearest pixel's."""
        height, width = self.images.shape[1:]
        nearest = np.rint(xy).astype(np.int64)
        inside = ((nearest >= 0) & (nearest < [width, height])).all(1)
        nearest = np.clip(nearest, 0, [width - 1, height - 1])
        chart = np.where(inside, self.chart[view][nearest[:, 1], nearest[:, 0]], NO_CHART)
        uv = self.uv[view][nearest[:, 1], nearest[:, 0]].astype(np.float32) / 65535
        low = np.clip(np.floor(xy).astype(np.int64), 0, [width - 2, height - 2])
        fraction = np.clip(xy - low, 0, 1).astype(np.float32)
        mixed, smooth = np.zeros_like(uv), chart != NO_CHART
        corners = []
        for dy in (0, 1):
            for dx in (0, 1):
                x, y = low[:, 0] + dx, low[:, 1] + dy
                value = self.uv[view][y, x].astype(np.float32) / 65535
                weight = np.abs(1 - dx - fraction[:, 0]) * np.abs(1 - dy - fraction[:, 1])
                mixed += weight[:, None] * value
                smooth &= self.chart[view][y, x] == chart
                corners.append(value)
        spread = np.ptp(np.stack(corners), axis=0).max(1)
        smooth &= spread < 0.1  # not across a fold or the seam of a cylinder
        return SurfacePoints(chart.astype(np.uint8), np.where(smooth[:, None], mixed, uv))

    def project(self, view: int, points: SurfacePoints) -> np.ndarray:
        """Pixel positions [N, 2] of surface points in another view, visible or not; NaN off chart."""
        return self._at(self.grid_xy[view], points)

    def jacobian(self, view: int, points: SurfacePoints) -> np.ndarray:
        """[N, 2, 2] d(pixel) / d(physical position on the chart), columns = along u, along v."""
        return self._at(self._jacobians[view], points).reshape(-1, 2, 2)

    @staticmethod
    def _at(grids: np.ndarray, points: SurfacePoints) -> np.ndarray:
        out = np.full((len(points.uv), grids.shape[-1]), np.nan, np.float32)
        for chart in range(len(grids)):
            mine = points.chart == chart
            if mine.any():
                out[mine] = interpolate(grids[chart], points.uv[mine])
        return out

    @cached_property
    def _jacobians(self) -> np.ndarray:
        """[V, C, GH, GW, 4] of the vertices: rows (dx/du, dx/dv, dy/du, dy/dv) per physical unit."""
        rows, columns = self.grid_xy.shape[2:4]
        along_u = np.gradient(self.grid_xy, axis=3) * (columns - 1)
        along_v = np.gradient(self.grid_xy, axis=2) * (rows - 1)
        along_u = along_u / self.grid_size[None, :, None, None, :1]
        along_v = along_v / self.grid_size[None, :, None, None, 1:]
        return np.stack([along_u, along_v], -1).reshape(*along_u.shape[:-1], 4)

    def visible(self, view: int, points: SurfacePoints, xy: np.ndarray, tolerance_px: float) -> np.ndarray:
        """[N] whether the surface points are what is seen at their projections xy in the view."""
        seen = self.locate(view, np.nan_to_num(xy, nan=-1e4))
        scale = np.linalg.norm(self.jacobian(view, points), axis=1)  # px per unit along u and v
        size = self.grid_size[np.minimum(points.chart, len(self.grid_size) - 1)]
        off_px = np.linalg.norm((seen.uv - points.uv) * size * scale, axis=1)
        return (points.chart != NO_CHART) & (seen.chart == points.chart) & (off_px < tolerance_px)
