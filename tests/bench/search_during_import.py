#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""How long a search takes while nothing else happens, and while a folder is imported.

    search_during_import.py --bin build/release/bin --pictures DIR [--stored N] [--searches N]
                            [--descriptor NAME]

DIR holds pictures, with folders or without. The first N are indexed, the others are imported while
searches go on. Prints the median and the 95th percentile of both, and their ratio. Searches are
asked in turns (idle, then during the import), so compare the ratio, not the times, on a busy machine.
"""

import argparse
import json
import pathlib
import re
import shutil
import subprocess
import tempfile
import time
import urllib.request


def request(address, method="GET", body=None, content_type=None):
    headers = {"Content-Type": content_type} if content_type else {}
    asked = urllib.request.Request(address, data=body, method=method, headers=headers)
    with urllib.request.urlopen(asked, timeout=600) as answer:
        return json.load(answer)


def percentile(times, share):
    ordered = sorted(times)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


def report(name, times):
    p50, p95 = percentile(times, 0.5), percentile(times, 0.95)
    print(f"{name:15} {len(times):4} searches  p50 {1000 * p50:7.0f} ms  p95 {1000 * p95:7.0f} ms")
    return p50, p95


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bin", type=pathlib.Path, required=True)
    parser.add_argument("--pictures", type=pathlib.Path, required=True)
    parser.add_argument("--stored", type=int, default=40)
    parser.add_argument("--imported", type=int, default=60)
    parser.add_argument("--searches", type=int, default=30)
    parser.add_argument("--descriptor", default="deal")
    options = parser.parse_args()
    kinds = {".jpg", ".jpeg", ".png"}
    pictures = sorted(p for p in options.pictures.rglob("*") if p.suffix.lower() in kinds)
    wanted = options.stored + options.imported
    if len(pictures) < wanted:
        parser.error(f"{options.pictures} has {len(pictures)} pictures, {wanted} are wanted")
    with tempfile.TemporaryDirectory() as name:
        measure(options, pictures, pathlib.Path(name))


def measure(options, pictures, folder):
    for part, chosen in (("stored", pictures[: options.stored]),
                         ("new", pictures[options.stored : options.stored + options.imported])):
        (folder / part).mkdir()
        for i, picture in enumerate(chosen):
            shutil.copy(picture, folder / part / f"{i}{picture.suffix.lower()}")
    subprocess.run([options.bin / "pliant", "index", folder / "stored", "--db", folder / "x.db",
                    "--descriptor", options.descriptor], check=True, stdout=subprocess.DEVNULL)
    server = subprocess.Popen([options.bin / "pliant-server", "--db", folder / "x.db", "--listen",
                               "127.0.0.1:0", "--import-dir", folder / "new", "--auto-train",
                               "false", "--log-level", "warn"], stdout=subprocess.PIPE, text=True)
    try:
        address = re.search(r"http://\S+", server.stdout.readline()).group()
        collection = address + "/v1/collections/default"
        queries = [p.read_bytes() for p in sorted((folder / "stored").iterdir())[:10]]

        def search(number):
            start = time.monotonic()
            request(collection + "/search", "POST", queries[number % len(queries)],
                    "application/octet-stream")
            return time.monotonic() - start

        search(0)  # warm
        idle = [search(i) for i in range(options.searches)]
        job = request(collection + "/imports", "POST", json.dumps({"folder": "."}).encode(),
                      "application/json")
        during = []
        started = time.monotonic()
        while True:
            state = request(f"{address}/v1/jobs/{job['id']}")
            if state["finished_at"]:
                break
            during.append(search(len(during)))
        seconds = time.monotonic() - started
        print(f"imported {state['done']:.0f} pictures ({state['state']}) in {seconds:.0f} s")
        idle_p50, idle_p95 = report("idle", idle)
        import_p50, import_p95 = report("during import", during)
        print(f"ratio: p50 {import_p50 / idle_p50:.2f}, p95 {import_p95 / idle_p95:.2f}")
    finally:
        server.terminate()
        server.wait()


if __name__ == "__main__":
    main()
