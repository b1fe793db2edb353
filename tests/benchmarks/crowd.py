"""Thousands of participants with everything they sent, written straight into the tables, records included."""

import hashlib
import random
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime, timedelta
from typing import Any

from sqlalchemy import Table, insert

from webapp.storage.database import Database
from webapp.storage.records import FIRST_HASH, Action, canonical, chained, content_digest
from webapp.storage.schema import metadata
from webapp.storage.scope import Scope
from webapp.storage.tables import (
    answers,
    arrangements,
    drives,
    events,
    pages,
    participants,
    predictions,
    ratings,
    record_contents,
    records,
    recruits,
    trials,
)
from webapp.study.counterbalancing import arrangements as all_arrangements
from webapp.study.counterbalancing import layout_orders
from webapp.study.experiments import SATISFACTION_ITEMS
from webapp.study.protocol import Study
from webapp.study.session import DRIVEN, Assignment, Page, plan_trials
from webapp.study.session import pages as all_pages

START = datetime(2031, 3, 1, 9, tzinfo=UTC)
BETWEEN_ARRIVALS = timedelta(minutes=3)
LEASE = timedelta(minutes=61)
EVENTS_PER_PAGE = 6

_Rows = dict[Table, list[dict[str, Any]]]
_AT_ONCE = 500
_CODE_ALPHABET = "23456789abcdefghjkmnpqrstvwxyz"


def write_crowd(database: Database, study: Study, scope: Scope, num_people: int, seed: int = 1) -> datetime:
    """Write people of whom most completed, some left and some are under way; return the time after the last arrival."""
    crowd = Crowd(study, scope, num_people, seed)
    for first in range(1, num_people + 1, _AT_ONCE):
        rows: _Rows = {}
        for number in range(first, min(first + _AT_ONCE, num_people + 1)):
            crowd.add(number, rows)
        with database.write() as connection:
            for table in metadata.sorted_tables:
                if rows.get(table):
                    connection.execute(insert(table), rows[table])
    return START + num_people * BETWEEN_ARRIVALS


