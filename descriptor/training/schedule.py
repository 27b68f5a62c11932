# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Learning-rate schedule over steps, or over the time that is left until a deadline."""

from __future__ import annotations

import datetime
import math
import time
from dataclasses import dataclass


def parse_deadline(text: str) -> float:
    """"HH:MM" or "HH:MM:SS" (UTC, the next one to come) -> seconds since the epoch."""
    now = datetime.datetime.now(datetime.timezone.utc)
    parts = [int(part) for part in text.split(":")]
    if len(parts) not in (2, 3):
        raise ValueError(f"a time is HH:MM or HH:MM:SS, not '{text}'")
    hour, minute, second = (*parts, 0)[:3]
    then = now.replace(hour=hour, minute=minute, second=second, microsecond=0)
    if then <= now:
        then += datetime.timedelta(days=1)
    return then.timestamp()


@dataclass
class Schedule:
    """progress() runs from 0 to 1. With a deadline it follows the clock from 'started' on, which is
    kept in the checkpoint; the result then depends on the machine's speed."""

    steps: int
    deadline: float | None = None
    started: float = 0.0

    def progress(self, step: int) -> float:
        if self.deadline is None:
            return min(step / max(self.steps, 1), 1.0)
        return min(max((time.time() - self.started) / max(self.deadline - self.started, 1e-9), 0.0), 1.0)

    def done(self, step: int) -> bool:
        return self.progress(step) >= 1.0


def rate_factor(progress: float, warmup: float, final_rate: float) -> float:
    """Linear warm-up, then a cosine from 1 to final_rate."""
    cosine = final_rate + (1 - final_rate) * 0.5 * (1 + math.cos(math.pi * progress))
    return cosine * min(1.0, (progress + 1e-4) / max(warmup, 1e-4))
