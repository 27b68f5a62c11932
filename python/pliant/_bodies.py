# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""What requests carry: images, parameters, archives. Private; see pliant.client."""
from __future__ import annotations

import base64
import json
import os
from typing import Any, Mapping, Union

from pliant._transport import png
from pliant.errors import InvalidArgumentError

#: A path, the bytes of a file, or an array of uint8, H x W or H x W x 3.
ImageLike = Union[str, "os.PathLike[str]", bytes, bytearray, memoryview, Any]
Json = dict[str, Any]

_ARCHIVES = {".tar": "application/x-tar", ".ndjson": "application/x-ndjson", ".jsonl": "application/x-ndjson"}


def encoded(image: ImageLike, channels: str = "RGB") -> bytes:
    """The bytes to send: of a file, as given, or an array as a PNG (RGB, unless `channels` is "BGR")."""
    if isinstance(image, (bytes, bytearray, memoryview)):
        return bytes(image)
    if isinstance(image, (str, os.PathLike)):
        with open(image, "rb") as file:
            return file.read()
    if hasattr(image, "dtype") and hasattr(image, "shape"):
        return png(image, channels)
    raise TypeError(f"image must be a path, bytes or an array of uint8, not {type(image).__name__}")


def as_base64(image: ImageLike, channels: str = "RGB") -> str:
    """The same inside of JSON."""
    return base64.b64encode(encoded(image, channels)).decode("ascii")


def image(what: str, image: ImageLike | None, image_url: str | None, channels: str) -> tuple[bytes, str]:
    """The body of a request with one image, and its type."""
    if (image is None) == (image_url is None):
        raise TypeError(f"{what} takes an image or image_url")
    if image_url is not None:
        return json.dumps({"image_url": image_url}).encode(), "application/json"
    return encoded(image, channels), "application/octet-stream"


def listing(*, filter: Json | None = None, **parameters: str | None) -> Json:
    """Parameters of a list, without those that were not given."""
    given: Json = {name: value for name, value in parameters.items() if value is not None}
    if filter is not None:
        given["filter"] = json.dumps(filter, allow_nan=False)
    return given


def plain(value: Any) -> str:
    """A parameter's value in an address."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (tuple, list)):
        return ",".join(str(item) for item in value)
    return str(value)


def search(asked: Mapping[str, Any]) -> Json:
    """One search of a batch: as the server takes it, but `image` may be any image."""
    if "image" not in asked:
        return dict(asked)
    return {**asked, "image": as_base64(asked["image"])}


def changes(given: Mapping[str, Any]) -> bytes:
    """A JSON merge patch of what was given; None leaves a thing as it is."""
    patch = {name: value for name, value in given.items() if value is not None}
    if not patch:
        raise TypeError(f"nothing to change: give {', '.join(given)}")
    return json.dumps(patch, allow_nan=False).encode()


def archive_type(path: str | os.PathLike[str]) -> str:
    """The media type of many images in one file, which its name says."""
    name = os.fsdecode(os.fspath(path))
    kind = _ARCHIVES.get(os.path.splitext(name)[1].lower())
    if kind is None:
        raise InvalidArgumentError(f"the name of an archive ends in {', '.join(_ARCHIVES)}, not as {name!r}",
                                   code="archive_type")
    return kind
