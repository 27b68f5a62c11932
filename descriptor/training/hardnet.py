# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""HardNet on polar patches (Mishchuk et al. 2017; Ebel et al. 2019; paper, section 3.3)."""

from __future__ import annotations

import torch
from torch import nn
from torch.nn import functional as F

from .fused_norm import norm_act, wrap_rows

_WIDTHS = ((1, 32, 1), (32, 32, 1), (32, 64, 2), (64, 64, 1), (64, 128, 2), (128, 128, 1))
_HEAD_KERNELS = (3, 3, 3, 2)


def standardize(patches: torch.Tensor) -> torch.Tensor:
    """[N, 1, 32, 32] to zero mean and unit variance each (eps 1e-5)."""
    variance, mean = torch.var_mean(patches, (2, 3), unbiased=False, keepdim=True)
    return (patches - mean) * torch.rsqrt(variance + 1e-5)


class HardNet(nn.Module):
    """[N, 32, 32] polar patches (rows = angle, columns = radius) -> [N, 128], unit length."""

    def __init__(self, dropout: float = 0.1):
        super().__init__()
        self.dropout = dropout
        for i, (inputs, outputs, stride) in enumerate(_WIDTHS, 1):
            self.add_module(f"conv{i}", nn.Conv2d(inputs, outputs, 3, stride, (0, 1), bias=False))
            self.add_module(f"bn{i}", nn.BatchNorm2d(outputs, affine=False))
        for i, kernel in enumerate(_HEAD_KERNELS, 1):
            self.add_module(f"head{i}", nn.Conv2d(128, 128, (1, kernel), bias=False))
            self.add_module(f"head_bn{i}", nn.BatchNorm2d(128, affine=False))

    def forward(self, patches: torch.Tensor) -> torch.Tensor:
        x = wrap_rows(standardize(patches[:, None]))
        body = len(_WIDTHS)
        for i in range(1, body + 1):
            # Channels-last weights keep the whole body in that layout.
            conv = self.get_submodule(f"conv{i}")
            x = norm_act(self.get_submodule(f"bn{i}"), conv(x), wrap=i < body)
        x = F.dropout(x, self.dropout, self.training)
        x = x.mean(2, keepdim=True)  # over the angle: rotation invariance
        for i in range(1, len(_HEAD_KERNELS) + 1):
            x = self.get_submodule(f"head_bn{i}")(self.get_submodule(f"head{i}")(x))
        return F.normalize(x.flatten(1))
