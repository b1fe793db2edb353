import random

import pytest

from tests.web.bundles import PATH, SMALL_WORLD, WAY
from webapp.bots.driving import GIVE_UP, Course, Intention, next_action
from webapp.explainer.worlds.key_door import ACTIONS
from webapp.stimuli.world_table import WorldTable

WORLD = WorldTable(
    layout="small",
    actions=tuple(ACTIONS),
    start=SMALL_WORLD.start,
    next_states=tuple(tuple(row) for row in SMALL_WORLD.next_state.tolist()),
    terminal=frozenset(SMALL_WORLD.terminal.nonzero()[0].tolist()),
    goals=frozenset(SMALL_WORLD.goal.nonzero()[0].tolist()),
    policy=tuple(0 for _ in range(SMALL_WORLD.num_states)),
    path_states=PATH.states,
    path_actions=WAY,
    subgoals=(1, 5, 7),
)


def drive(intention: Intention, step_limit: int, seed: int = 0) -> list[str]:
    """Drive to the end and return the actions, `GIVE_UP` among them."""
    course, rng, actions = Course(WORLD, WORLD.start, step_limit), random.Random(seed), list[str]()
    while len(actions) < step_limit and not WORLD.is_terminal(WORLD.roll_out(WORLD.start, actions)[-1]):
        action = next_action(course, actions, intention, rng)
        if action == GIVE_UP:
            return [*actions, action]
        actions.append(action)
    return actions


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("step_limit", [7, 8, 10, 21])
@pytest.mark.parametrize("skill", [0.0, 0.5])
def test_who_means_to_arrive_arrives_whatever_the_detours(seed: int, step_limit: int, skill: float) -> None:
    actions = drive(Intention(arrives=True, skill=skill, patience=1), step_limit, seed)
    assert WORLD.is_goal(WORLD.roll_out(WORLD.start, actions)[-1])
    assert len(actions) <= step_limit


def test_with_full_skill_no_action_is_wasted() -> None:
    assert len(drive(Intention(arrives=True, skill=1.0, patience=1), 21)) == 7


@pytest.mark.parametrize("seed", range(20))
def test_who_does_not_mean_to_never_arrives_and_gives_up(seed: int) -> None:
    actions = drive(Intention(arrives=False, skill=1.0, patience=15), 21, seed)
    assert actions[-1] == GIVE_UP
    assert len(actions) == 16
    assert not WORLD.is_terminal(WORLD.roll_out(WORLD.start, actions[:-1])[-1])
