"""`xar explain`: which steps of an agent's path cannot be avoided, and which of them somebody's route misses."""

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

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
from webapp.commands.sources import (
    SOURCE_OPTIONS,
    read_layout,
    read_source,
    source_options,
    title_of,
    working,
)
from webapp.commands.stability import show_stability

if TYPE_CHECKING:
    from rich.console import RenderableType

    from webapp.explainer.on_demand import Answer
    from webapp.explainer.requests import Request
    from webapp.explainer.sampling import Sampled
    from webapp.explainer.subjects import Source


@click.command()
@source_options
@click.option(
    "--world",
    type=click.Choice(["exact", "learned"]),
    default="exact",
    help="The table of the rules, or the learned world model (maps only).",
)
@policy_option
@importance_option
@click.option(
    "--estimator",
    type=click.Choice(["exact", "monte-carlo"]),
    default="exact",
    help="By solving, or by sampling with a standard error.",
)
@random_steps_option
@discount_option
@click.option(
    "--trials", type=click.IntRange(1, 1_000_000), default=1000, metavar="N", help="Rollouts per state when sampling."
)
@click.option(
    "--stop-early",
    "stops_early",
    is_flag=True,
    help="Sample only until each step's side of the threshold is settled at 95 %, with --trials as the budget.",
)
@seed_option
@click.option(
    "--threshold",
    type=click.Choice(["mean", "top-k", "largest-gap"]),
    default="mean",
    help="What separates subgoals from other steps; the paper's is the mean.",
)
@click.option("--k", "num_subgoals", type=click.IntRange(min=1), metavar="K", help="How many, for --threshold top-k.")
@click.option("--route", metavar="ACTIONS", help="What somebody would do instead: actions with commas between.")
@click.option("--from-step", type=click.IntRange(min=1), default=1, metavar="N", help="The step at which they would.")
@click.option(
    "--believed-layout",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Instead of a route: the map that they believe in, on which they plan it.",
)
@click.option(
    "--granularity",
    type=click.Choice(["steps", "events", "rooms"]),
    default="steps",
    help="Explain the path's steps, or what they achieve (maps only).",
)
@click.option(
    "--stability",
    "asks_stability",
    is_flag=True,
    help="Instead: how often each step is a subgoal over r, ties, thresholds and trainings.",
)
@click.option("--training-seeds", metavar="SEEDS", help="For --stability: more agents, trained with these seeds.")
@click.option(
    "--picture",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="For --stability: a new PNG or SVG file to draw.",
)
@click.option("--language", type=click.Choice(["en", "ja"]), default="en", help="Of the sentences below the table.")
@click.option("--json", "prints_json", is_flag=True, help="Print one JSON object instead of a picture.")
def explain(
    trials: int,
    route: str | None,
    believed_layout: Path | None,
    language: str,
    training_seeds: str | None,
    picture: Path | None,
    *,
    asks_stability: bool,
    prints_json: bool,
    **choices: Any,  # noqa: ANN401 - the other options, handed on as they are.
) -> None:
    """Explain the path of an agent: which steps cannot be avoided, and which of them a route misses."""
    from rich.text import Text

    from webapp.config import read_config
    from webapp.explainer.on_demand import answer, as_json
    from webapp.explainer.questioner import Belief
    from webapp.explainer.requests import Request
    from webapp.storage.instance import InstanceError

    try:
        source = read_source(**{name: choices.pop(name) for name in SOURCE_OPTIONS})
        names = None if route is None else tuple(name.strip() for name in route.split(",") if route.strip())
        belief = None if believed_layout is None else Belief(read_layout(believed_layout), believed_layout.name)
        request = Request(num_trials=trials, route=names, belief=belief, **choices)
        instance = read_config(os.environ).instance
        _check_options(source, request, asks_stability=asks_stability)
        seeds = _seeds(training_seeds)
        _check_stability(seeds, picture, asks_stability=asks_stability)
        with working(source, instance, learns=request.learns or bool(seeds)) as progress:
            if asks_stability:
                return show_stability(
                    source,
                    request,
                    instance / "explain-cache",
                    progress,
                    training_seeds=seeds,
                    picture=picture,
                    prints_json=prints_json,
                )
            found = answer(source, request, instance / "explain-cache", progress)
        if prints_json:
            return show_json(as_json(found, request))
        ending = () if found.sampled is None else (Text(_how_it_ended(found.sampled)),)
        return show(_report(found, request, language), *ending)
    except BrokenPipeError:
        raise  # Whoever read the answer has read enough.
    except (InstanceError, ArithmeticError, ValueError, OSError) as error:
        raise CommandError(str(error)) from error


