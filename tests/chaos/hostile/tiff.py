# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Hostile TIFF files, and the EXIF blocks that other formats carry."""
import struct
import zlib

from hostile.registry import bomb


SHORT, LONG, ASCII = 3, 4, 2


def tiff(entries, after=b""):
    """A little-endian TIFF: header, one directory of (tag, type, count, value), what follows it."""
    directory = b"".join(struct.pack("<HHII", *entry) for entry in entries)
    return b"II*\0" + struct.pack("<IH", 8, len(entries)) + directory + b"\0\0\0\0" + after


def tiff_tags(width, height, *more):
    """The tags of a grey, uncompressed image whose one strip is the file's beginning."""
    tags = {256: (LONG, width), 257: (LONG, height), 258: (SHORT, 8), 259: (SHORT, 1), 262: (SHORT, 1),
            273: (LONG, 8), 277: (SHORT, 1), 278: (LONG, height), 279: (LONG, 64)}
    tags.update({tag: (kind, value) for tag, kind, value in more})
    return [(tag, kind, 1, value) for tag, (kind, value) in sorted(tags.items())]


@bomb(".tif")
def size_twice():
    """Two sizes: a reader checks the small one, another decodes the large one."""
    return tiff(tiff_tags(12000, 12000) + [(256, LONG, 1, 200), (257, LONG, 1, 200)], bytes(3300))


@bomb(".tif")
def size_twice_small_first():
    """The same, for decoders that believe the last one."""
    return tiff([(256, LONG, 1, 200), (257, LONG, 1, 200)] + tiff_tags(12000, 12000), bytes(3300))


@bomb(".tif")
def entries_that_claim_many_values():
    """20 000 entries, each of 200 000 values that are all in the file."""
    entries = [(1000 + i, LONG, 200_000, 8) for i in range(20_000)]
    return tiff(tiff_tags(200, 200) + entries, bytes(800_000))


@bomb(".tif")
def many_strips():
    """Four million strips of no bytes."""
    strips = 4_000_000
    entries = [entry for entry in tiff_tags(200, 200, (278, LONG, 1)) if entry[0] not in (273, 279)]
    entries += [(273, LONG, strips, 512), (279, LONG, strips, 512)]
    return tiff(sorted(entries), bytes(512 + 4 * strips))


@bomb(".tif")
def overlapping_strips():
    """Sixty thousand strips that are all the same megabyte."""
    strips = 60_000
    entries = [entry for entry in tiff_tags(1000, strips, (278, LONG, 1)) if entry[0] not in (273, 279)]
    after = 8 + 2 + 12 * (len(entries) + 2) + 4
    entries += [(273, LONG, strips, after), (279, LONG, strips, after + 4 * strips)]
    data = after + 8 * strips
    return tiff(sorted(entries), struct.pack("<I", data) * strips + struct.pack("<I", 1 << 20) * strips + bytes(1 << 20))


@bomb(".tif")
def huge_tile():
    """A small image in one tile of a gigapixel."""
    data = zlib.compress(bytes(16_000_000), 9)
    entries = [entry for entry in tiff_tags(200, 200, (259, SHORT, 8), (322, LONG, 32768), (323, LONG, 32768))
               if entry[0] not in (273, 278, 279)]
    offset = 8 + 2 + 12 * (len(entries) + 2) + 4
    entries += [(324, LONG, 1, offset), (325, LONG, 1, len(data))]
    return tiff(entries, data)


@bomb(".tif")
def many_samples():
    """65 000 samples a pixel."""
    return tiff(tiff_tags(10_000, 10_000, (277, SHORT, 65_000)), bytes(1000))


@bomb(".tif")
def directory_that_is_its_own_next():
    """A list of directories without an end."""
    entries = tiff_tags(64, 64, (279, LONG, 4096))
    directory = b"".join(struct.pack("<HHII", *entry) for entry in entries)
    return b"II*\0" + struct.pack("<IH", 8, len(entries)) + directory + struct.pack("<I", 8) + bytes(8192)


def exif(entries, values):
    """An EXIF block of so many entries that each claim to be a text of all that follows."""
    names = [(270 + i % 60_000, ASCII, values, 8 + 2 + 12 * entries + 4) for i in range(entries)]
    return tiff(names, b"x" * values)
