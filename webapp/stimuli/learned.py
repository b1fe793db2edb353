"""The agents that people are shown: learned from experience, together with their models of the world."""

import dataclasses
import difflib
import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from webapp.stimuli.agents import Agent, Agents, BuildError, ReportProgress
from webapp.stimuli.sources import Sources
from webapp.study.problems import StudyError

if TYPE_CHECKING:
    from webapp.explainer.learning import Progress, TrainingSettings

WEIGHTS = "weights.safetensors"
"""The file of a bundle that holds the weights of all agents and world models."""


def learned_agents(sources: Sources, progress: ReportProgress) -> Agents:
    """Train the agents and world models of all key-door layouts in one batched run.

    Raises:
        StudyError: The study file overrides a training setting that does not exist, or with an impossible value.
        BuildError: An agent or a world model was not right when the budget ended.
    """
    from webapp.explainer import learning  # noqa: PLC0415 - torch is loaded only where something is trained.

    study = sources.study
    settings = _settings(learning.TrainingSettings, study.learning.settings)
    names = list(sources.layouts)
    began = time.monotonic()
    seconds_at: dict[int, float] = {}

    def watch(now: "Progress") -> None:
        seconds_at[now.iteration] = round(time.monotonic() - began, 1)
        progress("training", now.fraction)

    progress("training", 0.0)
    try:
        trained = learning.train(
            [sources.layouts[name] for name in names], settings, [study.training_seed(name) for name in names], watch
        )
    except learning.TrainingFailed as error:
        order = ", ".join(f"{number} {name}" for number, name in enumerate(names, start=1))
        raise BuildError(f"the training failed: {error} (the agents: {order})") from error
    progress("training", 1.0)
    by_layout = dict(zip(names, trained, strict=True))
    return Agents(
        kind="learned",
        by_layout={name: Agent(agent.policy, agent.tabulate(), agent.facts) for name, agent in by_layout.items()},
        settings=settings.to_dict(),
        seconds={name: seconds_at[agent.num_iterations] for name, agent in by_layout.items()},
        save=lambda folder: learning.save(trained, folder / WEIGHTS),
    )


def setting_problems(overrides: Mapping[str, Any]) -> Sequence[tuple[tuple[str, ...], str]]:
    """Say what is wrong with the settings of the training in a study file, by path; loads torch if there are any."""
    if not overrides:
        return []
    from webapp.explainer.learning import TrainingSettings  # noqa: PLC0415 - as above.

    known = [field.name for field in dataclasses.fields(TrainingSettings)]
    path = ("learning", "settings")
    problems = [((*path, name), _unknown(name, known)) for name in overrides if name not in known]
    if not problems:
        try:
            TrainingSettings(**overrides)
        except (TypeError, ValueError) as error:
            return [(path, str(error))]
    return problems


def _settings(kind: "type[TrainingSettings]", overrides: Mapping[str, Any]) -> "TrainingSettings":
    problems = setting_problems(overrides)
    if problems:
        raise StudyError(f"study.toml: {'.'.join(path)}: {message}" for path, message in problems)
    return kind(**overrides)


def _unknown(name: str, known: list[str]) -> str:
    near = difflib.get_close_matches(name, known, n=1)
    wish = f"did you mean {near[0]!r}?" if near else f"the settings are {', '.join(known)}"
    return f"is not a setting of the training; {wish}"
