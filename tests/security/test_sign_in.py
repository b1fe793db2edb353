"""Signing in: nobody guesses their way in, and nobody who guesses keeps the true researcher out."""

import functools
import threading
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path

import pytest
from flask import Flask

from tests.web.people import SAME_SITE, Clock, Visitor
from tests.web.reading import num_rows
from tests.web.researchers import LONG_AGO, NAME, PASSWORD, sign_in
from webapp.config import Config
from webapp.storage import researchers as storage
from webapp.storage.accounts import change_password, create_researcher
from webapp.views.researcher import signing_in
from webapp.views.services import services_of

HOURS = 6


@pytest.fixture
def office(app: Flask) -> Visitor:
    """The browser that a researcher signs in from every day, signed out for now."""
    create_researcher(services_of(app).database, NAME, PASSWORD, LONG_AGO)
    visitor = Visitor(app)
    assert sign_in(visitor).status_code == 303
    assert visitor.post("/researcher/sign-out").status_code == 303
    return visitor


def guess_for_hours(app: Flask, clock: Clock, name: str = NAME) -> int:
    """Guess as soon as it is allowed again; return how many guesses were looked at."""
    attacker, looked_at, end = Visitor(app), 0, clock.time + timedelta(hours=HOURS)
    while clock.time < end:
        answer = sign_in(attacker, name, "wrong password")
        looked_at += answer.status_code == 422
        clock.wait(seconds=int(answer.headers.get("Retry-After", 0)))
    while sign_in(attacker, name, "wrong password").status_code != 429:
        pass
    return looked_at


def test_who_guesses_for_hours_keeps_nobody_out_of_their_own_browser(app: Flask, clock: Clock, office: Visitor) -> None:
    assert guess_for_hours(app, clock) < 10 + 4 * HOURS + 10
    assert sign_in(Visitor(app)).status_code == 429
    assert sign_in(office, NAME, "mistyped").status_code == 422
    assert sign_in(office).headers["Location"] == "/researcher/"


