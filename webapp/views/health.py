"""Whether the server can do its work, for whoever watches over it."""

import threading
import time
from collections.abc import Callable
from http import HTTPStatus

from flask import Blueprint, Flask, Response, current_app, jsonify, request
from flask.blueprints import BlueprintSetupState

from webapp.storage.database import UnavailableError
from webapp.views.services import services_of

bp = Blueprint("health", __name__)

CHECK_INTERVAL_S = 1.0
"""At most one check is made in this time, however many ask."""
_SLOW_S = 2.0
"""After this long without an end, a check counts as failed."""
_EXTENSION = "xar-health"


class SharedCheck:
    """A check whose result is shared by all who ask within a second, so that asking costs nothing."""

    def __init__(self, check: Callable[[], None], clock: Callable[[], float] = time.monotonic) -> None:
        """Take a check that raises `UnavailableError` where it fails, and a clock in seconds."""
        self._check = check
        self._clock = clock
        self._lock = threading.Lock()
        self._began = float("-inf")
        self._is_running = False
        self._is_well = True

    def is_well(self) -> bool:
        """Tell whether the latest check succeeded; the first to ask after a second makes a new one."""
        with self._lock:
            age = self._clock() - self._began
            if self._is_running or age < CHECK_INTERVAL_S:
                return self._is_well and not (self._is_running and age > _SLOW_S)
            self._began, self._is_running = self._clock(), True
        is_well = False
        try:
            self._check()
            is_well = True
        except UnavailableError:
            pass  # That is the answer, and no event: what could not be stored is told where it happened.
        finally:
            with self._lock:
                self._is_well, self._is_running = is_well, False
        return is_well


@bp.record
def _prepare(state: BlueprintSetupState) -> None:
    app = state.app
    assert isinstance(app, Flask)  # noqa: S101 - for the type checker
    app.extensions[_EXTENSION] = SharedCheck(services_of(app).database.check_writable)


@bp.get("/healthz")
def health() -> tuple[Response, int, dict[str, str]]:
    """Answer 200 after a real write, undone again, and 503 if nothing can be written; it tells nothing about data.

    The body is `ok` or `unavailable`, as JSON where the request prefers that.
    """
    is_well = current_app.extensions[_EXTENSION].is_well()
    word = "ok" if is_well else "unavailable"
    if request.accept_mimetypes.best_match(["text/plain", "application/json"]) == "application/json":
        answer = jsonify(status=word)
    else:
        answer = Response(f"{word}\n", mimetype="text/plain")
    if is_well:
        return answer, HTTPStatus.OK, {}
    return answer, HTTPStatus.SERVICE_UNAVAILABLE, {"Retry-After": "5"}
