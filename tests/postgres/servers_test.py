#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Several servers on one PostgreSQL database with a synchronous standby, while they and it are killed and stopped at random moments.

    tests/postgres/servers_test.py --bin build/release/bin [--seconds 600] [--servers 4] [--parts 2]

Clients put, replace, delete, look and search, each time at another server. A model of what was acknowledged decides: every
look and every search that begins afterwards, at any server, must agree with it. What had no answer, or one that does not
know (503 `database_outcome_unknown`), may have happened; what was refused otherwise has not. Nothing else may be answered.
With --parts, each server holds a part of the index, and as one server at a time is in trouble, no search may lack a part while
the databases are well. At the end nothing may be lost or back, and so once more after the standby has taken over. A disk is filled where this may
mount one (root). Exit status 77 where PostgreSQL is not installed (tests/postgres/install.sh).
"""
import argparse
import contextlib
import http.client
import json
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "chaos"))
from model_client import COLLECTION, IMAGES, Book, Client  # noqa: E402  (needs the path above)
from service.images import texture  # noqa: E402
from service.server import Connection, Server, Wrong  # noqa: E402
from troubles import KEPT, SETTLE_S, SMALL, Databases, Troubles  # noqa: E402

OWN_MOUNTS = "PLIANT_TEST_OWN_MOUNTS"
SMALL_DISK_MB = 2048  # the databases keep up to 1 GB of their log


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Test:
    def __init__(self, options):
        self.options, self.book, self.servers = options, Book(), []
        self.logs = pathlib.Path(tempfile.mkdtemp(prefix="pliant-servers-"))
        home = pathlib.Path(tempfile.mkdtemp(prefix="pliant-databases-"))
        home.chmod(0o755)  # PostgreSQL's user enters it
        self.databases, self.small_disk = Databases(home), os.environ.get(OWN_MOUNTS)
        self.url, self.ports = "", [free_port() for _ in range(options.servers)]
        if options.parts:
            self.peers = self.logs / "peers.toml"
            holders = [[f"http://127.0.0.1:{port}" for port in self.ports[part :: options.parts]] for part in range(options.parts)]
            self.peers.write_text("[parts]\n" + "".join(f"{i} = {json.dumps(of)}\n" for i, of in enumerate(holders, 1)), encoding="ascii")

    def pliant(self, *command):
        return subprocess.run([self.options.bin / "pliant", *command, "--db", self.url], capture_output=True, text=True, check=False, timeout=600)

    def start(self, number):
        """Starts again where the database is not back yet."""
        until = time.monotonic() + SETTLE_S
        part = []
        if self.options.parts:
            saved = self.logs / f"index-{number}"
            saved.mkdir(exist_ok=True)
            part = ["--part", f"{number % self.options.parts + 1}/{self.options.parts}", "--peers", self.peers, "--index-dir", saved]
        while True:
            server = Server([self.options.bin / "pliant-server", "--db", self.url, "--descriptor", "rootsift", "--auto-train", "false",
                             "--listen", f"127.0.0.1:{self.ports[number]}", *part], self.logs / f"server-{number}.log")
            try:
                server.wait_ready()
                return server
            except Wrong:
                server.kill()
                if time.monotonic() > until:
                    raise
                time.sleep(0.5)

    def ask(self, method, path, body=None, kind="application/json", server=0):
        connection = Connection(self.servers[server].address, keep_alive=False)
        try:
            status, data = connection.ask(method, path, body, kind)
        finally:
            connection.close()
        if status >= 400:
            raise Wrong(f"{method} {path}: {status} {data[:300]}")
        return json.loads(data) if data else {}

    def prepare(self):
        if self.small_disk:
            disk = self.databases.home / SMALL
            disk.mkdir()
            subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={SMALL_DISK_MB}m", "tmpfs", disk], check=True)
        said = self.databases.local("up", "0")
        self.url = said.rsplit("'", 2)[1]
        done = self.pliant("db", "init")
        if done.returncode != 0:
            raise Wrong(f"db init: {done.stdout}{done.stderr}")
        self.servers = [self.start(i) for i in range(self.options.servers)]
        for i in range(KEPT):
            self.ask("PUT", f"{IMAGES}/kept-{i}?object=kept", texture(f"kept {i}"), "image/png")
        job = self.ask("POST", f"{COLLECTION}/vocabularies", b'{"words": 200}')
        while self.ask("GET", f"/v1/jobs/{job['id']}")["state"] not in ("done", "failed"):
            time.sleep(0.2)

    def run(self):
        clients = [Client(i, self.servers, self.book, f"{self.options.seed} {i}") for i in range(self.options.clients)]
        pairs = [pair for client in clients for pair in client.pairs]
        troubles = Troubles(self)
        for client in clients:
            client.seen_pairs = pairs
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
        return clients

    def settle(self):
        """Until every server answers again, and can write."""
        self.databases.local("up")
        until = time.monotonic() + SETTLE_S
        for i in range(len(self.servers)):
            while True:
                with contextlib.suppress(OSError, http.client.HTTPException, Wrong):
                    self.ask("PUT", f"{IMAGES}/last?object=last", texture(f"last {i}"), "image/png", i)
                    self.ask("GET", "/readyz", server=i)
                    break
                if time.monotonic() > until:
                    raise Wrong(f"server {i} does not come back")
                time.sleep(0.5)

    def verify(self, clients):
        for number, server in enumerate(self.servers):
            for client in clients:
                client.servers = [server]
                for image in client.images:
                    client.look(image)
                    client.search(image)
                for pair in client.pairs:
                    client.look_at_pair(pair)
            self.verify_list(number, clients)
        checked = self.pliant("db", "check")
        if checked.returncode != 0:
            self.book.blame(f"db check: {checked.stdout}{checked.stderr}")

    def verify_list(self, number, clients):
        page = self.ask("GET", f"{IMAGES}?limit=500", server=number)
        if page.get("next"):
            raise Wrong("more images than one page lists")
        listed = {row["id"] for row in page["images"]}
        images = [image for client in clients for image in client.images]
        must = {f"kept-{i}" for i in range(KEPT)} | {"last"} | {image.name for image in images if None not in image.may}
        never = {image.name for image in images if image.may == {None}}
        if must - listed or never & listed:
            self.book.blame(f"server {number} lists: lost {sorted(must - listed)}, back {sorted(never & listed)}")

    def keep_logs(self):
        for log in self.databases.home.glob("db*/log"):
            shutil.copy(log, self.logs / f"{log.parent.name}.log")

    def tidy(self, *, passed):
        for server in self.servers:
            server.kill()
        if not passed:
            self.keep_logs()
        with contextlib.suppress(Wrong):
            self.databases.local("down")
        if self.small_disk:
            subprocess.run(["umount", "-l", self.databases.home / SMALL], check=False)
        with contextlib.suppress(Wrong):
            self.databases.local("remove")
        shutil.rmtree(self.databases.home, ignore_errors=True)
        if passed:
            shutil.rmtree(self.logs)


def ask_for_own_mounts():
    """Starts this again with mounts that nobody else sees, where that is allowed."""
    if os.environ.get(OWN_MOUNTS):
        return
    tried = ["unshare", "--mount", "sh", "-c", "mount -t tmpfs tmpfs /mnt"]
    if os.geteuid() == 0 and shutil.which("unshare") and subprocess.run(tried, check=False, stderr=subprocess.DEVNULL).returncode == 0:
        os.execvpe("unshare", ["unshare", "--mount", sys.executable, *sys.argv], {**os.environ, OWN_MOUNTS: "1"})
    print("no disk can be mounted here, so none is full")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=pathlib.Path, required=True)
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--servers", type=int, default=4)
    parser.add_argument("--parts", type=int, default=0, help="of the index; 0: every server holds all of it")
    parser.add_argument("--clients", type=int, default=4)
    parser.add_argument("--gap", type=float, default=5, help="seconds at most between one trouble and the next")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    ask_for_own_mounts()
    print(f"seed {options.seed}", flush=True)
    for name in [name for name in os.environ if name.startswith("PG")]:
        del os.environ[name]  # they are about other databases
    test, finished = Test(options), False
    try:
        test.prepare()
        clients = test.run()
        if not test.book.wrong:
            test.settle()
            test.verify(clients)
            test.databases.local("promote")
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
        print(f"all logs are in {test.logs}")
    return 1 if test.book.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
