#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Packs a folder of images into one safetensors file for pliant-simulate-scenes.

    python3 -m descriptor.simulation.pack_textures textures/train train.safetensors [--max-side 640]

Reads with OpenCV or, where that is absent, with Pillow.
"""

import argparse
import pathlib
import sys

import numpy as np

from descriptor.training import tensor_file


def read_rgb(path, max_side):
    try:
        import cv2
    except ImportError:
        from PIL import Image

        try:
            image = Image.open(path).convert("RGB")
        except OSError:
            return None
        image.thumbnail((max_side, max_side))
        return np.asarray(image)
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        return None
    scale = max_side / max(image.shape[:2])
    if scale < 1:
        image = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    return np.ascontiguousarray(image[..., ::-1])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--max-side", type=int, default=640, help="pixels (default %(default)s)")
    options = parser.parse_args()
    names = sorted(p.relative_to(options.folder).as_posix() for p in options.folder.rglob("*") if p.is_file())
    images = {}
    for name in names:
        image = read_rgb(options.folder / name, options.max_side)
        if image is None:
            print(f"skipped {name}: not an image", file=sys.stderr)
        else:
            images[name] = image
    if not images:
        sys.exit(f"no image in {options.folder}")
    tensor_file.save(options.out, images)
    print(f"{len(images)} images, {options.out.stat().st_size / 1e6:.0f} MB in {options.out}")


if __name__ == "__main__":
    main()
