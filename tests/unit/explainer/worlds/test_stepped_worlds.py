"""Environments that are copied and stepped: their observations must be all there is to know."""

import sys
import threading
from types import SimpleNamespace
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.wrappers import OrderEnforcing, TimeLimit

from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.solvers import follow, plan
from webapp.explainer.worlds import gymnasium_worlds
from webapp.explainer.worlds.enumeration import enumerate_world
from webapp.explainer.worlds.finite import NotFinite
from webapp.explainer.worlds.stepped_worlds import SteppedWorld

Reply = tuple[Any, float, bool, bool, dict[str, Any]]


class Jugs(gymnasium.Env[Any, Any]):
    """Two jugs of 3 and 5 litres; four litres are wanted in the larger one. The state is what each holds."""

    SIZES = (3, 5)
    action_names = ("fill small", "fill large", "empty small", "empty large", "pour into large", "pour into small")

    def __init__(self, space: gymnasium.Space[Any] | None = None) -> None:
        self.observation_space = space or spaces.MultiDiscrete([4, 6])
        self.action_space = spaces.Discrete(6)
        self.clock = 0

    def observe(self) -> Any:  # noqa: ANN401 - whatever the space holds.
        return np.array(self.litres)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed, options=options)
        self.litres = [0, 0]
        return self.observe(), {}

    def step(self, action: int) -> Reply:
        self.clock += 1
        kind, jug = divmod(action, 2)
        if kind < 2:
            self.litres[jug] = self.SIZES[jug] if kind == 0 else 0
        else:
            into = 1 - jug
            poured = min(self.litres[jug], self.SIZES[into] - self.litres[into])
            self.litres[jug] -= poured
            self.litres[into] += poured
        ended = self.litres[1] == 4
        return self.observe(), float(ended), ended, self.clock > 5, {}


def stepped(env: gymnasium.Env[Any, Any]) -> DeterministicMDP:
    mdp = enumerate_world(SteppedWorld(env, 0, "jugs"))
    assert isinstance(mdp, DeterministicMDP)
    return mdp


def test_the_jugs_are_solved_in_six_pours() -> None:
    mdp = stepped(Jugs())
    # One of the jugs is always full or empty, which leaves 2 * 6 + 2 * 4 - 4 states; from the goal nobody goes on.
    assert set(mdp.states) <= {(s, l) for s in range(4) for l in range(6) if s in (0, 3) or l in (0, 5)}  # noqa: E741
    path = follow(mdp, plan(mdp))
    assert path.num_steps == 6
    assert [mdp.states[state] for state in path.states] == [(0, 0), (0, 5), (3, 2), (0, 2), (2, 0), (2, 5), (3, 4)]
    assert mdp.actions == Jugs.action_names


def test_running_out_of_time_ends_nothing() -> None:
    mdp = stepped(Jugs())
    assert {mdp.states[int(state)][1] for state in np.flatnonzero(mdp.terminal)} == {4}  # type: ignore[index]


class Pair(Jugs):
    """The same, observed as a tuple, a dictionary, a number, a picture or a text."""

    def observe(self) -> Any:  # noqa: ANN401 - as above.
        small, large = self.litres
        return {
            spaces.Tuple: (small, np.int64(large)),
            spaces.Dict: {"small": small, "large": np.array([large])},
            spaces.Discrete: 6 * small + large,
            spaces.Box: np.array([[small], [large]], dtype=np.uint8),
            spaces.Text: f"{small} and {large}",
        }[type(self.observation_space)]


@pytest.mark.parametrize(
    ("space", "start", "after"),
    [
        (spaces.Tuple((spaces.Discrete(4), spaces.Discrete(6))), (0, 0), (3, 0)),
        (spaces.Dict({"small": spaces.Discrete(4), "large": spaces.MultiDiscrete([6])}), ((0,), 0), ((0,), 3)),
        (spaces.Discrete(24), 0, 18),
        (spaces.Box(0, 5, (2, 1), dtype=np.uint8), (0, 0), (3, 0)),
        (spaces.Text(10, charset="0123456 and"), "0 and 0", "3 and 0"),
    ],
)
def test_every_discrete_observation_makes_a_label(space: gymnasium.Space[Any], start: Any, after: Any) -> None:  # noqa: ANN401
    mdp = stepped(Pair(space))
    assert mdp.num_states == stepped(Jugs()).num_states
    assert mdp.states[0] == start
    assert mdp.states[mdp.next_state[0, 0]] == after
    assert np.array_equal(mdp.next_state, stepped(Jugs()).next_state)


class Leaky(Jugs):
    """The third pour of an episode leaks, and no observation says how many there were."""

    pours = 0

    def step(self, action: int) -> Reply:
        self.pours += action > 3
        if self.pours == 3:
            self.litres[0] = 0
        return super().step(action)


class Counted(Jugs):
    """A world of one room that opens its door after many steps, whatever is done."""

    def step(self, action: int) -> Reply:
        reply = super().step(action)
        return (reply[0], float(self.clock == 40), self.clock == 40, False, {})


class Spilling(Jugs):
    """Each step may spill something."""

    def step(self, action: int) -> Reply:
        if self.np_random.random() < 0.5:
            self.litres[0] = 0
        return super().step(action)


@pytest.mark.parametrize("env", [Leaky(), Counted()])
def test_an_observation_that_is_not_the_state_is_refused(env: Jugs) -> None:
    with pytest.raises(NotFinite, match=r"the observation of jugs is not its state: '.*' in \(\d, \d\) led to"):
        stepped(env)


