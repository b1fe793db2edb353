"""Which requests take the baton with PostgreSQL: participants', none that may take long or comes in parts."""

import socket
from collections.abc import Callable
from io import BytesIO
from pathlib import Path

import pytest
from flask import Flask, request
from werkzeug.test import Client

from tests.web.people import SAME_SITE
from webapp import wsgi
from webapp.app import MAX_BODY_BYTES, _one_at_a_time
from webapp.config import Config
from webapp.storage.baton import Baton
from webapp.views.services import services_of
from webapp.wsgi import _reading_to_the_end


@pytest.fixture
def app(app: Flask) -> Flask:
    """The app as with PostgreSQL, whichever edition keeps its data."""
    if services_of(app).config.database_url is None:
        baton = services_of(app).database.baton
        app.wsgi_app = _one_at_a_time(app.wsgi_app, baton)  # type: ignore[method-assign,assignment]
    return app


@pytest.fixture
def asked(app: Flask) -> dict[str, bool]:
    """By path, whether the thread that answered had the baton."""
    baton, found = services_of(app).database.baton, dict[str, bool]()

    @app.before_request
    def _note() -> None:
        found[request.path] = baton.is_mine

    return found


def test_participants_take_turns_and_nobody_waits_for_researchers(app: Flask, asked: dict[str, bool]) -> None:
    client = app.test_client()
    for path in ("/", "/study", "/pictures/0.png", "/researcher/", "/ask/", "/healthz"):
        client.get(path)
    client.post("/consent", data=b"agree=yes", headers={"Transfer-Encoding": "chunked", **SAME_SITE})
    assert asked == {
        "/": True,
        "/study": True,
        "/pictures/0.png": True,
        "/researcher/": False,
        "/ask/": False,
        "/healthz": False,
        "/consent": False,
    }
    assert not services_of(app).database.baton._lock.locked()


def test_an_error_keeps_no_baton(app: Flask) -> None:
    def _fail() -> str:
        raise ZeroDivisionError

    app.view_functions["arrival.welcome"] = _fail
    app.testing = False
    assert app.test_client().get("/").status_code == 500
    assert not services_of(app).database.baton._lock.locked()


PATIENCE_S = 10


class _Body:
    """What a browser sends, with a note of who waited for it."""

    def __init__(self, content: bytes, baton: Baton) -> None:
        self.waited_with: list[bool] = []
        self._content, self._baton = BytesIO(content), baton

    def read(self, size: int = -1) -> bytes:
        self.waited_with.append(self._baton.is_mine)
        return self._content.read(size)


@pytest.mark.parametrize(("size", "status"), [(10, 422), (MAX_BODY_BYTES, 422), (MAX_BODY_BYTES + 1, 413)])
def test_nobody_waits_while_a_form_is_sent_to_gunicorn(app: Flask, size: int, status: int) -> None:
    """It hands over a request whose body is still on its way."""
    body = _Body(b"nonce=".ljust(size, b"x"), services_of(app).database.baton)
    ours, theirs = socket.socketpair()
    with ours, theirs:
        client = Client(_reading_to_the_end(app))
        answer = client.post(
            "/consent",
            headers=SAME_SITE,
            content_type="application/x-www-form-urlencoded",
            environ_overrides={"gunicorn.socket": ours, "wsgi.input": body, "CONTENT_LENGTH": str(size)},
        )
    assert answer.status_code == status
    assert True not in body.waited_with
    assert body.waited_with


class _Silent:
    """A form that does not come, as gunicorn's socket tells."""

    def __init__(self, connection: socket.socket) -> None:
        self.waited_s: list[float | None] = []
        self._connection = connection

    def read(self, _size: int = -1) -> bytes:
        self.waited_s.append(self._connection.gettimeout())
        return self._connection.recv(1)


def _send(app: Flask, method: str, body: BytesIO | _Silent, connection: socket.socket) -> None:
    sent = {"gunicorn.socket": connection, "wsgi.input": body, "CONTENT_LENGTH": "9"}
    Client(_reading_to_the_end(app)).open("/consent", method=method, headers=SAME_SITE, environ_overrides=sent)


def test_a_form_that_is_cut_off_is_no_form(app: Flask) -> None:
    """Its end could be that of an answer: 1 for 10."""
    answered: list[int] = []
    app.before_request(lambda: answered.append(1))
    ours, theirs = socket.socketpair()
    with ours, theirs, pytest.raises(ConnectionResetError):
        _send(app, "POST", BytesIO(b"agree=y"), ours)
    assert not answered


@pytest.mark.parametrize("method", ["GET", "POST"])
def test_a_form_that_does_not_come_is_not_waited_for(app: Flask, method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(wsgi, "_PART_WITHIN_S", 0.05)
    ours, theirs = socket.socketpair()
    with ours, theirs:
        ours.settimeout(PATIENCE_S)
        silent = _Silent(ours)
        with pytest.raises(ConnectionResetError):
            _send(app, method, silent, ours)
        assert silent.waited_s == [0.05]
        assert ours.gettimeout() == PATIENCE_S


def test_only_postgresql_has_threads_take_turns(instance: Path, start_app: Callable[[Config], Flask]) -> None:
    app = start_app(Config(instance))
    baton, found = services_of(app).database.baton, list[bool]()
    app.before_request(lambda: found.append(baton.is_mine))
    app.test_client().get("/")
    assert found == [services_of(app).config.database_url is not None]
