"""Browsers in the hands of participants and researchers, over Flask's test client or a real connection."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta

from flask import Flask
from flask.testing import FlaskClient
from werkzeug.test import TestResponse

SAME_SITE = {"Sec-Fetch-Site": "same-origin"}
ITEMS = ("likeliness", "loveliness", "general")
NUM_PAGES = 11


@dataclass
class Clock:
    """A clock that goes on by one second and one microsecond whenever it is read."""

    time: datetime = datetime(2031, 3, 1, 9, 30, 0, 17, tzinfo=UTC)

    def __call__(self) -> datetime:
        self.time += timedelta(seconds=1, microseconds=1)
        return self.time

    def wait(self, **units: float) -> None:
        self.time += timedelta(**units)


@dataclass
class Visitor:
    """One browser."""

    app: Flask
    client: FlaskClient = field(init=False)

    def __post_init__(self) -> None:
        self.client = self.app.test_client()

    def get(self, path: str) -> TestResponse:
        return self.client.get(path, buffered=True)

    def post(self, path: str, form: Mapping[str, str] | None = None) -> TestResponse:
        return self.client.post(path, data=dict(form or {}), headers=SAME_SITE)

    def agree(self) -> TestResponse:
        nonce = hidden_nonce(self.get("/"))
        return self.post("/consent", {"agree": "yes", "nonce": nonce})

    def place(self) -> str:
        """Where the server takes this browser."""
        return self.get("/study").headers["Location"]

    def nonce(self, number: int) -> str:
        return hidden_nonce(self.get(f"/study/{number}"))

    def answer(self, number: int, **changes: str) -> TestResponse:
        return self.post(f"/study/{number}", filled(number, self.nonce(number), **changes))

    def walk(self, first: int = 1, last: int = NUM_PAGES) -> None:
        for number in range(first, last + 1):
            assert self.answer(number).status_code == 303


def filled(number: int, nonce: str, **changes: str) -> dict[str, str]:
    """A page filled in; pages 3, 5, 7 ... are rating pages."""
    form = {"nonce": nonce}
    if number >= 3 and number % 2 == 1:
        form |= {f"rating-{item}": str(1 + (number + place) % 5) for place, item in enumerate(ITEMS)}
        form |= {f"time-{item}": str(1000 * number + place) for place, item in enumerate(ITEMS)}
    return form | {name.replace("_", "-"): value for name, value in changes.items()}


def hidden_nonce(response: TestResponse) -> str:
    found = re.search(r'name="nonce" value="([0-9a-f]{32})"', response.text)
    assert found is not None, response.text
    return found[1]
