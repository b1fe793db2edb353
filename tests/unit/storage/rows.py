"""A small data set with every odd value that may occur, written straight into the tables."""

from datetime import UTC, datetime, timedelta

from sqlalchemy import insert

from webapp.storage.database import Database
from webapp.storage.tables import arrangements, pages, participants, ratings, trials

START = datetime(2031, 3, 1, 9, 30, 0, 17, tzinfo=UTC)

_PEOPLE: tuple[dict[str, object], ...] = (
    {"code": "2345678abc", "mode": "live", "completed_at": START + timedelta(minutes=9, seconds=30)},
    {"code": "bcdefghjkm", "mode": "test", "withdrawn_at": START + timedelta(minutes=7)},
    {"code": "zzzzzzzzzz", "mode": "bot", "consent_version": 'April, "short"\nform'},
)
_TRIALS = (
    {"number": 1, "experiment": "1", "position": 1, "num_trials": 2, "layout": "first", "kind": "random", "draw": 0},
    {"number": 2, "experiment": "1", "position": 2, "num_trials": 2, "layout": "second", "kind": "full", "draw": None},
)


def write_rows(database: Database) -> None:
    """Three participants: one who finished, one who left, one who only agreed."""
    with database.write() as connection:
        for number, person in enumerate(_PEOPLE, start=1):
            row = {
                "id": number,
                "token_hash": str(number),
                "study": "odd",
                "study_version": "f" * 64,
                "consent_version": "1",
                "num_pages": 5,
                "consented_at": START,
                "last_seen_at": START + timedelta(minutes=number),
            }
            connection.execute(insert(participants).values(row | person))
            connection.execute(insert(arrangements).values(participant_id=number, experiment="1", arrangement=0))
            connection.execute(insert(trials), [{"participant_id": number, **trial} for trial in _TRIALS])
    for number in range(1, 6):
        _write_page(database, 1, number)
    for number in range(1, 4):
        _write_page(database, 2, number)


def _write_page(database: Database, participant: int, number: int) -> None:
    trial = number // 2 or None
    kind = "instructions" if trial is None else ("situation" if number % 2 == 0 else "rating")
    page = {
        "participant_id": participant,
        "number": number,
        "kind": kind,
        "trial_number": trial,
        "nonce": f"{participant} {number}",
        "submitted_at": START.replace(microsecond=0) + timedelta(minutes=number, microseconds=number // 4),
    }
    with database.write() as connection:
        connection.execute(insert(pages).values(page))
        if kind == "rating":
            key = {"participant_id": participant, "page_number": number}
            answers = (("ease", number, None), ("worth", 1 + number % 5, 0 if participant == 1 else 86_400_000))
            rows = [{**key, "item": item, "rating": value, "response_time_ms": time} for item, value, time in answers]
            connection.execute(insert(ratings), rows)
