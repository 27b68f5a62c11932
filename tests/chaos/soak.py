#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Two servers on one database, many clients, imports and `pliant index` beside them, for as long as it takes to see what grows.

    tests/chaos/soak.py --bin build/release/bin --minutes 60 --clients 32 --images 50000

Clients search, add, replace, remove and read; what they add they remove again, and so do the imports, so that the collection stays as large
as it was. Prints, for each server, memory and open files with their slopes over the second two thirds of the time, how long searches take, and what was
asked. Fails when an answer is wrong, when memory or files grow beyond the limits below, or when the database is not sound at the end.
"""
import argparse
import http.client
import json
import pathlib
import random
import shutil
import subprocess
import sys
import tempfile
import threading
import time

from service.images import sha256, texture, write_folder
from service.server import Connection, Server, Wrong

IMAGES = "/v1/collections/default/images"
SEARCH = "/v1/collections/default/search?limit=5"
MOST_GROWTH = 1.1  # of the memory between its second and its last third
MOST_GROWTH_MB = 32  # beside that: a server of few images is small
MOST_MORE_FILES = 8
BUSY = {429, 503}


class Client(threading.Thread):
    """Asks at random until it is stopped; knows what it has added. `wrong` says what was answered wrongly."""

    def __init__(self, number, address, ids):
        super().__init__(daemon=True)
        self.number, self.connection = number, Connection(address)
        self.ids, self.names = ids, sorted(ids)
        self.random, self.mine, self.added = random.Random(number), {}, 0
        self.searches_s, self.asked, self.busy, self.wrong, self.stopped = [], 0, 0, [], False

    def run(self):
        try:
            while not self.stopped and not self.wrong:
                self.random.choices([self.search, self.search_absent, self.put, self.remove, self.read], [55, 5, 15, 15, 10])[0]()
        except (OSError, http.client.HTTPException, Wrong) as error:
            self.wrong.append(f"client {self.number}: {error!r}")

    def ask(self, method, path, body, expected):
        """The body, or None when the server is busy."""
        status, data = self.connection.ask(method, path, body)
        self.asked += 1
        if status in BUSY:
            self.busy += 1
            time.sleep(0.1)
            return None
        if status not in expected:
            self.wrong.append(f"client {self.number}: {method} {path} was answered {status} {data[:300]!r}")
            return None
        return data

    def search(self):
        name = self.random.choice(self.names)
        begin = time.monotonic()
        data = self.ask("POST", SEARCH, texture(name), {200})
        if data is None:
            return
        self.searches_s.append(time.monotonic() - begin)
        found = [hit["image_id"] for hit in json.loads(data)["hits"]]
        if self.ids[name] not in found[:1]:
            self.wrong.append(f"client {self.number}: a search for {name} found {found}")

    def search_absent(self):
        """Nothing is found, so the server looks closer: the dearest of searches."""
        self.ask("POST", SEARCH, texture(f"absent {self.random.random()}"), {200})

    def put(self):
        name = f"c{self.number}-{self.random.randrange(20)}"
        self.added += 1
        data = texture(f"{name} {self.added}")
        if self.ask("PUT", f"{IMAGES}/{name}?object={name}", data, {200, 201}) is not None:
            self.mine[name] = sha256(data)

    def remove(self):
        if self.mine:
            name = self.random.choice(sorted(self.mine))
            if self.ask("DELETE", f"{IMAGES}/{name}", None, {204}) is not None:
                del self.mine[name]

    def read(self):
        if self.mine:
            name = self.random.choice(sorted(self.mine))
            data = self.ask("GET", f"{IMAGES}/{name}/content", None, {200})
            if data is not None and sha256(data) != self.mine[name]:
                self.wrong.append(f"client {self.number}: {name} has other bytes than were added")


class Importer(threading.Thread):
    """Adds a folder again and again, by a job of one server and by `pliant index` in turns, and removes its objects through the other."""

    def __init__(self, binaries, describe, folder, database, addresses):
        super().__init__(daemon=True)
        self.binaries, self.describe, self.folder, self.database, self.addresses = binaries, describe, folder, database, addresses
        self.rounds, self.wrong, self.stopped = 0, [], False

    def run(self):
        try:
            while not self.stopped and not self.wrong:
                self.round()
                self.rounds += 1
        except (OSError, http.client.HTTPException, Wrong) as error:
            self.wrong.append(f"import {self.rounds}: {error!r}")

    def round(self):
        name = f"batch{self.rounds}"
        objects = set(write_folder(self.folder / name, name, 5, 4).values())
        adding, removing = (Connection(self.addresses[(self.rounds + i) % 2]) for i in range(2))
        if self.rounds % 2:
            self.index(name)
        else:
            self.import_by(adding, name)
        for each in objects:
            status, data = removing.ask("DELETE", f"/v1/collections/default/objects/{each}")
            if status not in (200, 204):
                self.wrong.append(f"object {each} of {name}: {status} {data[:300]!r}")
        for path in sorted((self.folder / name).rglob("*"), reverse=True):
            path.rmdir() if path.is_dir() else path.unlink()
        (self.folder / name).rmdir()
        adding.close()
        removing.close()

    def index(self, name):
        done = subprocess.run([self.binaries / "pliant", "index", self.folder / name, "--db", self.database, "--jobs", "1", *self.describe],
                              capture_output=True, text=True, check=False)
        if done.returncode != 0:
            self.wrong.append(f"pliant index: {done.returncode} {done.stderr}")

    def import_by(self, connection, name):
        status, job = connection.json("POST", "/v1/collections/default/imports", {"folder": name})
        while status == 202 and job["state"] in ("queued", "running"):
            time.sleep(0.2)
            job = connection.get(f"/v1/jobs/{job['id']}")
        if job.get("state") != "done" or job["failed"]:
            self.wrong.append(f"import of {name}: {status} {job}")


class Watch(threading.Thread):
    """Memory and open files of the servers, once a second."""

    def __init__(self, servers):
        super().__init__(daemon=True)
        self.servers, self.samples, self.stopped = servers, [[] for _ in servers], False

    def run(self):
        while not self.stopped:
            for server, samples in zip(self.servers, self.samples):
                process = pathlib.Path(f"/proc/{server.process.pid}")
                memory = int((process / "statm").read_text().split()[1]) * 4096 / 1e6
                samples.append((time.monotonic(), memory, len(list((process / "fd").iterdir()))))
            time.sleep(1)


def mean(values):
    return sum(values) / len(values)


def slope_per_hour(samples, column):
    """Least squares."""
    times, values = [s[0] for s in samples], [s[column] for s in samples]
    t, v = mean(times), mean(values)
    return 3600 * sum((a - t) * (b - v) for a, b in zip(times, values)) / max(1e-9, sum((a - t)**2 for a in times))


def judge_growth(number, samples):
    """What is wrong; prints the server's row."""
    third = len(samples) // 3
    middle, last = samples[third:2 * third], samples[2 * third:]
    memory, files = [mean([s[1] for s in part]) for part in (middle, last)], [max(s[2] for s in part) for part in (middle, last)]
    print(f"| server {number} | {memory[0]:.0f} | {memory[1]:.0f} | {slope_per_hour(samples[third:], 1):+.1f} | {files[0]} | {files[1]} | "
          f"{slope_per_hour(samples[third:], 2):+.1f} |")
    wrong = []
    if memory[1] > MOST_GROWTH * memory[0] + MOST_GROWTH_MB:
        wrong.append(f"server {number}: memory grew from {memory[0]:.0f} to {memory[1]:.0f} MB")
    if files[1] > files[0] + MOST_MORE_FILES:
        wrong.append(f"server {number}: open files grew from {files[0]} to {files[1]}")
    return wrong


