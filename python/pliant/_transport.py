# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Requests to a server over http.client: retries, answers, errors. Private; see pliant.client."""
from __future__ import annotations

import email.utils
import http.client
import json
import os
import random
import ssl
import struct
import time
import urllib.parse
import uuid
import zlib
from typing import Any, BinaryIO, NamedTuple

from pliant import errors
from pliant.errors import ConnectionFailedError, InvalidArgumentError

_BUSY = (429, 503)
_BY_STATUS: dict[int, type[errors.Error]] = {
    400: errors.InvalidArgumentError, 401: errors.UnauthorizedError, 403: errors.ForbiddenError,
    404: errors.NotFoundError, 409: errors.ConflictError, 412: errors.ConflictError, 413: errors.TooLargeError,
    415: errors.UnsupportedMediaTypeError, 422: errors.UnprocessableError, 429: errors.UnavailableError,
    500: errors.InternalError, 503: errors.UnavailableError, 507: errors.NoSpaceError,
}


class Answer(NamedTuple):
    """A successful response. `document`: its JSON, or None."""

    status: int
    headers: http.client.HTTPMessage
    body: bytes
    document: Any


class Transport:
    """Opens one connection per request, so that any number of threads can share it. It follows no redirects and uses
    no proxies: the key goes only to the named server."""

    def __init__(self, url: str, key: str | None, timeout: float, retries: int, max_wait: float,
                 context: ssl.SSLContext | None) -> None:
        parts = urllib.parse.urlsplit(url)
        if parts.scheme not in ("http", "https") or not parts.hostname:
            raise InvalidArgumentError(f"url must be http://HOST or https://HOST, not {url!r}", code="url_invalid")
        if parts.query or parts.fragment or parts.username is not None:
            raise InvalidArgumentError("url must not have a user, query or fragment; pass the key as key",
                                       code="url_invalid")
        if key is not None and not (key.isascii() and key.isprintable() and " " not in key and key):
            raise InvalidArgumentError("key must be printable ASCII without spaces", code="key_invalid")
        try:
            # Always said: http.client would look for it in an IPv6 address.
            self._port = parts.port or (443 if parts.scheme == "https" else 80)
        except ValueError:
            raise InvalidArgumentError(f"url has an invalid port: {url!r}", code="url_invalid") from None
        self._host = parts.hostname
        self._prefix = parts.path.rstrip("/")
        self._tls = (context or ssl.create_default_context()) if parts.scheme == "https" else None
        self._headers = {"Authorization": f"Bearer {key}"} if key else {}
        self._timeout, self._retries, self.max_wait = timeout, retries, max_wait
        self.address = f"{parts.scheme}://{parts.netloc}{self._prefix}"

    def call(self, method: str, path: str, *, parameters: dict[str, Any] | None = None,
             body: bytes | BinaryIO | None = None, content_type: str | None = None, again: bool | None = None,
             patient: bool = True, into: BinaryIO | None = None, if_match: str | None = None) -> Answer:
        """`body`: bytes, or a file, sent from its beginning each time. `into`: a new file that receives the body of a
        success piece by piece. If `patient`, repeats requests after 429, 503 and failed connections. `again`: whether
        the request is idempotent; by default, all methods except POST and PATCH. Other requests get an
        Idempotency-Key, so that the server executes them once."""
        if again is None:
            again = method not in ("POST", "PATCH")
        target = self._prefix + path
        if parameters:
            target += "?" + urllib.parse.urlencode(parameters)
        headers = dict(self._headers)
        if content_type:
            headers["Content-Type"] = content_type
        if if_match is not None:
            headers["If-Match"] = if_match
        if body is not None and not isinstance(body, bytes):
            headers["Content-Length"] = str(os.fstat(body.fileno()).st_size)
        if not again:
            headers["Idempotency-Key"] = str(uuid.uuid4())
        retries = self._retries if patient else 0
        failed = 0
        while True:
            try:
                answer = self._once(method, target, body, headers, into)
            except (OSError, http.client.HTTPException) as error:
                if isinstance(error, ssl.SSLCertVerificationError) or failed >= retries:
                    raise ConnectionFailedError(f"{method} {self.address}{path}: {error or type(error).__name__}",
                                                code="connection_failed") from error
                wait = None
            else:
                if answer.status < 300 or answer.status == 304:
                    return answer
                refused = _refusal(answer)
                wait = refused.retry_after
                busy = answer.status in _BUSY or refused.code == "idempotency_running"
                if not busy or failed >= retries or (wait or 0) > self.max_wait:
                    raise refused
            time.sleep(wait if wait is not None else min(self.max_wait, 0.25 * 2**failed * (0.5 + random.random())))
            failed += 1

    def _once(self, method: str, target: str, body: bytes | BinaryIO | None, headers: dict[str, str],
              into: BinaryIO | None) -> Answer:
        if body is not None and not isinstance(body, bytes):
            body.seek(0)
        connection: http.client.HTTPConnection
        if self._tls:
            connection = http.client.HTTPSConnection(self._host, self._port, timeout=self._timeout, context=self._tls)
        else:
            connection = http.client.HTTPConnection(self._host, self._port, timeout=self._timeout)
        try:
            response = _exchange(connection, method, target, body, {**headers, "Connection": "close"})
            if into is not None and response.status < 300:
                _copy(response, into)
                return Answer(response.status, response.headers, b"", None)
            data = response.read()
            document = None
            if response.status < 300 and data and "json" in response.headers.get("Content-Type", ""):
                document = json.loads(data)
            return Answer(response.status, response.headers, data, document)
        except ValueError as error:  # malformed JSON
            raise http.client.HTTPException(f"the response cannot be read: {error}") from error
        finally:
            connection.close()


