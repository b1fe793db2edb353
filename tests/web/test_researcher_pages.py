"""The dashboard: signing in, live numbers, the list of people, earlier versions, accounts."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from flask import Flask

from tests.web.bundles import read_study, write_bundle
from tests.web.people import SAME_SITE, Clock, Visitor
from tests.web.reading import ask, num_rows
from tests.web.researchers import LONG_AGO, NAME, PASSWORD, researcher_of, sign_in, unblind
from webapp.config import Config
from webapp.storage.accounts import create_researcher
from webapp.storage.exports import FILE_NAMES
from webapp.views.services import services_of

PAGES = ("", "people", "allocation", "quality", "results", "data", "records", "study", "preview", "accounts")
CLOSED = ("status.json", "people.json", "dataset.zip", "consort.svg", "unblind", *PAGES, *FILE_NAMES)


@pytest.fixture
def stranger(app: Flask) -> Visitor:
    create_researcher(services_of(app).database, NAME, PASSWORD, LONG_AGO)
    return Visitor(app)


@pytest.fixture
def researcher(stranger: Visitor) -> Visitor:
    assert sign_in(stranger).headers["Location"] == "/researcher/"
    return stranger


def test_everything_but_signing_in_is_closed_to_strangers(stranger: Visitor, app: Flask) -> None:
    for rule in app.url_map.iter_rules():
        if rule.endpoint.startswith("researcher.") and rule.rule != "/researcher/sign-in":
            path = re.sub("<int:number>", "1", re.sub(r"<(code|name)>", "somebody", rule.rule))
            for answer in (stranger.get(path), stranger.post(path)):
                refused = answer.headers.get("Location") == "/researcher/sign-in"
                assert refused or answer.status_code in {401, 405}, path
    assert stranger.get("/researcher/status.json").status_code == 401
    assert stranger.get("/researcher/people.json").status_code == 401


def test_signing_in_opens_and_signing_out_closes(researcher: Visitor) -> None:
    page = researcher.get("/researcher/")
    assert page.status_code == 200
    assert NAME in page.text
    assert researcher.get("/researcher/sign-in").headers["Location"] == "/researcher/"
    token = researcher.client.get_cookie("researcher")
    assert token is not None
    answer = researcher.post("/researcher/sign-out")
    assert "researcher=;" in answer.headers["Set-Cookie"]
    researcher.client.set_cookie("researcher", token.value)
    for path in CLOSED:
        assert researcher.get(f"/researcher/{path}").status_code in {303, 401}


def test_the_cookie_is_closed_and_ends_with_the_browser(stranger: Visitor) -> None:
    parts = sign_in(stranger).headers["Set-Cookie"].split("; ")
    assert {"HttpOnly", "SameSite=Strict", "Path=/"} <= set(parts)
    assert not [part for part in parts if part.startswith(("Max-Age", "Expires"))]


def test_a_wrong_password_is_refused_without_saying_what_was_wrong(stranger: Visitor) -> None:
    answers = [sign_in(stranger, NAME, "wrong password"), sign_in(stranger, "nobody", PASSWORD)]
    assert [answer.status_code for answer in answers] == [422, 422]
    texts = [answer.text.replace(NAME, "X").replace("nobody", "X") for answer in answers]
    assert texts[0] == texts[1]
    assert "is not right" in texts[0]
    assert PASSWORD not in answers[1].text
    assert stranger.get("/researcher/").status_code == 303


def test_a_nul_in_a_name_or_an_address_finds_nobody(researcher: Visitor, stranger: Visitor) -> None:
    assert sign_in(stranger, f"{NAME}\0").status_code == 422
    assert researcher.get("/researcher/people/abc%00").status_code == 404
    assert researcher.post("/researcher/accounts/abc%00/sessions").status_code == 404


@pytest.mark.parametrize("name", [NAME, f"confirm:{NAME}", f"\N{LATIN SMALL LETTER Y WITH DIAERESIS}{NAME}"])
def test_wrong_sign_ins_from_outside_keep_nobody_inside_from_confirming(
    researcher: Visitor, app: Flask, clock: Clock, name: str
) -> None:
    outside, wait_s = Visitor(app), 0
    while wait_s < 60:
        clock.wait(seconds=wait_s)
        wait_s = int(sign_in(outside, name, "wrong password").headers.get("Retry-After", 0))
    assert sign_in(outside, name).status_code == 429
    assert unblind(researcher).status_code == 303


def test_guessing_is_slowed_down_and_said(stranger: Visitor, clock: Clock) -> None:
    statuses = [sign_in(stranger, NAME, "wrong password").status_code for _ in range(12)]
    assert statuses[:5] == [422] * 5
    assert 429 in statuses
    answer = sign_in(stranger)
    assert answer.status_code == 429
    assert int(answer.headers["Retry-After"]) > 1
    assert "too many attempts" in answer.text
    clock.wait(minutes=15)
    assert sign_in(stranger).status_code == 303


@pytest.mark.parametrize("polled", ["status.json", "people.json"])
def test_an_idle_dashboard_signs_out_although_it_polls(researcher: Visitor, clock: Clock, polled: str) -> None:
    for _ in range(31):
        clock.wait(minutes=1)
        status = researcher.get(f"/researcher/{polled}").status_code
    assert status == 401
    assert researcher.get("/researcher/").headers["Location"] == "/researcher/sign-in"


def test_a_page_that_fetches_itself_keeps_no_session_alive(researcher: Visitor, clock: Clock) -> None:
    for _ in range(31):
        clock.wait(minutes=1)
        status = researcher.client.get("/researcher/results", headers={"X-Poll": "1"}).status_code
    assert status == 303


def test_the_live_numbers_say_who_is_where(researcher: Visitor, app: Flask, clock: Clock) -> None:
    answer = researcher.get("/researcher/status.json").get_json()
    assert (answer["participants"], answer["counts"]["arrived"]) == ([], 0)
    people = [Visitor(app) for _ in range(4)]
    for person in people:
        person.agree()
    people[1].walk(1, 3)
    people[2].walk()
    people[3].walk(1, 1)
    people[3].post("/leave")
    answer = researcher.get("/researcher/status.json").get_json()
    counts = {"arrived": 4, "in_progress": 2, "stalled": 0, "completed": 1, "withdrawn": 1, "screened_out": 0}
    assert answer["counts"] == counts | {"excluded": 0}
    assert [line["progress"] for line in answer["participants"]] == [1, 11, 3, 0]
    assert [line["state"] for line in answer["participants"]] == ["withdrawn", "completed", "in_progress", "consented"]
    assert {line["num_pages"] for line in answer["participants"]} == {11}
    assert all(re.fullmatch(r"2031-03-01T\d\d:\d\d:\d\dZ", line["last_seen"]) for line in answer["participants"])
    assert answer["cells"] == []
    assert all(layout["most_assigned"] <= 4 for layout in answer["layouts"])
    unblind(researcher)
    cells = researcher.get("/researcher/status.json").get_json()["cells"]
    assert sum(cell["assigned"] for cell in cells) == 4 * 5
    assert sum(cell["done"] for cell in cells) == 5 + 1
    page = researcher.get("/researcher/").text
    assert all(line["code"] in page for line in answer["participants"])
    for _ in range(3):
        clock.wait(minutes=25)
        researcher.get("/researcher/")
    assert researcher.get("/researcher/status.json").get_json()["counts"]["stalled"] == 2


def test_the_end_of_the_log_stands_on_every_page(researcher: Visitor, instance: Path) -> None:
    ((number, digest),) = ask(instance, "SELECT number, hash FROM records ORDER BY number DESC LIMIT 1")
    for path in PAGES:
        page = researcher.get(f"/researcher/{path}")
        assert page.status_code == 200
        assert f'title="{digest}"' in page.text
    status = researcher.get("/researcher/status.json").get_json()
    assert status["head"] == {"number": number, "hash": digest}


def test_people_are_found_by_code_and_state_and_by_a_hundred(researcher: Visitor, app: Flask) -> None:
    people = [Visitor(app) for _ in range(3)]
    for person in people:
        person.agree()
    people[0].post("/leave")
    codes = [line["code"] for line in researcher.get("/researcher/people.json").get_json()["participants"]]
    assert len(codes) == 3
    gone = researcher.get("/researcher/people.json?state=withdrawn").get_json()
    assert ([line["code"] for line in gone["participants"]], gone["num_found"]) == ([codes[2]], 1)
    found = researcher.get(f"/researcher/people?search={codes[1]}").text
    assert f'href="/researcher/people/{codes[1]}"' in found
    assert codes[0] not in found
    assert "Nobody here yet" in researcher.get("/researcher/people?flagged=yes").text


@pytest.mark.parametrize(
    "query", ["state=asleep", "flagged=maybe", "excluded=maybe", "page=last", "mode=dream", "version=0000"]
)
def test_an_address_that_means_nothing_is_no_page(researcher: Visitor, query: str) -> None:
    assert researcher.get(f"/researcher/people?{query}").status_code == 404


def test_an_earlier_version_is_shown_when_chosen_and_links_stay_with_it(
    instance: Path, start_app: Callable[[Config], Flask]
) -> None:
    first = start_app(Config(instance))
    Visitor(first).agree()
    earlier = services_of(first).bundles.current.version
    write_bundle(instance, read_study(contact="somebody@example.org"))
    app = start_app(Config(instance))
    visitor = researcher_of(app)
    assert visitor.get("/researcher/status.json").get_json()["counts"]["arrived"] == 0
    page = visitor.get(f"/researcher/?version={earlier}").text
    assert "earlier version" in page
    assert 'data-count="arrived">1<' in page
    assert f'href="/researcher/results?version={earlier}"' in page
    assert f'data-status="/researcher/status.json?version={earlier}"' in page
    assert f"{earlier[:12]}, 1 person<" in page
    other = visitor.get("/researcher/people?mode=bot").text
    assert f"{earlier[:12]}, 0 people<" in other
    assert 'href="/researcher/quality?mode=bot"' in other


def test_data_of_a_version_whose_bundle_is_gone_are_refused_in_words(
    instance: Path, start_app: Callable[[Config], Flask]
) -> None:
    first = start_app(Config(instance))
    Visitor(first).agree()
    earlier = services_of(first).bundles.current.version
    write_bundle(instance, read_study(contact="somebody@example.org"))
    (instance / "bundles" / earlier / "catalogue.json").unlink()
    visitor = researcher_of(start_app(Config(instance)))
    answer = visitor.get(f"/researcher/?version={earlier}")
    assert answer.status_code == 410
    assert 'href="/researcher/"' in answer.text


def test_a_participant_is_no_researcher(stranger: Visitor, instance: Path) -> None:
    stranger.agree()
    token = stranger.client.get_cookie("participant")
    assert token is not None
    stranger.client.set_cookie("researcher", token.value)
    assert stranger.get("/researcher/").headers["Location"] == "/researcher/sign-in"
    assert num_rows(instance, "researcher_sessions") == 0


def test_nobody_is_counted_as_screened_out_where_no_quiz_can_end_the_study(researcher: Visitor) -> None:
    assert 'data-count="screened_out"' not in researcher.get("/researcher/").text


def test_a_viewer_looks_on_and_changes_nothing(app: Flask) -> None:
    person = Visitor(app)
    person.agree()
    viewer = researcher_of(app, "viewer")
    (line,) = viewer.get("/researcher/people.json").get_json()["participants"]
    for path in (*PAGES, f"people/{line['code']}"):
        answer = viewer.get(f"/researcher/{path}")
        assert answer.status_code == 200
        posts = re.findall(r'<form[^>]*method="post"[^>]*action="([^"]+)"', answer.text)
        harmless = {"/sign-out", "/allocation/replay", "/records/verify", "/accounts/sessions", "/preview"}
        assert {post.removeprefix("/researcher") for post in posts} <= harmless
        assert "unblind" not in answer.text.lower() or path == "results"
    closed = ["unblind", "dataset.zip", "ratings.csv", "consort.svg", f"people/{line['code']}/erase"]
    for path in closed:
        answer = viewer.get(f"/researcher/{path}")
        assert answer.status_code == 403
        assert "<strong>owner</strong>" in answer.text
    for action in ("note", "exclude", "include", "correct", "release", "restart", "link", "look", "erase"):
        assert viewer.post(f"/researcher/people/{line['code']}/{action}", {"reason": "x"}).status_code == 403


def test_an_admin_gives_roles_and_ends_sessions_and_nobody_else_does(app: Flask) -> None:
    admin, owner = researcher_of(app, "admin", "ada"), researcher_of(app, "owner", "olga")
    assert owner.post("/researcher/accounts/ada/role", {"role": "viewer"}).status_code == 403
    assert "ada" not in owner.get("/researcher/accounts").text
    assert 'data-account="olga"' in admin.get("/researcher/accounts").text
    assert admin.post("/researcher/accounts/olga/role", {"role": "viewer"}).status_code == 303
    assert "viewer: looks on" in owner.get("/researcher/accounts").text
    assert admin.post("/researcher/accounts/olga/sessions").status_code == 303
    assert owner.get("/researcher/").status_code == 303
    sign_in(owner, "olga")
    assert admin.post("/researcher/accounts/olga/close").status_code == 303
    assert owner.get("/researcher/").status_code == 303
    assert sign_in(owner, "olga").status_code == 422


@pytest.mark.parametrize(
    ("path", "form", "words"),
    [
        ("ada/role", {"role": "viewer"}, "another admin has to change your own account"),
        ("ada/close", {}, "another admin has to change your own account"),
        ("olga/role", {"role": "queen"}, "choose a role"),
        ("nobody/sessions", {}, "there is no account"),
    ],
)
def test_an_account_that_cannot_be_changed_says_why(app: Flask, path: str, form: dict[str, str], words: str) -> None:
    admin, _ = researcher_of(app, "admin", "ada"), researcher_of(app, "owner", "olga")
    answer = admin.post(f"/researcher/accounts/{path}", form)
    assert answer.status_code == 422
    assert words in answer.text
    assert admin.get("/researcher/accounts").status_code == 200


def test_everybody_ends_their_own_other_sessions(app: Flask) -> None:
    here, elsewhere = researcher_of(app), Visitor(app)
    sign_in(elsewhere)
    page = here.get("/researcher/accounts").text
    (session,) = re.findall(r'name="session" value="([0-9a-f]{12})"', page)
    assert here.post("/researcher/accounts/sessions", {"session": session}).status_code == 303
    assert elsewhere.get("/researcher/").status_code == 303
    sign_in(elsewhere)
    for form in ({"session": session}, {"session": "f" * 12}, {"session": ""}, {}):
        refused = here.post("/researcher/accounts/sessions", form)
        assert refused.status_code == 422
        assert "Nothing was changed: you have no session" in refused.text
    assert elsewhere.get("/researcher/").status_code == 200
    page = here.get("/researcher/accounts").text
    (others,) = re.findall(r'name="session" value="([^"]+)"><button[^>]*>End all but this one', page)
    here.post("/researcher/accounts/sessions", {"session": others})
    assert elsewhere.get("/researcher/").status_code == 303
    assert here.get("/researcher/").status_code == 200


def test_the_log_is_read_in_words_and_verified(researcher: Visitor, app: Flask) -> None:
    person = Visitor(app)
    person.agree()
    person.walk(1, 2)
    page = researcher.get("/researcher/records").text
    assert "agreed to take part" in page
    assert "page 2 was sent" in page
    only = researcher.get("/researcher/records?show=accounts").text
    assert "signed in" in only
    assert "page 2 was sent" not in only
    assert "as recorded" in researcher.post("/researcher/records/verify").text
    with services_of(app).database.write() as connection:
        connection.exec_driver_sql("UPDATE participants SET completed_at = consented_at")
    answer = researcher.post("/researcher/records/verify").text
    assert "Not everything is as it was recorded" in answer
    assert researcher.get("/researcher/records?show=dreams").status_code == 404


def test_every_draw_is_drawn_again_at_the_press_of_a_button(researcher: Visitor, app: Flask) -> None:
    for _ in range(3):
        Visitor(app).agree()
    assert "All 3 draws give the same again" in researcher.post("/researcher/allocation/replay").text


def test_a_foreign_page_cannot_unblind(researcher: Visitor, instance: Path) -> None:
    form = {"reason": "because", "password": PASSWORD}
    answer = researcher.client.post("/researcher/unblind", data=form, headers={"Sec-Fetch-Site": "cross-site"})
    assert answer.status_code == 403
    assert 'href="/researcher/"' in answer.text
    assert ask(instance, "SELECT 1 FROM records WHERE action = 'unblinded'") == []
    assert researcher.client.post("/researcher/unblind", data=form, headers=SAME_SITE).status_code == 303