def judge_end(clients, addresses):
    """Every image that was acknowledged is there, through either server."""
    wrong = []
    for client in clients:
        for address in addresses:
            connection = Connection(address)
            for name, expected in client.mine.items():
                status, data = connection.ask("GET", f"{IMAGES}/{name}/content")
                if status != 200 or sha256(data) != expected:
                    wrong.append(f"{name}: {status}, or other bytes than were added")
            connection.close()
    return wrong


def fill(options, folder, database):
    """Indexes the images that are searched for; their names."""
    begin = time.monotonic()
    names = [f"p{i}" for i in range(options.images)]
    if options.filled and options.filled.exists():
        shutil.copyfile(options.filled, database)
        return names
    shelf = folder / "images"
    shelf.mkdir()
    for name in names:
        (shelf / f"{name}.png").write_bytes(texture(name))
    made = time.monotonic()
    subprocess.run([options.bin / "pliant", "index", shelf, "--db", database, "--object-from", "stem", *options.describe], check=True,
                   stdout=subprocess.DEVNULL)
    print(f"{options.images} images indexed in {time.monotonic() - made:.0f} s (made in {made - begin:.0f} s)", flush=True)
    if options.filled:
        shutil.copyfile(database, options.filled)
    return names


def ids_of(address, names):
    """Images were given ids of their own: {name: id}."""
    connection, ids, cursor = Connection(address), {}, ""
    while cursor is not None:
        page = connection.get(f"{IMAGES}?limit=500" + (f"&cursor={cursor}" if cursor else ""))
        ids.update({image["object"]: image["id"] for image in page["images"]})
        cursor = page["next"]
    connection.close()
    missing = [name for name in names if name not in ids]
    if missing:
        raise Wrong(f"{len(missing)} images are not listed, {missing[:3]} among them")
    return ids


