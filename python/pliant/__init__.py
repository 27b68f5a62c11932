# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Find the same object again, however it is bent, folded or crumpled.

    features = pliant.describe("mug.jpg")                     # keypoints and descriptors, as NumPy arrays
    matches = pliant.match(features, other)                   # nearest neighbours
    inliers, warp = pliant.verify(features, other)            # matches that fit one smooth warp
    with pliant.Index("shop.db") as index: ...                # a searchable collection in one file
    client = pliant.Client("http://127.0.0.1:8080")           # the same on a running pliant-server

Several threads can use every function and class. The library releases the GIL while it works.
The first use loads the library and NumPy. `pliant.Client` needs neither.
"""
from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from pliant._version import __version__
from pliant.client import Client
from pliant.errors import (CancelledError, ConflictError, ConnectionFailedError, CorruptError, Error, ForbiddenError,
                           InternalError, InvalidArgumentError, NoSpaceError, NotFoundError, ReadOnlyError,
                           TooLargeError, UnauthorizedError, UnavailableError, UnprocessableError,
                           UnsupportedMediaTypeError)

if TYPE_CHECKING:
    from pliant.evaluation import evaluate_matching, evaluate_retrieval
    from pliant.features import Extractor, Features, describe, descriptor_names
    from pliant.index import Index
    from pliant.matching import Matches, Verification, Warp, match, verify
    from pliant.records import FolderReport, Hit, Instance, Image, SearchResult, Vocabulary
    from pliant.simulation import SimulationReport, simulate
    from pliant.tracking import TrackedFrame, Tracker, track

_MODULES = ("evaluation", "features", "index", "matching", "records", "simulation", "tracking")

__all__ = ["CancelledError", "Client", "ConflictError", "ConnectionFailedError", "CorruptError", "Error", "Extractor",
           "Features", "FolderReport", "ForbiddenError", "Hit", "Index", "Instance", "InternalError",
           "InvalidArgumentError", "Matches", "NoSpaceError", "NotFoundError", "Image", "ReadOnlyError",
           "SearchResult", "SimulationReport", "TooLargeError", "TrackedFrame", "Tracker", "UnauthorizedError",
           "UnavailableError", "UnprocessableError", "UnsupportedMediaTypeError", "Verification", "Vocabulary", "Warp",
           "describe", "descriptor_names", "evaluate_matching", "evaluate_retrieval", "match", "simulate", "track", "verify"]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'pliant' has no attribute {name!r}")
    for module in _MODULES:
        known = vars(importlib.import_module(f"pliant.{module}"))
        globals().update({one: known[one] for one in __all__ if one in known})
    return globals()[name]


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
