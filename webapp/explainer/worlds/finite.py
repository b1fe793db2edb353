"""Any finite world, as the explainer takes it in: what it must be able to say.

`FiniteWorld` is the whole of it; docs/own-environment.md shows one being written and explained. The adapters of
Gymnasium environments beside this module are such worlds too, and `enumeration` makes an MDP of any of them.
"""

import traceback
from collections.abc import Hashable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Protocol, runtime_checkable

GUIDE = "docs/own-environment.md"
"""Where the messages send a researcher whose environment cannot be taken as it is."""


class NotFinite(ValueError):
    """An environment cannot be taken in as it is; the message says why and names the way out."""


class Outcome(NamedTuple):
    """One of the things that can happen after an action.

    Attributes:
        probability: In [0, 1]; those of an action sum to 1.
        state: Any hashable label. Components of a tuple are the facts that hold in the state.
        reward: What it pays.
        ended: Whether the episode ends there. What stops an episode for lack of time is no end of this kind.

    Example:
        >>> from webapp.explainer import Outcome
        >>> Outcome(0.8, ("kettle", "hot"))
        Outcome(probability=0.8, state=('kettle', 'hot'), reward=0.0, ended=False)
    """

    probability: float
    state: Hashable
    reward: float = 0.0
    ended: bool = False


@runtime_checkable
class FiniteWorld(Protocol):
    """What a world has to say.

    Three more members are used where a world has them. `is_goal(state) -> bool` decides which states are goals; the
    episode ends there. Without it the goals are the ends that are entered with the highest reward of any end, so that
    FrozenLake's holes, which pay 0, are none; `least_goal_reward`, a number, is what such an end must pay at least.
    `describe(state) -> str` puts a state into words.

    Example:
        >>> from webapp.explainer import FiniteWorld, Outcome
        >>> class Tower:
        ...     actions, start = ("down", "up"), 0
        ...     def outcomes(self, floor, action):
        ...         return [Outcome(1.0, max(floor - 1, 0) if action == 0 else floor + 1)]
        ...     def is_goal(self, floor):
        ...         return floor == 3
        ...
        >>> world: FiniteWorld = Tower()
        >>> [outcome.state for outcome in world.outcomes(2, 1)]
        [3]
    """

    @property
    def actions(self) -> Sequence[str]:
        """The names of the actions; ties are broken by their order."""
        ...

    @property
    def start(self) -> Hashable:
        """The state in which an episode begins."""
        ...

    def outcomes(self, state: Any, action: int) -> Iterable[Outcome]:  # noqa: ANN401 - each world has its own.
        """List what can happen after an action, by its index, in a state that has not ended."""
        ...


class Ended(NamedTuple):
    """The label of an end that looks like another state: the episode may also pass it, or end there in another way.

    Attributes:
        state: What it looks like.
        in_goal: Whether the goal was reached by ending there.
    """

    state: Hashable
    in_goal: bool

    def __str__(self) -> str:
        return f"{self.state}, ended {'in the goal' if self.in_goal else 'without the goal'}"


def describe_state(world: FiniteWorld, label: Hashable) -> str:
    """Put a state into the world's own words, or show its label where the world has none.

    Args:
        world: The world that was enumerated.
        label: A label of its MDP.

    Raises:
        ValueError: The world's own `describe` failed.

    Example:
        >>> from webapp.explainer import describe_state, world_of
        >>> lake = world_of("FrozenLake-v1")
        >>> describe_state(lake, lake.start)
        'row 0, column 0: the start'
    """
    if isinstance(label, Ended):
        return f"{describe_state(world, label.state)}; ended {'in the goal' if label.in_goal else 'without the goal'}"
    describe = getattr(world, "describe", None)
    if describe is None:
        return repr(label)
    with own_failures(f"{type(world).__name__}.describe", f"for {label!r}"):
        return " ".join(str(describe(label)).split())


@contextmanager
def own_failures(called: str, about: str) -> Iterator[None]:
    """Say in one line what went wrong in a researcher's own code, and where; its traceback stays attached.

    Args:
        called: What was called, such as `Machine.outcomes`.
        about: For what.

    Raises:
        ValueError: Something was raised; a `ValueError` passes as it is.
    """
    try:
        yield
    except ValueError:
        raise
    except Exception as problem:
        place = traceback.extract_tb(problem.__traceback__)[-1]
        where = f"{Path(place.filename).name}, line {place.lineno}"
        raise ValueError(f"{called} raised {problem!r} {about} ({where})") from problem


def restrict_actions(world: FiniteWorld, names: Sequence[str]) -> FiniteWorld:
    """Return the same world with some of its actions only, in the order given.

    Raises:
        ValueError: There is no such action, one is named twice, or none is named.
    """
    if not names:
        raise ValueError(f"name at least one action; this world has {', '.join(world.actions)}")
    for place, name in enumerate(names):
        if name not in world.actions:
            raise ValueError(f"{name!r} is no action of this world; it has {', '.join(world.actions)}")
        if name in names[:place]:
            raise ValueError(f"the action {name!r} is named twice; name each once")
    return _Restricted(world, tuple(names), tuple(list(world.actions).index(name) for name in names))


@dataclass(frozen=True, slots=True)
class _Restricted:
    """A world with some of its actions; all else is asked of the world itself."""

    world: FiniteWorld
    actions: tuple[str, ...]
    chosen: tuple[int, ...]

    @property
    def start(self) -> Hashable:
        return self.world.start

    def outcomes(self, state: Hashable, action: int) -> Iterable[Outcome]:
        return self.world.outcomes(state, self.chosen[action])

    def __getattr__(self, name: str) -> object:
        return getattr(self.world, name)
