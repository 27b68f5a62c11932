#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""What an index in parts costs, and whether it ranks as one index (docker/PARTS.md).

    measure_parts.py --bin build/release/bin --db postgresql://pliant@db1/pliant --work /var/tmp/parts [--parts 2] [--searches 200]

Starts one server with the whole index, then one for each part and another that asks them, each twice: without index files and
with them. Searches by stored images, so nothing is described. All hits must be the same, with the same scores.
Times are wall times, and `processor` is the time of one process; nothing else should run.
"""

import argparse
import json
import pathlib
import re
import statistics
import time
import urllib.request

import service
from measure_collection import processor_seconds


def ask(server, image, **parameters):
    body = {"image_id": image, "group_by": "image", "limit": 1000, "exclude_self": False, **parameters}
    return service.request(server.collection + "/search", "POST", json.dumps(body).encode(), "application/json")


def start(options, names, flags, saved=lambda name: True):
    """As on machines of their own: one after the other, when the one before has saved its files. And the most seconds until one was ready."""
    servers, longest = {}, 0
    for name in names:
        begin = time.monotonic()
        servers[name] = service.Server(options.bin, options.db, *flags(name))
        longest = max(longest, time.monotonic() - begin)
        while not saved(name):
            time.sleep(0.2)
    return servers, longest


def stop(servers):
    for server in servers.values():
        server.__exit__()


def mean_seconds(server, histogram, label):
    with urllib.request.urlopen(server.address + "/metrics", timeout=60) as answer:
        text = answer.read().decode()
    total, count = (float(re.search(rf'{histogram}_{what}{{{label}}} (\S+)', text).group(1)) for what in ("sum", "count"))
    return total / count


def searches(server, images, **parameters):
    answers = [ask(server, image, **parameters) for image in images]
    return answers, statistics.median(answer["timings"]["rank_ms"] for answer in answers)


def measured(servers, asks, images):
    """Answers, the median of the ranking in ms, and processor seconds a search of each process."""
    searches(asks, images[:20], verify="none")
    before = {name: processor_seconds(server) for name, server in servers.items()}
    answers, rank_ms = searches(asks, images, verify="none")
    return answers, rank_ms, {name: (processor_seconds(server) - before[name]) / len(images) for name, server in servers.items()}


def hits(answer):
    return answer["total"], [(hit["image_id"], hit["score"]) for hit in answer["hits"]]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=pathlib.Path, required=True)
    parser.add_argument("--db", required=True)
    parser.add_argument("--work", type=pathlib.Path, required=True, help="folder for index files")
    parser.add_argument("--parts", type=int, default=2)
    parser.add_argument("--searches", type=int, default=200)
    options = parser.parse_args()

    def report(name, text):
        print(f"{name:30} {text}", flush=True)

    def folder(name):
        path = options.work / name
        path.mkdir(parents=True, exist_ok=True)
        return path

    def flags_of_whole(name):
        return ["--index-dir", folder(name)]

    peers = options.work / "peers.toml"

    def flags_of_part(name):
        part = 1 if name == "asks" else int(name)
        return ["--part", f"{part}/{options.parts}", "--peers", peers, "--index-dir", folder(str(part))]

    def start_twice(names, flags, say):
        servers, seconds = start(options, names, flags, lambda name: list(folder(name).glob("*/*.json")))  # written last
        report(f"start of {say}, without files", f"{seconds:.1f} s")
        stop(servers)
        servers, seconds = start(options, names, flags)
        report(f"start of {say}, with files", f"{seconds:.1f} s")
        return servers

    servers = start_twice(["whole"], flags_of_whole, "the whole")
    whole = servers["whole"]
    listed = service.request(whole.collection + f"/images?limit={options.searches}")
    images = [image["id"] for image in listed["images"]]
    report("images", json.load(urllib.request.urlopen(whole.collection))["images"])
    expected, rank_ms, processor = measured(servers, whole, images)
    one = processor["whole"]
    report("whole: ranking, processor", f"{rank_ms:.1f} ms, {1000 * one:.1f} ms")
    for when in "for the first time", "again":  # from the disk, if the database is larger than the memory
        candidates, _ = searches(whole, images[:50], verify="tps", verify_depth=30, limit=10)
        milliseconds = statistics.median(answer["timings"]["database_ms"] for answer in candidates)
        report(f"30 candidates, {when}", f"{milliseconds:.1f} ms")
    stop(servers)

    numbers = [str(part) for part in range(1, options.parts + 1)]
    head = "timeout_ms = 60000\n[parts]\n"  # the first searches read the files
    peers.write_text(head + "".join(f'{number} = ["http://127.0.0.1:1"]\n' for number in numbers), encoding="ascii")
    servers = start_twice(numbers, flags_of_part, "all parts")
    peers.write_text(head + "".join(f'{number} = ["{servers[number].address}"]\n' for number in numbers), encoding="ascii")
    servers.update(start(options, ["asks"], flags_of_part)[0])
    answers, rank_ms, processor = measured(servers, servers["asks"], images)
    own = [mean_seconds(servers[number], "pliant_http_request_seconds", 'route="peer.rank"') for number in numbers]
    asked = [mean_seconds(servers["asks"], "pliant_part_seconds", f'part="{number}"') for number in numbers]
    report("parts: ranking", f"{rank_ms:.1f} ms, of which two steps of the slowest part {2000 * max(own):.1f} ms")
    report("sending and receiving", f"{max(2000 * (a - b) for a, b in zip(asked, own, strict=True)):.1f} ms in both steps")
    for name, seconds in processor.items():
        report(f"processor of {name}", f"{1000 * seconds:.1f} ms, {seconds / one:.2f} of the whole")
    same = sum(hits(a) == hits(b) for a, b in zip(expected, answers, strict=True))
    report("the same answers", f"{same} of {len(images)}")
    stop(servers)
    if same != len(images):
        raise SystemExit(1)


if __name__ == "__main__":
    main()
