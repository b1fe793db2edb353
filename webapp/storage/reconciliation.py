"""The recruiter's list against those whom it sent to us."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from sqlalchemy import Connection, select

from webapp.storage.database import Database
from webapp.storage.people_rows import state
from webapp.storage.scope import Mode
from webapp.storage.tables import participants, recruits
from webapp.storage.wanted import FindBundle, bundles_in, no_bundle
from webapp.study.reconciliation import (
    ADVICE,
    FINDINGS,
    NO_PROBLEM,
    TITLES,
    Finding,
    Found,
    OurPerson,
    ReconciliationError,
    compare,
    read_list,
    right_codes,
)

MAX_BYTES = 20_000_000
"""The longest list that is read; a line of Prolific's has about 300 bytes."""


@dataclass(frozen=True, slots=True)
class Group:
    """The people of one finding.

    Attributes:
        finding: The finding.
        title: What it is, in words.
        advice: What it means.
        people: Whom it is about, by their ids.
    """

    finding: Finding
    title: str
    advice: str
    people: tuple[Found, ...]


@dataclass(frozen=True, slots=True)
class Reconciliation:
    """What came of comparing.

    Attributes:
        study: The study.
        mode: Which participants.
        num_theirs: How many people are in the recruiter's list.
        num_ours: How many people the recruiter sent to us.
        num_agreeing: How many are in both, and nothing is to be said or done about them.
        groups: All findings, also those about nobody.
    """

    study: str
    mode: Mode
    num_theirs: int
    num_ours: int
    num_agreeing: int
    groups: tuple[Group, ...]

    @property
    def num_problems(self) -> int:
        """How many disagreements there are."""
        return sum(len(group.people) for group in self.groups if group.finding not in NO_PROBLEM)

    def as_json(self) -> Mapping[str, Any]:
        """Return it for programs."""
        return {
            **{name: getattr(self, name) for name in ("study", "mode", "num_theirs", "num_ours", "num_agreeing")},
            "num_problems": self.num_problems,
            "findings": {
                group.finding: [
                    {"external_id": one.external_id, "participant": one.code, "words": one.words}
                    for one in group.people
                ]
                for group in self.groups
            },
        }


def reconcile(
    database: Database,
    study: str,
    mode: Mode,
    text: str,
    *,
    id_column: str | None = None,
    find_bundle: FindBundle = no_bundle,
) -> Reconciliation:
    """Compare the recruiter's list with ours.

    Args:
        database: Where our people are.
        study: The name of the study; all its versions count.
        mode: Which participants.
        text: The recruiter's CSV file.
        id_column: The heading of its column of people's ids, where it is none of the known ones.
        find_bundle: Tells which codes people were shown; without it codes are not compared.

    Raises:
        ReconciliationError: The file cannot be compared.
    """
    theirs = read_list(text, id_column)
    with database.read() as connection:
        ours = _ours(connection, study, mode, find_bundle)
    found = compare(theirs, ours)
    listed, here = {one.external_id for one in theirs}, {one.external_id for one in ours}
    return Reconciliation(
        study,
        mode,
        num_theirs=len(listed),
        num_ours=len(here),
        num_agreeing=len((listed & here) - {one.external_id for one in found}),
        groups=tuple(
            Group(finding, TITLES[finding], ADVICE[finding], tuple(one for one in found if one.finding == finding))
            for finding in FINDINGS
        ),
    )


def reconcile_file(
    database: Database, instance: Path, path: Path, study: str | None, mode: str, id_column: str | None
) -> Reconciliation:
    """Compare the recruiter's list in a file with ours.

    Args:
        database: Where our people are.
        instance: The folder of the instance.
        path: The file.
        study: The name of the study; None for the only one to which a recruiter sent somebody.
        mode: Which participants.
        id_column: As for `reconcile`.

    Raises:
        ReconciliationError: The file cannot be read or compared, or it is not clear which study is meant.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ReconciliationError(f"{path}: {error.strerror}") from error
    known = next(one for one in get_args(Mode) if one == mode)
    with database.read() as connection:
        name = _study(connection, known, study)
    find_bundle = bundles_in(instance)
    return reconcile(database, name, known, decoded(content), id_column=id_column, find_bundle=find_bundle)


def decoded(content: bytes) -> str:
    """Return the text of a file.

    Raises:
        ReconciliationError: It is too long, or no UTF-8.
    """
    if len(content) > MAX_BYTES:
        raise ReconciliationError(f"the file has {len(content)} bytes; {MAX_BYTES} are the most")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise ReconciliationError("the file is not in UTF-8; save it as `CSV UTF-8`") from None


def _ours(connection: Connection, study: str, mode: Mode, find_bundle: FindBundle) -> Sequence[OurPerson]:
    query = (
        select(
            participants.c.study_version,
            participants.c.code,
            recruits.c.external_id,
            recruits.c.external_session,
            state.label("state"),
        )
        .join(recruits, recruits.c.participant_id == participants.c.id)
        .where(participants.c.study == study, participants.c.mode == mode)
        .order_by(participants.c.id)
    )
    people: list[OurPerson] = []
    for version, code, external_id, session, where in connection.execute(query):
        bundle = find_bundle(version)
        recruitment = None if bundle is None else bundle.study.recruitment
        people.append(OurPerson(external_id, code, where, session, right_codes(recruitment, where)))
    return people


def _study(connection: Connection, mode: Mode, study: str | None) -> str:
    query = select(recruits.c.study).distinct().where(recruits.c.mode == mode).order_by(recruits.c.study)
    known: Sequence[str] = connection.execute(query).scalars().all()
    if study is None and len(known) == 1:
        return known[0]
    if study is not None and study in known:
        return study
    listed = ", ".join(known) or "none"
    if study is None:
        raise ReconciliationError(f"use --study: studies with people sent by a recruiter, mode {mode}: {listed}")
    raise ReconciliationError(
        f"nobody was sent to the study {study!r} in mode {mode}; studies with such people: {listed}"
    )
