# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Turns the weights of a run into what the project ships: weights, goldens, figures.

    python3 -m descriptor.training.export --weights RUN/joint/last.safetensors --dev DEV_SCENES \
        --model descriptor/model/deal.safetensors --goldens tests/data --against descriptor/model/deal.safetensors

The comparison (SIFT, RootSIFT, the weights with and without warp, and those of --against) is made
on the development scenes with shared keypoints, printed as the model card's table, and written to
comparison.csv beside the run's weights. The model card is written by hand.

    python3 -m descriptor.training.export --onnx deal.onnx

writes the shipped weights, or those of --weights, as an ONNX graph (see onnx_model.py), and nothing else.
"""

from __future__ import annotations

import argparse
import csv
import datetime
import json
from pathlib import Path

import torch

from . import runtime, tensor_file
from .goldens import write_goldens
from .model import Deal, load_model, save_model
from .onnx_model import OPSET, OnnxError, write_onnx
from .validation import MatchingPair, deal_describer, development_pairs, evaluate, sift_describer

_SHIPPED = Path(__file__).resolve().parent.parent / "model" / "deal.safetensors"


def compare(models: dict[str, tuple[Deal, dict[str, str]]], pairs: list[MatchingPair],
            device: torch.device) -> list[dict]:
    """Means over the development pairs for SIFT, RootSIFT, and each model (with its metadata) with and without warp, on the same pairs."""
    describers = {"SIFT": sift_describer(root=False), "RootSIFT": sift_describer(root=True)}
    for name, (model, metadata) in models.items():
        for suffix, warp in (("", True), (", fixed grid", False)):
            describers[name + suffix] = deal_describer(model.to(device), float(metadata["radius_per_size"]), warp, device)
    rows: list[dict] = []
    for name, describe in describers.items():
        figures = evaluate(describe, pairs)
        base = rows[0]["ms"] if rows else figures["ms"]
        rows.append({"method": name, **figures, "ms_to_sift": figures["ms"] / base})
        print("| {method} | {ms:.3f} | {mma:.3f} | {precision:.3f} | {ms_to_sift:.2f} |".format(**rows[-1]), flush=True)
    return rows


def export(arguments: argparse.Namespace, device: torch.device) -> None:
    pairs = development_pairs(arguments.dev, arguments.pairs, arguments.keypoints)
    print(f"{len(pairs)} development pairs", flush=True)
    # Read first: the new weights may replace them.
    against = {} if arguments.against is None else {"previous weights": load_model(arguments.against)}
    model, metadata = load_model(arguments.weights)
    metadata = {**metadata, "exported": datetime.date.today().isoformat()}
    target = arguments.model
    target.parent.mkdir(parents=True, exist_ok=True)
    save_model(target, model, {k: v for k, v in metadata.items() if k != "format"}, half=True)
    rows = compare({target.stem: load_model(target), **against}, pairs, device)
    with (arguments.weights.parent / "comparison.csv").open("w", newline="") as stream:
        writer = csv.DictWriter(stream, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    write_goldens(target, arguments.goldens)
    print(json.dumps({"weights": str(target), "sha256": tensor_file.sha256(target), "pairs": len(pairs)}))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--onnx", type=Path, help="write the network to this file as ONNX")
    parser.add_argument("--weights", type=Path, help="weights of a run (with --onnx: default the shipped ones)")
    parser.add_argument("--dev", type=Path, help="folder of development scenes")
    parser.add_argument("--model", type=Path, help="weight file to write")
    parser.add_argument("--goldens", type=Path, help="folder for the goldens")
    parser.add_argument("--against", type=Path, help="earlier weights for the comparison")
    parser.add_argument("--pairs", type=int, default=120)
    parser.add_argument("--keypoints", type=int, default=1024)
    parser.add_argument("--threads", type=int, default=1)
    arguments = parser.parse_args()
    if arguments.onnx is not None:
        try:
            write_onnx(arguments.weights or _SHIPPED, arguments.onnx)
        except (OnnxError, tensor_file.TensorFileError, OSError) as error:
            parser.exit(1, f"export: {error}\n")
        print(f"wrote {arguments.onnx}: {arguments.onnx.stat().st_size} bytes, ONNX opset {OPSET}")
        return
    missing = [name for name in ("weights", "dev", "model", "goldens") if getattr(arguments, name) is None]
    if missing:
        parser.error("the following arguments are required: " + ", ".join(f"--{name}" for name in missing))
    export(arguments, runtime.configure(arguments.threads))


if __name__ == "__main__":
    main()
