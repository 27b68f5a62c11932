#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Makes a folder of hostile pictures: small files that cost a careless reader gigabytes or minutes.

    tests/chaos/bombs.py FOLDER

Each function below is one picture; its docstring says what it attacks. Only Python's standard library
is used: the files are put together byte by byte, because no library would write them.
"""
import argparse
import pathlib
import struct
import zlib

BOMBS = {}


def bomb(extension):
    """Registers a function that returns a file's bytes under its own name."""
    def register(function):
        BOMBS[function.__name__ + extension] = function
        return function
    return register


# TIFF

SHORT, LONG, ASCII = 3, 4, 2


def tiff(entries, after=b""):
    """A little-endian TIFF: header, one directory of (tag, type, count, value), what follows it."""
    directory = b"".join(struct.pack("<HHII", *entry) for entry in entries)
    return b"II*\0" + struct.pack("<IH", 8, len(entries)) + directory + b"\0\0\0\0" + after


def tiff_tags(width, height, *more):
    """The tags of a grey, uncompressed picture whose one strip is the file's beginning."""
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
    """A small picture in one tile of a gigapixel."""
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


# EXIF blocks, in every format that carries them

def exif(entries, values):
    """An EXIF block of so many entries that each claim to be a text of all that follows."""
    names = [(270 + i % 60_000, ASCII, values, 8 + 2 + 12 * entries + 4) for i in range(entries)]
    return tiff(names, b"x" * values)


# PNG

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
def data_beyond_the_picture():
    """Data that unpack to a gigabyte behind the rows."""
    return png(64, 64, 8, 0, zeros(1_000_000_000))


@bomb(".png")
def much_data_beyond_the_picture():
    """Twenty megabytes of data that unpack to twenty gigabytes, of a picture of ten megapixels."""
    deflate = zlib.compressobj(9)
    block = deflate.compress(bytes(1 << 24)) + deflate.flush(zlib.Z_FULL_FLUSH)
    more = deflate.compress(bytes(1 << 24)) + deflate.flush(zlib.Z_FULL_FLUSH)
    return png(3200, 3200, 8, 0, block + more * (20_000_000 // len(more)))


@bomb(".png")
def archive_behind_the_end():
    """A picture that is also a ZIP archive."""
    return small_png() + b"PK\x05\x06" + bytes(18)


@bomb(".png")
def gif_in_png():
    """A PNG in name whose content is a GIF."""
    return b"GIF89a" + struct.pack("<HHBBB", 65_535, 65_535, 0x80, 0, 0) + bytes(6) + b";"


# JPEG

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
    """An EXIF block that holds a picture that holds an EXIF block, a thousand deep."""
    inner = b"\xff\xd8\xff\xd9"
    while len(inner) < 60_000:
        inner = b"\xff\xd8" + segment(0xE1, b"Exif\0\0" + inner) + b"\xff\xd9"
    return jpeg(segment(0xE1, b"Exif\0\0" + inner[:65_000]), frame(0xC0, 64, 64, 1),
                scan([1], 0, 63, 0) + bytes(100))


# WebP and BMP

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
    """Thousands of jumps out of the picture."""
    return bmp(10_000, 10_000, 8, 1, b"\0\x02\xff\xff" * 100_000)


@bomb(".bmp")
def least_number():
    """A height whose negative does not exist."""
    return bmp(64, -2**31, 24, 0, bytes(1000))


# No pictures

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


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n", maxsplit=1)[0])
    parser.add_argument("folder", type=pathlib.Path)
    folder = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    for name, make in BOMBS.items():
        data = make()
        (folder / name).write_bytes(data)
        print(f"{len(data):>9} {name}: {make.__doc__.strip()}")


if __name__ == "__main__":
    main()
