# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Compares a server that has just started, and its files, with the model. No client may be there."""
import contextlib
import json
import os
import pathlib
import re
import sqlite3
import subprocess
import time

from kill.client import image_path, search_path, state_of
from kill.model import EXISTS
from service.images import sha256
from service.server import Wrong

TEMPORARY = re.compile(r"\.new-[\d-]+(-wal|-shm|-journal)?$")
PAGE = 37
PATIENCE_S = 120  # for something to happen to a job, however busy the machine
STRAYS_S = 30  # for files of removed images to go


def everything(connection, path, name):
    """All entries of a list, page by page."""
    entries, cursor = [], ""
    while cursor is not None:
        page = connection.get(f"{path}?limit={PAGE}" + (f"&cursor={cursor}" if cursor else ""))
        entries += page[name]
        cursor = page["next"]
    return entries


class Verifier:
    def __init__(self, model, book, dice):
        self.model, self.book, self.dice, self.report = model, book, dice, model.report

    def wrong(self, text, keys=()):
        self.report.add("other", text, [line for key in keys for line in self.model.history[key]])

    def all_of(self, connection, thorough=False):
        """After a start."""
        before = connection.get("/v1/jobs?limit=500")["jobs"]
        self.book.settle_by(before)
        grew = self.growing()
        records = self.records(connection)
        actual = {key: state_of(record) if key[1] else EXISTS for key, record in records.items()
                  if not key[1] or key[0] not in self.model.opaque}
        late = dict(self.model.maybe)  # what may be added since the list was read, also by an import that ends now
        self.book.settle_by(connection.get("/v1/jobs?limit=500")["jobs"])
        for key, state in late.items():
            if key not in actual and connection.json("GET", image_path(key))[0] == 200:
                actual[key] = state
        self.model.settle_by(actual)
        self.drop_ended()
        self.model.compare(actual)
        self.book.settle_vocabularies(connection.get("/v1/collections/default/vocabularies")["vocabularies"])
        for name in self.model.opaque:
            if any(job.kind == "demo" and job.seen["state"] == "done" for job in self.book.jobs.values()):
                self.demonstration(connection, name)
        if not self.growing():
            # What ended since the list was read may have added to it.
            self.counts(connection, self.records(connection) if grew or late else records)
        self.contents(connection, thorough)
        self.searches(connection, 6 if thorough else 2)

    def growing(self):
        return bool(self.book.active_jobs("import", "demo")) or bool(self.model.maybe)

    def demonstration(self, connection, name):
        said = connection.get(f"/v1/collections/{name}/demo")
        missing = [each for each in said["objects"] if connection.json(
            "GET", f"/v1/collections/{name}/images/{each['image_id']}")[0] != 200]
        if not said["loaded"] or missing:
            self.report.add("lost", f"the demonstration objects were added: {said}, but not {missing}")

    def drop_ended(self):
        """What imports that have ended did not add, they will not add any more."""
        with self.model.lock:
            pending = {key for states in self.book.folders.values() for key in states}
            for key in [key for key in self.model.maybe if key not in pending]:
                del self.model.maybe[key]

    def records(self, connection):
        """{key: record}, and {(collection, ""): EXISTS}."""
        found = {}
        for name in [one["name"] for one in connection.get("/v1/collections")["collections"]]:
            found[name, ""] = EXISTS
            images = everything(connection, f"/v1/collections/{name}/images", "images")
            ids = [image["id"] for image in images]
            if ids != sorted(set(ids)):
                self.wrong(f"the list of {name} is not in order: {ids}")
            found.update({(name, image["id"]): image for image in images})
        return found

    def counts(self, connection, records):
        """Counts of collections, list of objects, metrics: all must agree with the list of images."""
        objects = {}
        for (name, image), record in records.items():
            per = objects.setdefault(name, {})
            if image and record["object"]:
                per.setdefault(record["object"], []).append(image)
        for name, per in objects.items():
            listed = everything(connection, f"/v1/collections/{name}/objects", "objects")
            if {entry["object"]: entry["images"] for entry in listed} != {each: len(ids) for each, ids in per.items()}:
                self.wrong(f"objects of {name}: {listed}, not {per}")
            if any(entry["image_id"] not in per.get(entry["object"], ()) for entry in listed):
                self.wrong(f"objects of {name} name images that are not theirs: {listed}")
            images = [record for key, record in records.items() if key[0] == name and key[1]]
            wanted = len(images), len(per), sum(record["keypoints"] for record in images)
            said = connection.get(f"/v1/collections/{name}")
            if (said["images"], said["objects"], said["descriptors"]) != wanted:
                self.wrong(f"collection {name} says {said}, it has {wanted}")
        metrics = dict(line.rsplit(" ", 1) for line in connection.ask("GET", "/metrics")[1].decode().splitlines()
                       if not line.startswith("#"))
        total = sum(1 for key in records if key[1]), sum(len(per) for per in objects.values())
        if (float(metrics["pliant_images"]), float(metrics["pliant_objects"])) != total:
            self.wrong(f"metrics: {metrics['pliant_images']} images, {metrics['pliant_objects']} objects, not {total}")

    def contents(self, connection, thorough):
        """The bytes of every image that was touched, and of some others."""
        with self.model.lock:
            live = {key: state for key, state in self.model.known.items() if state is not None and key[1]}
            others = self.dice.sample(sorted(live), min(8, len(live)))
            touched, self.model.touched = self.model.touched, set()
        for key in live if thorough else touched.union(others) & set(live):
            status, data = connection.ask("GET", image_path(key) + "/content")
            if status != 200 or sha256(data) != live[key].sha256:
                self.report.add("lost" if status != 200 else "mixtures",
                                f"content of {key}: {status} {data[:200] if status != 200 else sha256(data)}, "
                                f"not {live[key]}", self.model.history[key])
        for key in touched - set(live):
            if key[1] and key not in self.model.maybe and connection.json("GET", image_path(key))[0] != 404:
                self.report.add("back", f"{key} is there", self.model.history[key])

    def searches(self, connection, number):
        live = self.model.live()
        for key in self.dice.sample(sorted(live), min(number, len(live))):
            data = connection.ask("GET", image_path(key) + "/content")[1]
            status, answer = connection.ask("POST", search_path(live[key]), data)
            answer = json.loads(answer)
            if status == 409 and not self.model.has_vocabulary:
                return
            if status != 200:
                self.wrong(f"a search with {key} was answered {status} {answer}", [key])
                continue
            hits = {hit["image_id"]: hit["object"] for hit in answer["hits"]}
            if key[1] not in hits:
                self.wrong(f"a search with the bytes of {key} does not find it among {len(live)} images: {answer}", [key])
            for hit, named in hits.items():
                state = live.get(("default", hit)) or self.model.maybe.get(("default", hit))
                if state is None or state.object != (named or ""):
                    self.wrong(f"a search finds {hit} of {named!r}, known is {state}", [("default", hit)])

    def wait_for_jobs(self, connection):
        before, latest = None, 0
        while active := self.book.active_jobs():
            listed = connection.get("/v1/jobs?limit=500")["jobs"]
            self.book.settle_by(listed)
            if listed != before:
                before, latest = listed, time.monotonic() + PATIENCE_S
            if time.monotonic() > latest:
                raise Wrong(f"nothing happens to jobs: {[self.book.jobs[number] for number in active]}")
            time.sleep(0.2)


