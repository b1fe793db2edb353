"""The command `xar`: verbs only. Each loads what it needs when it runs, so that a quick verb stays quick."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

import click

from webapp.command_line import CommandError, OneLineErrors
from webapp.commands.comparing import compare
from webapp.commands.explaining import explain
from webapp.commands.simulating import simulate


@click.group(cls=OneLineErrors, context_settings={"help_option_names": ["-h", "--help"], "show_default": True})
@click.version_option(package_name="xar", prog_name="xar")
def main() -> None:
    """Explain what a learned agent does, and study how people understand it."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # Networks as small as ours get many times slower with more threads.


@main.command()
@click.argument("study", required=False)
def build(study: str | None) -> None:
    """Train and explain the agents of STUDY and build the bundle that is served; nothing is done twice.

    STUDY is the name of a declared study, or a folder that holds a study file (XAR_STUDY).
    """
    from rich.console import Console

    from webapp.config import read_config
    from webapp.stimuli.build import build as build_bundle
    from webapp.stimuli.console import render_report, shown_progress
    from webapp.stimuli.sources import find_study
    from webapp.storage.instance import prepare_instance

    with _refusals(), _build_refusals():
        config = read_config(os.environ)
        folder = find_study(config.study if study is None else study)
        prepare_instance(config.instance)
        with shown_progress(Console(stderr=True)) as progress:
            built = build_bundle(folder, config.instance, progress)
    Console().print(render_report(built))


@main.command()
@click.option("--host", help="The address to listen on; this machine alone unless told otherwise (XAR_HOST).")
@click.option("--port", type=click.IntRange(0, 65535), help="The port to listen on, 8000 if not given (XAR_PORT).")
@click.option("--study", help="The study to serve (XAR_STUDY).")
@click.option("--live", is_flag=True, help="Collect real data: answers are not marked as a test.")
def serve(host: str | None, port: int | None, study: str | None, *, live: bool) -> None:
    """Serve the participant pages and the dashboard until stopped."""
    from webapp.app import serve as run_server
    from webapp.config import read_config

    with _refusals():
        config = read_config(os.environ, live=live, host=host, port=port, study=study)
        run_server(config, announce=click.echo)


@main.group()
def admin() -> None:
    """Manage the accounts of researchers."""


@admin.command("create")
@click.argument("name")
@click.option("--generate-password", is_flag=True, help="Make a random password and print it, once.")
@click.option("--if-missing", is_flag=True, help="Do nothing if there is such an account.")
def create_admin(name: str, *, generate_password: bool, if_missing: bool) -> None:
    """Make an account for the dashboard; the password is asked for."""
    import secrets

    from webapp.config import read_config
    from webapp.password_entry import ask_for_password
    from webapp.storage.database import open_database
    from webapp.storage.researchers import check_name, create_researcher, has_researcher

    with _refusals():
        check_name(name)
    with _refusals(), open_database(read_config(os.environ).database_path) as database:
        if if_missing and has_researcher(database, name):
            click.echo(f"The account {name!r} is there already; its password stays as it is.")
            return
        password = secrets.token_urlsafe(15) if generate_password else ask_for_password()
        create_researcher(database, name, password, datetime.now(UTC))
    click.echo(f"The account {name!r} is made.")
    if generate_password:
        click.echo(f"Its password, shown only now: {password}")


@main.command()
@click.argument("folder", type=click.Path(file_okay=False, path_type=Path), metavar="DIR")
def export(folder: Path) -> None:
    """Write the files of the data into the folder DIR; nothing is overwritten."""
    from webapp.config import read_config
    from webapp.storage.database import open_database
    from webapp.storage.exports import export as write_files

    with _refusals(), open_database(read_config(os.environ).database_path, make=False) as database:
        num_rows = write_files(database, folder)
    for name, count in num_rows.items():
        _echo_written(folder / name, count)


@main.command()
@click.argument("file", type=click.Path(path_type=Path))
def recruits(file: Path) -> None:
    """Write into FILE who was sent by a recruiter, with their ids there; nothing is overwritten.

    It links the data with people, so keep it apart from them. It is needed to pay, and to answer the recruiter.
    """
    from webapp.config import read_config
    from webapp.storage.database import open_database
    from webapp.storage.exports import export_recruits

    with _refusals(), open_database(read_config(os.environ).database_path, make=False) as database:
        num_rows = export_recruits(database, file)
    _echo_written(file, num_rows)


main.add_command(explain)
main.add_command(compare)
main.add_command(simulate)


def _echo_written(path: Path, num_rows: int) -> None:
    click.echo(f"{path}: {num_rows} {'row' if num_rows == 1 else 'rows'}")


@contextmanager
def _refusals() -> Iterator[None]:
    """Turn what the layers refuse into one line and exit status 2."""
    from webapp.config import ConfigError
    from webapp.stimuli.catalogue import BundleError
    from webapp.storage.database import DatabaseError
    from webapp.storage.exports import ExportError
    from webapp.storage.instance import InstanceError
    from webapp.storage.researchers import AccountError

    try:
        yield
    except (AccountError, BundleError, ConfigError, DatabaseError, ExportError, InstanceError) as error:
        raise CommandError(str(error)) from error


@contextmanager
def _build_refusals() -> Iterator[None]:
    """Turn what a build refuses into one line; several problems of a study's files get a line each before it."""
    from webapp.stimuli.agents import BuildError
    from webapp.study.problems import StudyError

    try:
        yield
    except StudyError as error:
        if len(error.problems) == 1:
            raise CommandError(str(error)) from error
        for problem in error.problems:
            click.echo(problem, err=True)
        raise CommandError(f"the study cannot be used; {len(error.problems)} problems are listed above") from error
    except BuildError as error:
        raise CommandError(str(error)) from error
