"""What only PostgreSQL can do wrong: settings that lose answers, connections that go, several processes."""

import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, suppress
from pathlib import Path

import pytest
from sqlalchemy import func, insert, select, text
from sqlalchemy.exc import DBAPIError

from tests import postgres
from tests.unit.storage.people import NOW, at_once, enrol_somebody
from webapp.storage.database import Database, DatabaseError, UnavailableError, UnreachableError
from webapp.storage.postgres_edition import PostgresEdition
from webapp.storage.records import Entry, append, told_by
from webapp.storage.snapshot import snapshot
from webapp.storage.tables import participants, records, sign_in_attempts
from webapp.storage.verification import verify_log

HERE = Path("unused")


def attempt(name: str) -> dict[str, object]:
    return {"name_hash": name, "num_failures": 1, "last_attempt_at": NOW}


@pytest.fixture
def name(postgres_server: postgres.Server) -> Iterator[str]:
    made = postgres_server.make()
    yield made
    postgres_server.drop(made)


@pytest.fixture
def url(postgres_server: postgres.Server, name: str) -> str:
    return postgres_server.url(name)


@pytest.fixture
def database(url: str) -> Iterator[Database]:
    with closing(Database(HERE, url)) as opened:
        yield opened


@pytest.mark.parametrize(
    ("address", "wish"),
    [
        ("mysql://someone:geheim@host/x", "begins with 'mysql'"),
        ("no address, geheim", "is no address"),
        ("postgresql://someone:geheim@host:port/x", "is no address"),
    ],
)
def test_other_addresses_are_refused_without_repeating_the_password(address: str, wish: str) -> None:
    with pytest.raises(DatabaseError, match=wish) as refused:
        PostgresEdition(address)
    assert "geheim" not in str(refused.value)


def test_a_server_that_is_not_there_is_told_from_one_that_is_unfit(tmp_path: Path) -> None:
    with pytest.raises(UnreachableError, match="cannot be used") as refused:
        Database(HERE, f"postgres://someone:geheim@/x?host={tmp_path}")
    assert "geheim" not in str(refused.value)


def test_a_database_in_another_encoding_is_refused(postgres_server: postgres.Server) -> None:
    with closing(postgres_server.connect()) as connection:
        connection.execute("CREATE DATABASE latin TEMPLATE template0 ENCODING 'LATIN1' LOCALE 'C'")
    with pytest.raises(DatabaseError, match="ENCODING 'UTF8'"):
        Database(HERE, postgres_server.url("latin"))
    postgres_server.drop("latin")


def test_what_the_server_says_of_commits_is_overruled(postgres_server: postgres.Server, name: str) -> None:
    with closing(postgres_server.connect()) as connection:
        connection.execute(f"ALTER DATABASE {name} SET synchronous_commit = off")
    with closing(postgres_server.connect(name)) as plain:
        assert plain.execute("SHOW synchronous_commit").fetchone() == ("off",)
    with closing(Database(HERE, postgres_server.url(name))) as database, database.write() as connection_of_ours:
        assert connection_of_ours.execute(text("SHOW synchronous_commit")).scalar_one() == "on"


@pytest.mark.parametrize("setting", ["fsync", "full_page_writes"])
def test_a_server_that_may_lose_what_it_confirmed_is_refused(
    postgres_server: postgres.Server, url: str, setting: str
) -> None:
    def settle(value: str) -> None:
        with closing(postgres_server.connect()) as connection:
            connection.execute(f"ALTER SYSTEM {value}")
            connection.execute("SELECT pg_reload_conf()")
            connection.execute("SELECT pg_sleep(0.3)")

    settle(f"SET {setting} = off")
    try:
        with pytest.raises(DatabaseError, match=f"{setting} = off; set it to on"):
            Database(HERE, url)
    finally:
        settle(f"RESET {setting}")
    Database(HERE, url).close()


