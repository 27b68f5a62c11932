# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Clients of several servers, and what each of their pictures may be by what was acknowledged."""
import collections
import http.client
import json
import random
import threading
import time

from service.pictures import sha256, texture
from service.server import Connection

IMAGES = "/v1/collections/default/images"
SEARCH = "/v1/collections/default/search?group_by=image&limit=5"
IDS = 5  # of each client
HISTORY = 12


class Book:
    """What is wrong, and what was counted. Thread-safe."""

    def __init__(self):
        self.lock, self.figures, self.wrong = threading.Lock(), collections.Counter(), []

    def count(self, what):
        with self.lock:
            self.figures[what] += 1

    def most(self, what, number):
        with self.lock:
            self.figures[what] = max(self.figures[what], number)

    def blame(self, text, history=()):
        with self.lock:
            self.wrong.append("\n    ".join([text, *history]))


class Picture:
    """One id: the hashes that it may have now (None: it is not there)."""

    def __init__(self, name):
        self.name, self.may, self.data = name, {None}, {}  # data: bytes by hash
        self.history = collections.deque(maxlen=HISTORY)

    def note(self, text):
        self.history.append(f"{time.strftime('%H:%M:%S')} {text}")


class Client(threading.Thread):
    def __init__(self, number, servers, book, dice):
        super().__init__(daemon=True)
        self.number, self.servers, self.book, self.dice = number, servers, book, random.Random(dice)
        self.pictures = [Picture(f"c{number}-{i}") for i in range(IDS)]
        self.made, self.stopped = 0, False

    def run(self):
        try:
            while not self.stopped:
                self.dice.choices([self.put, self.delete, self.look, self.search], [4, 2, 3, 5])[0](self.dice.choice(self.pictures))
        except Exception as error:  # a defect of the test must not look like a quiet client
            self.book.blame(f"client {self.number}: defect of the test: {error!r}")

    def ask(self, method, path, body=None, kind="application/octet-stream"):
        """(status, JSON); status 0: no whole answer."""
        connection = Connection(self.dice.choice(self.servers).address, keep_alive=False)
        try:
            status, data = connection.ask(method, path, body, kind)
            answer = json.loads(data) if data else {}
        except (OSError, http.client.HTTPException):
            return 0, {}
        finally:
            connection.close()
        if status >= 500 and status not in (503, 507):
            self.book.blame(f"{method} {path}: {status} {answer}")
        self.book.count(f"{method} {status or 'no answer'}")
        return status, answer

    def put(self, picture):
        self.made += 1
        data = texture(f"client {self.number} {self.made}")
        mine = sha256(data)
        picture.data[mine] = data
        picture.note(f"put {mine[:8]}")
        before, picture.may = picture.may, picture.may | {mine}
        status, answer = self.ask("PUT", f"{IMAGES}/{picture.name}?object={picture.name}", data, "image/png")
        picture.note(f"-> {status}")
        if status in (200, 201):
            picture.may = {mine}
        elif 400 <= status < 500:
            self.book.blame(f"PUT {picture.name}: {status} {answer}", picture.history)
            picture.may = before

    def delete(self, picture):
        picture.note("delete")
        before, picture.may = picture.may, picture.may | {None}
        status, _ = self.ask("DELETE", f"{IMAGES}/{picture.name}")
        picture.note(f"-> {status}")
        if status == 404 and None not in before:
            self.book.blame(f"{picture.name} was lost: DELETE says 404", picture.history)
        if status == 204 and before == {None}:
            self.book.blame(f"{picture.name} was back: DELETE says 204", picture.history)
        if status in (204, 404):
            picture.may = {None}

    def look(self, picture):
        status, record = self.ask("GET", f"{IMAGES}/{picture.name}")
        if status not in (200, 404):
            return
        found = record["sha256"] if status == 200 else None
        self.book.count("looks that agree" if found in picture.may else "looks that do not")
        if found not in picture.may:
            self.book.blame(f"{picture.name} is {found and found[:8]}, may be {[one and one[:8] for one in picture.may]}", picture.history)

    def search(self, picture):
        if not picture.data:
            return
        if len(picture.may) > 1:
            return self.look(picture)
        now = next(iter(picture.may))
        asked = now or self.dice.choice(list(picture.data))
        status, answer = self.ask("POST", SEARCH, picture.data[asked], "image/png")
        if status != 200:
            return
        hits = [hit["image_id"] for hit in answer["hits"]]
        agrees = picture.name in hits[:1] if now else picture.name not in hits
        self.book.count("searches that agree" if agrees else "searches that do not")
        if now and picture.name not in hits[:1]:
            self.book.blame(f"{picture.name} ({now[:8]}) is not found: {hits}", picture.history)
        if not now and picture.name in hits:
            self.book.blame(f"{picture.name} is deleted, and found", picture.history)
