import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests import postgres
from tests.unit.storage.exported import LATER, files_of, take_part, wanted_of
from tests.unit.storage.people import NOW, enrol_somebody, walk
from webapp.storage.backups import back_up
from webapp.storage.database import Database, open_database
from webapp.storage.dataset import export


@pytest.fixture(scope="session")
def empty_database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A database file with all tables and no rows, to copy."""
    path = tmp_path_factory.mktemp("empty") / "xar.sqlite3"
    with open_database(path):
        return path


@pytest.fixture
def database(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Database]:
    """A database with all tables and no rows: a file, or one of PostgreSQL's where all tests are to use these."""
    if postgres.IS_WANTED and request.node.get_closest_marker("sqlite_only") is None:
        server = request.getfixturevalue("postgres_server")
        name = server.make()
        opened = Database(tmp_path / "xar.sqlite3", server.url(name))
        yield opened
        opened.close()
        server.drop(name)
        return
    empty = request.getfixturevalue("empty_database")
    shutil.copy(empty, tmp_path)
    opened = Database(tmp_path / empty.name)
    yield opened
    opened.close()


@pytest.fixture
def live(database: Database) -> Database:
    """A database with live data."""
    take_part(database)
    return database


@pytest.fixture
def files(live: Database, tmp_path: Path) -> dict[str, bytes]:
    """What an export of it holds, by path."""
    export(live, tmp_path / "out", wanted_of(live), LATER)
    return files_of(tmp_path / "out")


@pytest.fixture
def people(database: Database) -> Database:
    """A database of three people: one has finished, one is on page 4, one has only begun."""
    for cookie, last in (("done", 11), ("half way", 3), ("begun", 0)):
        walk(database, enrol_somebody(database, "live", cookie=cookie), last)
    return database


@pytest.fixture
def backup(people: Database, tmp_path: Path) -> Path:
    path, _ = back_up(people.path, tmp_path / "kept", NOW)
    return path
