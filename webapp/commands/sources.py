"""The options by which a verb is told what to explain: a map or an environment."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from webapp.command_line import CommandError

if TYPE_CHECKING:
    from webapp.explainer.subjects import Source
    from webapp.explainer.worlds.layout import Layout

_OPTIONS = (
    click.option("--layout", type=click.Path(path_type=Path), metavar="FILE", help="A key-door map, in ASCII."),
    click.option("--env", metavar="ID", help="Instead: a Gymnasium environment, or module:callable for your own."),
    click.option("--env-seed", type=click.IntRange(min=0), metavar="N", help="The seed of its reset; 0 if not given."),
    click.option(
        "--env-option", multiple=True, metavar="KEY=VALUE", help="An argument for making it, such as is_slippery=false."
    ),
    click.option("--actions", metavar="NAMES", help="Explain with these of its actions only, with commas between."),
    click.option(
        "--max-states",
        type=click.IntRange(min=1),
        metavar="N",
        help="Refuse an environment with more states; 200,000 if not given.",
    ),
)
SOURCE_OPTIONS = ("layout", "env", "env_seed", "env_option", "actions", "max_states")
"""The names under which a verb gets them."""


def source_options(verb: Callable[..., Any]) -> Callable[..., Any]:
    """Give a verb the options that `read_source` reads."""
    for option in reversed(_OPTIONS):
        verb = option(verb)
    return verb


def read_source(
    layout: Path | None,
    env: str | None,
    env_seed: int | None,
    env_option: tuple[str, ...],
    actions: str | None,
    max_states: int | None,
) -> "Source":
    """Return what the options name.

    Raises:
        CommandError: They name nothing, or two things, or a map that cannot be read.
        LayoutError: The map cannot be used.
    """
    from webapp.explainer.subjects import EnvironmentSource, MapSource

    if (layout is None) == (env is None):
        wish = "give one of --layout FILE and --env ID"
        raise CommandError(f"there is nothing to explain; {wish}" if layout is None else f"{wish}, not both")
    if layout is not None:
        given = {"--env-seed": env_seed, "--env-option": env_option, "--actions": actions, "--max-states": max_states}
        for name, value in given.items():
            if value not in (None, ()):
                raise CommandError(f"{name} belongs to --env; a map has no use for it")
        return MapSource(read_layout(layout), layout.name)
    from webapp.explainer.worlds.enumeration import MAX_STATES
    from webapp.explainer.worlds.gymnasium_worlds import parse_options

    names = () if actions is None else tuple(name.strip() for name in actions.split(","))
    return EnvironmentSource(str(env), env_seed or 0, names, parse_options(env_option), max_states or MAX_STATES)


def title_of(source: "Source") -> str:
    """Return the name of what is explained, for headings."""
    from webapp.explainer.subjects import MapSource

    if isinstance(source, MapSource):
        return source.name
    from webapp.explainer.worlds.gymnasium_worlds import resolve_id

    known = source.name if ":" in source.name else resolve_id(source.name)
    given = [] if known == source.name else [f"now {known}"]
    given += [f"{key}={value}" for key, value in source.options.items()]
    given += [f"seed {source.seed}"] if source.seed else []
    return f"{source.name} ({', '.join(given)})" if given else source.name


def read_layout(path: Path) -> "Layout":
    """Read a map.

    Raises:
        CommandError: The file cannot be read.
        LayoutError: The map cannot be used.
    """
    from webapp.explainer.worlds.layout import parse_layout

    try:
        return parse_layout(path.read_text(encoding="utf-8-sig"), path.name)
    except OSError as error:
        raise CommandError(f"{path} cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise CommandError(f"{path} is not a text file") from error


@contextmanager
def working(source: "Source", instance: Path, *, learns: bool) -> Iterator[Callable[[str, float], None]]:
    """Show on standard error how what takes long goes on; make the folder that keeps what is trained, if need be."""
    from webapp.explainer.subjects import EnvironmentSource

    if not learns and not isinstance(source, EnvironmentSource):
        yield _nobody
        return
    from rich.console import Console

    from webapp.stimuli.console import shown_progress
    from webapp.storage.instance import prepare_instance

    if learns:
        prepare_instance(instance)
    with shown_progress(Console(stderr=True)) as progress:
        yield progress


def _nobody(stage: str, done: float) -> None:
    """Show no progress where nothing takes long."""
    del stage, done
