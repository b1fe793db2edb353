"""Checks that look into the database, through connections that are set up as the server's are.

What takes long is read from a copy, so that nobody has to wait for it.
"""

import sqlite3
import sys
import time
from collections.abc import Iterator
from contextlib import closing
from datetime import UTC, datetime, timedelta
from pathlib import Path

from sqlalchemy import func, select
from sqlalchemy.exc import DBAPIError

from webapp.stimuli.program import running_program
from webapp.storage.backup_bundles import FOLDER, bundle_problems, published_versions
from webapp.storage.backup_manifests import POSTGRESQL_SUFFIX, SQLITE_SUFFIX, complete_backups, manifest_path
from webapp.storage.database import Database, DatabaseError, journal_mode
from webapp.storage.findings import Finding, worst
from webapp.storage.postgres_dumps import told as told_address
from webapp.storage.revisions import CURRENT, known_revisions
from webapp.storage.snapshot import snapshot
from webapp.storage.tables import participants, records
from webapp.storage.verification import verify_log

PRAGMAS = {"synchronous": 3, "foreign_keys": 1, "trusted_schema": 0, "secure_delete": 1, "mmap_size": 0}
"""What every connection must have in force."""

MAX_BACKUP_AGE = timedelta(days=1)
"""Older backups of live data are warned of."""

_SAFETY = ("fsync", "synchronous_commit", "full_page_writes")
_SETTINGS = ("server_version", *_SAFETY, "data_checksums")
_MAX_DRIFT_S = 0.5
_MAX_AHEAD = timedelta(seconds=2)
_MOST_TOLD = 5
_DATABASE_SUFFIXES = frozenset({SQLITE_SUFFIX, POSTGRESQL_SUFFIX, ".db", ".sqlite"})


def database_findings(path: Path, url: str | None, backups: Path, now: datetime) -> Iterator[Finding]:
    """Check a database, and what its data need beside it.

    Args:
        path: The file of the SQLite edition; its folder is the instance in both editions.
        url: The address of the PostgreSQL edition's database; None for the SQLite edition.
        backups: The folder of its backups.
        now: The time.
    """
    started = time.time() - time.monotonic()
    yield versions(with_sqlite=url is None)
    if url is None and not path.exists():
        yield Finding("database", "warning", f"there is no {path} yet", "`xar serve` or `xar migrate` makes one")
        return
    try:
        with closing(Database(path, url)) as opened:
            yield pragmas(opened) if url is None else server(opened)
            revision = schema(opened)
            yield revision
            damaged = damage(opened) if url is None else []
            yield from damaged
            if revision.status == "ok":
                if all(finding.status == "ok" for finding in damaged):
                    yield from chain(opened)
                yield from clock(opened, now, time.time() - time.monotonic() - started)
                yield from bundles(opened, path.parent)
                yield from backup_age(opened, backups, now)
    except (DatabaseError, DBAPIError) as error:
        told = f"cannot be used: {getattr(error, 'orig', None) or error}"
        wish = "keep it as it is; docs/operations.md says what to do" if url is None else "see docs/operations.md"
        yield Finding("database", "problem", told, wish)
    yield from unvouched(backups)


def versions(*, with_sqlite: bool) -> Finding:
    """Say what runs here, and which journal SQLite's version means. PostgreSQL's stands with its settings."""
    told = f"xar {running_program().version}, Python {'.'.join(map(str, sys.version_info[:3]))}"
    if not with_sqlite:
        return Finding("versions", "ok", told)
    journal = journal_mode(sqlite3.sqlite_version_info)
    means = "write-ahead log" if journal == "wal" else "rollback journal, as this version can lose commits with a log"
    return Finding("versions", "ok", f"{told}, SQLite {sqlite3.sqlite_version}: {means}")


def pragmas(database: Database) -> Finding:
    """Check what is in force on the connections that write and read."""
    wanted = PRAGMAS | {"journal_mode": journal_mode(sqlite3.sqlite_version_info)}
    wrong = []
    for transaction, name in ((database.write, "writing"), (database.read, "reading")):
        with transaction() as connection:
            for pragma, value in wanted.items():
                actual = connection.exec_driver_sql(f"PRAGMA {pragma}").scalar_one()
                if actual != value:
                    wrong.append(f"{pragma} is {actual} and not {value} for {name}")
    if wrong:
        return Finding("pragmas", "problem", "; ".join(wrong), "use the SQLite that Python brings, unchanged")
    told = ", ".join(f"{name}={value}" for name, value in wanted.items())
    return Finding("pragmas", "ok", told)


def server(database: Database) -> Finding:
    """Check what is in force on a connection to PostgreSQL; to connect is refused where answers could be lost."""
    with database.read() as connection:
        values = {name: connection.execute(select(func.current_setting(name))).scalar_one() for name in _SETTINGS}
    wrong = [f"{name} is {values[name]}" for name in _SAFETY if values[name] != "on"]
    told = ", ".join(f"{name}={value}" for name, value in values.items())
    if wrong:
        return Finding("PostgreSQL", "problem", "; ".join(wrong), "set it to on: confirmed answers could be lost")
    if values["data_checksums"] != "on":
        return Finding("PostgreSQL", "warning", told, "damage of the disk stays unseen; see pg_checksums --enable")
    return Finding("PostgreSQL", "ok", told)


