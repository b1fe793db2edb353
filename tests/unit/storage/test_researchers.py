import threading
from datetime import UTC, datetime, timedelta

import pytest

from webapp.storage.audit import audit_entries
from webapp.storage.database import Database
from webapp.storage.researchers import (
    AccountError,
    AccountExistsError,
    ResearcherSession,
    TooManyAttemptsError,
    create_researcher,
    find_session,
    has_researcher,
    reveal_ratings,
    sign_in,
    sign_out,
)

NOW = datetime(2031, 3, 1, 9, 30, tzinfo=UTC)
PASSWORD = "correct horse battery"  # noqa: S105


@pytest.fixture
def account(database: Database) -> str:
    create_researcher(database, "researcher", PASSWORD, NOW)
    return "researcher"


def open_session(database: Database, name: str, now: datetime = NOW) -> str:
    token = sign_in(database, name, PASSWORD, now)
    assert token is not None
    return token


def session_of(database: Database, token: str, now: datetime, *, active: bool = True) -> ResearcherSession:
    session = find_session(database, token, now, active=active)
    assert session is not None
    return session


def test_neither_password_nor_token_is_stored(database: Database, account: str) -> None:
    token = open_session(database, account)
    database.close()
    content = database.path.read_bytes()
    assert PASSWORD.encode() not in content
    assert token.encode() not in content
    assert b"$argon2id$v=19$m=19456,t=2,p=1$" in content


def test_an_account_is_made_once(database: Database, account: str) -> None:
    assert has_researcher(database, account)
    with pytest.raises(AccountExistsError):
        create_researcher(database, account, PASSWORD, NOW)


@pytest.mark.parametrize("name", ["", " blank", "blank ", "x" * 65, "two\nlines"])
def test_bad_names_are_refused(database: Database, name: str) -> None:
    with pytest.raises(AccountError, match="cannot be a name"):
        create_researcher(database, name, PASSWORD, NOW)


def test_short_passwords_are_refused(database: Database) -> None:
    with pytest.raises(AccountError, match="at least 12 characters, not 11"):
        create_researcher(database, "researcher", "x" * 11, NOW)
    assert not has_researcher(database, "researcher")


def test_only_name_and_password_together_open_a_session(database: Database, account: str) -> None:
    assert sign_in(database, account, "wrong password", NOW) is None
    assert sign_in(database, "nobody", PASSWORD, NOW) is None
    session = session_of(database, open_session(database, account), NOW)
    assert session.name == account
    assert find_session(database, "made up", NOW, active=True) is None


def test_every_sign_in_has_its_own_token(database: Database, account: str) -> None:
    assert open_session(database, account) != open_session(database, account)


def test_a_session_ends_after_half_an_hour_without_activity(database: Database, account: str) -> None:
    token = open_session(database, account)
    later = NOW + timedelta(minutes=29)
    session_of(database, token, later)
    session_of(database, token, later + timedelta(minutes=29))
    assert find_session(database, token, later + timedelta(minutes=60), active=True) is None


def test_polling_does_not_keep_a_session_alive(database: Database, account: str) -> None:
    token = open_session(database, account)
    for minutes in range(29):
        session_of(database, token, NOW + timedelta(minutes=minutes), active=False)
    assert find_session(database, token, NOW + timedelta(minutes=30), active=False) is None


def test_a_session_ends_after_twelve_hours_whatever_happens(database: Database, account: str) -> None:
    token = open_session(database, account)
    for quarters in range(1, 48):
        session_of(database, token, NOW + timedelta(minutes=15 * quarters))
    assert find_session(database, token, NOW + timedelta(hours=12), active=True) is None


def test_signing_out_ends_the_session_on_the_server(database: Database, account: str) -> None:
    token = open_session(database, account)
    sign_out(database, session_of(database, token, NOW), NOW)
    assert find_session(database, token, NOW, active=True) is None


def test_revealing_holds_for_the_session_and_is_logged_with_name_and_time(database: Database, account: str) -> None:
    token, other = open_session(database, account), open_session(database, account)
    when = NOW + timedelta(minutes=5)
    assert session_of(database, token, NOW).revealed_at is None
    reveal_ratings(database, session_of(database, token, NOW), "sakai2021 v1 test", when)
    assert session_of(database, token, when).revealed_at == when
    assert session_of(database, other, when).revealed_at is None
    entry = audit_entries(database)[-1]
    assert (entry.at, entry.researcher, entry.action, entry.detail) == (when, account, "revealed", "sakai2021 v1 test")


def test_guessing_is_slowed_down_more_and_more_and_never_locks_for_good(database: Database, account: str) -> None:
    now, waits = NOW, []
    for _ in range(5):
        assert sign_in(database, account, "wrong", now) is None
    for _ in range(14):
        with pytest.raises(TooManyAttemptsError) as refusal:
            sign_in(database, account, PASSWORD, now)
        waits.append(refusal.value.wait_s)
        now += timedelta(seconds=waits[-1])
        assert sign_in(database, account, "wrong", now) is None
    # One second more than the wait, as it is rounded up.
    assert [wait - 1 for wait in waits] == [1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 900, 900, 900, 900]
    open_session(database, account, now + timedelta(minutes=16))


def test_guessing_is_slowed_down_for_names_without_account_as_well(database: Database) -> None:
    for _ in range(5):
        assert sign_in(database, "nobody", "wrong", NOW) is None
    with pytest.raises(TooManyAttemptsError):
        sign_in(database, "nobody", "wrong", NOW)


def test_the_right_password_starts_the_count_anew(database: Database, account: str) -> None:
    for _ in range(3):
        for _ in range(4):
            assert sign_in(database, account, "wrong", NOW) is None
        open_session(database, account)


def test_the_throttle_outlives_a_restart(database: Database, account: str) -> None:
    for _ in range(5):
        sign_in(database, account, "wrong", NOW)
    database.close()
    again = Database(database.path)
    try:
        with pytest.raises(TooManyAttemptsError):
            sign_in(again, account, PASSWORD, NOW)
    finally:
        again.close()


def test_simultaneous_guesses_are_all_counted(database: Database, account: str) -> None:
    barrier, refused = threading.Barrier(12), []

    def guess() -> None:
        barrier.wait()
        try:
            sign_in(database, account, "wrong", NOW)
        except TooManyAttemptsError:
            refused.append(1)

    threads = [threading.Thread(target=guess) for _ in range(12)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(refused) == 12 - 5


def test_the_log_can_only_grow(database: Database, account: str) -> None:
    open_session(database, account)
    for statement in ("UPDATE audit_log SET researcher = 'someone else'", "DELETE FROM audit_log"):
        with pytest.raises(Exception, match="rows of audit_log"), database.write() as connection:
            connection.exec_driver_sql(statement)
    assert [entry.action for entry in audit_entries(database)] == ["created", "signed_in"]
