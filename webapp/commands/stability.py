"""`xar explain --stability`: how often each step is a subgoal when the choices behind an explanation change."""

from pathlib import Path
from typing import TYPE_CHECKING

from webapp.command_line import CommandError, show, show_json
from webapp.commands.sources import title_of

if TYPE_CHECKING:
    from webapp.explainer.requests import Request
    from webapp.explainer.subjects import Source, Subject
    from webapp.explainer.training_cache import ReportProgress
    from webapp.explainer.variants import OtherAgent


def show_stability(
    source: "Source",
    request: "Request",
    cache: Path,
    progress: "ReportProgress",
    *,
    training_seeds: tuple[int, ...],
    picture: Path | None,
    prints_json: bool,
) -> None:
    """Explain under many choices and print, and draw if wished, what stays and what flips.

    Raises:
        CommandError: A part of the request has no place here.
        ValueError: As for one explanation, or the picture cannot be written.
    """
    from webapp.explainer.on_demand import prepare_for
    from webapp.explainer.pictures.figure_files import check_new_picture
    from webapp.explainer.pictures.stability_report import StabilityReport
    from webapp.explainer.stability import as_json, stability
    from webapp.explainer.variants import StabilitySettings

    _check(request)
    if picture is not None:
        check_new_picture(picture)
    settings = StabilitySettings(
        importance=request.importance,
        random_steps=request.r,
        rule=request.threshold,
        k=request.num_subgoals,
        seed=request.seed,
    )
    subject = prepare_for(source, request, cache, progress)
    agents = [_agent(subject, seed, cache, progress) for seed in training_seeds]
    found = stability(subject.world, subject.policy, subject.path, settings, agents=agents)
    title = title_of(source)
    if picture is not None:
        from webapp.explainer.pictures.stability_picture import write_picture

        write_picture(found, picture, title)
    if prints_json:
        show_json(as_json(found))
    else:
        show(StabilityReport(found, title, str(request)))


def _check(request: "Request") -> None:
    if request.estimator != "exact":
        raise CommandError("--stability explains exactly; leave --estimator out")
    if request.granularity != "steps":
        raise CommandError("--stability is about steps; leave --granularity out")
    if request.route is not None or request.belief is not None:
        raise CommandError("--stability asks about no route; leave --route and --believed-layout out")


def _agent(subject: "Subject", seed: int, cache: Path, progress: "ReportProgress") -> "OtherAgent":
    """Return the agent of another training in the world as its own model predicts it."""
    from webapp.explainer.subjects import MapSource
    from webapp.explainer.training_cache import trained_agent
    from webapp.explainer.variants import OtherAgent

    if not isinstance(subject.source, MapSource):
        raise CommandError(
            f"agents are trained for key-door maps only; leave --training-seeds out for {subject.source.name}"
        )
    agent = trained_agent(subject.source.layout, seed, cache, progress)
    mdp = agent.tabulate()
    return OtherAgent(f"seed {seed}", mdp, agent.policy(mdp))