class Crowd:
    """Makes rows of one participant after the other, and the chain of records."""

    def __init__(self, study: Study, scope: Scope, num_people: int, seed: int) -> None:
        self._study, self._scope = study, scope
        self._last_arrival = START + num_people * BETWEEN_ARRIVALS
        self._chooser = random.Random(seed)
        self._num_records, self._last_hash = 0, FIRST_HASH

    def add(self, number: int, rows: _Rows) -> None:
        """Add the rows of one participant."""
        planned, places = self._plan(number)
        due = all_pages(self._study, planned)
        end = self._chooser.choices(("completed", "withdrawn", None), (85, 5, 10))[0]
        num_sent = len(due) if end == "completed" else self._chooser.randrange(len(due))
        salt, code = f"{self._chooser.getrandbits(128):032x}", self._code()
        subject = hashlib.sha256(f"{salt}{code}".encode()).hexdigest()
        consented_at = START + number * BETWEEN_ARRIVALS
        who = {"participant_id": number}
        drawn = [place | {"sizes": None, "uses": {}} for place in places]
        place = {"word": None, "experiments": drawn, "draws": [], "num_draws": 0}
        slot = self._record(rows, "allocated", consented_at, number, subject, "", content=place)
        self._record(rows, "consented", consented_at, number, subject, salt)
        rows.setdefault(arrangements, []).extend(who | place for place in places)
        rows.setdefault(trials, []).extend(
            who | {"number": at} | {name: getattr(trial, name) for name in type(trial).__slots__}
            for at, trial in enumerate(planned, start=1)
        )
        external = {"service": "prolific", "external_id": f"{number % (10**9):024x}", "external_session": f"{number}"}
        rows.setdefault(recruits, []).append(
            who | external | {"study": self._scope.study, "mode": self._scope.mode, "external_study": "study"}
        )
        at = consented_at
        for page in due[:num_sent]:
            at += timedelta(seconds=self._chooser.lognormvariate(3, 0.6))
            self._add_page(rows, number, page, at, [place + 1 for place, t in enumerate(planned) if t == page.trial])
            self._record(rows, "sent", at, number, subject, salt, page.number)
        person = self._person(number, code, salt, len(due), consented_at, at)
        released_at = None
        if end != "completed" and at + LEASE < self._last_arrival:
            released_at = at + LEASE
            why = {"slot": slot, "why": end or "expired"}
            self._record(rows, "slot_released", released_at, number, subject, "", content=why)
        rows.setdefault(participants, []).append(person | self._ended(end, at) | {"slot_released_at": released_at})

    def _plan(self, number: int) -> tuple[Sequence[Any], list[dict[str, Any]]]:
        chosen = {
            experiment.id: Assignment(
                number % len(all_arrangements(experiment)), number % len(layout_orders(experiment))
            )
            for experiment in self._study.experiments
        }
        places = [
            {"experiment": name, "arrangement": given.arrangement, "layout_order": given.layout_order}
            for name, given in chosen.items()
        ]
        num_draws = self._study.explanation.num_draws
        return plan_trials(self._study, chosen, lambda: self._chooser.randrange(num_draws)), places

    def _code(self) -> str:
        return "".join(self._chooser.choices(_CODE_ALPHABET, k=10))

    def _person(
        self, number: int, code: str, salt: str, num_pages: int, consented_at: datetime, last_seen_at: datetime
    ) -> dict[str, Any]:
        return {
            "id": number,
            "code": code,
            "token_hash": f"{number:064x}",
            "mode": self._scope.mode,
            "study": self._scope.study,
            "study_version": self._scope.study_version,
            "consent_version": "1",
            "language": "en",
            "translation": "original",
            "num_pages": num_pages,
            "consented_at": consented_at,
            "last_seen_at": last_seen_at,
            "salt": salt,
        }

    def _ended(self, end: str | None, at: datetime) -> dict[str, datetime | None]:
        return {name: at if name == f"{end}_at" else None for name in ("completed_at", "withdrawn_at")}

    def _add_page(self, rows: _Rows, number: int, page: Page, at: datetime, trial: Sequence[int]) -> None:
        key = {"participant_id": number, "page_number": page.number}
        row = {"kind": page.kind, "trial_number": trial[0] if trial else None, "nonce": f"{number} {page.number}"}
        rows.setdefault(pages, []).append({"participant_id": number, "number": page.number, **row, "submitted_at": at})
        for table, entries in self._content(page, at):
            rows.setdefault(table, []).extend(key | entry for entry in entries)

    def _content(self, page: Page, at: datetime) -> Iterator[tuple[Table, list[dict[str, Any]]]]:
        chooser = self._chooser
        if page.trial is not None and page.kind in ("rating", "satisfaction"):
            asked = self._study.experiment(page.trial.experiment).items_for(page.trial.kind)
            items = SATISFACTION_ITEMS if page.kind == "satisfaction" else [item.id for item in asked]
            yield ratings, [{"item": item, "rating": chooser.randint(1, 5), "response_time_ms": 2500} for item in items]
        if page.kind == "probe":
            yield predictions, [self._prediction(question) for question in (1, 2)]
        if page.kind == "quiz":
            answer = {"attempt": 1, "question": "goal", "purpose": "quiz", "answer": "flag", "is_correct": True}
            yield answers, [answer | {"submitted_at": at}]
        if page.kind in DRIVEN:
            end = chooser.choice(("reached", "gave_up"))
            told = {"layout": "a", "end": end, "num_steps": 9, "optimum": 7, "step_limit": 21}
            yield drives, [told | {"phase": DRIVEN[page.kind], "subgoals_passed": "1 2", "key_points": ""}]
        names = ["painted", *chooser.choices(("changed", "focus_lost"), (9, 1), k=EVENTS_PER_PAGE - 1)]
        yield (
            events,
            [
                {"number": place, "event": name, "target": "", "value": "", "at_ms": 500 * place}
                for place, name in enumerate(names, start=1)
            ],
        )

    def _prediction(self, question: int) -> dict[str, Any]:
        is_right = self._chooser.random() < 0.6
        told = {"predicted": "left" if is_right else "right", "action": "left", "is_correct": is_right}
        sure = {"confidence": self._chooser.randint(1, 5), "response_time_ms": 900}
        return {"question": question, "state": 7, "is_as_good": is_right or question == 1} | told | sure

    def _record(
        self,
        rows: _Rows,
        action: Action,
        at: datetime,
        number: int,
        subject: str,
        salt: str,
        page: int | None = None,
        content: dict[str, Any] | None = None,
    ) -> int:
        """Add a record of the chain and return its number; nobody verifies the digests of answers here."""
        self._num_records += 1
        scope = {"study": self._scope.study, "study_version": self._scope.study_version, "mode": self._scope.mode}
        row = {"number": self._num_records, "at": at, "actor": "system", "action": action, **scope}
        row |= {"subject": subject, "content_digest": content_digest(salt, content)}
        row |= chained(row, self._last_hash)
        self._last_hash = str(row["hash"])
        rows.setdefault(records, []).append(row)
        about = {"participant_id": number, "page_number": page, "part": None}
        told = None if content is None else canonical(content)
        rows.setdefault(record_contents, []).append({"number": row["number"], **about, "content": told})
        return self._num_records
