"""Somebody who is erased while the page that they sent is on its way."""

import pytest
from flask import Flask

from tests.web.people import Visitor
from webapp.storage.answers import Outcome, store_page
from webapp.storage.erasure import erase
from webapp.storage.participants import Participant
from webapp.views import participant
from webapp.views.services import services_of, utc_now


def test_they_are_told_that_there_is_no_place_for_them(app: Flask, monkeypatch: pytest.MonkeyPatch) -> None:
    visitor = Visitor(app)
    visitor.agree()

    def erase_and_store(database: object, person: Participant, *given: object) -> Outcome:
        erase(services_of(app).database, person.code, "researcher", utc_now())
        return store_page(database, person, *given)  # type: ignore[arg-type]

    monkeypatch.setattr(participant, "store_page", erase_and_store)
    app.testing = False
    answer = visitor.answer(1)
    assert answer.status_code == visitor.get("/study/1").status_code
    assert answer.status_code < 500
