"""The dashboard of a study that has everything: predictions, drives, translations, recruits."""

import re
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import pytest
from flask import Flask

from tests.unit.storage.people import DRIVING, enrol_somebody, send, walk, walk_to
from tests.web.bundles import write_bundle
from tests.web.people import Visitor
from tests.web.reading import ask
from tests.web.test_researcher_pages import DOWNLOADS, NAME, PASSWORD, rows, sign_in
from webapp.config import Config
from webapp.storage.exports import FILE_NAMES, RECRUITS
from webapp.storage.participants import Participant
from webapp.storage.researchers import create_researcher
from webapp.study.answers import Answer, PageContent
from webapp.study.experiments import SATISFACTION_ITEMS
from webapp.study.recruitment import Recruit
from webapp.study.sections import Recruitment
from webapp.views.services import services_of

NOTHING = "\N{EN DASH}"


@pytest.fixture
def driving(instance: Path, start_app: Callable[[Config], Flask]) -> Flask:
    """An app with a study that has everything around the trials, predictions and drives."""
    (experiment,) = DRIVING.experiments
    changes = {
        "experiments": (experiment.model_copy(update={"satisfaction": True}),),
        "recruitment": Recruitment(service="prolific"),
    }
    assert DRIVING.quiz is not None
    quiz = DRIVING.quiz.model_copy(update={"on_failure": "screen_out"})
    write_bundle(instance, DRIVING.model_copy(update=changes | {"quiz": quiz}))
    app = start_app(Config(instance, study=DRIVING.name))
    create_researcher(services_of(app).database, NAME, PASSWORD, datetime(2031, 1, 1, tzinfo=UTC))
    return app


def take_part(app: Flask, recruit: Recruit | None = None, language: str = "en", *, fails: bool = False) -> Participant:
    """Go all the way, or to the quiz and out, straight into the storage."""
    here = services_of(app)
    study, version = here.bundles.current.study, here.bundles.current.version
    participant = enrol_somebody(here.database, "test", version, study=study, language=language, recruit=recruit)
    if fails:
        page = walk_to(here.database, participant, "quiz", study)
        content = PageContent(answers=[Answer("goal", "key", is_correct=False)], failed=True, screens_out=True)
        send(here.database, participant, page.number, study=study, content=content)
    else:
        walk(here.database, participant, participant.num_pages, study=study)
    return participant


def test_whoever_was_screened_out_is_counted_where_the_quiz_can_end_the_study(driving: Flask) -> None:
    take_part(driving, fails=True)
    visitor = researcher_of(driving)
    counts = visitor.get("/researcher/status.json").get_json()["counts"]
    assert counts == {"arrived": 1, "in_progress": 0, "completed": 0, "withdrawn": 0, "screened_out": 1}
    page = visitor.get("/researcher/").text
    assert 'data-count="screened_out">1<' in page
    assert '<span class="state state--screened_out" data-value="state">screened out</span>' in page


def test_predictions_and_drives_are_hidden_until_revealed(driving: Flask) -> None:
    take_part(driving)
    visitor = researcher_of(driving)
    before = visitor.get("/researcher/").text
    marks = ("data-mean", "data-predictions", "data-calibration", "data-drives")
    assert not [mark for mark in marks if mark in before]
    visitor.post("/researcher/reveal")
    shown = visitor.get("/researcher/").text
    for mark in marks[1:]:
        assert re.findall(rf'{mark}="(\w+)"', shown) == list(DRIVING.experiments[0].kinds)
    assert "satisfaction scale" in shown
    status = visitor.get("/researcher/status.json").get_json()
    assert set(status) == {"counts", "cells", "participants", "num_elsewhere"}


