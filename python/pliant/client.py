# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""A client of pliant-server. It needs only Python's standard library, not the compiled library or NumPy.
server/reference/ describes routes, parameters and codes. Methods return the JSON of the server unchanged.
"""
from __future__ import annotations

import base64
import os
import ssl
import time
from typing import Any, Callable, Iterator, Mapping, Sequence, Union

from pliant import _checks, _transport
from pliant._transport import Transport, segment
from pliant.errors import ConnectionFailedError, Error, InvalidArgumentError, UnavailableError

#: A path, the bytes of a file, or an array of uint8, H x W or H x W x 3.
ImageLike = Union[str, "os.PathLike[str]", bytes, bytearray, memoryview, Any]
Json = dict[str, Any]

_ARCHIVES = {".tar": "application/x-tar", ".csv": "text/csv", ".ndjson": "application/x-ndjson", ".jsonl": "application/x-ndjson"}
_LONGEST_S = 30.0   # wait of one request for the end of a job
_HEARD_S = 1.0      # the same with a `progress` callback


class Client:
    """Talks to the server at `url` about one collection. Any number of threads can use it.

    key: an API key. collection: for all methods; `client.collection("shelf")` returns a client of another.
    timeout: seconds without a byte before a request fails. retries: how often the client repeats a request after 429,
    503 or a failed connection. With an Idempotency-Key the server executes `add` without an id, `train` and similar
    requests once. The client waits as long as `Retry-After` says. If that is more than `max_wait` seconds, it raises
    the error. context: for https with your own certificate.
    Failures raise the classes of `pliant.errors`, with the problem's code, title, detail and status.
    """

    def __init__(self, url: str = "http://127.0.0.1:8080", key: str | None = None, *, collection: str = "default",
                 timeout: float = 120.0, retries: int = 4, max_wait: float = 60.0,
                 context: ssl.SSLContext | None = None) -> None:
        self._transport = Transport(url, key, timeout, retries, max_wait, context)
        self._use(collection)

    def _use(self, collection: str) -> None:
        self.name = collection
        self._base = f"/v1/collections/{segment('collection', collection)}"

    def __repr__(self) -> str:
        return f"<pliant.Client {self._transport.address} collection {self.name!r}>"

    # Collections

    def collection(self, name: str) -> Client:
        """A client of another collection, with the same server and key."""
        other = object.__new__(Client)
        other._transport = self._transport
        other._use(name)
        return other

    def collections(self) -> list[Json]:
        """All collections by name, each as `info` returns it."""
        return list(self._ask("GET", "/v1/collections")["collections"])

    def create(self) -> Json:
        """Creates this client's collection; an existing one stays as it is."""
        return self._ask("PUT", self._base)

    def info(self) -> Json:
        """The collection's name, its numbers of images, objects and descriptors, and the vocabulary in use."""
        return self._ask("GET", self._base)

    def set_display_name(self, name: str | None) -> Json:
        """Sets the display name of this client's collection; None: back to its own name."""
        return self._patch(self._base, {"display_name": name})

    def set_found_from(self, probability: float | None) -> Json:
        """Sets from which probability on, 0.5 to 0.99, a hit of this client's collection is found; None: 0.9."""
        return self._patch(self._base, {"found_from": probability})

    def drop(self) -> None:
        """Deletes this client's collection with all its contents and its aliases."""
        self._ask("DELETE", self._base)

    def aliases(self) -> dict[str, str]:
        """All aliases, as a dict from alias to collection. `client.collection(alias)` accepts them too."""
        return {alias["name"]: alias["collection"] for alias in self._ask("GET", "/v1/aliases")["aliases"]}

    def set_aliases(self, changes: Mapping[str, str | None]) -> None:
        """Creates, moves and (None) removes aliases, all at once or none."""
        self._patch("/v1/aliases", dict(changes))

    # Images

    def add(self, image: ImageLike | None = None, *, image_url: str | None = None, object: str = "",
            id: str | None = None, metadata: Json | None = None, channels: str = "RGB") -> Json:
        """Adds an image and returns its record. With an id it replaces an existing image, and is safe to repeat.
        image_url, instead of image: an address from which the server fetches the image (if --fetch-hosts allows it)."""
        parameters = _given(object=object or None, metadata=metadata or None)
        path = f"{self._base}/images" + ("" if id is None else f"/{segment('id', id)}")
        return self._ask("POST" if id is None else "PUT", path, parameters=parameters,
                         **_image_body("add", image, image_url, channels))

    def get(self, id: str) -> Json:
        """An image's record. NotFoundError "image_not_found"."""
        return self._ask("GET", self._image(id))

    def etag(self, id: str) -> str:
        """The ETag of an image's current record, for `update(..., if_match=...)`."""
        return str(self._transport.call("GET", self._image(id)).headers["ETag"])

    def update(self, id: str, *, object: str | None = None, metadata: Json | None = None, source: str | None = None,
               collection: str | None = None, if_match: str | None = None) -> Json:
        """Changes an image's object, metadata or source without describing it again, and returns its record. Omitted
        values stay; object="" removes the object. metadata is merged key by key, and None removes a key. collection
        moves the image there; ConflictError "image_exists" if the other collection has an image with this id.
        if_match: an `etag`; ConflictError "precondition_failed" if the record has changed since."""
        changes = {"object": object, "metadata": metadata, "source": source, "collection": collection}
        if all(value is None for value in changes.values()):
            raise TypeError("nothing to change: give object, metadata, source or collection")
        return self._patch(self._image(id), {name: value for name, value in changes.items() if value is not None},
                           if_match=if_match)

    def content(self, id: str) -> bytes:
        """The bytes of an image as it was added."""
        return self._transport.call("GET", self._image(id) + "/content").body

    def thumbnail(self, id: str) -> bytes:
        """A JPEG, 320 pixels on the longer side."""
        return self._transport.call("GET", self._image(id) + "/thumbnail").body

    def features(self, id: str) -> Json:
        """Keypoints, and descriptors as base64."""
        return self._ask("GET", self._image(id) + "/features")

    def save_records(self, path: str | os.PathLike[str], object: str | None = None, *, filter: Json | None = None,
                     q: str | None = None) -> None:
        """Writes the records of the collection, or of the images that pass, to a file: a line of JSON each, or for a
        name in .csv, a table with id, object, file and labels, which `import_archive` accepts. One consistent snapshot,
        by ids. The file appears when it is complete."""
        form = "csv" if os.fsdecode(os.fspath(path)).lower().endswith(".csv") else None
        parameters = _given(object=object, filter=filter, q=q, format=form)
        _transport.download(self._transport, f"{self._base}/export", parameters, path)

    def save_features(self, path: str | os.PathLike[str], object: str | None = None, *, filter: Json | None = None,
                      q: str | None = None) -> None:
        """Writes the features of the collection, or of the images that pass, to an .npz file for
        `pliant.Features.load_folder` and `numpy.load`: one consistent snapshot, by ids. `objects` has the
        object of each image. The file appears when it is complete."""
        parameters = _given(object=object, filter=filter, q=q)
        _transport.download(self._transport, f"{self._base}/features", parameters, path)

    def delete(self, id: str) -> None:
        """Deletes an image permanently. NotFoundError if it does not exist, even if a repeated request deleted it."""
        self._ask("DELETE", self._image(id))

    def delete_object(self, object: str) -> int:
        """Deletes all images of an object, and returns their number."""
        return int(self._ask("DELETE", self._object(object))["deleted"])

    def rename_object(self, object: str, name: str, *, merge: bool = False) -> Json:
        """Renames an object with all its images. If the name is taken: ConflictError "object_exists", or with
        merge=True, both objects become one."""
        return self._patch(self._object(object), {"object": name}, parameters={"merge": "true"} if merge else None)

    def move_object(self, object: str, collection: str, *, merge: bool = False) -> Json:
        """Moves an object with all its images to another collection, all or none. If it has such an object:
        ConflictError "object_exists", or with merge=True, both become one. "image_exists" for an image's id."""
        return self._patch(self._object(object), {"collection": collection},
                           parameters={"merge": "true"} if merge else None)

    def delete_where(self, filter: Json, object: str | None = None, *, q: str | None = None) -> int:
        """Deletes all images that pass, as `images` lists them, all or none, and returns their number."""
        return int(self._ask("DELETE", f"{self._base}/images",
                             parameters=_given(object=object, filter=filter, q=q))["deleted"])

    def images(self, object: str | None = None, page: int = 100, *, filter: Json | None = None,
               q: str | None = None, sort: str | None = None) -> Iterator[Json]:
        """All images (of an object), fetched `page` at a time, 1 to 500. filter: only images whose metadata pass. q:
        only images with these words in the id, the object or the file's name. sort: id, created, updated, object,
        source or metadata.KEY; descending with a minus."""
        return self._pages(f"{self._base}/images", "images", page, _given(object=object, filter=filter, q=q, sort=sort))

    def objects(self, page: int = 100, *, filter: Json | None = None, q: str | None = None,
                sort: str | None = None) -> Iterator[Json]:
        """All objects with their numbers of images. sort: object, created, updated or images."""
        return self._pages(f"{self._base}/objects", "objects", page, _given(filter=filter, q=q, sort=sort))

    def object_info(self, object: str) -> Json:
        """An object's number of images, and the id of one of them. NotFoundError "object_not_found"."""
        return self._ask("GET", self._object(object))

    def facets(self, *keys: str, object: str | None = None, filter: Json | None = None, q: str | None = None,
               of: str = "images") -> Json:
        """`{"total": ..., "facets": {key: {"values": [{"value", "count"}], "without", "complete"}}}`: the number of
        images (or of="objects") that pass, and the most frequent values of up to 16 metadata keys."""
        answer = self._ask("GET", f"{self._base}/{segment('of', of)}", parameters=_given(
            object=object, filter=filter, q=q, count=True, limit=1, facets=keys or None))
        return {"total": answer["total"], "facets": answer.get("facets", {})}

    def import_archive(self, path: str | os.PathLike[str], *, object_from: str | None = None, object: str | None = None,
                       metadata: Json | None = None, wait: bool = True, timeout: float | None = None,
                       progress: Callable[[Json], object] | None = None) -> Json:
        """Adds the images of a file: a TAR archive (.tar), whose folders name the objects (object_from: "auto",
        "folder", "stem" or "none"), or lines of JSON (.ndjson, .jsonl). A table (.csv) from `save_records` changes the
        names and labels of stored images. The client reads the file while it sends it, so
        the file can be larger than the memory. object and metadata: for all images without their own.
        Returns the job, like `train`. `job_items` has the result of each image. A refused image does not stop the job."""
        name = os.fsdecode(os.fspath(path))
        kind = _ARCHIVES.get(os.path.splitext(name)[1].lower())
        if kind is None:
            raise InvalidArgumentError(f"archive name must end in one of {', '.join(_ARCHIVES)}, not {name!r}",
                                       code="archive_type")
        with open(path, "rb") as file:
            job = self._ask("POST", f"{self._base}/images:import", body=file, content_type=kind,
                            parameters=_given(object_from=object_from, object=object, metadata=metadata or None))
        return self.wait(job["id"], timeout=timeout, progress=progress) if wait else job

    def import_folder(self, folder: str = ".", *, object_from: str | None = None, wait: bool = True,
                      timeout: float | None = None, progress: Callable[[Json], object] | None = None) -> Json:
        """Adds the images of a folder on the server's disk, below its --import-dir. Returns the job, like `train`."""
        job = self._ask("POST", f"{self._base}/imports", **_json_body(
            {"folder": folder, **_given(object_from=object_from)}))
        return self.wait(job["id"], timeout=timeout, progress=progress) if wait else job

    def preview(self, image: ImageLike | None = None, *, image_url: str | None = None, channels: str = "RGB") -> bytes:
        """A JPEG of an image, 320 pixels on the longer side. The server stores nothing."""
        return self._transport.call("POST", "/v1/preview", again=True,
                                    **_image_body("preview", image, image_url, channels)).body

    # Searches

    def search(self, image: ImageLike | None = None, limit: int = 10, *, image_id: str | None = None,
               image_ids: Sequence[str] | None = None, image_url: str | None = None, filter: Json | None = None,
               channels: str = "RGB", **options: Any) -> Json:
        """Searches, and returns `{"hits": [...], "found": ..., ...}`. The query is an image, an address from which the
        server fetches one, the id of a stored image, or several ids. Images similar to several of them come first.
        Stored query images are not hits, except with exclude_self=False.

        options: offset, group_by, rank, verify, verify_depth, instances, closer_look, region ("x,y,width,height"
        or four numbers), min_score, object, explain, exclude_self.
        """
        if sum(given is not None for given in (image, image_id, image_ids, image_url)) != 1:
            raise TypeError("search takes exactly one of image, image_url, image_id and image_ids")
        if image_id is not None:
            query = _json_body({"image_id": image_id})
        elif image_ids is not None:
            query = _json_body({"image_ids": list(image_ids)})
        else:
            query = _image_body("search", image, image_url, channels)
        return self._ask("POST", f"{self._base}/search", parameters=_given(**options, limit=limit, filter=filter), again=True,
                         **query)

    def search_batch(self, searches: Sequence[Mapping[str, Any]]) -> list[Json | Error]:
        """Up to 100 searches in one request, each a dict of the server's parameters with one of image (as for
        `search`), image_id, image_ids and image_url: `{"image": "a.jpg", "limit": 3}`. Returns the answers in the same
        order. A failed search does not stop the others; its error is in the list and is not raised."""
        asked = [{**one, "image": _base64(one["image"])} if "image" in one else dict(one) for one in searches]
        answer = self._ask("POST", f"{self._base}/search:batch", again=True, **_json_body({"searches": asked}))
        return [result["answer"] if "answer" in result else _transport.problem_error(result["status"], result["problem"])
                for result in answer["results"]]

    def locate(self, image: ImageLike | None, object: str, *, image_url: str | None = None,
               channels: str = "RGB") -> Json:
        """Locates a known object in an image. With None and an image_url, the server fetches the image."""
        return self._ask("POST", self._object(object) + "/locate", again=True,
                         **_image_body("locate", image, image_url, channels))

    def compare(self, first: ImageLike | None = None, second: ImageLike | None = None, *, first_url: str | None = None,
                second_url: str | None = None, explain: bool = False, channels: str = "RGB") -> Json:
        """Whether two images show the same object, `{"verdict": "found", "perhaps" or "not_found", "probability": ...}`,
        and where the object of the first is in the second ("polygon"). The server stores nothing. Pass each as an
        image, or as an address from which the server fetches it."""
        body: Json = {"explain": explain}
        for name, image, url in (("first", first, first_url), ("second", second, second_url)):
            if (image is None) == (url is None):
                raise TypeError(f"compare takes either {name} or {name}_url")
            body[name] = {"image_url": url} if image is None else {"image": _base64(image, channels)}
        return self._ask("POST", "/v1/compare", again=True, **_json_body(body))

    # Vocabularies and background jobs

    def train(self, *, wait: bool = True, timeout: float | None = None,
              progress: Callable[[Json], object] | None = None, **options: Any) -> Json:
        """Trains a vocabulary and uses it (options: words, sample, seed, activate). Returns the job when it is done,
        or with `wait=False`, when it starts."""
        job = self._ask("POST", f"{self._base}/vocabularies", **_json_body(options))
        return self.wait(job["id"], timeout=timeout, progress=progress) if wait else job

    def self_test(self, *, wait: bool = True, timeout: float | None = None,
                  progress: Callable[[Json], object] | None = None, **options: float) -> Json | None:
        """Searches for simulated photos of the collection's images (options: pictures, false_alarms, seed). Returns the
        report of how well that works; with `wait=False`, the job."""
        job = self._ask("POST", f"{self._base}/selftest", **_json_body(options))
        if not wait:
            return job
        self.wait(job["id"], timeout=timeout, progress=progress)
        return self.self_test_report()

    def self_test_report(self) -> Json | None:
        """The report of the collection's last self-test; None before the first."""
        return self._ask("GET", f"{self._base}/selftest")["report"]

    def vocabularies(self) -> list[Json]:
        """All vocabularies of the collection."""
        return list(self._ask("GET", f"{self._base}/vocabularies")["vocabularies"])

    def use(self, vocabulary: int, *, wait: bool = True, timeout: float | None = None,
            progress: Callable[[Json], object] | None = None) -> None:
        """Activates a vocabulary. With `wait=False`, a job on the server may continue this."""
        answer = self._transport.call("PUT", f"{self._base}/vocabularies/{int(vocabulary)}/active")
        if answer.status == 202 and wait:
            self.wait(answer.document["id"], timeout=timeout, progress=progress)

    def jobs(self) -> list[Json]:
        """All jobs of the server, newest first."""
        return list(self._pages("/v1/jobs", "jobs", 500, {}))

    def job(self, id: str) -> Json:
        """A job's state (queued, running, done, failed, cancelled), done, total and failed."""
        return self._ask("GET", self._job(id))

    def job_items(self, id: str) -> Iterator[Json]:
        """The result of each image of an `import_archive`: status, and image_id or the problem."""
        return self._pages(self._job(id) + "/items", "items", 500, {})

    def cancel(self, id: str) -> Json:
        """Asks a job to stop."""
        return self._ask("DELETE", self._job(id))

    def wait(self, id: str, *, timeout: float | None = None, progress: Callable[[Json], object] | None = None) -> Json:
        """Waits for a job, calls `progress(job)` every second, and returns the job when it is done. Raises the job's
        error, CancelledError, or UnavailableError "timeout" after `timeout` seconds (the job continues). A restart of
        the server does not end this: the client asks again, until it got no answer for `max_wait` seconds."""
        end = None if timeout is None else time.monotonic() + timeout
        pause, patience, heard = 0.05, 0.0, time.monotonic()
        while True:
            asked = time.monotonic()
            try:
                job = self._ask("GET", self._job(id), parameters={"wait": f"{patience:.3f}"}, patient=False)
            except (ConnectionFailedError, UnavailableError) as error:
                heard = self._still_waits(error, heard, end)
                continue
            heard = time.monotonic()
            if progress is not None:
                progress(job)
            if job["state"] == "done":
                return job
            if job["state"] in ("failed", "cancelled"):
                raise _transport.job_error(job)
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

    def _still_waits(self, error: Error, heard: float, end: float | None) -> float:
        """After a failed question of `wait`: pauses before the next one, or raises the error. Returns when the server
        was last heard."""
        now = time.monotonic()
        if error.code == "starting":
            heard = now
        wait = 0.5 if error.retry_after is None else error.retry_after
        last = heard + self._transport.max_wait if end is None else min(end, heard + self._transport.max_wait)
        if now + wait > last or isinstance(error.__cause__, ssl.SSLCertVerificationError):
            raise error
        time.sleep(wait)
        return heard

    # The server: keys and backups need the scope admin

    def me(self) -> Json:
        """What this client's key allows: `{"keys_required", "scopes", "key", "image_url"}`."""
        return self._ask("GET", "/v1/me")

    def keys(self) -> list[Json]:
        """The records of all keys, oldest first."""
        return list(self._ask("GET", "/v1/keys")["keys"])

    def create_key(self, name: str, scope: str) -> Json:
        """Creates a key with the scope read, write or admin. Returns its record and, only here, the `key`."""
        return self._ask("POST", "/v1/keys", **_json_body({"name": name, "scope": scope}))

    def revoke_key(self, id: str) -> None:
        """Revokes a key. The server refuses later requests with it."""
        self._ask("DELETE", f"/v1/keys/{segment('id', id)}")

    def qr(self, text: str) -> bytes:
        """The text, up to 512 bytes, as a QR code in SVG."""
        return self._transport.call("POST", "/v1/qr", again=True, **_json_body({"text": text})).body

    def backups(self) -> list[Json]:
        """The names, sizes and times of all backups in the server's --backup-dir, newest first."""
        return list(self._ask("GET", "/v1/backups")["backups"])

    def backup(self, name: str | None = None, *, wait: bool = True, timeout: float | None = None) -> Json:
        """Copies the database into a backup (name: "monday.db"; default: made from the time). Returns the job."""
        job = self._ask("POST", "/v1/backups", **_json_body(_given(name=name)))
        return self.wait(job["id"], timeout=timeout) if wait else job

    def save_backup(self, name: str, path: str | os.PathLike[str]) -> None:
        """Downloads a backup to a file, which appears when it is complete. `pliant db restore` restores it."""
        _transport.download(self._transport, self._backup(name) + "/content", {}, path)

    def delete_backup(self, name: str) -> None:
        """Deletes a backup."""
        self._ask("DELETE", self._backup(name))

    def ready(self) -> bool:
        """Whether the server answers searches; False while it starts. ConnectionFailedError without a server."""
        try:
            self._transport.call("GET", "/readyz", patient=False)
        except UnavailableError:
            return False
        return True

    def _ask(self, method: str, path: str, **request: Any) -> Json:
        document: Json = self._transport.call(method, path, **request).document
        return document

    def _patch(self, path: str, changes: Json, **request: Any) -> Json:
        return self._ask("PATCH", path, body=_json_body(changes)["body"], content_type="application/merge-patch+json",
                         **request)

    def _image(self, id: str) -> str:
        return f"{self._base}/images/{segment('id', id)}"

    def _object(self, object: str) -> str:
        return f"{self._base}/objects/{segment('object', object)}"

    def _job(self, id: str) -> str:
        return f"/v1/jobs/{segment('id', id)}"

    def _backup(self, name: str) -> str:
        return f"/v1/backups/{segment('name', name)}"

    def _pages(self, path: str, field: str, page: int, parameters: Json) -> Iterator[Json]:
        while True:
            answer = self._ask("GET", path, parameters={"limit": page, **parameters})
            yield from answer[field]
            if answer["next"] is None:
                return
            parameters = {**parameters, "cursor": answer["next"]}


