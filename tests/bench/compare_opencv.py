#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Pliant beside what OpenCV alone makes of the same task, accuracy and time of one run.

    compare_opencv.py --bin build/release/bin --set REAL/packages [--distractors DIR]

SET has `ref` and `query` with NAME_i.jpg, i a number. Images below DIR are indexed too.
OpenCV: 512 SIFT keypoints of an image, twice as many of a query, one FLANN forest of k-d trees over all descriptors, the ratio test, a vote for
the image of each match, and a homography by RANSAC for the ten images with most votes; most inliers come first.
Pliant: `pliant index`, and searches in a warm server, with `deal` and with `rootsift`.
Prints a Markdown table: top-1, processor seconds of an image, and the median milliseconds of a query. Searches alternate.
Needs OpenCV for Python (Debian: python3-opencv).
"""

import argparse
import collections
import pathlib
import resource
import statistics
import subprocess
import tempfile
import time

import cv2
import numpy as np
import service

KEYPOINTS = 512
LONGER_SIDE = 1024
VERIFIED = 10


def object_of(stem):
    return stem.rpartition("_")[0]


def features_of(path, keypoints):
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    scale = LONGER_SIDE / max(image.shape)
    if scale < 1:
        image = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    found, descriptors = cv2.SIFT_create(keypoints).detectAndCompute(image, None)
    return np.float32([keypoint.pt for keypoint in found]), descriptors


class OpenCv:
    name = "OpenCV: SIFT, FLANN, homography"

    def __init__(self, images):
        self.images = images
        self.features = [features_of(path, KEYPOINTS) for path in images]
        self.forest = cv2.FlannBasedMatcher({"algorithm": 1, "trees": 4}, {"checks": 64})
        self.forest.add([descriptors for _, descriptors in self.features])
        self.forest.train()

    def search(self, path):
        points, descriptors = features_of(path, 2 * KEYPOINTS)
        matches = collections.defaultdict(list)
        for best, second in self.forest.knnMatch(descriptors, k=2):
            if best.distance < 0.8 * second.distance:
                matches[best.imgIdx].append((best.queryIdx, best.trainIdx))
        ranked = sorted(matches, key=lambda image: -len(matches[image]))[:VERIFIED]
        return self.images[max(ranked, key=lambda image: self.inliers(points, matches[image], image))].stem if ranked else None

    def inliers(self, points, matches, image):
        if len(matches) < 4:
            return 0
        query, reference = np.array(matches).T
        _, kept = cv2.findHomography(self.features[image][0][reference], points[query], cv2.RANSAC, 5)
        return 0 if kept is None else int(kept.sum())


class Pliant:
    def __init__(self, binaries, descriptor, images, folder):
        self.name = f"Pliant, {descriptor}"
        database = folder / f"{descriptor}.db"
        subprocess.run([binaries / "pliant", "index", *images, "--object-from", "stem", "--db", database, "--descriptor", descriptor], check=True,
                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.server = service.Server(binaries, database)

    def search(self, path):
        hits = self.server.search(path.read_bytes())["hits"]
        return hits[0]["object"] if hits else None


def processor_seconds():
    return sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=pathlib.Path, required=True)
    parser.add_argument("--set", type=pathlib.Path, required=True)
    parser.add_argument("--distractors", type=pathlib.Path)
    options = parser.parse_args()
    images = service.images_below(parser, options.set / "ref", 1)
    if options.distractors:
        images += service.images_below(parser, options.distractors, 1)
    queries = service.images_below(parser, options.set / "query", 1)
    with tempfile.TemporaryDirectory() as name:
        rivals, costs = [], []
        for make in (lambda: OpenCv(images), *(lambda d=d: Pliant(options.bin, d, images, pathlib.Path(name)) for d in ("deal", "rootsift"))):
            before = processor_seconds()
            rivals.append(make())
            costs.append((processor_seconds() - before) / len(images))
        right, times = [0] * len(rivals), [[] for _ in rivals]
        for i, query in enumerate([queries[0], *queries]):
            for number, rival in enumerate(rivals):
                begin = time.monotonic()
                answer = rival.search(query)
                if i == 0:  # warms up
                    continue
                times[number].append(1000 * (time.monotonic() - begin))
                right[number] += answer is not None and object_of(answer) == object_of(query.stem)
        for rival in rivals[1:]:
            rival.server.__exit__()
    print(f"{len(images)} images, {len(queries)} queries\n\n| | top-1 | indexing, processor seconds | query, ms |\n|---|---|---|---|")
    for rival, cost, hits, took in zip(rivals, costs, right, times):
        print(f"| {rival.name} | {hits / len(queries):.3f} | {cost:.3f} | {statistics.median(took):.0f} |")


if __name__ == "__main__":
    main()
