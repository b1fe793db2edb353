"""A small data set with every odd value that may occur, written straight into the tables."""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime, timedelta

from sqlalchemy import Connection, Table, insert, select

from tests.web.bundles import read_study
from webapp.storage.database import Database
from webapp.storage.people import Correction, correct, exclude, include
from webapp.storage.records import SYSTEM, Entry, Subject, append
from webapp.storage.scope import Scope
from webapp.storage.tables import (
    answers,
    arrangements,
    drive_steps,
    drives,
    events,
    page_restarts,
    pages,
    participants,
    predictions,
    ratings,
    recruits,
    trials,
)
from webapp.study.corrections import Asked
from webapp.study.session import Page

START = datetime(2031, 3, 1, 9, 30, 0, 17, tzinfo=UTC)

_Row = Mapping[str, object]

_PEOPLE: tuple[_Row, ...] = (
    {"code": "2345678abc", "mode": "live", "completed_at": START + timedelta(minutes=9, seconds=30)},
    {"code": "bcdefghjkm", "mode": "test", "withdrawn_at": START + timedelta(minutes=7), "guardian_agreed": True},
    {"code": "zzzzzzzzzz", "mode": "bot", "consent_version": 'April, "short"\nform', "guardian_agreed": False},
    {
        "code": "yyyyyyyyyy",
        "mode": "live",
        "language": "ja",
        "translation": "unvalidated",
        "screened_out_at": START + timedelta(minutes=2),
    },
)
_TRIALS: tuple[_Row, ...] = (
    {"number": 1, "experiment": "1", "position": 1, "num_trials": 2, "layout": "first", "kind": "random", "draw": 0},
    {"number": 2, "experiment": "1", "position": 2, "num_trials": 2, "layout": "second", "kind": "full", "draw": None},
)
_RECRUITS: tuple[_Row, ...] = (
    {
        "participant_id": 1,
        "service": "prolific",
        "external_id": "0123456789abcdef01234567",
        "external_study": "fedcba987654321001234567",
        "external_session": "session12345",
    },
    {"participant_id": 2, "service": "label", "external_id": "-odd.id"},
    {"participant_id": 4, "service": "sona", "external_id": "77"},
)
_LATER_PAGES: tuple[_Row, ...] = (
    {"number": 6, "kind": "quiz", "trial_number": None},
    {"number": 7, "kind": "probe", "trial_number": 1},
    {"number": 8, "kind": "practice", "trial_number": None},
    {"number": 9, "kind": "first_drive", "trial_number": 2},
    {"number": 10, "kind": "drive", "trial_number": 2},
)
_ANSWERS: tuple[_Row, ...] = (
    {"page_number": 3, "attempt": 1, "question": "check", "purpose": "attention", "answer": "2", "is_correct": False},
    {"page_number": 6, "attempt": 1, "question": "door", "purpose": "quiz", "answer": "wait", "is_correct": False},
    {"page_number": 6, "attempt": 2, "question": "door", "purpose": "quiz", "answer": "key", "is_correct": True},
    *(
        {"page_number": 1, "attempt": 1, "question": question, "purpose": "background", "answer": answer}
        for question, answer in {
            "age": "-5",
            "email": "@home",
            "formula": '=HYPERLINK("http://example.org","click")',
            "gender": "prefer_not_to_say",
            "job": 'researcher, -3 years\r\nof "dreams"',
            "phone": "+49",
            "return": "\r=1",
            "tab": "\t=1",
            "words": "ロボット",
        }.items()
    ),
)
_PREDICTIONS: tuple[_Row, ...] = (
    {
        "question": 1,
        "state": 0,
        "predicted": "left",
        "action": "forward",
        "is_correct": False,
        "is_as_good": True,
        "confidence": 5,
        "response_time_ms": 0,
    },
    {
        "question": 2,
        "state": 41,
        "predicted": "toggle",
        "action": "toggle",
        "is_correct": True,
        "is_as_good": True,
        "confidence": 1,
        "response_time_ms": None,
    },
)
_DRIVES: tuple[_Row, ...] = (
    {"phase": "practice", "layout": "meadow", "end": "reached", "num_steps": 2, "subgoals_passed": "1"},
    {"phase": "before", "layout": "second", "end": "gave_up", "num_steps": 0, "key_points": "1 5 7"},
    {"phase": "after", "layout": "second", "end": "step_limit", "num_steps": 3},
)
_STEPS: tuple[tuple[int, str, int | None, Sequence[str]], ...] = (
    (8, "practice", None, ("forward", "left")),
    (10, "drive", 2, ("toggle", "toggle", "toggle")),
)
_EVENTS: tuple[_Row, ...] = (
    {"page_number": 1, "event": "painted", "target": "", "value": "", "at_ms": 0},
    {"page_number": 1, "event": "focus_lost", "target": "", "value": "", "at_ms": 86_400_000},
    {"page_number": 3, "event": "changed", "target": "rating-ease", "value": "3", "at_ms": 1500},
    {"page_number": 3, "event": "visible", "target": "2", "value": "1200", "at_ms": 1500},
    {"page_number": 3, "event": "attended", "target": "=2", "value": "+800 pointer", "at_ms": 1499},
)


