# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Batches for consecutive steps, in line or prepared ahead by worker processes."""

from __future__ import annotations

import dataclasses
import sys
from typing import Iterator

import numpy as np
import torch
from torch.utils.data import DataLoader, Dataset

from .batches import Batch, BatchOptions, SceneSet, draw_batch


def to_tensors(batch: Batch) -> Batch:
    """The same with tensors in place of arrays: they pass between processes through shared memory."""
    arrays = {name: torch.from_numpy(np.ascontiguousarray(value)) for name, value in vars(batch).items()
              if isinstance(value, np.ndarray)}
    return dataclasses.replace(batch, **arrays)


class _Steps(Dataset):
    """The batch of step i at i."""

    def __init__(self, data: SceneSet, options: BatchOptions, seed: int):
        self.data, self.options, self.seed = data, options, seed

    def __getitem__(self, step: int) -> Batch:
        return to_tensors(draw_batch(self.data, self.options, self.seed, step))


def _itself(batch: Batch) -> Batch:
    return batch


def batches(data: SceneSet, options: BatchOptions, seed: int, first_step: int,
            workers: int) -> Iterator[Batch]:
    """Yields the batches of first_step, first_step + 1, ... for ever, as tensors."""
    # A generator of its own: the loader draws from it, and the training's noise must not depend on that.
    loader = DataLoader(_Steps(data, options, seed), batch_size=None, sampler=range(first_step, sys.maxsize),
                        num_workers=workers, collate_fn=_itself, generator=torch.Generator(),
                        multiprocessing_context="fork" if workers > 0 else None)
    yield from loader
