# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Small images, each of a texture of its own, as many as there are numbers."""
import hashlib
import random
import struct
import zlib

SIDE_PX = 96
BLOCK_PX = 8


def chunk(kind, data=b""):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def texture(name):
    """A PNG of random grey squares, about fifty keypoints. The same name gives the same bytes."""
    grey, across = random.Random(name), SIDE_PX // BLOCK_PX
    rows = []
    for _ in range(across):
        rows.append((b"\0" + b"".join(bytes([grey.randrange(256)]) * BLOCK_PX for _ in range(across))) * BLOCK_PX)
    header = struct.pack(">IIBBBBB", SIDE_PX, SIDE_PX, 8, 0, 0, 0, 0)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(b"".join(rows), 1))
            + chunk(b"IEND"))


def sha256(data):
    return hashlib.sha256(data).hexdigest()


def write_folder(folder, name, objects, images):
    """Writes a folder of new textures for each object; {sha256: object}."""
    written = {}
    for number in range(objects):
        named = f"{name}-{number}"
        (folder / named).mkdir(parents=True)
        for image in range(images):
            data = texture(f"{folder.name} {named} {image}")
            (folder / named / f"{image}.png").write_bytes(data)
            written[sha256(data)] = named
    return written
