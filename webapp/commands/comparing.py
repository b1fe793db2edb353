"""`xar compare`: the paper's subgoals beside other ways of choosing as many steps."""

import os
from pathlib import Path
from typing import Any

import click

from webapp.command_line import (
    CommandError,
    discount_option,
    importance_option,
    policy_option,
    random_steps_option,
    seed_option,
    show,
    show_json,
)
from webapp.commands.sources import SOURCE_OPTIONS, read_source, source_options, title_of, working


@click.command()
@source_options
@policy_option
@importance_option
@random_steps_option
@discount_option
@click.option(
    "--k",
    "budget",
    type=click.IntRange(min=1),
    metavar="K",
    help="How many steps each selector chooses; as many as there are subgoals if not given.",
)
@click.option("--alpha", type=float, default=0.5, metavar="A", help="The probability to exceed, from 0 to below 1.")
@click.option(
    "--min-gap",
    type=click.IntRange(min=1),
    default=2,
    metavar="N",
    help="The least distance between steps that HIGHLIGHTS chooses.",
)
@click.option(
    "--context",
    type=click.IntRange(min=0),
    default=1,
    metavar="N",
    help="How many states HIGHLIGHTS shows before and after each of its own; with --json.",
)
@seed_option
@click.option(
    "--picture",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Also draw the curves over k into a new PNG or SVG file.",
)
@click.option("--json", "prints_json", is_flag=True, help="Print one JSON object instead of tables.")
def compare(
    policy: Any,  # noqa: ANN401 - as the other options, handed on as it is.
    seed: int,
    random_steps: int | None,
    picture: Path | None,
    *,
    prints_json: bool,
    **choices: Any,  # noqa: ANN401
) -> None:
    """Compare the paper's subgoals with other ways of choosing as many steps of an agent's path."""
    from webapp.config import read_config
    from webapp.explainer.comparison import ComparisonSettings, as_json
    from webapp.explainer.comparison import compare as compare_selectors
    from webapp.explainer.on_demand import about, prepare_for
    from webapp.explainer.pictures.comparison_table import ComparisonReport
    from webapp.explainer.pictures.figure_files import check_new_picture
    from webapp.explainer.requests import Request
    from webapp.storage.instance import InstanceError

    try:
        if picture is not None:
            check_new_picture(picture)
        source = read_source(**{name: choices.pop(name) for name in SOURCE_OPTIONS})
        request = Request(policy=policy, seed=seed, random_steps=random_steps, discount=choices["discount"])
        settings = ComparisonSettings(seed=seed, random_steps=request.r, **choices)
        instance = read_config(os.environ).instance
        with working(source, instance, learns=request.learns) as progress:
            subject = prepare_for(source, request, instance / "explain-cache", progress)
        comparison = compare_selectors(subject.world, subject.policy, subject.path, settings)
        if picture is not None:
            from webapp.explainer.pictures.comparison_picture import write_picture

            write_picture(comparison, picture)
    except (InstanceError, ArithmeticError, ValueError, OSError) as error:
        raise CommandError(str(error)) from error
    if prints_json:
        show_json({**as_json(comparison), "about": about(subject, request)})
    else:
        show(ComparisonReport(comparison, title_of(source), f"{policy}, {settings}"))
