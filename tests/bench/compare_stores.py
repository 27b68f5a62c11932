#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""What a database on PostgreSQL costs beside one in a file, measured in one run on the same images.

    PLIANT_TEST_DATABASE_SLOW=1 bash tests/postgres/on_postgres.sh python3 tests/bench/compare_stores.py --bin build/release/bin --folder JPEGS

Indexes --folder in a file, fills it up to --images (load_database), copies it to PostgreSQL and back, and asks a server on each in turn: searches, uploads, and
how soon an upload is found by a second server on PostgreSQL. Prints medians and their differences.
"""
import argparse
import json
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

from service import Server, images_below, request


def timed(command):
    start = time.monotonic()
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"{command}: {done.returncode}\n{done.stdout}{done.stderr}")
    return time.monotonic() - start, done.stdout


def with_comment(jpeg, text):
    """The same image in other bytes."""
    comment = text.encode()
    return jpeg[:2] + b"\xff\xfe" + (len(comment) + 2).to_bytes(2, "big") + comment + jpeg[2:]


def milliseconds(work):
    start = time.monotonic()
    answer = work()
    return 1000 * (time.monotonic() - start), answer


def print_medians(what, by_store):
    file, postgres = (statistics.median(by_store[store]) for store in ("file", "PostgreSQL"))
    print(f"{what}: file {file:.1f} ms, PostgreSQL {postgres:.1f} ms, difference {postgres - file:+.1f} ms (medians of {len(by_store['file'])})")


def measure_service(options, file, url, jpegs):
    searches, uploads, seen = ({"file": [], "PostgreSQL": []} for _ in range(3))
    with Server(options.bin, file) as one, Server(options.bin, url) as two, Server(options.bin, url) as other:
        stores = {"file": one, "PostgreSQL": two}
        for server in (one, two, other):
            server.search(jpegs[0])  # loads what is loaded once
        for i in range(options.rounds):
            jpeg = jpegs[i % len(jpegs)]
            for name, server in stores.items():
                searches[name].append(milliseconds(lambda s=server: s.search(jpeg))[0])
            for name, server in stores.items():
                body = with_comment(jpeg, f"{name} {i}")
                took, _ = milliseconds(lambda s=server, b=body: request(f"{s.collection}/images/new-{i}", "PUT", b, "image/jpeg"))
                uploads[name].append(took)
            took, record = milliseconds(lambda: request(f"{other.collection}/images/new-{i}"))
            seen["PostgreSQL"].append(took)
            hits = other.search(jpeg)["hits"]
            if record["id"] != f"new-{i}" or not any(hit["image_id"] == f"new-{i}" for hit in hits):
                sys.exit(f"new-{i} is not found on the other server")
    print_medians("search", searches)
    print_medians("upload", uploads)
    print(f"an upload is found on another server, first try, {max(seen['PostgreSQL']):.1f} ms after its answer at most")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=pathlib.Path, required=True)
    parser.add_argument("--folder", type=pathlib.Path, required=True)
    parser.add_argument("--images", type=int, default=20000)
    parser.add_argument("--rounds", type=int, default=40)
    options = parser.parse_args()
    jpegs = [p.read_bytes() for p in images_below(parser, options.folder, 20) if p.suffix.lower() != ".png"]
    url = os.environ["PLIANT_TEST_DATABASE"]
    with tempfile.TemporaryDirectory() as home:
        file, back = f"{home}/file.db", f"{home}/back.db"
        timed([options.bin / "pliant", "index", options.folder, "--db", file])
        timed([options.bin / "load_database", "--db", file, "--images", str(options.images)])
        for source, target, what in ((file, url, "file to PostgreSQL"), (url, back, "PostgreSQL to file")):
            took, said = timed([options.bin / "pliant", "db", "copy", target, "--db", source, "--json", "--compare", "1"])
            result = json.loads(said)
            print(f"db copy, {what}: {result['copied']} images in {took:.0f} s with the comparison of {result['rankings_compared']} rankings, "
                  f"{result['copied'] / took:.0f}/s; differences: {result['differences']}", flush=True)
        measure_service(options, file, url, jpegs)


if __name__ == "__main__":
    main()
