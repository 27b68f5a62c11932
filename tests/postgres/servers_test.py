#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Several servers on one cluster, while processes of all kinds are killed with SIGKILL at random moments.

    PLIANT_TEST_SMALL_DISK=s1r2 tests/cluster/on_cluster.sh tests/cluster/servers_test.py --bin build/release/bin [--seconds 600] [--servers 4]

Clients put, replace, delete, look and search, each time at another server. A model of what was acknowledged decides:
every look and every search that begins afterwards, at any server, must agree with it. What had no answer, or another one
than 2xx, may have happened, also later, until the next acknowledged change of the same picture. In between the Keeper is
gone for a while, and, with PLIANT_TEST_SMALL_DISK, a node's disk is full. At the end nothing may be lost or back, and the
replicas must be equal.
"""
import argparse
import contextlib
import http.client
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "chaos"))
from model_client import IMAGES, Book, Client  # noqa: E402  (needs the path above)
from service.pictures import texture  # noqa: E402
from service.server import Connection, Server, Wrong  # noqa: E402
from troubles import KEPT, SETTLE_S, Troubles, local, most_parts  # noqa: E402

MOST_PARTS = 150


class Test:
    def __init__(self, options):
        self.options, self.book = options, Book()
        self.url = os.environ["PLIANT_TEST_CLUSTER"]
        self.home = pathlib.Path(os.environ["PLIANT_TEST_CLUSTER_HOME"])
        self.logs = pathlib.Path(tempfile.mkdtemp(prefix="pliant-servers-"))

    def pliant(self, *command):
        return subprocess.run([self.options.bin / "pliant", *command, "--db", self.url], capture_output=True, text=True, check=False, timeout=600)

    def start(self, number):
        """Starts again where a node or the Keeper is not back yet."""
        until = time.monotonic() + SETTLE_S
        while True:
            server = Server([self.options.bin / "pliant-server", "--db", self.url, "--descriptor", "rootsift", "--listen", "127.0.0.1:0",
                             "--auto-train", "false"], self.logs / f"server-{number}.log")
            try:
                server.wait_ready()
                return server
            except Wrong:
                server.kill()
                if time.monotonic() > until:
                    raise
                time.sleep(0.5)

    def ask(self, method, path, body=None, kind="application/json"):
        connection = Connection(self.servers[0].address, keep_alive=False)
        try:
            status, data = connection.ask(method, path, body, kind)
        finally:
            connection.close()
        if status >= 400:
            raise Wrong(f"{method} {path}: {status} {data[:300]}")
        return json.loads(data) if data else {}

    def prepare(self):
        done = self.pliant("cluster", "init")
        if done.returncode != 0:
            raise Wrong(f"cluster init: {done.stdout}{done.stderr}")
        self.servers = [self.start(i) for i in range(self.options.servers)]
        for i in range(KEPT):
            self.ask("PUT", f"{IMAGES}/kept-{i}?object=kept", texture(f"kept {i}"), "image/png")
        job = self.ask("POST", "/v1/collections/default/vocabularies", b'{"words": 200}')
        while self.ask("GET", f"/v1/jobs/{job['id']}")["state"] not in ("done", "failed"):
            time.sleep(0.2)

    def run(self):
        clients = [Client(i, self.servers, self.book, f"{self.options.seed} {i}") for i in range(self.options.clients)]
        troubles = Troubles(self)
        for thread in (*clients, troubles):
            thread.start()
        end = time.monotonic() + self.options.seconds
        while (time.monotonic() < end or troubles.waiting) and troubles.is_alive() and not self.book.wrong:
            time.sleep(0.5)
        troubles.stopped = True
        troubles.join(4 * SETTLE_S)
        for client in clients:
            client.stopped = True
        for client in clients:
            client.join(SETTLE_S)
        local("up", self.home)
        return clients

    def settle(self):
        """Until every server answers again, and can write."""
        until = time.monotonic() + SETTLE_S
        while True:
            with contextlib.suppress(OSError, http.client.HTTPException, Wrong):
                self.ask("PUT", f"{IMAGES}/last?object=last", texture("last"), "image/png")
                if all(Connection(server.address, False).ask("GET", "/readyz")[0] == 200 for server in self.servers):
                    return
            if time.monotonic() > until:
                raise Wrong("the cluster does not come back")
            time.sleep(1)

    def verify(self, clients):
        for server in self.servers:
            for client in clients:
                client.servers = [server]
                for picture in client.pictures:
                    client.look(picture)
                    client.search(picture)
            for i in range(KEPT):
                if Connection(server.address, False).ask("GET", f"{IMAGES}/kept-{i}")[0] != 200:
                    self.book.blame(f"kept-{i} is lost at a server")
        self.book.most("parts of one partition", most_parts(self.url))
        if self.book.figures["parts of one partition"] > MOST_PARTS:
            self.book.blame("there are more parts than merging keeps up with")
        checked = self.pliant("db", "check")
        if checked.returncode != 0:
            self.book.blame(f"db check: {checked.stdout}{checked.stderr}")
        until = time.monotonic() + SETTLE_S
        while (replicas := self.pliant("cluster", "check")).returncode != 0:
            if time.monotonic() > until:
                return self.book.blame(f"cluster check: {replicas.stdout}{replicas.stderr}")
            time.sleep(1)
        print("the replicas' checksums are equal")
        return None

    def keep_logs(self):
        for log in self.home.glob("*/*.log"):
            shutil.copy(log, self.logs / f"{log.parent.name}-{log.name}")

    def tidy(self, *, passed):
        for server in getattr(self, "servers", []):
            server.kill()
        if passed:
            shutil.rmtree(self.logs)


def run_case(description, servers, work):
    """The main function of another test: calls `work` with servers on the cluster. Returns the exit status."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=pathlib.Path, required=True)
    options = parser.parse_args()
    options.servers, options.seconds, options.gap, options.seed = servers, 0, 5, 1
    test, passed = Test(options), False
    try:
        test.prepare()
        work(test)
        passed = True
    except Wrong as wrong:
        test.keep_logs()
        print(f"WRONG: {wrong}; all logs are in {test.logs}")
        return 1
    finally:
        test.tidy(passed=passed)
    print("ok")
    return 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=pathlib.Path, required=True)
    parser.add_argument("--seconds", type=float, default=45)
    parser.add_argument("--servers", type=int, default=2)
    parser.add_argument("--clients", type=int, default=4)
    parser.add_argument("--gap", type=float, default=5, help="seconds at most between one trouble and the next")
    parser.add_argument("--seed", type=int, default=1)
    test, finished = Test(parser.parse_args()), False
    try:
        test.prepare()
        clients = test.run()
        if not test.book.wrong:
            test.settle()
            test.verify(clients)
        finished = True
    except Wrong as wrong:
        test.book.blame(str(wrong))
    finally:
        test.tidy(passed=finished and not test.book.wrong)
    for name, number in sorted(test.book.figures.items()):
        print(f"{number:7} {name}")
    print(f"{len(test.book.wrong):7} wrong")
    for wrong in test.book.wrong[:10]:
        print(f"WRONG: {wrong}")
    if test.book.wrong:
        test.keep_logs()
        print(f"all logs are in {test.logs}")
    return 1 if test.book.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
