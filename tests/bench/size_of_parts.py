#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Machines, memory, disk and searches a second for an index in parts (docker/PARTS.md), computed from measured costs.

    size_of_parts.py [--memory-gb 256] [--cores 32] [--copies 2]

The costs are those of docker/README.md (sizing) and of measure_parts.py. Waiting times are simulated: the steps of each part vary
as one server's rankings do, searches arrive at random while the machines are busy by half, and a part's second server is asked after
the 95th percentile.
"""

import argparse
import math
import random

import service

INDEX_BYTES = 10_200  # of an image, in memory or in the system's cache
DATABASE_BYTES = 27_200  # of an image, without its upload
OWN_GB = 1.5  # of a server: network, vocabulary, images that are described
CACHE_SHARE = 0.8  # of a machine's memory for the index
ASKING_S = 0.50  # processor time of the asking server: describing, words, verifying
PART_S = 0.010  # processor time of a ranking by a part: for any number of images,
PART_S_A_MILLION = 0.150  # and for each million in it (measure_parts.py: 42 ms for half a million and 512 keypoints; a photo has 1024)
QUERY_BYTES = 1024 * (128 * 4 + 4 + 8 * 8)  # of a search for each part: descriptors, weights, near words
SPREAD = 0.12  # of the logarithm of a ranking's time: 95 % lie below 1.2 times its median
HICCUP, HICCUP_S = 0.002, 0.2  # share of rankings that wait for something else, and for how long
SEARCHES = 20_000  # simulated


def busy(seconds, dice):
    """Waiting and working on a machine that is busy by half: an M/M/1 queue's time in the system, with the work as it varies."""
    work = seconds * math.exp(dice.gauss(0, SPREAD)) + (HICCUP_S if dice.random() < HICCUP else 0)
    return work + (dice.expovariate(1 / seconds) if dice.random() < 0.5 else 0)


def ranking_seconds(parts, copies, part_s, threads, dice):
    """Of each simulated search: the slowest part, with hedged requests."""
    step = part_s / threads
    alone = sorted(busy(step, dice) for _ in range(2000))
    hedge = alone[int(0.95 * len(alone))]
    times = []
    for _ in range(SEARCHES // parts + 200):
        slowest = 0
        for _ in range(parts):
            first = busy(step, dice)
            if copies > 1 and first > hedge:
                first = min(first, hedge + busy(step, dice))
            slowest = max(slowest, first)
        times.append(slowest)
    return times


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--memory-gb", type=float, default=256)
    parser.add_argument("--cores", type=int, default=32)
    parser.add_argument("--copies", type=int, default=2)
    options = parser.parse_args()
    dice = random.Random(1)
    print("| images | parts | machines | memory of a part, GB | database, TB | searches a second | ranking, ms | network of a search, MB |")
    print("|---|---|---|---|---|---|---|---|")
    for images in (1e6, 1e7, 1e8, 1e9):
        room = options.memory_gb * 1e9 * CACHE_SHARE - OWN_GB * 1e9
        parts = max(1, math.ceil(images * INDEX_BYTES / room))
        machines = parts * options.copies
        part_s = PART_S + PART_S_A_MILLION * images / parts / 1e6
        rate = machines * options.cores / (ASKING_S + parts * part_s)
        times = ranking_seconds(parts, options.copies, part_s, options.cores / 2, dice)
        ms = " / ".join(f"{1000 * service.percentile(times, share):.0f}" for share in (0.5, 0.95, 0.99))
        network = parts * QUERY_BYTES / 1e6 if parts > 1 else 0
        print(f"| {images:,.0f} | {parts} | {machines} | {images / parts * INDEX_BYTES / 1e9 + OWN_GB:.0f} | {images * DATABASE_BYTES / 1e12:.2f} "
              f"| {rate:.0f} | {ms} | {network:.0f} |".replace(",", " "))


if __name__ == "__main__":
    main()
