"""Researchers at the dashboard, over Flask's test client."""

import csv
import io
from datetime import UTC, datetime

from flask import Flask
from werkzeug.test import TestResponse

from tests.web.people import Visitor
from webapp.storage.accounts import create_researcher
from webapp.storage.researchers import Role
from webapp.views.services import services_of

NAME, PASSWORD = "researcher", "correct horse battery"
LONG_AGO = datetime(2031, 1, 1, tzinfo=UTC)


def sign_in(visitor: Visitor, name: str = NAME, password: str = PASSWORD) -> TestResponse:
    return visitor.post("/researcher/sign-in", {"name": name, "password": password})


def researcher_of(app: Flask, role: Role = "owner", name: str = NAME) -> Visitor:
    """A researcher of a new account who is signed in."""
    create_researcher(services_of(app).database, name, PASSWORD, LONG_AGO, role)
    visitor = Visitor(app)
    assert sign_in(visitor, name).headers["Location"] == "/researcher/"
    return visitor


def unblind(visitor: Visitor, reason: str = "The last person has finished", password: str = PASSWORD) -> TestResponse:
    return visitor.post("/researcher/unblind", {"reason": reason, "password": password})


def rows(researcher: Visitor, name: str) -> list[dict[str, str]]:
    """The rows of a file of the data."""
    answer = researcher.get(f"/researcher/{name}")
    assert answer.status_code == 200
    return list(csv.DictReader(io.StringIO(answer.data.decode("utf-8"), newline="")))
