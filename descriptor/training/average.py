# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""The weighted mean of weights along one training run, or of branches of one run.

    python3 -m descriptor.training.average 3:run/joint/last.safetensors 1:earlier.safetensors --out mean.safetensors

Averaging undoes part of the last steps' noise (Izmailov et al. 2018; Wortsman et al. 2022). It needs
weights that descend from the same ones: the mean of strangers is noise. Batch norm's statistics are
averaged like the weights. Metadata are those of the first file.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from .model import Deal, load_model, save_model


def average(weighted: list[tuple[float, Path]]) -> tuple[Deal, dict[str, str]]:
    """The mean network and the first file's metadata. Raises ValueError for weights that do not sum
    to something positive, or networks of different shapes or with differently spaced rings."""
    total = sum(weight for weight, _ in weighted)
    if not total > 0 or any(weight < 0 for weight, _ in weighted):
        raise ValueError("the weights of a mean must not be negative, nor all zero")
    model, metadata = load_model(weighted[0][1])
    mean = {name: value * (weighted[0][0] / total) for name, value in model.state_dict().items()}
    for weight, path in weighted[1:]:
        other, _ = load_model(path)
        if other.spacing != model.spacing:
            raise ValueError(f"{path}: the rings are {other.spacing}, in {weighted[0][1]} {model.spacing}")
        for name, value in other.state_dict().items():
            if value.shape != mean[name].shape:
                raise ValueError(f"{path}: '{name}' is {tuple(value.shape)}, "
                                 f"in {weighted[0][1]} {tuple(mean[name].shape)}")
            mean[name] = mean[name] + value * (weight / total)
    model.load_state_dict({name: mean[name].to(value.dtype) for name, value in model.state_dict().items()})
    return model, metadata


def _weighted(text: str) -> tuple[float, Path]:
    weight, _, path = text.partition(":")
    try:
        if path:
            return float(weight), Path(path)
    except ValueError:
        pass  # not a number: the same complaint
    raise argparse.ArgumentTypeError(f"'{text}' is not WEIGHT:FILE")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("weighted", type=_weighted, nargs="+", metavar="WEIGHT:FILE")
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    model, metadata = average(arguments.weighted)
    save_model(arguments.out, model, {key: value for key, value in metadata.items() if key != "format"})
    print(f"{arguments.out}: mean of {len(arguments.weighted)} files")


if __name__ == "__main__":
    main()
