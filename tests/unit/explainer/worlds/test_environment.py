from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env
from hypothesis import given, settings
from hypothesis import strategies as st
from minigrid.core.actions import Actions
from minigrid.core.grid import Grid
from minigrid.core.mission import MissionSpace
from minigrid.core.world_object import Door, Goal, Key, Wall
from minigrid.minigrid_env import MiniGridEnv

from tests.worlds import LAYOUTS, lay_out, layouts, reachable_states
from webapp.explainer.worlds.environment import KeyDoorEnv
from webapp.explainer.worlds.key_door import (
    ACTIONS,
    FORWARD,
    LEFT,
    PICKUP,
    RIGHT,
    TOGGLE,
    KeyDoorState,
    start_state,
    step,
)
from webapp.explainer.worlds.layout import Layout

CORRIDOR = lay_out("########", "#>KD..G#", "########")
ROUTE = [PICKUP, FORWARD, TOGGLE, FORWARD, FORWARD, FORWARD, FORWARD]


class PlainMiniGrid(MiniGridEnv):
    """The same world out of MiniGrid's own parts, stepped by MiniGrid's own code."""

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self.door = Door("yellow", is_locked=True)
        mission = MissionSpace(mission_func=lambda: "go")
        super().__init__(mission, width=layout.width, height=layout.height, max_steps=10**6, agent_view_size=3)

    def _gen_grid(self, width: int, height: int) -> None:
        self.grid = Grid(width, height)
        for cell in self.layout.walls:
            self.grid.set(*cell, Wall())
        self.grid.set(*self.layout.key, Key("yellow"))
        self.grid.set(*self.layout.door, self.door)
        self.grid.set(*self.layout.goal, Goal())
        self.agent_pos, self.agent_dir = self.layout.start, self.layout.heading

    @property
    def state(self) -> KeyDoorState:
        x, y = map(int, self.agent_pos)
        return KeyDoorState(x, y, self.agent_dir, int(self.carrying is not None), int(self.door.is_open))


def assert_steps_agree(env: KeyDoorEnv, states: list[KeyDoorState]) -> None:
    for state in states:
        if (state.x, state.y) == env.layout.goal:
            continue
        for action in range(len(ACTIONS)):
            first, _ = env.reset(options={"state": state})
            assert tuple(first) == state == env.state
            observation, reward, terminated, truncated, _ = env.step(action)
            after, ended = step(env.layout, state, action)
            assert tuple(observation) == after == env.state
            assert (terminated, truncated) == (ended, False)
            assert reward == (1 - 0.9 / env.max_steps if ended else 0)


def test_gymnasiums_checker_passes() -> None:
    entry_point = f"{KeyDoorEnv.__module__}:{KeyDoorEnv.__name__}"
    spec = EnvSpec("KeyDoor-v0", entry_point=entry_point, kwargs={"layout": LAYOUTS["simulation"]})
    check_env(gymnasium.make(spec, render_mode="rgb_array").unwrapped)


def test_the_world_is_made_of_minigrids_objects() -> None:
    env = KeyDoorEnv(LAYOUTS["simulation"])
    env.reset()
    assert isinstance(env, MiniGridEnv)
    for cell, kind in ((env.layout.key, Key), (env.layout.door, Door), (env.layout.goal, Goal), ((0, 0), Wall)):
        assert isinstance(env.grid.get(*cell), kind)


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
def test_every_transition_agrees_with_the_rules(layout: Layout) -> None:
    assert_steps_agree(KeyDoorEnv(layout), reachable_states(layout))


@settings(max_examples=25)
@given(layouts())
def test_every_transition_of_any_world_agrees_with_the_rules(layout: Layout) -> None:
    assert_steps_agree(KeyDoorEnv(layout), reachable_states(layout))


def test_transitions_agree_in_the_world_of_somebody_who_believes_the_door_open() -> None:
    layout = LAYOUTS["experiment2-a"]
    believed = start_state(layout)._replace(door_open=1)
    states = reachable_states(layout, believed)
    assert any(state.door_open and not state.has_key for state in states)
    assert_steps_agree(KeyDoorEnv(layout), states)


