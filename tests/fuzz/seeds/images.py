# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Images of all formats: written by OpenCV, put together byte by byte, and hostile ones."""
import struct
import zlib

import cv2
import numpy as np
from hostile import BOMBS, jpeg, png, tiff, webp
from hostile.others import bmp
from hostile.tiff import ASCII, LONG, SHORT

MOST_HOSTILE_BYTES = 4000
WIDTH, HEIGHT = 20, 24


def grey():
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    return ((x * 9 + y * 5) % 256).astype(np.uint8)


def colour():
    return np.dstack([grey(), np.flipud(grey()), 255 - grey()])


def encoded(extension, image, *parameters):
    good, data = cv2.imencode(extension, image, list(parameters))
    assert good
    return data.tobytes()


def oriented(orientation):
    """An EXIF block of one entry."""
    return tiff.tiff([(274, SHORT, 1, orientation)])


def with_segments(data, *segments):
    """A JPEG with more segments behind its first marker."""
    return data[:2] + b"".join(segments) + data[2:]


def jpegs():
    plain = encoded(".jpg", colour(), cv2.IMWRITE_JPEG_QUALITY, 30)
    progressive = encoded(".jpg", colour(), cv2.IMWRITE_JPEG_QUALITY, 30, cv2.IMWRITE_JPEG_PROGRESSIVE, 1,
                          cv2.IMWRITE_JPEG_RST_INTERVAL, 2)
    exif = jpeg.segment(0xE1, b"Exif\0\0" + oriented(6))
    return {
        "plain.jpg": plain,
        "progressive.jpg": progressive,
        "grey.jpg": encoded(".jpg", grey(), cv2.IMWRITE_JPEG_QUALITY, 30, cv2.IMWRITE_JPEG_OPTIMIZE, 1),
        "exif.jpg": with_segments(plain, exif, jpeg.segment(0xFE, b"comment"), jpeg.segment(0xE2, b"ICC_PROFILE\0\1\1")),
        "padding.jpg": with_segments(plain, b"\xff" + exif, b"\xff\xff" + jpeg.segment(0xEE, b"Adobe\0d\0\0\0\0\0")),
        "cut.jpg": plain[:-40],
    }


def pngs():
    rows = b"".join(b"\0" + bytes(row) for row in grey())
    colours = b"".join(bytes([i % 5]) + row.tobytes() for i, row in enumerate(colour()))
    deep = b"".join(b"\1" + row.astype(">u2").tobytes() for row in colour().astype(np.uint16) * 257)
    with_alpha = b"".join(b"\2" + row.tobytes() for row in np.dstack([colour(), grey()]))
    indices = b"".join(b"\0" + bytes(row % 4) for row in grey())
    passes = [(0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2)]
    interlaced = b"".join(b"\0" + bytes(row) for x, y, dx, dy in passes for row in grey()[y::dy, x::dx])
    palette = png.chunk(b"PLTE", bytes(range(12)))

    def image(depth, kind, data, *more, interlace=0):
        return png.png(WIDTH, HEIGHT, depth, kind, zlib.compress(data), *more, interlace=interlace)

    return {
        "grey.png": image(8, 0, rows),
        "colour.png": image(8, 2, colours),
        "deep.png": image(16, 2, deep),
        "alpha.png": image(8, 6, with_alpha),
        "palette.png": image(8, 3, indices, palette, png.chunk(b"tRNS", b"\0\x80")),
        "bits.png": png.png(WIDTH, HEIGHT, 1, 0, zlib.compress(b"\0\xaa\x55\xaa" * HEIGHT)),
        "interlaced.png": image(8, 0, interlaced, interlace=1),
        "exif.png": image(8, 0, rows, png.chunk(b"eXIf", oriented(8)), png.chunk(b"tEXt", b"a\0b")),
        "texts.png": image(8, 0, rows, png.chunk(b"zTXt", b"a\0\0" + zlib.compress(bytes(5000))),
                             png.chunk(b"gAMA", struct.pack(">I", 45455))),
    }


def webps():
    lossy = encoded(".webp", colour(), cv2.IMWRITE_WEBP_QUALITY, 30)
    canvas = bytes([0x08, 0, 0, 0]) + (WIDTH - 1).to_bytes(3, "little") + (HEIGHT - 1).to_bytes(3, "little")
    return {
        "lossy.webp": lossy,
        "alpha.webp": encoded(".webp", np.dstack([colour(), grey()]), cv2.IMWRITE_WEBP_QUALITY, 30),
        "lossless.webp": encoded(".webp", colour(), cv2.IMWRITE_WEBP_QUALITY, 101),
        "exif.webp": webp.webp((b"VP8X", canvas), (b"VP8L", webp.lossless(WIDTH, HEIGHT)), (b"EXIF", oriented(5)),
                               (b"XMP ", b"<x/>")),
        "exif_before.webp": webp.webp((b"VP8X", canvas), (b"EXIF", b"Exif\0\0" + oriented(3)),
                                      (lossy[12:16], lossy[20:20 + struct.unpack("<I", lossy[16:20])[0]])),
    }


