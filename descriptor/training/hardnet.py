# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""HardNet on polar patches (Mishchuk et al. 2017; Ebel et al. 2019; paper, section 3.3)."""

from __future__ import annotations

import torch
from torch import nn
from torch.nn import functional as F

from .fused_norm import norm_act, wrap_rows

_WIDTHS = ((1, 32, 1), (32, 32, 1), (32, 64, 2), (64, 64, 1), (64, 128, 2), (128, 128, 1))
_POLAR_HEAD = ((1, 3), (1, 3), (1, 3), (1, 2))  # along the radius
_CARTESIAN_HEAD = ((8, 8),)


def standardize(patches: torch.Tensor) -> torch.Tensor:
    """[N, 1, 32, 32] to zero mean and unit variance each (eps 1e-5)."""
    variance, mean = torch.var_mean(patches, (2, 3), unbiased=False, keepdim=True)
    return (patches - mean) * torch.rsqrt(variance + 1e-5)


class HardNet(nn.Module):
    """[N, 32, 32] patches -> [N, 128], unit length.

    Polar patches: rows = angle (circular, averaged before the head), columns = radius. Otherwise
    HardNet as published, for upright patches on a regular grid.
    """

    def __init__(self, dropout: float = 0.1, polar: bool = True):
        super().__init__()
        self.dropout, self.polar = dropout, polar
        self.head_kernels = _POLAR_HEAD if polar else _CARTESIAN_HEAD
        for i, (inputs, outputs, stride) in enumerate(_WIDTHS, 1):
            self.add_module(f"conv{i}", nn.Conv2d(inputs, outputs, 3, stride, (0 if polar else 1, 1), bias=False))
            self.add_module(f"bn{i}", nn.BatchNorm2d(outputs, affine=False))
        for i, kernel in enumerate(self.head_kernels, 1):
            self.add_module(f"head{i}", nn.Conv2d(128, 128, kernel, bias=False))
            self.add_module(f"head_bn{i}", nn.BatchNorm2d(128, affine=False))

    def forward(self, patches: torch.Tensor) -> torch.Tensor:
        x = standardize(patches[:, None])
        x = wrap_rows(x) if self.polar else x
        body = len(_WIDTHS)
        for i in range(1, body + 1):
            # Channels-last weights keep the whole body in that layout.
            conv = self.get_submodule(f"conv{i}")
            x = norm_act(self.get_submodule(f"bn{i}"), conv(x), wrap=self.polar and i < body)
        x = F.dropout(x, self.dropout, self.training)
        if self.polar:
            x = x.mean(2, keepdim=True)  # over the angle: rotation invariance
        for i in range(1, len(self.head_kernels) + 1):
            x = self.get_submodule(f"head_bn{i}")(self.get_submodule(f"head{i}")(x))
        return F.normalize(x.flatten(1))