@settings(max_examples=25)
@given(layouts(), st.lists(st.sampled_from(range(5)), min_size=50, max_size=300))
def test_long_episodes_agree_with_plain_minigrid(layout: Layout, actions: list[int]) -> None:
    ours, plain = KeyDoorEnv(layout), PlainMiniGrid(layout)
    ours.reset()
    plain.reset()
    for action in actions:
        _, _, terminated, truncated, _ = ours.step(action)
        _, _, plain_terminated, _, _ = plain.step(Actions[ACTIONS[action]])
        assert ours.state == plain.state
        assert terminated == plain_terminated
        if terminated or truncated:
            break


def test_an_episode_can_be_stepped_through_key_and_door() -> None:
    env = KeyDoorEnv(CORRIDOR)
    env.reset(seed=1)
    states = []
    for action in [*ROUTE[:3], TOGGLE, TOGGLE]:
        env.step(action)
        states.append(env.state)
    assert states == [(1, 1, 0, 1, 0), (2, 1, 0, 1, 0), (2, 1, 0, 1, 1), (2, 1, 0, 1, 0), (2, 1, 0, 1, 1)]


@pytest.mark.parametrize("num_detours", [0, 1, 7])
def test_the_reward_is_less_the_later_the_goal_is_reached(num_detours: int) -> None:
    env = KeyDoorEnv(CORRIDOR)
    env.reset()
    assert env.max_steps == 10 * 8 * 3
    results = [env.step(action) for action in [LEFT, RIGHT] * num_detours + ROUTE]
    num_steps = 2 * num_detours + 7
    assert [float(result[1]) for result in results] == [0.0] * (num_steps - 1) + [1 - 0.9 * num_steps / 240]
    assert [result[2] for result in results] == [False] * (num_steps - 1) + [True]


def test_an_episode_is_truncated_at_its_last_step() -> None:
    env = KeyDoorEnv(CORRIDOR)
    env.reset()
    truncations = [env.step(LEFT)[3] for _ in range(240)]
    assert truncations == [False] * 239 + [True]


def test_an_episode_forgets_the_one_before() -> None:
    env = KeyDoorEnv(CORRIDOR)
    env.reset()
    for action in ROUTE:
        env.step(action)
    observation, _ = env.reset()
    assert tuple(observation) == start_state(CORRIDOR)
    assert isinstance(env.grid.get(*CORRIDOR.key), Key)
    env.step(TOGGLE)
    assert env.state == start_state(CORRIDOR)
    assert env.step_count == 1


def test_observations_are_not_overwritten_by_later_steps() -> None:
    env = KeyDoorEnv(CORRIDOR)
    first, _ = env.reset()
    second = env.step(PICKUP)[0]
    assert first.dtype == second.dtype == np.int64
    assert (first.tolist(), second.tolist()) == ([1, 1, 0, 0, 0], [1, 1, 0, 1, 0])


@pytest.mark.parametrize(
    ("state", "problem"),
    [
        ((0, 0, 0, 0, 0), "no state of this world"),  # In a wall.
        ((9, 1, 0, 0, 0), "no state of this world"),  # Outside.
        ((-2, 1, 0, 0, 0), "no state of this world"),
        ((1, 1, 4, 0, 0), "no state of this world"),
        ((1, 1, 0, 2, 0), "no state of this world"),
        ((1, 1, 0, 0, -1), "no state of this world"),
        ((2, 1, 0, 0, 0), "no state of this world"),  # On the key.
        ((3, 1, 0, 1, 0), "no state of this world"),  # In the shut door.
        ((6, 1, 0, 1, 1), "where it has ended"),
    ],
)
def test_an_episode_begins_only_in_a_state_of_the_world(state: tuple[int, ...], problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        KeyDoorEnv(CORRIDOR).reset(options={"state": state})


def test_an_unknown_option_is_refused() -> None:
    options: dict[str, Any] = {"sate": (1, 1, 0, 0, 0)}
    with pytest.raises(ValueError, match=r"no option \['sate'\]"):
        KeyDoorEnv(CORRIDOR).reset(options=options)


@pytest.mark.parametrize("action", [-1, 5])
def test_an_unknown_action_is_refused(action: int) -> None:
    env = KeyDoorEnv(CORRIDOR)
    env.reset()
    with pytest.raises(ValueError, match=f"there is no action {action}"):
        env.step(action)
    assert env.step_count == 0
