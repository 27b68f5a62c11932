# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Files and blobs of our own formats (index/FORMAT.md; descriptor/base/safetensors.h)."""
import json
import math
import pathlib
import re
import struct
import sys
import zlib

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[2]
TYPE_BYTES = {"F16": 2, "F32": 4, "U8": 1}


def safetensors(header, data=b""):
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    return struct.pack("<Q", len(text)) + text + data


def tensor(dtype, shape, begin):
    return {"dtype": dtype, "shape": shape, "data_offsets": [begin, begin + TYPE_BYTES[dtype] * math.prod(shape)]}


def tensor_files():
    a, b = tensor("F32", [2, 3], 0), tensor("F16", [2], 24)
    two = {"__metadata__": {"model_id": "x"}, "a": a, "b": b}
    data = struct.pack("<6f", *range(6)) + struct.pack("<2e", 1, -2)
    return {
        "two": safetensors(two, data),
        "nan": safetensors({"a": a}, struct.pack("<6f", 1, 2, math.nan, math.inf, 0, -0.0)),
        "scalar": safetensors({"s": tensor("U8", [], 0)}, b"\7"),
        "nothing": safetensors({}),
        "no_values": safetensors({"e": tensor("F32", [0, 4], 0)}),
        "gap": safetensors({"a": a, "b": tensor("F16", [2], 26)}, data + b"\0\0"),
        "overlap": safetensors({"a": a, "b": tensor("F16", [2], 20)}, data[:24]),
        "twice": safetensors(b'{"a":{"dtype":"U8","shape":[1],"data_offsets":[0,1]},"a":1}', b"\0"),
        "deep": safetensors(b"[" * 300 + b"]" * 300),
        "huge": safetensors(b'{"a":{"dtype":"U8","shape":[1099511627776,1099511627776],"data_offsets":[0,1]}}', b"\0"),
        "cut": safetensors(two, data)[:-3],
        "long_header": struct.pack("<Q", 1 << 62) + b"{}",
    }


def weights():
    """The header of DEAL's weights, of half floats and with the narrowest hidden layers."""
    with (ROOT / "descriptor/model/deal.safetensors").open("rb") as file:
        header = json.loads(file.read(*struct.unpack("<Q", file.read(8))))
    metadata, offset, small = header.pop("__metadata__"), 0, {}
    for name, entry in sorted(header.items()):
        shape = entry["shape"]
        hidden = re.fullmatch(r"localization\.fc(\d)\.(weight|bias)", name)
        if hidden:
            layer, what = int(hidden[1]), hidden[2]
            rows = 132 if layer == 4 else 1
            shape = [rows] if what == "bias" else [rows, 3200 if layer == 1 else 1]
        small[name] = tensor("F16", shape, offset)
        offset = small[name]["data_offsets"][1]
    expected = int(re.search(r"kDataBytes = ([\d']+);", (HERE.parent / "weights_fuzz.cc").read_text())[1].replace("'", ""))
    if offset != expected:
        sys.exit(f"the smallest weights have {offset} bytes of data: change kDataBytes in weights_fuzz.cc")
    whole = {"__metadata__": {key: metadata[key] for key in ("format", "radius_per_size")}, **small}
    wrong = {**whole, "__metadata__": {"format": "pliant-deal", "radius_per_size": "1e999"}}
    missing = {name: entry for name, entry in whole.items() if "conv1" not in name}

    def text(value):
        return json.dumps(value, separators=(",", ":")).encode()

    return {"whole": text(whole), "radius": text({"__metadata__": wrong["__metadata__"]}),
            "missing": text(missing)[:2000], "other": text({"__metadata__": {"format": "other"}})}


def features(kind, dim, rows, row, **changes):
    values = {"magic": b"PLFT", "version": 4, "coloured": 0, "width": 640, "height": 480, **changes}
    body = struct.pack("<4sBBBIIII", values["magic"], values["version"], kind, values["coloured"], rows, dim,
                       values["width"], values["height"])
    points = b"".join(struct.pack("<HHHBB", 9000 * i, 7000 * i, 20000 + i, 30 * i, 140) for i in range(rows))
    return body + points + row * rows