def test_a_connection_that_is_lost_stores_nothing_and_the_next_try_does(database: Database) -> None:
    def store(*, loses: bool) -> None:
        with database.write() as connection:
            connection.execute(insert(sign_in_attempts).values(attempt("x")))
            if loses:
                connection.execute(text("SELECT pg_terminate_backend(pg_backend_pid())"))

    with pytest.raises(UnavailableError):
        store(loses=True)
    with database.read() as connection:
        assert connection.execute(select(sign_in_attempts.c.name_hash)).all() == []
    store(loses=False)
    with database.read() as connection:
        assert connection.execute(select(sign_in_attempts.c.name_hash)).scalar_one() == "x"


def test_a_server_that_stopped_at_once_kept_what_was_confirmed_and_is_found_again(
    postgres_server: postgres.Server, database: Database
) -> None:
    person = enrol_somebody(database)
    postgres_server.stop("immediate")
    try:
        with pytest.raises(UnavailableError):
            enrol_somebody(database)
        with pytest.raises(UnavailableError):
            database.check_writable()
    finally:
        postgres_server.start()
    enrol_somebody(database)
    database.check_writable()
    with database.read() as connection:
        codes = connection.execute(select(participants.c.code).order_by(participants.c.id)).scalars().all()
    assert (len(codes), codes[0]) == (2, person.code)
    assert verify_log(database).problems == ()


def test_several_programs_write_one_chain(url: str) -> None:
    with closing(Database(HERE, url)) as first, closing(Database(HERE, url)) as second:
        at_once(12, lambda number: enrol_somebody((first, second)[number % 2]))
        assert verify_log(first).problems == ()


@pytest.mark.parametrize("takes_turns", [True, False])
def test_writers_of_two_programs_see_what_the_other_wrote_and_without_the_lock_they_would_not(
    url: str, *, takes_turns: bool
) -> None:
    barrier = threading.Barrier(2)

    def count_up(number: int) -> int:
        edition = editions[number]
        with edition.writing() if takes_turns else edition._engine.begin() as connection:
            found = connection.execute(select(func.count()).select_from(sign_in_attempts)).scalar_one()
            if not takes_turns:
                barrier.wait(10)
            connection.execute(insert(sign_in_attempts).values(attempt(str(number))))
        return found

    with closing(PostgresEdition(url)) as first, closing(PostgresEdition(url)) as second:
        editions = (first, second)
        assert sorted(at_once(2, count_up)) == ([0, 1] if takes_turns else [0, 0])


def test_text_is_ordered_letter_by_letter(database: Database) -> None:
    with database.write() as connection:
        for letter in ("b", "B", "a", "ä", "_"):
            connection.execute(insert(sign_in_attempts).values(attempt(letter)))
    with database.read() as connection:
        query = select(sign_in_attempts.c.name_hash).order_by(sign_in_attempts.c.name_hash)
        assert connection.execute(query).scalars().all() == ["B", "_", "a", "b", "ä"]
        collations = text(
            "SELECT count(*) FROM information_schema.columns WHERE table_schema = 'public' "
            "AND data_type IN ('text', 'character varying') AND collation_name IS DISTINCT FROM 'C'"
        )
        assert connection.execute(collations).scalar_one() == 0


def test_a_long_look_sees_one_state_and_holds_up_nobody(database: Database) -> None:
    enrol_somebody(database)
    with snapshot(database) as connection:
        before = len(connection.execute(select(participants.c.id)).all())
        enrol_somebody(database)
        assert len(connection.execute(select(participants.c.id)).all()) == before == 1
        assert connection.execute(text("SHOW statement_timeout")).scalar_one() == "0"
    with database.read() as connection:
        assert len(connection.execute(select(participants.c.id)).all()) == 2


def test_tables_cannot_be_emptied_past_the_triggers(database: Database) -> None:
    with pytest.raises(Exception, match="rows of records stay"), database.write() as connection:
        connection.execute(text("TRUNCATE records CASCADE"))