def test_without_the_known_browser_the_researcher_would_be_kept_out(
    app: Flask, clock: Clock, office: Visitor, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The control."""
    monkeypatch.setattr(signing_in, "_known_browser", lambda _name: None)
    guess_for_hours(app, clock)
    assert sign_in(office).status_code == 429


def test_after_the_wait_a_new_browser_is_let_in_too(app: Flask, clock: Clock, office: Visitor) -> None:
    assert office
    guess_for_hours(app, clock)
    clock.wait(minutes=15)
    assert sign_in(Visitor(app)).status_code == 303


def test_a_known_browser_is_slowed_down_by_its_own_guesses_alone(app: Flask, clock: Clock, office: Visitor) -> None:
    for _ in range(9):
        refused = sign_in(office, NAME, "wrong password").status_code
    assert refused == 429
    clock.wait(minutes=1)
    assert sign_in(Visitor(app)).status_code == 303


@pytest.mark.parametrize("spoil", [str.upper, lambda mark: mark[:-1] + "0", lambda mark: "x" + mark, lambda _mark: "."])
def test_the_mark_of_a_browser_cannot_be_made_up(
    app: Flask, clock: Clock, office: Visitor, spoil: Callable[[str], str]
) -> None:
    cookie = office.client.get_cookie("browser")
    assert cookie is not None
    spoiled = spoil(cookie.value)
    if spoiled == cookie.value:
        spoiled += "1"
    guess_for_hours(app, clock)
    forger = Visitor(app)
    forger.client.set_cookie("browser", spoiled)
    assert sign_in(forger).status_code == 429


def test_the_mark_counts_for_one_account_alone(app: Flask, clock: Clock, office: Visitor) -> None:
    create_researcher(services_of(app).database, "colleague", PASSWORD, LONG_AGO)
    guess_for_hours(app, clock, "colleague")
    assert sign_in(office, "colleague").status_code == 429


def test_the_mark_opens_nothing(office: Visitor) -> None:
    assert office.client.get_cookie("browser") is not None
    assert office.get("/researcher/").headers["Location"] == "/researcher/sign-in"


def test_the_throttle_is_shared_by_servers_and_outlives_them(
    instance: Path, start_app: Callable[[Config], Flask]
) -> None:
    apps = [start_app(Config(instance)) for _ in range(2)]
    create_researcher(services_of(apps[0]).database, NAME, PASSWORD, LONG_AGO)
    for number in range(12):
        sign_in(Visitor(apps[number % 2]), NAME, "wrong password")
    later = start_app(Config(instance))
    assert [sign_in(Visitor(app)).status_code for app in (*apps, later)] == [429] * 3


def test_made_up_names_fill_no_disk(app: Flask, instance: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(storage, "_BUCKET_DIGITS", 1)
    monkeypatch.setattr(storage, "_verify", lambda _hashed, _password: False)
    for number in range(100):
        sign_in(Visitor(app), f"made up {number}", "x")
    assert num_rows(instance, "sign_in_attempts") <= 16


def test_many_strangers_at_once_wait_for_no_thread_and_known_browsers_go_first(
    app: Flask, office: Visitor, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Six wait or are looked at; the seventh is told to come again, and the eight threads of a server never fill up."""
    inside, release = threading.Semaphore(0), threading.Event()
    verify = storage._verify

    def slow(hashed: str, password: str) -> bool:
        if password == "slow":  # noqa: S105
            inside.release()
            release.wait(30)
            return False
        return verify(hashed, password)

    monkeypatch.setattr(storage, "_verify", slow)
    threads = [threading.Thread(target=sign_in, args=(Visitor(app), f"name {number}", "slow")) for number in range(6)]
    for thread in threads:
        thread.start()
    for _ in threads:
        assert inside.acquire(timeout=30)
    refused = sign_in(Visitor(app), "one more", "slow")
    known = sign_in(office)
    release.set()
    for thread in threads:
        thread.join()
    assert (refused.status_code, refused.headers["Retry-After"]) == (429, "1")
    assert known.status_code == 303
    assert sign_in(Visitor(app), "one more", "wrong").status_code == 422


def test_an_unknown_name_costs_the_same_hash_as_a_wrong_password(
    app: Flask, office: Visitor, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert office
    verified: list[str] = []
    verify = storage._HASHER.verify

    class Counted:
        def verify(self, hashed: str, password: str) -> bool:
            verified.append(hashed.rpartition("$")[0].rpartition("$")[0])
            return bool(verify(hashed, password))

    storage._nobodys_hash()
    monkeypatch.setattr(storage, "_HASHER", Counted())
    told = {name: sign_in(Visitor(app), name, "wrong password") for name in (NAME, "nobody")}
    assert verified == ["$argon2id$v=19$m=19456,t=2,p=1"] * 2
    texts = {answer.text.replace(NAME, "X").replace("nobody", "X") for answer in told.values()}
    assert len(texts) == 1
    assert len({answer.status_code for answer in told.values()}) == 1
    assert len({tuple(sorted(answer.headers.items())) for answer in told.values()}) <= 2


def test_another_session_begins_at_every_sign_in_and_an_old_token_is_never_taken_up(
    app: Flask, office: Visitor
) -> None:
    planted = Visitor(app)
    planted.client.set_cookie("researcher", "planted")
    assert sign_in(planted).status_code == 303
    cookie = planted.client.get_cookie("researcher")
    assert cookie is not None
    assert cookie.value != "planted"
    assert len(cookie.value) >= 43  # 256 bits in base64
    assert office.get("/researcher/").status_code == 303


def test_another_password_ends_every_session(app: Flask, office: Visitor) -> None:
    browsers = [office, Visitor(app), Visitor(app)]
    for browser in browsers:
        assert sign_in(browser).status_code == 303
    change_password(services_of(app).database, NAME, "another horse battery", "command line", LONG_AGO)
    for browser in browsers:
        assert browser.get("/researcher/").headers["Location"] == "/researcher/sign-in"
    assert sign_in(office).status_code == 422


@pytest.mark.parametrize("https", [False, True])
def test_every_cookie_is_closed(instance: Path, start_app: Callable[[Config], Flask], https: bool) -> None:
    app = start_app(Config(instance, https=https))
    create_researcher(services_of(app).database, NAME, PASSWORD, LONG_AGO)
    base = "https://localhost" if https else "http://localhost"
    client = app.test_client()
    client.get = functools.partial(client.get, base_url=base)  # type: ignore[method-assign]
    client.post = functools.partial(client.post, base_url=base, headers=SAME_SITE)  # type: ignore[method-assign]
    answers = [
        client.post("/researcher/sign-in", data={"name": NAME, "password": PASSWORD}),
        client.post("/researcher/sign-out"),
        client.post("/consent", data={"agree": "yes", "nonce": "0" * 32}),
        client.get("/study/9"),
    ]
    cookies = [cookie for answer in answers for cookie in answer.headers.getlist("Set-Cookie")]
    names = {cookie.partition("=")[0] for cookie in cookies}
    prefix = "__Host-" if https else ""
    assert names == {f"{prefix}{name}" for name in ("researcher", "browser", "participant", "notice")}
    for cookie in cookies:
        parts = cookie.split("; ")[1:]
        assert "HttpOnly" in parts, cookie
        assert "Path=/" in parts, cookie
        assert ("Secure" in parts) == https, cookie
        assert not [part for part in parts if part.startswith("Domain")], cookie
        wish = "Strict" if "researcher" in cookie or "browser" in cookie else "Lax"
        is_deleted = "Max-Age=0" in parts
        assert is_deleted or f"SameSite={wish}" in parts, cookie
        assert len(cookie.partition(";")[0]) < 4096


def test_failures_and_refusals_are_logged_without_names(
    app: Flask, office: Visitor, caplog: pytest.LogCaptureFixture
) -> None:
    create_researcher(services_of(app).database, "looker", PASSWORD, LONG_AGO, "viewer")
    sign_in(office, "somebody", "a secret that was mistyped")
    for _ in range(8):
        sign_in(office, NAME, "wrong password")
    viewer = Visitor(app)
    sign_in(viewer, "looker")
    viewer.get("/researcher/unblind")
    viewer.client.post("/leave", headers={"Sec-Fetch-Site": "cross-site"})
    viewer.client.get("/", headers={"Host": "evil.example"})
    told = caplog.text
    for words in ("a sign-in failed", "not looked at", "it needs owner", "CrossSiteError", "SecurityError"):
        assert words in told
    for secret in (NAME + " ", "somebody", "mistyped", "looker", "evil.example", "wrong password"):
        assert secret not in told.replace("researcher.", "")
