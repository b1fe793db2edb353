"""What the verbs of the command `xar` share: how a mistake is told, and options that several of them take."""

import io
import json
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from rich.console import RenderableType

policy_option = click.option(
    "--policy",
    type=click.Choice(["planner", "tie-averaged", "dqn"]),
    default="planner",
    help="A shortest path, all shortest paths alike, or the learned agent's (maps only).",
)
importance_option = click.option(
    "--importance",
    type=click.Choice(["return_probability", "ace", "reward_importance"]),
    default="return_probability",
    help="Return to the state after random actions, the causal effect of its action, or the reward lost without it.",
)
random_steps_option = click.option(
    "--random-steps",
    type=click.IntRange(0, 1000),
    metavar="R",
    help="How many random actions; 10 if not given, 1 for coarse steps.",
)
discount_option = click.option(
    "--discount",
    type=float,
    default=0.99,
    metavar="G",
    help="Of rewards, and of the planner where chance has a say; above 0 and below 1.",
)
seed_option = click.option(
    "--seed", type=click.IntRange(min=0), default=0, metavar="S", help="Of what is drawn at random and of training."
)


def show(*pages: "RenderableType") -> None:
    """Print for a person. Letters that the terminal does not have are written as escapes.

    Raises:
        CommandError: The output cannot be written.
    """
    from rich.console import Console  # noqa: PLC0415 - only who prints needs it.

    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")
    console = Console()
    with _writing():
        for page in pages:
            console.print(page)
        sys.stdout.flush()


def show_json(answer: Mapping[str, object]) -> None:
    """Print one object for other programs.

    Raises:
        CommandError: The output cannot be written.
    """
    with _writing():
        click.echo(json.dumps(answer))


@contextmanager
def _writing() -> Iterator[None]:
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        raise CommandError(f"the answer cannot be written: {error.strerror}") from error


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
def refusals() -> Iterator[None]:
    """Turn what the layers refuse into one line and exit status 2."""
    from webapp.config import ConfigError  # noqa: PLC0415 - a quick verb stays quick.
    from webapp.stimuli.catalogue import BundleError  # noqa: PLC0415
    from webapp.storage.accounts import AccountError  # noqa: PLC0415
    from webapp.storage.database import DatabaseError, UnavailableError  # noqa: PLC0415
    from webapp.storage.instance import InstanceError  # noqa: PLC0415
    from webapp.storage.people import PersonError  # noqa: PLC0415

    try:
        yield
    except (AccountError, BundleError, ConfigError, DatabaseError, InstanceError, PersonError) as error:
        raise CommandError(str(error)) from error
    except UnavailableError as error:
        wish = "try again; `xar doctor` tells what is the matter, such as another program that holds it"
        raise CommandError(f"the database cannot be used now: {error.orig}; {wish}") from error


@contextmanager
def _one_line() -> Iterator[None]:
    try:
        yield
    except click.exceptions.NoArgsIsHelpError:
        raise
    except click.ClickException as error:
        click.echo(f"xar: {' '.join(error.format_message().split())}", err=True)
        raise click.exceptions.Exit(2) from error
