# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""The DEAL network (Potje et al., NeurIPS 2021): deformation-aware local features.

Conventions (shared with the C++ side; tests/data/golden_* pin them):
  images   [I, H, W] grey in [0, 1];  keypoints [N, 3 or more] = x, y, size in pixels of their image
  radius     R = radius_per_size * size;  displacements in units of R unless named _px
  theta      [N, 66, 2] TPS parameters after tanh
"""

from __future__ import annotations

import copy
import os
from dataclasses import dataclass
from typing import Mapping

import numpy as np
import torch
from torch import nn
from torch.nn import functional as F

from . import geometry, tensor_file
from .backbone import Backbone
from .fast_linear import linear
from .hardnet import DIM, POLAR_HEAD, WIDTHS, HardNet
from .sampling import sample_features, sample_images

_WARP_DROPOUT = 0.1
_PART = 256  # keypoints described at once
ONE_SUPPORT = (1.0,)
POOLED_SUPPORTS = (0.72, 1.0, 1.39)  # radii over which an indexed image's descriptors are averaged (deal/network.h)


@dataclass(frozen=True)
class Shape:
    """Widths and depths of the network. The default is the paper's."""

    channels: int = 64                            # of the backbone's first stage; the second has twice as many
    blocks: tuple[int, int] = (3, 4)              # of the backbone's stages
    hidden: tuple[int, int, int] = (512, 256, 256)  # layers of the localisation network
    hardnet: tuple[int, ...] = WIDTHS
    head: tuple[tuple[int, int], ...] = POLAR_HEAD
    dim: int = DIM                                # of a descriptor

    @staticmethod
    def of(tensors: Mapping[str, np.ndarray | torch.Tensor]) -> Shape:
        """That of a network's tensors. Raises KeyError naming a tensor that is missing."""
        def extents(name: str) -> tuple[int, ...]:
            return tuple(tensors[name + ".weight"].shape)

        def count(start: str, end: str) -> int:
            return sum(name.startswith(start) and name.endswith(end) for name in tensors)

        return Shape(
            extents("backbone.conv1")[0],
            (count("backbone.layer1.", ".conv1.weight"), count("backbone.layer2.", ".conv1.weight")),
            tuple(extents(f"localization.fc{i}")[0] for i in (1, 2, 3)),
            tuple(extents(f"hardnet.conv{i + 1}")[0] for i in range(count("hardnet.conv", ".weight"))),
            tuple(extents(f"hardnet.head{i + 1}")[2:] for i in range(count("hardnet.head", ".weight"))),
            extents("hardnet.head1")[0])


SHAPES = {"deal": Shape(), "deal-small": Shape(16, (3, 4), (512, 512, 512), (16, 32, 64, 64), ((1, 8),), 64)}


class PreconditionedLinear(nn.Module):
    """The localisation network's last layer: (P W) x + P b with a fixed P per axis.

    Training moves W and b; folded() is the plain layer that the exported file holds. A model read
    from a file keeps the plain layer (P absent) until precondition() prepares it for training.
    """

    def __init__(self, inputs: int):
        super().__init__()
        outputs = 2 * geometry.TPS_PARAMETERS
        self.weight = nn.Parameter(torch.zeros(outputs, inputs))  # zero: start from the identity
        self.bias = nn.Parameter(torch.zeros(outputs))
        self.register_buffer("matrix", None, persistent=False)

    def folded(self) -> tuple[torch.Tensor, torch.Tensor]:
        if self.matrix is None:
            return self.weight, self.bias
        return _apply_per_axis(self.matrix, self.weight), _apply_per_axis(self.matrix, self.bias)

    @torch.no_grad()
    def precondition(self) -> None:
        """Changes the parameters such that folded() stays what it is."""
        if self.matrix is not None:
            return
        matrix = torch.from_numpy(geometry.tps_preconditioner())
        inverse = torch.linalg.inv(matrix)
        for parameter in (self.weight, self.bias):
            parameter.copy_(_apply_per_axis(inverse, parameter.double().cpu()))
        self.matrix = matrix.to(self.weight)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return linear(x, *self.folded())


def _apply_per_axis(matrix: torch.Tensor, layer: torch.Tensor) -> torch.Tensor:
    """matrix [66, 66] on the first axis of layer [132, ...] seen as [66, 2, ...]."""
    return (matrix @ layer.reshape(len(matrix), -1)).view_as(layer)