def live(options, clients, importer, watch):
    threads = [*clients, importer, watch]
    for thread in threads:
        thread.start()
    until = time.monotonic() + 60 * options.minutes
    while time.monotonic() < until and not any(thread.wrong for thread in [*clients, importer]):
        time.sleep(0.2)
    for thread in threads:
        thread.stopped = True
    for thread in threads:
        thread.join()


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n", maxsplit=1)[0])
    parser.add_argument("--bin", required=True, type=lambda text: pathlib.Path(text).resolve(), metavar="DIR")
    parser.add_argument("--minutes", type=float, default=60)
    parser.add_argument("--clients", type=int, default=32)
    parser.add_argument("--images", type=int, default=50_000, help="that are there and searched for")
    parser.add_argument("--filled", type=pathlib.Path, metavar="FILE", help="keeps the filled database, and begins with it the next time")
    parser.add_argument("--descriptor", default="rootsift", help="default: %(default)s, the fastest: what is tested is all else")
    options = parser.parse_args()
    options.describe = ["--descriptor", options.descriptor]
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        database, shelf = folder / "images.db", folder / "imports"
        shelf.mkdir()
        names = fill(options, folder, database)
        command = [options.bin / "pliant-server", "--db", database, "--listen", "127.0.0.1:0", "--import-dir", shelf, "--log-level", "warn", *options.describe]
        servers = [Server(command, folder / f"log{i}") for i in range(2)]
        for server in servers:
            server.wait_ready()
        addresses = [server.address for server in servers]
        ids = ids_of(addresses[0], names)
        clients = [Client(i, addresses[i % 2], ids) for i in range(options.clients)]
        importer, watch = Importer(options.bin, options.describe, shelf, database, addresses), Watch(servers)
        live(options, clients, importer, watch)
        wrong = [each for thread in [*clients, importer] for each in thread.wrong]
        searches = sorted(s for client in clients for s in client.searches_s) or [0.0]
        print(f"{sum(c.asked for c in clients)} requests, {sum(c.busy for c in clients)} of them told to wait, {importer.rounds} imports")
        print("searches: {}, median {:.0f} ms, 99 % within {:.0f} ms, longest {:.0f} ms".format(
            len(searches), *(1e3 * searches[min(len(searches) - 1, int(q * len(searches)))] for q in (0.5, 0.99, 1))))
        print("| | MB in the second third | MB in the last | MB an hour | files | files | files an hour |\n|---|---|---|---|---|---|---|")
        for number, samples in enumerate(watch.samples):
            wrong += judge_growth(number, samples)
        wrong += judge_end(clients, addresses)
        for server in servers:
            server.terminate()
            if (status := server.ended(120)) != 0:
                wrong.append(f"a server ended with {status}: {server.log.read_text()[-2000:]}")
        check = subprocess.run([options.bin / "pliant", "db", "check", "--db", database], capture_output=True, text=True, check=False)
        if check.stdout != "ok\n":
            wrong.append(f"db check: {check.stdout}{check.stderr}")
    print("\n".join(wrong[:20]) or "nothing wrong")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
