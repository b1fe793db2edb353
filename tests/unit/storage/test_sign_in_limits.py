"""Signing in at its limits: to the second when sessions end and waits begin, and whose counters are whose."""

import hashlib
import threading
from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import func, select

from webapp.storage import researchers as storage
from webapp.storage.accounts import create_researcher, open_sessions
from webapp.storage.database import Database
from webapp.storage.records import told_by
from webapp.storage.researchers import (
    ResearcherSession,
    TooManyAttemptsError,
    find_session,
    knows_password,
    log_download,
    sign_in,
    sign_out,
)
from webapp.storage.tables import researcher_sessions, sign_in_attempts

NOW = datetime(2031, 3, 1, 9, 30, tzinfo=UTC)
PASSWORD = "correct horse battery"  # noqa: S105
INSTANT = timedelta(microseconds=1)
MINUTE = timedelta(minutes=1)


@pytest.fixture
def account(database: Database) -> str:
    create_researcher(database, "researcher", PASSWORD, NOW)
    return "researcher"


def open_session(database: Database, now: datetime = NOW, browser: str | None = None, name: str = "researcher") -> str:
    token = sign_in(database, name, PASSWORD, now, browser)
    assert token is not None
    return token


def session_of(database: Database, token: str, now: datetime, *, active: bool = True) -> ResearcherSession:
    session = find_session(database, token, now, active=active)
    assert session is not None
    return session


def guess(database: Database, times: int, now: datetime = NOW, name: str = "researcher", browser: str = "") -> None:
    for _ in range(times):
        assert sign_in(database, name, "wrong", now, browser or None) is None


def is_blocked(database: Database, now: datetime = NOW, name: str = "researcher", browser: str = "") -> bool:
    try:
        sign_in(database, name, "wrong", now, browser or None)
    except TooManyAttemptsError:
        return True
    return False


def last_seen(database: Database, token: str) -> datetime:
    query = select(researcher_sessions.c.last_seen_at).where(
        researcher_sessions.c.token_hash == hashlib.sha256(token.encode()).hexdigest()
    )
    with database.read() as connection:
        found: datetime = connection.execute(query).scalar_one()
    return found


def num_sessions(database: Database) -> int:
    with database.read() as connection:
        return connection.execute(select(func.count()).select_from(researcher_sessions)).scalar_one()


@pytest.mark.usefixtures("account")
def test_an_idle_session_lives_for_exactly_half_an_hour(database: Database) -> None:
    token = open_session(database)
    assert find_session(database, token, NOW + timedelta(minutes=30) - INSTANT, active=False) is not None
    assert find_session(database, token, NOW + timedelta(minutes=30), active=False) is None


@pytest.mark.usefixtures("account")
def test_a_busy_session_lives_for_exactly_twelve_hours(database: Database) -> None:
    token, end = open_session(database), NOW + timedelta(hours=12)
    for quarters in range(1, 48):
        session_of(database, token, NOW + timedelta(minutes=15 * quarters))
    assert find_session(database, token, end - INSTANT, active=True) is not None
    assert find_session(database, token, end, active=True) is None


@pytest.mark.usefixtures("account")
def test_activity_is_noted_once_a_minute_and_for_that_session_alone(database: Database) -> None:
    one, other = open_session(database), open_session(database)
    session_of(database, one, NOW + MINUTE)
    assert last_seen(database, one) == NOW
    session_of(database, one, NOW + MINUTE + INSTANT)
    assert (last_seen(database, one), last_seen(database, other)) == (NOW + MINUTE + INSTANT, NOW)
    session_of(database, other, NOW + 9 * MINUTE, active=False)
    assert last_seen(database, other) == NOW