class Files:
    """The database's folder: what lies beside the database, and the directory of the originals."""

    def __init__(self, folder, report, pliant):
        self.folder, self.report, self.pliant = folder, report, pliant
        self.database, self.originals, self.backups = folder / "db", folder / "originals", folder / "backups"

    def age(self):
        """Makes temporary files look old: young ones could be of a living process, and stay."""
        long_ago = time.time() - 3600
        for path in self.temporary():
            with contextlib.suppress(FileNotFoundError):
                os.utime(path, (long_ago, long_ago))

    def temporary(self):
        return [path for path in self.folder.rglob("*") if TEMPORARY.search(path.name)]

    def rows(self, statement, path=None):
        where = f"file:{path or self.database}?mode=ro"
        with contextlib.closing(sqlite3.connect(where, uri=True, timeout=30)) as database:
            return database.execute(statement).fetchall()

    def strays(self):
        """Names of files that belong to nothing."""
        found = [path.relative_to(self.folder) for path in self.temporary()]
        if not self.originals.exists():
            return found
        wanted = {row[0] for row in self.rows("SELECT DISTINCT lower(hex(sha256)) FROM original_files")}
        wanted.add("pliant-originals")
        there = {path.name: path.relative_to(self.folder) for path in self.originals.rglob("*") if path.is_file()}
        found += [path for name, path in there.items() if name not in wanted]
        found += [pathlib.Path("missing") / name for name in wanted - set(there) if self.rows("SELECT 1 FROM original_files")]
        return found

    def expect_none(self):
        """After a start that nothing has been added since, but perhaps by jobs: so not at once."""
        latest = time.monotonic() + STRAYS_S
        while (strays := self.strays()) and time.monotonic() < latest:
            time.sleep(0.1)
        if strays:
            self.report.add("other", f"files of nothing: {[str(path) for path in strays]}")

    def check(self, *more, database=None):
        """Problems that `pliant db check` finds."""
        command = [self.pliant, "db", "check", "--json", "--db", database or self.database, *more]
        result = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
        try:
            return json.loads(result.stdout)["problems"]
        except (ValueError, KeyError):
            return [f"exit status {result.returncode}: {result.stdout} {result.stderr}"]

    def expect_sound(self, *more):
        for problem in self.check(*more):
            self.report.add("other", f"pliant db check: {problem}")

    def check_backup(self, path, snapshot, model):
        """A backup is a whole database, and has what was there from before it was asked for until now."""
        for problem in self.check(database=path):
            if "its original is not in" not in problem:  # removed since: the directory is not in the backup
                self.report.add("other", f"pliant db check of backup {path.name}: {problem}")
        rows = {(row[0], row[1]): row[2] for row in self.rows(
            "SELECT c.name, p.id, lower(hex(p.sha256)) FROM images p JOIN collections c ON c.key = p.collection", path)}
        for key, (version, state) in snapshot.items():
            if model.versions[key] == version and rows.get(key) != state.sha256:
                self.report.add("lost", f"backup {path.name} has {rows.get(key)} of {key}, not {state}", model.history[key])
