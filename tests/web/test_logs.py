"""What the server writes about its work holds nothing of who asked, whatever they send."""

import http.client
import io
import json
import logging
import re
import signal
import socket
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from flask import Flask
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from sqlalchemy import text

from tests.web.people import SAME_SITE, Visitor
from tests.web.servers import serving
from webapp.config import Config
from webapp.views.logs import REQUESTS, JsonFormatter, configure_logging
from webapp.views.services import services_of

MARKER = "Zq7personal"
"""Begins whatever a client chooses, so that it is found wherever it turns up."""


@pytest.fixture
def log() -> Iterator[io.StringIO]:
    """What is logged, at every level."""
    written = io.StringIO()
    handler = logging.StreamHandler(written)
    handler.setFormatter(JsonFormatter())
    root, requests = logging.getLogger(), logging.getLogger(REQUESTS)
    before = root.level, requests.level
    root.addHandler(handler)
    root.setLevel(logging.DEBUG)
    requests.setLevel(logging.INFO)
    yield written
    root.removeHandler(handler)
    root.setLevel(before[0])
    requests.setLevel(before[1])


@pytest.fixture
def failing(instance: Path, start_app: Callable[[Config], Flask]) -> Flask:
    """An app with routes that fail in ways that quote what was sent."""
    app = start_app(Config(instance))
    app.testing = False

    @app.get("/fail/number/<word>")
    def number(word: str) -> str:
        return str(int(word))

    @app.get("/fail/query/<word>")
    def query(word: str) -> str:
        with services_of(app).database.read() as connection:
            connection.execute(text("SELECT missing FROM participants WHERE code = :code"), {"code": word})
        return ""

    @app.get("/fail/cause/<word>")
    def cause(word: str) -> str:
        try:
            return dict[str, str]()[word]
        except KeyError as error:
            raise RuntimeError(f"no {word}") from error

    @app.get("/fail/file/<word>")
    def file(word: str) -> str:
        return Path(word).read_text(encoding="utf-8")

    return app


def lines(log: io.StringIO) -> list[dict[str, Any]]:
    return [json.loads(line) for line in log.getvalue().splitlines()]


def test_a_line_about_a_request_names_the_pattern_and_nothing_else(app: Flask, log: io.StringIO) -> None:
    visitor = Visitor(app)
    visitor.agree()
    visitor.get(f"/study/1?PROLIFIC_PID={MARKER}")
    line = [line for line in lines(log) if line["logger"] == REQUESTS][-1]
    assert set(line) == {"time", "level", "logger", "message", "method", "route", "request", "status", "duration_ms"}
    assert (line["method"], line["route"], line["status"]) == ("GET", "/study/<int:number>", 200)
    assert re.fullmatch(r"[0-9a-f]{16}", line["request"])
    assert 0 <= line["duration_ms"] < 60_000


def test_without_the_setting_requests_are_not_logged(app: Flask, log: io.StringIO) -> None:
    logging.getLogger(REQUESTS).setLevel(logging.WARNING)
    app.test_client().get("/")
    assert lines(log) == []


def test_an_error_page_shows_the_number_that_finds_its_line(failing: Flask, log: io.StringIO) -> None:
    answer = failing.test_client().get("/fail/number/three")
    assert answer.status_code == 500
    (error,) = [line for line in lines(log) if line["level"] == "ERROR"]
    assert (error["method"], error["route"]) == ("GET", "/fail/number/<word>")
    assert error["request"] in answer.text
    assert "in number" in error["traceback"]
    assert error["traceback"].endswith("ValueError")
    assert [line["request"] for line in lines(log) if line["logger"] == REQUESTS] == [error["request"]]


def test_pages_without_an_error_show_no_number(app: Flask) -> None:
    assert "&middot;" not in app.test_client().get("/nowhere").text


