# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Matching of descriptors, and verification by one smooth warp. Several threads can use all functions."""
from __future__ import annotations

import dataclasses
from typing import Any, Iterator, NamedTuple, Union

import numpy as np
import numpy.typing as npt

from pliant import _checks, _native
from pliant.errors import ConflictError, InvalidArgumentError
from pliant.features import Features, descriptor_rows

DescriptorsLike = Union[Features, npt.ArrayLike]


class Matches(NamedTuple):
    """pairs: M x 2 int64, rows of a and of b. distances: M float32, Euclidean, or Hamming in bits."""

    pairs: npt.NDArray[np.int64]
    distances: npt.NDArray[np.float32]


class Warp:
    """A thin-plate spline that maps points of image a to points of image b. Immutable; several threads can use it.

    Points are N x 2 (or one of 2) in pixels, x before y, pixel centres at integers.
    """

    def __init__(self, native: _native.Warp) -> None:
        self._native = native

    @classmethod
    def fit(cls, source: npt.ArrayLike, target: npt.ArrayLike, regularization: float = 1e-3) -> Warp:
        """The warp with least bending that maps `source` close to `target`, both N x 2, with N at least 3.
        `regularization`: 0 = as close as possible, large = affine; it does not depend on the images' sizes.
        Raises UnprocessableError for points on one line."""
        return cls(_native.Warp._fit(_points("source", source), _points("target", target), float(regularization)))

    def __call__(self, points: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Maps points of a to points of b, in an array of the same shape."""
        rows = _points("points", points)
        return self._native._map(rows).reshape(np.shape(points))

    def jacobians(self, points: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Derivatives at N points: N x 2 x 2, [[dx'/dx, dx'/dy], [dy'/dx, dy'/dy]]."""
        return self._native._jacobians(_points("points", points))

    @property
    def bending_energy(self) -> float:
        """0 for an affine map, larger for stronger bending; without a unit, independent of the images' sizes."""
        return self._native.bending_energy


@dataclasses.dataclass(frozen=True, eq=False)
class Verification:
    """The result of `verify`; `inliers, warp = verify(a, b)` works too.

    inliers: K x 2 int64, the matches that fit the warp (rows of a and of b); K = 0 without a warp.
    warp: from image a to image b; None if the matches fit no warp.
    failure: the reason without a warp (too few matches, ...), else None.
    matches: the number of tested matches.
    """

    inliers: npt.NDArray[np.int64]
    warp: Warp | None
    failure: str | None
    matches: int

    def __bool__(self) -> bool:
        return self.warp is not None

    def __iter__(self) -> Iterator[npt.NDArray[np.int64] | Warp | None]:
        return iter((self.inliers, self.warp))


def match(a: DescriptorsLike, b: DescriptorsLike, *, ratio: float = 1.0, mutual: bool = True,
          threads: int = 0) -> Matches:
    """Finds the nearest descriptor of b for each descriptor of a, like `pliant match`, in order of a.

    a, b: Features, or arrays N x D of float32 or uint8.
    ratio: largest ratio of the nearest to the second nearest distance (Lowe's ratio test), 0 to 1; 1 = keep all.
    mutual: keeps only matches that are nearest in both directions.
    Raises ConflictError for descriptors of different models or types, InvalidArgumentError for NaN and wrong shapes.
    """
    if isinstance(a, Features) and isinstance(b, Features) and a.model_id != b.model_id:
        raise ConflictError(f"descriptors of {a.model_id} and of {b.model_id} cannot be compared; use one model for both",
                            code="model_mismatch")
    rows = [descriptor_rows(name, given.descriptors if isinstance(given, Features) else given)
            for name, given in (("a", a), ("b", b))]
    return Matches(*_native.match(rows[0], rows[1], float(ratio), bool(mutual), _checks.whole("threads", threads, 0, 1024)))


def verify(a: Features, b: Features, matches: Matches | npt.ArrayLike | None = None, *, ratio: float = 0.9,
           tolerance: float = 0.01, seed: int = 1, threads: int = 0) -> Verification:
    """Verifies that a and b show the same object, however bent: their matches must fit one smooth warp.

    matches: Matches or M x 2 ints; None: mutual nearest neighbours that pass the ratio test with `ratio`, as in a
        search.
    tolerance: largest distance of an inlier from the warp, as a share of the longer side of b, above 0, below 1.
    A seed makes the result deterministic. A result without a warp is not an error.
    """
    for name, given in (("a", a), ("b", b)):
        if not isinstance(given, Features):
            raise TypeError(f"{name} must be Features, not {type(given).__name__}")
    pairs = None if matches is None else _pairs(matches)
    inliers, warp, failure, tested = _native.verify(a, b, pairs, float(ratio), float(tolerance),
                                                    _checks.whole("seed", seed, 0, 2**64 - 1),
                                                    _checks.whole("threads", threads, 0, 1024))
    return Verification(inliers, None if warp is None else Warp(warp), None if warp is not None else failure, tested)


def _pairs(matches: Matches | npt.ArrayLike) -> npt.NDArray[np.int64]:
    array = np.asarray(matches.pairs if isinstance(matches, Matches) else matches)
    if array.size == 0:
        return np.empty((0, 2), np.int64)
    if array.dtype.kind not in "iu":
        raise TypeError(f"matches must be whole numbers, not {array.dtype}")
    return _two_columns("matches", "M", array, np.int64)


def _points(name: str, points: npt.ArrayLike) -> npt.NDArray[np.float64]:
    array = np.asarray(points)
    if array.dtype.kind not in "fiu":
        raise TypeError(f"{name} must be numbers, not {array.dtype}")
    if array.shape == (2,):
        array = array.reshape(1, 2)
    return _two_columns(name, "N", array, np.float64)


def _two_columns(name: str, rows: str, array: npt.NDArray[Any], dtype: type[Any]) -> npt.NDArray[Any]:
    if array.ndim != 2 or array.shape[1] != 2:
        raise InvalidArgumentError(f"{name} must be {rows} x 2, not {' x '.join(map(str, array.shape))}", code="array_shape")
    return np.ascontiguousarray(array, dtype)
