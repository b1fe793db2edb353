"""Any finite world: what becomes of it, and how it is told that it contradicts itself."""

from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.mdps import mdps
from tests.stochastic_mdps import FractionWorld, as_mdp, fraction_worlds
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.stochastic import StochasticMDP
from webapp.explainer.worlds.enumeration import enumerate_world
from webapp.explainer.worlds.finite import Ended, FiniteWorld, Outcome, describe_state, restrict_actions


@dataclass
class Told:
    """A world told by a dictionary: what can happen after (state, action name)."""

    rules: Any
    start: Hashable = "a"
    actions: Sequence[str] = field(default=("go",))

    def outcomes(self, state: Hashable, action: int) -> Iterable[Outcome]:
        row: Iterable[Outcome] = self.rules[state, self.actions[action]]
        return row


@dataclass
class ToldWithGoals(Told):
    """The same, which says what its goals are."""

    goals: frozenset[Hashable] = frozenset()

    def is_goal(self, state: Hashable) -> bool:
        return state in self.goals


class Staircase:
    """Steps without an end, taken up or down."""

    actions = ("up", "down")
    start = 0

    def outcomes(self, state: int, action: int) -> list[Outcome]:
        return [Outcome(1.0, state + (1, -1)[action])]


class Copy:
    """The world of an MDP, asked state by state."""

    def __init__(self, mdp: StochasticMDP) -> None:
        self._mdp, self.actions, self.start = mdp, mdp.actions, mdp.states[mdp.start]

    def outcomes(self, state: Hashable, action: int) -> Iterable[Outcome]:
        mdp = self._mdp
        row = mdp.index[state] * mdp.num_actions + action
        for place in range(mdp.row_start[row], mdp.row_start[row + 1]):
            after = mdp.next_state[place]
            reward = 0.0 if mdp.reward is None else mdp.reward[mdp.index[state], action]
            yield Outcome(mdp.probability[place], mdp.states[after], reward, bool(mdp.terminal[after]))

    def is_goal(self, state: Hashable) -> bool:
        return bool(self._mdp.goal[self._mdp.index[state]])


def end(probability: float = 1.0, state: Hashable = "end", reward: float = 1.0) -> Outcome:
    return Outcome(probability, state, reward, ended=True)


def same_chances(new: StochasticMDP, old: StochasticMDP) -> None:
    """Compare the states that both have, whatever their order."""
    for state, label in enumerate(new.states):
        for action in range(new.num_actions):
            row, known = state * new.num_actions + action, old.index[label] * old.num_actions + action
            entries, others = (
                {
                    world.states[world.next_state[place]]: world.probability[place]
                    for place in range(world.row_start[index], world.row_start[index + 1])
                }
                for world, index in ((new, row), (old, known))
            )
            assert entries == pytest.approx(others)


def reached_from(mdp: DeterministicMDP, start: int) -> set[int]:
    reached, frontier = {start}, {start}
    while frontier:
        frontier = {int(after) for state in frontier for after in mdp.next_state[state]} - reached
        reached |= frontier
    return reached


@given(fraction_worlds())
def test_a_world_that_is_asked_state_by_state_comes_out_as_it_was(world: FractionWorld) -> None:
    mdp = as_mdp(world)
    reached, frontier = {0}, {0}
    while frontier:
        frontier = {t for s in frontier for a in range(world.num_actions) for t in world.outcomes[s, a]} - reached
        reached |= frontier
    if mdp.goal[0] or mdp.terminal[0] or not reached & world.goals:
        return
    found = enumerate_world(Copy(mdp))
    assert set(found.states) == {f"s{state}" for state in reached}
    assert found.states[found.start] == "s0"
    for label, terminal, goal in zip(found.states, found.terminal, found.goal, strict=True):
        assert (terminal, goal) == (mdp.terminal[mdp.index[label]], mdp.goal[mdp.index[label]])
    if isinstance(found, StochasticMDP):
        same_chances(found, mdp)
        assert found.reward is not None
        assert mdp.reward is not None
        for label, rewards in zip(found.states, found.reward, strict=True):
            assert rewards == pytest.approx(mdp.reward[mdp.index[label]])
    else:
        certain = [len(world.outcomes[s, a]) == 1 for s in reached for a in range(world.num_actions)]
        assert all(certain)


