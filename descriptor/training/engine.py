# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""One training step: from a batch to gradients and figures for the log."""

from __future__ import annotations

import contextlib

import torch
from torch.nn import functional as F

from . import losses
from .batches import Batch
from .fast_linear import linear
from .model import Deal
from .presets import Preset, Stage
from .warp_target import SUPERVISED_POINTS

_HINTS = 4  # windows whose features are compared with the teacher's


def configure_model(model: Deal, stage: Stage, preset: Preset, device: torch.device) -> None:
    """Freezes what the stage does not train and chooses the fast memory layout."""
    model.localization.fc4.precondition()
    model.to(device=device, memory_format=torch.channels_last)
    model.hardnet.dropout = model.localization.dropout = preset.dropout
    backbone = stage.train_backbone
    if backbone not in ("none", "late", "all"):
        raise ValueError(f"train_backbone is none, late or all, not '{backbone}'")
    for part, trained in ((model.hardnet, stage.train_hardnet), (model.localization, stage.train_localization),
                          (model.backbone, backbone == "all"),
                          (model.backbone.layer2, backbone != "none")):
        part.requires_grad_(trained)
        part.train(trained)


def make_optimizer(model: Deal, stage: Stage) -> torch.optim.Adam:
    """Adam with one group for the HardNet and one for the warp; base rates under 'peak'."""
    groups = []
    if stage.train_hardnet:
        groups.append({"params": list(model.hardnet.parameters()), "peak": stage.learning_rate})
    warp = [p for part in (model.backbone, model.localization) for p in part.parameters() if p.requires_grad]
    if warp:
        groups.append({"params": warp, "peak": stage.warp_learning_rate})
    return torch.optim.Adam(groups, lr=stage.learning_rate or stage.warp_learning_rate)


