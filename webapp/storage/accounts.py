"""Accounts of researchers: made, given a role, and closed by command; their sessions can be ended from outside."""

from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import ColumnElement, Connection, delete, func, insert, select, update

from webapp.storage.database import Database
from webapp.storage.passwords import WeakPasswordError, check_password
from webapp.storage.records import ACTORS, COMMAND_LINE, Entry, append
from webapp.storage.researchers import ABSOLUTE_LIMIT, IDLE_LIMIT, Role, hash_password
from webapp.storage.tables import researcher_sessions, researchers

MAX_NAME_LENGTH = 64


class AccountError(ValueError):
    """An account that cannot be made; the message says why."""


class AccountExistsError(AccountError):
    """There is an account of this name already."""


@dataclass(frozen=True, slots=True)
class Account:
    """An account.

    Attributes:
        name: Under which its owner signs in.
        role: What it may do.
        created_at: When it was made.
        disabled_at: When it was closed; None while it is open.
        num_sessions: How many browsers are signed in.
    """

    name: str
    role: Role
    created_at: datetime
    disabled_at: datetime | None
    num_sessions: int


@dataclass(frozen=True, slots=True)
class OpenSession:
    """A browser that is signed in.

    Attributes:
        id: The first digits of its token's hash, which say nothing about the token.
        name: The account.
        created_at: When it signed in.
        last_seen_at: When it last did something.
    """

    id: str
    name: str
    created_at: datetime
    last_seen_at: datetime


def check_name(name: str) -> None:
    """Make sure that a name can be that of an account.

    Raises:
        AccountError: It cannot; the message says what can.
    """
    if not name or len(name) > MAX_NAME_LENGTH or not name.isprintable() or name != name.strip():
        raise AccountError(f"{name!r} cannot be a name; use 1 to {MAX_NAME_LENGTH} characters, no blanks at the ends")
    if "/" in name or name in {".", ".."}:
        raise AccountError(f"{name!r} cannot be a name; it is part of addresses, so use no slash")
    if name in ACTORS:
        raise AccountError(f"{name!r} cannot be a name; the log uses it for somebody else")


def create_researcher(database: Database, name: str, password: str, now: datetime, role: Role = "owner") -> None:
    """Make an account.

    Raises:
        AccountExistsError: There is one of this name.
        AccountError: The name or the password cannot be used.
    """
    check_name(name)
    hashed = _hashed(password, name)
    with database.write() as connection:
        if connection.execute(select(researchers.c.id).where(researchers.c.name == name)).one_or_none():
            raise AccountExistsError(f"there is an account {name!r} already")
        connection.execute(insert(researchers).values(name=name, password_hash=hashed, created_at=now, role=role))
        append(connection, Entry(now, COMMAND_LINE, "created", content={"account": name, "role": role}))


def has_researcher(database: Database, name: str) -> bool:
    """Tell whether there is an account of this name."""
    with database.read() as connection:
        query = select(func.count()).select_from(researchers).where(researchers.c.name == name)
        return connection.execute(query).scalar_one() > 0


def accounts(database: Database, now: datetime) -> tuple[Account, ...]:
    """Return all accounts, oldest first."""
    num_sessions = (
        select(func.count())
        .select_from(researcher_sessions)
        .where(researcher_sessions.c.researcher_id == researchers.c.id, *_is_open(now))
        .scalar_subquery()
    )
    query = select(
        researchers.c.name, researchers.c.role, researchers.c.created_at, researchers.c.disabled_at, num_sessions
    )
    with database.read() as connection:
        return tuple(Account(*row) for row in connection.execute(query.order_by(researchers.c.id)))


def open_sessions(database: Database, now: datetime, name: str | None = None) -> tuple[OpenSession, ...]:
    """Return the browsers that are signed in, to one account or to any, latest first."""
    query = (
        select(
            func.substr(researcher_sessions.c.token_hash, 1, _ID_LENGTH),
            researchers.c.name,
            researcher_sessions.c.created_at,
            researcher_sessions.c.last_seen_at,
        )
        .join(researchers)
        .where(*_is_open(now))
        .order_by(researcher_sessions.c.created_at.desc())
    )
    if name is not None:
        query = query.where(researchers.c.name == name)
    with database.read() as connection:
        return tuple(OpenSession(*row) for row in connection.execute(query))


def change_role(database: Database, name: str, role: Role, actor: str, now: datetime) -> None:
    """Give an account another role.

    Raises:
        AccountError: There is no such account.
    """
    with database.write() as connection:
        _change(connection, name, role=role)
        append(connection, Entry(now, actor, "role_changed", content={"account": name, "role": role}))


def change_password(database: Database, name: str, password: str, actor: str, now: datetime) -> None:
    """Give an account another password, and end its sessions.

    Raises:
        AccountError: There is no such account, or the password cannot be used.
    """
    hashed = _hashed(password, name)
    with database.write() as connection:
        account = _change(connection, name, password_hash=hashed)
        connection.execute(delete(researcher_sessions).where(researcher_sessions.c.researcher_id == account))
        append(connection, Entry(now, actor, "password_changed", content={"account": name}))


def disable(database: Database, name: str, actor: str, now: datetime) -> None:
    """Close an account for good, and end its sessions. What it did stays on record under its name.

    Raises:
        AccountError: There is no such account.
    """
    with database.write() as connection:
        account = _change(connection, name, disabled_at=now)
        connection.execute(delete(researcher_sessions).where(researcher_sessions.c.researcher_id == account))
        append(connection, Entry(now, actor, "disabled", content={"account": name}))


def revoke_sessions(database: Database, name: str, actor: str, now: datetime, session_id: str | None = None) -> int:
    """End the sessions of an account, or the one of an id.

    Returns:
        How many were ended.

    Raises:
        AccountError: There is no such account.
    """
    with database.write() as connection:
        account = _change(connection, name)
        theirs = researcher_sessions.c.researcher_id == account
        if session_id is not None:
            theirs &= func.substr(researcher_sessions.c.token_hash, 1, _ID_LENGTH) == session_id
        ended = connection.execute(delete(researcher_sessions).where(theirs)).rowcount
        append(connection, Entry(now, actor, "sessions_revoked", content={"account": name, "ended": ended}))
    return ended


_ID_LENGTH = 12


def _hashed(password: str, name: str) -> str:
    try:
        check_password(password, name)
    except WeakPasswordError as error:
        raise AccountError(str(error)) from None
    return hash_password(password)


def _is_open(now: datetime) -> tuple[ColumnElement[bool], ...]:
    return (
        researcher_sessions.c.last_seen_at > now - IDLE_LIMIT,
        researcher_sessions.c.created_at > now - ABSOLUTE_LIMIT,
    )


def _change(connection: Connection, name: str, **values: object) -> int:
    account = connection.execute(select(researchers.c.id).where(researchers.c.name == name)).scalar_one_or_none()
    if account is None:
        known = connection.execute(select(researchers.c.name).order_by(researchers.c.name)).scalars().all()
        raise AccountError(f"there is no account {name!r}; there are {', '.join(known) or 'none'}")
    if values:
        connection.execute(update(researchers).where(researchers.c.id == account).values(values))
    return int(account)
