# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Hostile WebP files."""
import struct

from hostile.registry import bomb
from hostile.tiff import exif


def webp(*chunks):
    body = b"".join(kind + struct.pack("<I", len(data)) + data + b"\0" * (len(data) & 1)
                    for kind, data in chunks)
    return b"RIFF" + struct.pack("<I", len(body) + 4) + b"WEBP" + body


def lossless(width, height):
    """VP8L data whose codes have one symbol each, so that no pixel takes a bit."""
    bits, count = 0x2F, 8
    for value, width_bits in ((width - 1, 14), (height - 1, 14), (1, 1), (0, 3),  # header
                              (0, 1), (0, 1), (0, 1)):  # no transform, no colour cache, no meta codes
        bits |= value << count
        count += width_bits
    for _ in range(5):  # a simple code of one symbol: 0
        bits |= 1 << count
        count += 4
    return bits.to_bytes((count + 7) // 8 + 4, "little")


@bomb(".webp")
def webp_at_the_limit():
    """Ninety-eight megapixels in forty bytes."""
    return webp((b"VP8L", lossless(16_000, 6_100)))


@bomb(".webp")
def canvas_unlike_its_frame():
    """A canvas of 64 x 64 that holds a frame of 16 000 x 6100."""
    canvas = bytes([0, 0, 0, 0]) + (63).to_bytes(3, "little") * 2
    return webp((b"VP8X", canvas), (b"VP8L", lossless(16_000, 6_100)))


@bomb(".webp")
def exif_in_webp():
    """A directory of 65 000 texts of six megabytes each."""
    canvas = bytes([0x08, 0, 0, 0]) + (63).to_bytes(3, "little") * 2
    return webp((b"VP8X", canvas), (b"VP8L", lossless(64, 64)), (b"EXIF", exif(65_000, 6_000_000)))
