# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""HardNet on polar patches (Mishchuk et al. 2017; Ebel et al. 2019; paper, section 3.3)."""

from __future__ import annotations

import torch
from torch import nn
from torch.nn import functional as F

from .fused_norm import norm_act, wrap_rows

WIDTHS = (32, 32, 64, 64, 128, 128)             # outputs of the 3 x 3 convolutions
POLAR_HEAD = ((1, 3), (1, 3), (1, 3), (1, 2))   # kernels along the radius
CARTESIAN_HEAD = ((8, 8),)
DIM = 128                                       # of a descriptor in the paper


def strides(layers: int) -> list[int]:
    """Of the 3 x 3 convolutions: the second and the fourth from the end halve the map, 32 -> 8."""
    return [2 if layers - i in (2, 4) else 1 for i in range(layers)]


def standardize(patches: torch.Tensor) -> torch.Tensor:
    """[N, 1, 32, 32] to zero mean and unit variance each (eps 1e-5)."""
    variance, mean = torch.var_mean(patches, (2, 3), unbiased=False, keepdim=True)
    return (patches - mean) * torch.rsqrt(variance + 1e-5)


class HardNet(nn.Module):
    """[N, 32, 32] patches -> [N, dim], unit length. A head's kernels cover the 8 columns that are left.

    Polar patches: rows = angle (circular, averaged before the head), columns = radius. Otherwise
    HardNet as published, for upright patches on a regular grid.
    """

    def __init__(self, widths: tuple[int, ...] = WIDTHS, head: tuple[tuple[int, int], ...] = POLAR_HEAD,
                 dim: int = DIM, dropout: float = 0.1):
        super().__init__()
        self.dropout, self.polar, self.layers, self.head_layers = dropout, head[0][0] == 1, len(widths), len(head)
        polar = self.polar
        for i, (inputs, outputs, stride) in enumerate(zip((1, *widths), widths, strides(len(widths))), 1):
            self.add_module(f"conv{i}", nn.Conv2d(inputs, outputs, 3, stride, (0 if polar else 1, 1), bias=False))
            self.add_module(f"bn{i}", nn.BatchNorm2d(outputs, affine=False))
        for i, kernel in enumerate(head, 1):
            self.add_module(f"head{i}", nn.Conv2d(widths[-1] if i == 1 else dim, dim, kernel, bias=False))
            self.add_module(f"head_bn{i}", nn.BatchNorm2d(dim, affine=False))

    def forward(self, patches: torch.Tensor) -> torch.Tensor:
        x = standardize(patches[:, None])
        x = wrap_rows(x) if self.polar else x
        for i in range(1, self.layers + 1):
            # Channels-last weights keep the whole body in that layout.
            conv = self.get_submodule(f"conv{i}")
            x = norm_act(self.get_submodule(f"bn{i}"), conv(x), wrap=self.polar and i < self.layers)
        x = F.dropout(x, self.dropout, self.training)
        if self.polar:
            x = x.mean(2, keepdim=True)  # over the angle: rotation invariance
        for i in range(1, self.head_layers + 1):
            x = self.get_submodule(f"head_bn{i}")(self.get_submodule(f"head{i}")(x))
        return F.normalize(x.flatten(1))
