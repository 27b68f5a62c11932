# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""The answers of a server that are no success, as exceptions. Private."""
from __future__ import annotations

import email.utils
import json
import time
from email.message import Message
from typing import Any

from pliant import errors

_BY_STATUS: dict[int, type[errors.Error]] = {
    400: errors.InvalidArgumentError, 401: errors.UnauthorizedError, 403: errors.ForbiddenError,
    404: errors.NotFoundError, 409: errors.ConflictError, 412: errors.ConflictError, 413: errors.TooLargeError,
    415: errors.UnsupportedMediaTypeError, 422: errors.UnprocessableError, 429: errors.UnavailableError,
    500: errors.InternalError, 503: errors.UnavailableError, 507: errors.NoSpaceError,
}


def retry_after(headers: Message) -> float | None:
    """Seconds that the answer asks to wait (RFC 9110: a number, or a date); None where it does not."""
    given = headers.get("Retry-After")
    if given is None:
        return None
    value = str(given)
    if value.strip().isdecimal():
        return float(value)
    try:
        return max(0.0, email.utils.parsedate_to_datetime(value).timestamp() - time.time())
    except (TypeError, ValueError):
        return None


def error(status: int, headers: Message, body: bytes) -> errors.Error:
    """Of problem+json, or of whatever something between the server and here said."""
    return of_problem(status, _document(headers, body), request_id=headers.get("X-Request-Id"),
                      wait_s=retry_after(headers))


def of_problem(status: int, problem: dict[str, Any], *, request_id: str | None = None,
               wait_s: float | None = None) -> errors.Error:
    """Of a problem document, as it comes or inside of an answer."""
    kind = _BY_STATUS.get(status, errors.Error)
    code = _text(problem.get("code"))
    if status == 500 and code == "read_only":
        kind = errors.ReadOnlyError
    title = _text(problem.get("title"))
    return kind(_text(problem.get("detail")) or title or f"the server answered {status}", code=code or f"http_{status}",
                status=status, title=title, parameter=_text(problem.get("parameter")),
                request_id=_text(problem.get("request_id")) or request_id, retry_after=wait_s, problem=problem)


def of_job(job: dict[str, Any]) -> errors.Error:
    """Of a job that did not come to a good end."""
    if job["state"] == "cancelled":
        return errors.CancelledError(f"job {job['id']} was cancelled", code="cancelled", problem=job)
    problem = job.get("problem") or {}
    return errors.Error(problem.get("detail") or f"job {job['id']} {job['state']}", code=problem.get("code") or "job_failed",
                        problem=job)


def _document(headers: Message, body: bytes) -> dict[str, Any]:
    if "json" not in headers.get("Content-Type", ""):
        return {}
    try:
        document = json.loads(body)
    except ValueError:
        return {}
    return document if isinstance(document, dict) else {}


def _text(value: Any) -> str | None:
    return value if isinstance(value, str) else None