def test_every_share_and_mean_stands_with_the_count_it_rests_on(driving: Flask) -> None:
    take_part(driving)
    take_part(driving)
    visitor = researcher_of(driving)
    visitor.post("/researcher/reveal")
    shown = visitor.get("/researcher/").text
    rows = dict(re.findall(r'<tr (data-(?:predictions|calibration|drives)="\w+")>(.*?)</tr>', shown, flags=re.DOTALL))
    cells = {key: [plain(cell) for cell in re.findall(r"<td[^>]*>(.*?)</td>", row)] for key, row in rows.items()}
    assert cells['data-predictions="placebic"'] == ["100 % n = 4", "100 % n = 4", "3.00 n = 4"]
    assert cells['data-calibration="placebic"'] == [NOTHING, NOTHING, "100 % n = 4", NOTHING, NOTHING]
    assert cells['data-drives="tailored_all"'] == ["0 % n = 2", "0 % n = 2", "+0 n = 2", NOTHING, NOTHING]
    assert cells['data-drives="placebic"'] == [NOTHING, "0 % n = 2", NOTHING, NOTHING, NOTHING]


def researcher_of(app: Flask) -> Visitor:
    visitor = Visitor(app)
    assert sign_in(visitor).status_code == 303
    return visitor


def plain(html: str) -> str:
    return re.sub(r"<[^>]+>", "", html)


def test_unvalidated_translations_are_noted_with_their_readers(driving: Flask) -> None:
    take_part(driving, language="ja")
    take_part(driving)
    visitor = researcher_of(driving)
    for _ in range(2):
        notes = re.findall(r'<p class="note">(.*?)</p>', visitor.get("/researcher/").text)
        assert [plain(note)[:79] for note in notes] == [
            "The rating items in ja are an unvalidated translation (participants: 1). Cite a"
        ]
        visitor.post("/researcher/reveal")


def test_who_came_from_where_is_a_download_of_its_own_and_logged(driving: Flask, instance: Path) -> None:
    recruit = Recruit("prolific", "0123456789abcdef01234567", "fedcba987654321001234567", "session12345")
    participant = take_part(driving, recruit)
    take_part(driving)
    visitor = researcher_of(driving)
    page = visitor.get("/researcher/").text
    assert re.findall(r'href="/researcher/(\S+\.csv)" download', page) == list(DOWNLOADS)
    assert recruit.external_id not in page
    (line,) = rows(visitor, RECRUITS)
    assert (line["participant"], line["external_id"]) == (participant.code, recruit.external_id)
    assert (line["external_study"], line["state"]) == (recruit.external_study, "completed")
    logged = ask(instance, "SELECT researcher, detail FROM audit_log WHERE action = 'downloaded'")
    assert logged == [(NAME, RECRUITS)]
    for name in FILE_NAMES:
        assert recruit.external_id not in visitor.get(f"/researcher/{name}").text


def test_the_files_hold_what_the_participants_did(driving: Flask) -> None:
    participant = take_part(driving)
    visitor = researcher_of(driving)
    probes, drives = rows(visitor, "probes.csv"), rows(visitor, "drives.csv")
    assert {row["participant"] for row in (*probes, *drives)} == {participant.code}
    assert [row["is_correct"] for row in probes] == ["true"] * 6
    assert [row["phase"] for row in drives].count("before") == 1
    assert [row["phase"] for row in drives].count("after") == 3
    (person,) = rows(visitor, "participants.csv")
    assert (person["language"], person["translation"]) == ("en", "original")
    items = {row["item"] for row in rows(visitor, "ratings.csv")}
    assert items == {"foresee", "likeliness", "loveliness", "general", *SATISFACTION_ITEMS}


def test_the_dashboard_is_english_whatever_the_browser_asks_for(driving: Flask) -> None:
    visitor = Visitor(driving)
    for path in ("/researcher/sign-in", "/researcher/"):
        page = visitor.client.get(path, headers={"Accept-Language": "ja"}).text
        assert '<html lang="en">' in page
        sign_in(visitor)
    assert '<html lang="ja">' in visitor.client.get("/", headers={"Accept-Language": "ja"}).text
