# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Hostile PNG files."""
import struct
import zlib

from hostile.registry import bomb
from hostile.tiff import exif


def chunk(kind, data=b""):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png(width, height, depth, colour, data, *more, interlace=0):
    header = struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, interlace)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + b"".join(more) + chunk(b"IDAT", data)
            + chunk(b"IEND"))


def zeros(count):
    """So many zero bytes, deflated: 1 MB for each GB."""
    deflate, pieces, block = zlib.compressobj(9), [], bytes(1 << 20)
    for begin in range(0, count, len(block)):
        pieces.append(deflate.compress(block[:count - begin]))
    return b"".join(pieces) + deflate.flush()


def small_png(*more):
    rows = b"".join(b"\0" + bytes((x * 7 + y * 13) % 256 for x in range(64)) for y in range(64))
    return png(64, 64, 8, 0, zlib.compress(rows), *more)


@bomb(".png")
def compressed_texts():
    """A hundred texts of eight megabytes each."""
    text = b"Comment\0\0" + zeros(8_000_000 - 100)
    return small_png(*[chunk(b"zTXt", text)] * 100)


@bomb(".png")
def compressed_profile():
    """A colour profile of 200 megabytes."""
    return small_png(chunk(b"iCCP", b"profile\0\0" + zeros(200_000_000)))


@bomb(".png")
def exif_in_png():
    """A directory of 65 000 texts of six megabytes each."""
    return small_png(chunk(b"eXIf", exif(65_000, 6_000_000)))


@bomb(".png")
def exif_blocks():
    """Two thousand EXIF blocks of 3000 entries each."""
    return small_png(*[chunk(b"eXIf", exif(900, 3000))] * 2000)


@bomb(".png")
def sixteen_bits_and_alpha():
    """A hundred megapixels of eight bytes each."""
    return png(10_000, 10_000, 16, 6, zeros(10_000 * (8 * 10_000 + 1)))


@bomb(".png")
def interlaced():
    """A hundred megapixels, interlaced: no row is whole before the last pass."""
    return png(10_000, 10_000, 8, 2, zeros(10_000 * (3 * 10_000 + 1)), interlace=1)


@bomb(".png")
def grey_at_the_limit():
    """A hundred grey megapixels, which are allowed."""
    return png(10_000, 10_000, 8, 0, zeros(10_000 * 10_001))


@bomb(".png")
def very_wide():
    """65 535 x 16 pixels."""
    return png(65_535, 16, 8, 2, zeros(16 * (3 * 65_535 + 1)))


@bomb(".png")
def one_row():
    """65 535 x 1 pixels."""
    return png(65_535, 1, 8, 2, zeros(3 * 65_535 + 1))


@bomb(".png")
def empty_data_chunks():
    """A million chunks of data without data."""
    whole = small_png()
    at = whole.index(b"IDAT") - 4
    return whole[:at] + chunk(b"IDAT") * 1_000_000 + whole[at:]


@bomb(".png")
def data_beyond_the_image():
    """Data that unpack to a gigabyte behind the rows."""
    return png(64, 64, 8, 0, zeros(1_000_000_000))


@bomb(".png")
def much_data_beyond_the_image():
    """Twenty megabytes of data that unpack to twenty gigabytes, of an image of ten megapixels."""
    deflate = zlib.compressobj(9)
    block = deflate.compress(bytes(1 << 24)) + deflate.flush(zlib.Z_FULL_FLUSH)
    more = deflate.compress(bytes(1 << 24)) + deflate.flush(zlib.Z_FULL_FLUSH)
    return png(3200, 3200, 8, 0, block + more * (20_000_000 // len(more)))


@bomb(".png")
def archive_behind_the_end():
    """An image that is also a ZIP archive."""
    return small_png() + b"PK\x05\x06" + bytes(18)


@bomb(".png")
def gif_in_png():
    """A PNG in name whose content is a GIF."""
    return b"GIF89a" + struct.pack("<HHBBB", 65_535, 65_535, 0x80, 0, 0) + bytes(6) + b";"
