"""The page of one participant: what it tells, what owners may do there, and that errors lose nothing."""

import re
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from flask import Flask

from tests.unit.storage.people import NOW, enrol_somebody, walk_to
from tests.web.bundles import write_bundle
from tests.web.people import Visitor
from tests.web.reading import ask, num_rows
from tests.web.researchers import PASSWORD, researcher_of, unblind
from tests.web.test_results_pages import KINDS, kinds_told, plain, study_with, take_part
from webapp.config import Config
from webapp.storage import sqlite_edition
from webapp.storage.answers import store_step
from webapp.study.answers import DriveStep
from webapp.study.protocol import Study
from webapp.views.services import services_of

REASON = {"reason": "They wrote to us"}
CONFIRMED = REASON | {"password": PASSWORD}
BY_ARM = ("", "allocation", "results")
OF_TRIALS = ("Ratings", "Predictions", "Drives")


@pytest.fixture
def person(app: Flask) -> Visitor:
    """Somebody who is at page 4."""
    visitor = Visitor(app)
    visitor.agree()
    visitor.walk(1, 3)
    return visitor


@pytest.fixture
def researcher(app: Flask) -> Visitor:
    return researcher_of(app)


def code_of(researcher: Visitor) -> str:
    (line,) = researcher.get("/researcher/people.json").get_json()["participants"]
    return str(line["code"])


@pytest.mark.usefixtures("person")
def test_the_page_tells_what_happened_in_order(researcher: Visitor) -> None:
    page = researcher.get(f"/researcher/people/{code_of(researcher)}").text
    told = [plain(entry) for entry in re.findall(r'<li class="timeline__entry.*?</li>', page, re.DOTALL)]
    happened = [re.sub(r".*UTC (.*?) #\d+$", r"\1", entry) for entry in told]
    assert happened == [
        "a place in the study was drawn",
        "agreed to take part",
        "page 1 was sent: instructions",
        "page 2 was sent",
        "page 3 was sent",
    ]
    assert "3 of 11" in page


@pytest.mark.usefixtures("person")
def test_notes_exclusions_and_their_end_are_kept_with_their_reasons(researcher: Visitor) -> None:
    address = f"/researcher/people/{code_of(researcher)}"
    assert researcher.post(f"{address}/note", {"text": "Called us"}).headers["Location"] == f"{address}?done=noted"
    assert researcher.post(f"{address}/exclude", {"reason": "A friend answered"}).status_code == 303
    page = researcher.get(f"{address}?done=excluded").text
    assert "This person is excluded now." in page
    assert "noted: “Called us”" in page
    assert "A friend answered" in page
    assert "A friend answered" in researcher.get("/researcher/quality").text
    assert researcher.get("/researcher/status.json").get_json()["counts"]["excluded"] == 1
    assert researcher.post(f"{address}/include", {"reason": "It was a mistake"}).status_code == 303
    assert researcher.get("/researcher/status.json").get_json()["counts"]["excluded"] == 0


