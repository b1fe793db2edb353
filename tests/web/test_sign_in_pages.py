"""The pages of signing in, out and of who may do what, word for word and cookie by cookie."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from flask import Flask

from tests.web.people import Clock, Visitor
from tests.web.researchers import LONG_AGO, NAME, PASSWORD, researcher_of, sign_in, unblind
from webapp.config import Config
from webapp.storage.accounts import create_researcher
from webapp.views.researcher.door import in_words
from webapp.views.services import services_of

DOOR = "/researcher/sign-in"


@pytest.fixture
def office(app: Flask) -> Visitor:
    """A browser that nobody has signed in from yet."""
    create_researcher(services_of(app).database, NAME, PASSWORD, LONG_AGO)
    return Visitor(app)


def errors(text: str) -> list[str]:
    return re.findall(r'<a href="#name">([^<]+)</a>', text)


def name_field(text: str) -> str:
    found = re.search(r'<input id="name"[^>]* value="([^"]*)"', text)
    assert found is not None, text
    return found[1]


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (0, "0 seconds"),
        (1, "1 second"),
        (2, "2 seconds"),
        (90, "90 seconds"),
        (91, "2 minutes"),
        (300, "5 minutes"),
        (900, "15 minutes"),
    ],
)
def test_a_wait_is_said_in_words(seconds: int, words: str) -> None:
    assert in_words(seconds) == words


def test_the_door_asks_and_has_nothing_to_complain_of(office: Visitor) -> None:
    page = office.get(DOOR)
    assert (page.status_code, errors(page.text), name_field(page.text)) == (200, [], "")
    assert "<title>Sign in" in page.text


def test_who_is_signed_in_is_led_from_the_door_to_the_overview(office: Visitor) -> None:
    answer = sign_in(office)
    assert (answer.status_code, answer.headers["Location"]) == (303, "/researcher/")
    again = office.get(DOOR)
    assert (again.status_code, again.headers["Location"]) == (303, "/researcher/")


def test_who_is_not_is_led_from_the_overview_to_the_door(office: Visitor) -> None:
    answer = office.get("/researcher/")
    assert (answer.status_code, answer.headers["Location"]) == (303, DOOR)


@pytest.mark.parametrize("path", ["status.json", "people.json"])
def test_a_page_that_polls_is_told_that_it_is_signed_out(office: Visitor, path: str) -> None:
    answer = office.get(f"/researcher/{path}")
    assert (answer.status_code, answer.get_json()) == (401, {"error": "signed out"})


def test_blanks_around_a_name_do_not_matter_and_around_a_password_they_do(office: Visitor, app: Flask) -> None:
    assert sign_in(office, NAME, f" {PASSWORD}").status_code == 422
    assert sign_in(office, NAME, f"{PASSWORD} ").status_code == 422
    assert sign_in(Visitor(app), f"  {NAME} ").status_code == 303


@pytest.mark.parametrize("form", [{}, {"name": NAME}, {"password": PASSWORD}, {"name": "", "password": ""}])
def test_a_form_without_name_or_password_is_a_wrong_one(office: Visitor, form: dict[str, str]) -> None:
    answer = office.post(DOOR, form)
    assert answer.status_code == 422
    assert errors(answer.text) == ["The name or the password is not right."]
    assert name_field(answer.text) == form.get("name", "")


def test_no_account_is_found_by_the_default_of_a_missing_name(office: Visitor, app: Flask) -> None:
    for number, name in enumerate(("None", "XX" + "XX", "xx" + "xx")):
        create_researcher(services_of(app).database, name, f"{PASSWORD} {number}", LONG_AGO)
        assert office.post(DOOR, {"password": f"{PASSWORD} {number}"}).status_code == 422


def test_too_many_attempts_are_answered_with_the_time_to_wait(
    office: Visitor, clock: Clock, caplog: pytest.LogCaptureFixture
) -> None:
    for _ in range(7):
        sign_in(office, NAME, "wrong password")
        clock.wait(seconds=3)
    sign_in(office, NAME, "wrong password")
    answer = sign_in(office)
    wait_s = int(answer.headers["Retry-After"])
    assert answer.status_code == 429
    assert errors(answer.text) == [f"There were too many attempts. Try again in {in_words(wait_s)}."]
    assert name_field(answer.text) == NAME
    told = [(record.levelname, record.getMessage()) for record in caplog.records if "sign-in" in record.getMessage()]
    assert told[0] == ("WARNING", "a sign-in failed")
    assert told[-1] == ("WARNING", f"a sign-in was not looked at: the next one is in {wait_s} s")


def cookies(answer_headers: list[str]) -> dict[str, set[str]]:
    return {text.partition("=")[0]: set(text.split("; ")[1:]) for text in answer_headers}


@pytest.mark.parametrize("https", [False, True])
def test_a_session_ends_with_the_browser_and_its_mark_is_kept_for_ninety_days(
    instance: Path, start_app: Callable[[Config], Flask], https: bool
) -> None:
    app = start_app(Config(instance, https=https))
    create_researcher(services_of(app).database, NAME, PASSWORD, LONG_AGO)
    set_now = cookies(sign_in(Visitor(app)).headers.getlist("Set-Cookie"))
    prefix = "__Host-" if https else ""
    closed = {"HttpOnly", "Path=/", "SameSite=Strict"} | ({"Secure"} if https else set())
    assert set_now[f"{prefix}researcher"] == closed
    marked = set_now[f"{prefix}browser"]
    assert f"Max-Age={90 * 24 * 3600}" in marked
    assert {part for part in marked if not part.startswith(("Max-Age", "Expires"))} == closed


def test_a_browser_keeps_its_id_and_another_has_another(office: Visitor, app: Flask) -> None:
    def browser_id(visitor: Visitor) -> str:
        cookie = visitor.client.get_cookie("browser")
        assert cookie is not None
        name, dot, mark = cookie.value.partition(".")
        assert (dot, len(mark)) == (".", 64)
        return name

    sign_in(office)
    first = browser_id(office)
    assert re.fullmatch(r"[0-9a-f]{32}", first)
    office.post("/researcher/sign-out")
    sign_in(office)
    assert browser_id(office) == first
    other = Visitor(app)
    sign_in(other)
    assert browser_id(other) != first


def test_signing_out_leads_to_the_door_and_takes_the_cookie_but_not_the_mark(office: Visitor) -> None:
    sign_in(office)
    answer = office.post("/researcher/sign-out")
    assert (answer.status_code, answer.headers["Location"]) == (303, DOOR)
    assert list(cookies(answer.headers.getlist("Set-Cookie"))) == ["researcher"]
    assert office.client.get_cookie("researcher") is None
    assert office.client.get_cookie("browser") is not None


def test_a_mark_that_is_no_mark_is_none(office: Visitor) -> None:
    for mark in ("", ".", "a", "a.", ".a", "a.b.c"):
        office.client.set_cookie("browser", mark)
        assert sign_in(office, NAME, "wrong password").status_code in {422, 429}
        office.client.delete_cookie("browser")


def test_the_dashboard_is_english_whatever_the_browser_asks_for(office: Visitor) -> None:
    page = office.client.get(DOOR, headers={"Accept-Language": "ja"})
    assert '<html lang="en"' in page.text


def test_a_viewer_is_told_which_role_is_needed(app: Flask, caplog: pytest.LogCaptureFixture) -> None:
    viewer = researcher_of(app, "viewer")
    answer = viewer.get("/researcher/unblind")
    assert answer.status_code == 403
    assert "owner" in answer.text
    assert "GET /researcher/unblind refused: it needs owner" in caplog.text
    assert viewer.get("/researcher/").status_code == 200


def test_a_view_that_asks_for_a_role_is_open_to_who_has_it(app: Flask) -> None:
    assert researcher_of(app, "owner", "one").get("/researcher/unblind").status_code == 200
    assert researcher_of(app, "admin", "two").get("/researcher/unblind").status_code == 200


def test_a_password_that_is_asked_again_must_be_right(app: Flask) -> None:
    owner = researcher_of(app)
    for given in ({"password": "wrong"}, {"password": ""}, {}):
        answer = owner.post("/researcher/unblind", {"reason": "The last person has finished", **given})
        assert answer.status_code == 422
        assert "You are not unblinded: the password is not right.</p>" in answer.text
    for _ in range(7):
        answer = unblind(owner, password="wrong")  # noqa: S106
    assert re.search(r"too many attempts; try again in \d+ seconds?", answer.text)
    assert answer.status_code == 422


def test_looking_on_keeps_a_session_alive_and_polling_does_not(office: Visitor, clock: Clock) -> None:
    sign_in(office)
    for _ in range(3):
        clock.wait(minutes=20)
        assert office.get("/researcher/").status_code == 200
    clock.wait(minutes=20)
    assert office.get("/researcher/status.json").status_code == 200
    assert office.client.get("/researcher/", headers={"X-Poll": "1"}).status_code == 200
    clock.wait(minutes=20)
    assert office.get("/researcher/").status_code == 303
