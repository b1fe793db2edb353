"""Looking into the database from outside, over a connection of its own."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.outside import Outside, outside
from webapp.config import Config


def place(instance: Path) -> Config:
    """Return the settings that say where an instance keeps its data, whichever database this run is about."""
    return Config(instance, database_url=os.environ.get("DATABASE_URL"))


@contextmanager
def looking_into(instance: Path) -> Iterator[Outside]:
    config = place(instance)
    with outside(config.database_path, config.database_url) as connection:
        yield connection


def ask(instance: Path, question: str, *values: object) -> list[tuple[object, ...]]:
    with looking_into(instance) as connection:
        return connection.ask(question, *values)


def stored_ratings(instance: Path) -> dict[tuple[int, int], dict[str, int]]:
    """By participant's number and page: the ratings."""
    found: dict[tuple[int, int], dict[str, int]] = {}
    for participant, page, item, rating in ask(
        instance, "SELECT participant_id, page_number, item, rating FROM ratings"
    ):
        assert isinstance(participant, int)
        assert isinstance(page, int)
        assert isinstance(rating, int)
        found.setdefault((participant, page), {})[str(item)] = rating
    return found


def num_rows(instance: Path, table: str) -> int:
    ((number,),) = ask(instance, f"SELECT count(*) FROM {table}")  # noqa: S608
    assert isinstance(number, int)
    return number
