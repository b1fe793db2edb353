"""Agents trained for one map on demand, kept on disk by all that their training depends on."""

import hashlib
import json
import secrets
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

from webapp.explainer.worlds.layout import Layout

if TYPE_CHECKING:
    from webapp.explainer.learning import TrainedAgent, TrainingSettings

ReportProgress = Callable[[str, float], None]
"""Takes the name of a stage and how much of it is done, from 0 to 1."""


class NotLearned(ValueError):
    """An agent or a world model was not right when the budget of its training ended."""


def trained_agent(
    layout: Layout, seed: int, cache: Path, progress: ReportProgress, settings: "TrainingSettings | None" = None
) -> "TrainedAgent":
    """Return the agent of a map and a seed, trained now unless the folder has it; loads torch.

    Args:
        layout: The map.
        seed: Of the training, at least 0.
        cache: The folder in which trained networks are kept; it is made when needed.
        progress: Told how much of the training is done.
        settings: How to train; the settings' own defaults when left out.

    Raises:
        NotLearned: The networks did not learn the map within their budget.
    """
    from webapp.explainer import learning  # noqa: PLC0415 - torch is loaded only for what is learned.

    settings = settings or learning.TrainingSettings()
    weights = cache / f"{_fingerprint(layout, settings, seed)}.safetensors"
    if weights.exists():
        return learning.load(weights, [layout])[0]
    try:
        agents = learning.train([layout], settings, [seed], lambda now: progress("training", now.fraction))
    except learning.TrainingFailed as error:
        raise NotLearned(f"the training failed: {error}") from error
    cache.mkdir(mode=0o700, parents=True, exist_ok=True)
    draft = weights.with_name(f"{weights.stem}.{secrets.token_hex(8)}.part")
    learning.save(agents, draft)
    draft.replace(weights)
    return agents[0]


def _fingerprint(layout: Layout, settings: "TrainingSettings", seed: int) -> str:
    """Name what training depends on: the map, the settings, the seed, torch, and the code that learns."""
    core = Path(__file__).parent
    code = hashlib.sha256()
    for source in sorted([*core.glob("learning/*.py"), *core.glob("worlds/*.py"), core / "seeding.py"]):
        code.update(source.read_bytes())
    facts = [str(layout), settings.to_dict(), seed, version("torch"), code.hexdigest()]
    return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()[:32]
