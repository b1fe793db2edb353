"""Looking into the database from outside, over a connection of its own."""

import sqlite3
from contextlib import closing
from pathlib import Path


def ask(instance: Path, question: str, *values: object) -> list[tuple[object, ...]]:
    with closing(sqlite3.connect(instance / "xar.sqlite3", timeout=10)) as connection:
        return connection.execute(question, values).fetchall()


def stored_ratings(instance: Path) -> dict[tuple[int, int], dict[str, int]]:
    """By participant's number and page: the ratings."""
    found: dict[tuple[int, int], dict[str, int]] = {}
    with closing(sqlite3.connect(instance / "xar.sqlite3", timeout=10)) as connection:
        for participant, page, item, rating in connection.execute(
            "SELECT participant_id, page_number, item, rating FROM ratings"
        ):
            found.setdefault((participant, page), {})[item] = rating
    return found


def num_rows(instance: Path, table: str) -> int:
    with closing(sqlite3.connect(instance / "xar.sqlite3", timeout=10)) as connection:
        return int(connection.execute(f"SELECT count(*) FROM {table}").fetchone()[0])  # noqa: S608