@pytest.mark.usefixtures("person")
@pytest.mark.parametrize(
    ("action", "form", "words"),
    [
        ("note", {"text": " "}, "the note is missing"),
        ("exclude", {"reason": "x" * 501}, "the reason has 501 characters"),
        ("include", {"reason": "We were wrong"}, "not excluded"),
        ("correct", {"place": "", "value": "4", "reason": "Typed wrong"}, "choose the value"),
        ("correct", {"place": "ratings|3|weather", "value": "4", "reason": "Typed wrong"}, "has no answer to"),
        ("release", {"page": "9", "reason": "They are stuck"}, "is at page 4, not at page 9"),
        ("release", {"page": "99", "reason": "They are stuck"}, "there is no page 99"),
        ("restart", {"page": "4", "reason": ""}, "the reason is missing"),
        ("look", {"reason": "", "password": PASSWORD}, "the reason is missing"),
        ("look", {"reason": "They are stuck"}, "the password is not right"),
        ("look", {"reason": "They are stuck", "password": "wrong"}, "the password is not right"),
        (
            "correct",
            {"place": f"ratings|{'9' * 5000}|x", "value": "4", "reason": "Typed wrong"},
            "there is no page 999999999999; there are 11",
        ),
        ("correct", {"place": f"probes|3|{'9' * 30}", "value": "left", "reason": "Typed wrong"}, "has no answer to"),
        ("correct", {"place": "ratings|3|general", "value": "9", "reason": "Typed wrong"}, "whole number from 1 to 5"),
        ("correct", {"place": "ratings|3|general", "value": "banana", "reason": "x"}, "whole number from 1 to 5"),
        ("correct", {"place": "ratings|3|general", "value": "1" * 501, "reason": "x"}, "has 501 characters"),
    ],
)
def test_what_cannot_be_done_is_said_and_nothing_typed_is_lost(
    researcher: Visitor, action: str, form: dict[str, str], words: str
) -> None:
    if action == "correct":
        unblind(researcher)
    answer = researcher.post(f"/researcher/people/{code_of(researcher)}/{action}", form)
    assert answer.status_code == 422
    assert words in plain(answer.text).replace("&#39;", "'")
    typed = form.get("reason", "").strip()
    kept = f"You had typed: “{typed}”" if action == "include" else f">{typed}</textarea>"
    assert not typed or kept in answer.text


@pytest.mark.usefixtures("person")
def test_a_reason_to_exclude_never_stands_in_the_form_that_includes_again(researcher: Visitor, app: Flask) -> None:
    address = f"/researcher/people/{code_of(researcher)}"
    researcher_of(app, name="other").post(f"{address}/exclude", {"reason": "A friend answered"})
    page = researcher.post(f"{address}/exclude", {"reason": "A flatmate answered"}).text
    assert "You had typed: “A flatmate answered”" in page
    (form,) = re.findall(r'<form[^>]*/include".*?</form>', page, re.DOTALL)
    assert re.findall(r"<textarea[^>]*>(.*?)</textarea>", form) == [""]
    again = researcher.post(f"{address}/include", {"reason": ""}).text
    assert "You had typed" not in again


@pytest.mark.usefixtures("person")
def test_a_correction_stands_beside_the_answer(researcher: Visitor, instance: Path) -> None:
    address = f"/researcher/people/{code_of(researcher)}"
    assert "1 correction" not in researcher.get("/researcher/results").text
    unblind(researcher)
    form = {"place": "ratings|3|general", "value": "5", **REASON}
    assert researcher.post(f"{address}/correct", form).status_code == 303
    page = researcher.get(address).text
    assert "corrected general on page 3 from “" in page
    assert "to “5”: “They wrote to us”" in page
    assert "There is 1 correction, not applied here" in researcher.get("/researcher/results").text
    assert ask(instance, "SELECT count(*) FROM ratings WHERE rating = 5 AND item = 'general' AND page_number = 3") == [
        (0,)
    ]


def test_somebody_stuck_goes_on_without_the_page(person: Visitor, researcher: Visitor) -> None:
    address = f"/researcher/people/{code_of(researcher)}"
    assert person.place() == "/study/4"
    assert researcher.post(f"{address}/restart", {"page": "4", **REASON}).status_code == 303
    assert person.place() == "/study/4"
    assert researcher.post(f"{address}/release", {"page": "4", **REASON}).status_code == 303
    assert person.place() == "/study/5"
    page = researcher.get(address).text
    assert "released page 4: “They wrote to us”" in page
    assert "page 4 was sent" not in page
    assert re.findall(r'<tr><td class="number">4</td>.*<td class="number">(.*?)</td>', page) == ["released"]
    assert "page 4 was stored with nothing on it" in researcher.get("/researcher/records").text


def test_a_new_link_is_shown_once_and_leads_back(person: Visitor, researcher: Visitor, app: Flask) -> None:
    address = f"/researcher/people/{code_of(researcher)}"
    assert researcher.post(f"{address}/link").status_code == 422
    page = researcher.post(f"{address}/link", REASON).text
    found = re.search(r'value="http://localhost(/resume/[^"]+)" readonly', page)
    assert found is not None
    assert found[1] not in researcher.get(address).text
    elsewhere = Visitor(app)
    elsewhere.post(found[1])
    assert elsewhere.place() == "/study/4"
    assert "made a new personal link: “They wrote to us”" in researcher.get(address).text
    person.post("/leave")
    assert "the study is over" in researcher.post(f"{address}/link", REASON).text


