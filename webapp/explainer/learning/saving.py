"""Trained agents in one safetensors file: the same agents give the same bytes."""

import json
from collections.abc import Sequence
from pathlib import Path

from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file

from webapp.explainer.learning.agent import TrainedAgent
from webapp.explainer.learning.networks import Weights
from webapp.explainer.worlds.layout import Layout

_KEY = "agents"
"""All metadata stand under one key: the format does not fix the order of several."""


def save(agents: Sequence[TrainedAgent], path: Path) -> None:
    """Write agents into a file: weights as `<index>.<network>.<weight>`, facts and maps as JSON metadata."""
    tensors = {
        f"{index}.{network}.{name}": tensor.contiguous()
        for index, agent in enumerate(agents)
        for network, weights in _networks(agent).items()
        for name, tensor in weights.items()
    }
    facts = [{"layout": str(agent.layout), **agent.facts} for agent in agents]
    save_file(tensors, path, metadata={_KEY: json.dumps(facts, sort_keys=True)})


def load(path: Path, layouts: Sequence[Layout]) -> tuple[TrainedAgent, ...]:
    """Read agents back.

    Args:
        path: A file written by `save`.
        layouts: The maps that the agents were trained on, in the order of the agents.

    Raises:
        ValueError: The file is none of ours, or holds agents of other maps.
    """
    try:
        with safe_open(path, framework="pt") as file:
            facts = json.loads((file.metadata() or {})[_KEY])
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - it is no mapping.
    except (SafetensorError, KeyError, json.JSONDecodeError) as error:
        raise ValueError(f"{path} holds no agents: {error}") from error
    if [agent["layout"] for agent in facts] != [str(layout) for layout in layouts]:
        raise ValueError(f"{path} holds agents of other maps")
    return tuple(
        TrainedAgent(
            layout=layout,
            policy_weights=_weights(tensors, f"{index}.policy."),
            model_weights=_weights(tensors, f"{index}.model."),
            **{name: value for name, value in facts[index].items() if name != "layout"},
        )
        for index, layout in enumerate(layouts)
    )


def _networks(agent: TrainedAgent) -> dict[str, Weights]:
    return {"policy": agent.policy_weights, "model": agent.model_weights}


def _weights(tensors: Weights, prefix: str) -> Weights:
    return {name.removeprefix(prefix): tensor for name, tensor in tensors.items() if name.startswith(prefix)}
