# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""The training loop of one stage: resume, step, log, validate, checkpoint."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Callable

import numpy as np
import torch

from . import geometry
from .batches import SceneSet, batches
from .checkpoint import CsvLog, read_checkpoint, write_checkpoint
from .engine import TrainingStep, configure_model, make_optimizer
from .model import Deal, save_model
from .presets import Preset, Stage
from .schedule import Schedule, rate_factor
from .teacher import shared_components
from .validation import MatchingPair, deal_describer, evaluate

RADIUS_PER_SIZE = 9.0   # support radius of validation and of the exported model
_LOG_EVERY = 20
_WARP_CLIP = 1.0        # norm of the gradient of the warp's parameters


@dataclass(frozen=True)
class Run:
    """What a stage is to do and where."""

    directory: Path
    stage: Stage
    preset: Preset
    seed: int
    deadline: float | None = None    # seconds since the epoch; None: by steps
    stop_after_seconds: float = 0.0  # leave early with a checkpoint; 0 = run to the end
    info: tuple[tuple[str, str], ...] = ()  # further metadata of the exported weights


class Trainer:
    def __init__(self, run: Run, model: Deal, data: SceneSet, development: Callable[[], list[MatchingPair]],
                 device: torch.device, teacher: Deal | None = None):
        """development is called before the first validation only; an empty list means none."""
        self.run, self.model, self.data, self.device = run, model, data, device
        self.development, self.pairs = development, None
        configure_model(model, run.stage, run.preset, device)
        self.optimizer = make_optimizer(model, run.stage)
        self.step, self.seconds, self.best, self.validated = 0, 0.0, -1.0, 0.0
        self.schedule = Schedule(run.stage.steps, run.deadline, time.time())
        self.components: torch.Tensor | None = None  # of the teacher's descriptors; the same after new scenes
        run.directory.mkdir(parents=True, exist_ok=True)
        self._resume()
        self.log = CsvLog(run.directory / "log.csv", self.step)
        self.validation_log = CsvLog(run.directory / "validation.csv", self.step)
        if teacher is not None and self.components is None:
            described = np.concatenate([views[0].descriptors for views in data.targets]).astype(np.float64)
            self.components = torch.from_numpy(shared_components(described, model.dim)).float().to(device)
        self.compute = TrainingStep(model, run.stage, run.preset, device, teacher, self.components)

    def _resume(self) -> None:
        state = read_checkpoint(self.run.directory, self.device)
        if state is None:
            return
        if state["stage"] != self.run.stage.name:
            raise ValueError(f"{self.run.directory} holds a checkpoint of stage '{state['stage']}', "
                             f"not '{self.run.stage.name}'")
        self.model.load_state_dict(state["model"])
        self.model.set_spacing(state.get("spacing", geometry.LINEAR))
        self.optimizer.load_state_dict(state["optimizer"])
        self.step, self.seconds, self.best = state["step"], state["seconds"], state["best"]
        self.schedule.started, self.validated = state["started"], state.get("validated", self.seconds)
        self.components = state.get("components")

    def _checkpoint(self) -> None:
        write_checkpoint(self.run.directory, {
            "stage": self.run.stage.name, "model": self.model.state_dict(),
            "optimizer": self.optimizer.state_dict(), "step": self.step, "seconds": self.seconds,
            "best": self.best, "validated": self.validated, "started": self.schedule.started,
            "spacing": self.model.spacing, "components": self.components})
        self._export("last.safetensors")

    def _export(self, name: str) -> None:
        info = {"radius_per_size": str(RADIUS_PER_SIZE), "stage": self.run.stage.name,
                "steps": str(self.step), "seconds": f"{self.seconds:.0f}", **dict(self.run.info)}
        save_model(self.run.directory / name, self.model, info)

    def _validate(self) -> None:
        if self.pairs is None:
            self.pairs = self.development()
        self.validated = self.seconds
        if not self.pairs:
            return
        describe = deal_describer(self.model, RADIUS_PER_SIZE, self.run.stage.uses_warp, self.device)
        figures = evaluate(describe, self.pairs)
        self.validation_log.add({"step": self.step, "seconds": self.seconds, **figures})
        print(f"step {self.step} validation " + " ".join(f"{k} {v:.4f}" for k, v in figures.items()), flush=True)
        if figures["mma"] > self.best:
            self.best = figures["mma"]
            self._export("best.safetensors")

    def _optimize(self, loss: torch.Tensor, progress: float) -> None:
        factor = rate_factor(progress, self.run.stage.warmup, self.run.stage.final_rate)
        for group in self.optimizer.param_groups:
            group["lr"] = group["peak"] * factor
        self.optimizer.zero_grad(set_to_none=True)
        loss.backward()
        if self.run.stage.trains_warp:
            torch.nn.utils.clip_grad_norm_(self.optimizer.param_groups[-1]["params"], _WARP_CLIP)
        self.optimizer.step()

    def train(self) -> bool:
        """Runs until the stage is done (True) or stop_after_seconds have passed (False)."""
        start = time.monotonic()
        marks = {"checkpoint": start, "log": start}
        collected: list[dict[str, torch.Tensor]] = []
        before, preset = self.seconds, self.run.preset
        source = batches(self.data, self.run.stage.batch, self.run.seed, self.step, preset.workers)
        while not self.schedule.done(self.step):
            progress = self.schedule.progress(self.step)
            # Seeded by the step, so that a resumed run draws the same noise.
            torch.manual_seed(self.run.seed * 1_000_003 + self.step)
            loss, figures = self.compute(next(source), progress)
            self._optimize(loss, progress)
            self.step += 1
            collected.append(figures)
            now = time.monotonic()
            self.seconds = before + now - start
            stop = bool(self.run.stop_after_seconds) and now - start > self.run.stop_after_seconds
            save = stop or now - marks["checkpoint"] > preset.checkpoint_seconds
            if save or self.step % _LOG_EVERY == 0:
                self._write_log(collected, progress, now - marks["log"])
                collected, marks["log"] = [], now
            if self.seconds - self.validated > preset.validation_seconds:
                self._validate()
                marks["log"] = time.monotonic()
            if save:
                self._checkpoint()
                marks["checkpoint"] = time.monotonic()
            if stop:
                return False
        source.close()
        if collected:
            self._write_log(collected, 1.0, time.monotonic() - marks["log"])
        self._validate()
        self._checkpoint()
        return True

    def _write_log(self, collected: list[dict[str, torch.Tensor]], progress: float, seconds: float) -> None:
        """Means of the steps since the last row. Raises FloatingPointError, before anything is saved, if a loss is not finite."""
        table = torch.stack([torch.stack([value.float() for value in row.values()]) for row in collected])
        mean = dict(zip(collected[0], table.mean(0).tolist()))
        if not all(map(math.isfinite, mean.values())):
            raise FloatingPointError(f"a loss is not finite in steps {self.step - len(collected)} to {self.step - 1}: {mean}")
        if "warp_truth" in mean:
            mean["warp_r2"] = 1 - mean.pop("warp_error") / max(mean.pop("warp_truth"), 1e-9)
        rate = len(collected) * self.run.stage.batch.correspondences / max(seconds, 1e-9)
        row = {"step": self.step, "seconds": self.seconds, "progress": progress, **mean, "pairs_per_s": rate}
        self.log.add(row)
        print(" ".join(f"{key} {value:.4g}" if isinstance(value, float) else f"{key} {value}"
                       for key, value in row.items()), flush=True)
