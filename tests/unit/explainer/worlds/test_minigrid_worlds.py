"""MiniGrid's environments as worlds, against its rules written down once more and against MiniGrid itself."""

from collections.abc import Hashable
from functools import cache
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from minigrid.core.grid import Grid
from minigrid.core.mission import MissionSpace
from minigrid.core.world_object import Ball, Box, Goal, Key, Lava, Wall, WorldObj
from minigrid.minigrid_env import MiniGridEnv

from tests.minigrid_rules import Rules, Situation, situation_of
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.solvers import follow, plan
from webapp.explainer.worlds.enumeration import enumerate_world
from webapp.explainer.worlds.finite import Ended, NotFinite, describe_state
from webapp.explainer.worlds.gymnasium_worlds import world_of
from webapp.explainer.worlds.minigrid_worlds import MiniGridWorld

ALL = ("left", "right", "forward", "pickup", "drop", "toggle", "done")
FIVE = ("forward", "left", "right", "pickup", "toggle")
WORLDS = [
    ("MiniGrid-Empty-5x5-v0", ALL, 0),
    ("MiniGrid-Empty-8x8-v0", ALL, 0),
    ("MiniGrid-FourRooms-v0", ALL, 3),
    ("MiniGrid-DoorKey-5x5-v0", ALL, 0),
    ("MiniGrid-DoorKey-5x5-v0", FIVE, 7),
    ("MiniGrid-DoorKey-6x6-v0", ALL, 1),
    ("MiniGrid-DoorKey-8x8-v0", FIVE, 2),
    pytest.param("MiniGrid-DoorKey-16x16-v0", FIVE, 0, marks=pytest.mark.slow),
    ("MiniGrid-Unlock-v0", ALL, 0),
    ("MiniGrid-MultiRoom-N2-S4-v0", ALL, 4),
    ("MiniGrid-LavaGapS5-v0", ALL, 0),
    ("MiniGrid-LavaGapS7-v0", ALL, 1),
]


Doors = tuple[tuple[tuple[int, int], str], ...]


@cache
def enumerated(env_id: str, actions: tuple[str, ...] | None = None, seed: int = 0) -> DeterministicMDP:
    mdp = enumerate_world(world_of(env_id, seed=seed, actions=actions))
    assert isinstance(mdp, DeterministicMDP)
    return mdp


def fresh(env_id: str, seed: int) -> Any:  # noqa: ANN401 - MiniGrid's environments share no useful type.
    env = gymnasium.make(env_id).unwrapped
    env.reset(seed=seed)
    return env


def situation(label: Any, doors: Doors) -> Situation:  # noqa: ANN401 - each layout has labels of its own.
    """Say in the rules' terms what a label says; the doors come in the order in which they stand in the grid."""
    fields = label._asdict()
    words = [value for name, value in fields.items() if "door" in name]
    keys = [value for name, value in fields.items() if "key" in name]
    by_row = sorted(cell[::-1] for cell, _ in doors)
    return Situation(
        (label.x, label.y),
        label.heading,
        carrying=bool(keys) and keys[0] == "carried",
        key=keys[0] if keys and keys[0] != "carried" else None,
        doors=tuple(sorted((cell[::-1], word) for cell, word in zip(by_row, words, strict=True))),
    )


@pytest.mark.parametrize(("env_id", "actions", "seed"), WORLDS)
def test_states_ends_and_goals_are_those_of_the_rules(env_id: str, actions: tuple[str, ...], seed: int) -> None:
    mdp = enumerated(env_id, actions, seed)
    rules = Rules(fresh(env_id, seed), opening_wins="Unlock" in env_id)
    depth, ended, won = rules.explore(actions)
    seen = [situation(label, rules.start.doors) for label in mdp.states]
    assert len(set(seen)) == len(seen)
    assert set(seen) == set(depth)
    assert {seen[state] for state in np.flatnonzero(mdp.terminal)} == ended
    assert {seen[state] for state in np.flatnonzero(mdp.goal)} == won
    assert follow(mdp, plan(mdp)).num_steps == min(depth[each] for each in won)


