# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""One client: changes images and objects of its own, and looks at what it has changed."""
import http.client
import json
import random
import threading
import time
import urllib.parse

from kill.model import State
from service.images import sha256, texture
from service.server import Connection, Wrong

IMAGES = "/v1/collections/default/images"
SEARCH = "/v1/collections/default/search?group_by=image&limit=100"
OWN_IDS = 10
OWN_OBJECTS = 3
GENERATED = 4  # most images of its own without an id of its own
SHARED = [f"shared {number}" for number in range(6)]  # textures that all clients store under ids of their own
# A descriptor that several images have becomes a word itself, and `neighbours` counts only what is nearer than the word.
SHARED_HASHES = {sha256(texture(name)) for name in SHARED}
HONEST = {"busy", "starting", "stopping"}
MERGE_PATCH = "application/merge-patch+json"


def image_path(key):
    return f"/v1/collections/{key[0]}/images/{urllib.parse.quote(key[1])}"


def state_of(record):
    return State(record["sha256"], record["object"], json.dumps(record["metadata"], sort_keys=True))


def search_path(state):
    """A search that finds the image of this state by itself."""
    return SEARCH + ("&rank=histogram" if state.sha256 in SHARED_HASHES else "")


class Client(threading.Thread):
    """Runs until the server is gone. Its choices depend on the seed of `dice` alone."""

    def __init__(self, number, model, address, dice, keep_alive):
        super().__init__(daemon=True)
        self.number, self.model, self.dice = number, model, random.Random(dice)
        self.name_of_life = dice
        self.connection = Connection(address, keep_alive)
        self.stopped, self.failed_at, self.failure = False, None, None
        self.done, self.made = 0, 0

    def run(self):
        try:
            while not self.stopped:
                self.act()
                self.done += 1
        except (OSError, http.client.HTTPException) as error:
            self.failed_at, self.failure = time.monotonic(), repr(error)
        except Wrong as wrong:
            self.model.report.add("other", f"client {self.number}: {wrong}")
        except Exception as error:  # a defect of the test must not look like a quiet client
            self.model.report.add("other", f"client {self.number}: defect of the test: {error!r}")
        self.connection.close()

    def act(self):
        acts = {self.put_new: 30, self.put_shared: 12, self.relabel: 8, self.patch: 8, self.rename: 4, self.post: 8,
                self.delete: 12, self.delete_object: 4, self.look: 8, self.search: 9, self.page: 3}
        self.dice.choices(list(acts), list(acts.values()))[0]()

    # What it chooses.

    def new_image(self):
        self.made += 1
        return texture(f"{self.name_of_life} {self.made}")

    def own_key(self):
        return "default", f"c{self.number}-{self.dice.randrange(OWN_IDS)}"

    def own_object(self):
        return f"o{self.number}-{self.dice.randrange(OWN_OBJECTS)}" if self.dice.random() < 0.9 else ""

    def own_metadata(self):
        return json.dumps({"life": self.model.life, "note": self.dice.randrange(1000)}, sort_keys=True)

    def own(self):
        """Live images of this client."""
        mine = f"c{self.number}-", f"o{self.number}-"
        return {key: state for key, state in self.model.live().items()
                if key[1].startswith(mine[0]) or state.object.startswith(mine[1])}

    def own_live_key(self):
        return self.dice.choice(sorted(self.own()) or [self.own_key()])

    # How it changes something.

    def ask(self, method, path, body=None, kind="application/octet-stream"):
        status, data = self.connection.ask(method, path, body, kind)
        if status == 503:
            code = json.loads(data)["code"]
            if code not in HONEST:
                raise Wrong(f"{method} {path} was answered 503 {code}")
            time.sleep(0.05)
        return status, data

    def change(self, what, path, after, expected, body=None, kind="application/octet-stream"):
        """True when it was acknowledged."""
        method = what.split()[0]
        with self.model.change(f"client {self.number} {what}", after) as change:
            status, data = self.ask(method, path, body, kind)
            if status == 503:
                self.model.settle(change, False)
                return False
            if status not in expected:
                raise Wrong(f"{method} {path} was answered {status} {data[:300]!r}, not {expected}; "
                            + " / ".join(line for key in after for line in self.model.history[key]))
            if what in ("PUT", "POST", "PATCH") and len(after) == 1:
                (key, state), = after.items()
                record = json.loads(data)
                if (record["id"], state_of(record)) != (key[1], state):
                    raise Wrong(f"{method} {path} answered {record}, not {state}")
            if method == "DELETE" and status == 200 and json.loads(data)["deleted"] != len(after):
                raise Wrong(f"{method} {path} answered {data[:300]!r}, not {len(after)} images")
            self.model.settle(change, True)
        return True

    def put(self, key, data, label=None):
        before = self.model.known.get(key)
        state = label or State(sha256(data), self.own_object(), self.own_metadata())
        query = urllib.parse.urlencode({"object": state.object, "metadata": state.metadata})
        if self.change("PUT", f"{image_path(key)}?{query}", {key: state}, {200 if before else 201}, data):
            self.model.report.count("replaces" if before else "uploads")

    # The acts.

    def put_new(self):
        self.put(self.own_key(), self.new_image())

    def put_shared(self):
        self.put(self.own_key(), texture(self.dice.choice(SHARED)))

    def relabel(self):
        """The same bytes with another object and other metadata: no work but a replace."""
        key = self.own_live_key()
        state = self.model.known.get(key)
        if state is None:
            return self.put_new()
        status, data = self.ask("GET", image_path(key) + "/content")
        if status == 503:
            return None
        if status != 200 or sha256(data) != state.sha256:
            raise Wrong(f"content of {key} was answered {status}, {sha256(data)} instead of {state}")
        named = f"o{self.number}-{self.dice.randrange(OWN_OBJECTS)}"
        return self.put(key, data, State(state.sha256, named, self.own_metadata()))

    def patch(self):
        """Another name, other metadata, or both, in place."""
        key = self.own_live_key()
        before = self.model.known.get(key)
        if before is None:
            return
        state, patch = before, {}
        if self.dice.random() < 0.7:
            state = state._replace(object=self.own_object())
            patch["object"] = state.object or None
        if not patch or self.dice.random() < 0.5:
            state = state._replace(metadata=self.own_metadata())
            patch["metadata"] = json.loads(state.metadata)
        if self.change("PATCH", image_path(key), {key: state}, {200}, json.dumps(patch).encode(), MERGE_PATCH):
            self.model.report.count("replaces")

    def rename(self):
        """All images of an object go to another one, or none."""
        old, new = (f"o{self.number}-{number}" for number in self.dice.sample(range(OWN_OBJECTS), 2))
        after = {key: state._replace(object=new) for key, state in self.own().items() if state.object == old}
        path = f"/v1/collections/default/objects/{old}?merge=true"
        body = json.dumps({"object": new}).encode()
        if after and self.change("PATCH object", path, after, {200}, body, MERGE_PATCH):
            self.model.report.count("replaces", len(after))

    def post(self):
        """Without an id: it is made from the bytes."""
        if sum(not key[1].startswith("c") or "-" not in key[1] for key in self.own()) >= GENERATED:
            return self.delete()
        data = self.new_image()
        state = State(sha256(data), f"o{self.number}-0", self.own_metadata())
        query = urllib.parse.urlencode({"object": state.object, "metadata": state.metadata})
        key = "default", state.sha256[:32]
        if self.change("POST", f"{IMAGES}?{query}", {key: state}, {201}, data):
            self.model.report.count("uploads")
        return None

    def delete(self):
        key = self.own_live_key()
        before = self.model.known.get(key)
        if self.change("DELETE", image_path(key), {key: None}, {204 if before else 404}) and before:
            self.model.report.count("deletes")

    def delete_object(self):
        """All images of an object, or none."""
        name = f"o{self.number}-{self.dice.randrange(OWN_OBJECTS)}"
        keys = [key for key, state in self.own().items() if state.object == name]
        if keys and self.change("DELETE object", f"/v1/collections/default/objects/{name}", dict.fromkeys(keys), {200}):
            self.model.report.count("deletes", len(keys))

    def look(self):
        key = self.own_live_key()
        state = self.model.known.get(key)
        status, data = self.ask("GET", image_path(key))
        if status != 503 and (state_of(json.loads(data)) if status == 200 else None) != state:
            raise Wrong(f"GET {key} was answered {status} {data[:300]!r}, known is {state}")

    def search(self):
        key = self.own_live_key()
        state = self.model.known.get(key)
        if state is None:
            return
        status, data = self.connection.json("POST", search_path(state), {"image_id": key[1], "exclude_self": False})
        if status == 503 or (status == 409 and data["code"] == "no_vocabulary" and not self.model.has_vocabulary):
            return
        if status != 200:
            raise Wrong(f"a search with {key} was answered {status} {data}")
        if key[1] not in [hit["image_id"] for hit in data["hits"]]:
            raise Wrong(f"a search with {key} does not find it: {data}")

    def page(self):
        status, data = self.connection.json("GET", f"{IMAGES}?limit=7&object=o{self.number}-0")
        wanted = sorted(key[1] for key, state in self.own().items() if state.object == f"o{self.number}-0")
        if status == 200 and [image["id"] for image in data["images"]] != wanted[:7]:
            raise Wrong(f"the list of object o{self.number}-0 is {data}, not {wanted[:7]}")
