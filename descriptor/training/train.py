# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Trains one stage; continues where its run folder's checkpoint stands.

    python3 -m descriptor.training.train --preset cpu --stage hardnet --scenes DIR --run RUN/hardnet
"""

from __future__ import annotations

import argparse
import dataclasses
import platform
import sys
from pathlib import Path

import torch

from . import geometry, runtime
from .backbone import gabor_start
from .batches import SceneSet
from .checkpoint import read_checkpoint
from .model import SHAPES, Deal, LocalizationNet, Shape, load_model
from .presets import PRESETS, Preset, preset
from .schedule import parse_deadline
from .teacher import Teacher
from .trainer import Run, Trainer
from .validation import MatchingPair, development_pairs


def resumed_model(run: Path) -> Deal | None:
    """A network of the shape of the run folder's checkpoint (which the trainer then loads, with its spacing)."""
    state = read_checkpoint(run, torch.device("cpu"))
    if state is None:
        return None
    model = Deal(Shape.of(state["model"]))
    adapter = state["model"].get("localization.adapter.weight")
    if adapter is not None:
        wide, narrow = adapter.shape
        model.localization = LocalizationNet(wide, Shape.of(state["model"]).hidden).adapted(narrow)
    return model


def starting_model(init: Path | None, init_warp: Path | None, seed: int, spacing: str | None = None,
                   shape: str = "deal") -> Deal:
    """Fresh weights (Gabor start for the backbone), or those of files: init gives everything,
    init_warp overrides backbone and localisation network. Without `spacing`, the rings are those of the
    file, or those of most presets."""
    torch.manual_seed(seed)
    if init is None and init_warp is None:
        model = Deal(SHAPES[shape], spacing or Preset.spacing)
        gabor_start(model.backbone)
        return model
    model, _ = load_model(init or init_warp)
    if spacing is not None:
        model.set_spacing(spacing)
    if init_warp is not None and init is not None:
        warp, _ = load_model(init_warp)
        model.backbone, model.localization = warp.backbone, warp.localization
    return model


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--preset", choices=sorted(PRESETS), default="paper")
    parser.add_argument("--stage", required=True, help="hardnet, warp, joint, distill-warp or distill-head")
    parser.add_argument("--shape", choices=list(SHAPES), default="deal", help="of the network, without --init")
    parser.add_argument("--teacher", type=Path, help="weights that the stages distill-... learn from")
    parser.add_argument("--scenes", type=Path, nargs="+", required=True, help="folders of scene_*.safetensors")
    parser.add_argument("--dev", type=Path, help="folder of development scenes for validation")
    parser.add_argument("--run", type=Path, required=True, help="run folder of this stage")
    parser.add_argument("--init", type=Path, help="weights to start from")
    parser.add_argument("--init-warp", type=Path, help="backbone and localisation network to start from")
    parser.add_argument("--spacing", choices=geometry.SPACINGS,
                        help="of the polar grid's rings; default: that of --init, --init-warp or --teacher, else the preset's")
    parser.add_argument("--steps", type=int, help="overrides the stage's number of steps")
    parser.add_argument("--until", help="HH:MM or HH:MM:SS UTC: schedule by the clock instead of by steps")
    parser.add_argument("--seconds", type=float, default=0, help="stop with a checkpoint after this long")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--seed", type=int, default=1)
    return parser.parse_args()


def main() -> None:
    arguments = parse_arguments()
    device = runtime.configure(arguments.threads)
    recipe = preset(arguments.preset)
    stage = recipe.stage(arguments.stage)
    if arguments.steps is not None:
        stage = dataclasses.replace(stage, steps=arguments.steps)
    if stage.distill != (arguments.teacher is not None):
        sys.exit("the stages distill-warp and distill-head need --teacher, and no other stage takes it")
    teacher = None if arguments.teacher is None else Teacher(arguments.teacher, device)
    spacing = arguments.spacing
    if spacing is None and arguments.init is None and arguments.init_warp is None:
        spacing = recipe.spacing if teacher is None else teacher.model.spacing
    model = resumed_model(arguments.run)
    if model is None:
        model = starting_model(arguments.init, arguments.init_warp, arguments.seed, spacing, arguments.shape)
        if teacher is not None and stage.trains_warp:
            model.localization = teacher.model.localization.adapted(model.localization.fc1.in_features // 25)
    data = SceneSet(arguments.scenes, teacher=teacher)
    print(f"{data.describe()}; {device}, {arguments.threads} threads", flush=True)

    def development() -> list[MatchingPair]:
        if arguments.dev is None:
            return []
        return development_pairs(arguments.dev, recipe.validation_pairs, recipe.validation_keypoints)

    run = Run(arguments.run, stage, recipe, arguments.seed,
              None if arguments.until is None else parse_deadline(arguments.until), arguments.seconds,
              (("preset", arguments.preset), ("scenes", str(len(data))), ("seed", str(arguments.seed)),
               ("torch", torch.__version__), ("machine", f"{platform.machine()} {device}")))
    finished = Trainer(run, model, data, development, device, None if teacher is None else teacher.model).train()
    print("finished" if finished else "stopped; the same command continues", flush=True)


if __name__ == "__main__":
    main()
