"""Whether sub-rewards can be earned again, and whether they turn an agent away from the goal."""

from functools import cache
from itertools import product

import numpy as np
import pytest

from webapp.explainer.mdp import StateAction
from webapp.simulations.sub_rewards import add_subgoal, keeps_shortest_path, pays_to_go_on, steps_until_again
from webapp.simulations.tasks import Task, packaged_layout, read_task

SMALL = "#######\n#K<.DG#\n#######\n"
ROOM = "#####\n#K#.#\n#.D.#\n#^#G#\n#####\n"


@pytest.fixture(scope="module")
def simulation() -> Task:
    return read_task(packaged_layout(), "simulation")


def again_by_trying(task: Task, pair: StateAction, longest: int) -> float:
    """Try all action sequences of each length from after the pair, and look for the pair."""
    begin = int(task.mdp.next_state[pair])
    for length in range(longest):
        for actions in product(range(task.mdp.num_actions), repeat=length):
            state = begin
            for action in actions:
                state = int(task.mdp.next_state[state, action])
            if state == pair[0] and not task.mdp.terminal[state]:
                return length + 1
    return float("inf")


@pytest.mark.parametrize("text", [SMALL, ROOM])
def test_a_pair_is_executed_again_as_soon_as_trying_every_sequence_finds_it(text: str) -> None:
    task = read_task(text, "small")
    for pair in task.path.pairs:
        found = steps_until_again(task.mdp, pair)
        assert found == again_by_trying(task, pair, longest=6) or found > 6


def test_the_key_is_taken_once_and_a_turn_again_after_turning_back(simulation: Task) -> None:
    names = [simulation.mdp.actions[action] for action in simulation.path.actions]
    again = [steps_until_again(simulation.mdp, pair) for pair in simulation.path.pairs]
    assert [step for step, steps in enumerate(again, start=1) if np.isinf(steps)] == [7, 20]
    assert names[7 - 1] == "pickup"
    assert {again[step] for step, name in enumerate(names) if name in {"left", "right"}} == {2}


def test_going_on_pays_where_the_next_subgoal_is_nearer_than_the_same_again(simulation: Task) -> None:
    # Step 11 walks on open floor, so it can be walked again after 6 actions; step 12 turns, which takes 2.
    assert pays_to_go_on(simulation, 11, 16, 0.5)
    assert not pays_to_go_on(simulation, 12, 16, 0.5)
    # The goal pays twice as much, however far it is.
    assert pays_to_go_on(simulation, 12, 20, 0.5)
    assert pays_to_go_on(simulation, 7, 20, 0.5)


def test_added_subgoals_halve_the_largest_gap_as_evenly_as_the_rewards_allow(simulation: Task) -> None:
    steps = list(simulation.subgoals)
    added = []
    for _ in range(3):
        step = add_subgoal(simulation, steps, 0.5)
        assert step is not None
        added.append(step)
        steps.append(step)
    # By hand: 7..16 is the largest gap with the middles 11 and 12, then 0..7 with 3 and 4, then 11..16 with 13 and 14.
    # Step 14 opens the door, which could be shut and opened for ever.
    assert added == [11, 3, 13]


def test_no_step_is_added_where_every_one_is_a_subgoal_already(simulation: Task) -> None:
    inner = list(simulation.inner_steps)
    assert add_subgoal(simulation, inner, 0.5) is None
    # The step before a subgoal always qualifies: nothing can be done twice in one action.
    assert add_subgoal(simulation, [step for step in inner if step != 14], 0.5) == 14


def worth_by_recursion(
    task: Task, pairs: tuple[StateAction, ...], discount: float, horizon: int, *, once: bool
) -> tuple[float, float]:
    """Return the best discounted reward within a horizon, and the best along shortest paths, in plain recursion."""
    mdp = task.mdp
    shortest = task.path.num_steps

    @cache
    def best(state: int, earned: frozenset[StateAction], left: int, hurried: bool) -> float:
        if mdp.terminal[state]:
            return 0.0
        if left == 0:
            return -1e9 if hurried else 0.0
        worths = []
        for action in range(mdp.num_actions):
            pair, after = (state, action), int(mdp.next_state[state, action])
            pays = pair in pairs and not (once and pair in earned)
            now = 0.5 * pays + bool(mdp.goal[after])
            new = earned | {pair} if once and pair in pairs else earned
            worths.append(now + discount * best(after, new, left - 1, hurried))
        return max(worths)

    return best(mdp.start, frozenset(), horizon, False), best(mdp.start, frozenset(), shortest, True)


@pytest.mark.parametrize("once", [False, True])
@pytest.mark.parametrize("discount", [0.6, 0.9])
def test_the_shortest_path_is_kept_exactly_if_no_long_walk_earns_more(discount: float, *, once: bool) -> None:
    task = read_task(ROOM, "room")
    assert task.path.num_steps < 12
    differing = 0
    for first, second in ((1, 1), (2, 2), (4, 4), (6, 6), (7, 7), (2, 6), (1, 5), (3, 7)):
        pairs = tuple(dict.fromkeys(task.pairs((first, second))))
        free, along = worth_by_recursion(task, pairs, discount, horizon=150, once=once)
        expected = free <= along + 1e-5
        differing += not expected
        assert keeps_shortest_path(task.mdp, pairs, 0.5, discount, once=once) == expected, (first, second)
    assert differing or once or discount == 0.6  # Both answers occur where pairs pay again and the future counts.


def test_without_sub_rewards_a_shortest_path_is_always_optimal(simulation: Task) -> None:
    assert keeps_shortest_path(simulation.mdp, (), 0.5, 0.99, once=False)


def test_how_much_the_future_counts_decides_whether_circles_pay(simulation: Task) -> None:
    pairs = simulation.pairs(simulation.subgoals)
    assert keeps_shortest_path(simulation.mdp, pairs, 0.5, 0.85, once=False)
    assert not keeps_shortest_path(simulation.mdp, pairs, 0.5, 0.95, once=False)
    assert keeps_shortest_path(simulation.mdp, pairs, 0.5, 0.95, once=True)
