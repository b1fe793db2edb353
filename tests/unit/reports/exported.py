"""A data set as `xar export` writes it, of people who answered by chance."""

from pathlib import Path

from tests.benchmarks.crowd import write_crowd
from webapp.stimuli.sources import find_study
from webapp.storage.database import open_database
from webapp.storage.dataset import export
from webapp.storage.scope import Mode, Scope
from webapp.storage.wanted import Wanted
from webapp.study.protocol import parse_study

VERSION = "ab" * 32


def export_crowd(folder: Path, num_people: int, name: str = "sakai2021", mode: Mode = "live", seed: int = 1) -> Path:
    """Return a new data set in the folder, of so many who agreed; some left, and some are under way."""
    study = parse_study((find_study(name) / "study.toml").read_text(encoding="utf-8"))
    with open_database(folder / "crowd.sqlite", make=True) as database:
        now = write_crowd(database, study, Scope(study.name, VERSION, mode), num_people, seed)
        export(database, folder / "export", Wanted(), now)
    return folder / "export"
