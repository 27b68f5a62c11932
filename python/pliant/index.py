# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""A searchable collection of images in one database file, as `pliant` and `pliant-server` use it."""
from __future__ import annotations

import json
import os
from types import TracebackType
from typing import Any, Callable, Iterator, Sequence

from pliant import _checks, _native, images, records
from pliant.errors import InvalidArgumentError, NotFoundError
from pliant.features import Features, default_model

_PAGE = 500


class Index:
    """One collection of one database. Several threads and processes can use the database at the same time.

    Writes are durable when a call returns. A `with` block closes the index. Calls on a closed index raise
    InvalidArgumentError "closed".

    db: the file; created if it does not exist and `create`.
    collection: created if it does not exist and `create`; "default" always exists.
    descriptor: for a new database, deal by default. ConflictError "model_mismatch" if an existing database has another.
        Features of your own descriptor make a database of such features: `add` and `search` then take Features only.
    model: weight file for deal; None: the installed one.
    max_keypoints, max_side: how a new database describes its images (512 and 1024 pixels). ConflictError
        "extraction_mismatch" if an existing database has other values.
    keep_originals: also stores the images' bytes, for `content`; in `originals_dir` if given.
    busy_timeout: seconds to wait for another process's write before UnavailableError.
    """

    def __init__(self, db: str | os.PathLike[str], *, collection: str = "default", descriptor: str | Features = "",
                 model: str | os.PathLike[str] | None = None, create: bool = True, read_only: bool = False,
                 max_keypoints: int | None = None, max_side: int | None = None, keep_originals: bool = True,
                 originals_dir: str | os.PathLike[str] | None = None, busy_timeout: float = 10.0) -> None:
        if not 0 <= busy_timeout <= 1e6:
            raise InvalidArgumentError(f"busy_timeout must be 0 to 1000000 s, not {busy_timeout}", code="out_of_range")
        own = descriptor if isinstance(descriptor, Features) else None
        self._native = _native.Index(
            _checks.path("db", db), _checks.text("collection", collection),
            _checks.text("descriptor", "" if isinstance(descriptor, Features) else descriptor), own,
            default_model() if model is None else _checks.path("model", model), bool(create), bool(read_only),
            None if max_keypoints is None else _checks.whole("max_keypoints", max_keypoints, 1, 4096),
            None if max_side is None else _checks.whole("max_side", max_side, 16, 65536), bool(keep_originals),
            b"" if originals_dir is None else _checks.path("originals_dir", originals_dir), float(busy_timeout))
        self.collection = collection

    def close(self) -> None:
        """Waits for running calls, then closes the database. Closing twice is safe."""
        self._native.close()

    def __enter__(self) -> Index:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()

    # Images

    def add(self, image: images.ImageLike | Features, *, object: str = "", id: str | None = None,
            metadata: dict[str, Any] | None = None, source: str | None = None, channels: str = "RGB",
            threads: int = 0) -> records.Image:
        """Adds an image. An array is stored as a PNG. Features of the index's own model add an image that you described;
        it has no `content`.

        object: the object in the image; searches group by it. metadata: a dict of JSON values, for filters.
        id: replaces an existing image. None: the id comes from the image's bytes. Adding stored bytes again is
            "unchanged"; with another object or other metadata it raises ConflictError "same_bytes".
        Raises the errors of `describe`, and UnprocessableError "too_few_features" for images without texture.
        """
        if source is None:
            source = ""
            if isinstance(image, (str, os.PathLike)):
                source = _checks.shown(os.fsencode(image))
        record_parts = (_checks.text("object", object), None if id is None else _checks.text("id", id),
                        _checks.document("metadata", metadata or {}), _checks.text("source", source),
                        _checks.whole("threads", threads, 0, 1024))
        if isinstance(image, Features):
            outcome, record = self._native.add_features(image, *record_parts)
        else:
            outcome, record = self._native.add(images.encoded(image, channels), *record_parts)
        return records.image(json.loads(record), outcome)

    def add_folder(self, *folders: str | os.PathLike[str], object_from: str = "auto", threads: int = 0,
                   progress: Callable[[int, int], object] | None = None) -> records.FolderReport:
        """Adds all images below the folders, one thread each, as `pliant index` does, but trains no vocabulary.

        object_from: "folder" (the folder's name), "stem" (the file's), "none", or "auto" to choose between the
        first two. Other threads call progress(done, total); an exception from it stops the work. The call is safe to
        repeat: it skips stored images. Ctrl-C raises KeyboardInterrupt; the images added so far stay.
        """
        report = json.loads(self._native.add_folders([_checks.path("folder", folder) for folder in folders],
                                                     _checks.text("object_from", object_from),
                                                     _checks.whole("threads", threads, 0, 1024), progress))
        return records.FolderReport(report["indexed"], report["unchanged"],
                                    [(file["file"], file["code"], file["reason"]) for file in report["skipped"]],
                                    report["system_files"])

    def get(self, id: str) -> records.Image:
        """An image's record. NotFoundError if it does not exist."""
        return records.image(json.loads(self._native.get(_checks.text("id", id))))

    def features(self, id: str) -> Features:
        """Keypoints and descriptors of a stored image, the descriptors with 8 bits per value."""
        return Features(*self._native.features(_checks.text("id", id)))

    def content(self, id: str) -> bytes:
        """The bytes of the image as added."""
        return self._native.content(_checks.text("id", id))

    def update(self, id: str, *, object: str | None = None, metadata: dict[str, Any] | None = None,
               source: str | None = None) -> records.Image:
        """Changes an image's object, metadata or source without describing it again, and returns its record. Omitted
        values stay; object="" removes the object. metadata is merged key by key, and None removes a key."""
        if object is None and metadata is None and source is None:
            raise TypeError("nothing to change: give object, metadata or source")
        return records.image(json.loads(self._native.change(
            _checks.text("id", id), None if object is None else _checks.text("object", object),
            None if metadata is None else _checks.document("metadata", metadata),
            None if source is None else _checks.text("source", source))))

    def rename_object(self, object: str, name: str, *, merge: bool = False) -> int:
        """Renames an object with all its images, and returns its number of images. If the name is taken: ConflictError
        "object_exists", or with merge=True, both objects become one."""
        return self._native.rename_object(_checks.text("object", object), _checks.text("name", name), bool(merge))

    def remove(self, id: str) -> bool:
        """Removes an image from the database and from all later searches. False if it does not exist."""
        return self._native.remove(_checks.text("id", id))

    def remove_object(self, object: str) -> int:
        """Removes all images of an object, and returns their number."""
        return self._native.remove_object(_checks.text("object", object))

    def __len__(self) -> int:
        """The number of images."""
        return int(json.loads(self._native.describe_collection())["images"])

    def __contains__(self, id: str) -> bool:
        try:
            self.get(id)
        except NotFoundError:
            return False
        return True

    def __iter__(self) -> Iterator[records.Image]:
        return self.images()

    def images(self, object: str | None = None) -> Iterator[records.Image]:
        """All images (of an object) in order of their ids, read in pages, so images can be added and removed meanwhile."""
        wanted = None if object is None else _checks.text("object", object)
        after: str | None = ""
        while after is not None:
            page, after = self._native.list(after, wanted, _PAGE)
            yield from map(records.image, json.loads(page))

    def objects(self) -> Iterator[tuple[str, int]]:
        """(name, number of images) of all objects, in order of their names."""
        after: str | None = ""
        while after is not None:
            page, after = self._native.objects(after, _PAGE)
            yield from page

    # Vocabularies

    def train(self, *, words: int = 0, sample: int = 0, seed: int = 1, threads: int = 0,
              progress: Callable[[float], object] | None = None) -> records.Vocabulary:
        """Trains a vocabulary from the stored images and uses it. The first search needs one; train again when the
        collection has grown a few times larger.

        words: 0 = a tenth of the sample. sample: descriptors drawn at random; 0 = chosen by the collection's size.
        Another thread calls progress(share of 1); an exception from it stops the training, as Ctrl-C does. The
        vocabularies then stay as they were.
        """
        return records.vocabulary(json.loads(self._native.train(
            _checks.whole("words", words), _checks.whole("sample", sample), _checks.whole("seed", seed, 0, 2**64 - 1),
            _checks.whole("threads", threads, 0, 1024), progress)))

    def vocabularies(self) -> list[records.Vocabulary]:
        """All vocabularies of the collection."""
        return [records.vocabulary(document) for document in json.loads(self._native.vocabularies())]

    def use(self, vocabulary: int) -> None:
        """Switches to another vocabulary, by its id."""
        self._native.use(_checks.whole("vocabulary", vocabulary, 0, 2**63 - 1))

    # Searches

    def search(self, image: images.ImageLike | Features, top: int = 10, *, channels: str = "RGB",
               **options: Any) -> records.SearchResult:
        """Finds the objects that the image shows, and returns the best `top` hits; 0 = all.

        image: see `pliant.images`, or Features of the index's own model.
        options:
            offset: hits to skip at the start.
            group_by: "object" (one hit per object, its best image) or "image".
            rank: "neighbours" or "histogram".
            verify: "auto" (tps; none for histogram), "tps" or "none"; verify_depth: images to verify, 0 = adaptive, 30
                to 100 and more in large collections; instances: maximum number of instances of one object, 20.
            closer_look: if nothing is found, run a second pass at high resolution and return the answer with more
                evidence; if little is found, look for mirrored objects (True); not with Features.
            region: (x, y, width, height) in pixels of the query: searches only this part, at its full resolution.
            min_score: 0 to 1. object: only images of this object. filter: conditions on metadata, such as
                {"year": {"gte": 2020}, "colour": {"in": ["red"]}}; tests are in, ne, gt, gte, lt, lte,
                prefix, contains and exists; join filters with "and": [...], "or": [...] and "not": {...}.
            explain: adds the matches and the warp to each hit.
            threads: 0 = one per core.
        Raises ConflictError "no_vocabulary" before the first `train`, and UnprocessableError "too_few_features".
        """
        asked = _search_options(top, options)
        if isinstance(image, Features):
            return records.SearchResult(json.loads(self._native.search_features(image, asked)))
        return records.SearchResult(json.loads(self._native.search(images.encoded(image, channels), asked)))

    def search_stored(self, id: str, top: int = 10, **options: Any) -> records.SearchResult:
        """Like `search`, with a stored image as the query."""
        return records.SearchResult(json.loads(self._native.search_stored(_checks.text("id", id),
                                                                          _search_options(top, options))))

    # Upkeep

    def check(self) -> list[str]:
        """Checks the integrity of the database. Returns a sentence for each problem; empty = no problems."""
        return list(self._native.check())

    def backup(self, path: str | os.PathLike[str]) -> None:
        """Copies the database to a new file, even while it is in use."""
        self._native.backup(_checks.path("path", path))


