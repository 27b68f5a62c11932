# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Checks of arguments that several modules share. Private."""
from __future__ import annotations

import json
import os
from typing import Any

from pliant.errors import InvalidArgumentError


def text(name: str, value: Any) -> str:
    """`value`, if it is a str that UTF-8 can encode."""
    if not isinstance(value, str):
        raise TypeError(f"{name} must be str, not {type(value).__name__}")
    try:
        value.encode("utf-8")
    except UnicodeEncodeError:
        raise InvalidArgumentError(f"{name} is not valid Unicode: {value!a}", code="invalid_unicode") from None
    return value


def path(name: str, value: Any) -> bytes:
    """The bytes of a path. Accepts every file name of the system."""
    if isinstance(value, (bytes, bytearray)) or not isinstance(value, (str, os.PathLike)):
        raise TypeError(f"{name} must be str or os.PathLike, not {type(value).__name__}")
    encoded = os.fsencode(value)
    if not encoded:
        raise InvalidArgumentError(f"{name} is empty", code="empty_path")
    if b"\0" in encoded:
        raise InvalidArgumentError(f"{name} contains a null byte", code="null_byte")
    return encoded


def whole(name: str, value: Any, least: int = 0, most: int = 2**31 - 1) -> int:
    """`value` as an int within bounds. Accepts NumPy's integers, but no floats or bools."""
    if isinstance(value, bool) or not hasattr(value, "__index__"):
        raise TypeError(f"{name} must be an int, not {type(value).__name__}")
    number = int(value.__index__())
    if not least <= number <= most:
        raise InvalidArgumentError(f"{name} must be {least} to {most}, not {number}", code="out_of_range")
    return number


def document(name: str, value: Any) -> str:
    """The JSON of a dict."""
    if not isinstance(value, dict):
        raise TypeError(f"{name} must be a dict, not {type(value).__name__}")
    try:
        return json.dumps(value, allow_nan=False)
    except TypeError as error:
        raise TypeError(f"{name}: {error}") from None
    except ValueError as error:
        raise InvalidArgumentError(f"{name}: {error}", code=f"{name}_invalid") from None


def shown(text_of_file: bytes) -> str:
    """A file name or message of the library's, for people."""
    return text_of_file.decode("utf-8", "backslashreplace")
