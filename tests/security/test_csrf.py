"""Whatever changes something is taken from our own pages alone: every header that says so, on every such route."""

from collections.abc import Callable, Iterator
from itertools import product
from pathlib import Path

import pytest
from flask import Flask
from werkzeug.test import TestResponse

from tests.security.routes import CASES, Case, Who
from tests.security.stages import Running, filled, prepare
from tests.web.people import hidden_nonce
from webapp.config import Config
from webapp.views import security

SITES = (
    None,
    "same-origin",
    "none",
    "same-site",
    "cross-site",
    "nonsense",
    "",
    "Same-Origin",
    "same-origin, cross-site",
)
ORIGINS = (
    None,
    "http://localhost",
    "https://localhost",
    "http://evil.example",
    "null",
    "",
    "http://localhost.evil.example",
    "http://evil.example#@localhost",
    "http://localhost:8001",
    "localhost",
    "//localhost",
    "http://user@localhost",
)
OURS = {"http://localhost", "https://localhost", "//localhost"}


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    folder = tmp_path_factory.mktemp("csrf")
    one = Running(prepare("rating", folder / "stage"), folder / "copy")
    yield one
    one.close()


def headers(site: str | None, origin: str | None) -> dict[str, str]:
    given = {"Sec-Fetch-Site": site, "Origin": origin}
    return {name: value for name, value in given.items() if value is not None}


def is_taken(site: str | None, origin: str | None) -> bool:
    """What is specified: the browser's word on the site, and where it has none, the origin."""
    return site in {"same-origin", "none"} if site is not None else origin in OURS


def unsafe_cases() -> list[Case]:
    """One case of each unsafe rule that somebody is let in by."""
    found = {case.rule: case for case in reversed(CASES) if case.method == "POST" and case.stage == "rating"}
    return list(found.values())


def send(running: Running, case: Case, who: Who, site: str | None, origin: str | None) -> TestResponse:
    form = {name: filled(value, running.prepared.words) for name, value in case.form.items()}
    address = filled(case.address, running.prepared.words)
    return running.client(who).post(address, data=form, headers=headers(site, origin))


def test_every_unsafe_rule_is_among_them(running: Running) -> None:
    rules = {rule.rule for rule in running.app.url_map.iter_rules() if "POST" in (rule.methods or set())}
    assert rules - {case.rule for case in unsafe_cases()} == set()


@pytest.mark.parametrize("who", ["nobody", "A", "admin"])
def test_a_foreign_form_is_refused_on_every_unsafe_route_and_stores_nothing(running: Running, who: Who) -> None:
    for case, (site, origin) in product(unsafe_cases(), product(SITES, ORIGINS)):
        if not is_taken(site, origin):
            answer = send(running, case, who, site, origin)
            assert answer.status_code == 403, (case.name, site, origin)
    assert not running.has_changed()


@pytest.mark.parametrize(("site", "origin"), [pair for pair in product(SITES, ORIGINS) if is_taken(*pair)])
def test_our_own_form_is_taken(running: Running, site: str | None, origin: str | None) -> None:
    """On one route that stores something; that the check is the same for all is what the other test shows."""
    leave = next(case for case in CASES if case.method == "POST" and case.rule == "/leave")
    answer = send(running, leave, "A", site, origin)
    assert (answer.status_code, running.has_changed()) == (303, True)


def test_by_https_an_origin_without_is_foreign(instance: Path, start_app: Callable[[Config], Flask]) -> None:
    app = start_app(Config(instance, https=True))
    client = app.test_client()
    form = {"agree": "yes", "nonce": hidden_nonce(client.get("/"))}
    assert client.post("/consent", data=form, headers={"Origin": "http://localhost"}).status_code == 403
    assert client.post("/consent", data=form, headers={"Origin": "https://localhost"}).status_code == 303


def test_a_nonce_does_not_make_up_for_a_foreign_origin_nor_an_origin_for_a_nonce(running: Running) -> None:
    right = next(case for case in CASES if case.what == "the form of A" and case.stage == "rating")
    assert send(running, right, "A", "cross-site", "http://localhost").status_code == 403
    without = next(case for case in CASES if case.what == "no nonce")
    assert send(running, without, "A", "same-origin", None).headers["Location"] == "/study/3"
    assert not running.has_changed()


def test_without_the_check_foreign_forms_are_taken(running: Running, monkeypatch: pytest.MonkeyPatch) -> None:
    """The control."""
    monkeypatch.setattr(security, "_SAFE_METHODS", frozenset({"GET", "POST"}))
    leave = next(case for case in CASES if case.method == "POST" and case.rule == "/leave")
    assert send(running, leave, "A", "cross-site", "http://evil.example").status_code == 303
    assert running.has_changed()
