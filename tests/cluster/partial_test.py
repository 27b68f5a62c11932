#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""A shard whose replicas have all ended, or hang: searches with partial=true go on with the other one, say so, and show
nothing that was deleted; without it they are refused. Metrics by shard come within a bounded time.

    tests/cluster/on_cluster.sh tests/cluster/partial_test.py --bin build/release/bin
"""
import contextlib
import hashlib
import json
import os
import pathlib
import re
import signal
import sys
import tempfile
import time
import urllib.parse

from servers_test import run_case  # first: it says where the others are
from model_client import IMAGES
from service.pictures import texture
from service.server import Connection, Wrong
from troubles import KEPT, local

SEARCH = "/v1/collections/default/search?group_by=image&limit=50"
SHARDS = (("s1r1", "s1r2"), ("s2r1", "s2r2"))
METRICS_WITHIN_S = 3  # on a machine that does other things too


def shard_of(picture, collection=1):
    return hashlib.sha256(f"{collection}/{picture}".encode()).digest()[0] % len(SHARDS)


def require(holds, what):
    if not holds:
        raise Wrong(what)


class Partial:
    def __init__(self, test):
        self.test = test
        self.deleted = [f"gone-{i}" for i in range(8)]

    def ask(self, method, path, body=None, kind="application/json", server=0):
        connection = Connection(self.test.servers[server].address, keep_alive=False)
        try:
            return connection.ask(method, path, body, kind)
        finally:
            connection.close()

    def change(self, method, path, body=None, server=0):
        """Again after 503, as clients do: a replica that was killed and started again is taken for active until its session
        with the Keeper ends, and a write that waits for it then has an unknown outcome."""
        until, tries = time.monotonic() + 60, 0
        while True:
            status, data = self.ask(method, path, body, "image/png", server)
            tries += 1
            if status in (200, 201, 204) or (status == 404 and method == "DELETE" and tries > 1):
                return
            require(status == 503 and time.monotonic() < until, f"{method} {path}: {status} {data}")
            time.sleep(0.5)

    def search(self, picture, more="", server=0):
        status, data = self.ask("POST", SEARCH + more, texture(picture), "image/png", server)
        return status, json.loads(data)

    def signal(self, shard, number):
        for name in SHARDS[shard]:
            with contextlib.suppress(ProcessLookupError):
                os.kill(int((self.test.home / name / "pid").read_text(encoding="ascii")), number)

    def metrics(self):
        begun = time.monotonic()
        status, data = self.ask("GET", "/metrics")
        took = time.monotonic() - begun
        require(status == 200, f"/metrics: {status}")
        require(took < METRICS_WITHIN_S, f"/metrics took {took:.1f} s")
        return {(name, int(shard)): float(value) for name, shard, value in
                re.findall(r'^pliant_shard_(\w+)\{shard="(\d+)"\} (\S+)$', data.decode(), re.MULTILINE)}

    def await_metrics(self, shard, answering):
        until = time.monotonic() + 60
        while (figures := self.metrics())[("replicas_answering", shard + 1)] != answering:
            require(time.monotonic() < until, f"metrics of shard {shard + 1}: {figures}")
            time.sleep(0.5)
        return figures

    def all_is_there(self):
        """The whole answer, whether partial ones are asked for or not."""
        status, whole = self.search("kept 1")
        require(status == 200 and "coverage" not in whole, f"without partial: {status} {whole}")
        status, answer = self.search("kept 1", "&partial=true")
        expected = {"complete": True, "shards": 2, "answered": 2, "pictures": KEPT, "total_pictures": KEPT}
        require(status == 200 and answer["coverage"] == expected, f"all answer: {status} {answer['coverage']}")
        require([hit["image_id"] for hit in answer["hits"]] == [hit["image_id"] for hit in whole["hits"]], "other hits")
        counts = [(name, shard) for name in ("replicas", "replicas_answering", "replicas_active") for shard in (1, 2)]
        until = time.monotonic() + 60  # for the Keeper to see those that were gone
        while any((figures := self.metrics()).get(count) != 2 for count in counts):
            require(time.monotonic() < until, f"not all are at work: {figures}")
            time.sleep(0.5)
        for shard in (1, 2):
            for name in ("rows", "bytes", "parts"):
                require(figures[(name, shard)] > 0, f"{name} of shard {shard}: {figures}")
            require(("lag_seconds", shard) in figures and ("queue_length", shard) in figures, f"lacks: {figures}")

    def delete_elsewhere(self):
        """At the second server, so that the first one may not have seen it."""
        for picture in self.deleted:
            self.change("PUT", f"{IMAGES}/{picture}?object=gone", texture(picture))
        status, answer = self.search(self.deleted[0])
        require(answer["hits"][0]["image_id"] == self.deleted[0], f"not found: {answer}")
        for picture in self.deleted:
            self.change("DELETE", f"{IMAGES}/{picture}", server=1)

    def check_part(self, gone, first_within_s=None):
        """Every search while shard `gone` is."""
        here = sorted(f"kept-{i}" for i in range(KEPT) if shard_of(f"kept-{i}") != gone)
        begun = time.monotonic()
        status, answer = self.search("kept 1", "&partial=true")
        took = time.monotonic() - begun
        require(status == 200, f"the first partial search: {status} {answer}")
        print(f"shard {gone + 1} gone: the first partial search took {took:.1f} s")
        require(first_within_s is None or took < first_within_s, f"the first partial search took {took:.1f} s")
        for server in range(len(self.test.servers)):
            for i in range(KEPT):
                status, answer = self.search(f"kept {i}", "&partial=true", server)
                coverage = answer.get("coverage")
                require(status == 200, f"partial: {status} {answer}")
                require(coverage == {"complete": False, "shards": 2, "answered": 1, "pictures": len(here),
                                     "total_pictures": coverage["total_pictures"]}, f"coverage: {coverage}")
                found = [hit["image_id"] for hit in answer["hits"]]
                require(set(found) <= set(here), f"hits of the shard that is gone, or deleted: {found}")
                require(f"kept-{i}" in found[:1] or f"kept-{i}" not in here, f"kept-{i} is not found: {found}")
            for picture in self.deleted:
                _, answer = self.search(picture, "&partial=true", server)
                require(not set(self.deleted) & {hit["image_id"] for hit in answer["hits"]}, f"{picture} is deleted: {answer}")
        for more in ("", "&partial=false"):
            status, answer = self.search("kept 1", more)
            require(status == 503 and answer["code"] == "shard_unavailable", f"{more}: {status} {answer}")
        self.check_stored(gone, here)

    def check_stored(self, gone, here):
        """Searches with stored pictures, filters, batches."""
        there = next(f"kept-{i}" for i in range(KEPT) if shard_of(f"kept-{i}") == gone)
        document = {"image_id": here[0], "exclude_self": False, "partial": True}
        status, data = self.ask("POST", SEARCH, json.dumps(document))
        require(status == 200 and json.loads(data)["hits"][0]["image_id"] == here[0], f"image_id: {status} {data}")
        document["image_id"] = there
        status, data = self.ask("POST", SEARCH, json.dumps(document))
        require(status == 503, f"image_id of the shard that is gone: {status} {data}")
        status, data = self.ask("POST", SEARCH, json.dumps({"image_ids": here[:2], "partial": True}))
        require(status == 200 and not json.loads(data)["coverage"]["complete"], f"image_ids: {status} {data}")
        passes = urllib.parse.quote(json.dumps({"nothing": 1}))
        status, answer = self.search("kept 1", f"&partial=true&object=kept&filter={passes}")
        require(status == 200 and answer["hits"] == [], f"filter: {status} {answer}")
        searches = [{"image_id": here[0], "partial": True}, {"image_id": here[0]}]
        status, data = self.ask("POST", "/v1/collections/default/search:batch", json.dumps({"searches": searches}))
        require(status == 207 and [one["status"] for one in json.loads(data)["results"]] == [200, 503], f"batch: {status} {data}")

    def check_program(self, gone, status):
        with tempfile.TemporaryDirectory() as folder:
            picture = pathlib.Path(folder) / "a.png"
            picture.write_bytes(texture("kept 1"))
            done = self.test.pliant("query", str(picture), "--partial", "--json")
            require(done.returncode == status, f"query --partial: {done.returncode} {done.stdout}{done.stderr}")
            if status == 0:
                coverage = json.loads(done.stdout)["coverage"]
                require((coverage["answered"], coverage["total_pictures"]) == (1 if gone else 2, None if gone else KEPT), coverage)
            if gone:
                done = self.test.pliant("query", str(picture), "--json")
                require(done.returncode == 1, f"query: {done.returncode} {done.stdout}")

    def come_back(self):
        local("up", self.test.home)
        until = time.monotonic() + 60
        while True:
            status, answer = self.search("kept 1", "&partial=true")
            if status == 200 and answer["coverage"]["complete"]:
                break
            require(time.monotonic() < until, f"not whole again: {status} {answer}")
            time.sleep(0.5)
        self.test.settle()
        self.change("DELETE", f"{IMAGES}/last")

    def run(self):
        self.check_program(gone=0, status=0)
        self.all_is_there()
        for gone in (1, 0):
            self.delete_elsewhere()
            self.signal(gone, signal.SIGKILL)
            self.check_part(gone, first_within_s=10)
            figures = self.await_metrics(gone, 0)
            require(("rows", gone + 1) not in figures and figures[("rows", 2 - gone)] > 0, f"{figures}")
            # A program that begins now lacks what the first shard has: the list of collections, for example.
            self.check_program(gone=1, status=0 if gone == 1 else 1)
            self.come_back()
            self.all_is_there()
        self.delete_elsewhere()
        self.signal(1, signal.SIGSTOP)
        try:
            self.await_metrics(1, 0)
            self.check_part(1)
        finally:
            self.signal(1, signal.SIGCONT)
        self.come_back()
        self.all_is_there()


if __name__ == "__main__":
    sys.exit(run_case(__doc__, 2, lambda test: Partial(test).run()))
