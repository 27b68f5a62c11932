# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Images as arguments: a path, encoded bytes, or an array of pixels.

- `str` or `os.PathLike`: a file of JPEG, PNG, WebP, HEIC, AVIF, GIF, BMP or TIFF (the content counts, not the name);
- `bytes`, `bytearray` or `memoryview`: the content of such a file;
- an array of `uint8`, H x W (grey) or H x W x 3: red, green, blue, or OpenCV's order with `channels="BGR"`. Any
  memory layout; the function copies it.
"""
from __future__ import annotations

import os
from typing import Union

import numpy as np
import numpy.typing as npt

from pliant import _checks, _native
from pliant.errors import InvalidArgumentError, TooLargeError

ImageLike = Union[str, "os.PathLike[str]", bytes, bytearray, memoryview, "npt.NDArray[np.uint8]"]

MAX_BYTES = 64 * 1024 * 1024  # of an encoded image


def read(path: str | os.PathLike[str]) -> bytes:
    """A file's content. Raises OSError (FileNotFoundError, IsADirectoryError, ...), and TooLargeError above MAX_BYTES."""
    with open(os.fsdecode(_checks.path("path", path)), "rb") as file:
        data = file.read(MAX_BYTES + 1)
    if len(data) > MAX_BYTES:
        raise TooLargeError(f"{path!r} is too large: the limit is {MAX_BYTES} bytes", code="image_too_large")
    return data


def pixels(image: npt.NDArray[np.uint8], channels: str = "RGB", name: str = "image") -> npt.NDArray[np.uint8]:
    """`image` as a C-contiguous array H x W, or H x W x 3 in order R, G, B."""
    if channels not in ("RGB", "BGR"):
        raise InvalidArgumentError(f'channels must be "RGB" or "BGR", not {channels!r}', code="channels_invalid")
    if image.dtype != np.uint8:
        raise TypeError(f"{name} must be an array of uint8, not {image.dtype}"
                        + ("; scale it to 0..255 and convert it" if image.dtype.kind == "f" else ""))
    if image.ndim == 3 and image.shape[2] == 1:
        image = image[:, :, 0]
    if image.ndim != 2 and not (image.ndim == 3 and image.shape[2] == 3):
        raise InvalidArgumentError(f"{name} must be H x W or H x W x 3, not {' x '.join(map(str, image.shape))}",
                                   code="array_shape")
    if image.size == 0:
        raise InvalidArgumentError(f"{name} is empty: {' x '.join(map(str, image.shape))}", code="array_empty")
    if image.ndim == 3 and channels == "BGR":
        image = image[:, :, ::-1]
    return np.ascontiguousarray(image)


def encoded(image: ImageLike, channels: str = "RGB") -> bytes:
    """`image` as the content of a file; an array becomes a PNG."""
    if isinstance(image, np.ndarray):
        return _native.encode_png(pixels(image, channels))
    if isinstance(image, (bytes, bytearray, memoryview)):
        return bytes(image)
    if isinstance(image, (str, os.PathLike)):
        return read(image)
    raise TypeError("image must be a path, the bytes of a file, or an array of uint8 (np.asarray(image) of a PIL "
                    f"image in mode RGB or L), not {type(image).__name__}")
