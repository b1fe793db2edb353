"""A study whose every text is hostile, taken part in by hostile people and kept by hostile researchers."""

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

from sqlalchemy import insert

from tests.browser.site import RESEARCHER, Site, serve
from tests.security.payloads import PAYLOADS, as_read, fitting
from tests.unit.storage.people import content_of, pages_of
from tests.web.bundles import write_bundle
from tests.web.studies import CHECKS, PROLIFIC, QUIZ, a_study
from webapp.stimuli.bundle_files import bundle_version
from webapp.storage.accounts import MAX_NAME_LENGTH, AccountError, change_role, check_name
from webapp.storage.answers import store_page
from webapp.storage.database import Database, open_database
from webapp.storage.enrolment import Enrolment, enrol
from webapp.storage.instance import prepare_instance, secret_key
from webapp.storage.participants import Participant, hash_token
from webapp.storage.people import MAX_REASON_LENGTH, Correction, correct, exclude, include, note
from webapp.storage.tables import researchers
from webapp.study.answers import Answer, PageContent
from webapp.study.corrections import Asked
from webapp.study.protocol import Study
from webapp.study.recruitment import Recruit
from webapp.study.sections import MAX_TEXT_LENGTH
from webapp.study.session import Page
from webapp.study.texts import Texts, fill

NOW = datetime(2031, 3, 1, 9, 30, tzinfo=UTC)
MAX_ID_LENGTH = 64
"""The longest id of a recruiter that the pages take."""

TYPED = fitting(MAX_TEXT_LENGTH)
REASONS = fitting(MAX_REASON_LENGTH)
IDS = fitting(MAX_ID_LENGTH)
TOKEN = "a" * 40
QUESTIONS = tuple(f"q{number}" for number in range(len(TYPED)))


@dataclass(frozen=True, slots=True)
class HostileSite:
    """What is served.

    Attributes:
        site: The server.
        study: Its study.
        person: Who takes part; the browser that has `TOKEN` as its cookie is theirs.
        decided: Who has taken part, and about whom researchers wrote everything that they can write.
        texts: What participants read, by key.
        names: Of the researchers' accounts.
    """

    site: Site
    study: Study
    person: Participant
    decided: Participant
    texts: Texts
    names: Sequence[str]


def pages_for(database: Database, person: Participant, study: Study) -> Sequence[Page]:
    """Return the pages of somebody who takes part."""
    return pages_of(database, person, study)


def send(database: Database, person: Participant, study: Study, page: Page) -> None:
    """Send a page, filled in."""
    answers: Mapping[str, Sequence[Answer]] = {
        "background": [Answer(question, text) for question, text in zip(QUESTIONS, TYPED, strict=True)],
        "quiz": [Answer("goal", "flag", is_correct=True), Answer("door", "key", is_correct=True)],
    }
    content = content_of(page, study=study)
    if page.kind in answers:
        content = PageContent(answers=answers[page.kind])
    elif page.trial is not None and page.kind == "rating":
        checks = study.checks_of(page.trial.experiment, page.trial.position)
        told = [Answer(check.id, "2", is_correct=True) for check in checks]
        content = PageContent(ratings=content.ratings, answers=told)
    assert store_page(database, person, page, f"{person.id} {page.number}", content, NOW) == "accept"


