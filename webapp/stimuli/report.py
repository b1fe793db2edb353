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
from webapp.explainer.solvers import follow
from webapp.explainer.worlds.key_door import tabulate
from webapp.explainer.worlds.layout import Layout
from webapp.stimuli.agents import Agent, BuildError
from webapp.stimuli.scenes import Scene, Walk
from webapp.study.protocol import ExplanationSettings

_PACKAGES = ("gymnasium", "minigrid", "numpy", "pillow", "safetensors", "torch")
"""The packages whose version can change a bundle's bytes."""

_CODE = ("explainer", "stimuli", "study")
"""The packages of this project whose code can."""


@dataclass(frozen=True, slots=True)
class LayoutReport:
    """What came out for one layout.

    Attributes:
        layout: Its name.
        num_states: How many states can be reached.
        num_steps: The length of the agent's path.
        subgoals: Steps from 1.
        key_points: By experiment: the steps that answer its question.
        max_difference: The largest absolute difference between the importance in the agent's world and in the exact
            table, over the states of the path.
        training: What is to be reported of the agent's training; empty when nothing was trained.
    """

    layout: str
    num_states: int
    num_steps: int
    subgoals: Sequence[int]
    key_points: Mapping[str, Sequence[int]]
    max_difference: float
    training: Mapping[str, Any]

    def to_json(self) -> dict[str, Any]:
        """Return the report as plain JSON values, which `LayoutReport(**content)` reads back."""
        return asdict(self)


def report_on(
    name: str, layout: Layout, agent: Agent, way: Walk, scenes: Mapping[str, Scene], settings: ExplanationSettings
) -> LayoutReport:
    """Compare what was explained with the exact world.

    Raises:
        BuildError: The agent's world has other states than the exact one, or its path is another there.
    """
    exact = tabulate(layout)
    if set(exact.states) != set(agent.world.states):
        raise BuildError(f"layout {name!r}: the world model reaches other states than the world itself")
    policy = agent.policy(exact)
    path = follow(exact, policy)
    if [exact.states[state] for state in path.states] != [agent.world.states[state] for state in way.path.states]:
        raise BuildError(f"layout {name!r}: the agent's path in its world model is not its path in the world itself")
    importance = exact_importance(settings.importance, exact, policy, path, settings.random_steps)
    return LayoutReport(
        layout=name,
        num_states=agent.world.num_states,
        num_steps=way.path.num_steps,
        subgoals=way.subgoals,
        key_points={experiment: scene.key_points for experiment, scene in scenes.items() if scene.key_points},
        max_difference=float(np.max(np.abs(importance.values - way.importance.values))),
        training=agent.training,
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


def inputs_digest(study_folder: Path, agents: str) -> str:
    """Hash everything that a bundle follows from, without building it.

    Args:
        study_folder: The study's files.
        agents: What the agents are made by.

    Returns:
        SHA-256 in hexadecimal: of the study's files, the code, the packages, the processor type.
    """
    digest = hashlib.sha256(repr((agents, sorted(made_with().items()))).encode())
    for root, file in _inputs(study_folder):
        content = hashlib.sha256(file.read_bytes()).hexdigest()
        digest.update(f"{content}  {file.relative_to(root).as_posix()}\n".encode())
    return digest.hexdigest()


def _inputs(study_folder: Path) -> Iterator[tuple[Path, Path]]:
    package = Path(__file__).parents[1]
    for part in _CODE:
        yield from ((package, file) for file in sorted((package / part).rglob("*.py")))
    files = [study_folder / "study.toml", *study_folder.glob("layouts/*.txt"), *study_folder.glob("texts/*.toml")]
    yield from ((study_folder, file) for file in sorted(files))
