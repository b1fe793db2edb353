"""Gymnasium environments by name, as finite worlds.

Three ways lead from an environment to a world: its own table `P`, MiniGrid's grid, or copying and stepping. A name of
the form `module:callable` stands for a researcher's own environment or world.
"""

import difflib
import inspect
import json
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, cast

import gymnasium
from gymnasium import error
from gymnasium.envs import registration
from gymnasium.wrappers import OrderEnforcing, PassiveEnvChecker, TimeLimit

from webapp.explainer.worlds.finite import GUIDE, FiniteWorld, restrict_actions
from webapp.explainer.worlds.own_worlds import load
from webapp.explainer.worlds.stepped_worlds import SteppedWorld

if TYPE_CHECKING:
    from minigrid.minigrid_env import MiniGridEnv

_AS_JSON = {"True": "true", "False": "false", "None": "null"}

_REFUSALS = (
    error.Error,
    ArithmeticError,
    AssertionError,
    AttributeError,
    ImportError,
    LookupError,
    TypeError,
    ValueError,
)
"""What environments raise when they are made of the wrong options, or without a package that they need."""


def world_of(
    env_id: str, *, seed: int = 0, actions: Sequence[str] | None = None, options: Mapping[str, Any] | None = None
) -> FiniteWorld:
    """Return the world of an environment.

    Args:
        env_id: A registered name such as `FrozenLake-v1`, or `module:callable` for one of your own: what it returns
            is a Gymnasium environment or a `FiniteWorld`.
        seed: Of the environment's `reset`, at least 0: it decides the start, and the map where that is drawn.
        actions: The names of the actions to keep, in the order in which ties are broken; all of them if left out.
        options: What the environment is made with, such as `{"is_slippery": False}`.

    Raises:
        NotFinite: The environment has no finitely many states that can be listed.
        ValueError: There is no such environment or action, or it cannot be made with these options.

    Example:
        >>> from webapp.explainer import enumerate_world, world_of
        >>> lake = world_of("FrozenLake-v1", options={"is_slippery": False})
        >>> lake.actions
        ('left', 'down', 'right', 'up')
        >>> enumerate_world(lake).num_states
        16
    """
    name = env_id if ":" in env_id else resolve_id(env_id)
    made = load(name, options or {}) if ":" in name else make_environment(name, options or {})
    world = adapt(made, seed, name)
    return world if actions is None else restrict_actions(world, actions)


def adapt(made: Any, seed: int, name: str) -> FiniteWorld:  # noqa: ANN401 - an environment or a world, as it comes.
    """Return the world of an environment that was made already; a `FiniteWorld` is its own.

    Args:
        made: The environment, which the world keeps and steps, or the world.
        seed: Of the environment's `reset`, at least 0.
        name: What to call it in messages.

    Raises:
        NotFinite: The environment has no finitely many states that can be listed.
        ValueError: It cannot begin an episode, or the seed is negative.
    """
    if seed < 0:
        raise ValueError(f"the seed must be 0 or larger, not {seed}")
    try:
        world: FiniteWorld = _adapt(made, seed, name) if isinstance(made, gymnasium.Env) else made
    except (error.Error, ImportError) as problem:
        raise ValueError(f"{name} cannot begin an episode: {type(problem).__name__}: {problem}") from problem
    return world


def parse_options(texts: Iterable[str]) -> dict[str, Any]:
    """Read options written as `KEY=VALUE`.

    A value that is JSON (`4`, `false`, `[1, 0, 0]`) or one of Python's `True`, `False` and `None` is read as such, any
    other as text.

    Raises:
        ValueError: There is no `=` or no key, or a key comes twice.
    """
    options: dict[str, Any] = {}
    for text in texts:
        key, sign, value = text.partition("=")
        if not sign or not key.isidentifier():
            raise ValueError(
                f"an option of an environment is written KEY=VALUE, such as is_slippery=false, not {text!r}"
            )
        if key in options:
            raise ValueError(f"the option {key!r} of the environment is given twice; give it once")
        try:
            options[key] = json.loads(_AS_JSON.get(value, value))
        except json.JSONDecodeError:
            options[key] = value
    return options


def resolve_id(env_id: str) -> str:
    """Return the registered name that a name stands for.

    A version that the installed Gymnasium no longer has stands for the newest one (`Taxi-v3` for `Taxi-v4`, which is
    the same without rain), and so does a name without a version.

    Raises:
        ValueError: There is no such environment; the message has the names most like it.
    """
    if env_id not in gymnasium.registry:
        import minigrid  # noqa: F401, PLC0415 - registers its environments, and takes a while.
    if env_id in gymnasium.registry:
        return env_id
    if registration.ENV_ID_RE.fullmatch(env_id):
        namespace, name, version = registration.parse_env_id(env_id)
        newest = registration.find_highest_version(namespace, name)
        if newest is not None and (version is None or version < newest):
            return registration.get_env_id(namespace, name, newest)
    near = difflib.get_close_matches(env_id, gymnasium.registry, n=3)
    hint = f"did you mean {' or '.join(near)}?" if near else f"one of your own is named module:callable ({GUIDE})"
    raise ValueError(f"there is no environment {env_id!r}; {hint}")


def make_environment(env_id: str, options: Mapping[str, Any]) -> gymnasium.Env[Any, Any]:
    """Make a registered environment.

    Args:
        env_id: Its name, as `resolve_id` returns it.
        options: What it is made with.

    Raises:
        ValueError: It cannot be made with these options.
    """
    _refuse_text_for_yes_or_no(env_id, options)
    try:
        made: gymnasium.Env[Any, Any] = gymnasium.make(env_id, disable_env_checker=True, **options)
    except _REFUSALS as problem:
        given = f" with {', '.join(f'{key}={value!r}' for key, value in options.items())}" if options else ""
        raise ValueError(f"{env_id} cannot be made{given}: {type(problem).__name__}: {problem}") from problem
    return made


def _refuse_text_for_yes_or_no(env_id: str, options: Mapping[str, Any]) -> None:
    """Refuse `is_slippery=no`: a text counts as true, so the environment would be the opposite of what was meant."""
    entry = gymnasium.spec(env_id).entry_point
    if entry is None:
        return
    try:
        creator = registration.load_env_creator(entry) if isinstance(entry, str) else entry
    except (error.Error, ImportError):
        return  # Making it says what is missing.
    parameters = inspect.signature(creator).parameters
    for key, value in options.items():
        if key in parameters and isinstance(parameters[key].default, bool) and isinstance(value, str):
            raise ValueError(f"the option {key!r} of {env_id} takes true or false, not {value!r}")


def _adapt(env: gymnasium.Env[Any, Any], seed: int, name: str) -> FiniteWorld:
    """Choose the way from an environment to a world.

    Wrappers that only watch are taken off. Any other is part of the environment, which must then be stepped.
    """
    while isinstance(env, TimeLimit | OrderEnforcing | PassiveEnvChecker):
        env = env.env
    if hasattr(env, "P") and not isinstance(env, gymnasium.Wrapper):
        from webapp.explainer.worlds.tabular_worlds import TableWorld  # noqa: PLC0415 - only where there is one.

        return TableWorld(env, seed, name)
    if any(kind.__module__ == "minigrid.minigrid_env" for kind in type(env).__mro__):
        from webapp.explainer.worlds.minigrid_worlds import MiniGridWorld  # noqa: PLC0415 - loads MiniGrid.

        return MiniGridWorld(cast("MiniGridEnv", env), seed, name)
    return SteppedWorld(env, seed, name)