@contextmanager
def serve_hostile(folder: Path) -> Iterator[HostileSite]:
    """Serve it for as long as the context lasts."""
    questions = [{"id": question, "type": "text"} for question in QUESTIONS]
    told = {"contact": PAYLOADS[0], "ethics_approval": PAYLOADS[1], "retention_until": "2031-12-31"}
    sections = {"quiz": QUIZ, "attention_checks": CHECKS, "recruitment": PROLIFIC, **told}
    study = a_study(background={"questions": questions}, **sections)
    built, instance = folder / "built", folder / "instance"
    version, texts = _write(built, study)
    prepare_instance(instance)
    secret_key(instance)
    with open_database(instance / "xar.sqlite3") as database:
        person = _enrol(database, study, version, TOKEN, Recruit("prolific", "0" * 24, "1" * 24, "2" * 24))
        decided = _enrol(database, study, version, "decided", Recruit("prolific", "3" * 24, "1" * 24, "4" * 24))
        for page in pages_for(database, decided, study):
            send(database, decided, study, page)
        _decide(database, decided, study, pages_for(database, decided, study)[0])
        names = _make_accounts(database)
        for number, text in enumerate(IDS):
            _enrol(database, study, version, f"token {number}", Recruit("prolific", text, text, text))
    with serve(built, instance, study.name) as site:
        with open_database(instance / "xar.sqlite3", make=False) as database:
            change_role(database, RESEARCHER, "admin", RESEARCHER, NOW)  # Only admins see all accounts.
        yield HostileSite(site, study, person, decided, texts, names)


def _decide(database: Database, person: Participant, study: Study, page: Page) -> None:
    """Let researchers with hostile names note, exclude and correct, each time with a hostile text.

    Args:
        database: Where.
        person: About whom.
        study: Their study.
        page: Their page with the background questions, which must have been sent.
    """
    asked = Asked(study, page)
    for number, text in enumerate(REASONS):
        # No account's name has a NUL, and a data set with one cannot be analysed.
        now, actor = NOW + timedelta(seconds=number), as_read(PAYLOADS[-number]).replace("\0", "")
        note(database, person.code, text, actor, now)
        if number % 4 < 2:
            (include if number % 4 else exclude)(database, person.code, text, actor, now)
        slip = Correction("answers", asked, QUESTIONS[number % len(QUESTIONS)], text)
        correct(database, person.code, slip, text, actor, now)


def _write(built: Path, study: Study) -> tuple[str, Texts]:
    """Write a bundle of the study, each of its texts with a payload at its end, in turn."""
    folder = built / "bundles" / write_bundle(built, study)
    path = folder / "catalogue.json"
    content = json.loads(path.read_text(encoding="utf-8"))
    for entries in content["texts"].values():
        entries |= {f"background.{question}.question": question for question in QUESTIONS}
        for number, (key, entry) in enumerate(entries.items()):
            entries[key] = _appended(entry, _harmless_braces()[number % len(_harmless_braces())])
    path.write_text(json.dumps(content), encoding="utf-8")
    version = bundle_version(folder)
    folder.rename(folder.with_name(version))
    for pointer in ("current", "published"):
        (built / "bundles" / f"{pointer}-{study.name}").write_text(version, encoding="ascii")
    entries = content["texts"]["en"]
    return version, Texts("en", {key: tuple(one) if isinstance(one, list) else one for key, one in entries.items()})


def _appended(entry: str | list[str], payload: str) -> str | list[str]:
    return [f"{part} {payload}" for part in entry] if isinstance(entry, list) else f"{entry} {payload}"


def _harmless_braces() -> Sequence[str]:
    """The payloads without those that would name a parameter, which `xar study check` refuses."""
    read = [as_read(text) for text in PAYLOADS]
    return [text for text in read if _names_nothing(text)]


def _names_nothing(text: str) -> bool:
    try:
        return fill(text, {}, "") == text
    except LookupError:
        return False


def _enrol(database: Database, study: Study, version: str, token: str, recruit: Recruit) -> Participant:
    return enrol(database, Enrolment(study, version, "test", hash_token(token), "en", recruit=recruit), NOW)


def _make_accounts(database: Database) -> Sequence[str]:
    """Make an account for each payload that can be a name; nobody knows a password of theirs."""
    names = []
    for text in fitting(MAX_NAME_LENGTH):
        try:
            check_name(text)
        except AccountError:
            continue
        names.append(text)
    rows = [{"name": name, "password_hash": "none", "created_at": NOW, "role": "viewer"} for name in names]
    with database.write() as connection:
        connection.execute(insert(researchers), rows)
    return names
