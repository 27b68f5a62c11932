# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""The exceptions of Pliant. Errors of the library and of a server have the same classes.

Arguments of a wrong type raise Python's `TypeError`, and unreadable files its `OSError`. All other
errors are subclasses of `Error`.
"""
from __future__ import annotations

import functools
from typing import Any


class Error(Exception):
    """The base class.

    code: a stable word for programs (``"image_truncated"``).
    detail: a sentence for people, which is also ``str(error)``.
    Only for answers of a server (else None): status (of HTTP), title, parameter (with the wrong value),
    request_id (also in the server's log) and retry_after (seconds); `problem` is the whole document.
    """

    def __init__(self, detail: str, *, code: str = "error", status: int | None = None, title: str | None = None,
                 parameter: str | None = None, request_id: str | None = None, retry_after: float | None = None,
                 problem: dict[str, Any] | None = None) -> None:
        super().__init__(detail)
        self.detail = detail
        self.code = code
        self.status = status
        self.title = title
        self.parameter = parameter
        self.request_id = request_id
        self.retry_after = retry_after
        self.problem = problem

    def __reduce__(self) -> tuple[Any, ...]:
        return functools.partial(type(self), **self.__dict__), ()


class InvalidArgumentError(Error, ValueError):
    """An argument is out of range or malformed; the message names it."""


class NotFoundError(Error, LookupError):
    """No such image, object, vocabulary, collection or file."""


class ConflictError(Error):
    """The current state does not allow this: another model, a name in use, no vocabulary yet."""


class CorruptError(Error):
    """Stored data or a weight file is damaged."""


class UnsupportedMediaTypeError(Error):
    """Pliant does not read this type of image (or of body)."""


class TooLargeError(Error):
    """The data exceeds a limit on bytes, pixels or memory."""


class UnprocessableError(Error):
    """The image has the right type, but is damaged or has too few features."""


class UnavailableError(Error):
    """Temporarily busy or timed out. Try again later."""


class NoSpaceError(Error):
    """The disk is full, or the file could not be written."""


class CancelledError(Error):
    """The work was stopped on request. Finished work stays."""


class InternalError(Error):
    """A defect in Pliant, or damaged data on a server, whose log has the request id."""


class ReadOnlyError(Error):
    """Pliant cannot write to the file or database."""


class UnauthorizedError(Error):
    """The server needs a key, or does not know this one."""


class ForbiddenError(Error):
    """The key's scope does not include this."""


class ConnectionFailedError(Error, ConnectionError):
    """No server answers at that address, or the connection ended early."""