def write_rows(database: Database) -> None:
    """Four participants: one who finished, one who left, one who only agreed, one who was screened out.

    The one who left has everything that the one who finished has, but for the last page: its drive was not finished.
    """
    with database.write() as connection:
        for number, person in enumerate(_PEOPLE, start=1):
            row = {
                "id": number,
                "token_hash": str(number),
                "study": "odd",
                "study_version": "f" * 64,
                "consent_version": "1",
                "language": "en",
                "translation": "original",
                "num_pages": 10,
                "consented_at": START,
                "last_seen_at": START + timedelta(minutes=number),
                "salt": f"{number:032x}",
            }
            key = {"participant_id": number, "experiment": "1"}
            connection.execute(insert(participants).values(row | dict(person)))
            connection.execute(insert(arrangements).values(key | {"arrangement": 0, "layout_order": 0}))
            connection.execute(insert(trials), [{"participant_id": number, **trial} for trial in _TRIALS])
        for recruit in _RECRUITS:
            mode = _PEOPLE[int(str(recruit["participant_id"])) - 1]["mode"]
            connection.execute(insert(recruits).values({"study": "odd", "mode": mode} | dict(recruit)))
        for number in range(1, 6):
            _write_rated_page(connection, 1, number)
        for number in range(1, 4):
            _write_rated_page(connection, 2, number)
        for participant in (1, 2):
            _write_everything_else(connection, participant, last=10 if participant == 1 else 9)
        _write_ledger(connection)
    _decide(database)


def _write_rated_page(connection: Connection, participant: int, number: int) -> None:
    trial = number // 2 or None
    kind = "instructions" if trial is None else ("situation" if number % 2 == 0 else "rating")
    time = START.replace(microsecond=0) + timedelta(minutes=number, microseconds=number // 4)
    page = {"number": number, "kind": kind, "trial_number": trial, "submitted_at": time}
    _insert(connection, pages, participant, [{**page, "nonce": f"{participant} {number}"}])
    if kind == "rating":
        given = (("ease", number, None), ("worth", 1 + number % 5, 0 if participant == 1 else 86_400_000))
        rows = [{"item": item, "rating": value, "response_time_ms": time} for item, value, time in given]
        _insert(connection, ratings, participant, [{"page_number": number, **row} for row in rows])


def _write_everything_else(connection: Connection, participant: int, last: int) -> None:
    sent = [page for page in _LATER_PAGES if int(str(page["number"])) <= last]
    times = [START + timedelta(minutes=int(str(page["number"]))) for page in sent]
    nonces = [f"{participant} {page['number']}" for page in sent]
    rows = [
        {**page, "nonce": nonce, "submitted_at": time} for page, nonce, time in zip(sent, nonces, times, strict=True)
    ]
    _insert(connection, pages, participant, rows)
    at = START + timedelta(minutes=6, seconds=59)
    for answer in _ANSWERS:
        _insert(connection, answers, participant, [{"submitted_at": at, **answer}])
    _insert(connection, predictions, participant, [{"page_number": 7, **row} for row in _PREDICTIONS])
    lists = {"optimum": 2, "step_limit": 3, "subgoals_passed": "", "key_points": ""}
    for page_number, drive in enumerate(_DRIVES[: last - 7], start=8):
        _insert(connection, drives, participant, [{"page_number": page_number} | lists | dict(drive)])
    for page, kind, trial, actions in _STEPS:
        for number, action in enumerate(actions, start=1):
            of_step = {"page_kind": kind, "trial_number": trial, "number": number, "action": action}
            elapsed = None if number == 1 else 250 * number
            time = START + timedelta(minutes=page - 1, milliseconds=number)
            row = {"page_number": page, **of_step, "elapsed_ms": elapsed, "received_at": time}
            _insert(connection, drive_steps, participant, [row])
    for number, event in enumerate(_EVENTS, start=1):
        _insert(connection, events, participant, [{"number": number, **event}])
    restart = {"page_number": 8, "number": 1, "after_step": 0, "after_attempt": 0, "at": START}
    _insert(connection, page_restarts, participant, [restart])


def _write_ledger(connection: Connection) -> None:
    """The draws of the first two participants; the place of the second went back and counted again."""
    at = START + timedelta(minutes=10)
    for number in (1, 2):
        scope, subject = scope_of(connection, number), subject_of(connection, number)
        cell = {"experiment": "1", "sizes": [2, 1], "uses": {"0/0": number}, "arrangement": 0, "layout_order": 0}
        content = {"word": f"{number:016x}", "experiments": [cell], "draws": [0, 7], "num_draws": 10}
        append(connection, Entry(at, SYSTEM, "allocated", scope, subject, content=content))
    released, resumed = (START + timedelta(minutes=minutes) for minutes in (70, 80))
    gone = {"slot": 2, "why": "expired"}
    append(connection, Entry(released, SYSTEM, "slot_released", scope, subject, content=gone))
    append(connection, Entry(resumed, SYSTEM, "slot_resumed", scope, subject, content={"slot": 2}))


def _decide(database: Database) -> None:
    times = [START + timedelta(hours=2, seconds=second) for second in range(4)]
    exclude(database, "bcdefghjkm", "=too fast", "ann", times[0])
    include(database, "bcdefghjkm", "not so fast after all", "ann", times[1])
    exclude(database, "2345678abc", 'said "no", twice', "=ben", times[2])
    slip = Correction("answers", Asked(read_study(), Page(1, "background", None)), "job", "researcher")
    correct(database, "2345678abc", slip, "+1 told us", "ann", times[3])


def _insert(connection: Connection, table: Table, participant: int, rows: Sequence[_Row]) -> None:
    connection.execute(insert(table), [{"participant_id": participant, **row} for row in rows])


def subject_of(connection: Connection, participant_id: int) -> Subject:
    query = select(participants.c.id, participants.c.code, participants.c.salt)
    return Subject(*connection.execute(query.where(participants.c.id == participant_id)).one())


def scope_of(connection: Connection, participant_id: int) -> Scope:
    query = select(participants.c.study, participants.c.study_version, participants.c.mode)
    return Scope(*connection.execute(query.where(participants.c.id == participant_id)).one())