class TrainingStep:
    def __init__(self, model: Deal, stage: Stage, preset: Preset, device: torch.device, teacher: Deal | None = None,
                 components: torch.Tensor | None = None):
        """teacher: of a model whose localisation network is adapted to it. components [D, dim]: of its descriptors,
        those that the model's are to have (teacher.shared_components)."""
        self.model, self.stage, self.preset, self.device = model, stage, preset, device
        self.points = torch.from_numpy(SUPERVISED_POINTS).to(device)
        self.teacher, self.components = teacher, components
        if teacher is not None and stage.trains_warp:
            weight = teacher.localization.fc1.weight.detach().unflatten(1, (25, -1)).flatten(0, 1)
            self.importance = weight.t() @ weight  # [C, C] of the features, to the first layer

    def _move(self, tensor: torch.Tensor) -> torch.Tensor:
        return tensor.to(self.device, non_blocking=True)

    def _precision(self) -> contextlib.AbstractContextManager:
        if self.preset.bfloat16 and self.device.type == "cuda":
            return torch.autocast("cuda", torch.bfloat16)
        return contextlib.nullcontext()

    def _hint(self, maps: torch.Tensor, windows: torch.Tensor) -> torch.Tensor:
        """The share of the teacher's features of the first windows, weighted by their importance, that the features
        maps [I, C, h, w] do not explain (Romero et al., FitNets, ICLR 2015)."""
        with torch.no_grad():
            truth = self.teacher.backbone(windows).flatten(2).transpose(1, 2).flatten(0, 1)
        adapter = self.model.localization.adapter
        found = linear(maps[:_HINTS].float().flatten(2).transpose(1, 2).flatten(0, 1), adapter.weight, adapter.bias)

        def energy(x: torch.Tensor) -> torch.Tensor:
            return (linear(x, self.importance) * x).sum(1).mean()

        return energy(found - truth) / energy(truth - truth.mean(0))

    def _windows(self, batch: Batch, images: torch.Tensor) -> torch.Tensor:
        side = self.stage.batch.crop_px
        return torch.stack([image[y:y + side, x:x + side] for image, (x, y) in zip(images, batch.windows.tolist())])

    def _warp(self, batch: Batch, images: torch.Tensor, keypoints: torch.Tensor,
              index: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """theta of all keypoints (correspondences, then extra ones) from the windows' features, and those features."""
        windows = self._windows(batch, images)
        index = torch.cat([index, self._move(batch.extra_index)])
        where = torch.cat([keypoints, self._move(batch.extra_keypoints)])
        local = where.clone()
        local[:, :2] -= self._move(batch.windows)[index]
        with torch.set_grad_enabled(self.stage.train_backbone != "none"), self._precision():
            maps = self.model.backbone(windows)
        sampled = self.model.sample(maps.float(), windows.shape[1:], index, local)
        return self.model.localization(sampled), maps

    def _describe(self, batch: Batch, images: torch.Tensor, keypoints: torch.Tensor,
                  index: torch.Tensor, theta: torch.Tensor | None) -> tuple[torch.Tensor, torch.Tensor]:
        displacement = None if theta is None else self.model.displacement(theta[:len(index)])
        patches = self.model.patches(images, index, keypoints, batch.radius_per_size, displacement)
        if self.preset.patch_noise > 0:
            strength = torch.rand(len(patches), 1, 1, device=self.device) * self.preset.patch_noise
            patches = patches + torch.randn_like(patches) * strength
        with self._precision():
            return self.model.hardnet(patches).float().chunk(2)

    def __call__(self, batch: Batch, progress: float) -> tuple[torch.Tensor, dict[str, torch.Tensor]]:
        """Of a batch of tensors (batches.to_tensors): the loss (to be differentiated) and the figures of the step,
        which stay on the device, so that a GPU need not be waited for."""
        stage, figures = self.stage, {}
        clean = self._move(batch.images).float().div_(255)
        images = clean.clamp(1e-3).pow_(self._move(batch.gamma)[:, None, None])
        keypoints, index = self._move(batch.keypoints), self._move(batch.index)
        loss, theta = torch.zeros((), device=self.device), None
        taught = self._move(batch.theta) if stage.distill else None
        if stage.trains_warp or (stage.uses_warp and taught is None):
            theta, maps = self._warp(batch, images, keypoints, index)
        else:
            theta = taught
        if stage.trains_warp:
            predicted = self.model.displacement(theta, self.points)
            truth, known = self._move(batch.warp), self._move(batch.warp_known)
            if stage.distill:
                truth = self.model.displacement(taught, self.points)
                known = torch.ones_like(known)
            supervised = losses.warp_loss(predicted, truth, known)
            start, end = stage.warp_weight
            loss = loss + (start + (end - start) * progress) * supervised
            figures["warp_loss"] = supervised.detach()
            figures["warp_error"], figures["warp_truth"] = losses.warp_r2_terms(predicted, truth, known)
        if self.teacher is not None and stage.trains_warp:
            hint = self._hint(maps, self._windows(batch, clean)[:_HINTS])
            loss = loss + hint
            figures["hint"] = hint.detach()
        if stage.train_hardnet:
            a, b = self._describe(batch, images, keypoints, index, theta)
            first, second = keypoints[:, :2].chunk(2)
            ignore = losses.false_negatives(first, second, self._move(batch.surface), self._move(batch.texture))
            if stage.triplet:
                matching = losses.triplet(a, b, ignore)
            else:
                matching = losses.info_nce(a, b, ignore, stage.temperature)
            loss = loss + matching
            figures["loss"] = matching.detach()
            if stage.distill:
                wanted = F.normalize(linear(self._move(batch.descriptors), self.components.t()))
                distilled = losses.distillation(a, b, *wanted.chunk(2), stage.temperature)
                loss = loss + distilled
                figures["distillation"] = distilled.detach()
            figures["positive"], figures["negative"], figures["accuracy"] = losses.separation(a, b, ignore)
        return loss, figures
