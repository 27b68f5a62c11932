#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""What a collection costs in service: one row of the table of sizes in docker/README.md.

    load_database --db big.db --images 100000
    measure_collection.py --bin build/release/bin --db big.db --queries PHOTOS [--train] [--backup DIR]

Starts pliant-server on the database three times: without index files, with them, and with them but not in the machine's memory.
Then it searches with 1 and with 8 clients, uploads and removes images while 2 clients search, and runs `pliant db check`, a backup
(into DIR) and a training of as many words as there are, followed by the switch to them (--train).
Times are wall times: nothing else should run. `ranking` is the server's own figure, timings.rank_ms.
"""

import argparse
import concurrent.futures
import json
import os
import pathlib
import re
import shutil
import subprocess
import time
import urllib.error
import urllib.request

import service


SAVED_FROM = 256  # images; smaller indexes are not saved


def percentiles(values):
    return "/".join(f"{service.percentile(values, share):.0f}" for share in (0.5, 0.95, 0.99))


def bytes_of(path):
    if path.is_dir():
        return sum(file.stat().st_size for file in path.iterdir())
    return path.stat().st_size if path.exists() else 0


def drop_from_memory(paths):
    for path in paths:
        with open(path, "rb") as file:
            os.fsync(file.fileno())
            os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)


def started(options):
    """A server, and the seconds until it was ready. It prints its address when it is."""
    begin = time.monotonic()
    server = service.Server(options.bin, options.db)
    return server, time.monotonic() - begin


def memory_of(server):
    """What the process alone has, and what it has of files, in GB."""
    status = pathlib.Path(f"/proc/{server.process.pid}/status").read_text()
    return tuple(int(re.search(rf"Rss{kind}:\s+(\d+)", status).group(1)) / 1e6 for kind in ("Anon", "File"))


def processor_seconds(server):
    ticks = pathlib.Path(f"/proc/{server.process.pid}/stat").read_text().rpartition(")")[2].split()[11:13]
    return sum(map(int, ticks)) / os.sysconf("SC_CLK_TCK")


def search(server, image):
    begin = time.monotonic()
    answer = server.search(image)
    return 1000 * (time.monotonic() - begin), answer["timings"]["rank_ms"]


def measure_searches(server, queries, clients, report):
    before = processor_seconds(server)
    with concurrent.futures.ThreadPoolExecutor(clients) as pool:
        begin = time.monotonic()
        answers = list(pool.map(lambda image: search(server, image), queries))
        seconds = time.monotonic() - begin
    used = (processor_seconds(server) - before) / len(queries)
    report(f"{clients} clients", f"search {percentiles([took for took, _ in answers])} ms, ranking "
           f"{percentiles([rank for _, rank in answers])} ms (median/95 %/99 %), {used:.3f} processor seconds, "
           f"{len(queries) / seconds:.1f} a second")
    return used


def measure_changes(server, queries, report):
    """Images that differ from the stored ones in a byte behind the end of the file's data."""
    address = server.collection + "/images/added-"
    adding, removing = [], []
    running = True

    def load(number):
        while running:
            search(server, queries[number])

    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        clients = [pool.submit(load, number) for number in range(2)]
        for i, image in enumerate(queries[:30]):
            begin = time.monotonic()
            service.request(f"{address}{i}", "PUT", image + bytes([i]), "image/jpeg")
            adding.append(1000 * (time.monotonic() - begin))
        for i in range(len(queries[:30])):
            begin = time.monotonic()
            urllib.request.urlopen(urllib.request.Request(f"{address}{i}", method="DELETE"), timeout=600).close()
            removing.append(1000 * (time.monotonic() - begin))
        running = False
        for client in clients:
            client.result()
    report("changes while 2 search", f"adding {percentiles(adding)} ms, removing {percentiles(removing)} ms")


def timed(command, report, name):
    begin = time.monotonic()
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    report(name, f"{time.monotonic() - begin:.0f} s" if done.returncode == 0 else done.stderr.strip()[-300:])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=pathlib.Path, required=True)
    parser.add_argument("--db", type=pathlib.Path, required=True)
    parser.add_argument("--queries", type=pathlib.Path, required=True)
    parser.add_argument("--searches", type=int, default=200)
    parser.add_argument("--train", action="store_true")
    parser.add_argument("--backup", type=pathlib.Path)
    options = parser.parse_args()
    photos = [p for p in service.images_below(parser, options.queries, 40) if p.suffix.lower() != ".png"]
    step = max(1, len(photos) // options.searches)
    queries = [p.read_bytes() for p in photos[::step][: options.searches]]
    index = pathlib.Path(str(options.db) + ".index")

    def report(name, text):
        print(f"{name:24} {text}", flush=True)

    shutil.rmtree(index, ignore_errors=True)
    server, seconds = started(options)
    with server:
        report("images", json.load(urllib.request.urlopen(server.collection))["images"])
        report("start without files", f"{seconds:.1f} s")
        begin = time.monotonic()
        while json.load(urllib.request.urlopen(server.collection))["images"] >= SAVED_FROM and not list(index.glob("*.json")):
            time.sleep(0.1)
        report("saving the index", f"{time.monotonic() - begin:.1f} s")
    report("database, index", f"{bytes_of(options.db) / 1e9:.2f} GB, {bytes_of(index) / 1e9:.2f} GB")
    server, seconds = started(options)
    with server:
        report("start", f"{seconds:.1f} s")
    drop_from_memory([options.db, *index.glob("*")])
    server, seconds = started(options)
    with server:
        report("start, nothing in memory", f"{seconds:.1f} s")
        measure_searches(server, queries[:40], 1, lambda *_: None)
        one = measure_searches(server, queries, 1, report)
        eight = measure_searches(server, queries, 8, report)
        report("processor time, 8 to 1", f"{eight / one:.2f}")
        anonymous, files = memory_of(server)
        report("memory", f"{anonymous:.2f} GB, and {files:.2f} GB of files")
        measure_changes(server, queries, report)
    pliant = options.bin / "pliant"
    timed([pliant, "db", "check", "--db", options.db], report, "db check")
    if options.backup:
        copy = options.backup / "copy.db"
        timed([pliant, "db", "backup", copy, "--db", options.db], report, "backup")
        copy.unlink(missing_ok=True)
    if options.train:
        words = json.loads(subprocess.run([pliant, "vocab", "list", "--db", options.db, "--json"], check=True,
                                          stdout=subprocess.PIPE).stdout)["vocabularies"][-1]["words"]
        timed([pliant, "vocab", "train", "--db", options.db, "--words", str(words), "--use"], report, "vocabulary and switch")


if __name__ == "__main__":
    main()
