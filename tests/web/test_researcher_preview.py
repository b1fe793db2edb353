"""The preview: every page of any assignment, with nothing stored."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from flask import Flask

from tests.unit.storage.people import DRIVING
from tests.web.bundles import write_bundle
from tests.web.people import SAME_SITE, Visitor
from tests.web.reading import num_rows
from tests.web.researchers import researcher_of
from webapp.config import Config
from webapp.study.counterbalancing import arrangements

TABLES = ("participants", "pages", "ratings", "records", "drive_steps")


def test_every_page_of_every_arrangement_is_shown_and_nothing_is_stored(app: Flask, instance: Path) -> None:
    visitor = researcher_of(app)
    before = [num_rows(instance, table) for table in TABLES]
    for arrangement in (0, 5):
        for number in range(1, 12):
            answer = visitor.get(f"/researcher/preview/{number}?in-1={arrangement}.0&in-2=1.0")
            assert answer.status_code == 200
            assert f"page {number} of 11; nothing is stored" in answer.text
            assert not re.search(r'(?:action|href|data-\w+)="/(?:study|leave)', answer.text)
    assert visitor.get("/researcher/preview/12").status_code == 404
    assert [num_rows(instance, table) for table in TABLES] == before
    assert visitor.client.get_cookie("participant") is None


def test_sending_a_page_of_the_preview_leads_to_the_next_one(app: Flask) -> None:
    visitor = researcher_of(app)
    page = visitor.get("/researcher/preview/3?in-1=2.0").text
    found = re.search(r'<form class="page-form" method="post" action="([^"]+)"', page)
    assert found is not None
    address = found[1].replace("&amp;", "&")
    assert visitor.post(address).headers["Location"].startswith("/researcher/preview/4?in-1=2.0")
    as_script = visitor.client.post(address, headers={**SAME_SITE, "Accept": "application/json"})
    assert as_script.get_json()["next"].startswith("/researcher/preview/4?")
    last = visitor.post("/researcher/preview/11?in-1=2.0").headers["Location"]
    assert last.startswith("/researcher/preview?in-1=2.0")
    assert visitor.post("/researcher/preview", {"in-1": "3.0"}).headers["Location"].startswith("/researcher/preview/1?")


def test_drives_predictions_and_tailored_explanations_are_previewed_in_any_language(
    instance: Path, start_app: Callable[[Config], Flask]
) -> None:
    write_bundle(instance, DRIVING)
    visitor = researcher_of(start_app(Config(instance, study=DRIVING.name)))
    num_shown = 0
    for arrangement in range(len(arrangements(DRIVING.experiments[0]))):
        query = f"in-1={arrangement}.0&language=ja"
        listed = visitor.get(f"/researcher/preview?{query}").text
        for number in range(1, 1 + listed.count("/researcher/preview/")):
            answer = visitor.get(f"/researcher/preview/{number}?{query}")
            if "items.foresee" in answer.text:
                continue
            num_shown += answer.status_code == 200
    assert num_shown > 20


@pytest.mark.parametrize("query", ["in-1=99.0", "in-1=0.9", "in-1=x", "language=tlh", "draw=99", "draw=-1"])
def test_an_assignment_that_does_not_exist_has_no_preview(app: Flask, query: str) -> None:
    visitor = researcher_of(app)
    assert visitor.get(f"/researcher/preview?{query}").status_code == 404
    assert visitor.get(f"/researcher/preview/1?{query}").status_code == 404


def test_the_choice_lists_the_pages_in_words(app: Flask) -> None:
    visitor: Visitor = researcher_of(app)
    page = visitor.get("/researcher/preview").text
    assert "Its 11 pages" in page
    assert page.count(">Ratings</a>") == 5