@pytest.mark.parametrize("owns_all", [True, False])
def test_traces_are_gone_only_if_no_table_was_passed_over(
    postgres_server: postgres.Server, name: str, *, owns_all: bool
) -> None:
    with closing(postgres_server.connect(name)) as connection:
        connection.execute("CREATE ROLE somebody LOGIN")
        tables = connection.execute("SELECT tablename FROM pg_tables WHERE schemaname = 'public'").fetchall()
        for (table,) in tables if owns_all else tables[1:]:
            connection.execute(f'ALTER TABLE "{table}" OWNER TO somebody')
    try:
        url = postgres_server.url(name).replace("xar@", "somebody@")
        with closing(Database(HERE, url)) as theirs:
            assert theirs.forget(tries=1) == owns_all
    finally:
        with closing(postgres_server.connect(name)) as connection:
            connection.execute("REASSIGN OWNED BY somebody TO xar")
            connection.execute("DROP OWNED BY somebody")
            connection.execute("DROP ROLE somebody")


def test_the_server_of_the_tests_ends_with_the_tests_even_if_these_are_killed(root: Path) -> None:
    code = (
        "import time\nfrom tests import postgres\n"
        "with postgres.a_server() as server:\n    print(server.folder, flush=True)\n    time.sleep(60)\n"
    )
    with subprocess.Popen([sys.executable, "-c", code], cwd=root, stdout=subprocess.PIPE, text=True) as tests:
        assert tests.stdout is not None
        folder = Path(tests.stdout.readline().strip())
        number = int((folder / "data" / "postmaster.pid").read_text(encoding="utf-8").splitlines()[0])
        os.kill(number, 0)
        tests.kill()
    until = time.monotonic() + 20
    while folder.exists() and time.monotonic() < until:
        time.sleep(0.05)
    assert not folder.exists()
    with pytest.raises(ProcessLookupError):
        os.kill(number, 0)


def test_servers_that_start_at_once_make_the_tables_once(postgres_server: postgres.Server) -> None:
    name = postgres_server.make(template="template0")
    programs = [Database(HERE, postgres_server.url(name)) for _ in range(4)]
    at_once(4, lambda number: programs[number].prepare())
    for program in programs:
        program.check_version()
        program.close()
    postgres_server.drop(name)


def noted(name: str) -> Entry:
    return Entry(NOW, "researcher", "noted", content={"name": name})


def num_records(database: Database) -> int:
    with database.read() as connection:
        return connection.execute(select(func.count()).select_from(records)).scalar_one()


def note_and_pass_over_an_error(database: Database, name: str) -> None:
    with database.write() as connection:
        append(connection, noted(name))
        with suppress(DBAPIError):
            connection.execute(text("SELECT 1/0"))


def test_nobody_is_told_that_something_is_stored_after_an_error_that_was_passed_over(database: Database) -> None:
    """PostgreSQL answers the wish to commit with an undoing, and does not call that an error."""
    with pytest.raises(UnavailableError):
        note_and_pass_over_an_error(database, "lost")
    assert num_records(database) == 0
    with database.write() as connection:
        append(connection, noted("kept"))
    assert num_records(database) == 1


def test_whoever_leaves_rows_unread_and_fails_costs_the_others_of_the_group_nothing(database: Database) -> None:
    """Going back to before takes their cursor away, and closing it afterwards would be an error that ends all."""
    with database.write() as connection:
        for number in range(5):
            append(connection, noted(f"before {number}"))
    has_turn = threading.Event()

    def first() -> None:
        with database.write() as connection:
            append(connection, noted("first"))
            has_turn.set()
            while not database._turns._waiting:
                time.sleep(0.001)

    def second() -> None:
        assert has_turn.wait(10)
        with database.write() as connection:
            next(told_by(connection, "noted"))
            connection.execute(text("SELECT 1/0"))

    with ThreadPoolExecutor(2) as pool:
        futures = [pool.submit(action) for action in (first, second)]
    assert futures[0].exception() is None
    assert isinstance(futures[1].exception(), DBAPIError)
    assert num_records(database) == 6
