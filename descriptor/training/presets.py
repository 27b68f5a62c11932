# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Training recipes. A preset is a set of stages; README.md says what each is for."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field

from . import geometry
from .batches import BatchOptions


@dataclass(frozen=True)
class Stage:
    """One stage: what is trained, on what, how long."""

    name: str
    steps: int
    learning_rate: float               # peak, of the HardNet
    warp_learning_rate: float = 0.0    # peak, of backbone and localisation network
    final_rate: float = 0.01           # learning rates end at this share of their peak (cosine)
    warmup: float = 0.02               # share of the stage with linearly rising rates
    train_hardnet: bool = True
    train_backbone: str = "none"       # "none", "late" (its second residual stage only) or "all"
    train_localization: bool = False
    triplet: bool = False              # hardest-in-batch triplet instead of InfoNCE
    temperature: float = 0.07
    warp_weight: tuple[float, float] = (0.0, 0.0)  # supervised warp: at the start, at the end
    keep_warp: bool = False            # a warp is applied (the model's; with distill, the teacher's) though nothing of it is trained
    distill: bool = False              # towards a teacher's warps or descriptors (teacher.py)
    batch: BatchOptions = field(default_factory=BatchOptions)

    @property
    def trains_warp(self) -> bool:
        return self.train_backbone != "none" or self.train_localization

    @property
    def uses_warp(self) -> bool:
        return self.keep_warp or self.trains_warp


@dataclass(frozen=True)
class Preset:
    stages: tuple[Stage, ...]
    spacing: str = geometry.LOGARITHMIC  # of the polar grid's rings, for weights that start from nothing
    dropout: float = 0.1
    patch_noise: float = 0.02          # standard deviation of the noise on patches, up to this
    checkpoint_seconds: float = 120
    validation_seconds: float = 600
    validation_pairs: int = 24
    validation_keypoints: int = 512
    bfloat16: bool = False             # autocast on CUDA
    workers: int = 0                   # processes that prepare batches; 0 = in line

    def stage(self, name: str) -> Stage:
        for stage in self.stages:
            if stage.name == name:
                return stage
        raise ValueError(f"no stage '{name}' (there are {', '.join(s.name for s in self.stages)})")


def _stages(steps: tuple[int, int, int], correspondences: int, crop_px: int, rates: tuple[float, float],
            joint_backbone: str = "all", triplet: bool = True) -> tuple[Stage, ...]:
    """hardnet alone -> warp from the simulator's truth -> both."""
    plain = BatchOptions(correspondences=correspondences)
    cropped = dataclasses.replace(plain, crop_px=crop_px, extra_keypoints=48)
    hardnet_rate, warp_rate = rates
    return (
        Stage("hardnet", steps[0], hardnet_rate, batch=plain),
        Stage("warp", steps[1], 0.0, warp_rate, final_rate=0.05, train_hardnet=False, train_backbone="all",
              train_localization=True, warp_weight=(1.0, 1.0),
              batch=dataclasses.replace(cropped, correspondences=max(correspondences // 2, 8))),
        Stage("joint", steps[2], hardnet_rate * 0.3, warp_rate * 0.5, train_backbone=joint_backbone,
              train_localization=True, triplet=triplet, warp_weight=(10.0, 2.0), batch=cropped),
    )


def _distill(steps: tuple[int, int], correspondences: int, crop_px: int) -> tuple[Stage, ...]:
    """A smaller network from a teacher's warps and descriptors, which hold for one support radius: its warp, then its
    HardNet, on patches that the teacher's warp has sampled."""
    plain = BatchOptions(correspondences=correspondences, per_pair=64, radius_per_size=(8.4, 9.6), size_jitter=0.1)
    cropped = dataclasses.replace(plain, correspondences=max(correspondences // 2, 8), crop_px=crop_px, extra_keypoints=64)
    return (
        Stage("distill-warp", steps[0], 0.0, 1e-3, train_hardnet=False, train_backbone="all", train_localization=True,
              distill=True, warp_weight=(10.0, 10.0), batch=cropped),
        Stage("distill-head", steps[1], 2e-3, keep_warp=True, distill=True, batch=plain),
    )


def _paper() -> Preset:
    # Section 4: batches of 8 pairs x up to 128 correspondences, Adam 5e-5. The rate holds for
    # weights that start from ImageNet; from scratch a higher one with a cosine does better.
    # The rings are linear in the paper's code.
    stages = _stages((10000, 5000, 25000), 1024, 320, (1e-3, 5e-4))
    return Preset(tuple(dataclasses.replace(s, batch=dataclasses.replace(s.batch, per_pair=128)) for s in stages), geometry.LINEAR)


def _gpu() -> Preset:
    # The last stage is that of the weights trained so far (cpu), with the paper's batch and the whole backbone.
    hardnet, warp, joint = _stages((12000, 8000, 20000), 1024, 320, (1.5e-3, 5e-4), triplet=False)
    joint = dataclasses.replace(joint, learning_rate=1e-3, warp_learning_rate=4e-4, batch=_disagreeing(joint.batch))
    return Preset((hardnet, warp, joint, *_distill((12000, 30000), 1024, 320)), dropout=0.0, bfloat16=True, workers=10, checkpoint_seconds=60,
                  validation_seconds=240, validation_pairs=48, validation_keypoints=1024)


def _disagreeing(batch: BatchOptions) -> BatchOptions:
    """Partners whose sizes disagree are what the descriptor loses most of: they are drawn on purpose."""
    return dataclasses.replace(batch, extra_keypoints=24, per_pair=64, size_jitter=0.15, radius_per_size=(7.0, 12.0))


def _cpu() -> Preset:
    # Two cores: smaller batches, no dropout (the schedule is far too short to overfit). The joint
    # stage trains the late half of the backbone, whose gradient costs a quarter more a step.
    # Hardest-in-batch triplets need longer schedules.
    hardnet, warp, joint = _stages((4000, 3000, 1500), 256, 240, (1.5e-3, 1e-3), joint_backbone="late",
                                   triplet=False)
    joint = dataclasses.replace(joint, learning_rate=8e-4, warp_learning_rate=3e-4, batch=_disagreeing(joint.batch))
    return Preset((hardnet, warp, joint, *_distill((4000, 20000), 512, 240)), dropout=0.0, validation_seconds=1500, validation_pairs=12,
                  validation_keypoints=300)


def _tiny() -> Preset:
    return Preset((*_stages((6, 3, 3), 24, 96, (1e-3, 1e-3)), *_distill((3, 3), 24, 96)), dropout=0.1, checkpoint_seconds=1e9,
                  validation_seconds=1e9, validation_pairs=2, validation_keypoints=64)


PRESETS = {"paper": _paper, "gpu": _gpu, "cpu": _cpu, "tiny": _tiny}


def preset(name: str) -> Preset:
    if name not in PRESETS:
        raise ValueError(f"no preset '{name}' (there are {', '.join(PRESETS)})")
    return PRESETS[name]()