def test_signing_out_ends_one_session_and_says_whose(database: Database, account: str) -> None:
    one, other = open_session(database), open_session(database)
    session = session_of(database, one, NOW)
    assert session == ResearcherSession(account, "owner", hashlib.sha256(one.encode()).hexdigest())
    sign_out(database, session, NOW + MINUTE)
    assert find_session(database, one, NOW, active=False) is None
    assert find_session(database, other, NOW, active=False) is not None
    with database.read() as connection:
        ((_, at, actor, *_),) = told_by(connection, "signed_out")
    assert (at, actor) == (NOW + MINUTE, account)


@pytest.mark.usefixtures("account")
def test_sessions_that_are_over_are_forgotten_at_the_next_sign_in(database: Database) -> None:
    open_session(database, NOW)
    open_session(database, NOW + timedelta(hours=1))
    open_session(database, NOW + timedelta(hours=12), browser="b")
    assert num_sessions(database) == 3
    open_session(database, NOW + timedelta(hours=12) + INSTANT, browser="b")
    assert num_sessions(database) == 3


@pytest.mark.usefixtures("account")
def test_a_token_is_256_bits_that_a_url_may_hold(database: Database) -> None:
    token = open_session(database)
    assert len(token) == 43
    assert set(token) <= set("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_")


def test_a_session_is_listed_as_it_began(database: Database, account: str) -> None:
    open_session(database, NOW + MINUTE)
    (listed,) = open_sessions(database, NOW + MINUTE)
    assert (listed.name, listed.created_at, listed.last_seen_at) == (account, NOW + MINUTE, NOW + MINUTE)


@pytest.mark.usefixtures("account")
def test_wrong_passwords_are_forgotten_after_a_day_and_not_before(database: Database) -> None:
    guess(database, 4)
    day = timedelta(days=1)
    guess(database, 1, NOW + day)
    assert is_blocked(database, NOW + day)
    assert not is_blocked(database, NOW + 2 * day + INSTANT)
    guess(database, 3, NOW + 2 * day + INSTANT)
    assert not is_blocked(database, NOW + 2 * day + INSTANT)


def test_a_wait_ends_to_the_second_and_is_said_rounded_up(database: Database, account: str) -> None:
    guess(database, 5)
    second = timedelta(seconds=1)
    for now, wait_s in ((NOW, 2), (NOW + second / 2, 1), (NOW + second - INSTANT, 1)):
        with pytest.raises(TooManyAttemptsError, match=f"^too many attempts; try again in {wait_s} s$") as refusal:
            sign_in(database, account, PASSWORD, now)
        assert refusal.value.wait_s == wait_s
    assert sign_in(database, account, PASSWORD, NOW + second) is not None


def test_guesses_are_counted_by_name_and_by_browser_and_by_both_together(database: Database, account: str) -> None:
    create_researcher(database, "colleague", PASSWORD, NOW)
    guess(database, 5, browser="office")
    assert is_blocked(database, browser="office")
    assert not is_blocked(database, browser="home")
    assert not is_blocked(database, name="colleague", browser="office")
    assert not is_blocked(database)
    assert sign_in(database, account, PASSWORD, NOW, "home") is not None
    assert not is_blocked(database, NOW + MINUTE, browser="office")


def test_a_right_password_clears_its_own_counter_alone(database: Database, account: str) -> None:
    guess(database, 4)
    open_session(database, browser="office")
    guess(database, 1)
    assert is_blocked(database)
    with database.read() as connection:
        names = connection.execute(select(sign_in_attempts.c.name_hash)).scalars().all()
    assert names == [hashlib.sha256(account.encode()).hexdigest()[:3]]


def test_names_whose_hashes_begin_alike_share_a_counter_and_others_do_not(database: Database) -> None:
    digits = {number: hashlib.sha256(f"name {number}".encode()).hexdigest() for number in range(400)}
    alike = next((a, b) for a in digits for b in digits if a < b and digits[a][:3] == digits[b][:3])
    apart = next(n for n in digits if digits[n][:2] == digits[alike[0]][:2] and digits[n][:3] != digits[alike[0]][:3])
    guess(database, 5, name=f"name {alike[0]}")
    assert is_blocked(database, name=f"name {alike[1]}")
    assert not is_blocked(database, name=f"name {apart}")


