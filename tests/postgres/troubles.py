# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""What happens to servers and their databases under the clients: killed and stopped processes, cut connections, a standby
that takes over, a full disk."""
import contextlib
import math
import os
import pathlib
import random
import signal
import subprocess
import sys
import threading
import time

from model_client import IMAGES, REFUSED
from service.images import texture
from service.server import Connection, Wrong

LOCAL = pathlib.Path(__file__).resolve().parents[2] / "docker" / "cluster_local.sh"
KEPT = 20  # images that are there from the beginning to the end
SETTLE_S = 180
SMALL = "db1"  # the database whose disk can be filled
FILLER = "filler"
WELL_S = 30  # until servers have followed a database that is back
LONG_S = 17  # a server that is stopped longer than this has lost its transactions (idle_in_transaction_session_timeout)


class Databases:
    """A primary and a synchronous standby, by docker/cluster_local.sh."""

    def __init__(self, home):
        self.home = home

    def local(self, action, *arguments):
        done = subprocess.run(["bash", LOCAL, action, self.home, *arguments], capture_output=True, text=True, check=False, timeout=600)
        if done.returncode == 77:
            print(done.stderr, end="")
            sys.exit(77)
        if done.returncode != 0:
            raise Wrong(f"cluster_local.sh {action}: {done.stdout}{done.stderr}")
        return done.stdout

    def primary(self):
        return (self.home / "primary").read_text(encoding="ascii").strip()

    def standby(self):
        return "db1" if self.primary() == "db2" else "db2"

    def sql(self, statement):
        """At the primary, as superuser; text, or nothing when it does not answer."""
        port = (self.home / self.primary() / "port").read_text(encoding="ascii").strip()
        done = subprocess.run(["psql", "-qAtX", "-d", f"host=127.0.0.1 port={port} user=postgres dbname=postgres connect_timeout=5",
                               "-c", statement], capture_output=True, text=True, check=False, timeout=60)
        return done.stdout.strip()

    def processes(self, name):
        """The postmaster, and its children."""
        with contextlib.suppress(OSError):
            lines = (self.home / name / "data" / "postmaster.pid").read_text(encoding="utf-8").splitlines()
            if str(self.home / name).encode() in pathlib.Path(f"/proc/{lines[0]}/cmdline").read_bytes():
                children = subprocess.run(["pgrep", "-P", lines[0]], capture_output=True, text=True, check=False).stdout.split()
                return [int(lines[0]), *map(int, children)]
        return []

    def kill(self, name):
        """The postmaster alone; the others notice it, and end before a new one can start."""
        processes = self.processes(name)
        send(signal.SIGKILL, processes[:1])
        until = time.monotonic() + SETTLE_S
        while any(is_postgres(process) for process in processes):
            if time.monotonic() > until:
                raise Wrong(f"processes of {name} outlive its postmaster")
            time.sleep(0.05)


def is_postgres(process):
    with contextlib.suppress(OSError):
        return b"postgres" in pathlib.Path(f"/proc/{process}/cmdline").read_bytes()
    return False


def send(number, processes):
    for process in processes:
        with contextlib.suppress(ProcessLookupError):
            os.kill(process, number)


def put(server, name):
    """The status of a new image of that name; 0: no answer."""
    connection = Connection(server.address, keep_alive=False)
    try:
        return connection.ask("PUT", f"{IMAGES}/{name}?object={name}", texture(f"{name} {time.monotonic()}"), "image/png")[0]
    except OSError:
        return 0
    finally:
        connection.close()


class Troubles(threading.Thread):
    """One trouble after the other; each ends with everything running again. The standby takes over at a third of the time,
    and a disk is full at two thirds; both wait until all is calm."""

    def __init__(self, test):
        super().__init__(daemon=True)
        self.databases, self.servers, self.start_server, self.book = test.databases, test.servers, test.start, test.book
        self.seconds, self.gap_s, self.stopped = test.options.seconds, test.options.gap, False
        self.dice = random.Random(f"{test.options.seed} troubles")
        self.waiting = [(1 / 3, self.promote)]
        if test.small_disk:
            self.waiting.append((2 / 3, self.disk_is_full))

    def run(self):
        begun = time.monotonic()
        choices = {self.kill_server: 4, self.slow_server: 2, self.stop_server: 3, self.kill_primary: 3, self.stop_primary: 2, self.kill_standby: 1, self.promote: 1,
                   self.cut: 4}
        try:
            while not self.stopped:
                time.sleep(self.dice.uniform(1, self.gap_s))
                if self.waiting and time.monotonic() - begun > self.waiting[0][0] * self.seconds:
                    self.wait_calm()
                    trouble = self.waiting.pop(0)[1]
                else:
                    trouble = self.dice.choices([*choices], [*choices.values()])[0]
                print(f"{time.strftime('%H:%M:%S')} {trouble.__name__.replace('_', ' ')}", flush=True)
                if not trouble.__name__.endswith("server"):
                    self.book.well_from = math.inf
                trouble()
                if self.book.well_from == math.inf:
                    self.book.well_from = time.monotonic() + WELL_S
                self.book.count(f"troubles: {trouble.__name__.replace('_', ' ')}")
        except Exception as error:
            self.book.blame(f"troubles: {error!r}")

    def some_time(self):
        return self.dice.uniform(0.5, 6)

    def kill_server(self):
        i = self.dice.randrange(len(self.servers))
        self.servers[i].kill()
        self.servers[i] = self.start_server(i)

    def stop_server(self):
        """Now and then for so long that the database takes its transaction away."""
        server = self.dice.choice(self.servers)
        self.book.stopped = server.address
        send(signal.SIGSTOP, [server.process.pid])
        time.sleep(self.dice.choice([1, 3, LONG_S + 3]))
        send(signal.SIGCONT, [server.process.pid])
        self.book.stopped = None

    def slow_server(self):
        server = self.dice.choice(self.servers)
        self.book.stopped = server.address
        for _ in range(20):
            send(signal.SIGSTOP, [server.process.pid])
            time.sleep(self.dice.uniform(0.05, 0.4))
            send(signal.SIGCONT, [server.process.pid])
            time.sleep(0.05)
        self.book.stopped = None

    def kill_primary(self):
        self.databases.kill(self.databases.primary())
        time.sleep(self.some_time())
        self.databases.local("up")

    def kill_standby(self):
        """Commits wait."""
        self.databases.kill(self.databases.standby())
        time.sleep(self.some_time())
        self.databases.local("up")

    def stop_primary(self):
        processes = self.databases.processes(self.databases.primary())
        send(signal.SIGSTOP, processes)
        time.sleep(self.dice.choice([1, 4, 14]))
        send(signal.SIGCONT, processes)

    def promote(self):
        """The old primary is gone before, and comes back as the standby."""
        if self.dice.random() < 0.7:
            self.databases.kill(self.databases.primary())
        self.databases.local("promote")

    def cut(self):
        """Connections, most of them between question and answer."""
        for _ in range(self.dice.randrange(5, 20)):
            self.databases.sql("SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE datname = 'pliant' AND pid <> pg_backend_pid() "
                               "AND random() < CASE state WHEN 'active' THEN 0.5 ELSE 0.1 END")
            time.sleep(self.dice.uniform(0, 0.3))

    def wait_calm(self):
        """Until every server writes."""
        until = time.monotonic() + SETTLE_S
        for server in self.servers:
            while put(server, "calm") not in (200, 201):
                if time.monotonic() > until:
                    raise Wrong("the servers do not become calm")
                time.sleep(0.5)

    def disk_is_full(self):
        """That of the primary: what is written is refused, and written when there is space again."""
        if self.databases.primary() != SMALL:
            self.databases.local("promote")
            self.wait_calm()
        filler = self.databases.home / SMALL / FILLER
        with open(filler, "wb", buffering=0) as file, contextlib.suppress(OSError):
            while True:
                file.write(bytes(1 << 16))
        refused, end = 0, time.monotonic() + SETTLE_S
        while refused < 20:
            status = put(self.dice.choice(self.servers), f"full-{self.dice.randrange(KEPT)}")
            refused += status in REFUSED
            self.book.count(f"writes {'refused' if status in REFUSED else 'done'} while the disk is full")
            if status not in (200, 201, *REFUSED) or time.monotonic() > end:
                self.book.blame(f"a full disk: {status}, {refused} writes were refused")
                break
        filler.unlink()
        self.databases.local("up")
        self.wait_calm()
