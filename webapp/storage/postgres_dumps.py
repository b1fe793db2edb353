"""Backups of a PostgreSQL database: `pg_dump`, of the very state whose rows and head the manifest names.

The programs of PostgreSQL get the password in their environment, never on their command line, which others can see.
"""

import os
import secrets
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from datetime import datetime
from pathlib import Path

from sqlalchemy import URL, Connection, create_engine, func, inspect, make_url, select, table, text
from sqlalchemy.exc import SQLAlchemyError

from webapp.storage.backup_bundles import FOLDER, copy_bundles, publish_again
from webapp.storage.backup_manifests import (
    KEY_SUFFIX,
    POSTGRESQL_SUFFIX,
    BackupError,
    Manifest,
    digest,
    read_manifest,
)
from webapp.storage.backups import Contents, complete, new_draft
from webapp.storage.database import Database
from webapp.storage.instance import only_server, prepare_instance
from webapp.storage.records import FIRST_HASH, Head
from webapp.storage.restoring import Restored, bring_key, chain_problems, differences
from webapp.storage.revisions import known_revisions

_DRIVER = "postgresql+psycopg"
_RESTORE = ("pg_restore", "--exit-on-error", "--single-transaction", "--no-owner", "--no-privileges")


def dump(database: Database, folder: Path, now: datetime, *, with_secret_key: bool = False) -> tuple[Path, Manifest]:
    """Dump a database, and copy the bundles that its data refer to, into a folder; nobody has to wait.

    Args:
        database: Of the PostgreSQL edition.
        folder: Where the backup goes; made if it is not there.
        now: The time, which names the backup.
        with_secret_key: Whether to copy the instance's secret key too.

    Raises:
        BackupError: No backup can be made.
    """
    address = _address(database.url)
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        with new_draft(folder) as draft:
            with database.edition.reading(is_long=True) as connection:
                state = connection.execute(text("SELECT pg_export_snapshot()")).scalar_one()
                found = _contents(connection)
                options = ("--format=custom", f"--snapshot={state}", "--no-owner", "--no-privileges", f"--file={draft}")
                _run(address, "pg_dump", *options)
            _run(address, "pg_restore", "--list", str(draft), is_connected=False)
            with draft.open("rb") as file:
                os.fsync(file.fileno())
            return complete(
                draft,
                found,
                now,
                database=told(database.url),
                instance=database.path.parent,
                suffix=POSTGRESQL_SUFFIX,
                with_secret_key=with_secret_key,
            )
    except OSError as error:
        raise BackupError(f"the folder {folder} cannot hold a backup: {error.strerror}") from error


def verify_dump(backup: Path, url: str) -> tuple[Manifest | None, list[str]]:
    """Check a dump in a database that is made for it and dropped again, on the server of an address.

    Args:
        backup: The file.
        url: The address; its user must be allowed to make databases.

    Returns:
        Its manifest if there is one, and a line for each thing that is wrong.
    """
    if not backup.is_file():
        raise BackupError(f"there is no backup {backup}")
    try:
        manifest = read_manifest(backup)
    except BackupError as error:
        return None, [str(error)]
    found = digest(backup)
    if found != manifest.sha256:
        told_so = f"{backup} is not the file that was backed up: its digest is {found}, not {manifest.sha256}"
        return manifest, [told_so]
    with _scratch(_address(url)) as scratch:
        try:
            _run(scratch, *_RESTORE, f"--dbname={_shown(scratch)}", str(backup), is_connected=False)
        except BackupError as error:
            return manifest, [str(error)]
        return manifest, list(_problems(backup, scratch, manifest))


def restore_dump(backup: Path, path: Path, url: str) -> Restored:
    """Take a dump into use in a database that holds no data, if nothing is wrong with it.

    Args:
        backup: The file.
        path: As for `Database`; its folder is the instance.
        url: The address of the database.

    Raises:
        BackupError: The backup is not as it should be, or the database holds data.
        webapp.storage.instance.InstanceError: A server runs on the instance.
    """
    instance, address = path.parent, _address(url)
    prepare_instance(instance)
    with only_server(instance):
        if _holds_data(address):
            wish = "make an empty one and name it in DATABASE_URL; the one there stays as it is"
            raise BackupError(f"the database {told(url)} holds data; {wish}")
        manifest, problems = verify_dump(backup, url)
        if manifest is None or problems:
            raise BackupError(f"{backup} was not restored: {problems[0]}; `xar restore {backup} --verify` tells all")
        copy_bundles(backup.parent / FOLDER, instance / FOLDER, manifest.bundles)
        publish_again(instance, manifest.published)
        options = ("--clean", "--if-exists", f"--dbname={_shown(address)}", str(backup))
        _run(address, *_RESTORE, *options, is_connected=False)
        with closing(Database(path, url)) as database:
            database.upgrade()
        has_key, is_same_key = bring_key(backup.with_suffix(KEY_SUFFIX), instance / "secret_key")
    return Restored(manifest, None, has_key, is_same_key)


