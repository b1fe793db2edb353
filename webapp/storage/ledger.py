"""The allocation ledger: every draw with what it was drawn from, and every place given back.

A place is taken by a consent. It counts for the balance while its participant has finished, or may still finish: has
neither left nor been screened out, and gave a sign of life within the study's lease. The next allocation gives back the
others; whoever returns later keeps the assignment, and the place counts again. Each study version has a ledger of its
own for live data, for test runs and for bots. `storage.replay` draws everything again.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any, Literal

from sqlalchemy import Connection, and_, case, func, or_, select, update

from webapp.storage.records import SYSTEM, Entry, Subject, append
from webapp.storage.scope import Scope
from webapp.storage.tables import arrangements, participants, record_contents, records
from webapp.study.counterbalancing import arrangements as all_arrangements
from webapp.study.counterbalancing import choose_cell, layout_orders
from webapp.study.draws import Draws
from webapp.study.protocol import Experiment, Study
from webapp.study.session import Assignment, Trial, plan_trials

Why = Literal["expired", "withdrawn", "screened_out"]
_Cell = tuple[int, int]


@dataclass(frozen=True, slots=True)
class Allocation:
    """What was drawn for a participant.

    Attributes:
        chosen: By experiment.
        trials: In the order of the study.
        content: What the ledger holds of it.
    """

    chosen: Mapping[str, Assignment]
    trials: tuple[Trial, ...]
    content: Mapping[str, Any]


def allocate(connection: Connection, study: Study, scope: Scope, draws: Draws) -> Allocation:
    """Choose, within the transaction that stores the choice, what a new participant sees."""
    chosen: dict[str, Assignment] = {}
    told: list[dict[str, Any]] = []
    for experiment in study.experiments:
        uses = _uses(connection, scope, experiment)
        sizes = len(all_arrangements(experiment)), len(layout_orders(experiment))
        chosen[experiment.id] = Assignment(*choose_cell(uses, *sizes, draws))
        told.append(_told(experiment.id, uses, sizes, chosen[experiment.id]))
    num_draws = study.explanation.num_draws
    trials = plan_trials(study, chosen, draw=lambda: draws.randrange(num_draws))
    drawn = [trial.draw for trial in trials if trial.draw is not None]
    content = {"word": draws.word, "experiments": told, "draws": drawn, "num_draws": num_draws}
    return Allocation(chosen, trials, content)


def release_abandoned(connection: Connection, scope: Scope, lease_minutes: int, now: datetime) -> None:
    """Give back the places of those who left, were screened out, or gave no sign of life within the lease."""
    why = case(
        (participants.c.withdrawn_at.is_not(None), "withdrawn"),
        (participants.c.screened_out_at.is_not(None), "screened_out"),
        else_="expired",
    )
    silent = participants.c.last_seen_at < now - timedelta(minutes=lease_minutes)
    abandoned = or_(participants.c.withdrawn_at.is_not(None), participants.c.screened_out_at.is_not(None), silent)
    query = (
        select(participants.c.id, participants.c.code, participants.c.salt, why)
        .where(
            scope.of(participants),
            participants.c.completed_at.is_(None),
            participants.c.slot_released_at.is_(None),
            abandoned,
        )
        .order_by(participants.c.id)
    )
    for participant_id, code, salt, reason in connection.execute(query).all():
        release_slot(connection, scope, Subject(participant_id, code, salt), reason, now)


def release_slot(connection: Connection, scope: Scope, subject: Subject, why: Why, now: datetime) -> None:
    """Give back one place."""
    connection.execute(update(participants).where(participants.c.id == subject.id).values(slot_released_at=now))
    content = {"slot": slot_of(connection, subject.id), "why": why}
    append(connection, Entry(now, SYSTEM, "slot_released", scope, subject, content=content))


def resume_slot(connection: Connection, scope: Scope, subject: Subject, now: datetime) -> None:
    """Let the place of somebody who came back late count again."""
    changes = {"slot_released_at": None, "returned_late_at": now}
    connection.execute(update(participants).where(participants.c.id == subject.id).values(changes))
    content = {"slot": slot_of(connection, subject.id)}
    append(connection, Entry(now, SYSTEM, "slot_resumed", scope, subject, content=content))


def slot_of(connection: Connection, participant_id: int) -> int:
    """Return the number of the record that gave a participant the place."""
    query = (
        select(records.c.number)
        .join(record_contents, record_contents.c.number == records.c.number)
        .where(record_contents.c.participant_id == participant_id, records.c.action == "allocated")
    )
    return int(connection.execute(query).scalar_one())


def taken_places(connection: Connection, study: Study, now: datetime) -> int:
    """Return how many people of all versions of a live study have finished, or may still finish within the lease."""
    person = participants.c
    under_way = and_(
        person.withdrawn_at.is_(None),
        person.screened_out_at.is_(None),
        person.last_seen_at >= now - timedelta(minutes=study.lease_minutes),
    )
    query = select(func.count()).where(
        person.study == study.name, person.mode == "live", or_(person.completed_at.is_not(None), under_way)
    )
    return connection.execute(query).scalar_one()


def _uses(connection: Connection, scope: Scope, experiment: Experiment) -> dict[_Cell, int]:
    query = (
        select(arrangements.c.arrangement, arrangements.c.layout_order, func.count())
        .join(participants)
        .where(
            and_(scope.of(participants), participants.c.slot_released_at.is_(None)),
            arrangements.c.experiment == experiment.id,
        )
        .group_by(arrangements.c.arrangement, arrangements.c.layout_order)
    )
    return {(arrangement, order): count for arrangement, order, count in connection.execute(query)}


def _told(experiment: str, uses: Mapping[_Cell, int], sizes: _Cell, chosen: Assignment) -> dict[str, Any]:
    return {
        "experiment": experiment,
        "sizes": list(sizes),
        "uses": {f"{arrangement}/{order}": count for (arrangement, order), count in sorted(uses.items())},
        "arrangement": chosen.arrangement,
        "layout_order": chosen.layout_order,
    }
