# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""The client that starts jobs, follows and cancels them, and makes and deletes whole collections."""
import json

from kill.client import Client
from kill.jobs import import_states
from kill.model import EXISTS, State
from service.images import sha256, write_folder
from service.server import Wrong

VOCABULARIES = "/v1/collections/default/vocabularies"
MOST_ACTIVE = 5  # jobs at once
MOST_LIVE = 260  # images; above, no imports
MOST_VOCABULARIES = 12
LEAST_TRAINED = 10  # images


class JobClient(Client):
    def __init__(self, model, book, address, dice, keep_alive, imports, large_imports=False):
        super().__init__("j", model, address, dice, keep_alive)
        self.book, self.imports, self.large_imports = book, imports, large_imports

    def act(self):
        acts = {self.train: 6, self.backup: 5, self.import_folder: 5, self.activate: 3, self.follow: 12,
                self.cancel: 3, self.demonstrate: 1, self.make_collection: 4, self.fill_collection: 6,
                self.drop_collection: 3, self.remove_imported: 5}
        self.dice.choices(list(acts), list(acts.values()))[0]()

    def start_job(self, kind, mark, path, document):
        self.book.unsure.append((kind, mark))
        status, answer = self.connection.json("POST", path, document)
        if status == 202:
            self.book.accepted(kind, mark, answer)
        elif status != 503:
            raise Wrong(f"POST {path} {document} was answered {status} {answer}")
        self.book.unsure.remove((kind, mark))
        return status == 202

    def may_start(self):
        return len(self.book.active_jobs()) < MOST_ACTIVE

    def train(self):
        """Ten descriptors a word or more: with as many words as descriptors no descriptor is near its word."""
        images = len(self.model.live())
        if not self.may_start() or len(self.book.made) >= MOST_VOCABULARIES or images < LEAST_TRAINED:
            return self.follow()
        activate = self.dice.random() < 0.6
        seed = self.dice.randrange(10**9) + 1000
        if activate:
            self.book.active = None
        self.start_job("train", seed, VOCABULARIES,
                       {"words": self.dice.randrange(LEAST_TRAINED, 3 * images), "sample": 40 * images, "seed": seed,
                        "activate": activate})
        return None

    def activate(self):
        if not self.book.made:
            return
        number = self.dice.choice(sorted(self.book.made.values()))
        self.book.active = None
        self.book.unsure.append(("activate", number))
        status, answer = self.connection.json("PUT", f"{VOCABULARIES}/{number}/active")
        if status == 202:
            self.book.accepted("activate", number, answer)
        elif status == 200 and not self.book.active_jobs("train", "activate"):
            self.book.active = number
        elif status not in (200, 503):
            raise Wrong(f"activation of vocabulary {number} was answered {status} {answer}")
        self.book.unsure.remove(("activate", number))

    def backup(self):
        if self.may_start():
            name = f"b{self.model.life}-{self.dice.randrange(10**6)}.db"
            self.book.backups[name] = self.book.snapshot()
            self.start_job("backup", name, "/v1/backups", {"name": name})

    def import_folder(self):
        if not self.may_start() or len(self.model.live()) > MOST_LIVE:
            return
        name = f"f{self.model.life}-{self.dice.randrange(10**6)}"
        many = self.large_imports and self.dice.random() < 0.3
        states = import_states(write_folder(self.imports / name, name, 2, 105 if many else self.dice.randrange(2, 9)))
        with self.model.lock:
            self.model.expect(states)
            self.book.folders[name] = states
        if not self.start_job("import", name, "/v1/collections/default/imports", {"folder": name, "object_from": "folder"}):
            with self.model.lock:
                self.book.drop_folder(name)

    def demonstrate(self):
        """Once, into a collection of its own."""
        if self.model.opaque or not self.may_start():
            return
        if self.change("PUT collection", "/v1/collections/demo", {("demo", ""): EXISTS}, {201, 200}):
            self.model.opaque.add("demo")
            self.start_job("demo", None, "/v1/collections/demo/demo", {})

    def follow(self):
        for number in self.book.active_jobs():
            status, document = self.connection.json("GET", f"/v1/jobs/{number}")
            if status == 200:
                self.book.see(document)
            elif status != 503:
                raise Wrong(f"job {number} was answered {status} {document}")

    def cancel(self):
        active = self.book.active_jobs()
        if not active:
            return
        number = self.dice.choice(active)
        status, document = self.connection.json("DELETE", f"/v1/jobs/{number}")
        if status == 202:
            with self.model.lock:
                self.book.jobs[number].cancelled = True
                self.book.see(document)
        elif status != 503:
            raise Wrong(f"cancelling job {number} was answered {status} {document}")

    def collections(self):
        return sorted(key[0] for key, state in list(self.model.known.items())
                      if state == EXISTS and key[0].startswith("side"))

    def make_collection(self):
        if len(self.collections()) < 3:
            name = f"side-{self.model.life}-{self.dice.randrange(10**6)}"
            self.change("PUT collection", f"/v1/collections/{name}", {(name, ""): EXISTS}, {201})

    def change(self, what, path, after, expected, body=None):
        if what != "PUT collection":
            return super().change(what, path, after, expected, body)
        with self.model.change(what, after) as change:
            status, data = self.ask("PUT", path)
            if status not in (*expected, 503):
                raise Wrong(f"PUT {path} was answered {status} {data[:300]!r}")
            self.model.settle(change, status != 503)
        return status != 503

    def fill_collection(self):
        for name in self.collections()[:1]:
            data = self.new_image()
            self.put((name, f"p{self.dice.randrange(4)}"), data,
                     State(sha256(data), "thing", json.dumps({"life": self.model.life})))

    def drop_collection(self):
        """With all its images, as a whole."""
        for name in self.collections()[:1]:
            keys = [(name, ""), *self.model.live(name)]
            if self.change("DELETE collection", f"/v1/collections/{name}", dict.fromkeys(keys), {204}):
                self.model.report.count("deletes", len(keys))

    def remove_imported(self):
        """All images of one object of an import that has ended."""
        pending = {state.object for states in [self.model.maybe, *self.book.folders.values()]
                   for state in list(states.values())}
        objects = sorted({state.object for state in self.model.live().values() if state.object.startswith("f")} - pending)
        if objects:
            name = self.dice.choice(objects)
            keys = [key for key, state in self.model.live().items() if state.object == name]
            if self.change("DELETE object", f"/v1/collections/default/objects/{name}", dict.fromkeys(keys), {200}):
                self.model.report.count("deletes", len(keys))