@given(mdps())
def test_a_world_without_chance_becomes_a_deterministic_one(mdp: DeterministicMDP) -> None:
    rules = {
        (state, name): [
            Outcome(0.25, after, 0.0, bool(mdp.terminal[after])),
            Outcome(0.75, after, 0.0, bool(mdp.terminal[after])),
            Outcome(0.0, "never heard of", 0.0),
        ]
        for state in range(mdp.num_states)
        for name, after in zip(mdp.actions, mdp.next_state[state].tolist(), strict=True)
    }
    goals = frozenset(np.flatnonzero(mdp.goal).tolist())
    world = ToldWithGoals(rules, mdp.start, mdp.actions, goals)
    if mdp.terminal[mdp.start]:
        return
    if not mdp.goal[list(reached_from(mdp, mdp.start))].any():
        with pytest.raises(ValueError, match="no goal can be reached"):
            enumerate_world(world)
        return
    found = enumerate_world(world)
    assert isinstance(found, DeterministicMDP)
    for state, label in enumerate(found.states):
        assert isinstance(label, int)
        assert [found.states[after] for after in found.next_state[state]] == mdp.next_state[label].tolist()


def test_states_are_numbered_breadth_first_and_in_the_order_of_the_actions() -> None:
    tree = {(s, n): [Outcome(1.0, 2 * s + i, 0.0, s > 3)] for s in range(1, 8) for i, n in enumerate(("left", "right"))}
    found = enumerate_world(Told(dict(tree), 1, ("left", "right")))
    assert found.states == tuple(range(1, 16))


def test_the_ends_that_pay_most_are_the_goals() -> None:
    row = [end(0.5, "hole", 0.0), end(0.25, "coin", 1.0), end(0.25, "prize", 2.0)]
    found = enumerate_world(Told({("a", "go"): row}))
    assert dict(zip(found.states, found.goal.tolist(), strict=True)) == {
        "a": False,
        "hole": False,
        "coin": False,
        "prize": True,
    }
    assert found.terminal.tolist() == [False, True, True, True]


def test_where_every_end_costs_the_cheapest_is_the_goal() -> None:
    found = enumerate_world(Told({("a", "go"): [end(0.5, "far", -9.0), end(0.5, "near", -1.0)]}))
    assert [label for label, goal in zip(found.states, found.goal, strict=True) if goal] == ["near"]


def test_a_world_may_say_itself_what_its_goals_are_and_the_episode_ends_there() -> None:
    rules = {("a", "go"): [Outcome(0.5, "b"), end(0.5, "paid", 9.0)], ("b", "go"): [Outcome(1.0, "a")]}
    found = enumerate_world(ToldWithGoals(rules, goals=frozenset({"b"})))
    assert dict(zip(found.states, found.goal.tolist(), strict=True)) == {"a": False, "b": True, "paid": False}
    assert found.terminal.tolist() == [False, True, True]


def test_an_end_that_looks_like_another_state_is_kept_apart_and_reads_well() -> None:
    rules = {
        ("a", "go"): [Outcome(0.5, "b"), end(0.25, "b", 1.0), end(0.25, "b", 0.0)],
        ("b", "go"): [Outcome(1.0, "a")],
    }
    world = Told(rules)
    found = enumerate_world(world)
    assert found.states == ("a", "b", Ended("b", in_goal=True), Ended("b", in_goal=False))
    assert found.terminal.tolist() == [False, False, True, True]
    assert found.goal.tolist() == [False, False, True, False]
    assert str(found.states[2]) == "b, ended in the goal"
    assert describe_state(world, found.states[3]) == "'b'; ended without the goal"


def test_expected_rewards_are_kept() -> None:
    rules = {
        ("a", "go"): [end(0.5, "won", 10.0), Outcome(0.3, "a", -1.0), Outcome(0.2, "a", -3.0)],
        ("a", "stay"): [Outcome(1.0, "a", -0.5)],
    }
    found = enumerate_world(Told(rules, actions=("go", "stay")))
    assert isinstance(found, StochasticMDP)
    assert found.reward is not None
    assert found.reward[0] == pytest.approx([0.5 * 10 - 0.3 - 0.6, -0.5])
    assert not found.reward[1].any()


def test_a_state_is_described_in_the_worlds_own_words_if_it_has_any() -> None:
    class Worded(Told):
        def describe(self, state: Hashable) -> str:
            return f"the state called {state}"

    rules = {("a", "go"): [Outcome(0.5, "b"), end(0.5, "b")], ("b", "go"): [Outcome(1.0, "a")]}
    world = Worded(rules)
    assert describe_state(world, "a") == "the state called a"
    assert describe_state(world, Ended("b", in_goal=True)) == "the state called b; ended in the goal"
    assert describe_state(Told(rules), ("x", 1)) == "('x', 1)"


Rules = dict[tuple[Hashable, str], Iterable[Any]]