def _exchange(connection: http.client.HTTPConnection, method: str, target: str, body: bytes | BinaryIO | None,
              headers: dict[str, str]) -> http.client.HTTPResponse:
    """A server can refuse a request before it has read the whole body. Its response counts."""
    try:
        connection.request(method, target, body, headers)
    except (BrokenPipeError, ConnectionResetError) as cut:
        try:
            return connection.getresponse()
        except (OSError, http.client.HTTPException):
            raise cut from None
    return connection.getresponse()


def _refusal(answer: Answer) -> errors.Error:
    """The error of a refused request, from problem+json or another body, such as a proxy's."""
    problem: Any = None
    if "json" in answer.headers.get("Content-Type", ""):
        try:
            problem = json.loads(answer.body)
        except ValueError:
            pass
    return problem_error(answer.status, problem if isinstance(problem, dict) else {},
                         request_id=answer.headers.get("X-Request-Id"), wait_s=_retry_after(answer.headers))


def _retry_after(headers: http.client.HTTPMessage) -> float | None:
    """Seconds to wait, from `Retry-After` (RFC 9110: a number or a date); None if it is missing or malformed."""
    value = str(headers.get("Retry-After", ""))
    if value.strip().isdecimal():
        return float(value)
    try:
        return max(0.0, email.utils.parsedate_to_datetime(value).timestamp() - time.time())
    except (TypeError, ValueError):
        return None


def problem_error(status: int, problem: dict[str, Any], *, request_id: str | None = None,
                  wait_s: float | None = None) -> errors.Error:
    """The error of a problem document."""
    said = {name: value for name, value in problem.items() if isinstance(value, str)}
    code, title = said.get("code"), said.get("title")
    kind = errors.ReadOnlyError if (status, code) == (500, "read_only") else _BY_STATUS.get(status, errors.Error)
    return kind(said.get("detail") or title or f"the server answered {status}", code=code or f"http_{status}",
                status=status, title=title, parameter=said.get("parameter"),
                request_id=said.get("request_id") or request_id, retry_after=wait_s, problem=problem)


def job_error(job: dict[str, Any]) -> errors.Error:
    """The error of a failed or cancelled job."""
    if job["state"] == "cancelled":
        return errors.CancelledError(f"job {job['id']} was cancelled", code="cancelled", problem=job)
    problem = job.get("problem") or {}
    return errors.Error(problem.get("detail") or f"job {job['id']} {job['state']}", code=problem.get("code") or "job_failed",
                        problem=job)


class _FileFailed(Exception):
    """The file that takes a body cannot be written. This is not a failure of the connection."""


def _copy(response: http.client.HTTPResponse, file: BinaryIO) -> None:
    try:
        file.seek(0)
        file.truncate()
    except OSError as error:
        raise _FileFailed from error
    while data := response.read(1 << 20):
        try:
            file.write(data)
        except OSError as error:
            raise _FileFailed from error
    if response.length:  # read(n) does not say that something is missing
        raise http.client.IncompleteRead(b"", response.length)


def download(transport: Transport, path: str, parameters: dict[str, Any], target: str | os.PathLike[str]) -> None:
    """Downloads to a file that appears when it is complete. Raises OSError if the file cannot be written."""
    final = os.fsdecode(os.fspath(target))
    partial = f"{final}.part-{uuid.uuid4().hex}"
    with open(partial, "xb", buffering=0) as file:
        try:
            transport.call("GET", path, parameters=parameters, into=file)
            os.replace(partial, final)
        except _FileFailed as failed:
            os.unlink(partial)
            raise failed.__cause__ or failed from None
        except BaseException:
            os.unlink(partial)
            raise


def segment(name: str, value: str) -> str:
    """A name as one part of a path."""
    if not isinstance(value, str):
        raise TypeError(f"{name} must be str, not {type(value).__name__}")
    if value in ("", ".", ".."):
        raise InvalidArgumentError(f"{name} must not be {value!r}", code=f"{name}_invalid")
    return urllib.parse.quote(value, safe="")


def png(pixels: Any, channels: str) -> bytes:
    """An array H x W or H x W x 3 of uint8 as a PNG, without the compiled library."""
    if str(pixels.dtype) != "uint8":
        raise TypeError(f"image must be an array of uint8, not {pixels.dtype}")
    colour = pixels.ndim == 3 and pixels.shape[2] == 3
    if (pixels.ndim != 2 and not colour) or 0 in pixels.shape:
        raise InvalidArgumentError(f"image must be H x W or H x W x 3, not {' x '.join(map(str, pixels.shape))}",
                                   code="array_shape")
    if channels not in ("RGB", "BGR"):
        raise InvalidArgumentError(f'channels must be "RGB" or "BGR", not {channels!r}', code="channels_invalid")
    if colour and channels == "BGR":
        pixels = pixels[:, :, ::-1]
    height, width = pixels.shape[:2]
    rows = b"".join(b"\0" + pixels[y].tobytes() for y in range(height))

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">2I5B", width, height, 8, 2 if colour else 0, 0, 0, 0))
            + chunk(b"IDAT", zlib.compress(rows, 1)) + chunk(b"IEND", b""))