@pytest.mark.parametrize(("env_id", "actions", "seed"), WORLDS)
def test_random_walks_agree_with_minigrid_step_by_step(env_id: str, actions: tuple[str, ...], seed: int) -> None:
    mdp = enumerated(env_id, actions, seed)
    env, rng = fresh(env_id, seed), np.random.default_rng(8)
    doors, state = situation_of(env).doors, mdp.start
    for action in rng.integers(len(actions), size=600).tolist():
        _, _, terminated, truncated, _ = env.step(env.actions[actions[action]])
        state = int(mdp.next_state[state, action])
        assert situation(mdp.states[state], doors) == situation_of(env)
        assert terminated == mdp.terminal[state]
        if terminated or truncated:
            env.reset(seed=seed)
            state = mdp.start


@pytest.mark.parametrize(("env_id", "actions", "seed"), WORLDS)
def test_the_planned_path_earns_minigrids_reward_at_its_last_step(
    env_id: str, actions: tuple[str, ...], seed: int
) -> None:
    mdp = enumerated(env_id, actions, seed)
    env = fresh(env_id, seed)
    path = follow(mdp, plan(mdp))
    results = [env.step(env.actions[actions[action]])[1:3] for action in path.actions]
    assert [bool(ended) for _, ended in results] == [False] * (path.num_steps - 1) + [True]
    assert results[-1][0] > 0


def test_an_empty_room_has_four_headings_per_cell_and_the_goal_two_ways_in() -> None:
    assert enumerated("MiniGrid-Empty-5x5-v0").num_states == (9 - 1) * 4 + 2
    assert enumerated("MiniGrid-Empty-8x8-v0").num_states == (36 - 1) * 4 + 2


def test_a_label_has_named_facts_and_can_be_put_into_words() -> None:
    world = world_of("MiniGrid-DoorKey-5x5-v0", actions=FIVE)
    mdp = enumerate_world(world)
    label: Any = mdp.states[mdp.start]
    assert label._fields == ("x", "y", "heading", "carrying", "yellow_door", "yellow_key")
    assert label == (1, 3, 2, "nothing", "locked", (1, 2))
    words = "at (1, 3) facing left, carrying nothing, the yellow door locked, the yellow key at (1, 2)"
    assert describe_state(world, label) == words
    taken = next(state for state in mdp.states if state[3] == "yellow key")  # type: ignore[index]
    assert taken[5] == "carried"  # type: ignore[index]
    assert "carrying the yellow key, the yellow door locked" in describe_state(world, taken)


def test_another_seed_is_another_layout() -> None:
    starts = {world_of("MiniGrid-FourRooms-v0", seed=seed).start for seed in range(5)}
    assert len(starts) == 5
    assert world_of("MiniGrid-FourRooms-v0", seed=3).start in starts


def test_the_time_that_has_passed_is_no_part_of_the_world() -> None:
    world = world_of("MiniGrid-Empty-5x5-v0")
    goal = next(s for s in enumerate_world(world).states if s[:2] == (3, 2) and s[2] == 1)  # type: ignore[index]
    rewards = {outcome.reward for _ in range(300) for outcome in world.outcomes(goal, 2)}
    assert rewards == {1 - 0.9 / 100}


def test_an_end_that_looks_like_a_state_on_the_way_is_kept_apart() -> None:
    world = world_of("MiniGrid-GoToDoor-5x5-v0")
    mdp = enumerate_world(world)
    ends = [label for label, ended in zip(mdp.states, mdp.terminal, strict=True) if ended]
    assert ends
    # Beside the right door `done` succeeds where `toggle` gives up, and both leave everything as it was.
    apart = [label for label in ends if isinstance(label, Ended)]
    assert {each.state for each in apart if each.in_goal} & {each.state for each in apart if not each.in_goal}


class Custom(MiniGridEnv):
    """A room whose furniture a test chooses."""

    def __init__(self, *things: tuple[WorldObj, tuple[int, int]]) -> None:
        self.things = things
        super().__init__(MissionSpace(mission_func=lambda: "go"), width=5, height=4, max_steps=10)

    def _gen_grid(self, width: int, height: int) -> None:
        self.grid = Grid(width, height)
        self.grid.wall_rect(0, 0, width, height)
        self.put_obj(Goal(), 3, 2)
        for thing, cell in self.things:
            self.put_obj(thing, *cell)
        self.agent_pos, self.agent_dir = (1, 1), 0


