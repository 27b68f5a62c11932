# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""What happens to a cluster under its clients: killed processes, a Keeper that is gone for a while, a full disk."""
import contextlib
import http.client
import os
import pathlib
import random
import re
import signal
import subprocess
import threading
import time

from model_client import IMAGES, SEARCH
from service.pictures import texture
from service.server import Connection, Wrong

LOCAL = pathlib.Path(__file__).resolve().parent.parent.parent / "docker" / "cluster_local.sh"
NODES = ("s1r1", "s1r2", "s2r1", "s2r2")
KEPT = 20  # pictures that are there from the beginning to the end
SETTLE_S = 180
FILLER = "filler"


def local(action, home):
    done = subprocess.run(["bash", LOCAL, action, home], capture_output=True, text=True, check=False, timeout=300)
    if done.returncode != 0:
        raise Wrong(f"cluster_local.sh {action}: {done.stdout}{done.stderr}")


def ask(server, method, path, body=None):
    """(status, Retry-After); status 0: no answer."""
    connection = http.client.HTTPConnection(*server.address, timeout=120)
    try:
        connection.request(method, path, body, {"Content-Type": "image/png"} if body else {})
        answer = connection.getresponse()
        answer.read()
        return answer.status, answer.getheader("Retry-After")
    except (OSError, http.client.HTTPException):
        return 0, None
    finally:
        connection.close()


def most_parts(url):
    """Of the tables of all nodes, the most parts that one partition has."""
    most = 0
    for port in re.findall(r"127[.]0[.]0[.]1:(\d+)", url.split("/pliant?")[0]):
        statement = b"SELECT max(n) FROM (SELECT count() AS n FROM system.parts WHERE active GROUP BY database, table, partition)"
        connection = Connection(("127.0.0.1", int(port)), keep_alive=False)
        with contextlib.suppress(OSError, http.client.HTTPException, ValueError):
            most = max(most, int(connection.ask("POST", "/", statement)[1]))
        connection.close()
    return most


class Troubles(threading.Thread):
    """Kills one process after the other; the last thing it does is to start what it has killed. Once each, at a third
    and two thirds of the time, the Keeper is gone, and a disk full, for a while, in which nothing else happens."""

    def __init__(self, test):
        super().__init__(daemon=True)
        self.home, self.servers, self.start_server, self.book = test.home, test.servers, test.start, test.book
        self.url, self.seconds, self.gap_s, self.stopped = test.url, test.options.seconds, test.options.gap, False
        self.dice = random.Random(f"{test.options.seed} troubles")
        self.lasts_s = min(60, max(10, self.seconds / 15))
        self.small_disk = os.environ.get("PLIANT_TEST_SMALL_DISK")
        self.waiting = [(1 / 3, self.keeper_is_gone)]
        if self.small_disk:
            self.waiting.append((2 / 3, self.disk_is_full))

    def run(self):
        begun = time.monotonic()
        try:
            while not self.stopped:
                time.sleep(self.dice.uniform(1, self.gap_s))
                if self.waiting and time.monotonic() - begun > self.waiting[0][0] * self.seconds:
                    self.waiting[0][1]()
                    self.waiting.pop(0)
                else:
                    self.dice.choices([self.server, self.node, self.keeper], [4, 4, 1])[0]()
                self.book.most("parts of one partition", most_parts(self.url))
        except Exception as error:
            self.book.blame(f"troubles: {error!r}")

    def server(self):
        i = self.dice.randrange(len(self.servers))
        self.servers[i].kill()
        self.book.count("killed servers")
        self.servers[i] = self.start_server(i)

    def kill(self, name, what):
        pid = int((self.home / name / "pid").read_text(encoding="ascii"))
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
        self.book.count(f"killed {what}")

    def process(self, name, what):
        self.kill(name, what)
        time.sleep(self.dice.uniform(0.5, 6))
        local("up", self.home)

    def node(self):
        self.process(self.dice.choice(NODES), "ClickHouse")

    def keeper(self):
        self.process("zookeeper", "ZooKeeper")

    def wait_calm(self):
        """Until every server reads and writes, on both shards."""
        until = time.monotonic() + SETTLE_S
        for server in self.servers:
            for i in range(KEPT):
                while ask(server, "PUT", f"{IMAGES}/calm-{i}?object=calm", texture(f"calm {time.monotonic()}"))[0] not in (200, 201):
                    if time.monotonic() > until:
                        raise Wrong("the cluster does not become calm")
                    time.sleep(0.5)

    def reads_go_on(self, when):
        for server in self.servers:
            number = self.dice.randrange(KEPT)
            for method, path, body in (("GET", f"{IMAGES}/kept-{number}", None), ("POST", SEARCH, texture(f"kept {number}"))):
                status, _ = ask(server, method, path, body)
                self.book.count(f"reads {when}")
                if status != 200:
                    self.book.blame(f"{method} {path} {when}: {status}")

    def keeper_is_gone(self):
        """Reads go on, writes are refused."""
        self.wait_calm()
        when = "while the Keeper is gone"
        self.kill("zookeeper", "ZooKeeper")
        end = time.monotonic() + self.lasts_s
        while time.monotonic() < end:
            self.reads_go_on(when)
            status, retry = ask(self.dice.choice(self.servers), "PUT", f"{IMAGES}/gone-{self.dice.randrange(KEPT)}?object=gone",
                                texture(f"gone {time.monotonic()}"))
            self.book.count(f"writes refused {when}")
            if status != 503 or not retry:
                self.book.blame(f"PUT {when}: {status}, Retry-After {retry}")
        local("up", self.home)
        self.wait_calm()

    def disk_is_full(self):
        """Of one node. Reads go on; what is written to its shard is refused, and written when there is space again."""
        self.wait_calm()
        when = "while a disk is full"
        filler = self.home / self.small_disk / "data" / FILLER
        with open(filler, "wb", buffering=0) as file, contextlib.suppress(OSError):
            while True:
                file.write(bytes(1 << 16))
        end, refused = time.monotonic() + self.lasts_s, 0
        while time.monotonic() < end or not refused:
            self.reads_go_on(when)
            status, _ = ask(self.dice.choice(self.servers), "PUT", f"{IMAGES}/full-{self.dice.randrange(KEPT)}?object=full",
                            texture(f"full {time.monotonic()}"))
            refused += status in (503, 507)
            self.book.count(f"writes {'refused' if status in (503, 507) else 'done'} {when}")
            if status not in (200, 201, 503, 507):
                self.book.blame(f"PUT {when}: {status}")
            if time.monotonic() > end + SETTLE_S:
                self.book.blame(f"nothing was refused {when}")
                break
        filler.unlink()
        self.wait_calm()
