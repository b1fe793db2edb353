"""`xar export`, `xar recruits`, `xar reconcile`: the data, who was sent by whom, and whether the recruiter agrees."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, get_args

import click

from webapp.command_line import CommandError, show_json

if TYPE_CHECKING:
    from webapp.storage.reconciliation import Reconciliation
    from webapp.storage.wanted import Wanted

MODES = ("live", "test", "bot")


@click.command()
@click.argument("folder", type=click.Path(path_type=Path), metavar="DIR")
@click.option("--study", metavar="NAME", help="The data of this study alone; of all if not given.")
@click.option("--version", "study_version", metavar="HASH", help="Of this version alone, or the start of its hash.")
@click.option("--mode", type=click.Choice(MODES), help="Of these participants alone; live ones are the data.")
@click.option("--with-free-text", is_flag=True, help="Also answers in participants' own words, which may name people.")
def export(
    folder: Path, study: str | None, study_version: str | None, mode: str | None, *, with_free_text: bool
) -> None:
    """Write the data as a data set into the new folder DIR, complete or not at all; nothing is overwritten.

    It holds no ids of recruiters, and unless told otherwise no answers in participants' own words.
    """
    from webapp.config import read_config
    from webapp.storage.database import open_database
    from webapp.storage.dataset import export as write_dataset
    from webapp.storage.dataset import record_export

    with _refusals():
        config = read_config(os.environ)
        with open_database(config, make=False) as database:
            wanted = _wanted(config.instance, study, study_version, mode, with_free_text=with_free_text)
            now = datetime.now(UTC)
            num_rows = write_dataset(database, folder, wanted, now)
            record_export(database, wanted, now)
    for name, count in num_rows.items():
        _echo_written(folder / name, count)


@click.command()
@click.argument("file", type=click.Path(path_type=Path))
def recruits(file: Path) -> None:
    """Write into FILE who was sent by a recruiter, with their ids there; nothing is overwritten.

    It links the data with people, so keep it apart from them. It is needed to pay, and to answer the recruiter. That it
    was written is logged.
    """
    from webapp.config import read_config
    from webapp.storage.database import open_database
    from webapp.storage.exports import export_recruits

    with _refusals(), open_database(read_config(os.environ), make=False) as database:
        num_rows = export_recruits(database, file, datetime.now(UTC))
    _echo_written(file, num_rows)


@click.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--study", metavar="NAME", help="The study; the only one that has such participants if not given.")
@click.option("--mode", type=click.Choice(MODES), default="live", help="Which participants.")
@click.option("--id-column", metavar="NAME", help="The column with people's ids, where it is none of the known ones.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def reconcile(file: Path, study: str | None, mode: str, id_column: str | None, *, as_json: bool) -> None:
    """Compare the recruiter's CSV FILE with the data: who is missing, extra, twice there, paid but incomplete.

    The output holds people's ids at the recruiter. Exit status 1 means that the two differ.
    """
    from webapp.config import read_config
    from webapp.storage.database import open_database
    from webapp.storage.reconciliation import reconcile_file

    with _refusals():
        config = read_config(os.environ)
        with open_database(config, make=False) as database:
            found = reconcile_file(database, config.instance, file, study, mode, id_column)
    if as_json:
        show_json(found.as_json())
    else:
        _echo_reconciliation(found)
    if found.num_problems:
        raise click.exceptions.Exit(1)


def _wanted(
    instance: Path, study: str | None, version: str | None, mode: str | None, *, with_free_text: bool
) -> "Wanted":
    from webapp.storage.scope import Mode
    from webapp.storage.wanted import Wanted, bundles_in

    known: Mode | None = next((one for one in get_args(Mode) if one == mode), None)
    return Wanted(study, version, known, with_free_text=with_free_text, find_bundle=bundles_in(instance))


def _echo_written(path: Path, num_rows: int) -> None:
    click.echo(f"{path}: {num_rows} {'row' if num_rows == 1 else 'rows'}")


def _echo_reconciliation(found: "Reconciliation") -> None:
    click.echo(f"In the file: {found.num_theirs}; here: {found.num_ours}; in agreement: {found.num_agreeing}.")
    for group in found.groups:
        if group.people:
            click.echo(f"\n{group.title} ({len(group.people)}): {group.advice}")
        for person in group.people:
            click.echo("  " + " · ".join(part for part in (person.external_id, person.code, person.words) if part))


@contextmanager
def _refusals() -> Iterator[None]:
    """Turn what the layers refuse into one line and exit status 2."""
    from webapp.config import ConfigError
    from webapp.storage.database import DatabaseError
    from webapp.storage.exports import ExportError
    from webapp.storage.instance import InstanceError
    from webapp.study.reconciliation import ReconciliationError

    try:
        yield
    except (ConfigError, DatabaseError, ExportError, InstanceError, ReconciliationError) as error:
        raise CommandError(str(error)) from error
