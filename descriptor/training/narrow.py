# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Gives a network descriptors of fewer components, those in which they vary most.

    python3 -m descriptor.training.narrow --weights RUN/joint/last.safetensors --scenes DIR --dim 64 --out narrow.safetensors

HardNet's head is linear, so its layers, their normalisation and the projection on the components are one layer of the
file that is written. The components come from the descriptors of the scenes (teacher.py), which it caches.
"""

from __future__ import annotations

import argparse
import copy
import dataclasses
from pathlib import Path

import numpy as np
import torch

from . import runtime
from .batches import SceneSet
from .model import Deal, Shape, load_model, save_model
from .teacher import Teacher, shared_components


@torch.no_grad()
def narrowed(model: Deal, components: np.ndarray) -> Deal:
    """The network whose descriptors are the model's times components [D, dim], scaled to unit length."""
    old = copy.deepcopy(model.hardnet).double().eval()
    channels, columns = old.get_submodule(f"conv{old.layers}").out_channels, 8

    def head(x: torch.Tensor) -> torch.Tensor:
        for i in range(1, old.head_layers + 1):
            x = old.get_submodule(f"head_bn{i}")(old.get_submodule(f"head{i}")(x))
        return x.flatten(1) @ torch.from_numpy(components)

    offset = head(torch.zeros(1, channels, 1, columns, dtype=torch.float64))
    basis = torch.eye(channels * columns, dtype=torch.float64).view(-1, channels, 1, columns)
    weight = (head(basis) - offset).t().reshape(-1, channels, 1, columns)
    shape = dataclasses.replace(Shape.of(model.state_dict()), head=((1, columns),), dim=components.shape[1])
    network = Deal(shape, model.spacing).eval()
    state = {name: value for name, value in model.state_dict().items() if ".head" not in name}
    eps = network.hardnet.head_bn1.eps
    state |= {"hardnet.head1.weight": weight, "hardnet.head_bn1.running_mean": -offset[0],
              "hardnet.head_bn1.running_var": torch.full((len(weight),), 1 - eps)}
    network.load_state_dict(state, strict=False)
    return network


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--weights", type=Path, required=True)
    parser.add_argument("--scenes", type=Path, nargs="+", required=True)
    parser.add_argument("--dim", type=int, required=True, help="a power of two")
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    runtime.configure(1)
    model, metadata = load_model(arguments.weights)
    data = SceneSet(arguments.scenes, teacher=Teacher(arguments.weights))
    described = np.concatenate([views[0].descriptors for views in data.targets]).astype(np.float64)
    components = shared_components(described, arguments.dim)
    kept = ((described @ components) ** 2).sum() / (described**2).sum()
    save_model(arguments.out, narrowed(model, components),
               {name: value for name, value in metadata.items() if name not in ("format", "radial_spacing")})
    print(f"{arguments.dim} components keep {kept:.4f} of the descriptors' energy")


if __name__ == "__main__":
    main()