@pytest.mark.parametrize(
    ("rules", "problem"),
    [
        ({("a", "go"): [Outcome(float("nan"), "b")]}, "number from 0 to 1, not nan after 'go' in 'a'"),
        ({("a", "go"): [Outcome(-0.5, "b"), Outcome(1.5, "c")]}, "number from 0 to 1, not -0.5 after 'go' in 'a'"),
        ({("a", "go"): [Outcome(1.5, "b")]}, "number from 0 to 1, not 1.5 after 'go' in 'a'"),
        ({("a", "go"): [Outcome(0.5, "b"), Outcome(0.4, "c")]}, "after 'go' in 'a' must sum to 1, not 0.9"),
        ({("a", "go"): []}, "after 'go' in 'a' must sum to 1, not 0.0"),
        ({("a", "go"): [Outcome(1.0, "b")], ("b", "go"): [(0.5,)]}, r"and after 'go' in 'b' is \(0.5,\)"),
        ({("a", "go"): [7]}, "and after 'go' in 'a' is 7"),
        ({("a", "go"): [Outcome(1.0, ["b"])]}, r"the state after 'go' in 'a' must be hashable, .* \['b'\] is not"),  # type: ignore[arg-type]
        ({("a", "go"): [end(reward=float("inf"))]}, "a reward must be a finite number, not inf after 'go' in 'a'"),
        ({("a", "go"): [Outcome(1.0, "a")]}, "no goal can be reached from the start 'a': no episode ever ends"),
    ],
)
def test_a_world_that_contradicts_itself_is_refused_by_state_and_action(rules: Rules, problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        enumerate_world(Told(rules))


@pytest.mark.parametrize(
    ("actions", "problem"),
    [
        ((), r"a list of named actions, not \(\)"),
        ("go", "a list of named actions, not 'go'"),
        (("go", ""), "a list of named actions"),
        (("go", "go"), "different names, not go, go"),
    ],
)
def test_actions_need_names(actions: Sequence[str], problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        enumerate_world(Told({("a", "go"): [end()]}, actions=actions))


def test_a_start_that_is_no_label_or_over_at_once_is_refused() -> None:
    with pytest.raises(ValueError, match=r"the start must be hashable, such as a tuple, and \['a'\] is not"):
        enumerate_world(Told({}, start=["a"]))  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="the start 'a' is a goal, so the episode has ended before it begins"):
        enumerate_world(ToldWithGoals({}, goals=frozenset({"a"})))


def test_goals_out_of_reach_are_told() -> None:
    with pytest.raises(ValueError, match="is_goal holds for none of the ends in reach"):
        enumerate_world(ToldWithGoals({("a", "go"): [end()]}, goals=frozenset({"elsewhere"})))
    world = Told({("a", "go"): [end(reward=0.0)]})
    world.least_goal_reward = 1  # type: ignore[attr-defined]
    with pytest.raises(ValueError, match="the best end in reach pays 0, and a goal pays 1 or more"):
        enumerate_world(world)


def test_too_many_states_are_refused_with_the_limit_and_the_way_out() -> None:
    with pytest.raises(ValueError, match=r"more than 50 states .* abstract .*own-environment.md.*--max-states"):
        enumerate_world(Staircase(), max_states=50)
    with pytest.raises(ValueError, match="must be 1 or larger, not 0"):
        enumerate_world(Staircase(), max_states=0)


@given(st.integers(1, 40))
def test_a_world_of_exactly_as_many_states_as_allowed_passes(size: int) -> None:
    rules: Rules = {(s, "go"): [Outcome(1.0, s + 1, 0.0, s + 1 == size)] for s in range(size)}
    assert enumerate_world(Told(rules, 0), max_states=size + 1).num_states == size + 1
    with pytest.raises(ValueError, match=f"more than {size} states"):
        enumerate_world(Told(rules, 0), max_states=size)


def test_actions_are_chosen_and_ordered_by_name() -> None:
    rules: Rules = {("a", name): [end(state=name)] for name in ("x", "y", "z")}
    chosen = restrict_actions(ToldWithGoals(rules, "a", ("x", "y", "z"), frozenset({"y", "z"})), ["z", "x"])
    assert isinstance(chosen, FiniteWorld)
    found = enumerate_world(chosen)
    assert found.actions == ("z", "x")
    assert found.states == ("a", "z", "x")
    assert found.goal.tolist() == [False, True, False]


@pytest.mark.parametrize(
    ("names", "problem"),
    [
        (["w"], "'w' is no action of this world; it has x, y"),
        (["x", "x"], "'x' is named twice"),
        ([], "name at least one action; this world has x, y"),
    ],
)
def test_unknown_actions_are_refused(names: list[str], problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        restrict_actions(Told({}, actions=("x", "y")), names)


def test_what_lacks_a_member_is_no_world() -> None:
    make: Callable[[], object] = object
    assert isinstance(Staircase(), FiniteWorld)
    assert not isinstance(make(), FiniteWorld)


def test_thousands_of_states_are_reported_as_they_are_found() -> None:
    class Line:
        actions = ("on",)
        start = 0

        def outcomes(self, state: int, action: int) -> list[Outcome]:  # noqa: ARG002
            return [Outcome(1.0, state + 1, 0.0, state == 11_000)]

    told: list[int] = []
    assert enumerate_world(Line(), progress=told.append).num_states == 11_002
    assert told == [5_001, 10_001]
