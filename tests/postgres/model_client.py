# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Clients of several servers, and what each of their images may be by what was acknowledged."""
import collections
import http.client
import json
import random
import threading
import time
import urllib.parse

from service.images import sha256, texture
from service.server import Connection

COLLECTION = "/v1/collections/default"
IMAGES = f"{COLLECTION}/images"
SEARCH = f"{COLLECTION}/search?group_by=image&limit=5"
IDS = 4  # of each client
PAIRS = 2  # of each client
HISTORY = 12
REFUSED = (503, 507)
DEADLINE_S = 20  # of a request; a ranking in parts has 5
REFUSED_S = 0.05  # the clients leave the processors to what comes back


class Book:
    """What is wrong, and what was counted. Thread-safe."""

    def __init__(self):
        self.lock, self.figures, self.wrong = threading.Lock(), collections.Counter(), []
        self.well_from, self.stopped = time.monotonic(), None  # the databases are well; the server that is stopped

    def count(self, what):
        with self.lock:
            self.figures[what] += 1

    def most(self, what, number):
        with self.lock:
            self.figures[what] = max(self.figures[what], number)

    def blame(self, text, history=()):
        with self.lock:
            self.wrong.append("\n    ".join([f"{time.strftime('%H:%M:%S')} {text}", *history]))


class History:
    def __init__(self, name):
        self.name, self.history = name, collections.deque(maxlen=HISTORY)

    def note(self, text):
        self.history.append(f"{time.strftime('%H:%M:%S')} {text}")


class Image(History):
    """One id: the hashes that it may have now (None: it is not there)."""

    def __init__(self, name):
        super().__init__(name)
        self.may, self.data = {None}, {}  # data: bytes by hash


class Pair(History):
    """Two images of one object, which go in one request. Others read `state` while the owner changes it: its parts are
    replaced together. They are how many images there may be, and whether since `filled` only whole pairs came or went."""

    def __init__(self, name):
        super().__init__(name)
        self.ids, self.filled, self.state = (f"{name}-0", f"{name}-1"), 0, (frozenset({0}), True)


