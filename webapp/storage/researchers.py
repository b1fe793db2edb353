"""Signing in: sessions of researchers, and the throttle that slows down guessing; `storage.accounts` makes accounts."""

import functools
import hashlib
import secrets
import threading
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Literal, get_args

from argon2 import PasswordHasher, Type
from argon2.exceptions import InvalidHashError, VerificationError
from sqlalchemy import Connection, delete, insert, select, update

from webapp.storage.database import Database
from webapp.storage.participants import hash_token
from webapp.storage.records import Entry, append
from webapp.storage.tables import researcher_sessions, researchers, sign_in_attempts

Role = Literal["viewer", "owner", "admin"]
"""What an account may do: look on while the arms are masked; do everything with the study; manage accounts too."""

ROLES: tuple[Role, ...] = get_args(Role)
"""Each may do what those before it may."""

IDLE_LIMIT = timedelta(minutes=30)
ABSOLUTE_LIMIT = timedelta(hours=12)

FREE_ATTEMPTS = 5
"""So many wrong passwords in a row cost nothing; each further one doubles the wait, from 1 s up to `MAX_WAIT`."""

MAX_WAIT = timedelta(minutes=15)
_FORGET_AFTER = timedelta(days=1)

_HASHER = PasswordHasher(time_cost=2, memory_cost=19 * 1024, parallelism=1, type=Type.ID)
# A password hash takes 19 MiB and 50 ms: many sign-ins at once must not starve the participants.
_HASHES_AT_ONCE = threading.BoundedSemaphore(2)
# So many strangers may be at it or wait for it; the threads that are left serve participants and known browsers.
_STRANGERS_AT_ONCE = threading.BoundedSemaphore(6)
# Names are counted by three hexadecimal digits of their hash, so that made-up names fill 4,096 rows and no more.
_BUCKET_DIGITS = 3


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
        role: What the account may do.
        token_hash: SHA-256 of the cookie's token, in hexadecimal.
    """

    name: str
    role: Role
    token_hash: str

    def may(self, role: Role) -> bool:
        """Tell whether the account may do what a role may: each may do what the lower ones may."""
        return ROLES.index(self.role) >= ROLES.index(role)


def sign_in(database: Database, name: str, password: str, now: datetime, browser: str | None = None) -> str | None:
    """Open a session.

    The attempt is counted before the password is looked at, so that simultaneous guesses are all counted. Those from a
    browser that the account has signed in from before are counted apart: whoever guesses elsewhere, however often,
    keeps nobody out of a browser of their own.

    Args:
        database: Where the accounts are.
        name: The name that was typed.
        password: The password that was typed.
        now: The time of the attempt.
        browser: The id of a browser from which this account has signed in before, as proven by its cookie.

    Returns:
        The token for the researcher's cookie; None if name and password do not belong together.

    Raises:
        TooManyAttemptsError: Wrong passwords came too fast for this name, whether or not there is such an account, or
            too many strangers try at once.
    """
    if browser is not None:
        return _sign_in(database, name, password, now, _counter_of_browser(name, browser))
    if not _STRANGERS_AT_ONCE.acquire(blocking=False):
        raise TooManyAttemptsError(wait_s=1)
    try:
        return _sign_in(database, name, password, now, _counter_of_strangers(name))
    finally:
        _STRANGERS_AT_ONCE.release()


def _sign_in(database: Database, name: str, password: str, now: datetime, counter: str) -> str | None:
    wanted = "" if "\0" in name else name  # No account's name has a NUL, and PostgreSQL refuses to look for one.
    with database.write() as connection:
        _count_attempt(connection, counter, now)
        account = connection.execute(
            select(researchers.c.id, researchers.c.password_hash).where(
                researchers.c.name == wanted, researchers.c.disabled_at.is_(None)
            )
        ).one_or_none()
    right = _verify(_nobodys_hash() if account is None else account.password_hash, password)
    if account is None or not right:
        return None
    token = secrets.token_urlsafe(32)
    session = {"token_hash": hash_token(token), "researcher_id": account.id, "created_at": now, "last_seen_at": now}
    with database.write() as connection:
        connection.execute(delete(sign_in_attempts).where(sign_in_attempts.c.name_hash == counter))
        connection.execute(delete(researcher_sessions).where(researcher_sessions.c.created_at < now - ABSOLUTE_LIMIT))
        connection.execute(insert(researcher_sessions).values(session))
        append(connection, Entry(now, name, "signed_in"))
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
        select(researchers.c.name, researchers.c.role, researcher_sessions)
        .join(researchers)
        .where(
            researcher_sessions.c.token_hash == hash_token(token),
            researcher_sessions.c.last_seen_at > now - IDLE_LIMIT,
            researcher_sessions.c.created_at > now - ABSOLUTE_LIMIT,
            researchers.c.disabled_at.is_(None),
        )
    )
    with database.read() as connection:
        row = connection.execute(query).one_or_none()
    if row is None:
        return None
    if active and now - row.last_seen_at > timedelta(minutes=1):
        _change_session(database, row.token_hash, last_seen_at=now)
    return ResearcherSession(row.name, row.role, row.token_hash)


def sign_out(database: Database, session: ResearcherSession, now: datetime) -> None:
    """End a session."""
    with database.write() as connection:
        connection.execute(delete(researcher_sessions).where(researcher_sessions.c.token_hash == session.token_hash))
        append(connection, Entry(now, session.name, "signed_out"))


def knows_password(database: Database, session: ResearcherSession, password: str, now: datetime) -> bool:
    """Tell whether whoever is signed in knows the password, before something that cannot be undone.

    Attempts are counted apart from those to sign in: whoever tries wrong passwords from outside hinders nobody inside.

    Raises:
        TooManyAttemptsError: Wrong passwords came too fast.
    """
    counter = _counter("confirm", session.name)
    with database.write() as connection:
        _count_attempt(connection, counter, now)
        query = select(researchers.c.password_hash).where(researchers.c.name == session.name)
        hashed = connection.execute(query).scalar_one()
    if not _verify(hashed, password):
        return False
    with database.write() as connection:
        connection.execute(delete(sign_in_attempts).where(sign_in_attempts.c.name_hash == counter))
    return True


def log_download(database: Database, session: ResearcherSession, file_name: str, now: datetime) -> None:
    """Record who downloaded which file, and when."""
    with database.write() as connection:
        append(connection, Entry(now, session.name, "downloaded", content={"file": file_name}))


def hash_password(password: str) -> str:
    """Return what is stored of a password: an Argon2id hash with its salt."""
    return _HASHER.hash(password)


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


def _counter_of_strangers(name: str) -> str:
    return hashlib.sha256(name.encode(errors="replace")).hexdigest()[:_BUCKET_DIGITS]


def _counter_of_browser(name: str, browser: str) -> str:
    return _counter("browser", browser, name)


def _counter(*parts: str) -> str:
    """Return a counter's name, which has all 64 digits and so is none of the strangers'."""
    return hashlib.sha256("|".join(parts).encode(errors="replace")).hexdigest()


def _count_attempt(connection: Connection, name_hash: str, now: datetime) -> None:
    """Count one more failure by a counter, taken back by `sign_in` if the password is right."""
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
    if row is None:
        connection.execute(insert(sign_in_attempts).values(name_hash=name_hash, **changes))
    else:
        connection.execute(update(sign_in_attempts).where(sign_in_attempts.c.name_hash == name_hash).values(changes))


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
