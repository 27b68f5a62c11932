# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""ResNet-34 up to its second residual stage (He et al. 2016; paper, section 3.1)."""

from __future__ import annotations

import math

import torch
from torch import nn
from torch.nn import functional as F

from .fused_norm import norm_act


class BasicBlock(nn.Module):
    def __init__(self, inputs: int, outputs: int, stride: int = 1):
        super().__init__()
        self.conv1 = nn.Conv2d(inputs, outputs, 3, stride, 1, bias=False)
        self.bn1 = nn.BatchNorm2d(outputs)
        self.conv2 = nn.Conv2d(outputs, outputs, 3, 1, 1, bias=False)
        self.bn2 = nn.BatchNorm2d(outputs)
        self.downsample: nn.Module | None = None
        if stride != 1 or inputs != outputs:
            self.downsample = nn.Sequential(nn.Conv2d(inputs, outputs, 1, stride, bias=False),
                                            nn.BatchNorm2d(outputs))

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        y = norm_act(self.bn1, self.conv1(x))
        if self.downsample is not None:
            convolution, bn = self.downsample
            x = norm_act(bn, convolution(x), relu=False)
        return norm_act(self.bn2, self.conv2(y), residual=x)


class Backbone(nn.Module):
    """[I, H, W] grey in [0, 1] -> [I, 2 C, ceil(H/8), ceil(W/8)], C = channels of the first stage."""

    def __init__(self, channels: int = 64, blocks: tuple[int, int] = (3, 4)):
        super().__init__()
        wide = 2 * channels
        self.conv1 = nn.Conv2d(3, channels, 7, 2, 3, bias=False)
        self.bn1 = nn.BatchNorm2d(channels)
        self.layer1 = nn.Sequential(*(BasicBlock(channels, channels) for _ in range(blocks[0])))
        self.layer2 = nn.Sequential(BasicBlock(channels, wide, 2), *(BasicBlock(wide, wide) for _ in range(blocks[1] - 1)))

    def forward(self, grey: torch.Tensor) -> torch.Tensor:
        # Three equal input channels: the slices of conv1 add up to one (a third of its work).
        kernel = self.conv1.weight.sum(1, keepdim=True)
        x = F.conv2d(grey[:, None], kernel, stride=2, padding=3)
        x = F.max_pool2d(norm_act(self.bn1, x), 3, 2, 1)
        return self.layer2(self.layer1(x))


def gabor_start(backbone: Backbone) -> None:
    """A start from which the warp is learnable without ImageNet weights.

    First layer: zero-mean Gabor filters of 4 phases, 2 wavelengths (1 below 64 channels) and as many
    orientations as fit. Residual branches end in zero, and the down-sampling of layer 2 passes (x, -x):
    at the start the network computes pooled, rectified oriented energy.
    """
    y, x = torch.meshgrid(torch.arange(-3.0, 4.0), torch.arange(-3.0, 4.0), indexing="ij")
    channels = len(backbone.bn1.weight)
    bands = ((3.5, 1.5), (6.0, 2.0)) if channels >= 64 else ((4.5, 1.7),)
    orientations = channels // (4 * len(bands))
    filters = []
    for wavelength, sigma in bands:
        window = torch.exp(-(x * x + y * y) / (2 * sigma * sigma))
        for orientation in range(orientations):
            theta = math.pi * orientation / orientations
            phase = 2 * math.pi * (x * math.cos(theta) + y * math.sin(theta)) / wavelength
            for quarter in range(4):
                wave = window * torch.cos(phase + quarter * math.pi / 2)
                wave = wave - window * (wave.sum() / window.sum())
                filters.append(wave / wave.norm())
    with torch.no_grad():
        backbone.conv1.weight.copy_(torch.stack(filters)[:, None].expand(-1, 3, -1, -1) / 3)
        for block in (*backbone.layer1, *backbone.layer2):
            block.bn2.weight.zero_()
        identity = torch.eye(channels)
        backbone.layer2[0].downsample[0].weight.copy_(
            torch.cat([identity, -identity])[:, :, None, None])