def told(url: str | None) -> str:
    """Return how a manifest names a database: its address without user and password."""
    address = _address(url)
    host = address.host or address.query.get("host", "this machine")
    return f"postgresql://{host}:{address.port or 5432}/{address.database}"


def _problems(backup: Path, scratch: URL, manifest: Manifest) -> Iterator[str]:
    with _connected(scratch) as connection:
        found = _contents(connection)
    yield from differences(backup, found, manifest)
    if found.revision is None or found.revision in known_revisions():
        yield from chain_problems(lambda: Database(backup, scratch.render_as_string(hide_password=False)))


def _contents(connection: Connection) -> Contents:
    tables = sorted(inspect(connection).get_table_names())
    num_rows = {name: connection.execute(select(func.count()).select_from(table(name))).scalar_one() for name in tables}
    revision, last, versions = None, None, []
    if "alembic_version" in num_rows:
        revision = connection.execute(text("SELECT version_num FROM alembic_version")).scalar_one_or_none()
    if "records" in num_rows:
        query = text("SELECT number, hash FROM records ORDER BY number DESC LIMIT 1")
        last = connection.execute(query).one_or_none()
    if "participants" in num_rows:
        versions = list(connection.execute(text("SELECT DISTINCT study_version FROM participants")).scalars())
    head = Head(0, FIRST_HASH) if last is None else Head(last.number, last.hash)
    return Contents(revision, head, num_rows, tuple(sorted(versions)))


def _holds_data(address: URL) -> bool:
    with _connected(address) as connection:
        found = _contents(connection).num_rows
    return any(number for name, number in found.items() if name != "alembic_version")


@contextmanager
def _connected(address: URL) -> Iterator[Connection]:
    engine = create_engine(address, hide_parameters=True, isolation_level="AUTOCOMMIT")
    try:
        with engine.connect() as connection:
            yield connection
    except SQLAlchemyError as error:
        reason = str(getattr(error, "orig", None) or error).strip().splitlines()[0]
        raise BackupError(f"the database {told(_shown(address))} cannot be used: {reason}") from error
    finally:
        engine.dispose()


@contextmanager
def _scratch(address: URL) -> Iterator[URL]:
    """Make an empty database beside the one of an address, for as long as the context lasts."""
    name = f"xar_check_{secrets.token_hex(6)}"
    with _connected(address) as connection:
        connection.execute(text(f"CREATE DATABASE {name} TEMPLATE template0 ENCODING 'UTF8'"))
    try:
        yield address.set(database=name)
    finally:
        with _connected(address) as connection:
            connection.execute(text(f"DROP DATABASE {name} WITH (FORCE)"))


def _run(address: URL, program: str, *arguments: str, is_connected: bool = True) -> None:
    """Run a program of PostgreSQL's.

    Raises:
        BackupError: It is not there, or failed.
    """
    where = (f"--dbname={_shown(address)}",) if is_connected else ()
    try:
        done = subprocess.run(  # noqa: S603 - a fixed program; no shell.
            [program, "--no-password", *where, *arguments] if program == "pg_dump" else [program, *arguments],
            env=_environment(address),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            check=False,
        )
    except FileNotFoundError:
        raise BackupError(f"{program} was not found; install PostgreSQL's client programs") from None
    if done.returncode:
        lines = [line for line in done.stderr.splitlines() if line.strip()] or ["it gives no reason"]
        raise BackupError(f"{program} failed: {lines[0]}")


def _environment(address: URL) -> Mapping[str, str]:
    password = {} if address.password is None else {"PGPASSWORD": str(address.password)}
    return os.environ | password | {"LC_ALL": "C"}


def _shown(address: URL) -> str:
    """Return the address as PostgreSQL's programs take it, without the password."""
    # `set` would leave a password as it is when told None.
    shown = URL.create(
        "postgresql", address.username, None, address.host, address.port, address.database, address.query
    )
    return shown.render_as_string()


def _address(url: str | None) -> URL:
    if url is None:
        raise BackupError("a dump needs PostgreSQL; set DATABASE_URL to the address of a database")
    return make_url(url).set(drivername=_DRIVER)
