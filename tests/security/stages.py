"""An application with everybody in it who could ask: participants under way, a bot, and an account of each role."""

import re
import shutil
import sqlite3
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from flask import Flask, url_for
from flask.testing import FlaskClient
from werkzeug.test import TestResponse

from tests.security.routes import PARTICIPANTS, RESEARCHERS, Case, Stage, Who
from tests.web.bundles import write_bundle
from tests.web.people import SAME_SITE, Clock, Visitor, hidden_nonce
from tests.web.researchers import researcher_of, unblind
from tests.web.studies import PROLIFIC, a_study, one_experiment
from webapp.app import create_app
from webapp.config import Config
from webapp.storage.accounts import open_sessions
from webapp.views.services import services_of
from webapp.views.tokens import bot_pass

STUDY = a_study(experiments=one_experiment(["subgoals"], drive={}), recruitment=PROLIFIC)


@dataclass(frozen=True, slots=True)
class Prepared:
    """A folder from which applications of one stage are copied.

    Attributes:
        folder: The instance.
        cookies: What everybody's browser holds.
        words: What stands for the names in braces.
    """

    folder: Path
    cookies: Mapping[Who, Mapping[str, str]]
    words: Mapping[str, str]


class Running:
    """A copy of a prepared stage that is made anew whenever a request has stored something."""

    def __init__(self, prepared: Prepared, folder: Path) -> None:
        self.prepared = prepared
        self._folder = folder
        self._app: Flask | None = None
        self._before = ""

    def ask(self, case: Case, who: Who) -> tuple[TestResponse, bool]:
        """Send a request as somebody; return the answer and whether something is stored now that was not before."""
        address = filled(case.address, self.prepared.words)
        form = {name: filled(value, self.prepared.words) for name, value in case.form.items()}
        answer = self.client(who).open(
            address, method=case.method, headers=SAME_SITE, data=form if case.method == "POST" else None, buffered=True
        )
        return answer, self.has_changed()

    def client(self, who: Who) -> FlaskClient:
        """Return the browser of somebody."""
        client = self.app.test_client()
        for name, value in self.prepared.cookies[who].items():
            client.set_cookie(name, value)
        return client

    @property
    def app(self) -> Flask:
        """The application, in the state of the stage."""
        if self._app is None:
            shutil.rmtree(self._folder, ignore_errors=True)
            shutil.copytree(self.prepared.folder, self._folder)
            self._app = create_app(Config(self._folder), clock=_later())
            self._before = stored(self._folder)
        return self._app

    def has_changed(self) -> bool:
        """Tell whether something was stored since the last look; the next request then begins from the stage again."""
        has_changed = stored(self._folder) != self._before
        if has_changed:
            self.close()
        return has_changed

    def close(self) -> None:
        """Let go of the database."""
        if self._app is not None:
            services_of(self._app).database.close()
            self._app = None


def prepare(stage: Stage, folder: Path) -> Prepared:
    """Let everybody come as far as a stage says."""
    write_bundle(folder, STUDY)
    app = create_app(Config(folder), clock=Clock())
    try:
        people = {who: _participant(app, stage, is_bot=who == "bot") for who in PARTICIPANTS}
        team = {who: researcher_of(app, who, who) for who in RESEARCHERS}  # type: ignore[arg-type]
        if stage == "unblinded":
            for who in ("owner", "admin"):
                assert unblind(team[who]).status_code == 303
        cookies: dict[Who, dict[str, str]] = {"nobody": {}}
        for who, visitor in (*people.items(), *team.items()):
            cookies[who] = _cookies(visitor)
        return Prepared(folder, cookies, _words(app, stage, people["A"], team["owner"]))
    finally:
        services_of(app).database.close()


def filled(text: str, words: Mapping[str, str]) -> str:
    """Put words in the place of names in braces."""
    return re.sub(r"\{(\w+)\}", lambda found: words[found[1]], text)


def stored(instance: Path) -> str:
    """Return everything that the database of an instance holds, without when somebody was last seen."""
    with closing(sqlite3.connect(instance / "xar.sqlite3", timeout=10)) as connection:
        names = connection.execute("SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name").fetchall()
        return "\n".join(_rows(connection, name) for (name,) in names)


def _rows(connection: sqlite3.Connection, table: str) -> str:
    cursor = connection.execute(f"SELECT * FROM {table}")  # noqa: S608 - a name that the database gave
    kept = [place for place, column in enumerate(cursor.description) if column[0] != "last_seen_at"]
    return f"{table}: {sorted(repr([row[place] for place in kept]) for row in cursor)}"


def _participant(app: Flask, stage: Stage, *, is_bot: bool) -> Visitor:
    visitor = Visitor(app)
    if is_bot:
        visitor.client.environ_base["HTTP_XAR_BOT"] = bot_pass(services_of(app).secret)
    visitor.agree()
    for number in range(1, 4 if stage == "driving" else 3):
        form = {"nonce": visitor.nonce(number), "rating-likeliness": "4", "rating-general": "2"}
        assert visitor.post(f"/study/{number}", form).status_code == 303
    return visitor


def _cookies(visitor: Visitor) -> dict[str, str]:
    found = {}
    for name in ("participant", "researcher"):
        cookie = visitor.client.get_cookie(name)
        if cookie is not None:
            found[name] = cookie.value
    return found


def _words(app: Flask, stage: Stage, participant: Visitor, owner: Visitor) -> dict[str, str]:
    number = 4 if stage == "driving" else 3
    page = participant.get(f"/study/{number}")
    people = owner.get("/researcher/people.json").get_json()["participants"]
    codes = sorted(str(line["code"]) for line in people)
    link = participant.get("/another-device").text
    token = re.search(r"/resume/([\w-]+)", link)
    digest = re.search(r"/pictures/([0-9a-f]{64})", page.text)
    (session,) = open_sessions(services_of(app).database, services_of(app).clock(), "owner")
    assert token is not None
    assert digest is not None
    with app.test_request_context():
        static = url_for("static", filename="x").removesuffix("/x")
    return {
        "code_A": codes[0],
        "token_A": token[1],
        "guess": "0" * 64,
        "nonce_A": hidden_nonce(page),
        "drive_A": hidden_nonce(page),
        "picture": digest[1],
        "consent": hidden_nonce(Visitor(app).get("/")),
        "session_owner": session.id,
        "static": static,
    }


def _later() -> Clock:
    clock = Clock()
    clock.wait(minutes=10)
    return clock
