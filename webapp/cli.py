"""The command `xar`: verbs only. Each loads what it needs when it runs, so that a quick verb stays quick."""

import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from webapp.explainer.worlds.layout import Layout


class CommandError(click.ClickException):
    """What a verb refuses: one line on standard error and exit status 2."""

    exit_code = 2


class OneLineErrors(click.Group):
    """A command whose every error is one line and exit status 2, mistakes in the command line itself included."""

    def invoke(self, ctx: click.Context) -> Any:  # noqa: ANN401 - whatever the verb returns, which is nothing.
        """Run a verb."""
        with _one_line():
            return super().invoke(ctx)

    def make_context(self, *args: Any, **kwargs: Any) -> click.Context:  # noqa: ANN401 - handed on as they are.
        """Read the command line up to the verb."""
        with _one_line():
            return super().make_context(*args, **kwargs)


@contextmanager
def _one_line() -> Iterator[None]:
    try:
        yield
    except click.exceptions.NoArgsIsHelpError:
        raise
    except click.ClickException as error:
        click.echo(f"xar: {' '.join(error.format_message().split())}", err=True)
        raise click.exceptions.Exit(2) from error


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
    from webapp.storage.database import open_database
    from webapp.storage.researchers import create_researcher, has_researcher

    with _refusals(), open_database(read_config(os.environ).database_path) as database:
        if if_missing and has_researcher(database, name):
            click.echo(f"The account {name!r} is there already; its password stays as it is.")
            return
        password = secrets.token_urlsafe(15) if generate_password else _ask_for_password()
        create_researcher(database, name, password, datetime.now(UTC))
    click.echo(f"The account {name!r} is made.")
    if generate_password:
        click.echo(f"Its password, shown only now: {password}")


@main.command()
@click.argument("folder", type=click.Path(file_okay=False, path_type=Path), metavar="DIR")
def export(folder: Path) -> None:
    """Write ratings.csv and participants.csv into the folder DIR; nothing is overwritten."""
    from webapp.config import read_config
    from webapp.storage.database import open_database
    from webapp.storage.exports import export as write_files

    with _refusals(), open_database(read_config(os.environ).database_path, make=False) as database:
        num_rows = write_files(database, folder)
    for name, count in num_rows.items():
        click.echo(f"{folder / name}: {count} {'row' if count == 1 else 'rows'}")


@main.command()
@click.option("--layout", required=True, type=click.Path(path_type=Path), metavar="FILE", help="The map, in ASCII.")
@click.option(
    "--world",
    type=click.Choice(["exact", "learned"]),
    default="exact",
    help="The table of the map's rules, or the learned world model.",
)
@click.option(
    "--policy",
    type=click.Choice(["planner", "dqn"]),
    default="planner",
    help="A shortest path, or the learned agent's.",
)
@click.option(
    "--importance",
    type=click.Choice(["return_probability", "ace"]),
    default="return_probability",
    help="Return to the state after random actions, or the causal effect of its action.",
)
@click.option(
    "--estimator",
    type=click.Choice(["exact", "monte-carlo"]),
    default="exact",
    help="By solving, or by sampling with a standard error.",
)
@click.option("--random-steps", type=click.IntRange(0, 1000), default=10, metavar="R", help="How many random actions.")
@click.option(
    "--trials", type=click.IntRange(1, 1_000_000), default=1000, metavar="N", help="Rollouts per state when sampling."
)
@click.option("--seed", type=click.IntRange(min=0), default=0, metavar="S", help="Of sampling and of training.")
@click.option(
    "--route",
    metavar="ACTIONS",
    help="What somebody would do instead: forward, left, right, pickup, toggle, with commas between.",
)
@click.option("--from-step", type=click.IntRange(min=1), default=1, metavar="N", help="The step at which they would.")
@click.option("--json", "prints_json", is_flag=True, help="Print one JSON object instead of a picture.")
def explain(layout: Path, trials: int, route: str | None, *, prints_json: bool, **choices: Any) -> None:  # noqa: ANN401
    """Explain the path of an agent on a map: which steps cannot be avoided, and which of them a route misses."""
    from rich.console import Console

    from webapp.config import read_config
    from webapp.explainer.on_demand import Request, answer, as_json
    from webapp.explainer.pictures.terminal import Report
    from webapp.storage.instance import InstanceError

    try:
        names = None if route is None else tuple(name.strip() for name in route.split(","))
        request = Request(num_trials=trials, route=names, **choices)
        world = _read_layout(layout)
        instance = read_config(os.environ).instance
        with _training_progress(instance) if request.learns else nullcontext(_nobody) as progress:
            mdp, explanation = answer(world, request, instance / "explain-cache", progress, layout.name)
    except (InstanceError, ValueError) as error:
        raise CommandError(str(error)) from error
    if prints_json:
        click.echo(json.dumps(as_json(mdp, explanation)))
    else:
        Console().print(Report(world, mdp, explanation, layout.name, str(request)))


@contextmanager
def _training_progress(instance: Path) -> Iterator[Callable[[str, float], None]]:
    """Make the folder that keeps what is trained, and show on standard error how the training goes."""
    from rich.console import Console

    from webapp.stimuli.console import shown_progress
    from webapp.storage.instance import prepare_instance

    prepare_instance(instance)
    with shown_progress(Console(stderr=True)) as progress:
        yield progress


def _nobody(stage: str, done: float) -> None:
    """Show no progress where nothing takes long."""
    del stage, done


def _read_layout(path: Path) -> "Layout":
    from webapp.explainer.worlds.layout import parse_layout

    try:
        return parse_layout(path.read_text(encoding="utf-8-sig"), path.name)
    except OSError as error:
        raise CommandError(f"{path} cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise CommandError(f"{path} is not a text file") from error


def _ask_for_password() -> str:
    return str(click.prompt("Password", hide_input=True, confirmation_prompt=True))


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