def test_confirming_has_a_counter_of_its_own_for_each_account(database: Database, account: str) -> None:
    create_researcher(database, "colleague", PASSWORD, NOW)
    mine = session_of(database, open_session(database), NOW)
    theirs = session_of(database, open_session(database, name="colleague"), NOW)
    for _ in range(5):
        assert not knows_password(database, mine, "wrong", NOW)
    assert not knows_password(database, theirs, "wrong", NOW)
    with pytest.raises(TooManyAttemptsError):
        knows_password(database, mine, PASSWORD, NOW)
    assert knows_password(database, mine, PASSWORD, NOW + timedelta(seconds=1))
    for _ in range(4):
        assert not knows_password(database, mine, "wrong", NOW + MINUTE)
    assert knows_password(database, mine, PASSWORD, NOW + MINUTE)
    assert knows_password(database, theirs, PASSWORD, NOW)
    assert sign_in(database, account, "wrong", NOW) is None


def test_a_download_is_on_record_with_its_time_and_file(database: Database, account: str) -> None:
    session = session_of(database, open_session(database), NOW)
    log_download(database, session, "ratings.csv", NOW + MINUTE)
    with database.read() as connection:
        ((_, at, actor, *_, content),) = told_by(connection, "downloaded")
    assert (at, actor, content) == (NOW + MINUTE, account, {"file": "ratings.csv"})


@pytest.mark.usefixtures("account")
def test_of_seven_strangers_at_once_one_is_told_to_come_again_in_a_second(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    inside, leave, results = threading.Semaphore(0), threading.Event(), []

    def slow(_hashed: str, _password: str) -> bool:
        inside.release()
        assert leave.wait(30)
        return False

    monkeypatch.setattr(storage, "_verify", slow)
    threads = [
        threading.Thread(target=lambda name: results.append(sign_in(database, name, "x", NOW)), args=(f"n{number}",))
        for number in range(6)
    ]
    for thread in threads:
        thread.start()
    assert all(inside.acquire(timeout=30) for _ in threads)
    with pytest.raises(TooManyAttemptsError) as refusal:
        sign_in(database, "seventh", "x", NOW)
    leave.set()
    for thread in threads:
        thread.join()
    assert refusal.value.wait_s == 1
    assert results == [None] * 6
    assert sign_in(database, "seventh", "x", NOW) is None


def test_two_passwords_are_looked_at_at_once_and_no_third(monkeypatch: pytest.MonkeyPatch) -> None:
    inside, leave = threading.Semaphore(0), threading.Event()

    class Slow:
        def verify(self, _hashed: str, _password: str) -> bool:
            inside.release()
            return leave.wait(30)

    monkeypatch.setattr(storage, "_HASHER", Slow())
    threads = [threading.Thread(target=storage._verify, args=("x", "y")) for _ in range(3)]
    for thread in threads:
        thread.start()
    assert [inside.acquire(timeout=30), inside.acquire(timeout=30), inside.acquire(timeout=0.3)] == [True, True, False]
    leave.set()
    for thread in threads:
        thread.join()
    assert inside.acquire(timeout=30)


@pytest.mark.usefixtures("account")
def test_counters_have_names_that_outlast_a_new_version(database: Database) -> None:
    """A counter under another name would forget the guesses that were made before."""
    session = session_of(database, open_session(database), NOW)
    guess(database, 1, browser="office")
    assert not knows_password(database, session, "wrong", NOW)
    with database.read() as connection:
        names = set(connection.execute(select(sign_in_attempts.c.name_hash)).scalars())
    parts = ("browser|office|researcher", "confirm|researcher")
    assert names == {hashlib.sha256(part.encode()).hexdigest() for part in parts}
