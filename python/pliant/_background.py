# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""What a server does in the background: jobs, training, many images at once. Private; see pliant.client."""
from __future__ import annotations

import json
import os
import time
from typing import Any, Callable, Iterator

from pliant import _bodies, _problems
from pliant._bodies import Json
from pliant._transport import Transport, segment
from pliant.errors import UnavailableError

_LONGEST_S = 30.0   # that one request waits for the end of a job
_HEARD_S = 1.0      # the same where somebody wants to hear how it goes on
_ITEMS = 500        # of a page


class Background:
    """These methods of Client."""

    _transport: Transport
    _base: str

    def train(self, *, wait: bool = True, timeout: float | None = None,
              progress: Callable[[Json], object] | None = None, **options: Any) -> Json:
        """Trains a vocabulary and uses it (options: words, sample, seed, activate). The job: when it is done, or, with
        `wait=False`, as it begins."""
        job = self._call("POST", f"{self._base}/vocabularies", body=json.dumps(options).encode(),
                         content_type="application/json")
        return self.wait(job["id"], timeout=timeout, progress=progress) if wait else job

    def vocabularies(self) -> list[Json]:
        """All of the collection."""
        return list(self._call("GET", f"{self._base}/vocabularies")["vocabularies"])

    def import_archive(self, path: str | os.PathLike[str], *, object_from: str | None = None, object: str | None = None,
                       metadata: Json | None = None, wait: bool = True, timeout: float | None = None,
                       progress: Callable[[Json], object] | None = None) -> Json:
        """Adds the images of a file: a TAR archive (.tar), whose folders name the objects (object_from: "auto",
        "folder", "stem" or "none"), or lines of JSON (.ndjson, .jsonl). It is sent as it is read, and may be larger than
        the memory. object and metadata: of all images that do not say otherwise.
        The job, as `train` gives it. `job_items` says what became of each image; one that is refused fails none of the
        others."""
        kind = _bodies.archive_type(path)
        parameters = _bodies.listing(object_from=object_from, object=object)
        if metadata:
            parameters["metadata"] = json.dumps(metadata, allow_nan=False)
        with open(path, "rb") as file:
            job = self._call("POST", f"{self._base}/images:import", parameters=parameters, body=file, content_type=kind)
        return self.wait(job["id"], timeout=timeout, progress=progress) if wait else job

    def jobs(self) -> list[Json]:
        """All jobs of the server, newest first."""
        return list(self._call("GET", "/v1/jobs")["jobs"])

    def job(self, id: str) -> Json:
        """Its state (queued, running, done, failed, cancelled), done, total and failed."""
        return self._call("GET", f"/v1/jobs/{segment('id', id)}")

    def job_items(self, id: str) -> Iterator[Json]:
        """What became of each image of an `import_archive`: status, and image_id or the problem."""
        parameters: Json = {"limit": _ITEMS}
        while True:
            page = self._call("GET", f"/v1/jobs/{segment('id', id)}/items", parameters=parameters)
            yield from page["items"]
            if page["next"] is None:
                return
            parameters["cursor"] = page["next"]

    def cancel(self, id: str) -> Json:
        """Asks a job to stop."""
        return self._call("DELETE", f"/v1/jobs/{segment('id', id)}")

    def wait(self, id: str, *, timeout: float | None = None, progress: Callable[[Json], object] | None = None) -> Json:
        """The job when it is done; `progress(job)` hears how it goes on, every second. Raises the job's error if it
        failed, CancelledError, and UnavailableError "timeout" after `timeout` seconds (the job goes on)."""
        end = None if timeout is None else time.monotonic() + timeout
        pause, patience = 0.05, 0.0
        while True:
            asked = time.monotonic()
            job = self._call("GET", f"/v1/jobs/{segment('id', id)}", parameters={"wait": f"{patience:.3f}"})
            if progress is not None:
                progress(job)
            if job["state"] == "done":
                return job
            if job["state"] in ("failed", "cancelled"):
                raise _problems.of_job(job)
            now = time.monotonic()
            left = None if end is None else end - now
            if left is not None and left <= 0:
                raise UnavailableError(f"job {id} is still {job['state']} after {timeout} s", code="timeout", problem=job)
            if patience and now - asked < patience:  # a server that does not wait is not asked all the time
                time.sleep(pause if left is None else min(pause, left))
                pause = min(2.0, pause * 1.5)
                left = None if end is None else max(0.0, end - time.monotonic())
            patience = _LONGEST_S if progress is None else _HEARD_S
            patience = patience if left is None else min(patience, left)

    def _call(self, method: str, path: str, **request: Any) -> Json:
        document: Json = self._transport.call(method, path, **request).document
        return document