def _region(region: Sequence[float] | None) -> list[float] | None:
    if region is None:
        return None
    values = [float(value) for value in region]
    if len(values) != 4:
        raise InvalidArgumentError(f"region must be (x, y, width, height), not {len(values)} values",
                                   code="region_invalid")
    return values


def _search_options(top: int, given: dict[str, Any]) -> dict[str, Any]:
    known: dict[str, Any] = {"offset": 0, "group_by": "object", "rank": "neighbours", "verify": "auto",
                             "verify_depth": 0, "instances": 20, "closer_look": True, "region": None,
                             "min_score": 0.0, "object": None, "filter": None, "explain": False, "threads": 0}
    for name in given:
        if name not in known:
            raise TypeError(f"search has no option {name!r}; options are {', '.join(['top', *known])}")
    options: dict[str, Any] = {**known, **given, "top": _checks.whole("top", top)}
    for name, most in (("offset", 2**31 - 1), ("verify_depth", 2**31 - 1), ("instances", 1000), ("threads", 1024)):
        options[name] = _checks.whole(name, options[name], 0, most)
    for name in ("group_by", "rank", "verify"):
        options[name] = _checks.text(name, options[name])
    if options["object"] is not None:
        options["object"] = _checks.text("object", options["object"])
    options["region"] = _region(options["region"])
    options["min_score"] = float(options["min_score"])
    options["filter"] = "" if options["filter"] is None else _checks.document("filter", options["filter"])
    options["explain"] = bool(options["explain"])
    options["closer_look"] = bool(options["closer_look"])
    return options