@pytest.mark.parametrize("kind", ["number", "query", "cause", "file"])
def test_exceptions_that_quote_what_was_sent_are_told_without(failing: Flask, log: io.StringIO, kind: str) -> None:
    assert failing.test_client().get(f"/fail/{kind}/{MARKER}").status_code in {500, 503}
    assert MARKER not in log.getvalue()
    assert "Traceback" in log.getvalue() or 'File \\"' in log.getvalue()


@pytest.mark.parametrize("kind", ["number", "query", "cause", "file"])
def test_a_failure_is_one_line_that_tells_each_place_once(failing: Flask, log: io.StringIO, kind: str) -> None:
    """The database's exceptions come in pairs, the driver's and SQLAlchemy's, with the same places in both."""
    failing.test_client().get(f"/fail/{kind}/{MARKER}")
    (error,) = [line for line in lines(log) if line["level"] == "ERROR"]
    places = re.findall(r"^  File .*$", error["traceback"], re.MULTILINE)
    assert sorted(places) == sorted(set(places))
    assert any(place.endswith(f"in {kind}") for place in places)


def test_the_cause_of_a_failure_is_told_before_it(failing: Flask, log: io.StringIO) -> None:
    failing.test_client().get(f"/fail/cause/{MARKER}")
    (error,) = [line for line in lines(log) if line["level"] == "ERROR"]
    told = [line for line in error["traceback"].splitlines() if not line.startswith(" ")]
    assert told == ["KeyError", "RuntimeError"]
    assert error["traceback"].count("in cause\n") == 2


def test_the_usual_formatter_would_have_quoted_it(failing: Flask) -> None:
    """The control: what is kept out is there to be kept out."""
    written = io.StringIO()
    handler = logging.StreamHandler(written)
    logging.getLogger().addHandler(handler)
    failing.test_client().get(f"/fail/cause/{MARKER}")
    logging.getLogger().removeHandler(handler)
    assert MARKER in written.getvalue()


_PRINTABLE = st.text(st.characters(min_codepoint=33, max_codepoint=126, exclude_characters='%#?&;"\\'), max_size=12)
_TAILS = st.one_of(_PRINTABLE, st.sampled_from(["\u2028{}", "\x1b[2J", '"}{"', "%s%n", "\x9b", "\ud7ff", "'--", "{0}"]))


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(st.lists(_TAILS, min_size=8, max_size=8), st.sampled_from(["GET", "POST", "PUT", f"{MARKER}"]))
def test_whatever_a_client_sends_no_line_holds_it(
    failing: Flask, log: io.StringIO, tails: list[str], method: str
) -> None:
    """Property: path, query, form, cookies, headers and method never turn up, and every line is one JSON object."""
    path, query, field, value, cookie, agent, name, place = (f"{MARKER}{tail}" for tail in tails)
    client = failing.test_client()
    client.set_cookie("participant", cookie)
    client.set_cookie("researcher", cookie)
    headers = {"User-Agent": agent, "Referer": agent, "X-Forwarded-For": agent, "Origin": agent, "Accept": agent}
    headers = {key: "".join(c for c in text if " " <= c <= "\xff") for key, text in headers.items()}
    for where in (
        f"/{path}",
        f"/fail/number/{place}",
        f"/fail/cause/{place}",
        f"/study/{place}",
        "/researcher/sign-in",
    ):
        client.open(
            where,
            method=method,
            query_string={"PROLIFIC_PID": query, "SESSION_ID": query, "lang": query},
            data={field: value, "name": name, "password": value, "nonce": value} if method == "POST" else None,
            headers=headers if method != "POST" else headers | SAME_SITE,
        )
    written = log.getvalue()
    assert MARKER not in written
    assert written.isascii()
    assert all(isinstance(json.loads(line), dict) for line in written.splitlines())


