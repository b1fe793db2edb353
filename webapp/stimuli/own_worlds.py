"""Worlds of a study's own, in place of a layout: any finite world without chance that can be drawn.

What it must be able to say is what `xar explain` asks of a world (docs/own-environment.md), and on top of that a
picture of each state. docs/plugins.md tells researchers how.
"""

import copy
import inspect
from collections import deque
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from webapp.explainer.mdp import DeterministicMDP, Policy
from webapp.explainer.solvers import plan
from webapp.explainer.worlds.enumeration import TooManyStates, enumerate_world
from webapp.explainer.worlds.finite import Ended, FiniteWorld, own_failures, restrict_actions
from webapp.explainer.worlds.gymnasium_worlds import adapt, make_environment, resolve_id
from webapp.explainer.worlds.own_worlds import make
from webapp.stimuli.own_pictures import as_picture, digest_of
from webapp.stimuli.plug_ins import WORLDS_GROUP, Origin, find, origin_of
from webapp.study.own_parts import GYMNASIUM, OwnWorld

GUIDE = "docs/plugins.md"

MAX_STATES = 5_000
"""A world with more states has more pictures than anybody wants to look at or to keep."""

MAX_ACTION_LENGTH = 16
"""The longest name of an action, in characters, as the data store it."""

_RESERVED = "give_up"
"""What the button sends that ends a drive."""

_Draw = Callable[[int], Any]


@dataclass(frozen=True, slots=True, eq=False)
class ShownWorld:
    """A world of a study's own, as the build needs it.

    Attributes:
        layout: What the study calls it.
        origin: Where it came from.
        table: Its states, actions and where these lead.
        planned: Whether its agent is the exact planner; otherwise the world brings a policy of its own.
        policy: `[S]`, the agent's action in each state.
    """

    layout: str
    origin: Origin
    table: DeterministicMDP
    planned: bool
    policy: Policy
    _draw: _Draw
    _words: Callable[[Hashable, str], str]

    def pictures(self, progress: Callable[[float], None] = lambda _: None) -> tuple[bytes, ...]:
        """Draw each state `[S]`.

        Args:
            progress: Is told how much is done, from 0 to 1.

        Raises:
            ValueError: A state cannot be drawn.
        """
        made: dict[str, bytes] = {}
        pictures = []
        for state in range(self.table.num_states):
            drawn = self._draw(state)
            key = digest_of(drawn)
            if key not in made:
                made[key] = self._picture(state, drawn)
            pictures.append(made[key])
            progress((state + 1) / self.table.num_states)
        return tuple(pictures)

    def describe(self, state: int, language: str) -> str:
        """Put a state, by its index, into words.

        Raises:
            ValueError: The world's own words for it failed, or are none.
        """
        label = _seen(self.table.states[state])
        words = self._words(label, language)
        if not isinstance(words, str) or not words.strip():
            raise ValueError(f"describe gave {words!r} for {label!r}; it should give words")
        return " ".join(words.split())

    def label(self, state: int) -> str:
        """Return a state's label as messages and tables show it."""
        return repr(self.table.states[state])

    def check_first(self, languages: Sequence[str]) -> None:
        """Draw and describe the start, so that what is missing altogether is told before anything is built.

        Raises:
            ValueError: It cannot be drawn or described.
        """
        self._picture(self.table.start, self._draw(self.table.start))
        for language in languages:
            self.describe(self.table.start, language)

    def _picture(self, state: int, drawn: Any) -> bytes:  # noqa: ANN401 - whatever was drawn.
        try:
            return as_picture(drawn)
        except ValueError as problem:
            raise ValueError(f"the picture of {self.label(state)}: {problem}") from None


def load_world(layout: str, declared: OwnWorld, languages: Sequence[str], folder: Path) -> ShownWorld:
    """Load a world that a study declares, within `plug_ins.study_modules`.

    Args:
        layout: What the study calls it.
        declared: How the study file declares it.
        languages: Those of the study.
        folder: The study's folder.

    Raises:
        ValueError: It cannot be loaded, or it is none that can be shown; the message says why.
    """
    made, origin = _made(declared, folder)
    own: Any = getattr(made, "unwrapped", made)
    drawn = made if callable(getattr(own, "picture", None)) else copy_of(made, declared, folder)
    full = adapt(made, declared.seed, declared.use)
    world = restrict_actions(full, declared.actions) if declared.actions else full
    table = _table(world, declared.use)
    _check_actions(table.actions)
    chosen = [list(full.actions).index(name) for name in table.actions]
    shown = ShownWorld(
        layout=layout,
        origin=origin,
        table=table,
        planned=not callable(getattr(own, "policy", None)),
        policy=_policy(own, table),
        _draw=_drawing(own, drawn, table, chosen, declared.seed),
        _words=_wording(own, full, languages),
    )
    shown.check_first(languages)
    return shown


def copy_of(made: Any, declared: OwnWorld, folder: Path) -> Any:  # noqa: ANN401 - an environment, as it comes.
    """Return the same environment once more, to be drawn while the other is stepped."""
    if declared.use.startswith(GYMNASIUM) or callable(find(declared.use, WORLDS_GROUP, folder)):
        return _made(declared, folder)[0]
    return copy.deepcopy(made)


