# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""One database, and many lives of a server on it. Each life ends by kill -9: under load, while it starts, or while
it stops."""
import dataclasses
import random
import subprocess
import time

from kill.client import Client
from kill.job_client import JobClient
from kill.jobs import JobBook, import_states
from kill.model import Model
from kill.verify import Files, Verifier
from service.images import write_folder
from service.server import Connection, Server, Wrong

CLIENTS = 8
LONGEST_LIFE_S = 12
CHECKED = 0.4  # share of lives after which `pliant db check` runs; damage would stay until the next
STOP_S = 45  # --shutdown-timeout and some


@dataclasses.dataclass
class Setup:
    """How the server of a round runs."""
    descriptor: str
    originals: str  # "database", "directory", or "turns"
    auto_train: bool
    keep_alive: bool
    large_imports: bool

    @staticmethod
    def of(number):
        """All combinations of the first three within 24 rounds, and each value of them within three or four."""
        return Setup("deal" if number % 4 == 1 else "rootsift", ("directory", "database", "turns")[number % 3],
                     number // 2 % 2 == 0, number % 5 not in (1, 3), number % 6 == 4)

    def __str__(self):
        return (f"{self.descriptor}, originals {self.originals}, {'automatic' if self.auto_train else 'no automatic'} "
                f"training, keep-alive {'on' if self.keep_alive else 'off'}")


class Round:
    def __init__(self, number, seed, folder, binaries, report):
        self.name, self.folder, self.binaries, self.report = f"{seed}/{number}", folder, binaries, report
        self.setup, self.dice = Setup.of(number), random.Random(f"{seed}/{number}")
        self.model = Model(report)
        self.book = JobBook(self.model, self.setup.auto_train)
        self.files = Files(folder, report, binaries / "pliant")
        self.verifier = Verifier(self.model, self.book, random.Random(f"{self.name} verify"))
        self.imports = folder / "imports"
        self.imports.mkdir()
        self.files.backups.mkdir()
        self.start_s, self.stop_s = 0.3, 0.1  # how long a start and a stop take, about
        self.server, self.connection, self.other = None, None, None

    def command(self):
        place = self.setup.originals
        if place == "turns":
            place = "database" if self.model.life % 2 else "directory"
        return [self.binaries / "pliant-server", "--db", self.files.database, "--listen", "127.0.0.1:0",
                "--descriptor", self.setup.descriptor, "--max-keypoints", "64", "--max-side", "96",
                "--auto-train", str(self.setup.auto_train).lower(), "--idle-timeout", "300",
                "--originals-dir", "database" if place == "database" else self.files.originals,
                "--import-dir", self.imports, "--backup-dir", self.files.backups]

    # Starting.

    def begin(self):
        self.files.age()
        self.server = Server(self.command(), self.folder / "log")

    def start(self):
        """A server that is ready, after some that were killed while they started, sometimes."""
        while self.model.life > 0 and self.dice.random() < 0.25 or self.model.life == 0 and self.dice.random() < 0.7:
            self.begin()
            time.sleep(self.dice.random() * self.start_s * 1.2)
            self.count_kill(self.server.kill(), "start")
            self.model.life += 1
        self.begin()
        self.start_s = 0.7 * self.start_s + 0.3 * self.server.wait_ready()
        self.connection = Connection(self.server.address)

    def count_kill(self, was_alive, when):
        if was_alive:
            self.report.count("kills")
            self.report.kinds[when] += 1

    # Living.

    def live(self):
        """One life, from a ready server to its end."""
        name = f"{self.name}/{self.model.life}"
        clients = [Client(number, self.model, self.server.address, f"{name}/{number}", self.setup.keep_alive)
                   for number in range(CLIENTS)]
        clients.append(JobClient(self.model, self.book, self.server.address, f"{name}/jobs", self.setup.keep_alive,
                                 self.imports, self.setup.large_imports))
        for client in clients:
            client.start()
        if self.dice.random() < 0.15:
            self.start_other()
        enough, latest = self.dice.randrange(1, 90), time.monotonic() + LONGEST_LIFE_S
        while sum(client.done for client in clients) < enough and time.monotonic() < latest:
            time.sleep(0.001)
        time.sleep(self.dice.random() * 0.03)
        broken_from = time.monotonic()
        self.end()
        for client in clients:
            client.stopped = True
        for client in clients:
            client.join(130)
            if client.is_alive():
                raise Wrong(f"client {client.number} does not end")
            if client.failed_at is not None and client.failed_at < broken_from:
                self.report.add("other", f"client {client.number} lost its connection before the kill: {client.failure}")
        self.connection.close()
        self.model.life += 1

    def start_other(self):
        """Another program on the same database, which is killed as well."""
        if self.dice.random() < 0.5:
            what = ["db", "backup", self.files.backups / f"cli{self.model.life}.db"]
        else:
            folder = self.folder / "others" / f"x{self.model.life}"
            self.model.expect(import_states(write_folder(folder, f"x{self.model.life}", 2, 4)))
            what = ["index", folder, "--object-from", "folder"]
        self.other = subprocess.Popen([self.binaries / "pliant", *what, "--db", self.files.database],
                                      stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def end(self):
        if self.dice.random() < 0.2:
            for number in self.book.active_jobs():
                self.book.jobs[number].stops += 1
            self.server.terminate()
            begin = time.monotonic()
            status = self.server.ended(self.dice.random() * self.stop_s * 1.5)
            if status is not None:
                self.stop_s = 0.7 * self.stop_s + 0.3 * (time.monotonic() - begin)
            if status not in (None, 0):
                self.report.add("other", f"the server ended with {status} after SIGTERM")
            self.count_kill(status is None and self.server.kill(), "stop")
        else:
            self.count_kill(self.server.kill(), "load")
        if self.other is not None:
            self.count_kill(self.other.poll() is None, "command")
            self.other.kill()
            self.other.wait()
            self.other = None

    # Looking.

    def verify(self, thorough=False):
        self.verifier.all_of(self.connection, thorough)
        if self.report.wrong:
            return
        if thorough or self.dice.random() < CHECKED:
            self.files.expect_sound()
        for listed in self.connection.get("/v1/backups")["backups"]:
            path = self.files.backups / listed["name"]
            self.files.check_backup(path, self.book.backups.pop(path.name, {}), self.model)
            path.unlink()
        if not self.verifier.growing():
            self.files.expect_none()

    def finish(self):
        """To the end of all jobs, then a stop that nobody disturbs."""
        self.start()
        self.verifier.wait_for_jobs(self.connection)
        self.verify(thorough=True)
        self.connection.close()
        self.server.terminate()
        status = self.server.ended(STOP_S)
        if status != 0:
            self.report.add("other", f"the server ended with {status} after SIGTERM")
        self.files.expect_sound()

    def run(self, lives):
        for _ in range(lives):
            self.start()
            self.verify()
            if self.report.wrong:
                return
            self.live()
            if self.report.wrong:
                return
        self.finish()

    def tidy(self):
        if self.server is not None:
            self.server.kill()
        if self.other is not None:
            self.other.kill()
            self.other.wait()