def feature_blobs():
    row = struct.pack("<H2B", 0x2C00, 0x9E, 0x40)  # of 4 components: a half and 4 codes of 4 bits
    coloured = features(0, 4, 3, row, coloured=1)
    cells = zlib.compress(bytes(range(120, 132)))
    return {
        "colours": coloured + struct.pack("<HH", 3, 2) + cells,
        "colours_cut": coloured + struct.pack("<HH", 3, 2) + cells[:-3],
        "colours_more": coloured + struct.pack("<HH", 3, 2) + cells + b"1",
        "colours_none": coloured,
        "colours_huge": coloured + struct.pack("<HH", 0xFFFF, 0xFFFF) + cells,
        "preview": features(0, 4, 1, row, coloured=2) + struct.pack("<I", 6) + bytes(range(6)),
        "preview_and_colours": features(0, 4, 1, row, coloured=3) + struct.pack("<I", 2) + b"ab" + struct.pack("<HH", 3, 2) + cells,
        "preview_cut": features(0, 4, 1, row, coloured=2) + struct.pack("<I", 7) + bytes(6),
        "bits": features(1, 4, 3, b"\x0f\xf0\xaa\x55"),
        "whole": features(0, 4, 3, row),
        "small_step": features(0, 4, 1, struct.pack("<H2B", 1, 0x9E, 0x40)),
        "not_finite": features(0, 4, 1, struct.pack("<H2B", 0x7C00, 0x9E, 0x40)),
        "zero": features(0, 4, 1, bytes(4)),
        "empty": features(0, 128, 0, b""),
        "no_dim": features(0, 0, 2, b""),
        "wide": features(0, 4, 1, row, width=0xFFFFFFFF),
        "flag": features(0, 4, 1, row, coloured=9),
        "version": features(0, 4, 1, row, version=3),
        "many": features(0, 4, 0, b"")[:7] + struct.pack("<II", 1 << 20, 1 << 14) + bytes(8),
    }


def varint(value):
    out = b""
    while value >= 0x80:
        out += bytes([value & 0x7F | 0x80])
        value >>= 7
    return out + bytes([value])


def words(values, bits, version=2):
    """The vocabulary has 2^10 words."""
    packed = sum(value << (i * bits) for i, value in enumerate(values))
    return bytes([10, version]) + varint(len(values)) + bytes([bits]) + packed.to_bytes((len(values) * bits + 7) // 8, "little")


def words_blobs():
    values = [3, 4, 205, 3]
    return {
        "words": words(values, 8),
        "all_bits": words([1023, 0, 1023], 10),
        "wide": words(values, 32),
        "version": words(values, 8, version=1),
        "empty": words([], 0),
        "zeros": words([0] * 9, 0),
        "too_far": words([1024], 11),
        "too_wide": words(values, 33),
        "too_many": bytes([10, 2, 0xFF, 0xFF, 0xFF, 0xFF, 0x0F, 0]),
        "long_number": bytes([10, 2, 0x81, 0x80, 0x80, 0x80, 0x00, 3, 1]),
        "more": words(values, 8) + b"\0",
        "filled_up": words([1], 1)[:-1] + b"\x03",
    }


def codebook(kind, dim, words, code_bytes, part_dim, values=()):
    return bytes([kind, dim - 1, words - 1, 1]) + varint(code_bytes) + varint(part_dim) + struct.pack(
        f"<{len(values)}f", *values)


def codebook_blobs():
    def floats(scale):
        rotation = [float(i // 4 == i % 4) for i in range(16)]
        return rotation + [scale * (i % 17 - 8) for i in range(4 * 16)]

    return {
        "floats": codebook(0, 4, 3, 1, 2, floats(0.25)),
        "padded": codebook(0, 3, 2, 1, 2, [0.5] * 12 + [0.1 * i for i in range(64)]),
        "large": codebook(0, 4, 3, 1, 2, floats(1e37)),
        "small": codebook(0, 4, 3, 1, 2, floats(1e-44)),
        "none": codebook(0, 4, 3, 0, 0),
        "binary": codebook(1, 4, 3, 4, 0),
        "binary_other": codebook(1, 4, 3, 5, 0),
        "not_finite": codebook(0, 4, 3, 1, 2, floats(math.inf)),
        "huge": codebook(0, 4, 3, 1 << 14, 1 << 14),
    }


SEEDS = {"safetensors": tensor_files, "weights": weights, "feature_blob": feature_blobs, "words_blob": words_blobs,
         "codebook_blob": codebook_blobs}
