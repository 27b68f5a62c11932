# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""A client of pliant-server, of Python's standard library alone: `import pliant.client` needs neither the compiled
library nor NumPy. The reference of routes, parameters and codes is server/reference/; answers are its JSON as they come.
"""
from __future__ import annotations

import json
import os
import ssl
from typing import Any, Iterator, Mapping, Sequence

from pliant import _bodies, _problems, _transport
from pliant._background import Background
from pliant._bodies import ImageLike, Json
from pliant._transport import Transport, segment
from pliant.errors import Error, UnavailableError


class Client(Background):
    """Talks to the server at `url` about one collection. Any number of threads may use it.

    key: an API key. collection: the one that methods are about; `client.collection("shelf")` gives another.
    timeout: seconds without a byte before a request fails. retries: how often a request is repeated that the server
    refused as too much (429, 503), or whose connection failed: `add` without an id, `train` and such are
    done once all the same, by an Idempotency-Key. It waits as long as `Retry-After` says, but no more than `max_wait` seconds: then
    the error is raised. context: for https with a certificate of your own.
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
        """The same server and key, another collection."""
        other = object.__new__(Client)
        other._transport = self._transport
        other._use(name)
        return other

    def collections(self) -> list[str]:
        """The names of all."""
        return list(self._get("/v1/collections")["collections"])

    def create(self) -> Json:
        """Makes this client's collection; one that is there stays as it is."""
        return self._ask("PUT", self._base)

    def info(self) -> Json:
        """Its name, its numbers of images, objects and descriptors, and the vocabulary in use."""
        return self._get(self._base)

    def set_display_name(self, name: str | None) -> Json:
        """What people call this client's collection; None: by its own name."""
        return self._patch(self._base, json.dumps({"display_name": name}).encode())

    def drop(self) -> None:
        """Deletes this client's collection with all it holds, and its aliases."""
        self._transport.call("DELETE", self._base)

    def aliases(self) -> dict[str, str]:
        """Other names of collections: alias to collection. `client.collection(alias)` takes them, too."""
        return {alias["name"]: alias["collection"] for alias in self._get("/v1/aliases")["aliases"]}

    def set_aliases(self, changes: Mapping[str, str | None]) -> None:
        """Makes, moves and (None) removes aliases, all at once or none."""
        self._patch("/v1/aliases", json.dumps(dict(changes)).encode())

    # Images

    def add(self, image: ImageLike | None = None, *, image_url: str | None = None, object: str = "",
            id: str | None = None, metadata: Json | None = None, channels: str = "RGB") -> Json:
        """Adds an image and gives its record. With an id it replaces what is there, and can be repeated safely.
        image_url, in place of image: an address that the server fetches it from (where --fetch-hosts allows it)."""
        body, kind = _bodies.image("add", image, image_url, channels)
        parameters: Json = {"object": object} if object else {}
        if metadata:
            parameters["metadata"] = json.dumps(metadata, allow_nan=False)
        path = f"{self._base}/images" + ("" if id is None else f"/{segment('id', id)}")
        return self._ask("POST" if id is None else "PUT", path, parameters=parameters, body=body, content_type=kind)

    def get(self, id: str) -> Json:
        """An image's record. NotFoundError "image_not_found"."""
        return self._get(self._image(id))

    def etag(self, id: str) -> str:
        """Of an image's record as it is now, for `update(..., if_match=...)`."""
        return str(self._transport.call("GET", self._image(id)).headers["ETag"])

    def update(self, id: str, *, object: str | None = None, metadata: Json | None = None, source: str | None = None,
               if_match: str | None = None) -> Json:
        """Changes what an image is called or known by, without describing it anew, and gives its record. What is left
        out stays; object="": it shows no object any more. metadata is merged key by key, and None removes a key.
        if_match: an `etag`; ConflictError "precondition_failed" if the record was changed since."""
        return self._patch(self._image(id), _bodies.changes({"object": object, "metadata": metadata, "source": source}),
                           if_match=if_match)

    def content(self, id: str) -> bytes:
        """The bytes of an image as it was added."""
        return self._transport.call("GET", self._image(id) + "/content").body

    def thumbnail(self, id: str) -> bytes:
        """A JPEG, 320 pixels on the longer side."""
        return self._transport.call("GET", self._image(id) + "/thumbnail").body

    def features(self, id: str) -> Json:
        """Keypoints, and descriptors as base64."""
        return self._get(self._image(id) + "/features")

    def save_features(self, path: str | os.PathLike[str], object: str | None = None, *, filter: Json | None = None,
                      q: str | None = None) -> None:
        """Writes the features of the whole collection (of an object, of those that pass) to an .npz file, which
        `pliant.Features.load_folder` and `numpy.load` read: by ids, all of one state. `objects` says what each shows.
        The file appears when it is complete."""
        _transport.download(self._transport, f"{self._base}/features", _bodies.listing(object=object, filter=filter, q=q), path)

    def delete(self, id: str) -> None:
        """Deletes an image for good. NotFoundError if there is none, also when a request that was repeated finds it gone."""
        self._transport.call("DELETE", self._image(id))

    def delete_object(self, object: str) -> int:
        """Deletes all images of an object, and says how many."""
        return int(self._ask("DELETE", f"{self._base}/objects/{segment('object', object)}")["deleted"])

    def rename_object(self, object: str, name: str, *, merge: bool = False) -> Json:
        """Gives an object another name, with all its images at once. Where another one has it, ConflictError
        "object_exists", or, with merge=True, both become one."""
        return self._patch(f"{self._base}/objects/{segment('object', object)}", _bodies.changes({"object": name}),
                           parameters={"merge": "true"} if merge else None)

    def delete_where(self, filter: Json, object: str | None = None) -> int:
        """Deletes all images (of an object) whose metadata pass, at once or not at all, and says how many."""
        parameters = _bodies.listing(object=object, filter=filter)
        return int(self._ask("DELETE", f"{self._base}/images", parameters=parameters)["deleted"])

    def images(self, object: str | None = None, page: int = 100, *, filter: Json | None = None,
               q: str | None = None, sort: str | None = None) -> Iterator[Json]:
        """All images (of an object), fetched `page` at a time, 1 to 500. filter: only those whose metadata pass. q: only
        those with these words in the id, the object or the file's name. sort: id, created, updated, object or
        source; with a minus downwards."""
        return self._pages("/images", "images", page, _bodies.listing(object=object, filter=filter, q=q, sort=sort))

    def objects(self, page: int = 100, *, filter: Json | None = None, q: str | None = None,
                sort: str | None = None) -> Iterator[Json]:
        """All objects with their numbers of images. sort: object, created, updated or images."""
        return self._pages("/objects", "objects", page, _bodies.listing(filter=filter, q=q, sort=sort))

    # Searches

    def search(self, image: ImageLike | None = None, top: int = 10, *, image_id: str | None = None,
               image_ids: Sequence[str] | None = None, image_url: str | None = None, filter: Json | None = None,
               channels: str = "RGB", **options: Any) -> Json:
        """The server's answer, `{"hits": [...], "found": ..., ...}`, to an image, to one that the server fetches by its
        address, to the id of a stored one, or to several ids: images like any of these, those like several first.
        Stored images are no hits themselves, unless exclude_self=False.

        options: offset, group_by, rank, verify, verify_depth, expand, instances, closer_look, region ("x,y,width,height"
        or four numbers), min_score, object, explain, exclude_self.
        """
        if sum(given is not None for given in (image, image_id, image_ids, image_url)) != 1:
            raise TypeError("search takes an image, image_url, image_id or image_ids")
        parameters: Json = {name: _bodies.plain(value) for name, value in options.items() if value is not None}
        parameters["limit"] = top
        if filter is not None:
            parameters["filter"] = json.dumps(filter, allow_nan=False)
        if image_id is not None or image_ids is not None:
            stored: Json = {"image_id": image_id} if image_id is not None else {"image_ids": list(image_ids or ())}
            body, kind = json.dumps(stored).encode(), "application/json"
        else:
            body, kind = _bodies.image("search", image, image_url, channels)
        return self._ask("POST", f"{self._base}/search", parameters=parameters, body=body, content_type=kind, again=True)

    def search_batch(self, searches: Sequence[Mapping[str, Any]]) -> list[Json | Error]:
        """Up to 100 searches in one request, each a dict of the server's parameters with one of image (anything that
        `search` takes), image_id, image_ids and image_url: `{"image": "a.jpg", "limit": 3}`. In their order the
        answers, or, in place of one that failed, its error: it is not raised, and the others are answered."""
        body = json.dumps({"searches": [_bodies.search(one) for one in searches]}, allow_nan=False).encode()
        answer = self._ask("POST", f"{self._base}/search:batch", body=body, content_type="application/json", again=True)
        return [result["answer"] if "answer" in result else _problems.of_problem(result["status"], result["problem"])
                for result in answer["results"]]

    def locate(self, image: ImageLike | None, object: str, *, image_url: str | None = None,
               channels: str = "RGB") -> Json:
        """Where a known object is in an image; with None and an image_url, in one that the server fetches."""
        body, kind = _bodies.image("locate", image, image_url, channels)
        return self._ask("POST", f"{self._base}/objects/{segment('object', object)}/locate",
                         body=body, content_type=kind, again=True)

    def compare(self, first: ImageLike | None = None, second: ImageLike | None = None, *, first_url: str | None = None,
                second_url: str | None = None, explain: bool = False, channels: str = "RGB") -> Json:
        """Whether two images show the same object, `{"verdict": "found" or "not_found", "probability": ...}`, and where
        that of the first is in the second ("polygon"). Nothing is stored. Each is an image, or an address that the
        server fetches it from."""
        body: Json = {"explain": explain}
        for name, image, url in (("first", first, first_url), ("second", second, second_url)):
            if (image is None) == (url is None):
                raise TypeError(f"compare takes {name} or {name}_url")
            body[name] = {"image_url": url} if image is None else {
                "image": _bodies.as_base64(image, channels)}
        return self._ask("POST", "/v1/compare", body=json.dumps(body).encode(), content_type="application/json", again=True)

    # About the server

    def ready(self) -> bool:
        """Whether it answers searches; False while it starts. ConnectionFailedError where nobody listens."""
        try:
            self._transport.call("GET", "/readyz", patient=False)
        except UnavailableError:
            return False
        return True

    def _get(self, path: str, **parameters: Any) -> Json:
        return self._ask("GET", path, parameters=parameters)

    def _ask(self, method: str, path: str, **request: Any) -> Json:
        document: Json = self._transport.call(method, path, **request).document
        return document

    def _patch(self, path: str, changes: bytes, *, parameters: Json | None = None, if_match: str | None = None) -> Json:
        return self._ask("PATCH", path, parameters=parameters, body=changes,
                         content_type="application/merge-patch+json", if_match=if_match)

    def _image(self, id: str) -> str:
        return f"{self._base}/images/{segment('id', id)}"

    def _pages(self, path: str, field: str, page: int, parameters: Json) -> Iterator[Json]:
        while True:
            answer = self._get(self._base + path, limit=page, **parameters)
            yield from answer[field]
            if answer["next"] is None:
                return
            parameters = {**parameters, "cursor": answer["next"]}