def _given(**parameters: Any) -> Json:
    """Parameters of an address, without the omitted ones."""
    return {name: _plain(name, value) for name, value in parameters.items() if value is not None}


def _plain(name: str, value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        return _checks.document(name, value)
    if isinstance(value, str):
        return _checks.text(name, value)
    if isinstance(value, (tuple, list)):
        return ",".join(str(item) for item in value)
    return str(value)


def _json_body(document: Json) -> Json:
    return {"body": _checks.document("request", document).encode(), "content_type": "application/json"}


def _image_body(what: str, image: ImageLike | None, image_url: str | None, channels: str) -> Json:
    if (image is None) == (image_url is None):
        raise TypeError(f"{what} takes either image or image_url")
    if image_url is not None:
        return _json_body({"image_url": image_url})
    return {"body": _encoded(image, channels), "content_type": "application/octet-stream"}


def _encoded(image: ImageLike, channels: str = "RGB") -> bytes:
    """The bytes to send: a file's content, given bytes, or an array as a PNG (RGB, unless `channels` is "BGR")."""
    if isinstance(image, (bytes, bytearray, memoryview)):
        return bytes(image)
    if isinstance(image, (str, os.PathLike)):
        with open(image, "rb") as file:
            return file.read()
    if hasattr(image, "dtype") and hasattr(image, "shape"):
        return _transport.png(image, channels)
    raise TypeError(f"image must be a path, bytes or an array of uint8, not {type(image).__name__}")


def _base64(image: ImageLike, channels: str = "RGB") -> str:
    return base64.b64encode(_encoded(image, channels)).decode("ascii")