@pytest.mark.usefixtures("person")
def test_erasing_asks_for_code_and_password_and_leaves_nobody(researcher: Visitor, instance: Path) -> None:
    code = code_of(researcher)
    address = f"/researcher/people/{code}/erase"
    asked = researcher.get(address).text
    assert "What goes" in asked
    assert "What stays" in asked
    for form, words in (
        ({"code": "somebody", "password": PASSWORD}, "type the code"),
        ({"code": code, "password": "wrong"}, "password is not right"),
    ):
        refused = researcher.post(address, form)
        assert refused.status_code == 422
        assert words in refused.text
    assert num_rows(instance, "participants") == 1
    erased = researcher.post(address, {"code": code, "password": PASSWORD})
    assert erased.headers["Location"] == "/researcher/people?done=erased"
    assert num_rows(instance, "participants") == 0
    assert researcher.get(f"/researcher/people/{code}").status_code == 404
    assert researcher.post(f"/researcher/people/{code}/note", {"text": "x"}).status_code == 404
    assert code not in researcher.get("/researcher/records").text


@pytest.mark.sqlite_only(reason="a reader holds up SQLite's file")
def test_traces_that_somebody_keeps_on_the_disk_are_told_of(
    instance: Path, start_app: Callable[[Config], Flask], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sqlite_edition, "journal_mode", lambda _: "wal")  # The other journal lets nobody read on.
    app = start_app(Config(instance))
    Visitor(app).agree()
    researcher = researcher_of(app)
    code = code_of(researcher)
    with closing(sqlite3.connect(instance / "xar.sqlite3", isolation_level=None)) as reader:
        reader.execute("BEGIN")
        reader.execute("SELECT count(*) FROM participants").fetchone()
        erased = researcher.post(f"/researcher/people/{code}/erase", {"code": code, "password": PASSWORD})
    assert erased.headers["Location"] == "/researcher/people?done=erased_for_now"
    page = researcher.get(erased.headers["Location"]).text
    assert "the last traces leave the disk when the server is restarted" in page


@pytest.fixture
def driving(instance: Path, start_app: Callable[[Config], Flask]) -> Flask:
    study: Study = study_with(*KINDS)
    write_bundle(instance, study)
    return start_app(Config(instance, study=study.name))


def test_the_pictures_are_shown_for_a_reason_to_one_account_and_of_one_person(driving: Flask, instance: Path) -> None:
    people = [take_part(driving), take_part(driving)]
    visitor, other = researcher_of(driving), researcher_of(driving, name="other")
    address = f"/researcher/people/{people[0].code}"
    before = visitor.get(address).text
    assert "/pictures/" not in before
    assert visitor.post(f"{address}/look", CONFIRMED).headers["Location"] == f"{address}?done=person_unblinded"
    page = visitor.get(address).text
    assert kinds_told(page) == set(KINDS)
    assert page.count("/pictures/") > 6
    for asker, path in ((other, address), (visitor, f"/researcher/people/{people[1].code}"), (visitor, "/researcher/")):
        assert kinds_told(asker.get(path).text) == set()
    logged = ask(instance, "SELECT actor, subject IS NOT NULL FROM records WHERE action = 'person_unblinded'")
    assert logged == [("researcher", 1)]


def test_a_prediction_is_corrected_to_an_action_of_the_world(driving: Flask) -> None:
    person, researcher = take_part(driving), researcher_of(driving)
    address = f"/researcher/people/{person.code}"
    unblind(researcher)
    (key, *_) = re.findall(r'value="(probes\|\d+\|1)"', researcher.get(address).text)
    refused = researcher.post(f"{address}/correct", {"place": key, "value": "up", **REASON})
    assert refused.status_code == 422
    assert "use forward, left, right" in refused.text
    assert researcher.post(f"{address}/correct", {"place": key, "value": "forward", **REASON}).status_code == 303


