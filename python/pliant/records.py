# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Records and answers of an index. Plain values; coordinates are pixels of original upright images, centres at integers."""
from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import numpy.typing as npt


@dataclasses.dataclass(frozen=True)
class Image:
    """A stored image. Only `Index.add` sets `outcome`: "created", "replaced" or "unchanged"."""

    id: str
    object: str  # that the image shows; "" = none
    metadata: dict[str, Any]
    source: str  # file name as given, for people; "" = none
    width: int
    height: int
    keypoints: int
    bytes: int
    sha256: str
    media_type: str
    added_at: str  # ISO 8601, UTC
    updated_at: str  # last change of bytes, object, metadata or source
    collection: str
    outcome: str | None = None


@dataclasses.dataclass(frozen=True)
class Vocabulary:
    """The visual words of a collection's searches."""

    id: int
    words: int
    active: bool
    model_id: str
    method: str
    seed: int
    sampled: int  # descriptors of the training, of `available`
    available: int
    loss: float  # mean distance of a descriptor from its word
    created_at: str


@dataclasses.dataclass(frozen=True, eq=False)
class Instance:
    """One place in the query where the object is."""

    inliers: int
    polygon: npt.NDArray[np.float64] | None  # K x 2, outline in the query, not closed


@dataclasses.dataclass(frozen=True, eq=False)
class Hit:
    """One result of a search, the best image of its object."""

    rank: int  # from 1
    object: str | None
    score: float  # 0 to 1
    probability: float | None  # that the hit is right; None = unknown
    verdict: str | None  # "found", "perhaps" or "unlikely", by the probability
    image_id: str
    inliers: int  # matches that fit one warp; 0 without verification
    polygon: npt.NDArray[np.float64] | None  # K x 2, outline of the object in the query, not closed
    instances: list[Instance]
    metadata: dict[str, Any]
    explain: dict[str, Any] | None  # as in the HTTP interface; only with explain=True


class SearchResult(list["Hit"]):
    """The hits, best first. `total`: hits over all pages. `verdict`: "found", "perhaps" (the first hit has a probability
    of 0.2 or more) or "not_found". `found`: hits with the verdict "found". Both are None for hits without a
    probability. `document`: the whole answer as `pliant query --json` prints it (mirrored, took_ms, timings, ...)."""

    def __init__(self, document: dict[str, Any]) -> None:
        super().__init__(_hit(hit) for hit in document["hits"])
        self.document = document
        self.total: int = document["total"]
        self.verdict: str | None = document["verdict"]
        self.found: int | None = document["found"]


@dataclasses.dataclass(frozen=True)
class FolderReport:
    """The result of `Index.add_folder`. skipped: (file, code, reason) of each refused image. system_files: files in
    folders of systems (trash, thumbnails, snapshots), which are left out."""

    indexed: int
    unchanged: int
    skipped: list[tuple[str, str, str]]
    system_files: int


def _polygon(points: list[list[float]] | None) -> npt.NDArray[np.float64] | None:
    return None if points is None else np.array(points, np.float64).reshape(-1, 2)


def _hit(hit: dict[str, Any]) -> Hit:
    return Hit(hit["rank"], hit["object"], hit["score"], hit["probability"], hit["verdict"], hit["image_id"], hit["inliers"],
               _polygon(hit["polygon"]),
               [Instance(place["inliers"], _polygon(place["polygon"])) for place in hit["instances"]],
               hit["metadata"], hit.get("explain"))


def image(document: dict[str, Any], outcome: str | None = None) -> Image:
    """From a record's JSON form."""
    names = {field.name for field in dataclasses.fields(Image)}
    return Image(outcome=outcome, **{name: value for name, value in document.items() if name in names})


def vocabulary(document: dict[str, Any]) -> Vocabulary:
    """From a record's JSON form."""
    names = {field.name for field in dataclasses.fields(Vocabulary)}
    return Vocabulary(**{name: value for name, value in document.items() if name in names})
