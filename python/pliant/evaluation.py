# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Your own keypoints and descriptors in the benchmarks of `pliant eval`."""
from __future__ import annotations

import json
import os
from typing import Any, Callable, Sequence

from pliant import _checks, _native
from pliant.features import Features, default_model


def evaluate_matching(folder: str | os.PathLike[str], describe: Callable[[str], Features], *, name: str = "mine",
                      descriptors: Sequence[str] = ("deal", "sift"), pairs: int = 0, max_keypoints: int = 2048,
                      seed: int = 1, jobs: int = 0) -> list[dict[str, Any]]:
    """Matches image pairs with ground truth, as `pliant eval matching`, and returns the rows of its JSON: `descriptors`
    at Pliant's keypoints, then `name` at yours.

    folder: a data set with image files (`pliant simulate --format folders`, HPatches, the non-rigid benchmark).
    describe: gets an image's path and returns Features in pixels of that file; at most max_keypoints count, those with
        the highest response. Several threads call it, one per scene at a time; an exception stops the benchmark.
    pairs: chosen by `seed`; 0 = all. jobs: threads; 0 = one per core.
    """
    return json.loads(_native.evaluate_matching(
        _checks.path("folder", folder), _checks.text("name", name), _caller(describe), _names(descriptors), default_model(),
        _checks.whole("pairs", pairs), _checks.whole("max_keypoints", max_keypoints, 1, 4096),
        _checks.whole("seed", seed, 0, 2**64 - 1), _checks.whole("jobs", jobs, 0, 1024)))


def evaluate_retrieval(folder: str | os.PathLike[str], describe: Callable[[str], Features], *, name: str = "mine",
                       descriptors: Sequence[str] = (), protocols: Sequence[str] = ("paper", "default"), seeds: int = 1,
                       jobs: int = 0) -> list[dict[str, Any]]:
    """Searches a folder of objects with its queries, as `pliant eval retrieval`, and returns the rows of its JSON, one
    per descriptor and protocol; those of `name` come last.

    describe: as in `evaluate_matching`, at most 4096 keypoints. An image is searched and stored with the same features.
    protocols: "paper", "default", "unverified". seeds: number of vocabularies for each row.
    """
    return json.loads(_native.evaluate_retrieval(
        _checks.path("folder", folder), _checks.text("name", name), _caller(describe), _names(descriptors), default_model(),
        _names(protocols), _checks.whole("seeds", seeds, 1, 1000), _checks.whole("jobs", jobs, 0, 1024)))


def _caller(describe: Callable[[str], Features]) -> Callable[[bytes], Features]:
    def call(path: bytes) -> Features:
        features = describe(os.fsdecode(path))
        if not isinstance(features, Features):
            raise TypeError(f"describe must return Features, not {type(features).__name__}")
        return features
    return call


def _names(names: Sequence[str]) -> list[str]:
    return [_checks.text("name", name) for name in names]
