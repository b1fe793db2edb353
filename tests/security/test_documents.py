"""What docs/security.md tells in numbers and sentences is true of the program."""

import io
import re
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path

import pytest
from argon2 import PasswordHasher
from flask import Flask
from sqlalchemy import update

from tests.conftest import ROOT
from tests.web.bundles import write_bundle
from tests.web.people import SAME_SITE, Clock, Visitor
from tests.web.researchers import LONG_AGO, NAME, PASSWORD, researcher_of, sign_in
from tests.web.studies import PROLIFIC, a_study
from webapp import app as application
from webapp.config import Config
from webapp.storage import passwords, researchers
from webapp.storage.accounts import create_researcher
from webapp.storage.tables import researchers as accounts
from webapp.study import problems
from webapp.views.researcher import data_pages, signing_in
from webapp.views.services import services_of
from webapp.views.tokens import bot_pass

DOCUMENT = (ROOT / "docs/security.md").read_text(encoding="utf-8")
UPLOADED = "an id that nobody else has 4711"
ELSEWHERE = r"(FileHandler|SysLogHandler|SMTPHandler|HTTPHandler|SocketHandler|NTEventLogHandler|basicConfig\(filename)"


def section(title: str) -> str:
    """The words of a section, on one line."""
    return " ".join(DOCUMENT.partition(f"\n## {title}\n")[2].partition("\n## ")[0].split())


def test_the_limits_are_those_of_the_program() -> None:
    told = section("Limits")
    assert f"at most {application.MAX_BODY_BYTES // 1024} KiB and {application.MAX_FORM_PARTS} parts" in told
    assert f"a recruiter's list {data_pages.MAX_LIST_BYTES // 1024**2} MiB" in told
    assert f"A file of a study has at most {problems.MAX_BYTES // 1024} KiB" in told


def test_the_numbers_about_signing_in_are_those_of_the_program() -> None:
    told = section("Signing in")
    assert f"a password of {passwords.MIN_LENGTH} to {passwords.MAX_LENGTH:,} characters" in told
    minutes, hours = researchers.IDLE_LIMIT // timedelta(minutes=1), researchers.ABSOLUTE_LIMIT // timedelta(hours=1)
    assert f"A session ends {minutes} minutes after the last thing done by hand, after {hours} hours" in told
    assert researchers.FREE_ATTEMPTS == 5
    assert "Five wrong passwords in a row cost nothing" in told
    assert f"carries a mark for {signing_in.BROWSER_DAYS} days" in told
    assert researchers._STRANGERS_AT_ONCE._initial_value == 6  # type: ignore[attr-defined]
    assert researchers._HASHES_AT_ONCE._initial_value == 2  # type: ignore[attr-defined]


def test_every_purpose_of_the_key_is_told() -> None:
    source = (ROOT / "webapp/views/tokens.py").read_text(encoding="utf-8")
    words = {
        "session": "the signature of Flask's cookie",
        "participant": "tokens of participants",
        "recruit": "tokens of participants",
        "page": "nonces of pages",
        "bots": "the pass of bots",
        "browser": "marks of browsers",
    }
    assert set(re.findall(r'_hmac\(secret, "(\w+)"', source)) == set(words)
    assert [word for word in words.values() if word not in section("Keys")] == []
    found = [path.name for path in (ROOT / "webapp").rglob("*.py") if "hmac.new" in path.read_text(encoding="utf-8")]
    assert sorted(found) == ["tokens.py", "unblinding.py"]
    assert "the names of masked arms" in section("Keys")


def test_another_key_ends_what_was_computed_from_the_first_but_no_session_that_has_begun(
    instance: Path, start_app: Callable[[Config], Flask], caplog: pytest.LogCaptureFixture
) -> None:
    first = start_app(Config(instance))
    visitor = Visitor(first)
    visitor.agree()
    nonce = visitor.nonce(1)
    cookie = visitor.client.get_cookie("participant")
    assert cookie is not None
    (instance / "secret_key").unlink()
    second = start_app(Config(instance))
    again = Visitor(second)
    again.client.set_cookie("participant", cookie.value)
    assert again.place() == "/study/1"
    assert again.post("/study/1", {"nonce": nonce}).headers["Location"] == "/study/1"
    assert again.nonce(1) != nonce
    assert again.post("/study/1", {"nonce": again.nonce(1)}).headers["Location"] == "/study/2"
    assert bot_pass(services_of(first).secret) != bot_pass(services_of(second).secret)
    assert "no session that has begun ends with it" in section("Keys")
    assert "secret key" in caplog.text


def test_nothing_that_is_sent_becomes_a_file_or_a_row(tmp_path: Path, start_app: Callable[[Config], Flask]) -> None:
    write_bundle(tmp_path / "instance", a_study(recruitment=PROLIFIC))
    app = start_app(Config(tmp_path / "instance"))
    owner = researcher_of(app)
    before = {path for path in tmp_path.rglob("*") if path.is_file()}
    content = f"Participant id,Status\n{UPLOADED},APPROVED\n".encode()
    sent = {"list": (io.BytesIO(content), f"{UPLOADED}.csv")}
    answer = owner.client.post("/researcher/reconcile", data=sent, headers=SAME_SITE)
    assert (answer.status_code, UPLOADED in answer.text) == (200, True)
    after = {path for path in tmp_path.rglob("*") if path.is_file()}
    assert {path for path in after - before if not path.name.startswith("xar.sqlite3")} == set()
    assert [path for path in after if UPLOADED.encode() in path.read_bytes()] == []


def test_a_password_does_not_expire(app: Flask, clock: Clock) -> None:
    create_researcher(services_of(app).database, NAME, PASSWORD, LONG_AGO)
    clock.wait(days=20 * 365)
    assert sign_in(Visitor(app)).headers["Location"] == "/researcher/"


def test_a_hash_of_other_parameters_still_opens(app: Flask) -> None:
    """So the parameters can be raised without anybody having to choose another password."""
    create_researcher(services_of(app).database, NAME, "an earlier password of mine", LONG_AGO)
    earlier = PasswordHasher(time_cost=3, memory_cost=8 * 1024, parallelism=2).hash(PASSWORD)
    with services_of(app).database.write() as connection:
        connection.execute(update(accounts).where(accounts.c.name == NAME).values(password_hash=earlier))
    assert sign_in(Visitor(app)).headers["Location"] == "/researcher/"
    assert sign_in(Visitor(app), NAME, "an earlier password of mine").status_code == 422


def test_no_module_writes_a_log_elsewhere() -> None:
    sources = {path: path.read_text(encoding="utf-8") for path in (ROOT / "webapp").rglob("*.py")}
    assert [path for path, text in sources.items() if re.search(ELSEWHERE, text)] == []
    assert re.search(ELSEWHERE, "logging.handlers.RotatingFileHandler(path)")


def test_no_password_comes_with_what_is_deployed() -> None:
    texts = [path.read_text(encoding="utf-8") for path in (ROOT / "deploy").rglob("*") if path.is_file()]
    said = [line for text in texts for line in text.splitlines() if not line.lstrip().startswith("#")]
    set_there = re.compile(r"(?i)password\w*\s*[=:]\s*([\w./-]{3,})")
    values = {found for line in said for found in set_there.findall(line) if found}
    assert values == {"/run/secrets/database_password"}
    assert not (ROOT / "deploy/secrets").exists()
    assert set_there.findall("POSTGRES_PASSWORD: secret") == ["secret"]