def test_a_step_that_draws_random_numbers_is_refused() -> None:
    with pytest.raises(NotFinite, match=r"'.*' in jugs draws random numbers in \(0, 0\)"):
        stepped(Spilling())


@pytest.mark.parametrize(
    ("observations", "actions", "problem"),
    [
        (spaces.Box(0.0, 5.0, (2,)), spaces.Discrete(6), "continuous observations, .*abstract them"),
        (
            spaces.Dict({"a": spaces.Discrete(2), "b": spaces.Box(0.0, 1.0)}),
            spaces.Discrete(6),
            "continuous observations",
        ),
        (spaces.Sequence(spaces.Discrete(2)), spaces.Discrete(6), "observations of the kind Sequence"),
        (spaces.Discrete(2), spaces.Box(0.0, 1.0), r"has the action space Box\(.* only a Discrete one can be listed"),
        (spaces.Discrete(2), spaces.MultiDiscrete([2, 2]), "only a Discrete one can be listed"),
    ],
)
def test_spaces_without_finitely_many_elements_are_refused(
    observations: gymnasium.Space[Any], actions: gymnasium.Space[Any], problem: str
) -> None:
    env = Jugs(observations)
    env.action_space = actions
    with pytest.raises(NotFinite, match=problem):
        SteppedWorld(env, 0, "jugs")


def test_action_names_must_fit() -> None:
    env = Jugs()
    env.action_names = ("fill", "empty")  # type: ignore[assignment]
    with pytest.raises(ValueError, match="jugs has 6 actions and needs as many action_names, not 2"):
        SteppedWorld(env, 0, "jugs")


def test_actions_may_be_counted_from_another_number() -> None:
    class Shifted(Jugs):
        def __init__(self) -> None:
            super().__init__()
            self.action_space = spaces.Discrete(6, start=10)

        def step(self, action: int) -> Reply:
            return super().step(action - 10)

    assert np.array_equal(stepped(Shifted()).next_state, stepped(Jugs()).next_state)


class EverySecond(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Remembers, beside the environment, how many steps there were: every second one does nothing."""

    steps = 0

    def step(self, action: int) -> Any:  # noqa: ANN401 - Gymnasium's signature.
        self.steps += 1
        if self.steps % 2:
            return super().step(action)
        return self.env.unwrapped.observe(), 0.0, False, False, {}  # type: ignore[attr-defined]


def test_a_memory_in_a_wrapper_is_seen_too() -> None:
    with pytest.raises(NotFinite, match="the observation of jugs is not its state"):
        stepped(EverySecond(Jugs()))


def test_an_environment_that_cannot_be_pickled_is_compared_by_what_it_does() -> None:
    env = Jugs()
    env.callback = lambda: None  # type: ignore[attr-defined]
    assert np.array_equal(stepped(env).next_state, stepped(Jugs()).next_state)


def test_an_environment_that_cannot_be_copied_is_refused() -> None:
    env = Jugs()
    env.lock = threading.Lock()  # type: ignore[attr-defined]
    with pytest.raises(NotFinite, match=r"jugs cannot be copied, .* \(TypeError: cannot pickle"):
        stepped(env)


class Backwards(gymnasium.ActionWrapper[Any, Any, Any]):
    """Takes each action for the one as far from the other end."""

    def action(self, action: int) -> int:
        return 5 - action


def test_a_wrapper_that_changes_a_world_is_part_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "jugs", SimpleNamespace(backwards=lambda: Backwards(Jugs())))
    mdp = enumerate_world(gymnasium_worlds.world_of("jugs:backwards"))
    assert isinstance(mdp, DeterministicMDP)
    plain = stepped(Jugs())
    forwards = {plain.states[state]: row for state, row in enumerate(plain.next_state)}
    for label, row in zip(mdp.states, mdp.next_state, strict=True):
        assert [mdp.states[after] for after in row] == [plain.states[after] for after in forwards[label][::-1]]


def test_wrappers_that_only_watch_are_taken_off(monkeypatch: pytest.MonkeyPatch) -> None:
    watched = lambda: TimeLimit(OrderEnforcing(gymnasium.make("CliffWalking-v1")), 3)
    monkeypatch.setitem(sys.modules, "cliff", SimpleNamespace(watched=watched))
    mdp = enumerate_world(gymnasium_worlds.world_of("cliff:watched"))
    assert mdp.states == enumerate_world(gymnasium_worlds.world_of("CliffWalking-v1")).states


def test_a_big_random_world_comes_out_as_it_is() -> None:
    rng = np.random.default_rng(0)
    table = rng.integers(0, 60, size=(60, 3))

    class Table(gymnasium.Env[Any, Any]):
        observation_space = spaces.Discrete(60)
        action_space = spaces.Discrete(3)

        def reset(self, **_: Any) -> Any:  # noqa: ANN401 - Gymnasium's signature.
            self.at = 0
            return 0, {}

        def step(self, action: int) -> Any:  # noqa: ANN401 - as above.
            self.at = int(table[self.at, action])
            return self.at, float(self.at == 59), self.at == 59, False, {}

    mdp = enumerate_world(SteppedWorld(Table(), 0, "table"))
    assert isinstance(mdp, DeterministicMDP)
    for state, label in enumerate(mdp.states):
        if label != 59:
            assert [mdp.states[after] for after in mdp.next_state[state]] == table[label].tolist()  # type: ignore[call-overload]
