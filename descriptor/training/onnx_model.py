# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""The network as one ONNX graph, for inference elsewhere: backbone, warp, patches, HardNet.

    inputs   image      [1, 1, H, W] float32 grey in [0, 1]; any H and W
             keypoints  [N, 3] float32 x, y, size in pixels of the image, pixel centres at integers; any N from 1
    output   descriptors [N, D] float32, unit length; D = 64 for the shipped weights

It holds operators of opset 13 only (sampling is Gather, exact in every runtime), and the metadata of the weights'
file with their SHA-256. Keypoints are detected outside of it.
"""

from __future__ import annotations

import inspect
import os
import tempfile
import warnings
from pathlib import Path

import torch
from torch import nn
from torch.nn import functional as F

from . import geometry, tensor_file
from .model import SHAPES, Deal, Shape, load_model

OPSET = 13


class OnnxError(RuntimeError):
    """The graph cannot be written; the message says what is missing."""


def _side(tensor: torch.Tensor, axis: int) -> torch.Tensor:
    """An extent as a value of the graph, not as the number that it has while tracing."""
    return torch._shape_as_tensor(tensor)[axis]  # pylint: disable=protected-access


def _cells(coordinate: torch.Tensor, extent: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """First cell of the bilinear pair, clamped to the border, and the fraction towards the second."""
    last = (extent - 1).to(coordinate.dtype)
    clamped = torch.minimum(coordinate.clamp(min=0), last)
    first = torch.minimum(clamped.floor(), (last - 1).clamp(min=0))
    return first.long(), clamped - first


class OnnxDeal(nn.Module):
    """Deal.forward for one image, of operators that ONNX has and with nothing fixed but the weights."""

    def __init__(self, model: Deal, radius_per_size: float):
        super().__init__()
        self.model, self.radius_per_size = model.eval(), radius_per_size
        weight, bias = model.localization.fc4.folded()
        self.register_buffer("theta_weight", weight.detach())
        self.register_buffer("theta_bias", bias.detach())

    def features_at(self, maps: torch.Tensor, image: torch.Tensor, keypoints: torch.Tensor) -> torch.Tensor:
        """5 x 5 neighbourhoods of maps [1, C, h, w] at the keypoints: [N, 25 C]."""
        channels = maps.shape[1]
        height, width = _side(maps, 2), _side(maps, 3)
        scale = [(width - 1) / (_side(image, 3) - 1).clamp(min=1), (height - 1) / (_side(image, 2) - 1).clamp(min=1)]
        table = maps[0].permute(1, 2, 0).reshape(-1, channels)
        steps = torch.arange(-2, 4)
        cells, fractions = [], []
        for axis, extent in enumerate((width, height)):
            place = keypoints[:, axis] * scale[axis]
            first = place.floor()
            fractions.append((place - first).view(-1, 1, 1, 1))
            cells.append(torch.minimum((first.long()[:, None] + steps).clamp(min=0), extent - 1))
        rows = cells[1][:, :, None] * width + cells[0][:, None, :]
        values = table[rows.reshape(-1)].view(-1, 6, 6, channels)
        across = values[:, :, :-1] + (values[:, :, 1:] - values[:, :, :-1]) * fractions[0]
        down = across[:, :-1] + (across[:, 1:] - across[:, :-1]) * fractions[1]
        return down.reshape(-1, 25 * channels)

    def displacement(self, features: torch.Tensor) -> torch.Tensor:
        """Features [N, 3200] -> [N, 1024, 2] in units of the radius."""
        localization = self.model.localization
        for layer in (localization.fc1, localization.fc2, localization.fc3):
            features = F.relu(F.linear(features, layer.weight, layer.bias))
        theta = torch.tanh(F.linear(features, self.theta_weight, self.theta_bias))
        return torch.matmul(self.model.basis, theta.view(-1, geometry.TPS_PARAMETERS, 2)) * self.model.gain

    def patches(self, image: torch.Tensor, points: torch.Tensor) -> torch.Tensor:
        """The image at points [N, 1024, 2]: [N, 32, 32]."""
        height, width = _side(image, 2), _side(image, 3)
        x, across = _cells(points[..., 0], width)
        y, along = _cells(points[..., 1], height)
        flat = image.reshape(-1)
        right = (width - 1).clamp(max=1)
        below = width * (height - 1).clamp(max=1)
        first = y * width + x
        top = flat[first] + (flat[first + right] - flat[first]) * across
        bottom = flat[first + below] + (flat[first + below + right] - flat[first + below]) * across
        return (top + (bottom - top) * along).view(-1, geometry.GRID, geometry.GRID)

    def forward(self, image: torch.Tensor, keypoints: torch.Tensor) -> torch.Tensor:
        maps = self.model.backbone(image[:, 0])
        displacement = self.displacement(self.features_at(maps, image, keypoints))
        radius = (keypoints[:, 2] * self.radius_per_size)[:, None, None]
        points = keypoints[:, None, :2] + radius * (self.model.unit_grid + displacement)
        return self.model.hardnet(self.patches(image, points))


def write_onnx(weights: str | os.PathLike, path: str | os.PathLike) -> None:
    """Writes the network of a weight file to `path`, atomically.

    Raises OnnxError without Debian's python3-onnx, TensorFileError for a broken weight file.
    """
    try:
        import onnx  # pylint: disable=import-outside-toplevel
    except ImportError as error:
        raise OnnxError("writing ONNX needs the package onnx (Debian: python3-onnx)") from error
    model, metadata = load_model(weights)
    network = OnnxDeal(model, float(metadata["radius_per_size"])).eval()
    # Any image and keypoints will do: nothing of them stays in the graph.
    example = (torch.rand(1, 1, 53, 75), torch.tensor([[20.0, 30.0, 4.0], [40.5, 20.25, 9.0]]))
    # Debian 13's PyTorch has two exporters, of which this is the one that Debian 12's has.
    legacy = {"dynamo": False} if "dynamo" in inspect.signature(torch.onnx.export).parameters else {}
    path = Path(path)
    with tempfile.TemporaryDirectory(dir=path.absolute().parent) as scratch:
        made = Path(scratch) / path.name
        with warnings.catch_warnings(), torch.no_grad():
            warnings.simplefilter("ignore")  # shapes that are meant to be constant: channels
            torch.onnx.export(network, example, str(made), opset_version=OPSET, input_names=["image", "keypoints"],
                              output_names=["descriptors"],
                              dynamic_axes={"image": {2: "height", 3: "width"}, "keypoints": {0: "keypoints"},
                                            "descriptors": {0: "keypoints"}}, **legacy)
        graph = onnx.load(str(made))
        onnx.checker.check_model(graph)
        digest = tensor_file.sha256(weights)
        name = "deal-small" if Shape.of(model.state_dict()) == SHAPES["deal-small"] else "deal"
        onnx.helper.set_model_props(graph, {**metadata, "sha256": digest, "model_id": f"{name}:{digest[:16]}"})
        onnx.save(graph, str(made))
        os.replace(made, path)
