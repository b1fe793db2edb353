from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from flask import Flask

from tests.web.bundles import read_study, write_bundle
from tests.web.people import Clock
from webapp.app import create_app
from webapp.config import Config
from webapp.views.services import services_of


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
def start_app(clock: Clock) -> Iterator[Callable[[Config], Flask]]:
    """Start apps, and close their databases at the end."""
    started: list[Flask] = []

    def start(config: Config) -> Flask:
        started.append(create_app(config, clock=clock))
        return started[-1]

    yield start
    for app in started:
        services_of(app).database.close()


@pytest.fixture
def app(instance: Path, start_app: Callable[[Config], Flask]) -> Flask:
    return start_app(Config(instance))