def test_other_packages_words_are_told_without_what_they_filled_in() -> None:
    def said(name: str, message: str, *values: object) -> str:
        record = logging.LogRecord(name, logging.ERROR, __file__, 7, message, values, None)
        line = json.loads(JsonFormatter().format(record))
        assert line["source"] == "test_logs:7"
        return str(line["message"])

    assert said("waitress", "Exception while serving %s", f"/{MARKER}") == "Exception while serving ..."
    assert said("waitress.queue", "Task queue depth is %d", 5) == "Task queue depth is 5"
    assert MARKER not in said("gunicorn.error", f"Invalid request from ip={MARKER}: bad")
    assert MARKER not in said("webapp", f"Exception on /{MARKER} [GET]")


def test_a_line_break_or_a_quote_cannot_make_a_line_of_its_own() -> None:
    words = 'x\n{"level": "CRITICAL"}\r\u2028\x85"'
    record = logging.LogRecord("webapp.views.errors", logging.ERROR, __file__, 7, "%s", (words,), None)
    line = JsonFormatter().format(record)
    assert len(line.splitlines()) == 1
    assert json.loads(line)["message"] == words


def test_gunicorns_own_lines_take_the_same_way(monkeypatch: pytest.MonkeyPatch) -> None:
    root = logging.getLogger()
    monkeypatch.setattr(root, "handlers", list(root.handlers))
    level = root.level
    theirs = [logging.getLogger(f"gunicorn.{name}") for name in ("error", "access")]
    for logger in theirs:
        logger.addHandler(logging.NullHandler())
    configure_logging(with_requests=False)
    root.setLevel(level)
    assert [logger.handlers for logger in theirs] == [[], []]
    assert [logger.propagate for logger in theirs] == [True, False]


@pytest.mark.parametrize("access", ["yes", "no"])
def test_the_real_server_writes_nothing_of_hostile_clients(instance: Path, access: str) -> None:
    with serving(instance, XAR_ACCESS_LOG=access) as server:
        for request in _HOSTILE:
            with socket.create_connection(("127.0.0.1", server.port), timeout=10) as client:
                client.sendall(request.replace(b"PORT", str(server.port).encode()))
                client.shutdown(socket.SHUT_WR)
                with suppress(ConnectionError):
                    while client.recv(65536):
                        pass
        connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=10)
        connection.request("GET", f"/{MARKER}?{MARKER}", headers={"Cookie": f"participant={MARKER}"})
        assert connection.getresponse().status == 404
        connection.close()
        status, written = server.stop(signal.SIGTERM)
    assert status == 0
    assert MARKER not in written
    assert "127.0.0.1" not in written
    found = [json.loads(line) for line in written.splitlines()]
    requests = [line for line in found if line["logger"] == REQUESTS]
    assert (len(requests) >= 3) if access == "yes" else (requests == [])


_M = MARKER.encode()
_HOSTILE = (
    b"GET /%b HTTP/1.1\r\nHost: localhost:PORT\r\nUser-Agent: %b\r\nConnection: close\r\n\r\n" % (_M, _M),
    b"%b / HTTP/1.1\r\nHost: localhost:PORT\r\nConnection: close\r\n\r\n" % _M,
    b"GET / HTTP/1.1\r\nHost: %b\r\nConnection: close\r\n\r\n" % _M,
    b"GET / HTTP/1.1\r\n%b\r\n\r\n" % _M,
    b"%b\r\n\r\n" % (_M * 3),
    b"POST /consent HTTP/1.1\r\nHost: localhost:PORT\r\nTransfer-Encoding: chunked\r\n\r\n%b\r\n\r\n" % _M,
    b"POST /consent HTTP/1.1\r\nHost: localhost:PORT\r\nContent-Length: %b\r\n\r\n" % _M,
    b"POST /consent HTTP/1.1\r\nHost: localhost:PORT\r\nContent-Length: 999\r\n\r\n%b" % _M,
    b"GET /%b HTTP/1.1\r\nHost: localhost:PORT\r\nCookie: %b\r\n%b: %b\r\n\r\n" % (_M * 9000, _M, _M, _M),
)
