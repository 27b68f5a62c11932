#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""What an image costs: disk, memory and processor time, measured on images of your own.

    size_of_service.py --bin build/release/bin --images DIR [--count N] [--descriptor NAME]

Indexes N images with their originals in a directory of their own, starts a server on them, and
searches. Times are processor seconds, not wall time, so that a busy machine changes them little;
divide by the cores that are free. The last lines are a table of larger collections, in proportion.
measure_collection.py measures these.
"""

import argparse
import contextlib
import json
import pathlib
import re
import resource
import sqlite3
import subprocess
import tempfile
import urllib.request

import service

INDEX_BYTES = 20  # of a keypoint in memory: code 16, bias 2, image 2


def cpu_of_children():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def bytes_below(folder):
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


def vocabulary_bytes(database):
    """What does not grow with the images."""
    with contextlib.closing(sqlite3.connect(database)) as file:
        return file.execute("SELECT coalesce(sum(length(data)), 0) FROM vocabulary_words").fetchone()[0]


def metric(address, name):
    with urllib.request.urlopen(address + "/metrics", timeout=60) as answer:
        text = answer.read().decode()
    return float(re.search(rf"^{name} (\S+)$", text, re.MULTILINE).group(1))


def measure(options, chosen, folder):
    service.copy_numbered(chosen, folder / "new")
    database, originals = folder / "x.db", folder / "originals"
    before = cpu_of_children()
    index = subprocess.run(
        [options.bin / "pliant", "index", folder / "new", "--db", database, "--originals-dir",
         originals, "--descriptor", options.descriptor, "--json"], stdout=subprocess.PIPE)
    if index.returncode not in (0, 3):  # 3: some images were skipped
        raise SystemExit(index.returncode)
    count = json.loads(index.stdout)["indexed"]
    facts = {"images": count, "index_cpu_s": (cpu_of_children() - before) / count}
    facts["index_mb"] = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1e3
    facts["database_bytes"] = (database.stat().st_size - vocabulary_bytes(database)) / count
    facts["original_bytes"] = bytes_below(originals) / count
    facts["keypoints"] = json.loads(subprocess.run(
        [options.bin / "pliant", "db", "stats", "--db", database, "--json"], check=True,
        stdout=subprocess.PIPE).stdout)["descriptors"] / count
    with service.Server(options.bin, database, "--descriptor", options.descriptor) as server:
        facts["empty_mb"] = metric(server.address, "process_resident_memory_bytes") / 1e6
        start = metric(server.address, "process_cpu_seconds_total")
        for image in sorted((folder / "new").iterdir())[: options.searches]:
            server.search(image.read_bytes())
        used = metric(server.address, "process_cpu_seconds_total") - start
        facts["search_cpu_s"] = used / options.searches
        facts["busy_mb"] = metric(server.address, "process_resident_memory_bytes") / 1e6
    return facts


def report(facts):
    print(f"{facts['images']} images with {facts['keypoints']:.0f} keypoints on average")
    print(f"  database   {facts['database_bytes'] / 1e3:8.1f} kB an image")
    print(f"  originals  {facts['original_bytes'] / 1e3:8.1f} kB an image")
    print(f"  indexing   {facts['index_cpu_s']:8.2f} processor seconds an image, "
          f"{facts['index_mb']:.0f} MB at most")
    print(f"  a search   {facts['search_cpu_s']:8.2f} processor seconds")
    print(f"  server     {facts['empty_mb']:8.0f} MB after the start, {facts['busy_mb']:.0f} MB "
          "after searches")
    print("\n| images | memory | database | originals | indexing, processor hours |")
    print("| ---: | ---: | ---: | ---: | ---: |")
    for images in (1000, 10_000, 100_000, 1_000_000):
        memory = facts["busy_mb"] / 1e3 + images * facts["keypoints"] * INDEX_BYTES / 1e9
        print(f"| {images:,} | {memory:.1f} GB | {images * facts['database_bytes'] / 1e9:.1f} GB "
              f"| {images * facts['original_bytes'] / 1e9:.1f} GB "
              f"| {images * facts['index_cpu_s'] / 3600:.1f} |".replace(",", " "))


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=pathlib.Path, required=True)
    parser.add_argument("--images", type=pathlib.Path, required=True)
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--searches", type=int, default=10)
    parser.add_argument("--descriptor", default="deal")
    options = parser.parse_args()
    images = service.images_below(parser, options.images, options.count)
    step = len(images) / options.count  # from all of them
    chosen = [images[int(i * step)] for i in range(options.count)]
    with tempfile.TemporaryDirectory() as name:
        report(measure(options, chosen, pathlib.Path(name)))


if __name__ == "__main__":
    main()
