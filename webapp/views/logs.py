"""What the server writes about its work: one JSON object per line, with nothing in it that came from a participant.

A path holds page numbers and a query ids, an exception's message may quote what was sent, and servers put addresses
into theirs. So of a request only its route's pattern is told, of an exception where it happened and its kind, and of
what other packages have to say their own words without what they filled in.
"""

import json
import logging
import secrets
import time
import traceback
from datetime import UTC, datetime
from typing import Any

from flask import Flask, Response, g, request

REQUESTS = "webapp.views.requests"
"""The logger of the lines about requests."""

_OURS = "webapp."
_METHODS = frozenset({"GET", "HEAD", "POST", "OPTIONS", "PUT", "PATCH", "DELETE", "TRACE", "CONNECT"})
_WITHHELD = "(words withheld: they may quote a request)"
_ITS_OWN_WORDS = frozenset({"DatabaseError", "InstanceError", "ConfigError"})
_Error = BaseException | None


class JsonFormatter(logging.Formatter):
    """One JSON object per line; nothing about who asked is ever put in."""

    def format(self, record: logging.LogRecord) -> str:
        """Write time (UTC), level, logger, message, the fields that come with it, and the traceback if there is one."""
        line: dict[str, Any] = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname,
            "logger": record.name,
            "message": _message(record),
        }
        line |= getattr(record, "fields", {})
        if not record.name.startswith(_OURS):
            line["source"] = f"{record.module}:{record.lineno}"
        if record.exc_info and record.exc_info[1] is not None:
            line["traceback"] = _traceback(record.exc_info[1])
        # Escapes beyond ASCII keep terminals and line-based readers from being misled.
        return json.dumps(line, ensure_ascii=True)


def configure_logging(*, with_requests: bool) -> None:
    """Let everything in this process be written by `JsonFormatter`, what Waitress and gunicorn say included.

    Args:
        with_requests: Whether to write a line for each request.
    """
    handler = logging.StreamHandler()
    handler.setFormatter(JsonFormatter())
    logging.basicConfig(level=logging.WARNING, handlers=[handler], force=True)
    # A few waiting requests are no event.
    logging.getLogger("waitress.queue").setLevel(logging.ERROR)
    logging.getLogger(REQUESTS).setLevel(logging.INFO if with_requests else logging.WARNING)
    for name in ("gunicorn.error", "gunicorn.access"):
        logger = logging.getLogger(name)
        logger.handlers.clear()
        logger.propagate = name == "gunicorn.error"


def init_request_log(app: Flask) -> None:
    """Number every request at random, and write a line about it where that is wanted."""
    logger = logging.getLogger(REQUESTS)

    @app.before_request
    def _begin() -> None:
        g.began = time.perf_counter()

    @app.after_request
    def _end(response: Response) -> Response:
        if logger.isEnabledFor(logging.INFO):
            fields = {**request_fields(), "status": response.status_code}
            if "began" in g:
                fields["duration_ms"] = round((time.perf_counter() - g.began) * 1000, 1)
            logger.info("request", extra={"fields": fields})
        return response


def request_id() -> str:
    """Return the random number of the current request, by which a line of the log is found: 16 hexadecimal digits."""
    if "request_id" not in g:
        g.request_id = secrets.token_hex(8)
    number: str = g.request_id
    return number


def request_fields() -> dict[str, Any]:
    """Return what may be told about the current request: method, the pattern of its route, its random number."""
    return {
        "method": request.method if request.method in _METHODS else "other",
        "route": None if request.url_rule is None else request.url_rule.rule,
        "request": request_id(),
    }


def _message(record: logging.LogRecord) -> str:
    """Return a record's words; of other packages only those that stand in their code, and numbers."""
    if record.name.startswith(_OURS):
        return record.getMessage()
    if not record.args or not isinstance(record.msg, str):
        return _WITHHELD
    given = record.args if isinstance(record.args, tuple) else (record.args,)
    try:
        return record.msg % tuple(_Number(value) if isinstance(value, int | float) else "..." for value in given)
    except (TypeError, ValueError):
        return _WITHHELD


class _Number(float):
    """A number that every kind of placeholder can show."""

    def __str__(self) -> str:
        return f"{float(self):g}"

    __repr__ = __str__


def _traceback(error: BaseException) -> str:
    """Return where an exception happened and of which kind it is, from its first cause on.

    A cause is told without the places that what it led to passed through as well: what a database refuses is raised by
    the driver and once more by SQLAlchemy, with the same places.
    """
    told: list[str] = []
    seen: set[int] = set()
    places: set[tuple[str, int | None, str]] = set()
    current: _Error = error
    while current is not None and id(current) not in seen:
        seen.add(id(current))
        frames = traceback.extract_tb(current.__traceback__)
        fresh = [frame for frame in frames if (frame.filename, frame.lineno, frame.name) not in places]
        places.update((frame.filename, frame.lineno, frame.name) for frame in frames)
        told.append("".join(traceback.format_list(fresh)) + _kind(current))
        current = current.__cause__ or (None if current.__suppress_context__ else current.__context__)
    return "\n".join(reversed(told))


def _kind(error: BaseException) -> str:
    """Name an exception, with its own words where these cannot quote anybody."""
    kind = type(error)
    name = f"{kind.__module__}.{kind.__qualname__}".removeprefix("builtins.")
    if isinstance(error, OSError) and error.strerror:
        return f"{name}: {error.strerror}"
    is_ours = kind.__module__.startswith(_OURS) and kind.__name__ in _ITS_OWN_WORDS
    # SQLite names tables and columns, never values; PostgreSQL quotes values, so of its errors only the code is told.
    if is_ours or kind.__module__ == "sqlite3":
        return f"{name}: {error}"
    state = getattr(error, "sqlstate", None)
    return name if state is None else f"{name}: {state}"
