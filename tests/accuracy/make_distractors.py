#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Makes a folder of distractors for `pliant eval retrieval --distractors`: images that show none of
the objects. A large image below the given folders becomes two halves, a small one stays whole. The
program skips nearly plain images. The same folders give the same files.

    tests/accuracy/make_distractors.py textures/train --out distractors --count 2000

descriptor/simulation/gather_textures.py makes such folders from Debian packages. Never use images
that the objects of the set were made from.
"""
import argparse
import hashlib
import pathlib
import sys

import cv2
import numpy as np

SIDE = 640  # of the longer side of a distractor, pixels
SMALLEST = 300  # shortest side of a half, pixels; smaller images stay whole
PLAIN = 25.0  # lowest variance of the Laplacian at SIDE; below it an image is too plain


def images(folders):
    """All files below the folders, in an order that depends only on their contents."""
    files = []
    for folder in folders:
        if not folder.is_dir():
            sys.exit(f"{folder} is not a folder")
        files += [path for path in folder.rglob("*") if path.is_file()]
    by_content = {hashlib.sha256(path.read_bytes()).hexdigest(): path for path in sorted(files)}
    return [by_content[key] for key in sorted(by_content)]


def halves(image):
    height, width = image.shape[:2]
    if max(height, width) // 2 < SMALLEST or min(height, width) < SMALLEST:
        return [image]
    if width >= height:
        return [image[:, : width // 2], image[:, width // 2 :]]
    return [image[: height // 2], image[height // 2 :]]


def scaled(image):
    factor = SIDE / max(image.shape[:2])
    method = cv2.INTER_AREA if factor < 1 else cv2.INTER_CUBIC
    return cv2.resize(image, None, fx=factor, fy=factor, interpolation=method)


def is_plain(image):
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    return float(np.var(cv2.Laplacian(grey, cv2.CV_32F))) < PLAIN


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("folders", nargs="+", type=pathlib.Path, metavar="FOLDER", help="folders of images")
    parser.add_argument("--out", required=True, type=pathlib.Path, help="new folder for the distractors")
    parser.add_argument("--count", type=int, default=2000, help="number of distractors (default: %(default)s)")
    options = parser.parse_args()
    part = options.out.with_name("." + options.out.name + ".part")
    if options.out.exists() or part.exists():
        sys.exit(f"{options.out} or {part} already exists. Delete it, or choose another --out.")
    part.mkdir(parents=True)
    made = 0
    for path in images(options.folders):
        image = cv2.imread(str(path), cv2.IMREAD_COLOR)
        if image is None:
            print(f"skipped {path}: not a readable image", file=sys.stderr)
            continue
        for half in map(scaled, halves(image)):
            if made == options.count or is_plain(half):
                continue
            made += 1
            cv2.imwrite(str(part / f"{made:05d}.jpg"), half, [cv2.IMWRITE_JPEG_QUALITY, 90])
    if made < options.count:
        sys.exit(f"only {made} of {options.count} distractors made; they are in {part}. Add folders, or lower --count.")
    part.rename(options.out)
    print(f"{made} distractors in {options.out}")


if __name__ == "__main__":
    main()