def _check_options(source: "Source", request: "Request", *, asks_stability: bool) -> None:
    """Refuse options that were given but would change nothing."""
    from webapp.explainer.subjects import MapSource

    given = click.get_current_context().get_parameter_source
    in_sentences = isinstance(source, MapSource) and request.granularity == "steps" and not asks_stability
    if given("language") is ParameterSource.COMMANDLINE and not in_sentences:
        raise CommandError("--language belongs to the sentences below a map's steps; leave it out here")
    if given("trials") is ParameterSource.COMMANDLINE and request.estimator == "exact":
        raise CommandError("--trials belongs to --estimator monte-carlo; an exact answer needs none")


def _seeds(text: str | None) -> tuple[int, ...]:
    try:
        seeds = () if text is None else tuple(int(seed) for seed in text.split(","))
    except ValueError as error:
        raise CommandError(f"--training-seeds takes whole numbers with commas between, not {text!r}") from error
    if any(seed < 0 for seed in seeds) or len(set(seeds)) < len(seeds):
        raise CommandError(f"--training-seeds takes different numbers from 0 on, not {text!r}")
    return seeds


def _check_stability(seeds: tuple[int, ...], picture: Path | None, *, asks_stability: bool) -> None:
    if asks_stability:
        return
    for name, value in {"--training-seeds": seeds, "--picture": picture}.items():
        if value:
            raise CommandError(f"{name} belongs to --stability; ask for that, or leave it out")


def _report(found: "Answer", request: "Request", language: str) -> "RenderableType":
    """Return what a person is shown: a map with the path drawn on it where there is one, else the path in words."""
    from webapp.explainer.explanation import certain
    from webapp.explainer.pictures.granularity_table import GranularityReport
    from webapp.explainer.pictures.path_report import PathReport
    from webapp.explainer.pictures.sentences import load_phrases, subgoal_sentences
    from webapp.explainer.pictures.terminal import Report
    from webapp.explainer.subjects import MapSource

    subject, explanation = found.subject, found.explanation
    title = title_of(subject.source)
    if found.coarse is not None:
        return GranularityReport(
            found.coarse.world, found.coarse.path, explanation, title, str(request), found.question
        )
    if not isinstance(subject.source, MapSource):
        describe = lambda state: subject.describe(subject.world.states[state])
        return PathReport(subject.world, explanation, describe, title, str(request))
    layout, mdp = subject.source.layout, certain(subject.world)
    sentences = subgoal_sentences(layout, mdp, explanation, load_phrases(language))
    _check_encoding(language, "".join(sentences.values()))
    return Report(layout, mdp, explanation, title, str(request), request.belief, sentences)


def _how_it_ended(sampled: "Sampled") -> str:
    """Say why the sampling stopped."""
    trials = f"{sampled.num_trials} trial{'s' if sampled.num_trials > 1 else ''} per state"
    if sampled.stopped == "settled":
        return f"Sampling ended after {trials}: every step's side of the threshold is settled at 95 %."
    if not sampled.unsettled:
        return f"Sampling ended after {trials}, its budget; every step's side of the threshold is settled at 95 %."
    steps = ", ".join(map(str, sampled.unsettled))
    return f"Sampling ended after {trials}, its budget. Not settled at 95 %: the side of the threshold of step {steps}."


def _check_encoding(language: str, text: str) -> None:
    """Refuse a language whose letters the terminal does not have."""
    encoding = sys.stdout.encoding or "utf-8"
    try:
        text.encode(encoding)
    except UnicodeEncodeError as error:
        wish = "set PYTHONIOENCODING=utf-8, or choose another --language"
        raise CommandError(f"{language!r} cannot be written in this terminal's {encoding}; {wish}") from error
