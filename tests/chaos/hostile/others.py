# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Hostile BMP files, and files that are no images."""
import struct

from hostile.registry import bomb


def bmp(width, height, bits, compression, data):
    header = struct.pack("<IiiHHIIiiII", 40, width, height, 1, bits, compression, len(data), 0, 0, 256, 0)
    palette = bytes(1024)
    offset = 14 + len(header) + len(palette)
    return b"BM" + struct.pack("<IHHI", offset + len(data), 0, 0, offset) + header + palette + data


@bomb(".bmp")
def run_lengths():
    """A hundred megapixels from one run."""
    return bmp(10_000, 10_000, 8, 1, b"\xff\x07\0\x01")


@bomb(".bmp")
def run_lengths_that_jump():
    """Thousands of jumps out of the image."""
    return bmp(10_000, 10_000, 8, 1, b"\0\x02\xff\xff" * 100_000)


@bomb(".bmp")
def least_number():
    """A height whose negative does not exist."""
    return bmp(64, -2**31, 24, 0, bytes(1000))


@bomb(".svg")
def billion_laughs():
    """XML entities that double thirty times."""
    entities = "".join(f'<!ENTITY a{i + 1} "&a{i};&a{i};">' for i in range(30))
    return f'<!DOCTYPE svg [<!ENTITY a0 "ha">{entities}]><svg>&a30;</svg>'.encode()


@bomb(".jpg")
def nothing():
    """No bytes."""
    return b""


@bomb(".jpg")
def noise():
    """A JPEG's beginning and then anything."""
    value, out = 1, bytearray(b"\xff\xd8\xff")
    while len(out) < 200_000:
        value = value * 6364136223846793005 + 1442695040888963407 & (1 << 64) - 1
        out += value.to_bytes(8, "little")
    return bytes(out)
