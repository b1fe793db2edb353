"""What a build says about itself: what it was made with, and per layout what came out."""

import hashlib
import platform
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from webapp.explainer.importance import exact_importance
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.solvers import follow
from webapp.stimuli.agents import Agent, BuildError
from webapp.stimuli.arm_fidelity import arm_fidelities
from webapp.stimuli.scenes import Scene, Walk
from webapp.study.protocol import Study

_PACKAGES = ("gymnasium", "minigrid", "numpy", "pillow", "safetensors", "torch")
"""The packages whose version can change a bundle's bytes."""

_CODE = ("explainer", "stimuli", "study")
"""The packages of this project whose code can, and their tables of phrases."""


@dataclass(frozen=True, slots=True)
class LayoutReport:
    """What came out for one layout.

    Attributes:
        layout: Its name.
        num_states: How many states can be reached.
        num_steps: The length of the agent's path.
        subgoals: Steps from 1.
        key_points: By experiment: the steps that answer its question.
        pictures: By experiment and kind: the fewest and the most pictures of an explanation.
        fidelity: By experiment and kind: the lowest, mean and highest `P(reach | shown)`, see `arm_fidelity`.
        arms_like_subgoals: By experiment: the comparison arms that show exactly what the subgoals show.
        max_difference: The largest absolute difference between the importance in the agent's world and in the exact
            table, over the states of the path.
        training: What is to be reported of the agent's training; empty when nothing was trained.
    """

    layout: str
    num_states: int
    num_steps: int
    subgoals: Sequence[int]
    key_points: Mapping[str, Sequence[int]]
    pictures: Mapping[str, Mapping[str, Sequence[int]]]
    fidelity: Mapping[str, Mapping[str, Sequence[float]]]
    arms_like_subgoals: Mapping[str, Sequence[str]]
    max_difference: float
    training: Mapping[str, Any]

    def to_json(self) -> dict[str, Any]:
        """Return the report as plain JSON values, which `LayoutReport(**content)` reads back."""
        return asdict(self)


def report_on(
    study: Study, name: str, exact: DeterministicMDP, agent: Agent, way: Walk, scenes: Mapping[str, Scene]
) -> LayoutReport:
    """Compare what was explained with the exact world.

    Args:
        study: The study.
        name: The layout's name.
        exact: The world itself.
        agent: Whose world and policy it is.
        way: Its path.
        scenes: By experiment, those of this layout.

    Raises:
        BuildError: The agent's world has other states than the exact one, its path is another there, or participants
            act in it and it errs.
    """
    settings = study.explanation
    if set(exact.states) != set(agent.world.states):
        raise BuildError(f"layout {name!r}: the world model reaches other states than the world itself")
    policy = agent.policy(exact)
    path = follow(exact, policy)
    if [exact.states[state] for state in path.states] != [agent.world.states[state] for state in way.path.states]:
        raise BuildError(f"layout {name!r}: the agent's path in its world model is not its path in the world itself")
    if name in acted_in(study):
        _check_transitions(name, exact, agent.world)
    importance = exact_importance(settings.importance, exact, policy, path, settings.random_steps)
    return LayoutReport(
        layout=name,
        num_states=agent.world.num_states,
        num_steps=way.path.num_steps,
        subgoals=way.subgoals,
        key_points={experiment: scene.key_points for experiment, scene in scenes.items() if scene.key_points},
        pictures={
            experiment: {kind: scene.num_pictures(kind) for kind in study.experiment(experiment).kinds}
            for experiment, scene in scenes.items()
        },
        fidelity={
            experiment: arm_fidelities(
                scene, study.experiment(experiment).kinds, agent.world, agent.policy(agent.world), way.path
            )
            for experiment, scene in scenes.items()
        },
        arms_like_subgoals={experiment: scene.arms_like_subgoals() for experiment, scene in scenes.items()},
        max_difference=float(np.max(np.abs(importance.values - way.importance.values))),
        training=agent.training,
    )


def acted_in(study: Study) -> frozenset[str]:
    """Return the layouts in which somebody's own actions are carried out: in practice, in a drive, on `/ask`."""
    if study.ask is not None:
        return frozenset(study.layouts)
    practised = () if study.practice is None else (study.practice.layout,)
    driven = (layout for experiment in study.experiments if experiment.drive for layout in experiment.layouts)
    return frozenset((*practised, *driven))


def _check_transitions(name: str, exact: DeterministicMDP, known: DeterministicMDP) -> None:
    """Refuse a world model that would carry out an action otherwise than the world does."""
    place = np.array([known.index[label] for label in exact.states])
    wrong = np.argwhere(known.next_state[place] != place[exact.next_state])
    if len(wrong):
        state, action = wrong[0]
        raise BuildError(
            f"layout {name!r}: people act in it, and the world model errs there, such as on "
            f"{exact.actions[action]!r} in {exact.states[state]!r}"
        )


def made_with() -> dict[str, Any]:
    """Return what a bundle's bytes may depend on besides the study: Python, packages, processor type."""
    return {
        "python": platform.python_version(),
        "packages": {package: version(package) for package in _PACKAGES},
        "machine": platform.machine(),
        "processor": processor_type(),
    }


def processor_type() -> str:
    """Return the processor's model, or what the platform says of it where it does not tell the model."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return models[0] if models else platform.processor() or platform.machine()


def inputs_digest(agents: str, files: Mapping[str, bytes]) -> str:
    """Hash everything that a bundle follows from, without building it.

    Args:
        agents: What the agents are made by.
        files: All files that the study is built from, as `frozen_files`.

    Returns:
        SHA-256 in hexadecimal: of the study's files, the texts that all studies share, the code, the packages, the
        processor type.
    """
    digest = hashlib.sha256(repr((agents, sorted(made_with().items()))).encode())
    for name, content in sorted([*_code(), *files.items()]):
        digest.update(f"{hashlib.sha256(content).hexdigest()}  {name}\n".encode())
    return digest.hexdigest()


def _code() -> Iterator[tuple[str, bytes]]:
    package = Path(__file__).parents[1]
    for part in _CODE:
        for file in (file for ending in ("py", "toml") for file in (package / part).rglob(f"*.{ending}")):
            yield file.relative_to(package).as_posix(), file.read_bytes()
