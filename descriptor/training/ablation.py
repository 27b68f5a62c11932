# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""The paper's ablation (section 4.3): what the polar grid, deformed data and the warp each add, and
what rings with logarithmic distances add to that.

    python3 -m descriptor.training.ablation --scenes DIR --planar DIR --weights W --dev DIR ... --out RUN

Every setup trains a HardNet from a random start with the same steps and batches. Setups with a warp
get it from a localisation network that is fitted afresh, first, on their own data; the backbone
under it is that of W and frozen in all. The same command continues where RUN stands, and ends with
RUN/ablation.csv, RUN/ablation.png and a table.
"""

from __future__ import annotations

import argparse
import csv
import dataclasses
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import torch

matplotlib.use("Agg")
from matplotlib import pyplot as plt  # noqa: E402

from . import geometry, runtime, warp_fit  # noqa: E402
from .batches import BatchOptions, SceneSet  # noqa: E402
from .cartesian import CartesianDeal  # noqa: E402
from .model import Deal, load_model, save_model  # noqa: E402
from .presets import Stage, preset  # noqa: E402
from .trainer import RADIUS_PER_SIZE, Run, Trainer  # noqa: E402
from .validation import MatchingPair, deal_describer, development_pairs, evaluate, sift_describer  # noqa: E402


@dataclass(frozen=True)
class Setup:
    name: str
    title: str
    data: str = "scenes"
    warp: bool = True
    kind: type[Deal] = Deal
    spacing: str = geometry.LINEAR


SETUPS = (
    Setup("cartesian", "regular grid, warp", kind=CartesianDeal),
    Setup("planar", "polar grid, warp, planar data", data="planar"),
    Setup("fixed", "polar grid, no warp", warp=False),
    Setup("full", "polar grid, warp"),
    Setup("logarithmic", "polar grid, logarithmic, warp", spacing=geometry.LOGARITHMIC),
)


@dataclass(frozen=True)
class Budget:
    """What every setup gets."""

    steps: int = 800
    correspondences: int = 128
    crop_px: int = 240
    fit_scenes: int = 150     # scenes whose features the localisation network is fitted on
    fit_per_view: int = 100   # keypoints of each of their views
    fit_steps: int = 1000
    seed: int = 1

    def stage(self, warp: bool) -> Stage:
        batch = BatchOptions(correspondences=self.correspondences, per_pair=64, crop_px=self.crop_px)
        return Stage("hardnet", self.steps, preset("cpu").stage("hardnet").learning_rate, keep_warp=warp, batch=batch)


def fitted_warp(weights: Path, scenes: Path, out: Path, budget: Budget) -> None:
    """Backbone of weights and a localisation network fitted from the identity on the scenes -> out."""
    model, metadata = load_model(weights)
    table = warp_fit.extract(scenes, model, RADIUS_PER_SIZE, budget.fit_per_view, budget.fit_scenes)
    torch.manual_seed(budget.seed)
    model.localization = Deal().localization
    options = warp_fit.FitOptions(steps=budget.fit_steps, seed=budget.seed)
    r2 = warp_fit.fit(model, warp_fit.CachedFeatures(table, options.held_out), options)
    save_model(out, model, {"radius_per_size": metadata["radius_per_size"], "warp_r2": f"{r2:.4f}"})
    print(f"{out.name}: R2 of the warp on held-out scenes {r2:.3f}", flush=True)


def train(setup: Setup, warp: Path, data: SceneSet, run: Path, budget: Budget, device: torch.device) -> Deal:
    """The trained network of a setup; continues or just reads what the run folder holds."""
    torch.manual_seed(budget.seed)
    model = setup.kind()
    model.set_spacing(setup.spacing)
    fitted, _ = load_model(warp)
    model.backbone, model.localization = fitted.backbone, fitted.localization
    recipe = dataclasses.replace(preset("cpu"), validation_seconds=float("inf"))
    Trainer(Run(run, budget.stage(setup.warp), recipe, budget.seed), model, data, list, device).train()
    return load_model(run / "last.safetensors", setup.kind)[0].to(device)


def measure(models: dict[str, Deal], developments: dict[str, list[MatchingPair]],
            device: torch.device) -> list[dict[str, str]]:
    """A row for each set of pairs and setup, and for SIFT."""
    rows = []
    for name, chosen in developments.items():
        describers = {"SIFT": sift_describer(root=False)}
        for setup in SETUPS:
            describers[setup.title] = deal_describer(models[setup.name], RADIUS_PER_SIZE, setup.warp, device)
        for title, describe in describers.items():
            figures = {key: f"{value:.4f}" for key, value in evaluate(describe, chosen).items()}
            rows.append({"set": name, "pairs": str(len(chosen)), "setup": title, **figures})
            print(f"{name} ({len(chosen)} pairs)  {title:32} "
                  + "  ".join(f"{key} {value}" for key, value in figures.items()), flush=True)
    return rows


def draw(rows: list[dict[str, str]], out: Path) -> None:
    """MMA of every setup as bars, a panel for each set."""
    sets = list(dict.fromkeys(row["set"] for row in rows))
    figure, axes = plt.subplots(1, len(sets), figsize=(6 * len(sets), 3), squeeze=False)
    for axis, name in zip(axes[0], sets):
        mine = [row for row in rows if row["set"] == name][::-1]
        bars = axis.barh([row["setup"] for row in mine], [float(row["mma"]) for row in mine],
                         color=["tab:gray" if row["setup"] == "SIFT" else "tab:blue" for row in mine])
        axis.bar_label(bars, fmt="%.3f", padding=3)
        axis.set_xlim(0, 1)
        axis.set_title(f"{name}, {mine[0]['pairs']} pairs")
        axis.set_xlabel("mean matching accuracy")
    figure.tight_layout()
    figure.savefig(out, dpi=90)
    plt.close(figure)


def ablate(scenes: Path, planar: Path, weights: Path, out: Path, budget: Budget,
           device: torch.device) -> dict[str, Deal]:
    """Trains what is not yet trained; the networks by the setups' names."""
    out.mkdir(parents=True, exist_ok=True)
    models = {}
    for kind, directory in {"scenes": scenes, "planar": planar}.items():
        data = SceneSet([directory])
        print(f"{kind}: {data.describe()}", flush=True)
        warp = out / f"warp-{kind}.safetensors"
        if not warp.exists():
            fitted_warp(weights, directory, warp, budget)
        for setup in SETUPS:
            if setup.data == kind:
                print(f"training: {setup.title}", flush=True)
                models[setup.name] = train(setup, warp, data, out / setup.name, budget, device)
    return models


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--scenes", type=Path, required=True, help="scenes of deformed objects")
    parser.add_argument("--planar", type=Path, required=True, help="scenes of preset planar")
    parser.add_argument("--weights", type=Path, required=True, help="whose backbone all setups share")
    parser.add_argument("--dev", type=Path, nargs="+", required=True, help="folders of scenes to measure on")
    parser.add_argument("--out", type=Path, required=True)
    for field in dataclasses.fields(Budget):
        parser.add_argument("--" + field.name.replace("_", "-"), type=int, default=field.default)
    parser.add_argument("--pairs", type=int, default=120)
    parser.add_argument("--keypoints", type=int, default=1000)
    parser.add_argument("--threads", type=int, default=1)
    arguments = parser.parse_args()
    device = runtime.configure(arguments.threads)
    budget = Budget(**{field.name: getattr(arguments, field.name) for field in dataclasses.fields(Budget)})
    # Read first: a wrong folder is to be known before the training, not after it.
    developments = {str(directory): development_pairs(directory, arguments.pairs, arguments.keypoints)
                    for directory in arguments.dev}
    models = ablate(arguments.scenes, arguments.planar, arguments.weights, arguments.out, budget, device)
    rows = measure(models, developments, device)
    with (arguments.out / "ablation.csv").open("w", newline="") as stream:
        writer = csv.DictWriter(stream, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    draw(rows, arguments.out / "ablation.png")


if __name__ == "__main__":
    main()
