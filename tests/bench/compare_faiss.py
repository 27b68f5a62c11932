#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Ranks the same descriptors with Pliant and with Faiss, in turn, and prints accuracy beside time.

    PYTHONPATH=build/release/python compare_faiss.py --set CACHE/packages/deal-X.db --distractors CACHE/worn-shirts/deal-X.db --images 1000

The databases are those of `pliant eval retrieval --cache`. Where they have fewer images than asked for, distractors are repeated with noise.
Faiss: as many lists as Pliant has words, as many visited, codes of 4 bits for fast scan (IndexIVFPQFastScan) of the same length, the 100 nearest
descriptors. They vote as in Pliant (`index/RANKING.md`), without the weights of contrast and without the rank among the votes for one descriptor.
Pliant: `Index.search` without verification. Prints a Markdown table: top-1, median milliseconds of a query, seconds to train and to add.
Needs Faiss for Python (Debian: python3-faiss).
"""
import argparse
import pathlib
import statistics
import tempfile
import time

import faiss
import numpy as np
import pliant

NEAREST = 100
NOISE = 0.4  # length of the noise on a descriptor that is repeated


def read(database, collection):
    with pliant.Index(database, collection=collection, create=False) as index:
        return [(image.object, index.features(image.id)) for image in index]


def drawn(features, count, random):
    """At most `count` keypoints."""
    rows = random.permutation(len(features))[:count]
    return pliant.Features(features.keypoints[rows], features.descriptors[rows], features.width, features.height, features.model_id)


def noisy(features, random):
    noise = random.standard_normal(features.descriptors.shape).astype(np.float32)
    descriptors = features.descriptors + NOISE * noise / np.linalg.norm(noise, axis=1, keepdims=True)
    descriptors /= np.linalg.norm(descriptors, axis=1, keepdims=True)
    return pliant.Features(features.keypoints, descriptors, features.width, features.height, features.model_id)


class Pliant:
    name = "Pliant"

    def __init__(self, folder, images, options):
        self.index = pliant.Index(folder / "index.db", descriptor=images[0][1])
        self.adding = -time.monotonic()
        for label, features in images:
            self.index.add(features, object=label)
        self.adding += time.monotonic()
        self.training = -time.monotonic()
        self.index.train(words=options.words, sample=options.sample)
        self.training += time.monotonic()

    def search(self, features):
        hits = self.index.search(features, 1, verify="none", threads=2)
        return hits[0].object if hits else None


class Faiss:
    name = "Faiss: IVF, PQ, fast scan"

    def __init__(self, images, options, random):
        self.labels = [label for label, _ in images]
        counts = [len(features) for _, features in images]
        self.image = np.repeat(np.arange(len(images)), counts)
        self.length = np.sqrt(np.array(counts))
        dim = images[0][1].descriptors.shape[1]
        self.words = faiss.IndexFlatL2(dim)
        self.index = faiss.IndexIVFPQFastScan(self.words, dim, options.words, 32, 4)
        self.index.nprobe = 16 if options.words < 32768 else 8
        rows = [features.descriptors for _, features in images]
        sample = np.concatenate([rows[i] for i in random.permutation(len(rows))[:options.sample // 400]])
        self.training = -time.monotonic()
        self.index.train(sample[:options.sample])
        self.training += time.monotonic()
        self.adding = -time.monotonic()
        for begin in range(0, len(rows), 1000):
            self.index.add(np.concatenate(rows[begin:begin + 1000]))
        self.adding += time.monotonic()

    def search(self, features):
        words, _ = self.words.search(features.descriptors, self.index.nprobe)
        limits = 0.7 * np.maximum(words[:, 0], 0.3 * words[:, -1])
        distances, rows = self.index.search(features.descriptors, NEAREST)
        votes = np.zeros(len(self.labels))
        for limit, row, distance in zip(limits, rows, distances):
            weights = limit - distance
            kept = (row >= 0) & (weights > 0)
            images, first = np.unique(self.image[row[kept]], return_index=True)  # nearest first
            votes[images] += weights[kept][first] / np.sqrt(max(1, len(images)))
        return self.labels[np.argmax(votes / self.length)]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--set", type=pathlib.Path, required=True)
    parser.add_argument("--distractors", type=pathlib.Path, nargs="*", default=[])
    parser.add_argument("--images", type=int, default=1000)
    parser.add_argument("--words", type=int, default=1024)
    parser.add_argument("--descriptors", type=int, default=512)
    parser.add_argument("--queries", type=int, default=200)
    options = parser.parse_args()
    options.sample = 20 * options.words
    random = np.random.default_rng(1)
    faiss.omp_set_num_threads(2)
    images = read(options.set, "gallery")
    others = [("", drawn(features, options.descriptors, random)) for database in options.distractors
              for collection in ("gallery", "queries") for _, features in read(database, collection)]
    wanted = options.images - len(images)
    images += [others[i] if i < len(others) else ("", noisy(others[i % len(others)][1], random)) for i in range(wanted if others else 0)]
    queries = [(label, drawn(features, options.descriptors, random)) for label, features in read(options.set, "queries")]
    queries = [queries[i] for i in random.permutation(len(queries))[:options.queries]]
    with tempfile.TemporaryDirectory() as folder:
        rivals = [Pliant(pathlib.Path(folder), images, options), Faiss(images, options, random)]
        right, times = [0] * len(rivals), [[] for _ in rivals]
        for i, (label, features) in enumerate([queries[0], *queries]):
            for number, rival in enumerate(rivals):
                begin = time.monotonic()
                answer = rival.search(features)
                if i > 0:  # the first warms up
                    times[number].append(1000 * (time.monotonic() - begin))
                    right[number] += answer == label
        print(f"{len(images)} images, {len(queries)} queries, {options.words} words\n\n| | top-1 | query, ms | training, s | adding, s |\n|---|---|---|---|---|")
        for rival, took, hits in zip(rivals, times, right):
            print(f"| {rival.name} | {hits / len(queries):.3f} | {statistics.median(took):.1f} | {rival.training:.0f} | {rival.adding:.0f} |")
        rivals[0].index.close()


if __name__ == "__main__":
    main()