class Client(threading.Thread):
    def __init__(self, number, servers, book, dice):
        super().__init__(daemon=True)
        self.number, self.servers, self.book, self.dice = number, servers, book, random.Random(dice)
        self.images = [Image(f"c{number}-{i}") for i in range(IDS)]
        self.pairs = [Pair(f"c{number}-pair-{i}") for i in range(PAIRS)]
        self.seen_pairs = self.pairs  # those of all clients
        self.made, self.stopped = 0, False

    def run(self):
        works = {self.put: 4, self.delete: 2, self.look: 3, self.search: 5, self.fill: 2, self.empty: 2, self.look_at_pair: 4}
        try:
            while not self.stopped:
                work = self.dice.choices([*works], [*works.values()])[0]
                if work in (self.fill, self.empty):
                    work(self.dice.choice(self.pairs))
                else:
                    work(self.dice.choice(self.seen_pairs if work == self.look_at_pair else self.images))
        except Exception as error:  # a defect of the test must not look like a quiet client
            self.book.blame(f"client {self.number}: defect of the test: {error!r}")

    def ask(self, method, path, body=None, kind="application/octet-stream"):
        """(status, JSON); status 0: no whole answer."""
        address, begun = self.dice.choice(self.servers).address, time.monotonic()
        was_well = begun > self.book.well_from and address != self.book.stopped
        connection = Connection(address, keep_alive=False)
        try:
            status, data = connection.ask(method, path, body, kind)
            answer = json.loads(data) if data else {}
        except TimeoutError:
            self.book.blame(f"{method} {path}: no answer in {time.monotonic() - begun:.0f} s")
            return 0, {}
        except (OSError, http.client.HTTPException):  # a killed server
            status, answer = 0, {}
        finally:
            connection.close()
        self.book.count(f"{method} {status or 'no answer'}")
        self.book.most(f"seconds for an answer at most ({'write' if method in ('PUT', 'DELETE') else 'read'})", round(time.monotonic() - begun))
        took = time.monotonic() - begun
        if was_well and time.monotonic() > self.book.well_from and address != self.book.stopped:
            self.book.most("seconds for an answer at most, all well but other servers", round(took, 1))
            if answer.get("code") == "part_unavailable" or took > DEADLINE_S:
                self.book.blame(f"{method} {path}: {status} {answer.get('code')} after {took:.1f} s, though only another server was in trouble")
        if status in REFUSED:
            self.book.count(f"refused: {answer.get('code')}")
            time.sleep(REFUSED_S)
        if status >= 400 and status not in (404, *REFUSED):
            self.book.blame(f"{method} {path}: {status} {answer}")
        if status == 503 and not connection.headers.get("Retry-After"):
            self.book.blame(f"{method} {path}: 503 without Retry-After: {answer}")
        return status, answer

    def new_texture(self):
        self.made += 1
        return texture(f"client {self.number} {self.made}")

    def put(self, image):
        data = self.new_texture()
        mine = sha256(data)
        image.data[mine] = data
        image.note(f"put {mine[:8]}")
        before, image.may = image.may, image.may | {mine}
        status, answer = self.ask("PUT", f"{IMAGES}/{image.name}?object={image.name}", data, "image/png")
        image.note(f"-> {status} {answer.get('code', '')}")
        if status in (200, 201):
            image.may = {mine}
        elif was_not_done(status, answer):
            image.may = before
        elif status == 404:
            self.book.blame(f"PUT {image.name}: {status} {answer}", image.history)

    def delete(self, image):
        image.note("delete")
        before, image.may = image.may, image.may | {None}
        status, answer = self.ask("DELETE", f"{IMAGES}/{image.name}")
        image.note(f"-> {status} {answer.get('code', '')}")
        if status == 404 and None not in before:
            self.book.blame(f"{image.name} was lost: DELETE says 404", image.history)
        if status == 204 and before == {None}:
            self.book.blame(f"{image.name} was back: DELETE says 204", image.history)
        if status in (204, 404):
            image.may = {None}
        elif was_not_done(status, answer):
            image.may = before

    def look(self, image):
        status, record = self.ask("GET", f"{IMAGES}/{image.name}")
        if status not in (200, 404):
            return
        found = record["sha256"] if status == 200 else None
        self.book.count("looks that agree" if found in image.may else "looks that do not")
        if found not in image.may:
            self.book.blame(f"{image.name} is {found and found[:8]}, may be {[one and one[:8] for one in image.may]}", image.history)

    def search(self, image):
        if not image.data:
            return
        if len(image.may) > 1:
            return self.look(image)
        now = next(iter(image.may))
        asked = now or self.dice.choice(list(image.data))
        status, answer = self.ask("POST", SEARCH, image.data[asked], "image/png")
        if status != 200:
            return
        hits = [hit["image_id"] for hit in answer["hits"]]
        agrees = image.name in hits[:1] if now else image.name not in hits
        self.book.count("searches that agree" if agrees else "searches that do not")
        if now and image.name not in hits[:1]:
            self.book.blame(f"{image.name} ({now[:8]}) is not found: {hits}", image.history)
        if not now and image.name in hits:
            self.book.blame(f"{image.name} is deleted, and found", image.history)

    def fill(self, pair):
        """Puts both images, one after the other."""
        pair.filled += 1
        pair.state = frozenset({0, 1, 2}), False
        pair.note("fill")
        query = urllib.parse.urlencode({"object": pair.name, "metadata": json.dumps({"pair": pair.name})})
        status = [self.ask("PUT", f"{IMAGES}/{one}?{query}", self.new_texture(), "image/png")[0] for one in pair.ids]
        pair.note(f"-> {status}")
        if all(one in (200, 201) for one in status):
            pair.state = frozenset({2}), True

    def empty(self, pair):
        """Removes both in one request, by their object or by their metadata."""
        before, whole = pair.state
        if not whole:
            return
        which = self.dice.choice([f"{COLLECTION}/objects/{pair.name}",
                                  f"{IMAGES}?{urllib.parse.urlencode({'filter': json.dumps({'pair': pair.name})})}"])
        pair.state = before | {0}, True
        pair.note(f"delete {which}")
        status, answer = self.ask("DELETE", which)
        pair.note(f"-> {status} {answer}")
        if status in (200, 404):
            pair.state = frozenset({0}), True
            if answer.get("deleted", 0) not in before:
                self.book.blame(f"{pair.name} had {sorted(before)} images, DELETE says {status} {answer}", pair.history)
        elif was_not_done(status, answer):
            pair.state = before, True

    def look_at_pair(self, pair):
        """Any client's: there are both or none, also while somebody removes them."""
        filled, (before, whole) = pair.filled, pair.state
        status, answer = self.ask("GET", f"{IMAGES}?{urllib.parse.urlencode({'object': pair.name})}")
        (after, still_whole), refilled = pair.state, pair.filled
        if status not in (200, 404) or not whole or not still_whole or filled != refilled:
            return
        found = len(answer.get("images", []))
        agrees = found in before | after
        self.book.count("looks at pairs that agree" if agrees else "looks at pairs that do not")
        if not agrees:
            self.book.blame(f"{pair.name} has {found} images, may have {sorted(before | after)}", list(pair.history))


def was_not_done(status, answer):
    """Every refusal but one says that nothing has changed."""
    return status in REFUSED and answer.get("code") != "database_outcome_unknown"
