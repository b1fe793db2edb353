import os
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from flask import Flask

from tests import postgres
from tests.web.bundles import read_study, write_bundle
from tests.web.people import Clock
from webapp.app import create_app
from webapp.config import Config
from webapp.views.services import services_of

# The module starts a part of such a run.
collect_ignore = ["test_on_postgres.py"] if postgres.IS_WANTED else []


@pytest.fixture(autouse=True)
def database_of_the_run(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Let what a test starts use a new database of PostgreSQL's, where all tests are to use these."""
    monkeypatch.delenv("DATABASE_URL", raising=False)
    if not postgres.IS_WANTED or request.node.get_closest_marker("sqlite_only") is not None:
        yield
        return
    server = request.getfixturevalue("postgres_server")
    name = server.make()
    monkeypatch.setenv("DATABASE_URL", server.url(name))
    yield
    server.drop(name)


@pytest.fixture
def instance(tmp_path: Path) -> Path:
    """An instance folder with a bundle of the shipped study."""
    folder = tmp_path / "instance"
    write_bundle(folder, read_study())
    return folder


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def start_app(clock: Clock, database_of_the_run: None) -> Iterator[Callable[[Config], Flask]]:  # noqa: ARG001 - first.
    """Start apps, and close their databases at the end."""
    started: list[Flask] = []

    def start(config: Config) -> Flask:
        started.append(create_app(replace(config, database_url=os.environ.get("DATABASE_URL")), clock=clock))
        return started[-1]

    yield start
    for app in started:
        services_of(app).database.close()


@pytest.fixture
def app(instance: Path, start_app: Callable[[Config], Flask]) -> Flask:
    return start_app(Config(instance))
