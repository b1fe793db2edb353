import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from webapp.storage.database import Database, open_database


@pytest.fixture(scope="session")
def empty_database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A database file with all tables and no rows, to copy."""
    path = tmp_path_factory.mktemp("empty") / "xar.sqlite3"
    with open_database(path):
        return path


@pytest.fixture
def database(tmp_path: Path, empty_database: Path) -> Iterator[Database]:
    shutil.copy(empty_database, tmp_path)
    opened = Database(tmp_path / empty_database.name)
    yield opened
    opened.close()