def by_arm(page: str) -> list[str]:
    """What a page marks as the numbers of one arm."""
    marks = "cell|arm|predictions|as-good|before|after|gain|calibration"
    return re.findall(rf'data-(?:{marks})="([^"]+)"', page) + re.findall(r"Arm [A-C]\b", page)


def test_whoever_looked_at_somebody_gets_no_numbers_by_arm_until_unblinded(driving: Flask) -> None:
    people = [take_part(driving), take_part(driving)]
    visitor, other = researcher_of(driving), researcher_of(driving, name="other")
    assert all(by_arm(visitor.get(f"/researcher/{path}").text) for path in BY_ARM)
    assert visitor.post(f"/researcher/people/{people[0].code}/look", REASON).status_code == 422
    visitor.post(f"/researcher/people/{people[0].code}/look", CONFIRMED)
    for _ in range(2):
        assert visitor.get("/researcher/status.json").get_json()["cells"] == []
        for path in BY_ARM:
            page = visitor.get(f"/researcher/{path}").text
            assert by_arm(page) == []
            assert "data-arms-hidden" in page
        # Letters that came back with the erasure would tell themselves by what is missing since.
        visitor.post(f"/researcher/people/{people[0].code}/erase", {"code": people[0].code, "password": PASSWORD})
    assert by_arm(other.get("/researcher/results").text)
    assert by_arm(visitor.get("/researcher/allocation?mode=live").text)
    unblind(visitor)
    for path in BY_ARM:
        page = visitor.get(f"/researcher/{path}").text
        assert by_arm(page)
        assert "data-arms-hidden" not in page


def test_what_was_asked_and_done_in_trials_is_hidden_while_blind_and_cannot_be_corrected(
    driving: Flask,
) -> None:
    person, visitor = take_part(driving), researcher_of(driving)
    address = f"/researcher/people/{person.code}"

    def told(page: str) -> set[str]:
        keys = {key.partition("|")[0] for key in re.findall(r'<option value="([^"]+\|[^"]+)"', page)}
        return keys | {title for title in OF_TRIALS if f">{title}</h2>" in page}

    assert told(visitor.get(address).text) <= {"answers"}
    refused = visitor.post(f"{address}/correct", {"place": "probes|99|7", "value": "up", **REASON})
    assert "while arms are masked only answers can be corrected" in refused.text
    visitor.post(f"{address}/look", CONFIRMED)
    page = visitor.get(address).text
    assert told(page) >= {"ratings", "probes", *OF_TRIALS}
    assert re.search(r"Page \d+, trial \d, foresee \(1 to 5\): 3<", page)


@pytest.mark.parametrize(("kind", "is_told"), [("practice", True), ("drive", False)])
def test_how_somebody_steered_in_a_trial_is_hidden_while_blind(driving: Flask, kind: str, *, is_told: bool) -> None:
    here = services_of(driving)
    study, version = here.bundles.current.study, here.bundles.current.version
    person = enrol_somebody(here.database, "test", version, study=study)
    page = walk_to(here.database, person, kind, study)
    store_step(here.database, person, page, DriveStep(1, "forward", 1200), NOW)
    visitor = researcher_of(driving)
    address = f"/researcher/people/{person.code}"
    assert ("steered the agent on page" in visitor.get(address).text) == is_told
    visitor.post(f"{address}/look", CONFIRMED)
    assert "steered the agent on page" in visitor.get(address).text


def test_whoever_sees_the_arms_sees_what_was_shown_as_far_as_they_came(driving: Flask) -> None:
    take_part(driving, fails=True)
    visitor = researcher_of(driving)
    unblind(visitor)
    page = visitor.get(f"/researcher/people/{code_of(visitor)}").text
    assert page.count("(not reached)") == 3
    assert "Practice, page" in page


@pytest.mark.usefixtures("person")
def test_the_page_follows_a_person_into_their_own_scope(researcher: Visitor) -> None:
    code = code_of(researcher)
    page = researcher.get(f"/researcher/people/{code}?mode=bot").text
    assert '<span class="chip chip--test">test</span>' in page
    assert f'action="/researcher/people/{code}/note"' in page
