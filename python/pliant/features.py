# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Keypoints and descriptors of an image."""
from __future__ import annotations

import contextlib
import dataclasses
import functools
import os
import pathlib
from typing import Any, Iterator, Sequence

import numpy as np
import numpy.typing as npt

from pliant import _checks, _native, images
from pliant.errors import CorruptError, Error, InvalidArgumentError

COLUMNS = ("x", "y", "size", "angle", "response", "octave")


@dataclasses.dataclass(frozen=True, eq=False)
class Features:
    """The N keypoints of one image and their descriptors. The arrays are C-contiguous copies and not writeable.

    keypoints: N x 6 float32 with the columns
        x, y: pixels of the original upright image, pixel centres at integers: (0, 0) is the middle of the first pixel;
        size: diameter of the described neighbourhood, in pixels (OpenCV's);
        angle: degrees, 0 to 360, clockwise (y points down), as OpenCV's;
        response: the detector's strength, without a unit;
        octave: OpenCV's packed SIFT octave, a whole number.
    descriptors: N x D; float32 (Euclidean distance; D = 64 for deal and its variants, 128 for sift and rootsift, 200 for daisy) or uint8
        (Hamming distance over 8 D bits; D = 32 for orb, 64 for brisk).
    width, height: size of the image, in pixels.
    model_id: the model that made the descriptors ("deal:" and 16 hex digits); different models cannot be compared.
    """

    keypoints: npt.NDArray[np.float32]
    descriptors: npt.NDArray[Any]
    width: int
    height: int
    model_id: str = ""

    def __post_init__(self) -> None:
        keypoints = np.asarray(self.keypoints)
        if keypoints.dtype.kind not in "fiu":
            raise TypeError(f"keypoints must be numbers, not {keypoints.dtype}")
        if keypoints.ndim != 2 or keypoints.shape[1] != len(COLUMNS):
            raise InvalidArgumentError(f"keypoints must be N x 6 ({', '.join(COLUMNS)}), not "
                                       f"{' x '.join(map(str, keypoints.shape))}", code="array_shape")
        descriptors = descriptor_rows("descriptors", self.descriptors)
        if len(keypoints) != len(descriptors):
            raise InvalidArgumentError(f"{len(keypoints)} keypoints, but {len(descriptors)} descriptors",
                                       code="array_shape")
        keypoints = np.array(keypoints, np.float32, order="C")
        if not np.isfinite(keypoints).all():
            raise InvalidArgumentError("keypoints contain NaN or infinity", code="not_finite")
        descriptors = np.array(descriptors, order="C")
        if descriptors.dtype == np.float32 and not np.isfinite(descriptors).all():
            raise InvalidArgumentError("descriptors contain NaN or infinity", code="not_finite")
        keypoints.setflags(write=False)
        descriptors.setflags(write=False)
        object.__setattr__(self, "keypoints", keypoints)
        object.__setattr__(self, "descriptors", descriptors)
        object.__setattr__(self, "width", _checks.whole("width", self.width))
        object.__setattr__(self, "height", _checks.whole("height", self.height))
        _checks.text("model_id", self.model_id)

    def __len__(self) -> int:
        """N, the number of keypoints."""
        return len(self.keypoints)

    @property
    def xy(self) -> npt.NDArray[np.float64]:
        """Positions of the keypoints in pixels, N x 2."""
        return self.keypoints[:, :2].astype(np.float64)

    def to_cv(self) -> list[Any]:
        """The keypoints as a list of `cv2.KeyPoint`, in order (needs OpenCV's Python module)."""
        import cv2  # type: ignore[import]
        return [cv2.KeyPoint(float(x), float(y), float(size), float(angle), float(response), int(octave))
                for x, y, size, angle, response, octave in self.keypoints]

    @classmethod
    def from_cv(cls, keypoints: Sequence[Any], descriptors: npt.ArrayLike, width: int, height: int,
                model_id: str = "cv2") -> Features:
        """From a sequence of `cv2.KeyPoint` and the descriptors of `detectAndCompute`, in an image of width x height
        pixels. `model_id` names the method; matching compares it."""
        rows = np.array([[*k.pt, k.size, k.angle, k.response, k.octave] for k in keypoints], np.float32)
        return cls(rows.reshape(-1, len(COLUMNS)), np.asarray(descriptors), width, height, model_id)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes an .npz file for `Features.load` and `numpy.load`, with the names of `pliant describe --out x.npz`."""
        file = pathlib.Path(os.fsdecode(_checks.path("path", path)))
        if file.suffix != ".npz":
            raise InvalidArgumentError(f"{file.name!a} must end in .npz", code="bad_features_name")
        np.savez(file, keypoints=self.keypoints, descriptors=self.descriptors, width=np.int64(self.width),
                 height=np.int64(self.height), model_id=np.array(self.model_id))

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Features:
        """Reads a file written by `save` or `pliant describe --out x.npz`. Raises CorruptError for another file."""
        with _archive(path) as file:
            if "starts" in file:
                raise InvalidArgumentError(f"{os.fsdecode(path)!a} has the features of a folder: use load_folder",
                                           code="features_of_folder")
            return cls(file["keypoints"], file["descriptors"], int(file["width"]), int(file["height"]),
                       str(file["model_id"]))

    @classmethod
    def load_folder(cls, path: str | os.PathLike[str]) -> dict[str, Features]:
        """Reads a file written by `pliant describe DIR --out x.npz`: features by name below DIR."""
        with _archive(path) as file:
            if "starts" not in file:
                raise InvalidArgumentError(f"{os.fsdecode(path)!a} has the features of one image: use load",
                                           code="features_of_image")
            keypoints, descriptors, starts = file["keypoints"], file["descriptors"], file["starts"]
            sizes = zip(file["width"].tolist(), file["height"].tolist(), strict=True)
            return {str(name): cls(keypoints[begin:end], descriptors[begin:end], width, height, str(file["model_id"]))
                    for name, begin, end, (width, height) in zip(file["names"], starts[:-1], starts[1:], sizes,
                                                                 strict=True)}


@contextlib.contextmanager
def _archive(path: str | os.PathLike[str]) -> Iterator[Any]:
    name = os.fsdecode(_checks.path("path", path))
    try:
        with np.load(name, allow_pickle=False) as file:
            yield file
    except (Error, OSError):
        raise
    except Exception as error:  # NumPy and zipfile document none of theirs
        raise CorruptError(f"{name!a} is damaged or no .npz file of features: {error}", code="not_features") from error


def descriptor_rows(name: str, rows: npt.ArrayLike) -> npt.NDArray[Any]:
    """N x D, C-contiguous, float32 or uint8. Raises TypeError for numbers of another kind."""
    array = np.asarray(rows)
    if array.dtype.kind == "f":
        array = array.astype(np.float32, copy=False)
    elif array.dtype != np.uint8:
        raise TypeError(f"{name} must be an array of floats or uint8, not {array.dtype}")
    if array.ndim != 2:
        raise InvalidArgumentError(f"{name} must be N x D, not of {array.ndim} dimension(s)", code="array_shape")
    return np.ascontiguousarray(array)


def descriptor_names() -> list[str]:
    """The names of all descriptors, best first."""
    return _native.descriptor_names()


def default_model() -> bytes:
    """DEAL's weight file or the folder of its weights: $PLIANT_MODEL, else share/pliant below a parent folder of the
    package (installed, or a build tree); empty if neither exists: the library then looks beside its programs."""
    given = os.environb.get(b"PLIANT_MODEL", b"")
    if given:
        return given
    for parent in pathlib.Path(__file__).absolute().parents[1:6]:
        folder = parent / "share" / "pliant"
        if (folder / "deal.safetensors").is_file():
            return os.fsencode(folder)
    return b""


class Extractor:
    """Describes images, always in the same way. The constructor loads the weights; many threads can use one extractor.

    descriptor: one of `descriptor_names()`.
    model: weight file for deal and its variants, or the folder of NAME.safetensors; None: the installed one.
    max_keypoints: number of keypoints to keep, strongest first, 1 to 4096.
    max_side: scale larger images down to this longer side in pixels; 0 = never.
    enlarge_below: also describe images with fewer keypoints at twice their size, up to this number; 0 = never.
    """

    def __init__(self, descriptor: str = "deal", *, model: str | os.PathLike[str] | None = None,
                 max_keypoints: int = 1024, max_side: int = 1024, enlarge_below: int = 0) -> None:
        file = default_model() if model is None else _checks.path("model", model)
        self._native = _native.Extractor(_checks.text("descriptor", descriptor), file,
                                         _checks.whole("max_keypoints", max_keypoints, 1, 4096),
                                         _checks.whole("max_side", max_side),
                                         _checks.whole("enlarge_below", enlarge_below))

    @property
    def descriptor(self) -> str:
        """The descriptor's name."""
        return self._native.descriptor

    @property
    def model_id(self) -> str:
        """The id of the model, as in `Features`."""
        return self._native.model_id

    @property
    def dim(self) -> int:
        """D, columns of the descriptors."""
        return self._native.dim

    def describe(self, image: images.ImageLike, *, channels: str = "RGB", threads: int = 0) -> Features:
        """Detects keypoints and describes them. `threads`: 0 = one per core; 1 is faster if your own threads describe
        several images. An image without keypoints gives N = 0."""
        count = _checks.whole("threads", threads, 0, 1024)
        if isinstance(image, np.ndarray):
            return Features(*self._native.describe_array(images.pixels(image, channels), count))
        return Features(*self._native.describe_bytes(images.encoded(image), count))