class LocalizationNet(nn.Module):
    """Sampled features [N, 25 C] -> TPS parameters theta [N, 66, 2] in (-1, 1).

    While a smaller network learns from a teacher, it has the teacher's layers behind an adapter, from its own channels
    to the teacher's. first() is the plain layer that the exported file holds.
    """

    def __init__(self, channels: int, hidden: tuple[int, int, int]):
        super().__init__()
        sizes = (25 * channels, *hidden)
        for i in range(3):
            self.add_module(f"fc{i + 1}", nn.Linear(sizes[i], sizes[i + 1]))
        self.fc4 = PreconditionedLinear(sizes[3])
        self.adapter: nn.Linear | None = None
        self.dropout = _WARP_DROPOUT

    def adapted(self, channels: int) -> LocalizationNet:
        """A copy of this network for features of so many channels."""
        network = copy.deepcopy(self)
        network.adapter = nn.Linear(channels, self.fc1.in_features // 25)
        return network

    def first(self) -> tuple[torch.Tensor, torch.Tensor]:
        if self.adapter is None:
            return self.fc1.weight, self.fc1.bias
        weight = self.fc1.weight.unflatten(1, (25, -1))
        adapted = linear(weight.flatten(0, 1), self.adapter.weight.t()).view(len(weight), -1)
        return adapted, self.fc1.bias + (weight @ self.adapter.bias).sum(1)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        for weight, bias in (self.first(), *((layer.weight, layer.bias) for layer in (self.fc2, self.fc3))):
            x = F.relu(linear(x, weight, bias))
            x = F.dropout(x, self.dropout, self.training)
        return torch.tanh(self.fc4(x)).view(-1, geometry.TPS_PARAMETERS, 2)


class Deal(nn.Module):
    format = "pliant-deal"  # of its weight files

    def __init__(self, shape: Shape = Shape(), spacing: str = geometry.LINEAR):
        super().__init__()
        self.backbone = Backbone(shape.channels, shape.blocks)
        self.localization = LocalizationNet(2 * shape.channels, shape.hidden)
        self.hardnet = HardNet(shape.hardnet, shape.head, shape.dim)
        self.dim = shape.dim
        self.gain = geometry.displacement_gain()
        for name in ("unit_grid", "basis", "linear_basis"):
            self.register_buffer(name, None, persistent=False)
        self.set_spacing(spacing)

    def set_spacing(self, spacing: str) -> None:
        """How the rings of the polar grid are spaced (geometry.py); what was learned stays."""
        self.spacing = spacing
        like = self.localization.fc1.weight
        self.unit_grid = _constant(geometry.unit_polar_grid(spacing)).to(like)
        self.basis = _constant(geometry.tps_basis(spacing)).to(like)
        self.linear_basis = _constant(geometry.tps_basis()).to(like)  # the true warp's: warp_target.py

    def features_at(self, images: torch.Tensor, index: torch.Tensor,
                    keypoints: torch.Tensor) -> torch.Tensor:
        """Backbone and first spatial transformer: [N, 25 C]."""
        return self.sample(self.backbone(images), images.shape[1:], index, keypoints)

    @staticmethod
    def sample(maps: torch.Tensor, image_size: torch.Size, index: torch.Tensor,
               keypoints: torch.Tensor) -> torch.Tensor:
        """maps [I, C, h, w]; image pixel x lies at cell x (w - 1) / (W - 1)."""
        height, width = image_size
        scale = keypoints.new_tensor([(maps.shape[3] - 1) / max(width - 1, 1),
                                      (maps.shape[2] - 1) / max(height - 1, 1)])
        return sample_features(maps, index, keypoints[:, :2] * scale)

    def displacement(self, theta: torch.Tensor, points: torch.Tensor | None = None) -> torch.Tensor:
        """theta [N, 66, 2] -> [N, 1024, 2] in units of R at the grid, or at `points` of the linear grid."""
        basis = self.basis if points is None else self.linear_basis[points]
        # A 1 x 1 convolution: the same product, but fast with any BLAS.
        return F.conv1d(theta, basis[:, :, None]) * self.gain

    def offsets(self, keypoints: torch.Tensor, displacement: torch.Tensor | None) -> torch.Tensor:
        """Sampling points [N or 1, 1024, 2] in units of R; the fixed grid where displacement is None."""
        return self.unit_grid[None] if displacement is None else self.unit_grid + displacement

    def patches(self, images: torch.Tensor, index: torch.Tensor, keypoints: torch.Tensor,
                radius_per_size: float | torch.Tensor,
                displacement: torch.Tensor | None = None) -> torch.Tensor:
        """Patches [N, 32, 32] of the images at offsets()."""
        radius = (keypoints[:, 2] * radius_per_size)[:, None, None]
        grid = keypoints[:, None, :2] + radius * self.offsets(keypoints, displacement)
        return sample_images(images, index, grid).view(-1, geometry.GRID, geometry.GRID)

    @torch.no_grad()
    def describe(self, grey: torch.Tensor, keypoints: torch.Tensor, radius_per_size: float, warp: bool = True,
                 supports: tuple[float, ...] = ONE_SUPPORT) -> tuple[torch.Tensor | None, torch.Tensor]:
        """theta (None without the warp) and descriptors [N, dim] of one image [H, W], in parts to save memory.
        With several supports, relative radii, a descriptor is the mean over them, scaled to unit length."""
        images, index = grey[None], torch.zeros(len(keypoints), dtype=torch.long, device=grey.device)
        theta = self.localization(self.features_at(images, index, keypoints)) if warp else None
        rows = [torch.zeros(0, self.dim, device=grey.device)]
        for start in range(0, len(keypoints), _PART):
            part = slice(start, start + _PART)
            displacement = None if theta is None else self.displacement(theta[part])
            rows.append(F.normalize(sum(
                self.hardnet(self.patches(images, index[part], keypoints[part], radius_per_size * support, displacement))
                for support in supports)))
        return theta, torch.cat(rows)

    def forward(self, images: torch.Tensor, index: torch.Tensor, keypoints: torch.Tensor,
                radius_per_size: float, warp: bool = True) -> torch.Tensor:
        """Descriptors [N, dim]."""
        displacement = None
        if warp:
            theta = self.localization(self.features_at(images, index, keypoints))
            displacement = self.displacement(theta)
        return self.hardnet(self.patches(images, index, keypoints, radius_per_size, displacement))


def _constant(array: np.ndarray) -> torch.Tensor:
    return torch.from_numpy(array).float()


def export_tensors(model: Deal) -> dict[str, np.ndarray]:
    """The model as plain layers under the file's names (fc1 and fc4 folded)."""
    localization = copy.deepcopy(model.localization).double()
    if localization.fc4.matrix is not None:
        localization.fc4.matrix = torch.from_numpy(geometry.tps_preconditioner()).to(localization.fc4.weight)
    folded = {}
    for layer, parameters in (("fc1", localization.first()), ("fc4", localization.fc4.folded())):
        folded |= {f"localization.{layer}.{kind}": value for kind, value in zip(("weight", "bias"), parameters)}
    tensors = {}
    for name, value in model.state_dict().items():
        if name.endswith("num_batches_tracked") or ".adapter." in name:
            continue
        value = folded.get(name, value)
        tensors[name] = value.detach().cpu().float().numpy()
    return tensors


def load_model(path: str | os.PathLike, kind: type[Deal] = Deal) -> tuple[Deal, dict[str, str]]:
    """Reads a safetensors file of kind's format; widths and depths come from its tensors, the rings' spacing from
    its metadata (linear where they say nothing).

    Raises TensorFileError naming the tensor that is missing or has the wrong shape.
    """
    tensors, metadata = tensor_file.load(path)
    if metadata.get("format") != kind.format:
        raise tensor_file.TensorFileError(f"{path}: metadata 'format' is not '{kind.format}'")
    try:
        model = kind(Shape.of(tensors))
    except KeyError as error:
        raise tensor_file.TensorFileError(f"{path}: tensor {error} is missing") from error
    spacing = metadata.get("radial_spacing", geometry.LINEAR)
    if spacing not in geometry.SPACINGS:
        raise tensor_file.TensorFileError(f"{path}: metadata 'radial_spacing' is '{spacing}', not one of {geometry.SPACINGS}")
    model.set_spacing(spacing)
    state = model.state_dict()
    for name, value in state.items():
        if name.endswith("num_batches_tracked"):
            continue
        if name not in tensors or tensors[name].shape != tuple(value.shape):
            found = tensors[name].shape if name in tensors else "nothing"
            raise tensor_file.TensorFileError(
                f"{path}: tensor '{name}' should have shape {tuple(value.shape)}, found {found}")
        state[name] = torch.from_numpy(tensors[name].copy())
    model.load_state_dict(state)
    return model.eval(), metadata


def save_model(path: str | os.PathLike, model: Deal, metadata: dict[str, str], half: bool = False) -> None:
    """metadata must hold radius_per_size; 'format' and 'radial_spacing' are added. With `half`, matrices and filters are
    rounded to half precision, which halves the file; vectors (biases, batch norm) are not."""
    tensors = export_tensors(model)
    if half:
        tensors = {name: value.astype(np.float16) if value.ndim > 1 else value for name, value in tensors.items()}
    tensor_file.save(path, tensors, {**metadata, "format": model.format, "radial_spacing": model.spacing})
