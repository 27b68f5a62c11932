# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""What the server promises of background jobs, and what was seen of each.

A job that was accepted is never forgotten, one that has ended stays as it ended, one that was cancelled does not
begin again, a backup begins once, everything else at most three times.
"""
import collections
import dataclasses

from kill.model import State

ENDED = {"done", "failed", "cancelled"}
MOST_ATTEMPTS = 3
AUTOMATIC = "automatic"  # the mark of trainings that the server starts on its own
# Failures that are the job's own fault.
HONEST_FAILURES = {"train": {"no_images", "invalid_parameter", "words_invalid", "collection_not_found"},
                   "activate": {"vocabulary_not_found", "collection_not_found"}}


@dataclasses.dataclass
class Job:
    kind: str
    mark: object  # names it among all jobs of its kind: folder, name or seed
    stops: int = 0  # SIGTERMs during its life, each of which forgives an attempt
    cancelled: bool = False
    seen: dict = dataclasses.field(default_factory=lambda: {"state": "queued", "attempts": 0})

    @property
    def ended(self):
        return self.seen["state"] in ENDED


def mark_of(kind, parameters):
    return {"train": parameters.get("seed"), "backup": parameters.get("name"), "import": parameters.get("folder"),
            "activate": parameters.get("vocabulary")}.get(kind)


class JobBook:
    """Locked by the model's lock."""

    def __init__(self, model, auto_train):
        self.model, self.report, self.auto_train = model, model.report, auto_train
        self.jobs = {}  # id: Job
        self.unsure = []  # (kind, mark) of requests without an answer
        self.folders = {}  # folder: {key: State} of imports that have not ended
        self.backups = {}  # name: {key: (version, State)} as it was when asked for
        self.made = {}  # seed: vocabulary that a training is known to have made
        self.active = None  # the vocabulary that must be active; None: not known

    def accepted(self, kind, mark, document):
        with self.model.lock:
            self.jobs[document["id"]] = Job(kind, mark)
            self.report.count("jobs")
            self.see(document)

    def complain(self, text):
        self.report.add("other", text)

    def see(self, document):
        """What the server says of one job that is known."""
        with self.model.lock:
            job = self.jobs[document["id"]]
            before, name = job.seen, f"job {document['id']} ({job.kind} {job.mark})"
            if job.ended:
                for field in ("state", "attempts", "finished_at", "result"):
                    if document.get(field) != before.get(field):
                        self.complain(f"{name} had ended: {field} was {before.get(field)}, is {document.get(field)}")
            job.seen = document
            most = 1 if job.kind == "backup" else MOST_ATTEMPTS
            if document["attempts"] > most:
                self.complain(f"{name} began {document['attempts']} times: {document}")
            if document["state"] == "failed" and document["problem"]["code"] not in HONEST_FAILURES.get(job.kind, ()):
                if document["problem"]["code"] != "interrupted" or document["attempts"] < most:
                    self.complain(f"{name} failed: {document}")
            if job.ended and before["state"] not in ENDED:
                self.on_end(job)

    def on_end(self, job):
        if job.kind == "import":
            states = self.folders.pop(job.mark)
            if job.seen["state"] == "done":
                self.model.adopt(states)
                if job.seen["failed"]:
                    self.complain(f"the import {job.mark} left something out: {job.seen}")
        elif job.kind == "train" and job.seen["state"] == "done" and job.seen["collection"] == "default":
            self.made[job.mark] = int(job.seen["result"].rsplit("/", 1)[1])
            self.model.has_vocabulary = True

    def settle_by(self, listed):
        """After a start: `listed` is GET /v1/jobs."""
        with self.model.lock:
            there = {document["id"]: document for document in listed}
            for missing in set(self.jobs) - set(there):
                self.report.add("lost", f"job {missing} {self.jobs.pop(missing)} was accepted and is not listed")
            for number, document in there.items():
                if number not in self.jobs:
                    self.settle_new(number, document)
                self.see(document)
                job = self.jobs[number]
                if job.cancelled and not job.ended:
                    self.complain(f"job {number} ({job.kind}) was cancelled, and begins again: {document}")
            for kind, mark in self.unsure:  # those that were not accepted
                if kind == "import" and mark in self.folders:
                    self.drop_folder(mark)
            self.unsure = []
            running = collections.Counter(document["kind"] for document in listed if document["state"] == "running")
            asked_for = collections.Counter((job.kind, job.mark) for job in self.jobs.values()
                                            if job.kind != "activate" and job.mark != AUTOMATIC)
            for what, number in [*running.items(), *asked_for.items()]:
                if number > 1:
                    self.complain(f"{what}: {number} jobs instead of one: {listed}")

    def settle_new(self, number, document):
        kind, mark = document["kind"], mark_of(document["kind"], document["parameters"])
        if document["parameters"].get("automatic", False):
            mark = AUTOMATIC
        elif (kind, mark) in self.unsure:
            self.unsure.remove((kind, mark))
        else:
            self.report.add("other", f"job from nowhere: {document}")
            self.folders.setdefault(mark, {})
        self.jobs[number] = Job(kind, mark)

    def drop_folder(self, folder):
        for key in self.folders.pop(folder):
            self.model.maybe.pop(key, None)

    def active_jobs(self, *kinds):
        with self.model.lock:
            return [number for number, job in self.jobs.items() if not job.ended and (not kinds or job.kind in kinds)]

    def settle_vocabularies(self, vocabularies):
        """After a start: each training has made as many as it may have, and the active one is the right one."""
        with self.model.lock:
            numbers = {vocabulary["id"] for vocabulary in vocabularies}
            self.model.has_vocabulary = self.model.has_vocabulary or bool(numbers)
            for seed, number in self.made.items():
                if number not in numbers and seed != AUTOMATIC:
                    self.report.add("lost", f"vocabulary {number} of the training with seed {seed}: {vocabularies}")
            seeds = collections.Counter(vocabulary["seed"] for vocabulary in vocabularies)
            for job in self.jobs.values():
                if job.kind == "train" and job.mark != AUTOMATIC:
                    if seeds[job.mark] > job.seen["attempts"] + job.stops:
                        self.complain(f"{seeds[job.mark]} vocabularies of one training: {job}")
            active = [vocabulary["id"] for vocabulary in vocabularies if vocabulary["active"]]
            if self.active is not None and not self.auto_train and active != [self.active]:
                self.report.add("lost", f"vocabulary {self.active} was active, now {active}")
            steady = not self.auto_train and not self.active_jobs("train", "activate")
            self.active = active[0] if active and steady else None

    def snapshot(self):
        """Images that nobody is changing, and which version of each."""
        with self.model.lock:
            open_keys = {key for change in self.model.unsure for key in change.after}
            return {key: (self.model.versions[key], state) for key, state in self.model.live().items()
                    if key not in open_keys}


def import_states(written):
    """What an import of images.write_folder adds."""
    return {("default", sha[:32]): State(sha, named, "{}") for sha, named in written.items()}
