# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Reading and writing the safetensors format with NumPy only.

Layout: uint64 little-endian header length, JSON header, raw little-endian tensor data. The header
maps each name to {dtype, shape, data_offsets}; "__metadata__" holds strings.
"""

from __future__ import annotations

import hashlib
import json
import os
import struct
from pathlib import Path
from typing import Mapping

import numpy as np

_DTYPES = {
    "F64": "<f8", "F32": "<f4", "F16": "<f2", "I64": "<i8", "I32": "<i4", "I16": "<i2",
    "I8": "i1", "U16": "<u2", "U32": "<u4", "U64": "<u8", "U8": "u1", "BOOL": "?",
}
_NAMES = {np.dtype(code): name for name, code in _DTYPES.items()}
_MAX_HEADER_BYTES = 64 << 20


class TensorFileError(ValueError):
    """The file is not a sound safetensors file; the message names the file and the fault."""


def _parse_header(path: Path, raw: bytes, data_bytes: int) -> tuple[dict, dict[str, str]]:
    try:
        header = json.loads(raw)
    except ValueError as error:
        raise TensorFileError(f"{path}: the header is not JSON ({error})") from error
    if not isinstance(header, dict):
        raise TensorFileError(f"{path}: the header is not a JSON object")
    metadata = header.pop("__metadata__", {})
    if not isinstance(metadata, dict):
        raise TensorFileError(f"{path}: __metadata__ is not a JSON object")
    for name, entry in header.items():
        try:
            dtype, shape = np.dtype(_DTYPES[entry["dtype"]]), entry["shape"]
            begin, end = entry["data_offsets"]
            count = 1
            for extent in shape:
                if not isinstance(extent, int) or extent < 0:
                    raise ValueError(f"extent {extent!r}")
                count *= extent
        except (KeyError, TypeError, ValueError) as error:
            raise TensorFileError(f"{path}: tensor '{name}' is badly described ({error!r})") from error
        if not 0 <= begin <= end <= data_bytes or end - begin != count * dtype.itemsize:
            raise TensorFileError(f"{path}: tensor '{name}' does not fit its data (file truncated?)")
    return header, metadata


def load(path: str | os.PathLike) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Maps the file into memory; returns (read-only arrays by name, metadata).

    Raises TensorFileError for a malformed or truncated file, OSError if it cannot be read.
    """
    path = Path(path)
    size = path.stat().st_size
    with path.open("rb") as stream:
        prefix = stream.read(8)
        if len(prefix) < 8:
            raise TensorFileError(f"{path}: too short for a safetensors file ({size} bytes)")
        (header_bytes,) = struct.unpack("<Q", prefix)
        if header_bytes > min(_MAX_HEADER_BYTES, size - 8):
            raise TensorFileError(f"{path}: header length {header_bytes} exceeds the file")
        raw = stream.read(header_bytes)
    data_start = 8 + header_bytes
    header, metadata = _parse_header(path, raw, size - data_start)
    mapped = np.memmap(path, np.uint8, "r", data_start) if size > data_start else np.empty(0, np.uint8)
    tensors = {}
    for name, entry in header.items():
        begin, end = entry["data_offsets"]
        dtype = np.dtype(_DTYPES[entry["dtype"]])
        tensors[name] = np.frombuffer(mapped[begin:end].data, dtype).reshape(entry["shape"])
    return tensors, metadata


def save(path: str | os.PathLike, tensors: Mapping[str, np.ndarray],
         metadata: Mapping[str, str] | None = None) -> None:
    """Writes atomically: temporary file beside the target, fsync, rename."""
    header: dict[str, object] = {}
    if metadata:
        header["__metadata__"] = {key: str(value) for key, value in metadata.items()}
    arrays = {name: np.ascontiguousarray(array) for name, array in tensors.items()}
    offset = 0
    for name, array in arrays.items():
        if array.dtype not in _NAMES:
            raise TensorFileError(f"tensor '{name}': safetensors has no type for {array.dtype}")
        end = offset + array.nbytes
        header[name] = {"dtype": _NAMES[array.dtype], "shape": list(np.shape(tensors[name])),
                        "data_offsets": [offset, end]}
        offset = end
    raw = json.dumps(header, separators=(",", ":")).encode()
    raw += b" " * (-len(raw) % 8)
    temporary = Path(f"{os.fspath(path)}.tmp{os.getpid()}")
    with temporary.open("wb") as stream:
        stream.write(struct.pack("<Q", len(raw)) + raw)
        for array in arrays.values():
            stream.write(array.tobytes())
        stream.flush()
        os.fsync(stream.fileno())
    os.replace(temporary, path)


def sha256(path: str | os.PathLike) -> str:
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()
