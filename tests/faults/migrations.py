"""Killed in mid-migration (F17): the tables are the old ones or the new ones, never between, and no row is lost.

    python -m tests.faults.migrations [--full]

`xar migrate` runs in a process that kills itself before one of its statements, from every earlier revision with data in
its tables. The control commits after each statement, and must be found between.
"""

import argparse
import signal
import sqlite3
import sys
import tempfile
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from alembic import command
from alembic.config import Config as AlembicConfig

from tests.faults.killed_migration import migrate_counting
from tests.faults.oracle import evidence
from tests.unit.storage.people import NOW
from tests.unit.storage.test_migrations import PEOPLE
from webapp.storage.database import Database
from webapp.storage.migrating import migrate
from webapp.storage.restoring import verify
from webapp.storage.revisions import known_revisions
from webapp.storage.verification import verify_log

PLACES = Path(__file__).parents[2] / "webapp" / "storage" / "migrations"
NEWEST, *EARLIER = known_revisions()
NEVER = 10**9


@dataclass(frozen=True, slots=True)
class State:
    """What a database file holds.

    Attributes:
        schema: The statements that make its tables, indexes and triggers.
        columns: Of each table.
        rows: Of each table, in order.
    """

    schema: tuple[str, ...]
    columns: dict[str, tuple[str, ...]]
    rows: dict[str, tuple[tuple[Any, ...], ...]]

    def shared_rows(self, other: "State") -> dict[str, list[tuple[Any, ...]]]:
        """Return the rows as far as both have the columns, without the revision."""
        found = {}
        for table in sorted(self.columns.keys() & other.columns.keys() - {"alembic_version"}):
            places = [place for place, name in enumerate(self.columns[table]) if name in other.columns[table]]
            names = [self.columns[table][place] for place in places]
            order = sorted(range(len(names)), key=names.__getitem__)
            found[table] = sorted((tuple(row[places[i]] for i in order) for row in self.rows[table]), key=repr)
        return found


def make_at(path: Path, revision: str, people: str) -> None:
    """Make a database of an earlier revision, with rows that the first version stored.

    Args:
        path: The file.
        revision: Of its tables.
        people: Statements that store rows in the tables of revision 0001.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with closing(Database(path)) as database, database.write() as connection:
        config = AlembicConfig()
        config.set_main_option("script_location", str(PLACES))
        config.attributes["connection"] = connection
        command.upgrade(config, "0001")
        for statement in people.strip().split(";\n"):
            connection.exec_driver_sql(statement)
        command.upgrade(config, revision)


def state(path: Path) -> State:
    """Read a database file, as whoever opens it next finds it."""
    with closing(sqlite3.connect(path)) as connection:
        (intact,) = connection.execute("PRAGMA integrity_check").fetchone()
        assert intact == "ok"
        query = "SELECT sql FROM sqlite_schema WHERE sql IS NOT NULL ORDER BY name"
        schema = tuple(sql for (sql,) in connection.execute(query))
        tables = [name for (name,) in connection.execute("SELECT name FROM sqlite_schema WHERE type = 'table'")]
        columns = {name: tuple(row[1] for row in connection.execute(f"PRAGMA table_info({name})")) for name in tables}
        rows = {name: tuple(connection.execute(f"SELECT * FROM {name}")) for name in tables}  # noqa: S608
    return State(schema, columns, rows)


def migrate_and_be_killed(path: Path, kept: Path, before: int, *, is_naive: bool = False) -> int:
    """Migrate in a process that kills itself.

    Args:
        path: The database file.
        kept: Where the backup goes.
        before: Before which statement of the migration, from 0; their number for the moment after the last; `NEVER` to
            let it end.
        is_naive: Whether to commit after every statement.

    Returns:
        How many statements were executed or begun.
    """
    context = get_context("forkserver")
    context.set_forkserver_preload(["tests.faults.killed_migration"])
    count = context.Value("i", 0)
    child = context.Process(target=migrate_counting, args=(path, kept, before, is_naive, count))
    child.start()
    child.join()
    assert child.exitcode == (0 if before == NEVER else -signal.SIGKILL), child.exitcode
    return int(count.value)


def outcome(old: State, new: State, found: State) -> str:
    """Say which of the two a database is, `between` if neither, or `changed` if its rows are not the same."""
    if found == old:
        return "old"
    if found.schema != new.schema or found.rows["alembic_version"] != new.rows["alembic_version"]:
        return "between"
    return "new" if found.shared_rows(old) == new.shared_rows(old) else "changed"


def points(num_statements: int, num_points: int) -> Sequence[int]:
    """Return statements to be killed before, evenly spread, from the first one to the moment after the last."""
    wanted = min(num_points, num_statements + 1)
    return sorted({round(place * num_statements / (wanted - 1)) for place in range(wanted)})


def run(folder: Path, revision: str, people: str, num_points: int, *, is_naive: bool = False) -> list[str]:
    """Kill a migration at several points and return what was found each time.

    Args:
        folder: To work in; it does not exist yet.
        revision: Of the database that is migrated.
        people: As for `make_at`.
        num_points: How many.
        is_naive: Whether to commit after every statement.
    """
    source, done = folder / "source" / "xar.sqlite3", folder / "done" / "xar.sqlite3"
    make_at(source, revision, people)
    old = state(source)
    done.parent.mkdir()
    done.write_bytes(source.read_bytes())
    num_statements = migrate_and_be_killed(done, folder / "kept", NEVER)
    new, found = state(done), []
    for point in points(num_statements, num_points):
        path = folder / str(point) / "xar.sqlite3"
        path.parent.mkdir()
        path.write_bytes(source.read_bytes())
        migrate_and_be_killed(path, path.parent / "kept", point, is_naive=is_naive)
        found.append(outcome(old, new, state(path)))
        if is_naive:
            continue
        for backup in (path.parent / "kept").glob("*.sqlite3"):
            assert state(backup) == old, "the backup is what was there before"
            assert verify(backup, path.parent / "check")[1] == []
        migrate(path, None, NOW)
        assert outcome(old, new, state(path)) == "new", "what was cut short can be done again"
        with closing(Database(path)) as database:
            assert verify_log(database).problems == ()
    return found


def main() -> int:
    """Run all points and say what came of them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--full", action="store_true", help="before every statement, not at 20 points")
    num_points = NEVER if parser.parse_args().full else 20
    is_well = True
    with tempfile.TemporaryDirectory() as folder:
        for revision in EARLIER:
            found = run(Path(folder) / revision, revision, PEOPLE, num_points)
            naive = run(Path(folder) / f"{revision}-naive", revision, PEOPLE, 20, is_naive=True)
            counts = {name: found.count(name) for name in ("old", "new", "between", "changed")}
            control = {"killed": len(naive), "between": naive.count("between")}
            told = f"migration from {revision} to {NEWEST}, killed half-way"
            print(evidence(told, {"killed": len(found), **counts}, control=control))
            is_well &= set(found) <= {"old", "new"} and "between" in naive
    return 0 if is_well else 1


if __name__ == "__main__":
    sys.exit(main())