def schema(database: Database) -> Finding:
    """Check that the tables are this program's."""
    newest, revision = CURRENT, database.revision()
    if revision == newest:
        return Finding("schema", "ok", f"revision {revision}")
    if revision is not None and revision not in known_revisions():
        return Finding("schema", "problem", f"revision {revision} is of a later xar", "install that version of xar")
    return Finding("schema", "problem", f"revision {revision}, and this is xar for {newest}", "run `xar migrate`")


def damage(database: Database) -> list[Finding]:
    """Let SQLite look for damage, in a copy."""
    try:
        with snapshot(database) as connection:
            lines = [line for (line,) in connection.exec_driver_sql("PRAGMA integrity_check") if line != "ok"]
            if not lines:
                dangling = connection.exec_driver_sql("PRAGMA foreign_key_check")
                lines = [f"a row of {table} refers to nothing" for table, *_ in dangling]
    except DBAPIError as error:  # It is too damaged to be checked.
        lines = [str(error.orig)]
    wish = "stop the server, keep the file, and restore the newest backup that `xar restore --verify` accepts"
    found = [Finding("integrity", "problem", line, wish) for line in lines[:_MOST_TOLD]]
    return worst("integrity", found, "no damage; every row's references are there")


def chain(database: Database) -> list[Finding]:
    """Check the chain of records and every row that it vouches for."""
    verified = verify_log(database)
    wish = "`xar verify-log` tells all; compare with a backup, and say so in the paper"
    found = [Finding("record chain", "problem", problem, wish) for problem in verified.problems[:_MOST_TOLD]]
    told = f"{verified.head.number} records, all as recorded; head {verified.head.hash[:12]}"
    return worst("record chain", found, told)


def clock(database: Database, now: datetime, drift_s: float = 0.0) -> list[Finding]:
    """Check that the clock is not behind what was recorded, and does not jump.

    Args:
        database: With records.
        now: The time.
        drift_s: By how much the clock went otherwise than time passed, while the checks ran.
    """
    with database.read() as connection:
        last = connection.execute(select(records.c.at).order_by(records.c.at.desc()).limit(1)).scalar_one_or_none()
    found = []
    if last is not None and last > now + _MAX_AHEAD:
        told = f"the clock shows {now:%Y-%m-%d %H:%M:%S} UTC, and a record is of {last:%Y-%m-%d %H:%M:%S}"
        found.append(Finding("clock", "problem", told, "set the clock by a time server (NTP)"))
    if abs(drift_s) > _MAX_DRIFT_S:
        told = f"the clock was set by {drift_s:+.1f} s during this check"
        found.append(Finding("clock", "warning", told, "let a time server (NTP) keep it, in small steps"))
    return worst("clock", found, f"{now.astimezone(UTC):%Y-%m-%d %H:%M:%S} UTC, after the last record")


def bundles(database: Database, instance: Path) -> list[Finding]:
    """Check that the versions that people saw, and those that are published, are there unchanged."""
    with database.read() as connection:
        query = select(participants.c.study_version, participants.c.mode).distinct()
        seen = {(row.study_version, row.mode) for row in connection.execute(query)}
    needed = {version for version, mode in seen if mode == "live"} | set(published_versions(instance).values())
    others = {version for version, _ in seen} - needed
    folder = instance / FOLDER
    wish = "bring it back from the backups' folder `bundles`: people who saw it cannot go on without"
    found = [Finding("bundles", "problem", problem, wish) for problem in bundle_problems(folder, sorted(needed))]
    found += [
        Finding("bundles", "warning", problem, "only tests and bots saw it")
        for problem in bundle_problems(folder, sorted(others))
    ]
    return worst("bundles", found, f"in use: {len(needed | others)}, unchanged")


def backup_age(database: Database, backups: Path, now: datetime) -> list[Finding]:
    """Check that there is a young backup, if there are live data."""
    with database.read() as connection:
        query = select(participants.c.id).where(participants.c.mode == "live").limit(1)
        has_live = connection.execute(query).scalar_one_or_none() is not None
    kept = list(complete_backups(backups, name_of(database)))
    if not kept:
        if not has_live:
            return [Finding("backups", "ok", "none, and no live data")]
        told = f"there are live data and no backup in {backups}"
        return [Finding("backups", "problem", told, "run `xar backup`, and every few hours during a study")]
    age = now - kept[-1][1].made_at
    told = f"{len(kept)} in {backups}, the newest {_duration(age)} old"
    if has_live and age > MAX_BACKUP_AGE:
        return [Finding("backups", "warning", told, "run `xar backup`, and every few hours during a study")]
    return [Finding("backups", "ok", told)]


def unvouched(backups: Path) -> Iterator[Finding]:
    """Yield the databases in the folder of backups that no manifest stands for."""
    for path in sorted(backups.glob("*")):
        is_database = path.suffix in _DATABASE_SUFFIXES and path.is_file()
        if is_database and not manifest_path(path).exists():
            told = f"{path} has no manifest: it was copied or cut off, and may be torn"
            yield Finding("backups", "problem", told, "use `xar backup` for backups, and remove it")


def _duration(age: timedelta) -> str:
    hours = int(age.total_seconds() // 3600)
    return f"{hours // 24} days" if hours >= 48 else f"{hours} h" if hours else f"{int(age.total_seconds() // 60)} min"  # noqa: PLR2004


def name_of(database: Database) -> str:
    """Return how manifests name a database."""
    return str(database.path.absolute()) if database.url is None else told_address(database.url)