@functools.lru_cache(maxsize=4)
def _extractor(descriptor: str, model: bytes, stamp: tuple[int, ...], max_keypoints: int, max_side: int,
               enlarge_below: int) -> Extractor:
    return Extractor(descriptor, model=os.fsdecode(model) or None, max_keypoints=max_keypoints, max_side=max_side,
                     enlarge_below=enlarge_below)


def describe(image: images.ImageLike, *, descriptor: str = "deal", model: str | os.PathLike[str] | None = None,
             max_keypoints: int = 1024, max_side: int = 1024, enlarge_below: int = 0, channels: str = "RGB",
             threads: int = 0) -> Features:
    """Keypoints and descriptors of an image, as `pliant describe` writes them.

    image, channels: see `pliant.images`. The other arguments are those of `Extractor`; the last four extractors stay in
    memory, so the weights load once. Raises UnsupportedMediaTypeError, UnprocessableError and TooLargeError for
    images, OSError for files.
    """
    file = default_model() if model is None else _checks.path("model", model)
    known = _extractor(_checks.text("descriptor", descriptor), file, _stamp(file),
                       _checks.whole("max_keypoints", max_keypoints, 1, 4096), _checks.whole("max_side", max_side),
                       _checks.whole("enlarge_below", enlarge_below))
    return known.describe(image, channels=channels, threads=threads)


def _stamp(model: bytes) -> tuple[int, ...]:
    """Changes when the weight file does."""
    try:
        status = os.stat(model)
    except OSError:
        return ()
    return status.st_ino, status.st_mtime_ns, status.st_size
