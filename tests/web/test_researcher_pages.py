import csv
import io
import re
from collections import defaultdict
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import pytest
from flask import Flask
from werkzeug.test import TestResponse

from tests.web.bundles import read_study, write_bundle
from tests.web.people import ITEMS, SAME_SITE, Clock, Visitor
from tests.web.reading import ask, num_rows
from webapp.config import Config
from webapp.storage.export_columns import PARTICIPANTS_COLUMNS, RATINGS_COLUMNS
from webapp.storage.exports import FILE_NAMES, RECRUITS
from webapp.storage.researchers import create_researcher
from webapp.views.services import services_of

NAME, PASSWORD = "researcher", "correct horse battery"
DOWNLOADS = (*FILE_NAMES, RECRUITS)
CLOSED = ("/researcher/", "/researcher/status.json", *(f"/researcher/{name}" for name in DOWNLOADS))


@pytest.fixture
def stranger(app: Flask) -> Visitor:
    create_researcher(services_of(app).database, NAME, PASSWORD, datetime(2031, 1, 1, tzinfo=UTC))
    return Visitor(app)


@pytest.fixture
def researcher(stranger: Visitor) -> Visitor:
    assert sign_in(stranger).headers["Location"] == "/researcher/"
    return stranger


def sign_in(visitor: Visitor, name: str = NAME, password: str = PASSWORD) -> TestResponse:
    return visitor.post("/researcher/sign-in", {"name": name, "password": password})


def rows(researcher: Visitor, name: str) -> list[dict[str, str]]:
    answer = researcher.get(f"/researcher/{name}")
    assert answer.status_code == 200
    return list(csv.DictReader(io.StringIO(answer.data.decode("utf-8"), newline="")))


def test_everything_but_signing_in_is_closed_to_strangers(stranger: Visitor, app: Flask) -> None:
    for rule in app.url_map.iter_rules():
        if rule.endpoint.startswith("researcher.") and rule.rule != "/researcher/sign-in":
            for answer in (stranger.get(rule.rule), stranger.post(rule.rule)):
                refused = answer.headers.get("Location") == "/researcher/sign-in"
                assert refused or answer.status_code in {401, 405}
    assert stranger.get("/researcher/status.json").status_code == 401


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
        assert researcher.get(path).status_code in {303, 401}


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


def test_an_idle_dashboard_signs_out_although_it_polls(researcher: Visitor, clock: Clock) -> None:
    for _ in range(31):
        clock.wait(minutes=1)
        status = researcher.get("/researcher/status.json").status_code
    assert status == 401
    assert researcher.get("/researcher/").headers["Location"] == "/researcher/sign-in"


def test_live_numbers_follow_the_participants(researcher: Visitor, app: Flask) -> None:
    people = [Visitor(app) for _ in range(4)]
    for person, last in zip(people, (0, 3, 11, 1), strict=True):
        person.agree()
        person.walk(last=last)
    people[3].post("/leave")
    answer = researcher.get("/researcher/status.json").get_json()
    assert answer["counts"] == {"arrived": 4, "in_progress": 2, "completed": 1, "withdrawn": 1, "screened_out": 0}
    assert [line["progress"] for line in answer["participants"]] == [1, 11, 3, 0]
    assert [line["state"] for line in answer["participants"]] == ["withdrawn", "completed", "in_progress", "consented"]
    assert {line["num_pages"] for line in answer["participants"]} == {11}
    assert all(re.fullmatch(r"2031-03-01T\d\d:\d\d:\d\dZ", line["last_seen"]) for line in answer["participants"])
    assert sum(cell["assigned"] for cell in answer["cells"]) == 4 * 5
    assert sum(cell["done"] for cell in answer["cells"]) == 5 + 1
    page = researcher.get("/researcher/").text
    assert all(line["code"] in page for line in answer["participants"])


def test_ratings_are_hidden_until_revealed_and_revealing_is_logged(
    researcher: Visitor, app: Flask, instance: Path, clock: Clock
) -> None:
    person = Visitor(app)
    person.agree()
    person.walk()
    assert "ratings" not in researcher.get("/researcher/status.json").get_json()
    assert "data-mean" not in researcher.get("/researcher/").text
    before = clock.time
    assert researcher.post("/researcher/reveal").headers["Location"] == "/researcher/"
    means = re.findall(r'data-mean="([\d.]+)"', researcher.get("/researcher/").text)
    assert sorted(map(float, means)) == sorted(
        float(str(value)) for (value,) in ask(instance, "SELECT rating FROM ratings")
    )
    logged = ask(instance, "SELECT researcher, action, at FROM audit_log WHERE action = 'revealed'")
    assert [entry[:2] for entry in logged] == [(NAME, "revealed")]
    assert str(logged[0][2]) > before.strftime("%Y-%m-%d %H:%M:%S.%f")
    researcher.post("/researcher/sign-out")
    sign_in(researcher)
    assert "data-mean" not in researcher.get("/researcher/").text


