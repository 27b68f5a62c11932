#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""How long a search takes while nothing else happens, and while a folder is imported.

    search_during_import.py --bin build/release/bin --images DIR [--stored N] [--searches N]
                            [--descriptor NAME]

DIR holds images, with folders or without. The first N are indexed, the others are imported while
searches go on. Prints the median and the 95th percentile of both, and their ratio. Searches are
asked in turns (idle, then during the import), so compare the ratio, not the times, on a busy machine.
"""

import argparse
import json
import pathlib
import subprocess
import tempfile
import time

import service


def report(name, times):
    p50, p95 = service.percentile(times, 0.5), service.percentile(times, 0.95)
    print(f"{name:15} {len(times):4} searches  p50 {1000 * p50:7.0f} ms  p95 {1000 * p95:7.0f} ms")
    return p50, p95


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bin", type=pathlib.Path, required=True)
    parser.add_argument("--images", type=pathlib.Path, required=True)
    parser.add_argument("--stored", type=int, default=40)
    parser.add_argument("--imported", type=int, default=60)
    parser.add_argument("--searches", type=int, default=30)
    parser.add_argument("--descriptor", default="deal")
    options = parser.parse_args()
    images = service.images_below(parser, options.images, options.stored + options.imported)
    with tempfile.TemporaryDirectory() as name:
        measure(options, images, pathlib.Path(name))


def measure(options, images, folder):
    service.copy_numbered(images[: options.stored], folder / "stored")
    service.copy_numbered(images[options.stored : options.stored + options.imported],
                          folder / "new")
    subprocess.run([options.bin / "pliant", "index", folder / "stored", "--db", folder / "x.db",
                    "--descriptor", options.descriptor], check=True, stdout=subprocess.DEVNULL)
    queries = [p.read_bytes() for p in sorted((folder / "stored").iterdir())[:10]]
    with service.Server(options.bin, folder / "x.db", "--import-dir", folder / "new") as server:

        def search(number):
            start = time.monotonic()
            server.search(queries[number % len(queries)])
            return time.monotonic() - start

        search(0)  # warm
        idle = [search(i) for i in range(options.searches)]
        job = service.request(server.collection + "/imports", "POST",
                              json.dumps({"folder": "."}).encode(), "application/json")
        during = []
        started = time.monotonic()
        while True:
            state = service.request(f"{server.address}/v1/jobs/{job['id']}")
            if state["finished_at"]:
                break
            during.append(search(len(during)))
        seconds = time.monotonic() - started
    print(f"imported {state['done']:.0f} images ({state['state']}) in {seconds:.0f} s")
    idle_p50, idle_p95 = report("idle", idle)
    import_p50, import_p95 = report("during import", during)
    print(f"ratio: p50 {import_p50 / idle_p50:.2f}, p95 {import_p95 / idle_p95:.2f}")


if __name__ == "__main__":
    main()
