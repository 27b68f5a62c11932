#!/usr/bin/python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Gathers images for the simulator from Debian packages, and splits them for ever.

    /usr/bin/python3 descriptor/simulation/gather_textures.py --out textures

Needs no root: `apt-get download` and `dpkg -x` into a temporary folder. Needs python3-opencv. Writes
textures/{train,dev,test}/PACKAGE/NNNN.jpg and textures/manifest.csv (file, set, package, size, source, hash).

The side is a hash of the image's bytes: 76 % train, 12 % dev, 12 % test. An image keeps its side whatever else is
gathered, now or later. An image that looks like one gathered before (in whatever package) is left out, so that no
two sides share one.
"""

import argparse
import csv
import hashlib
import pathlib
import subprocess
import sys
import tempfile

import cv2
import numpy as np

# Photographs, paintings, posters, maps and surfaces; their licences are in each package's copyright file.
PACKAGES = """
    colobot-common-textures cube2-data endless-sky-data extremetuxracer-data fillets-ng-data
    freecol freedroidrpg-data gcompris-qt-data gnome-backgrounds kgeography-data krank lebiniou-data
    lomiri-wallpapers-16.04 lomiri-wallpapers-20.04 lugaru-data lxqt-themes mate-backgrounds naev-data
    openarena-081-textures openclipart-png opencv-doc palapeli-data planetblupi-common
    plasma-workspace-wallpapers renpy-demo renpy-thequestion stellarium-data torcs-data ufoai-textures
    warzone2100-data wesnoth-1.16-data wesnoth-1.16-dm wesnoth-1.16-httt wesnoth-1.16-low
    wesnoth-1.16-sota wesnoth-1.16-trow wesnoth-1.16-ttb wordpress-theme-twentytwentyone
""".split()
SUFFIXES = {".jpg", ".jpeg", ".png", ".webp", ".bmp", ".tga", ".tif", ".tiff"}
MIN_SIDE = 200


def side_of(digest):
    """train, dev or test, by the first byte of an image's SHA-256."""
    byte = digest[0]
    return "train" if byte < 196 else "dev" if byte < 226 else "test"


def unpack(package, folder):
    """Downloads and unpacks; returns a reason when that fails, else None."""
    download = subprocess.run(["apt-get", "download", package], cwd=folder, capture_output=True, text=True)
    archives = list(folder.glob("*.deb"))
    if download.returncode != 0 or not archives:
        return (download.stderr.strip().splitlines() or ["apt-get download failed"])[-1]
    unpacked = subprocess.run(["dpkg", "-x", str(archives[0]), str(folder / "root")], capture_output=True, text=True)
    return None if unpacked.returncode == 0 else unpacked.stderr.strip()


def read_image(path, max_side):
    """The image in colour, scaled down; None when it is no use as a texture."""
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if image is None or image.ndim < 2 or image.dtype != np.uint8 or min(image.shape[:2]) < MIN_SIDE:
        return None
    if image.ndim == 3 and image.shape[2] == 4:
        if (image[..., 3] < 128).mean() > 0.1:  # a sprite, not an image
            return None
        image = image[..., :3]
    if image.ndim == 2:
        image = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
    if max(image.shape[:2]) > 3 * min(image.shape[:2]):
        return None
    scale = max_side / max(image.shape[:2])
    if scale < 1:
        image = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    return image if has_texture(image) else None


def has_texture(image):
    """Keypoints need contrast in most parts of the image."""
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY).astype(np.float32)
    edges = np.hypot(cv2.Sobel(grey, cv2.CV_32F, 1, 0), cv2.Sobel(grey, cv2.CV_32F, 0, 1))
    parts = cv2.resize((edges > 60).astype(np.float32), (8, 8), interpolation=cv2.INTER_AREA)
    return grey.std() > 15 and (parts > 0.02).mean() > 0.5


def difference_hash(image):
    small = cv2.resize(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), (9, 8), interpolation=cv2.INTER_AREA)
    return np.packbits(small[:, 1:] > small[:, :-1])


def gather(package, options, seen, writer):
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        problem = unpack(package, folder)
        if problem:
            print(f"skipped {package}: {problem}", file=sys.stderr)
            return 0
        files = [p for p in (folder / "root").rglob("*") if p.suffix.lower() in SUFFIXES and p.is_file()]
        # A fixed shuffle, so that the limit takes a sample and not one sub-folder.
        files.sort(key=lambda p: hashlib.sha256(str(p.relative_to(folder)).encode()).digest())
        count = 0
        for path in files:
            if count >= options.limit:
                break
            image = read_image(path, options.max_side)
            if image is None:
                continue
            code = difference_hash(image)
            if any(np.unpackbits(code ^ other).sum() <= 6 for other in seen):
                continue
            seen.append(code)
            digest = hashlib.sha256(path.read_bytes())
            side = side_of(digest.digest())
            target = pathlib.Path(side) / package / f"{count:04d}.jpg"
            (options.out / target).parent.mkdir(parents=True, exist_ok=True)
            if not cv2.imwrite(str(options.out / target), image, [cv2.IMWRITE_JPEG_QUALITY, 92]):
                raise OSError(f"cannot write {options.out / target}")
            source = str(path.relative_to(folder / "root"))
            writer.writerow([target, side, package, image.shape[1], image.shape[0], source, digest.hexdigest()])
            count += 1
        return count


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=pathlib.Path, required=True, help="folder for the images")
    parser.add_argument("--packages", nargs="+", default=PACKAGES, help="Debian packages; default: a list of %d" % len(PACKAGES))
    parser.add_argument("--limit", type=int, default=120, help="images a package (default %(default)s)")
    parser.add_argument("--max-side", type=int, default=640, help="pixels of the longer side (default %(default)s)")
    options = parser.parse_args()
    if options.limit < 1 or options.max_side < MIN_SIDE:
        parser.error(f"--limit must be at least 1 and --max-side at least {MIN_SIDE}")
    options.out.mkdir(parents=True, exist_ok=True)
    seen, total = [], 0
    with open(options.out / "manifest.csv", "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["file", "set", "package", "width", "height", "source", "sha256"])
        for package in options.packages:
            count = gather(package, options, seen, writer)
            total += count
            print(f"{package}: {count} images", flush=True)
    if total == 0:
        sys.exit("no image was gathered; is `apt-get update` done?")
    print(f"{total} images in {options.out}")


if __name__ == "__main__":
    main()