def _made(declared: OwnWorld, folder: Path) -> tuple[Any, Origin]:
    """Make the world or environment, so that it can be drawn if it is one of Gymnasium's."""
    if declared.use.startswith(GYMNASIUM):
        name = resolve_id(declared.use.removeprefix(GYMNASIUM))
        env = make_environment(name, {"render_mode": "rgb_array", **declared.options})
        return env, origin_of(declared.use, type(env.unwrapped), folder)
    found = find(declared.use, WORLDS_GROUP, folder)
    options = dict(declared.options)
    if callable(found) and _takes(found, "render_mode"):
        options.setdefault("render_mode", "rgb_array")
    return make(found, declared.use, options), origin_of(declared.use, found, folder)


def _takes(function: Callable[..., Any], parameter: str) -> bool:
    try:
        return parameter in inspect.signature(function).parameters
    except (TypeError, ValueError):
        return False  # Something not written in Python.


def _table(world: FiniteWorld, use: str) -> DeterministicMDP:
    try:
        mdp = enumerate_world(world, max_states=MAX_STATES)
    except TooManyStates:
        wish = "take a smaller world, or see that no way leads on for ever"
        raise ValueError(f"{use} has more than {MAX_STATES} states, and each is drawn; {wish}") from None
    if not isinstance(mdp, DeterministicMDP):
        raise ValueError(  # noqa: TRY004 - the type only says which world it is.
            f"in {use} chance decides where actions lead, and a study shows what certainly follows; take a world "
            "without chance (FrozenLake: options = { is_slippery = false })"
        )
    return mdp


def _check_actions(actions: Sequence[str]) -> None:
    for name in actions:
        if len(name) > MAX_ACTION_LENGTH or not name.isprintable() or name == _RESERVED:
            wish = f"use up to {MAX_ACTION_LENGTH} printable characters, and not {_RESERVED!r}"
            raise ValueError(f"an action is called {name!r}; {wish}")


def _policy(own: Any, table: DeterministicMDP) -> Policy:  # noqa: ANN401 - a world or an environment.
    choose = getattr(own, "policy", None)
    if not callable(choose):
        return plan(table)
    actions = np.zeros(table.num_states, dtype=np.int32)
    for state, label in enumerate(table.states):
        if not table.terminal[state]:
            with own_failures(f"{type(own).__name__}.policy", f"for {label!r}"):
                name = choose(label)
            if name not in table.actions:
                raise ValueError(f"policy gave {name!r} for {label!r}; the actions are {', '.join(table.actions)}")
            actions[state] = table.actions.index(name)
    return actions


def _wording(own: Any, world: Any, languages: Sequence[str]) -> Callable[[Hashable, str], str]:  # noqa: ANN401 - as above.
    """Return what puts a label into words: the world's own, those of its adapter, else the label as it is."""
    describe = getattr(own, "describe", None) or getattr(world, "describe", None)
    if describe is None:
        return lambda label, _: _label_in_words(label)
    called = f"{type(own).__name__}.describe"
    takes_language = _takes(describe, "language")
    if not takes_language and len(languages) > 1:
        raise ValueError(
            f"{called} has words in one language, and the study has {', '.join(languages)}; "
            f"give it describe(state, language), see {GUIDE}"
        )

    def words(label: Hashable, language: str) -> str:
        with own_failures(called, f"for {label!r}"):
            said: str = describe(label, language=language) if takes_language else describe(label)
        return said

    return words


def _label_in_words(label: Hashable) -> str:
    """Return a label with the names of its components, where it has names."""
    fields: Sequence[str] = getattr(label, "_fields", ())
    if not fields or not isinstance(label, tuple):
        return str(label)
    return ", ".join(f"{name} {value}" for name, value in zip(fields, label, strict=True))


def _drawing(own: Any, env: Any, table: DeterministicMDP, actions: Sequence[int], seed: int) -> _Draw:  # noqa: ANN401
    """Return what draws a state: the world's own `picture`, else the environment's `render` on the way there."""
    picture = getattr(own, "picture", None)
    if callable(picture):

        def draw(state: int) -> Any:  # noqa: ANN401 - whatever the researcher's code draws.
            label = _seen(table.states[state])
            with own_failures(f"{type(own).__name__}.picture", f"for {label!r}"):
                return picture(label)

        return draw
    if getattr(env, "render_mode", None) != "rgb_array":
        raise ValueError(
            f"{type(own).__name__} cannot be drawn: give it picture(state), or the render_mode 'rgb_array' if it is a "
            f"Gymnasium environment, see {GUIDE}"
        )
    ways, first = _ways(table), int(getattr(env.action_space, "start", 0))
    return lambda state: _rendered(env, [first + actions[action] for action in ways[state]], seed)


def _rendered(env: Any, way: Sequence[int], seed: int) -> Any:  # noqa: ANN401 - as above.
    """Let an environment draw the state to which actions lead.

    Gymnasium's own small worlds also draw the latest action, which is no part of a state; they are told of none.
    """
    with own_failures(f"{type(env.unwrapped).__name__}.render", f"after {len(way)} actions"):
        env.reset(seed=seed)
        for action in way:
            env.step(action)
        if hasattr(env.unwrapped, "lastaction"):
            env.unwrapped.lastaction = None
        return env.render()


def _ways(table: DeterministicMDP) -> Mapping[int, tuple[int, ...]]:
    """Return shortest ways from the start to all states, as action indices."""
    ways: dict[int, tuple[int, ...]] = {table.start: ()}
    queue = deque([table.start])
    while queue:
        state = queue.popleft()
        for action, after in enumerate(table.next_state[state].tolist()):
            if after not in ways:
                ways[after] = (*ways[state], action)
                queue.append(after)
    return ways


def _seen(label: Hashable) -> Hashable:
    """Return what a state looks like; an end that looks like another state is drawn and described like it."""
    return label.state if isinstance(label, Ended) else label
