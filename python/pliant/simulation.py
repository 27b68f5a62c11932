# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Simulated images of cloth and paper, with exact correspondences."""
from __future__ import annotations

import dataclasses
import os
from typing import Any, Callable

from pliant import _checks, _native

_WHOLE = {"scenes", "first", "distractors", "views", "width", "height", "seed", "jobs"}
_REAL = {"strength", "occluders", "turn_deg", "least_scale"}
_TEXT = {"preset", "format"}


@dataclasses.dataclass(frozen=True)
class SimulationReport:
    """The result of `simulate`. mean_stretch, worst_stretch: mean and maximum over all views of the cloth's stretch, as a
    share (95th percentile over the edges of a view). skipped: (file, reason) of unusable textures."""

    scenes: int
    unchanged: int
    images: int
    textures: int
    seconds: float
    mean_stretch: float
    worst_stretch: float
    skipped: list[tuple[str, str]]


def simulate(textures: str | os.PathLike[str], out: str | os.PathLike[str], *,
             progress: Callable[[int, int], object] | None = None, **options: Any) -> SimulationReport:
    """Renders scenes into the folder `out`, like `pliant simulate`. Existing scenes of the same
    settings stay.

    textures: a folder of images, a safetensors pack, or "procedural" for generated ones.
    options: preset ("pairs", "objects", "sequence", "rotation", "scale", "planar", "street"), format ("auto", "tensors",
        "folders"), scenes (100), first (0), distractors (0), views (0 = the preset's), width (640), height (480), colour
        (False), strength (1.0), occluders (0.25), turn_deg (60), least_scale (0.5), seed (1), jobs (0 = one per core).
    Other threads call progress(done, total); an exception from it stops the work, like Ctrl-C. Complete scenes
    stay. Raises InvalidArgumentError, NotFoundError, ConflictError (the folder has scenes of other settings), NoSpaceError.
    """
    given: dict[str, Any] = {"textures": _checks.path("textures", textures), "out": _checks.path("out", out)}
    for name, value in options.items():
        if name in _WHOLE:
            given[name] = _checks.whole(name, value, 0, 2**64 - 1 if name == "seed" else 2**31 - 1)
        elif name in _REAL:
            given[name] = float(value)
        elif name in _TEXT:
            given[name] = _checks.text(name, value)
        elif name == "colour":
            given[name] = bool(value)
        else:
            known = sorted({"colour", "progress", *_WHOLE, *_REAL, *_TEXT})
            raise TypeError(f"simulate has no option {name!r}; options are {', '.join(known)}")
    report = _native.simulate(given, progress)
    report["skipped"] = [(_checks.shown(file), _checks.shown(reason)) for file, reason in report["skipped"]]
    return SimulationReport(**report)
