"""The log of everything that happened: append-only, each record chained to the one before by its hash.

A record holds digests, never a person's words or answers. What it tells about stands beside it, in `record_contents`
or in the answers' own tables, and can be erased at a person's wish: the digests are salted with a random number of that
person, which is erased too, so that nothing of them can be guessed from the chain, and the chain still holds.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, Literal

from sqlalchemy import Connection, bindparam, insert, select

from webapp.storage.group_commit import kept
from webapp.storage.scope import Scope
from webapp.storage.tables import record_contents, records

Action = Literal[
    "consented",
    "attempted",
    "acted",
    "sent",
    "withdrew",
    "allocated",
    "slot_released",
    "slot_resumed",
    "served",
    "excluded",
    "included",
    "corrected",
    "noted",
    "page_released",
    "page_restarted",
    "link_made",
    "erased",
    "unblinded",
    "person_unblinded",
    "downloaded",
    "published",
    "created",
    "role_changed",
    "password_changed",
    "disabled",
    "signed_in",
    "signed_out",
    "sessions_revoked",
    "revealed",
]
"""What may have happened; `revealed` only in logs of earlier versions of the program."""

LEDGER: frozenset[str] = frozenset({"allocated", "slot_released", "slot_resumed"})
"""The allocation ledger. Its contents are about places in the study, not about who took them, and outlast erasure."""

PARTICIPANT = "participant"
SYSTEM = "system"
COMMAND_LINE = "(command line)"
"""Who acts besides researchers, who act under the names of their accounts: whoever can run commands on the machine."""

ACTORS = frozenset({PARTICIPANT, SYSTEM, COMMAND_LINE})
"""Names that no account may have."""

FIRST_HASH = "0" * 64
"""What stands for the hash before the first record."""

# Every change needs these; putting them together takes longer than asking.
_HEAD = select(records.c.number, records.c.hash).order_by(records.c.number.desc()).limit(1)
_INSERT_RECORD, _INSERT_CONTENT = insert(records), insert(record_contents)
# The same in one statement, where the way to the database is long.
_BESIDE = "beside_"
_INSERT_BOTH = (
    insert(record_contents)
    .values({column.name: bindparam(f"{_BESIDE}{column.name}") for column in record_contents.columns})
    .add_cte(insert(records).values({column.name: bindparam(column.name) for column in records.columns}).cte("record"))
)
_LAST = "last record"


@dataclass(frozen=True, slots=True)
class Subject:
    """The participant whom a record is about.

    Attributes:
        id: The row's number.
        code: The public code.
        salt: The participant's own random number, in hexadecimal.
    """

    id: int
    code: str
    salt: str

    @property
    def digest(self) -> str:
        """What the chain holds of the participant."""
        return _sha256(f"{self.salt}{self.code}")


@dataclass(frozen=True, slots=True)
class Entry:
    """What is to be recorded.

    Attributes:
        at: When it happened.
        actor: `PARTICIPANT`, `SYSTEM`, or the name of an account.
        action: What happened.
        scope: Of which data; None for what concerns accounts alone.
        subject: The participant it is about, if any.
        page: The page it is about, if any.
        part: The number of the attempt, or of the drive's action, within the page, if any.
        content: What is told about it. Answers are not repeated: see `rows`.
        rows: Rows of the answers' tables, where these are what is told; they are digested and not stored again.
    """

    at: datetime
    actor: str
    action: Action
    scope: Scope | None = None
    subject: Subject | None = None
    page: int | None = None
    part: int | None = None
    content: Mapping[str, Any] | None = None
    rows: Mapping[str, Any] | None = None


@dataclass(frozen=True, slots=True)
class Head:
    """The end of the chain. Who notes it down can tell later whether anything before it was changed.

    Attributes:
        number: Of the latest record; 0 for an empty log.
        hash: Its hash, 64 hexadecimal digits.
    """

    number: int
    hash: str


def append(connection: Connection, entry: Entry) -> int:
    """Add a record, within the transaction of what it tells about.

    Returns:
        Its number.
    """
    of_turns = kept(connection)
    last = of_turns.get(_LAST) or head(connection)
    salt = "" if entry.subject is None or entry.action in LEDGER else entry.subject.salt
    told = entry.content if entry.rows is None else entry.rows
    row = {
        "number": last.number + 1,
        "at": entry.at,
        "actor": entry.actor,
        "action": entry.action,
        "study": None if entry.scope is None else entry.scope.study,
        "study_version": None if entry.scope is None else entry.scope.study_version,
        "mode": None if entry.scope is None else entry.scope.mode,
        "subject": None if entry.subject is None else entry.subject.digest,
        "content_digest": content_digest(salt, told),
    }
    chain = chained(row, last.hash)
    row |= chain
    beside = {
        "number": row["number"],
        "participant_id": None if entry.subject is None else entry.subject.id,
        "page_number": entry.page,
        "part": entry.part,
        "content": None if entry.content is None else canonical(entry.content),
    }
    if connection.dialect.name == "postgresql":
        connection.execute(_INSERT_BOTH, {**row, **{f"{_BESIDE}{name}": value for name, value in beside.items()}})
    else:
        connection.execute(_INSERT_RECORD, row)
        connection.execute(_INSERT_CONTENT, beside)
    of_turns[_LAST] = Head(last.number + 1, chain["hash"])
    return last.number + 1


def head(connection: Connection) -> Head:
    """Return the end of the chain."""
    row = connection.execute(_HEAD).one_or_none()
    return Head(0, FIRST_HASH) if row is None else Head(*row)


def told_by(connection: Connection, *actions: Action, scope: Scope | None = None) -> Iterator[tuple[Any, ...]]:
    """Yield what was recorded of some kinds, in order: number, at, actor, action, participant id, page, content.

    Args:
        connection: A transaction.
        actions: The kinds.
        scope: Of these data alone; None for all.
    """
    query = (
        select(
            records.c.number,
            records.c.at,
            records.c.actor,
            records.c.action,
            record_contents.c.participant_id,
            record_contents.c.page_number,
            record_contents.c.content,
        )
        .join(record_contents, record_contents.c.number == records.c.number)
        .where(records.c.action.in_(actions))
        .order_by(records.c.number)
    )
    if scope is not None:
        query = query.where(scope.of(records))
    for *told, content in connection.execute(query, execution_options={"yield_per": 1000}):
        yield (*told, None if content is None else json.loads(content))


def chained(row: Mapping[str, Any], previous_hash: str) -> dict[str, str]:
    """Return the hash of a record and that of the one before.

    The hash is the SHA-256 of the canonical JSON of the previous hash and the record's fields, in the order below.
    """
    fields = ("number", "at", "actor", "action", "study", "study_version", "mode", "subject", "content_digest")
    return {
        "previous_hash": previous_hash,
        "hash": _sha256(canonical([previous_hash, *(row[name] for name in fields)])),
    }


def content_digest(salt: str, content: Mapping[str, Any] | None) -> str:
    """Return the SHA-256 of a salt and the canonical JSON of what is told."""
    return _sha256(salt + canonical(content))


def canonical(content: object) -> str:
    """Write JSON so that equal content gives equal text; times are UTC with microseconds."""
    return json.dumps(content, sort_keys=True, ensure_ascii=False, separators=(",", ":"), default=_time)


def _time(value: object) -> str:
    if not isinstance(value, datetime):
        raise TypeError(f"{value!r} cannot be recorded")
    return value.astimezone(UTC).isoformat(timespec="microseconds").replace("+00:00", "Z")


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
