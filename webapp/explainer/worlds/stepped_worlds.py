"""Environments with neither a table nor a grid: copied before each step, their states told apart by observations.

Nothing says that an observation is all there is to know. So whenever a state is met again, the environment as it was
met must do the same as the one met first, and random walks must do what was listed; else the world is refused.
"""

import copy
import hashlib
import pickle
from collections.abc import Hashable, Iterable, Sequence
from typing import Any

import gymnasium

from webapp.explainer.seeding import stream
from webapp.explainer.worlds.finite import GUIDE, NotFinite, Outcome
from webapp.explainer.worlds.spaces import action_names, as_label, check_finite

_NUM_WALKS, _WALK_STEPS = 5, 100

_Env = gymnasium.Env[Any, Any]


class SteppedWorld:
    """The world of an environment that can be copied and whose observations are its states.

    Attributes:
        name: What to call it in messages.
        actions: The names of its actions.
        start: The label of the observation with which an episode begins.

    Args:
        env: The environment.
        seed: Of `reset`.
        name: What to call it in messages.

    Raises:
        NotFinite: The observations or the actions are continuous, a step draws random numbers, or an observation
            does not tell what happens next.
    """

    def __init__(self, env: _Env, seed: int, name: str) -> None:
        check_finite(env.observation_space, name)
        self.name = name
        self.actions: Sequence[str] = action_names(env, name)
        self._first_action = int(getattr(env.action_space, "start", 0))
        self.start: Hashable = as_label(env.observation_space, env.reset(seed=seed)[0])
        self._rows: dict[Hashable, tuple[Outcome, ...]] = {}
        self._waiting: dict[Hashable, dict[Hashable, _Env]] = {}
        self._seen: dict[Hashable, set[Hashable]] = {}
        self._meet(self.start, env)
        self._walk(env, seed)

    def outcomes(self, state: Hashable, action: int) -> Iterable[Outcome]:
        """Copy an environment in this state and step it once.

        Raises:
            NotFinite: The step draws random numbers, or the observation does not tell what happens next.
        """
        if state not in self._rows:
            self._expand(state)
        return (self._rows[state][action],)

    def _expand(self, state: Hashable) -> None:
        """Find out what all actions do, and see that every copy which looks like this state does the same."""
        first, *others = self._waiting.pop(state).values()
        row, after = self._steps(state, first)
        self._rows[state] = row
        for other in others:
            self._agree(state, self._steps(state, other)[0])
        for outcome, env in zip(row, after, strict=True):
            if not outcome.ended:
                self._meet(outcome.state, env)

    def _meet(self, state: Hashable, env: _Env) -> None:
        mark = _fingerprint(env)
        seen = self._seen.setdefault(state, set())
        if mark in seen:
            return
        seen.add(mark)
        if state in self._rows:
            self._agree(state, self._steps(state, env)[0])
        else:
            self._waiting.setdefault(state, {})[mark] = env

    def _steps(self, state: Hashable, env: _Env) -> tuple[tuple[Outcome, ...], list[_Env]]:
        copies = [self._copy(env) for _ in self.actions]
        return tuple(self._step(state, each, action) for action, each in enumerate(copies)), copies

    def _copy(self, env: _Env) -> _Env:
        try:
            return copy.deepcopy(env)
        except Exception as problem:
            raise NotFinite(
                f"{self.name} cannot be copied, so it cannot be restored ({type(problem).__name__}: {problem}): "
                f"name its states through the protocol of {GUIDE}"
            ) from problem

    def _step(self, state: Hashable, env: _Env, action: int) -> Outcome:
        generator = env.unwrapped.np_random.bit_generator
        before = pickle.dumps(generator.state)
        observation, reward, ended, _, _ = env.step(self._first_action + action)
        if pickle.dumps(generator.state) != before:
            raise NotFinite(
                f"{self.actions[action]!r} in {self.name} draws random numbers in {state!r}, so what can happen cannot "
                f"be listed by stepping: give the probabilities through the protocol of {GUIDE}"
            )
        return Outcome(1.0, as_label(env.observation_space, observation), float(reward), bool(ended))

    def _agree(self, state: Hashable, row: tuple[Outcome, ...]) -> None:
        for action, (known, new) in enumerate(zip(self._rows[state], row, strict=True)):
            if known != new:
                raise NotFinite(
                    f"the observation of {self.name} is not its state: {self.actions[action]!r} in {state!r} led to "
                    f"{known[1:]} once and to {new[1:]} another time (state, reward, ended); "
                    f"observe all that matters, or name the states through the protocol of {GUIDE}"
                )

    def _walk(self, start: _Env, seed: int) -> None:
        """Compare what was listed with what happens on random ways, where a memory has time to show."""
        rng = stream(seed, "worlds", "walks")
        for _ in range(_NUM_WALKS):
            env, state = self._copy(start), self.start
            for action in rng.integers(len(self.actions), size=_WALK_STEPS).tolist():
                (listed,) = self.outcomes(state, action)
                happened = self._step(state, env, action)
                if happened != listed:
                    row = list(self._rows[state])
                    row[action] = happened
                    self._agree(state, tuple(row))
                if happened.ended:
                    break
                state = happened.state


def _fingerprint(env: _Env) -> Hashable:
    """Return equal marks for two environments only if all that they hold is equal, wrappers included."""
    held = []
    while isinstance(env, gymnasium.Wrapper):
        held.append({name: value for name, value in vars(env).items() if name != "env"})
        env = env.env
    try:
        return hashlib.blake2b(pickle.dumps([*held, vars(env)]), digest_size=16).hexdigest()
    except (pickle.PicklingError, TypeError, AttributeError):
        return object()  # Nobody can say, so it equals no other and is compared by what it does.
