"""Accounts of researchers, their sessions on the dashboard, and the throttle that slows down guessing."""

import functools
import hashlib
import secrets
import threading
from dataclasses import dataclass
from datetime import datetime, timedelta

from argon2 import PasswordHasher, Type
from argon2.exceptions import InvalidHashError, VerificationError
from sqlalchemy import Connection, delete, func, insert, select, update
from sqlalchemy.dialects.sqlite import insert as upsert

from webapp.storage.audit import AuditEntry, log_action
from webapp.storage.database import Database
from webapp.storage.participants import hash_token
from webapp.storage.tables import researcher_sessions, researchers, sign_in_attempts

MIN_PASSWORD_LENGTH = 12
MAX_PASSWORD_LENGTH = 1024
MAX_NAME_LENGTH = 64

IDLE_LIMIT = timedelta(minutes=30)
ABSOLUTE_LIMIT = timedelta(hours=12)

FREE_ATTEMPTS = 5
"""So many wrong passwords in a row cost nothing; each further one doubles the wait, from 1 s up to `MAX_WAIT`."""

MAX_WAIT = timedelta(minutes=15)
_FORGET_AFTER = timedelta(days=1)

_HASHER = PasswordHasher(time_cost=2, memory_cost=19 * 1024, parallelism=1, type=Type.ID)
# A password hash takes 19 MiB and 50 ms: many sign-ins at once must not starve the participants.
_HASHES_AT_ONCE = threading.BoundedSemaphore(2)


class AccountError(ValueError):
    """An account that cannot be made; the message says why."""


class AccountExistsError(AccountError):
    """There is an account of this name already."""


class TooManyAttemptsError(RuntimeError):
    """Wrong passwords came too fast.

    Attributes:
        wait_s: The number of seconds after which the next attempt is looked at.
    """

    def __init__(self, wait_s: int) -> None:
        super().__init__(f"too many attempts; try again in {wait_s} s")
        self.wait_s = wait_s


@dataclass(frozen=True, slots=True)
class ResearcherSession:
    """A researcher who is signed in.

    Attributes:
        name: The name of the account.
        token_hash: SHA-256 of the cookie's token, in hexadecimal.
        revealed_at: When the ratings were revealed in this session; None while they are hidden.
    """

    name: str
    token_hash: str
    revealed_at: datetime | None


def check_name(name: str) -> None:
    """Make sure that a name can be that of an account.

    Raises:
        AccountError: It cannot; the message says what can.
    """
    if not name or len(name) > MAX_NAME_LENGTH or not name.isprintable() or name != name.strip():
        raise AccountError(f"{name!r} cannot be a name; use 1 to {MAX_NAME_LENGTH} characters, no blanks at the ends")


def create_researcher(database: Database, name: str, password: str, now: datetime) -> None:
    """Make an account.

    Raises:
        AccountExistsError: There is one of this name.
        AccountError: The name or the password cannot be used.
    """
    check_name(name)
    if not MIN_PASSWORD_LENGTH <= len(password) <= MAX_PASSWORD_LENGTH:
        raise AccountError(f"a password needs at least {MIN_PASSWORD_LENGTH} characters, not {len(password)}")
    hashed = _HASHER.hash(password)
    with database.write() as connection:
        if connection.execute(select(researchers.c.id).where(researchers.c.name == name)).one_or_none():
            raise AccountExistsError(f"there is an account {name!r} already")
        connection.execute(insert(researchers).values(name=name, password_hash=hashed, created_at=now))
        log_action(connection, AuditEntry(now, name, "created", None))


def has_researcher(database: Database, name: str) -> bool:
    """Tell whether there is an account of this name."""
    with database.read() as connection:
        query = select(func.count()).select_from(researchers).where(researchers.c.name == name)
        return connection.execute(query).scalar_one() > 0


def sign_in(database: Database, name: str, password: str, now: datetime) -> str | None:
    """Open a session.

    The attempt is counted before the password is looked at, so that simultaneous guesses are all counted.

    Returns:
        The token for the researcher's cookie; None if name and password do not belong together.

    Raises:
        TooManyAttemptsError: Wrong passwords came too fast for this name, whether or not there is such an account.
    """
    name_hash = hashlib.sha256(name.encode()).hexdigest()
    with database.write() as connection:
        _count_attempt(connection, name_hash, now)
        account = connection.execute(
            select(researchers.c.id, researchers.c.password_hash).where(researchers.c.name == name)
        ).one_or_none()
    right = _verify(_nobodys_hash() if account is None else account.password_hash, password)
    if account is None or not right:
        return None
    token = secrets.token_urlsafe(32)
    session = {"token_hash": hash_token(token), "researcher_id": account.id, "created_at": now, "last_seen_at": now}
    with database.write() as connection:
        connection.execute(delete(sign_in_attempts).where(sign_in_attempts.c.name_hash == name_hash))
        connection.execute(delete(researcher_sessions).where(researcher_sessions.c.created_at < now - ABSOLUTE_LIMIT))
        connection.execute(insert(researcher_sessions).values(session))
        log_action(connection, AuditEntry(now, name, "signed_in", None))
    return token


