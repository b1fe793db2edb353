"""Pages that a researcher let a participant begin anew: what was done on them before stays, and counts no more."""

from dataclasses import dataclass

from sqlalchemy import BindParameter, Connection, bindparam, func, select

from webapp.storage.participants import Participant
from webapp.storage.tables import answers, drive_steps, page_restarts

# Every request asks some of these; putting them together takes longer than asking.
_PARTICIPANT: BindParameter[int] = bindparam("participant")
_PAGE: BindParameter[int] = bindparam("page")
_RESTARTS = (
    select(page_restarts.c.page_number, func.max(page_restarts.c.number))
    .where(page_restarts.c.participant_id == _PARTICIPANT)
    .group_by(page_restarts.c.page_number)
)
_LATEST = (
    select(page_restarts.c.number, page_restarts.c.after_step, page_restarts.c.after_attempt)
    .where(page_restarts.c.participant_id == _PARTICIPANT, page_restarts.c.page_number == _PAGE)
    .order_by(page_restarts.c.number.desc())
    .limit(1)
)
_STEPS = select(func.count()).where(
    drive_steps.c.participant_id == _PARTICIPANT,
    drive_steps.c.page_number == _PAGE,
    drive_steps.c.number > bindparam("after"),
)
_ATTEMPTS = select(func.max(answers.c.attempt)).where(
    answers.c.participant_id == _PARTICIPANT, answers.c.page_number == _PAGE
)


@dataclass(frozen=True, slots=True)
class Restart:
    """Where a page was begun last.

    Attributes:
        participant_id: Whose page it is.
        page: The page's number.
        number: How often it was begun anew.
        after_step: The number of the drive's last action before that; 0 if there was none.
        after_attempt: The number of the last attempt at its questions before that; 0 if there was none.
    """

    participant_id: int
    page: int
    number: int
    after_step: int
    after_attempt: int


def read_restarts(connection: Connection, participant: Participant) -> dict[int, int]:
    """Return by page how often a participant began it anew; pages never begun anew are missing."""
    if not participant.has_restarts:
        return {}
    return dict(tuple(row) for row in connection.execute(_RESTARTS, {"participant": participant.id}))


def latest_restart(connection: Connection, participant_id: int, page: int) -> Restart:
    """Return where a page was begun last; for most pages that is their beginning."""
    row = connection.execute(_LATEST, {"participant": participant_id, "page": page}).one_or_none()
    return Restart(participant_id, page, *(0, 0, 0) if row is None else tuple(row))


def restart_within(connection: Connection, fresh: Participant, page: int) -> Restart:
    """Return the same of a participant who was read within this transaction; most need not be asked about."""
    return latest_restart(connection, fresh.id, page) if fresh.has_restarts else Restart(fresh.id, page, 0, 0, 0)


def num_steps_since(connection: Connection, restart: Restart) -> int:
    """Return how many actions of the page's drive are stored since then."""
    wanted = {"participant": restart.participant_id, "page": restart.page, "after": restart.after_step}
    return int(connection.execute(_STEPS, wanted).scalar_one())


def num_attempts_since(connection: Connection, restart: Restart) -> int:
    """Return how many attempts at the page's questions are stored since then."""
    wanted = {"participant": restart.participant_id, "page": restart.page}
    return max((connection.execute(_ATTEMPTS, wanted).scalar_one() or 0) - restart.after_attempt, 0)
