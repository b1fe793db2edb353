"""What holds for every route and every status: headers, and where forms may come from."""

import errno
import logging
import os
import sqlite3
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from pathlib import Path

import pytest
from flask import Flask, render_template
from werkzeug.test import TestResponse

from tests.web.people import SAME_SITE, Visitor, hidden_nonce
from tests.web.reading import num_rows
from webapp.config import Config
from webapp.storage import sqlite_edition

STRICT = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; "
    "connect-src 'self'; form-action 'self'; frame-ancestors 'none'; base-uri 'none'; object-src 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
}
METHODS = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS")


def every_route(app: Flask) -> Iterator[str]:
    for rule in app.url_map.iter_rules():
        path = rule.rule.replace("<int:number>", "1").replace("<digest>", "0" * 64)
        yield path.replace("<path:filename>", "css/base.css")


def assert_strict(answer: TestResponse) -> None:
    where = f"{answer.request.method} {answer.request.path}: {answer.status}"
    assert {name: answer.headers.get(name) for name in STRICT} == STRICT, where
    assert "Server" not in answer.headers
    is_static = answer.request.path.startswith("/static/")
    if not is_static and answer.mimetype == "text/html":
        assert answer.headers["Cache-Control"] == "no-store", where
        assert "Cookie" in answer.headers["Vary"], where


def test_every_route_answers_every_method_with_strict_headers_and_no_failure(app: Flask) -> None:
    with_place = Visitor(app)
    with_place.agree()
    clients = [app.test_client(), with_place.client]
    for path in [*every_route(app), "/nowhere", "/researcher"]:
        for method in METHODS:
            for client in clients:
                for headers in ({}, SAME_SITE):
                    answer = client.open(path, method=method, headers=headers, buffered=True)
                    assert answer.status_code < 500
                    assert_strict(answer)


def test_failures_have_strict_headers_too_and_say_nothing_about_who_asked(
    app: Flask, caplog: pytest.LogCaptureFixture
) -> None:
    def fail() -> str:
        raise KeyError("the cupboard is bare")

    app.add_url_rule("/fails", view_func=fail)
    client = app.test_client()
    origin = {"REMOTE_ADDR": "203.0.113.9"}
    with caplog.at_level(logging.DEBUG):
        answer = client.get("/fails?secret=1", environ_overrides=origin, headers={"User-Agent": "Teapot/4"})
    assert answer.status_code == 500
    assert_strict(answer)
    assert "cupboard" not in answer.text
    assert "cupboard" in caplog.text
    assert not [word for word in ("203.0.113.9", "Teapot", "secret") if word in caplog.text]


def test_too_much_is_refused_and_said_on_a_page(app: Flask) -> None:
    visitor = Visitor(app)
    visitor.agree()
    answer = visitor.post("/study/1", {"nonce": "x" * 70_000})
    assert answer.status_code == 413
    assert "larger than any page" in answer.text
    assert_strict(answer)
    parts = {f"part-{number}": "x" for number in range(101)}
    answer = visitor.client.post("/study/1", data=parts, headers=SAME_SITE, content_type="multipart/form-data")
    assert answer.status_code == 413
    assert_strict(answer)


def test_a_wrong_method_is_told_the_right_ones(app: Flask) -> None:
    answer = app.test_client().get("/consent")
    assert answer.status_code == 405
    assert "POST" in answer.headers["Allow"]


def test_another_name_for_the_server_is_refused(app: Flask) -> None:
    answer = app.test_client().get("/", headers={"Host": "evil.example"})
    assert answer.status_code == 400
    assert_strict(answer)
    assert app.test_client().get("/", headers={"Host": "127.0.0.1:8000"}).status_code == 200


def test_by_https_browsers_are_told_to_stay_with_it(instance: Path, start_app: Callable[[Config], Flask]) -> None:
    app = start_app(Config(instance, https=True))
    assert "max-age=31536000" in app.test_client().get("/").headers["Strict-Transport-Security"]
    plain = start_app(Config(instance))
    assert "Strict-Transport-Security" not in plain.test_client().get("/").headers


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"Sec-Fetch-Site": "same-origin"}, 303),
        ({"Sec-Fetch-Site": "none"}, 303),
        ({"Sec-Fetch-Site": "same-site"}, 403),
        ({"Sec-Fetch-Site": "cross-site"}, 403),
        ({"Sec-Fetch-Site": ""}, 403),
        ({"Sec-Fetch-Site": "cross-site", "Origin": "http://localhost"}, 403),
        ({"Sec-Fetch-Site": "same-origin", "Origin": "http://evil.example"}, 303),
        ({"Origin": "http://localhost"}, 303),
        ({"Origin": "https://localhost"}, 303),
        ({"Origin": "http://localhost:8001"}, 403),
        ({"Origin": "http://localhost.evil.example"}, 403),
        ({"Origin": "http://evil.example"}, 403),
        ({"Origin": "null"}, 403),
        ({"Origin": ""}, 403),
        ({}, 403),
    ],
)
def test_forms_are_taken_from_our_own_pages_alone(
    app: Flask, instance: Path, headers: Mapping[str, str], status: int
) -> None:
    client = app.test_client()
    form = {"agree": "yes", "nonce": hidden_nonce(client.get("/"))}
    assert client.post("/consent", data=form, headers=headers).status_code == status
    assert num_rows(instance, "participants") == (1 if status == 303 else 0)


def test_the_server_says_whether_it_can_store(app: Flask) -> None:
    answer = app.test_client().get("/healthz")
    assert (answer.status_code, answer.text) == (200, "ok\n")


@pytest.mark.sqlite_only(reason="it locks SQLite's file")
def test_when_nothing_can_be_stored_participants_are_asked_to_wait_and_lose_nothing(
    instance: Path, start_app: Callable[[Config], Flask], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sqlite_edition, "BUSY_TIMEOUT_S", 0.05)
    visitor = Visitor(start_app(Config(instance)))
    visitor.agree()
    form = {"nonce": visitor.nonce(1)}
    with closing(sqlite3.connect(instance / "xar.sqlite3")) as other:
        other.isolation_level = None
        other.execute("BEGIN IMMEDIATE")
        answer = visitor.post("/study/1", form)
        assert answer.status_code == 503
        assert answer.headers["Retry-After"] == "5"
        assert "did not work just now" in answer.text
        assert_strict(answer)
    assert num_rows(instance, "pages") == 0
    assert visitor.post("/study/1", form).headers["Location"] == "/study/2"


@pytest.mark.parametrize("number", [errno.EIO, errno.ENOSPC, errno.EMFILE])
def test_what_the_disk_does_not_give_or_take_is_told_as_a_wait(app: Flask, number: int) -> None:
    app.testing = False

    @app.get("/of-the-disk")
    def of_the_disk() -> str:
        raise OSError(number, os.strerror(number))

    @app.get("/of-the-program")
    def of_the_program() -> str:
        return render_template("there-is-no-such.html")  # Jinja calls this an OSError too, and waiting does not help.

    answer = app.test_client().get("/of-the-disk")
    assert (answer.status_code, answer.headers["Retry-After"]) == (503, "5")
    assert "did not work just now" in answer.text
    assert_strict(answer)
    answer = app.test_client().get("/of-the-program")
    assert (answer.status_code, answer.headers.get("Retry-After")) == (500, None)
