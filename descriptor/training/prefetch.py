# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Batches for consecutive steps, in line or prepared ahead by worker processes."""

from __future__ import annotations

from collections import deque
from concurrent.futures import ProcessPoolExecutor
from typing import Iterator

from .batches import Batch, BatchOptions, SceneSet, draw_batch

_shared: tuple[SceneSet, BatchOptions, int] | None = None


def _draw(step: int) -> Batch:
    return draw_batch(*_shared, step)


def batches(data: SceneSet, options: BatchOptions, seed: int, first_step: int,
            workers: int) -> Iterator[Batch]:
    """Yields the batches of first_step, first_step + 1, ... for ever."""
    if workers <= 0:
        step = first_step
        while True:
            yield draw_batch(data, options, seed, step)
            step += 1
    global _shared
    _shared = (data, options, seed)  # inherited by the forked workers
    import multiprocessing
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("fork")) as pool:
        ahead = deque(pool.submit(_draw, first_step + i) for i in range(2 * workers))
        step = first_step + len(ahead)
        while True:
            yield ahead.popleft().result()
            ahead.append(pool.submit(_draw, step))
            step += 1
