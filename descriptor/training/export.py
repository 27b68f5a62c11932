# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Turns the weights of a run into what the project ships: weights, model card, goldens, figures.

    python3 -m descriptor.training.export --weights RUN/joint/last.safetensors --dev DEV_SCENES \
        --model descriptor/model --goldens tests/data --against descriptor/model/deal.safetensors

The comparison (SIFT, RootSIFT, the weights with and without warp, and those of --against) is made
on the development scenes with shared keypoints and written to comparison.csv and to the card.

    python3 -m descriptor.training.export --onnx deal.onnx

writes the shipped weights, or those of --weights, as an ONNX graph (see onnx_model.py), and nothing else.
"""

from __future__ import annotations

import argparse
import csv
import dataclasses
import datetime
import json
import shutil
from pathlib import Path

import torch

from . import runtime, tensor_file
from .goldens import write_goldens
from .model import load_model, save_model
from .onnx_model import OPSET, OnnxError, write_onnx
from .validation import MatchingPair, deal_describer, development_pairs, evaluate, sift_describer

_SHIPPED = Path(__file__).resolve().parent.parent / "model" / "deal.safetensors"

_LIMITS = """## Limits

- Trained on simulated cloth only. Real materials bend, shine and blur in ways that the simulator does not know.
- The descriptor describes SIFT keypoints; where SIFT finds nothing twice, nothing can be matched.
- Rotation in the image is free; mirror images and views from behind are not covered.
- Repeated patterns look alike to it, as to every local descriptor.

## Conventions

Metadata: `format` = `pliant-deal`; `radius_per_size`: support radius R over the keypoint's size. Polar grid, control points and sampling are
those of `descriptor/deal/network.h` and `descriptor/training`. Tensor names follow ResNet's habit: `backbone.*`, `localization.fc1..4`,
`hardnet.*`; PyTorch layouts. The localisation network's widths are read from the tensors.
"""


@dataclasses.dataclass(frozen=True)
class Row:
    """One line of the comparison: means over the development pairs."""

    method: str
    ms: float
    mma: float
    precision: float
    ms_to_sift: float


def compare(weights: dict[str, Path], pairs: list[MatchingPair], device: torch.device,
            radius: float | None = None) -> list[Row]:
    """SIFT, RootSIFT, and each weight file with and without warp, on the same pairs."""
    describers = {"SIFT": sift_describer(root=False), "RootSIFT": sift_describer(root=True)}
    for name, path in weights.items():
        model, metadata = load_model(path)
        model.to(device)
        used = radius or float(metadata["radius_per_size"])
        describers[name] = deal_describer(model, used, True, device)
        describers[f"{name}, fixed grid"] = deal_describer(model, used, False, device)
    rows: list[Row] = []
    for name, describe in describers.items():
        figures = evaluate(describe, pairs)
        base = rows[0].ms if rows else figures["ms"]
        rows.append(Row(name, figures["ms"], figures["mma"], figures["precision"], figures["ms"] / base))
        print(_table_line(rows[-1]), flush=True)
    return rows


def best_radius(path: Path, pairs: list[MatchingPair], radii: list[float], device: torch.device) -> float:
    """The support radius (per keypoint size) with the highest MMA."""
    model, _ = load_model(path)
    model.to(device)
    scores = {radius: evaluate(deal_describer(model, radius, True, device), pairs)["mma"] for radius in radii}
    for radius, mma in scores.items():
        print(f"radius {radius:g} MMA {mma:.4f}", flush=True)
    return max(scores, key=scores.__getitem__)


def _table_line(row: Row) -> str:
    return f"| {row.method} | {row.ms:.3f} | {row.mma:.3f} | {row.precision:.3f} | {row.ms_to_sift:.2f} |"


def model_card(metadata: dict[str, str], rows: list[Row], pairs: int, digest: str) -> str:
    facts = "\n".join(f"| {key} | {value} |" for key, value in metadata.items())
    table = "\n".join(_table_line(row) for row in rows)
    return f"""# Model card: `deal.safetensors`

Weights of the DEAL network (Potje et al., NeurIPS 2021) as Pliant runs it. SHA-256 `{digest}`; the model id is `deal:` and its first 16 hex
digits. Features, vocabularies and databases carry that id; replacing the file makes them incompatible, and Pliant says so. Written by `python3 -m descriptor.training.export`; figures and facts come from that run.

| training | |
|---|---|
{facts}

## Development set

{pairs} pairs of views of simulated objects whose textures are not in the training set; SIFT keypoints (one per place), shared by all
methods, 3 px. MS = correct / min(keypoints), MMA = correct among the true pairs, precision = correct mutual nearest neighbours.

| method | MS | MMA | precision | MS / MS(SIFT) |
|---|---|---|---|---|
{table}

{_LIMITS}"""


def export(arguments: argparse.Namespace, device: torch.device) -> None:
    weights: Path = arguments.weights
    model, metadata = load_model(weights)
    pairs = development_pairs(arguments.dev, arguments.pairs, arguments.keypoints)
    print(f"{len(pairs)} development pairs", flush=True)
    if arguments.radii:
        chosen = best_radius(weights, pairs[::4], arguments.radii, device)
        metadata = {**metadata, "radius_per_size": f"{chosen:g}"}
    metadata = {**metadata, **dict(item.split("=", 1) for item in arguments.fact),
                "exported": datetime.date.today().isoformat()}
    arguments.model.mkdir(parents=True, exist_ok=True)
    against = {}
    if arguments.against is not None:
        kept = arguments.model / "previous.safetensors"
        shutil.copyfile(arguments.against, kept)
        against = {"previous weights": kept}
    target = arguments.model / "deal.safetensors"
    save_model(target, model, {k: v for k, v in metadata.items() if k != "format"}, half=True)
    rows = compare({"deal": target, **against}, pairs, device)
    for path in against.values():
        path.unlink()
    (arguments.model / "README.md").write_text(
        model_card(metadata, rows, len(pairs), tensor_file.sha256(target)))
    with (arguments.model / "comparison.csv").open("w", newline="") as stream:
        writer = csv.DictWriter(stream, [field.name for field in dataclasses.fields(Row)])
        writer.writeheader()
        writer.writerows(dataclasses.asdict(row) for row in rows)
    write_goldens(target, arguments.goldens)
    print(json.dumps({"weights": str(target), "sha256": tensor_file.sha256(target), "pairs": len(pairs)}))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--onnx", type=Path, help="write the network to this file as ONNX")
    parser.add_argument("--weights", type=Path, help="weights of a run (with --onnx: default the shipped ones)")
    parser.add_argument("--dev", type=Path, help="folder of development scenes")
    parser.add_argument("--model", type=Path, help="folder for weights and card")
    parser.add_argument("--goldens", type=Path, help="folder for the goldens")
    parser.add_argument("--against", type=Path, help="earlier weights for the comparison")
    parser.add_argument("--pairs", type=int, default=120)
    parser.add_argument("--keypoints", type=int, default=1024)
    parser.add_argument("--radii", type=float, nargs="*", default=[], help="candidates for radius_per_size")
    parser.add_argument("--fact", action="append", default=[], help="key=value for metadata and card")
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
