# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""The command line, killed midway and run again, on a database that no server uses."""
import json
import subprocess
import time

from kill.jobs import import_states
from service.images import write_folder

IMAGES = 4
OBJECTS = 3


class Commands:
    def __init__(self, round_):
        self.round, self.model, self.report, self.dice = round_, round_.model, round_.report, round_.dice
        self.files = round_.files

    def program(self, *arguments):
        return [self.round.binaries / "pliant", *arguments, "--db", self.files.database, "--json"]

    def killed(self, longest_s, *arguments):
        """Starts it, and kills it. The time that it takes is about `longest_s`."""
        process = subprocess.Popen(self.program(*arguments), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        time.sleep(self.dice.random() * longest_s)
        self.round.count_kill(process.poll() is None, "command")
        process.kill()
        process.wait()
        self.files.age()

    def done(self, *arguments, may_skip=False):
        """(its JSON, seconds); it must succeed."""
        begin = time.monotonic()
        result = subprocess.run(self.program(*arguments), capture_output=True, text=True, timeout=300, check=False)
        if result.returncode not in ((0, 3) if may_skip else (0,)):
            self.report.add("other", f"pliant {arguments} ended with {result.returncode}: {result.stdout} {result.stderr}")
            return {}, 1.0
        return json.loads(result.stdout), time.monotonic() - begin

    def run(self):
        for act in (self.index, self.move, self.train, self.backup, self.remove):
            act()
            self.files.expect_sound()

    def index(self):
        """Indexing that was killed goes on where it was."""
        folder = self.round.folder / "others" / "killed"
        states = import_states(write_folder(folder, "killed", OBJECTS, IMAGES))
        arguments = ["index", folder, "--object-from", "folder"]
        for _ in range(2):
            self.killed(0.8, *arguments)
        before = self.count(states)
        said, _ = self.done(*arguments)
        if (said.get("unchanged"), said.get("indexed")) != (before, len(states) - before):
            self.report.add("other", f"{before} of {len(states)} images were there, then: {said}")
        self.model.adopt(states)
        self.model.touched.update(states)

    def count(self, states):
        there = {row[0] for row in self.files.rows("SELECT id FROM images")}
        return sum(key[1] in there for key in states)

    def move(self):
        """All originals into the directory or out of it."""
        place = self.dice.choice(["database", self.files.originals])
        for _ in range(2):
            self.killed(0.5, "db", "originals", place)
        said, _ = self.done("db", "originals", place)
        if said.get("left") != 0:
            self.report.add("lost", f"originals were left when they were moved to {place}: {said}")
        self.sweep()
        self.files.expect_none()
        self.model.touched.update(self.model.live())

    def sweep(self):
        """Sweeps the directory of originals, if there ever was one."""
        stats, _ = self.done("db", "stats")
        self.done("db", "check", *(["--sweep"] if stats["originals"] else []))

    def train(self):
        for _ in range(2):
            self.killed(0.6, "vocab", "train", "--words", "30", "--seed", "77")
        self.done("vocab", "train", "--words", "30", "--seed", "77")
        self.book_is_open()

    def book_is_open(self):
        self.round.book.active = None

    def backup(self):
        """A backup that was killed left nothing, or a whole one; the next one removes what was left."""
        target = self.files.backups / "killed.db"
        for _ in range(3):
            self.killed(0.4, "db", "backup", target)
            if target.exists():
                self.files.check_backup(target, self.round.book.snapshot(), self.model)
                target.unlink()
        self.done("db", "backup", target)
        self.files.check_backup(target, self.round.book.snapshot(), self.model)
        target.unlink()
        self.files.expect_none()

    def remove(self):
        """Removing objects: each as a whole."""
        names = [f"killed-{number}" for number in range(OBJECTS)]
        arguments = ["db", "rm", *[word for name in names for word in ("--object", name)]]
        self.killed(0.4, *arguments)
        rows = self.files.rows("SELECT o.name, count(*) FROM images p JOIN objects o ON o.key = p.object GROUP BY 1")
        there = {name: number for name, number in rows if name in names}
        if any(number != IMAGES for number in there.values()):
            self.report.add("mixtures", f"objects were removed in part: {there}")
        self.done(*arguments, may_skip=True)
        self.model.adopt({key: None for key, state in self.model.live().items() if state.object in names})
        self.sweep()
        self.files.expect_none()
