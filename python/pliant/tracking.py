# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Tracking of one object through the frames of a video while it bends. The tracker processes every frame
independently, so it finds a lost object again."""
from __future__ import annotations

import dataclasses
import json
import os
from typing import Any, Iterable, Iterator, Sequence

import numpy as np
import numpy.typing as npt

from pliant import _checks, _native, images
from pliant.errors import InvalidArgumentError
from pliant.features import Extractor, Features
from pliant.matching import Warp


@dataclasses.dataclass(frozen=True, eq=False)
class TrackedFrame:
    """Where the object is in one frame. Coordinates are pixels, centres at integers.

    number: of the frame, from 0. time_s: seconds since the first frame, or None. file: its name in a folder.
    found: whether the frame shows the object; reason: a stable word if not, else None.
    on_template, in_frame: K x 2 each, the inliers of the warp, also when the object counts as lost.
    matches: number of tested matches; keypoints: number of keypoints of the frame.
    warp: from the template (the region of the reference) to the frame; outline: K x 2 in the frame, not closed;
    mesh: as in `pliant track --json`. All three are None for a lost object.
    """

    number: int
    time_s: float | None
    file: str
    found: bool
    reason: str | None
    keypoints: int
    matches: int
    on_template: npt.NDArray[np.float64]
    in_frame: npt.NDArray[np.float64]
    warp: Warp | None
    outline: npt.NDArray[np.float64] | None
    mesh: dict[str, Any] | None

    @property
    def inlier_rate(self) -> float:
        """Share of inliers among the matches; 0 without matches."""
        return len(self.on_template) / self.matches if self.matches else 0.0


class Tracker:
    """Finds an object of a reference image in frames. Immutable; several threads can use it.

    reference: see `pliant.images`. region: (x, y, width, height) of the object in it, whole pixels; None: all of it, or
    the bounding box of `mask`, H x W uint8 of the reference's size, 0 outside the object.
    descriptor, model, max_keypoints, max_side: as in `Extractor`.
    iterations: RANSAC samples per frame; min_inliers: with fewer inliers the object counts as lost; max_ratio: limit of
    the ratio test; tolerance: share of the frame's longer side; regularization: stiffness of the warp.
    """

    def __init__(self, reference: images.ImageLike, *, region: Sequence[int] | None = None,
                 mask: npt.NDArray[np.uint8] | None = None, channels: str = "RGB", descriptor: str = "deal",
                 model: str | os.PathLike[str] | None = None, max_keypoints: int = 1024, max_side: int = 1024,
                 iterations: int = 1500, min_inliers: int = 8, max_ratio: float = 0.9, tolerance: float = 0.01,
                 regularization: float = 3e-3, threads: int = 0) -> None:
        extractor = Extractor(descriptor, model=model, max_keypoints=max_keypoints, max_side=max_side)
        box = None
        if region is not None:
            box = [_checks.whole("region", value) for value in region]
            if len(box) != 4:
                raise InvalidArgumentError(f"region must be (x, y, width, height), not {len(box)} values",
                                           code="region_invalid")
        for name, value in (("tolerance", tolerance), ("max_ratio", max_ratio)):
            if not 0 < value <= 1:
                raise InvalidArgumentError(f"{name} must be above 0, at most 1, not {value}", code="out_of_range")
        self._native = _native.Tracker(
            extractor._native, _decoded(reference, channels), box,
            None if mask is None else images.pixels(mask, name="mask"), _checks.whole("iterations", iterations, 1, 10**6),
            _checks.whole("min_inliers", min_inliers, 1), float(max_ratio), float(tolerance), float(regularization),
            _checks.whole("threads", threads, 0, 1024))

    @property
    def region(self) -> tuple[int, int, int, int]:
        """The template's box in the reference: x, y, width, height."""
        return self._native.region

    @property
    def features(self) -> Features:
        """Features of the template, in its own pixels."""
        return Features(*self._native.features)

    def find(self, frame: images.ImageLike, *, channels: str = "RGB", number: int = 0, time_s: float | None = None,
             file: str = "") -> TrackedFrame:
        """Finds the object in a frame. A lost object is not an error."""
        text, on_template, in_frame, warp = self._native.find(_decoded(frame, channels))
        said = json.loads(text)
        outline = None if said["outline"] is None else np.array(said["outline"], np.float64)
        return TrackedFrame(number, time_s, file, said["found"], said["reason"], said["keypoints"], said["matches"],
                            on_template, in_frame, None if warp is None or not said["found"] else Warp(warp), outline,
                            said["mesh"])


def track(reference: images.ImageLike | Tracker, frames: str | os.PathLike[str] | Iterable[images.ImageLike], *,
          every: int = 1, channels: str = "RGB", **options: Any) -> Iterator[TrackedFrame]:
    """Tracks the object of `reference` through the frames, one at a time, as the caller iterates.

    frames: a video file, a folder of images (in natural order of their names), or any iterable of images.
    every: only frames 0, every, 2 every, ... options: as in `Tracker`; or pass a Tracker as `reference`.
    Raises errors of the Tracker at once, and errors of a frame when the iteration reaches it.
    """
    step = _checks.whole("every", every, 1)
    if isinstance(reference, Tracker):
        if options:
            raise TypeError("track takes no options with a Tracker; pass them to Tracker")
        tracker = reference
    else:
        tracker = Tracker(reference, channels=channels, **options)
    if isinstance(frames, (str, os.PathLike)):
        return _of_source(tracker, _native.Frames(_checks.path("frames", frames), step))
    if isinstance(frames, (bytes, bytearray, memoryview)):
        raise TypeError("frames must be a path or an iterable of images, not the bytes of one image")
    return _of_images(tracker, frames, step, channels)


def _of_source(tracker: Tracker, source: _native.Frames) -> Iterator[TrackedFrame]:
    while (frame := source.next()) is not None:
        number, time_s, file, image = frame
        yield tracker.find(image, number=number, time_s=time_s, file=file)


def _of_images(tracker: Tracker, frames: Iterable[images.ImageLike], every: int,
                 channels: str) -> Iterator[TrackedFrame]:
    for number, frame in enumerate(frames):
        if number % every == 0:
            yield tracker.find(frame, channels=channels, number=number)


def _decoded(image: images.ImageLike, channels: str) -> npt.NDArray[np.uint8]:
    if isinstance(image, np.ndarray):
        return images.pixels(image, channels)
    return _native.decode(images.encoded(image))