def test_a_key_in_a_box_can_be_found() -> None:
    world = MiniGridWorld(Custom((Box("grey", contains=Key("red")), (2, 1))), 0, "custom")
    mdp = enumerate_world(world)
    names = mdp.states[0]._fields  # type: ignore[attr-defined]
    assert names == ("x", "y", "heading", "carrying", "grey_box", "red_key")
    assert mdp.states[0][4:] == ((2, 1), "inside a box")  # type: ignore[index]
    facts = {label[4:] for label in mdp.states}  # type: ignore[index]
    assert {("gone", (2, 1)), ("gone", "carried"), ("carried", "inside a box")} <= facts
    assert not any(box != "gone" and key != "inside a box" for box, key in facts)
    opened = next(label for label in mdp.states if label[4:] == ("gone", (2, 1)))  # type: ignore[index]
    assert "the grey box gone, the red key at (2, 1)" in describe_state(world, opened)


def test_things_of_the_same_name_are_numbered() -> None:
    balls = [Ball("red"), Ball("red")]  # type: ignore[no-untyped-call]
    world = MiniGridWorld(Custom((balls[0], (2, 1)), (balls[1], (1, 2))), 0, "custom")
    assert world.start._fields[4:] == ("red_ball_1", "red_ball_2")  # type: ignore[attr-defined]
    assert world.start[4:] == ((2, 1), (1, 2))  # type: ignore[index]


class Switch(WorldObj):
    """Something that counts how often it was toggled."""

    def __init__(self) -> None:
        super().__init__("floor", "blue")

    def toggle(self, env: MiniGridEnv, pos: tuple[int, int]) -> bool:  # noqa: ARG002
        self.color = "red"
        return True


class Counting(Custom):
    """Remembers how often the agent turned."""

    turns = 0

    def step(self, action: Any) -> Any:  # noqa: ANN401 - MiniGrid's signature.
        self.turns += action == self.actions.left
        return super().step(action)


class Building(Custom):
    """Builds a wall behind the agent's back."""

    def step(self, action: Any) -> Any:  # noqa: ANN401 - MiniGrid's signature.
        self.grid.set(2, 2, Wall())
        return super().step(action)


@pytest.mark.parametrize(
    ("env", "problem"),
    [
        (Custom((Switch(), (2, 1))), "custom holds a blue floor that toggling may change in ways unknown here"),
        (Counting(), "'left' in custom changes turns, which is no part of the grid"),
        (Building(), r"'left' in custom builds the cell \(2, 2\) anew, which cannot be restored"),
    ],
)
def test_what_cannot_be_restored_is_refused(env: MiniGridEnv, problem: str) -> None:
    with pytest.raises(NotFinite, match=problem):
        enumerate_world(MiniGridWorld(env, 0, "custom"))


class Swallowing(Custom):
    """Lets go of nothing: what is carried vanishes with the action `done`."""

    def step(self, action: Any) -> Any:  # noqa: ANN401 - MiniGrid's signature.
        if action == self.actions.done:
            self.carrying = None
        return super().step(action)


def test_a_thing_may_vanish_from_the_hand() -> None:
    mdp = enumerate_world(MiniGridWorld(Swallowing((Key("red"), (2, 1))), 0, "custom"))
    assert {label[3:] for label in mdp.states} >= {("red key", "carried"), ("nothing", "gone")}  # type: ignore[index]


def test_steps_that_draw_random_numbers_are_refused() -> None:
    world = world_of("MiniGrid-Dynamic-Obstacles-5x5-v0")
    with pytest.raises(NotFinite, match=r"'left' in .* draws random numbers, .* protocol of docs/own-environment.md"):
        enumerate_world(world)


def test_instructions_that_remember_are_refused() -> None:
    with pytest.raises(NotFinite, match="an instruction that remembers what was done"):
        world_of("BabyAI-GoToRedBall-v0")


def test_an_unreachable_goal_is_told_and_lava_is_none() -> None:
    lava = Lava()  # type: ignore[no-untyped-call]
    env = Custom((Wall(), (3, 1)), (Wall(), (2, 2)), (lava, (1, 2)))
    with pytest.raises(ValueError, match=r"no goal can be reached .* the best end in reach pays 0"):
        enumerate_world(MiniGridWorld(env, 0, "custom"))


def test_an_environment_may_name_fewer_actions_itself() -> None:
    class Named(Custom):
        action_names = ("l", "r", "f")

        def __init__(self) -> None:
            super().__init__()
            self.action_space = spaces.Discrete(3)

    world = MiniGridWorld(Named(), 0, "custom")
    assert world.actions == ("l", "r", "f")
    assert isinstance(world.start, Hashable)
