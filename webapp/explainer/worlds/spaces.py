"""Which of Gymnasium's spaces hold finitely many things, and what their elements are called."""

from collections.abc import Hashable, Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from webapp.explainer.worlds.finite import GUIDE, NotFinite


def action_names(env: gymnasium.Env[Any, Any], name: str, known: Sequence[str] | None = None) -> tuple[str, ...]:
    """Return the names of an environment's actions: its own `action_names`, those that are known, or their numbers.

    Args:
        env: The environment.
        name: What to call it in messages.
        known: Names from elsewhere, at least as many as there are actions.

    Raises:
        NotFinite: The actions cannot be listed.
        ValueError: There are more or fewer names than actions.
    """
    space = env.action_space
    if not isinstance(space, spaces.Discrete):
        raise NotFinite(
            f"{name} has the action space {space}, and only a Discrete one can be listed; "
            f"choose finitely many actions, for example through the protocol of {GUIDE}"
        )
    count = int(space.n)
    own = getattr(env, "action_names", None)
    if own is not None:
        if len(own) != count:
            raise ValueError(f"{name} has {count} actions and needs as many action_names, not {len(own)}")
        return tuple(own)
    return tuple(known[:count]) if known is not None else tuple(f"action {action}" for action in range(count))


def check_finite(space: gymnasium.Space[Any], name: str) -> None:
    """Refuse observations that are continuous, or that cannot be told apart by looking at numbers.

    Raises:
        NotFinite: The observations cannot be states.
    """
    parts = _parts(space)
    if parts is not None:
        for part in parts:
            check_finite(part, name)
        return
    if isinstance(space, spaces.Box):
        if not np.issubdtype(space.dtype, np.integer):
            raise NotFinite(
                f"{name} has continuous observations, {space}, and only finitely many states can be explained: "
                f"abstract them, for example into bins, through the protocol of {GUIDE}"
            )
    elif not isinstance(space, spaces.Discrete | spaces.MultiDiscrete | spaces.MultiBinary | spaces.Text):
        raise NotFinite(
            f"{name} has observations of the kind {space}, which cannot be told apart as states: "
            f"name its states through the protocol of {GUIDE}"
        )


def as_label(space: gymnasium.Space[Any], observation: Any) -> Hashable:  # noqa: ANN401 - whatever the space holds.
    """Make a hashable label of an observation, with one component per number where it has several."""
    if isinstance(space, spaces.Dict):
        return tuple(as_label(part, observation[key]) for key, part in space.spaces.items())
    if isinstance(space, spaces.Tuple):
        return tuple(as_label(part, each) for part, each in zip(space.spaces, observation, strict=True))
    if isinstance(space, spaces.Discrete):
        return int(observation)
    if isinstance(space, spaces.Text):
        return str(observation)
    return tuple(np.asarray(observation).ravel().tolist())


def _parts(space: gymnasium.Space[Any]) -> Sequence[gymnasium.Space[Any]] | None:
    if isinstance(space, spaces.Dict):
        return tuple(space.spaces.values())
    return space.spaces if isinstance(space, spaces.Tuple) else None