def test_the_csv_holds_what_was_clicked(researcher: Visitor, app: Flask) -> None:
    person = Visitor(app)
    person.agree()
    clicked: dict[int, dict[str, str]] = defaultdict(dict)
    for number in range(1, 12):
        answers = {item: str(1 + (7 * number + place) % 5) for place, item in enumerate(ITEMS)}
        person.answer(number, **{f"rating_{item}": value for item, value in answers.items()})
        if number >= 3 and number % 2:
            clicked[number] = answers
    found = rows(researcher, "ratings.csv")
    assert tuple(found[0]) == RATINGS_COLUMNS
    places = [("1", "1"), ("1", "2"), ("1", "3"), ("2", "1"), ("2", "2")]
    for (experiment, trial), answers in zip(places, clicked.values(), strict=True):
        own = [row for row in found if (row["experiment"], row["trial"]) == (experiment, trial)]
        assert {row["item"]: row["rating"] for row in own} == answers
        assert {bool(row["draw"]) for row in own} == {own[0]["kind"] == "random"}
    assert {row["mode"] for row in found} == {"test"}
    assert {row["study_version"] for row in found} == {services_of(app).bundles.current.version}
    (line,) = rows(researcher, "participants.csv")
    assert tuple(line) == PARTICIPANTS_COLUMNS
    assert line["participant"] == found[0]["participant"]
    assert (line["num_pages_sent"], line["num_pages"]) == ("11", "11")
    for row in found:
        assert f"{row['experiment']}/{row['layout']}/{row['kind']}" in line["assignment"]


def test_downloads_are_files_and_are_logged(researcher: Visitor, instance: Path) -> None:
    for name in FILE_NAMES:
        answer = researcher.get(f"/researcher/{name}")
        assert answer.headers["Content-Type"] == "text/csv; charset=utf-8"
        assert answer.headers["Content-Disposition"] == f"attachment; filename={name}"
        assert answer.headers["Cache-Control"] == "no-store"
        assert not answer.data.startswith(b"\xef\xbb\xbf")
    logged = ask(instance, "SELECT detail FROM audit_log WHERE action = 'downloaded' ORDER BY id")
    assert logged == [(name,) for name in FILE_NAMES]


def test_every_file_is_offered_for_download(researcher: Visitor) -> None:
    offered = re.findall(r'href="/researcher/(\S+\.csv)" download', researcher.get("/researcher/").text)
    assert offered == list(FILE_NAMES)


@pytest.mark.parametrize("path", ["/researcher/secrets.csv", "/researcher/.csv", "/researcher/recruits.csv"])
def test_no_other_file_can_be_had(researcher: Visitor, instance: Path, path: str) -> None:
    assert researcher.get(path).status_code == 404
    assert ask(instance, "SELECT 1 FROM audit_log WHERE action = 'downloaded'") == []


def test_a_download_that_is_never_read_to_its_end_does_not_hold_up_participants(
    researcher: Visitor, app: Flask
) -> None:
    answer = researcher.client.get("/researcher/ratings.csv")
    person = Visitor(app)
    person.agree()
    assert person.answer(1).status_code == 303
    answer.close()


def test_a_participant_is_no_researcher(stranger: Visitor, instance: Path) -> None:
    stranger.agree()
    token = stranger.client.get_cookie("participant")
    assert token is not None
    stranger.client.set_cookie("researcher", token.value)
    assert stranger.get("/researcher/").headers["Location"] == "/researcher/sign-in"
    assert num_rows(instance, "researcher_sessions") == 0


def test_a_foreign_page_cannot_reveal(researcher: Visitor, instance: Path) -> None:
    answer = researcher.client.post("/researcher/reveal", headers={"Sec-Fetch-Site": "cross-site"})
    assert answer.status_code == 403
    assert 'href="/researcher/"' in answer.text
    assert researcher.client.post("/researcher/reveal", headers=SAME_SITE).status_code == 303
    assert len(ask(instance, "SELECT 1 FROM audit_log WHERE action = 'revealed'")) == 1


@pytest.mark.parametrize("points", [5, 7])
def test_the_means_are_shown_on_the_scale_of_the_study_file(
    points: int, instance: Path, start_app: Callable[[Config], Flask]
) -> None:
    experiments = tuple(
        experiment.model_copy(
            update={"items": tuple(item.model_copy(update={"points": points}) for item in experiment.items)}
        )
        for experiment in read_study().experiments
    )
    write_bundle(instance, read_study(experiments=experiments))
    app = start_app(Config(instance))
    person = Visitor(app)
    person.agree()
    person.walk()
    researcher = Visitor(app)
    create_researcher(services_of(app).database, NAME, PASSWORD, datetime(2031, 1, 1, tzinfo=UTC))
    sign_in(researcher)
    researcher.post("/researcher/reveal")
    page = researcher.get("/researcher/").text
    assert f"From 1 to {points}." in page
    assert page.count(f'data-highest="{points}"') == 2


def test_nobody_is_counted_as_screened_out_where_no_quiz_can_end_the_study(researcher: Visitor) -> None:
    assert 'data-count="screened_out"' not in researcher.get("/researcher/").text
