# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Bilinear sampling by gather, with the gradients that training needs and no others.

Coordinates are in pixel-centre units (0 = centre of the first pixel), clamped to the border.
"""

from __future__ import annotations

import torch


def _corners(coordinate: torch.Tensor, extent: int) -> tuple[torch.Tensor, torch.Tensor]:
    """First cell of the bilinear pair and the fraction towards the second."""
    clamped = coordinate.clamp(0, extent - 1)
    first = clamped.floor().clamp_(max=max(extent - 2, 0))
    return first, clamped - first


class _SampleImages(torch.autograd.Function):
    @staticmethod
    def forward(ctx, images, index, xy):
        _, height, width = images.shape
        x0, fx = _corners(xy[..., 0], width)
        y0, fy = _corners(xy[..., 1], height)
        base = index[:, None] * (height * width) + (y0 * width + x0).long()
        flat = images.reshape(-1)
        take = lambda offset: torch.take(flat, base + offset)  # noqa: E731
        right, down = int(width > 1), width * int(height > 1)
        v00, v10 = take(0), take(right)
        top_slope = v10 - v00
        top = v00 + top_slope * fx
        v01, v11 = take(down), take(down + right)
        bottom_slope = v11 - v01
        bottom = v01 + bottom_slope * fx
        if ctx.needs_input_grad[2]:
            inside_x = (xy[..., 0] >= 0) & (xy[..., 0] <= width - 1)
            inside_y = (xy[..., 1] >= 0) & (xy[..., 1] <= height - 1)
            gx = (top_slope + (bottom_slope - top_slope) * fy) * inside_x
            ctx.save_for_backward(gx, (bottom - top) * inside_y)
        return top + (bottom - top) * fy

    @staticmethod
    def backward(ctx, grad):
        gx, gy = ctx.saved_tensors
        return None, None, torch.stack([grad * gx, grad * gy], -1)


def sample_images(images: torch.Tensor, index: torch.Tensor, xy: torch.Tensor) -> torch.Tensor:
    """images [I, H, W], index [N] image of each point set, xy [N, M, 2] px -> [N, M].

    Differentiable in xy only.
    """
    return _SampleImages.apply(images, index, xy)


class _GatherRows(torch.autograd.Function):
    """table[rows] whose backward is one index_add (autograd's own sorts the indices)."""

    @staticmethod
    def forward(ctx, table, rows):
        ctx.save_for_backward(rows)
        ctx.shape = table.shape
        return table.index_select(0, rows)

    @staticmethod
    def backward(ctx, grad):
        (rows,) = ctx.saved_tensors
        return grad.new_zeros(ctx.shape).index_add_(0, rows, grad), None


def sample_features(features: torch.Tensor, index: torch.Tensor, xy: torch.Tensor) -> torch.Tensor:
    """5 x 5 neighbourhoods one cell apart (paper, section 3.1).

    features [I, C, h, w], index [N], xy [N, 2] in feature cells -> [N, 25 * C]; rows of the
    neighbourhood slowest, channels fastest. All 25 points share one fraction, so 36 cells suffice.
    """
    _, channels, height, width = features.shape
    table = features.permute(0, 2, 3, 1).reshape(-1, channels)
    first = xy.floor()
    fraction = (xy - first).view(-1, 1, 1, 2)
    steps = torch.arange(-2, 4, device=xy.device)
    columns = (first[:, 0].long()[:, None] + steps).clamp_(0, width - 1)
    rows = (first[:, 1].long()[:, None] + steps).clamp_(0, height - 1)
    cells = (index[:, None] * height + rows)[:, :, None] * width + columns[:, None, :]
    values = _GatherRows.apply(table, cells.reshape(-1)).view(len(xy), 6, 6, channels)
    across = values[:, :, :-1] + (values[:, :, 1:] - values[:, :, :-1]) * fraction[..., :1]
    down = across[:, :-1] + (across[:, 1:] - across[:, :-1]) * fraction[..., 1:]
    return down.reshape(len(xy), 25 * channels)