def find_session(database: Database, token: str, now: datetime, *, active: bool) -> ResearcherSession | None:
    """Return the session that a cookie's token belongs to.

    Args:
        database: Where to look.
        token: The token.
        now: The time of the request.
        active: Whether the researcher did something, which keeps the session alive; a poll by the page does not.

    Returns:
        None if there is no such session, or it has ended by itself after `IDLE_LIMIT` or `ABSOLUTE_LIMIT`.
    """
    query = (
        select(researchers.c.name, researcher_sessions)
        .join(researchers)
        .where(
            researcher_sessions.c.token_hash == hash_token(token),
            researcher_sessions.c.last_seen_at > now - IDLE_LIMIT,
            researcher_sessions.c.created_at > now - ABSOLUTE_LIMIT,
        )
    )
    with database.read() as connection:
        row = connection.execute(query).one_or_none()
    if row is None:
        return None
    if active and now - row.last_seen_at > timedelta(minutes=1):
        _change_session(database, row.token_hash, last_seen_at=now)
    return ResearcherSession(row.name, row.token_hash, row.revealed_at)


def sign_out(database: Database, session: ResearcherSession, now: datetime) -> None:
    """End a session."""
    with database.write() as connection:
        connection.execute(delete(researcher_sessions).where(researcher_sessions.c.token_hash == session.token_hash))
        log_action(connection, AuditEntry(now, session.name, "signed_out", None))


def reveal_ratings(database: Database, session: ResearcherSession, detail: str, now: datetime) -> None:
    """Show the ratings for the rest of this session, and log who asked for them and when.

    Args:
        database: Where to store.
        session: Who asks.
        detail: Which ratings, in words.
        now: The time.
    """
    with database.write() as connection:
        connection.execute(
            update(researcher_sessions)
            .where(researcher_sessions.c.token_hash == session.token_hash)
            .values(revealed_at=now)
        )
        log_action(connection, AuditEntry(now, session.name, "revealed", detail))


def log_download(database: Database, session: ResearcherSession, file_name: str, now: datetime) -> None:
    """Log who downloaded which file, and when."""
    with database.write() as connection:
        log_action(connection, AuditEntry(now, session.name, "downloaded", file_name))


@functools.cache
def _nobodys_hash() -> str:
    """Return what is verified when there is no such account, so that the time taken does not tell which exist."""
    return _HASHER.hash(secrets.token_urlsafe(32))


def _verify(hashed: str, password: str) -> bool:
    with _HASHES_AT_ONCE:
        try:
            return _HASHER.verify(hashed, password)
        except (VerificationError, InvalidHashError):
            return False


def _count_attempt(connection: Connection, name_hash: str, now: datetime) -> None:
    """Count one more failure for a name, taken back by `sign_in` if the password is right."""
    connection.execute(delete(sign_in_attempts).where(sign_in_attempts.c.last_attempt_at < now - _FORGET_AFTER))
    query = select(sign_in_attempts).where(sign_in_attempts.c.name_hash == name_hash)
    row = connection.execute(query).one_or_none()
    if row is not None and row.blocked_until is not None and now < row.blocked_until:
        raise TooManyAttemptsError(wait_s=int((row.blocked_until - now).total_seconds()) + 1)
    num_failures = 1 if row is None else row.num_failures + 1
    changes = {
        "num_failures": num_failures,
        "last_attempt_at": now,
        "blocked_until": None if num_failures < FREE_ATTEMPTS else now + _wait(num_failures),
    }
    connection.execute(
        upsert(sign_in_attempts)
        .values(name_hash=name_hash, **changes)
        .on_conflict_do_update(index_elements=["name_hash"], set_=changes)
    )


def _wait(num_failures: int) -> timedelta:
    doublings = min(num_failures - FREE_ATTEMPTS, 20)
    return min(timedelta(seconds=2**doublings), MAX_WAIT)


def _change_session(database: Database, token_hash: str, *, last_seen_at: datetime) -> None:
    with database.write() as connection:
        connection.execute(
            update(researcher_sessions)
            .where(researcher_sessions.c.token_hash == token_hash)
            .values(last_seen_at=last_seen_at)
        )
