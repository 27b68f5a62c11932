# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""The exceptions of Pliant: the same classes whether an error comes from the library or from a server.

Wrong types of arguments are Python's own `TypeError`, files that cannot be opened its `OSError`; all
else is a subclass of `Error`.
"""
from __future__ import annotations

from typing import Any


class Error(Exception):
    """Base of all.

    code: a stable word for programs (``"image_truncated"``).
    detail: a sentence for people, which is also ``str(error)``.
    Of a server's answers only (else None): status (of HTTP), title, parameter (the one at fault),
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
        return _restore, (type(self), self.detail, {k: v for k, v in self.__dict__.items() if k != "detail"})


def _restore(kind: type[Error], detail: str, attributes: dict[str, Any]) -> Error:
    return kind(detail, **attributes)


class InvalidArgumentError(Error, ValueError):
    """An argument is out of range or malformed; the message names it."""


class NotFoundError(Error, LookupError):
    """No such image, object, vocabulary, collection or file."""


class ConflictError(Error):
    """The state forbids it: another model, a name that is taken, no vocabulary yet."""


class CorruptError(Error):
    """Stored data or a weight file fail their checks."""


class UnsupportedMediaTypeError(Error):
    """Not a type of image (or of body) that Pliant reads."""


class TooLargeError(Error):
    """Over a limit on bytes, pixels or memory."""


class UnprocessableError(Error):
    """The right type, but it decodes badly or has too few features."""


class UnavailableError(Error):
    """Busy; trying later may succeed."""


class NoSpaceError(Error):
    """The disk is full, or the file could not be written."""


class CancelledError(Error):
    """Stopped on request; what was reported as done is done."""


class InternalError(Error):
    """A defect in Pliant, or damaged data on a server, whose log has the request id."""


class ReadOnlyError(Error):
    """It may not be written."""


class UnauthorizedError(Error):
    """A server wants a key, or does not know the one it was shown."""


class ForbiddenError(Error):
    """The key's scope does not include this."""


class ConnectionFailedError(Error, ConnectionError):
    """No server answers at that address, or the connection ended early."""
