# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Converts weights of the paper's own code (github.com/verlab/DEAL_NeurIPS_2021) to a weight file of Pliant.

    python3 -m descriptor.training.convert newdata-DEAL-big.pth --out deal-paper.safetensors

It prints how the two networks differ, and how each difference is handled. A file that holds anything but
tensors is refused: it could run code.
"""

from __future__ import annotations

import argparse
import sys
import tarfile
import zipfile
from pathlib import Path
from typing import Mapping

import numpy as np
import torch

from . import geometry, tensor_file
from .model import Deal, save_model

RADIUS_PER_SIZE = 24.0  # the code's SIFTscale 48, of which it takes half
# The code samples the feature map at (-1, -1/2, 0, 1/2, 1) x 5 / (8 W), in coordinates from -1 to 1 over W pixels: 5/32 px apart.
_STEP_CELLS = 5 / 256
# Modules of Pliant's network and of the code's. The code's numbers are places in a torch.nn.Sequential.
_MODULES = {
    "backbone.conv1": "resnet.0", "backbone.bn1": "resnet.1", "backbone.layer1": "resnet.4", "backbone.layer2": "resnet.5",
    **{f"localization.fc{i}": f"tps_transform.loc.{3 * i - 1}" for i in range(1, 5)},
    **{f"hardnet.conv{i}": f"hardnet.features.{4 * i - 2}" for i in range(1, 7)},
    **{f"hardnet.bn{i}": f"hardnet.features.{4 * i - 1}" for i in range(1, 7)},
    **{f"hardnet.head{i}": f"hardnet.features.{2 * i + 25}" for i in range(1, 5)},
    **{f"hardnet.head_bn{i}": f"hardnet.features.{2 * i + 26}" for i in range(1, 5)},
}
_NAMED = 6  # tensors that an error names of each kind
_DIFFERENCES = """\
The same in both: grey values from 0 to 1 without mean and deviation, linear rings, support radius 24 x keypoint size, HardNet with four head layers.
Exact: the {points} control points of the warp are among Pliant's 64; the weights of the others are zero.
Approximate: the code reads 25 features 5/32 pixel apart, Pliant reads them 8 pixels apart. The first layer of the localisation network
  interpolates linearly between Pliant's.
Not converted: the code places a patch up to half a pixel beside the keypoint, depending on its place in the image. Pliant places it at the keypoint.
Not converted: the code takes the mean of the colours as grey, Pliant the luma. Grey images are the same.
Pliant averages descriptors of indexed images over three support radii; the code does not.
The descriptors have 128 components, those of the shipped weights 64 (python3 -m descriptor.training.narrow)."""


class ConvertError(ValueError):
    """The file is not a checkpoint of the paper's code; the message says why."""


def read_tensors(path: Path) -> dict[str, torch.Tensor]:
    """The tensors of a checkpoint by name. Nothing of the file is executed.

    Raises ConvertError for a file that holds something else, OSError if it cannot be read.
    """
    try:
        # Before 2.6, torch.load unpacks tar files and runs TorchScript whatever weights_only says.
        program = zipfile.is_zipfile(path) and any(name.endswith("/constants.pkl") for name in zipfile.ZipFile(path).namelist())
        if program or tarfile.is_tarfile(path):
            raise ConvertError(f"{path} is a {'TorchScript archive' if program else 'tar file'}. "
                               "Give the file that torch.save wrote of the network's state_dict()")
        state = torch.load(path, map_location="cpu", weights_only=True)
    except (ConvertError, OSError):
        raise
    except Exception as error:  # pylint: disable=broad-except  # a damaged pickle raises any type
        raise ConvertError(f"{path} is damaged, or it holds objects other than tensors, which could run code. Nothing of it was run. "
                           "Give the file that torch.save wrote of the network's state_dict()") from error
    if not isinstance(state, Mapping) or not all(torch.is_tensor(value) for value in state.values()):
        raise ConvertError(f"{path} holds no tensors by name: give the file that torch.save wrote of the network's state_dict()")
    return {str(name): value for name, value in state.items() if not str(name).endswith("num_batches_tracked")}


