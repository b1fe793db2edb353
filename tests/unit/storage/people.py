"""Participants who arrive and send pages, straight into the storage."""

import itertools
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from typing import TypeVar

from sqlalchemy import Table, func, select

from tests.web.bundles import STUDY_FOLDER, read_study
from webapp.storage.answers import Outcome, store_page
from webapp.storage.database import Database
from webapp.storage.enrolment import Enrolment, enrol
from webapp.storage.participants import Participant, find_trials, hash_token
from webapp.storage.scope import Mode
from webapp.study.answers import DriveEnd, DriveResult, PageContent, Prediction
from webapp.study.experiments import SATISFACTION_ITEMS
from webapp.study.protocol import Study, parse_study
from webapp.study.questionnaire import Ratings
from webapp.study.recruitment import Recruit
from webapp.study.session import DRIVEN, Page, pages

NOW = datetime(2031, 3, 1, 9, 30, 0, 17, tzinfo=UTC)
STUDY = read_study()
"""The two experiments of the paper: 11 pages, no drives, no predictions."""

_UNDERSTANDING = parse_study((STUDY_FOLDER.parent / "understanding" / "study.toml").read_text(encoding="utf-8"))
_EXPERIMENT = _UNDERSTANDING.experiments[0]
DRIVING = _UNDERSTANDING.model_copy(
    update={"experiments": (_EXPERIMENT.model_copy(update={"kinds": ("tailored_all", "placebic", "none")}),)}
)
"""Everything around the trials, predictions and drives; three kinds, so that everybody sees each of them once."""

_NUMBERS = itertools.count()
_Result = TypeVar("_Result")


def enrol_somebody(
    database: Database,
    mode: Mode = "test",
    version: str = "v1",
    *,
    study: Study = STUDY,
    cookie: str | None = None,
    language: str = "en",
    recruit: Recruit | None = None,
) -> Participant:
    """Give consent; with the same cookie, as the same person."""
    token_hash = hash_token(cookie or f"token {next(_NUMBERS)}")
    return enrol(database, Enrolment(study, version, mode, token_hash, language, recruit=recruit), NOW)


def pages_of(database: Database, participant: Participant, study: Study = STUDY) -> Sequence[Page]:
    return pages(study, find_trials(database, participant))


def page_of_kind(database: Database, participant: Participant, kind: str, study: Study = STUDY) -> Page:
    """The first page of a kind."""
    return next(page for page in pages_of(database, participant, study) if page.kind == kind)


def send(
    database: Database,
    participant: Participant,
    number: int,
    rating: int = 3,
    *,
    study: Study = STUDY,
    content: PageContent | None = None,
    now: datetime = NOW,
) -> Outcome:
    """Send the page of a number, filled in as `content_of` does unless told otherwise."""
    page = pages_of(database, participant, study)[number - 1]
    filled = content_of(page, rating, study) if content is None else content
    return store_page(database, participant, page, f"{participant.id} {number}", filled, now)


def walk(database: Database, participant: Participant, last: int, rating: int = 3, *, study: Study = STUDY) -> None:
    """Send all pages up to one."""
    for number in range(1, last + 1):
        assert send(database, participant, number, rating, study=study) == "accept"


def walk_to(database: Database, participant: Participant, kind: str, study: Study = STUDY) -> Page:
    """Send all pages before the first one of a kind, and return that page."""
    page = page_of_kind(database, participant, kind, study)
    walk(database, participant, page.number - 1, study=study)
    return page


def content_of(page: Page, rating: int = 3, study: Study = STUDY) -> PageContent:
    """What may stand on a page: one rating for every item, predictions that are right, drives that are given up."""
    match page.kind:
        case "rating":
            assert page.trial is not None
            items = study.experiment(page.trial.experiment).items_for(page.trial.kind)
            return PageContent(ratings=ratings_of([item.id for item in items], rating))
        case "satisfaction":
            return PageContent(ratings=ratings_of(SATISFACTION_ITEMS, rating))
        case "probe":
            return PageContent(predictions=[prediction(number) for number in (1, 2)])
        case _:
            return PageContent(drive=drive(page)) if page.kind in DRIVEN else PageContent()


def ratings_of(items: Sequence[str], rating: int) -> Ratings:
    return Ratings(dict.fromkeys(items, rating), dict.fromkeys(items))


def prediction(question: int, predicted: str = "left", confidence: int = 3, *, is_as_good: bool = True) -> Prediction:
    """A prediction where the agent goes left."""
    is_right = predicted == "left"
    return Prediction(question, 7, predicted, "left", is_right, is_as_good, confidence, response_time_ms=None)


def drive(page: Page, end: DriveEnd = "gave_up", num_steps: int = 0, key_points: Sequence[int] = ()) -> DriveResult:
    """A drive where seven actions would do."""
    layout = "practice" if page.trial is None else page.trial.layout
    return DriveResult(DRIVEN[page.kind], layout, end, num_steps, 7, 21, (), key_points)


def count(database: Database, table: Table) -> int:
    with database.read() as connection:
        return connection.execute(select(func.count()).select_from(table)).scalar_one()


def at_once(num_threads: int, action: Callable[[int], _Result]) -> list[_Result]:
    """Let threads do something at the same moment, each with its number from 0, and return what came of it."""
    barrier = threading.Barrier(num_threads)

    def wait_and_act(number: int) -> _Result:
        barrier.wait()
        return action(number)

    with ThreadPoolExecutor(num_threads) as pool:
        return list(pool.map(wait_and_act, range(num_threads)))
