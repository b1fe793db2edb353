import threading
from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import update

from tests.outside import on_disk
from webapp.storage.accounts import (
    AccountError,
    AccountExistsError,
    accounts,
    change_role,
    create_researcher,
    disable,
    has_researcher,
    open_sessions,
    revoke_sessions,
)
from webapp.storage.database import Database
from webapp.storage.records import ACTORS, COMMAND_LINE, told_by
from webapp.storage.researchers import (
    ROLES,
    ResearcherSession,
    Role,
    TooManyAttemptsError,
    find_session,
    knows_password,
    sign_in,
    sign_out,
)
from webapp.storage.tables import researchers

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
    content = on_disk(database)
    assert PASSWORD.encode() not in content
    assert token.encode() not in content
    assert b"$argon2id$v=19$m=19456,t=2,p=1$" in content


def test_an_account_is_made_once(database: Database, account: str) -> None:
    assert has_researcher(database, account)
    with pytest.raises(AccountExistsError):
        create_researcher(database, account, PASSWORD, NOW)


@pytest.mark.parametrize("name", ["", " blank", "blank ", "x" * 65, "two\nlines", "a/b", "..", *sorted(ACTORS)])
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


@pytest.mark.parametrize("role", ROLES)
def test_a_role_may_do_what_the_lower_ones_may(database: Database, role: Role) -> None:
    create_researcher(database, "somebody", PASSWORD, NOW, role)
    session = session_of(database, open_session(database, "somebody"), NOW)
    assert session.role == role
    assert [known for known in ROLES if session.may(known)] == list(ROLES[: ROLES.index(role) + 1])


def test_another_role_counts_at_once_and_is_recorded(database: Database, account: str) -> None:
    token = open_session(database, account)
    change_role(database, account, "viewer", "boss", NOW)
    assert not session_of(database, token, NOW).may("owner")
    with database.read() as connection:
        (recorded,) = told_by(connection, "role_changed")
    assert (recorded[2], recorded[-1]) == ("boss", {"account": account, "role": "viewer"})


def test_a_closed_account_is_signed_out_and_lets_nobody_in(database: Database, account: str) -> None:
    token = open_session(database, account)
    disable(database, account, "boss", NOW)
    assert find_session(database, token, NOW, active=True) is None
    assert sign_in(database, account, PASSWORD, NOW) is None
    (closed,) = accounts(database, NOW)
    assert (closed.disabled_at, closed.num_sessions) == (NOW, 0)


def test_an_account_that_is_closed_while_somebody_signs_in_lets_nobody_in(database: Database, account: str) -> None:
    token = open_session(database, account)
    with database.write() as connection:
        connection.execute(update(researchers).values(disabled_at=NOW))
    assert find_session(database, token, NOW, active=True) is None


def test_one_session_or_all_can_be_ended_from_outside(database: Database, account: str) -> None:
    tokens = [open_session(database, account, NOW + timedelta(minutes=minute)) for minute in range(3)]
    now = NOW + timedelta(minutes=3)
    latest, *others = open_sessions(database, now, account)
    assert latest.created_at == NOW + timedelta(minutes=2)
    assert revoke_sessions(database, account, "boss", now, latest.id) == 1
    assert [find_session(database, token, now, active=True) is None for token in tokens] == [False, False, True]
    assert revoke_sessions(database, account, "boss", now) == len(others)
    assert open_sessions(database, now) == ()


def test_an_account_that_is_not_there_is_named_with_those_that_are(database: Database, account: str) -> None:
    for change in (
        lambda: change_role(database, "nobody", "viewer", "boss", NOW),
        lambda: disable(database, "nobody", "boss", NOW),
        lambda: revoke_sessions(database, "nobody", "boss", NOW),
    ):
        with pytest.raises(AccountError, match=f"no account 'nobody'; there are {account}"):
            change()


def test_the_password_is_asked_again_and_guesses_count(database: Database, account: str) -> None:
    session = session_of(database, open_session(database, account), NOW)
    for _ in range(4):
        assert not knows_password(database, session, "wrong", NOW)
    assert knows_password(database, session, PASSWORD, NOW)
    for _ in range(5):
        assert not knows_password(database, session, "wrong", NOW)
    with pytest.raises(TooManyAttemptsError):
        knows_password(database, session, PASSWORD, NOW)


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
    again = Database(database.path, database.url)
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


def test_what_accounts_did_is_recorded_in_order(database: Database, account: str) -> None:
    token = open_session(database, account)
    sign_out(database, session_of(database, token, NOW), NOW)
    with database.read() as connection:
        told = [
            (actor, action) for _, _, actor, action, *_ in told_by(connection, "created", "signed_in", "signed_out")
        ]
    assert told == [(COMMAND_LINE, "created"), (account, "signed_in"), (account, "signed_out")]