def paper_name(name: str) -> str:
    """The code's name of a tensor of Pliant's."""
    module = next(module for module in _MODULES if name.startswith(module + "."))
    return _MODULES[module] + name[len(module):]


def _check(path: Path, shapes: Mapping[str, tuple[int, ...]], expected: Mapping[str, tuple[int, ...]]) -> None:
    wrong = [f"{name} {shapes[name]} instead of {shape}" for name, shape in expected.items() if shapes.get(name, shape) != shape]
    found = {"missing": [name for name in expected if name not in shapes],
             "unknown": [name for name in shapes if name not in expected], "of the wrong shape": wrong}
    complaints = []
    for kind, names in found.items():
        if names:
            more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
            complaints.append(f"{kind}: {', '.join(names[:_NAMED])}{more}")
    if complaints:
        raise ConvertError(f"{path} is not the network of DEAL's published code. Tensors {'; '.join(complaints)}")


def _at_cells(weight: torch.Tensor) -> torch.Tensor:
    """The first layer [512, 3200] on features one cell apart, in Pliant's order (row, column, channel; the code's is
    channel, row, column). A feature between two cells is their mean, weighted by distance."""
    places = np.arange(-2, 3)
    shares = torch.from_numpy(np.maximum(0, 1 - np.abs(_STEP_CELLS * places[:, None] - places))).to(weight)
    cells = torch.einsum("ncij,ik,jl->nklc", weight.view(len(weight), -1, 5, 5), shares, shares)
    return cells.reshape(weight.shape)


def _all_control_points(layer: torch.Tensor) -> torch.Tensor:
    """The last layer [2 P, ...] for Pliant's 66 parameters per axis. 8 x 4 control points are every other column of 8 x 8."""
    layer = layer.unflatten(0, (-1, 2))
    columns = (len(layer) - 2) // 8
    rows = np.arange(geometry.TPS_PARAMETERS - 2).reshape(8, 8)[:, ::8 // columns].reshape(-1)[1:] - 1
    all_points = layer.new_zeros(geometry.TPS_PARAMETERS, *layer.shape[1:])
    all_points[rows], all_points[-3:] = layer[:-3], layer[-3:]
    return all_points.flatten(0, 1)


def convert(path: Path) -> tuple[Deal, int]:
    """The network of a checkpoint, and the number of its control points. Raises ConvertError naming unfit tensors."""
    tensors = read_tensors(path)
    network = Deal()
    names = {name: paper_name(name) for name in network.state_dict() if not name.endswith("num_batches_tracked")}
    shapes = {name: tuple(value.shape) for name, value in tensors.items()}
    expected = {paper: tuple(network.state_dict()[name].shape) for name, paper in names.items()}
    last = [names[f"localization.fc4.{kind}"] for kind in ("weight", "bias")]
    points = 32 if shapes.get(last[0], ())[:1] == (68,) else 64  # the published weights have 32, the paper says 64
    expected |= {name: (2 * (points + 2), *expected[name][1:]) for name in last}
    _check(path, shapes, expected)
    state = {name: tensors[paper].double() for name, paper in names.items()}
    state["localization.fc1.weight"] = _at_cells(state["localization.fc1.weight"])
    for kind in ("weight", "bias"):
        state[f"localization.fc4.{kind}"] = _all_control_points(state[f"localization.fc4.{kind}"])
    network.load_state_dict(state, strict=False)
    return network.eval(), points


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("checkpoint", type=Path, help="newdata-DEAL-big.pth of the paper's code")
    parser.add_argument("--out", type=Path, required=True, help="weight file to write")
    arguments = parser.parse_args()
    try:
        network, points = convert(arguments.checkpoint)
        save_model(arguments.out, network, {"radius_per_size": str(RADIUS_PER_SIZE), "source": arguments.checkpoint.name,
                                            "source_sha256": tensor_file.sha256(arguments.checkpoint)})
    except (ConvertError, OSError) as error:
        sys.exit(f"convert: {error}")
    print(f"wrote {arguments.out}\n{_DIFFERENCES.format(points=points)}")


if __name__ == "__main__":
    main()
