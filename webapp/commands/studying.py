"""`xar study`: a folder to begin with, a check before launch, a frozen version, and the proof of what it holds."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

import click

from webapp.command_line import CommandError, refusals, show, show_json
from webapp.commands.publishing import publish_study, stored_bundle


@click.group()
def study() -> None:
    """Declare a study, check it before launch, freeze it, and prove what was frozen."""


@study.command("new")
@click.argument("name")
@click.option(
    "--from",
    "template",
    type=click.Choice(["sakai2021", "understanding"]),
    default="sakai2021",
    help="The study to begin with: the paper's, or one in which almost everything is switched on.",
)
@click.option(
    "--into", "parent", type=click.Path(path_type=Path), default=Path(), metavar="DIR", help="Where the folder goes."
)
def new(name: str, template: str, parent: Path) -> None:
    """Write the folder NAME with a study of your own, every setting explained; nothing is overwritten."""
    from webapp.stimuli.new_study import write_study

    with study_refusals():
        folder = write_study(name, template, parent)
    click.echo(f"{folder}/study.toml is the study; texts/ and layouts/ lie beside it.")
    click.echo(f"Next: change them, then `xar study check {folder}`.")


@study.command("check")
@click.argument("name", required=False, metavar="[NAME|FOLDER]")
@click.option("--json", "prints_json", is_flag=True, help="Print one JSON object.")
def check(name: str | None, *, prints_json: bool) -> None:
    """Check a study's files, compare its arms, and estimate how long it takes.

    Every problem is told at once, and the exit status is then 2. Warnings and notes are for you to judge.
    """
    from webapp.config import read_config
    from webapp.stimuli.check_console import render_check
    from webapp.stimuli.checking import check_study
    from webapp.stimuli.sources import find_study

    with study_refusals():
        config = read_config(os.environ)
        folder = find_study(config.study if name is None else name)
        found = check_study(folder, config.instance, datetime.now(UTC).date())
    if prints_json:
        show_json(found.to_json())
    else:
        show(render_check(found))


@study.command("publish")
@click.argument("name", metavar="NAME|FOLDER")
@click.option("--note", default="", metavar="TEXT", help="Why, for the records.")
def publish(name: str, note: str) -> None:
    """Freeze a study as it is now: files, layouts, weights, pictures, texts, program and planned analysis.

    A live server serves the published version and no other. Publishing a changed study makes another version; the
    earlier one stays, since rows of the data refer to it.
    """
    from rich.console import Console

    from webapp.config import read_config
    from webapp.stimuli.console import shown_progress
    from webapp.stimuli.sources import find_study

    with study_refusals():
        config = read_config(os.environ)
        folder = find_study(name)
        with shown_progress(Console(stderr=True)) as progress:
            published = publish_study(folder, config, note, datetime.now(UTC), progress)
    for line in published.lines():
        click.echo(line)


@study.command("verify")
@click.argument("name", required=False)
@click.option("--version", metavar="HASH", help="Which version, or the start of its hash; else the published one.")
@click.option(
    "--weights",
    type=click.Choice(["stored", "train"]),
    default="stored",
    help="Take the agents from the bundle, or train them again, which takes minutes and needs the same processor type.",
)
@click.option("--json", "prints_json", is_flag=True, help="Print one JSON object.")
def verify(name: str | None, version: str | None, weights: Literal["stored", "train"], *, prints_json: bool) -> None:
    """Build a version of the study NAME again from the files within it, and compare the two.

    Without a published version it is the one that was built last. Exit status 1 means that something that participants
    saw does not come out again.
    """
    from rich.console import Console

    from webapp.config import read_config
    from webapp.stimuli.console import shown_progress
    from webapp.stimuli.verification import verify as build_again
    from webapp.stimuli.verification_console import render_verified

    with study_refusals():
        config = read_config(os.environ)
        folder = stored_bundle(config.instance, config.study if name is None else name, version)
        with shown_progress(Console(stderr=True)) as progress:
            found = build_again(folder, weights, progress)
    if prints_json:
        show_json(found.to_json())
    else:
        show(render_verified(found))
    if not found.is_proven:
        raise click.exceptions.Exit(1)


@contextmanager
def study_refusals() -> Iterator[None]:
    """Turn what the layers refuse into one line; several problems of a study's files get a line each before it."""
    from webapp.stimuli.agents import BuildError
    from webapp.study.problems import StudyError

    try:
        with refusals():
            yield
    except StudyError as error:
        if len(error.problems) == 1:
            raise CommandError(str(error)) from error
        for problem in error.problems:
            click.echo(problem, err=True)
        raise CommandError(f"the study cannot be used; {len(error.problems)} problems are listed above") from error
    except BuildError as error:
        raise CommandError(str(error)) from error
