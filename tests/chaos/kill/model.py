# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""What the server must hold: the acknowledged changes, and both outcomes of those without an answer.

A key is (collection, id of the image); (collection, "") stands for the collection itself. Thread-safe.
"""
import collections
import contextlib
import dataclasses
import threading

State = collections.namedtuple("State", "sha256 object metadata")  # metadata: JSON with sorted keys
EXISTS = State("collection", "", "{}")
HISTORY = 40  # lines kept of each key


@dataclasses.dataclass
class Change:
    """One change of some keys, which happens as a whole or not at all."""
    what: str
    before: dict
    after: dict


@dataclasses.dataclass
class Figures:
    kills: int = 0
    uploads: int = 0
    replaces: int = 0
    deletes: int = 0
    jobs: int = 0
    unanswered: int = 0
    lost: int = 0
    back: int = 0
    mixtures: int = 0
    other: int = 0


class Report:
    """Counts, and collects what is wrong."""

    def __init__(self):
        self.figures, self.wrong, self.kinds = Figures(), [], collections.Counter()
        self.lock = threading.Lock()

    def count(self, name, number=1):
        with self.lock:
            setattr(self.figures, name, getattr(self.figures, name) + number)

    def add(self, kind, text, history=()):
        """`kind`: lost, back, mixtures or other."""
        self.count(kind)
        with self.lock:
            self.wrong.append(f"{kind}: {text}" + "".join(f"\n    {line}" for line in history))


class Model:
    def __init__(self, report):
        self.report, self.lock = report, threading.RLock()
        self.known = {("default", ""): EXISTS}  # key: State, or None = acknowledged to be gone
        self.past = collections.defaultdict(set)  # key: the states it had
        self.maybe = {}  # key: State that a background job or another program may add at any time
        self.unsure = []  # changes without an answer
        self.versions = collections.Counter()  # key: how often it was about to change
        self.history = collections.defaultdict(lambda: collections.deque(maxlen=HISTORY))
        self.touched = set()  # keys to be looked at in depth after the next start
        self.life = 0
        self.has_vocabulary = False  # one was seen
        self.opaque = set()  # collections whose images the server makes itself

    def note(self, keys, text):
        for key in keys:
            self.history[key].append(f"life {self.life}: {text}")

    def live(self, collection="default"):
        with self.lock:
            return {key: state for key, state in self.known.items()
                    if state is not None and key[0] == collection and key[1]}

    @contextlib.contextmanager
    def change(self, what, after):
        """The change is open until `settle` says what was answered; an error leaves it open."""
        with self.lock:
            change = Change(what, {key: self.known.get(key) for key in after}, dict(after))
            self.versions.update(after.keys())
            self.unsure.append(change)
            self.touched.update(after)
            self.note(after, f"{what} begins, {self.brief(after)}")
        try:
            yield change
        except BaseException as error:
            with self.lock:
                self.note(after, f"{what} has no answer ({type(error).__name__})")
            self.report.count("unanswered")
            raise

    @staticmethod
    def brief(states):
        return "; ".join(f"{key[1]} -> {state and (state.sha256[:8], state.object, state.metadata)}"
                         for key, state in list(states.items())[:4])

    def settle(self, change, done):
        """`done`: it was acknowledged; else it was refused, and all is as before."""
        with self.lock:
            self.unsure.remove(change)
            self.note(change.after, f"{change.what} {'acknowledged' if done else 'refused'}")
            if done:
                self.adopt(change.after)

    def adopt(self, states):
        with self.lock:
            for key, state in states.items():
                if self.known.get(key) is not None:
                    self.past[key].add(self.known[key])
                self.known[key] = state
                self.maybe.pop(key, None)

    def expect(self, states):
        """A background job or another program begins to add these."""
        with self.lock:
            self.maybe.update(states)
            self.touched.update(states)
            self.note(states, "may be added from now on")

    # After a start, while no client is there.

    def settle_by(self, actual):
        """Settles changes without an answer, and late additions, by what is there."""
        with self.lock:
            for change in self.unsure:
                found = {key: actual.get(key) for key in change.after}
                if found in (change.before, change.after):
                    self.note(change.after, f"{change.what} turned out {'done' if found == change.after else 'not done'}")
                    self.adopt(found)
                    continue
                for key in change.after:
                    self.blame(key, found[key], f"neither before nor after {change.what}")
                    self.adopt({key: found[key]})
            self.unsure = []
            for key, state in list(self.maybe.items()):
                if actual.get(key) is None:
                    continue
                if actual[key] != state:
                    self.blame(key, actual[key], "added by a job, but otherwise")
                self.adopt({key: actual[key]})

    def compare(self, actual):
        """Reports every difference between what is there and what was acknowledged."""
        with self.lock:
            for key in set(self.known) | set(actual):
                if self.known.get(key) != actual.get(key):
                    self.blame(key, actual.get(key), "acknowledged otherwise")
                    self.known[key] = actual.get(key)

    def blame(self, key, found, why):
        wanted = self.known.get(key)
        if found is None:
            kind = "lost"
        elif wanted is None:
            kind = "back" if found in self.past[key] else "mixtures" if self.past[key] else "other"
        else:
            kind = "lost" if found in self.past[key] else "mixtures"
        self.report.add(kind, f"{key}: {why}: is {found}, known {wanted}", self.history[key])
