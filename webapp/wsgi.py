"""What gunicorn serves: `webapp.wsgi:live()`, or `webapp.wsgi:test_run()`. `xar serve --workers` starts it."""

import errno
import os
import sys
import time
from collections.abc import Iterable
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
    """Let what is left of a form be read before the answer goes out, such as where nothing can be stored anyway.

    gunicorn would read it afterwards, and with it the beginning of the connection's next request, if that is there by
    then; and nobody would hear of that request any more. What is too long, or does not come, is not waited for: the
    connection is closed then.
    """
    answer = app.wsgi_app

    def read_and_answer(environ: "WSGIEnvironment", start_response: "StartResponse") -> Iterable[bytes]:
        body, left = environ["wsgi.input"], _MAX_LEFT_BYTES
        length = int(environ.get("CONTENT_LENGTH") or 0)
        if length > left:
            return answer(environ, start_response)
        if 0 < length <= MAX_BODY_BYTES:
            # Whoever takes their time sending it holds up nobody.
            environ["wsgi.input"] = BytesIO(body.read(length))
        answered, connection = answer(environ, start_response), environ["gunicorn.socket"]
        before = connection.gettimeout()
        connection.settimeout(_PART_WITHIN_S)
        try:
            while left > 0 and (part := body.read(min(left, _PART_BYTES))):
                left -= len(part)
        except OSError as error:
            raise ConnectionResetError(errno.ECONNRESET, "the rest of a form did not come") from error
        finally:
            connection.settimeout(before)
        return answered

    app.wsgi_app = read_and_answer  # type: ignore[method-assign]
    return app