def bmps():
    header = struct.pack("<IHHHH", 12, WIDTH, HEIGHT, 1, 24)
    pixels = bytes(60 * HEIGHT)
    return {
        "plain.bmp": encoded(".bmp", grey()[:8, :8]),
        "upside_down.bmp": bmp(16, -8, 8, 0, bytes(range(128))),
        "runs.bmp": bmp(16, 8, 8, 1, b"\x10\x07\0\0" * 7 + b"\0\x05abcde\0\0\2\1\0\x01"),
        "core.bmp": b"BM" + struct.pack("<IHHI", 26 + len(pixels), 0, 0, 26) + header + pixels,
    }


def strips(big_endian, bits, samples, *more):
    """A TIFF with its pixels before its directory."""
    order = ">" if big_endian else "<"
    row = WIDTH * samples * bits // 8
    data = bytes(i * 7 % 256 for i in range(row * HEIGHT))
    entries = {256: (SHORT, WIDTH), 257: (SHORT, HEIGHT), 258: (SHORT, bits), 259: (SHORT, 1),
               262: (SHORT, 2 if samples == 3 else 1), 273: (LONG, 8), 277: (SHORT, samples), 278: (SHORT, HEIGHT),
               279: (LONG, len(data))}
    entries.update({tag: (kind, value) for tag, kind, value in more})
    packed = b"".join(
        struct.pack(order + "HHI", tag, kind, 1)
        + (struct.pack(order + "HH", value, 0) if kind == SHORT else struct.pack(order + "I", value))
        for tag, (kind, value) in sorted(entries.items()))
    head = b"MM\0*" if big_endian else b"II*\0"
    return (head + struct.pack(order + "I", 8 + len(data)) + data + struct.pack(order + "H", len(entries)) + packed
            + bytes(4))


def tiffs():
    return {
        "packed.tif": encoded(".tiff", colour()),
        "deep.tif": encoded(".tiff", colour().astype(np.uint16) * 257),
        "little.tif": strips(False, 8, 1),
        "big.tif": strips(True, 8, 3),
        "turned.tif": strips(True, 16, 1, (274, SHORT, 6)),
    }


def gif(interlaced, transparent=None):
    """Codes of 8 bits: a clear code (128) begins each row, before the table would grow."""
    rows = grey() // 2
    order = [y for first, step in [(0, 8), (4, 8), (2, 4), (1, 2)] for y in range(first, HEIGHT, step)] if interlaced else range(HEIGHT)
    codes = b"".join(b"\x80" + rows[y].tobytes() for y in order) + b"\x81"
    blocks = b"".join(bytes([len(codes[at:at + 255])]) + codes[at:at + 255] for at in range(0, len(codes), 255))
    control = b"" if transparent is None else b"\x21\xf9\4\1\0\0" + bytes([transparent, 0])
    return (b"GIF89a" + struct.pack("<HHBBB", WIDTH + 4, HEIGHT, 0xF6, 0, 0) + bytes(i * 2 for i in range(128) for _ in range(3))
            + b"\x21\xfe\2hi\0" + control + struct.pack("<BHHHHB", 0x2C, 2, 0, WIDTH, HEIGHT, 0x40 if interlaced else 0)
            + b"\7" + blocks + b"\0\x3b")


def gifs():
    return {"plain.gif": gif(False), "interlaced.gif": gif(True, 9)}


def hostile():
    made = {name: make() for name, make in BOMBS.items()}
    return {f"hostile_{name}": data for name, data in made.items() if len(data) <= MOST_HOSTILE_BYTES}


def images():
    return {**jpegs(), **pngs(), **webps(), **bmps(), **tiffs(), **gifs(), **hostile()}


def exif_blocks():
    many = [(270, ASCII, 4, 0x64636261), (274, SHORT, 1, 3), (0x9000, 7, 4, 0x30303230)]
    return {**{name: data for name, data in {**tiffs(), **hostile()}.items() if name.endswith(".tif")},
            "exif_6": oriented(6), "exif_more": tiff.tiff(many), "exif_twice": tiff.tiff([many[1], (274, SHORT, 1, 8)]),
            "exif_long": tiff.tiff([(274, LONG, 1, 7)]), "no_values": tiff.tiff([(274, SHORT, 0, 0)])}


def pnms():
    return {
        "grey.pgm": b"P5\n4 3\n255\n" + bytes(range(12)),
        "colour.ppm": b"P6 2 2 255\n" + bytes(range(12)),
        "comments.pgm": b"P5 # made by hand\n# so wide\n4\t3 #\n255\n" + bytes(12),
        "sixteen.pgm": b"P5\n4 3\n65535\n" + bytes(24),
        "huge.pgm": b"P5\n30000 30000\n255\n" + bytes(12),
        "text.pgm": b"P2\n2 2\n255\n0 1 2 3\n",
    }


SEEDS = {"image": images, "exif": exif_blocks, "pnm": pnms}
