"""This program as a load test serves it, and what it stored of whom."""

import hashlib
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sqlalchemy import select

from tests.benchmarks.load.studies import NAME
from tests.web.servers import serving
from webapp.config import Config
from webapp.storage.database import open_database
from webapp.storage.tables import participants, ratings

Answers = Mapping[str, Mapping[tuple[str, str], str]]
"""By person, by page and item, what was answered."""

END = "/done"
COOKIE = "participant"


@dataclass(frozen=True, slots=True)
class Running:
    """A running server.

    Attributes:
        port: Where it listens.
        pid: Its first process.
        instance: Its instance folder.
    """

    port: int
    pid: int
    instance: Path

    def starts(self, num_people: int) -> list[str]:
        """Return the address with which each person starts: the same for all."""
        return ["/"] * num_people


@contextmanager
def serve_ours(built: Path, instance: Path, *words: str, **settings: str) -> Iterator[Running]:
    """Serve a copy of a built instance on a new database, with its tables made before, as `make run` does it.

    The process that makes them keeps the package that does so in its memory.
    """
    instance.mkdir()
    shutil.copytree(built / "bundles", instance / "bundles")
    with open_database(Config(instance=instance, study=NAME, database_url=settings.get("DATABASE_URL"))):
        pass
    with serving(instance, "--study", NAME, *words, **settings) as server:
        yield Running(server.port, server.process.pid, instance)
        server.stop()


def stored_by_us(instance: Path, url: str | None = None) -> Answers:
    """Return what the database holds, once the server has stopped; persons by the hash of their cookie.

    Args:
        instance: The instance, with the SQLite edition's file.
        url: The address of the PostgreSQL edition's database instead.
    """
    found: dict[str, dict[tuple[str, str], str]] = {}
    query = select(participants.c.token_hash, ratings.c.page_number, ratings.c.item, ratings.c.rating).where(
        ratings.c.participant_id == participants.c.id
    )
    place = Config(instance=instance, study=NAME, database_url=url)
    with open_database(place, make=False) as database, database.read() as connection:
        for token_hash, page, item, rating in connection.execute(query):
            key = str(page), str(item)
            assert key not in found.setdefault(token_hash, {}), "a rating is there twice"
            found[token_hash][key] = str(rating)
    return found


def told_to_us(person: Mapping[str, Any]) -> tuple[str, dict[tuple[str, str], str]]:
    """Return who a person is, and what of theirs was acknowledged, in the terms of `stored_by_us`."""
    token = person["cookies"].get(COOKIE, "")
    ledger = {
        (page.rpartition("/")[2], name.removeprefix("rating-")): value
        for page, name, value in person["ledger"]
        if name.startswith("rating-")
    }
    return hashlib.sha256(token.encode()).hexdigest(), ledger
