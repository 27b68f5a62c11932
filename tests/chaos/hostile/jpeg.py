# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Hostile JPEG files."""
import struct

from hostile.registry import bomb
from hostile.tiff import exif


def segment(marker, data):
    return struct.pack(">BBH", 0xFF, marker, len(data) + 2) + data


# One code of one bit for the value 0, for DC and for AC.
TABLES = b"".join(segment(0xC4, bytes([kind]) + bytes([1] + [0] * 15) + b"\0") for kind in (0x00, 0x10))
QUANTISATION = segment(0xDB, b"\0" + bytes([1] * 64))


def frame(marker, width, height, components):
    return segment(marker, struct.pack(">BHHB", 8, height, width, components)
                   + b"".join(bytes([i + 1, 0x11, 0]) for i in range(components)))


def scan(components, first, last, approximation):
    return segment(0xDA, bytes([len(components)]) + b"".join(bytes([c, 0]) for c in components)
                   + bytes([first, last, approximation]))


def jpeg(*parts):
    return b"\xff\xd8" + QUANTISATION + TABLES + b"".join(parts) + b"\xff\xd9"


@bomb(".jpg")
def thousands_of_scans():
    """Each scan of a few bytes makes the decoder walk through 16 megapixels."""
    scans = scan([1], 0, 0, 0x01) + bytes(64) + (scan([1], 0, 0, 0x10) + bytes(8)) * 5000
    return jpeg(frame(0xC2, 4096, 4096, 1), scans)


@bomb(".jpg")
def progressive_at_the_limit():
    """The coefficients of a hundred megapixels in three components."""
    return jpeg(frame(0xC2, 10_000, 10_000, 3), scan([1, 2, 3], 0, 0, 0) + bytes(1000))


@bomb(".jpg")
def components_one_by_one():
    """Not progressive, but a scan for each component: all coefficients are kept, too."""
    return jpeg(frame(0xC0, 10_000, 10_000, 3), b"".join(scan([c], 0, 63, 0) + bytes(100) for c in (1, 2, 3)))


@bomb(".jpg")
def baseline_at_the_limit():
    """A hundred megapixels from a kilobyte, which is allowed."""
    return jpeg(frame(0xC0, 10_000, 10_000, 1), scan([1], 0, 63, 0) + bytes(1000))


@bomb(".jpg")
def two_frames():
    """A small frame and then a large one."""
    return jpeg(frame(0xC0, 64, 64, 1), frame(0xC0, 10_000, 10_000, 1), scan([1], 0, 63, 0) + bytes(100))


@bomb(".jpg")
def exif_in_jpeg():
    """A hundred EXIF blocks of 2500 entries, each a text of 30 000 bytes."""
    block = segment(0xE1, b"Exif\0\0" + exif(2500, 30_000))
    return jpeg(block * 100, frame(0xC0, 64, 64, 1), scan([1], 0, 63, 0) + bytes(100))


@bomb(".jpg")
def profiles():
    """Thirty megabytes of colour profile."""
    block = segment(0xE2, b"ICC_PROFILE\0\x01\xff" + bytes(65_000))
    return jpeg(block * 480, frame(0xC0, 64, 64, 1), scan([1], 0, 63, 0) + bytes(100))


@bomb(".jpg")
def thumbnail_in_thumbnail():
    """An EXIF block that holds an image that holds an EXIF block, a thousand deep."""
    inner = b"\xff\xd8\xff\xd9"
    while len(inner) < 60_000:
        inner = b"\xff\xd8" + segment(0xE1, b"Exif\0\0" + inner) + b"\xff\xd9"
    return jpeg(segment(0xE1, b"Exif\0\0" + inner[:65_000]), frame(0xC0, 64, 64, 1),
                scan([1], 0, 63, 0) + bytes(100))
