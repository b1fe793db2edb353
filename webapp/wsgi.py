"""What gunicorn serves: `webapp.wsgi:live()`, or `webapp.wsgi:test_run()`. `xar serve --workers` starts it."""

import errno
import os
import socket
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from io import BytesIO
from typing import TYPE_CHECKING

from flask import Flask

from webapp.app import MAX_BODY_BYTES, create_app
from webapp.config import Config, ConfigError, read_config
from webapp.stimuli.catalogue import BundleError
from webapp.storage.database import DatabaseError, UnreachableError
from webapp.storage.instance import InstanceError
from webapp.views.logs import configure_logging

if TYPE_CHECKING:
    from wsgiref.types import StartResponse, WSGIEnvironment

LIVE = "webapp.wsgi:live()"
TEST_RUN = "webapp.wsgi:test_run()"
"""The addresses of the two, for gunicorn."""

REFUSALS = (BundleError, ConfigError, DatabaseError, InstanceError)
"""What keeps a server from starting, told in one line."""

_MAX_LEFT_BYTES = 6 * 1024 * 1024
_PART_BYTES = 64 * 1024
_PART_WITHIN_S = 5.0
_CANNOT_BOOT = 3
"""The exit status by which gunicorn knows that another try would end in the same way."""


def live() -> Flask:
    """Put together the app that collects real data."""
    return _app(is_live=True)


def test_run() -> Flask:
    """Put together the app whose answers are marked as a test."""
    return _app(is_live=False)


def _app(*, is_live: bool) -> Flask:
    try:
        config = read_config(os.environ, live=is_live)
        if config.database_url is None:
            raise ConfigError("gunicorn serves PostgreSQL and DATABASE_URL is not set; `xar serve` serves SQLite")
        configure_logging(with_requests=config.access_log)
        return _reading_to_the_end(_patient_app(config))
    except REFUSALS as error:
        print(f"xar: {error}", file=sys.stderr)  # noqa: T201 - as the command line does.
        sys.exit(_CANNOT_BOOT)


def _patient_app(config: Config) -> Flask:
    """Wait for a database that is not back yet. The server was started with it there: see `gunicorn_settings`."""
    while True:
        try:
            return create_app(config)
        except UnreachableError:
            time.sleep(1)


def _reading_to_the_end(app: Flask) -> Flask:
    """Let a form be there before it is looked at, and what is left of longer ones be read before the answer goes out.

    gunicorn hands over a request before its form has come, so that whoever takes their time would hold up others, and
    takes one that is cut off for whole. What is left it would read after the answer, and with it the beginning of the
    connection's next request, if that is there by then; and nobody would hear of that request any more. What is too
    long, or does not come, is not waited for: the connection is closed then.
    """
    answer = app.wsgi_app

    def read_and_answer(environ: "WSGIEnvironment", start_response: "StartResponse") -> Iterable[bytes]:
        body, connection, left = environ["wsgi.input"], environ["gunicorn.socket"], _MAX_LEFT_BYTES
        length = int(environ.get("CONTENT_LENGTH") or 0)
        if length > left:
            return answer(environ, start_response)
        if 0 < length <= MAX_BODY_BYTES:
            with _no_part_late(connection):
                form = body.read(length)
            if len(form) < length:
                raise _cut_off()
            return answer({**environ, "wsgi.input": BytesIO(form)}, start_response)
        answered = answer(environ, start_response)
        with _no_part_late(connection):
            while left > 0 and (part := body.read(min(left, _PART_BYTES))):
                left -= len(part)
        return answered

    app.wsgi_app = read_and_answer  # type: ignore[method-assign]
    return app


@contextmanager
def _no_part_late(connection: socket.socket) -> Iterator[None]:
    before = connection.gettimeout()
    connection.settimeout(_PART_WITHIN_S)
    try:
        yield
    except OSError as error:
        raise _cut_off() from error
    finally:
        connection.settimeout(before)


def _cut_off() -> ConnectionResetError:
    """Return what gunicorn closes the connection for."""
    return ConnectionResetError(errno.ECONNRESET, "the rest of a form did not come")
