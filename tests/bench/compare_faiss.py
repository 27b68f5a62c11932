#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Pliant's ranking beside the same votes over an index of Faiss, accuracy and time of one run.

    compare_faiss.py --bin build/release/bin --set REAL/packages --distractors DIR [--words 4000]

SET has `ref` and `query` with NAME_i.jpg, i a number. Images below DIR are indexed too, all with `deal`.
Faiss: an inverted file of as many means with the same 16 bytes a descriptor (OPQ, 32 parts of 4 bits, fast scan), the same number of lists, and
the nearest 200 descriptors of each of the query's. Pliant: a warm server without verification, its own figures for quantising and ranking.
Prints a Markdown table: top-1 without verification and the median milliseconds of a query. Queries alternate.
Needs Faiss for Python (Debian: python3-faiss).
"""

import argparse
import pathlib
import statistics
import subprocess
import tempfile
import time

import faiss
import numpy as np
import service

PROBES = 16
NEAREST = 200
REACH, LEAST = 0.7, 0.3  # index/RANKING.md


def object_of(name):
    return name.rpartition("_")[0]


class Faiss:
    name = "Faiss, OPQ and IVF-PQ fast scan"

    def __init__(self, features, words):
        self.names, starts, descriptors = features["names"], features["starts"], features["descriptors"]
        self.counts = np.diff(starts)
        self.image_of = np.repeat(np.arange(len(self.counts)), self.counts)
        self.index = faiss.index_factory(descriptors.shape[1], f"OPQ32,IVF{words},PQ32x4fsr")
        self.index.train(descriptors[np.random.default_rng(1).permutation(len(descriptors))[: 40 * words]])
        self.index.add(descriptors)
        self.lists = faiss.extract_index_ivf(self.index)
        self.lists.nprobe = PROBES

    def search(self, descriptors):
        begin = time.monotonic()
        distances, found = self.index.search(descriptors, NEAREST)
        to_words, _ = self.lists.quantizer.search(self.index.chain.at(0).apply(descriptors), PROBES)
        limits = REACH * np.maximum(to_words[:, 0], LEAST * to_words[:, -1])
        weights = np.maximum(0, limits[:, None] - distances)
        images = np.where(found >= 0, self.image_of[found], 0)
        votes = np.zeros(len(self.counts))
        for of, weight in zip(images, weights):
            best = np.zeros(len(votes))
            np.maximum.at(best, of, weight)
            votes += best / np.sqrt(max(1, np.count_nonzero(best)))
        first = np.argmax(votes / np.sqrt(np.maximum(8, self.counts)))
        return pathlib.Path(str(self.names[first])).stem, 1000 * (time.monotonic() - begin)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=pathlib.Path, required=True)
    parser.add_argument("--set", type=pathlib.Path, required=True)
    parser.add_argument("--distractors", type=pathlib.Path, required=True)
    parser.add_argument("--words", type=int, default=4000)
    options = parser.parse_args()
    queries = service.images_below(parser, options.set / "query", 1)
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)

        def pliant(*arguments):
            subprocess.run([options.bin / "pliant", *arguments], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

        database = folder / "x.db"
        pliant("index", options.set / "ref", options.distractors, "--no-originals", "--db", database)
        pliant("vocab", "train", "--db", database, "--words", str(options.words), "--use")
        pliant("db", "export", folder / "stored.npz", "--db", database)
        pliant("describe", options.set / "query", "--max-keypoints", "1024", "--out", folder / "queries.npz")
        rival = Faiss(np.load(folder / "stored.npz"), options.words)
        asked = np.load(folder / "queries.npz")
        right, times = [0, 0], [[], []]
        with service.Server(options.bin, database) as server:
            server.collection += "/search?verify=none"
            for i, name_of_query in enumerate(asked["names"]):
                rows = asked["descriptors"][asked["starts"][i] : asked["starts"][i + 1]]
                answers = [rival.search(rows)]
                photo = (options.set / "query" / str(name_of_query)).read_bytes()
                answer = service.request(server.collection, "POST", photo, "application/octet-stream")
                took = answer["timings"]["quantize_ms"] + answer["timings"]["rank_ms"]
                answers.append((pathlib.Path(answer["hits"][0]["source"]).stem, took))
                for number, (first, took) in enumerate(answers):
                    right[number] += object_of(first) == object_of(pathlib.Path(str(name_of_query)).stem)
                    times[number].append(took)
    print(f"{len(rival.counts)} images, {len(rival.image_of)} descriptors, {options.words} words, {len(queries)} queries\n\n"
          "| | top-1 | ranking, ms |\n|---|---|---|")
    for title, hits, took in zip((rival.name, "Pliant"), right, times):
        print(f"| {title} | {hits / len(queries):.3f} | {statistics.median(took):.0f} |")


if __name__ == "__main__":
    main()
