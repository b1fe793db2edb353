"""Agents that learn in lockstep, against one agent by itself in the real environment, and against each other."""

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

from tests.worlds import LAYOUTS, lay_out
from webapp.explainer.learning import FreshAgent, FreshSettings, Outcome, learn
from webapp.explainer.learning.threads import one_thread
from webapp.explainer.seeding import stream
from webapp.explainer.worlds.environment import KeyDoorEnv
from webapp.explainer.worlds.key_door import FORWARD, LEFT, PICKUP, RIGHT, TOGGLE, KeyDoorState, tabulate
from webapp.explainer.worlds.layout import LayoutError

LAYOUT = lay_out("#######", "#K<.DG#", "#######")
SHORTEST = [PICKUP, RIGHT, RIGHT, FORWARD, TOGGLE, FORWARD, FORWARD]
WORLD = tabulate(LAYOUT)
START = KeyDoorState(2, 1, 2, 0, 0)
SETTINGS = FreshSettings(
    num_slots=4,
    max_episodes=20,
    units=24,
    learning_rate=3e-3,
    batch_size=8,
    warmup_steps=120,
    target_interval=60,
    replay_capacity=700,
    exploration_steps=1500,
    max_gradient_norm=0.1,
)
SEED = 1
"""With this seed some find the goal by detours before they find the shortest path."""


def pair(state: KeyDoorState, action: int) -> tuple[int, int]:
    return list(WORLD.states).index(state), action


IN_VAIN = pair(START, TOGGLE)
"""Leads from the start back to the start, so it can be executed again and again."""
ONE_WAY = (pair(START, PICKUP), pair(KeyDoorState(4, 1, 0, 1, 1), FORWARD))
"""The first and the last of a shortest path. No episode has room for a second time."""
CLASS = (
    FreshAgent("alone"),
    FreshAgent("turns", (pair(START, LEFT),)),
    FreshAgent("turns once", (pair(START, LEFT),), once=True),
    FreshAgent("in vain", (IN_VAIN,)),
    FreshAgent("in vain once", (IN_VAIN,), once=True),
    FreshAgent("told the way", ONE_WAY),
    FreshAgent("told the way once", ONE_WAY, once=True),
    FreshAgent("another"),
    FreshAgent("a third"),
)


Transition = tuple[KeyDoorState, int, float, KeyDoorState, bool]
"""Before, action, reward, after, and whether the goal is reached: a truncated episode might have gone on."""


class Alone:
    """One agent by itself: DQN as one would write it by hand, in MiniGrid, with the agent's own streams."""

    def __init__(self, agent: FreshAgent, settings: FreshSettings, seed: int) -> None:
        self.settings, self.once = settings, agent.once
        self.paying = {(WORLD.states[state], action) for state, action in agent.sub_rewards}
        self.acting, self.replay, weights = (
            stream(seed, "fresh", agent.name, use) for use in ("acting", "replay", "weights")
        )
        self.network = self.first_network(weights)
        self.target = deepcopy(self.network)
        self.optimizer = torch.optim.Adam(self.network.parameters(), lr=settings.learning_rate)
        self.memory: list[Transition] = []
        self.num_steps = 0

    def first_network(self, rng: np.random.Generator) -> torch.nn.Sequential:
        sizes = [LAYOUT.width + LAYOUT.height + 8, self.settings.units, self.settings.units, 5]
        modules: list[torch.nn.Module] = []
        for place, fan in enumerate((5, self.settings.units, self.settings.units)):
            layer = torch.nn.Linear(sizes[place], sizes[place + 1])
            # A stack holds all layers but the last from inputs to outputs, and so it draws them.
            lies_so = place == len(sizes) - 2
            weight, bias = (
                torch.from_numpy(rng.random(shape, dtype=np.float32) * 2 - 1) / fan**0.5
                for shape in (layer.weight.shape if lies_so else layer.weight.T.shape, layer.bias.shape)
            )
            layer.load_state_dict({"weight": weight if lies_so else weight.T, "bias": bias})
            modules += [layer, torch.nn.ReLU()]
        return torch.nn.Sequential(*modules[:-1])

    def values(self, network: torch.nn.Sequential, *states: KeyDoorState) -> torch.Tensor:
        sizes = (LAYOUT.width, LAYOUT.height, 4, 2, 2)
        rows = [
            np.concatenate([np.eye(size)[part] for size, part in zip(sizes, state, strict=True)]) for state in states
        ]
        values: torch.Tensor = network(torch.from_numpy(np.array(rows, dtype=np.float32)))
        return values

    def best(self, state: KeyDoorState) -> int:
        return int(self.values(self.network, state).argmax())

    def learn(self) -> Outcome:
        env = KeyDoorEnv(LAYOUT)
        num_goals, first_goal = 0, None
        for episode in range(1, self.settings.max_episodes + 1):
            env.reset()
            paid: set[tuple[KeyDoorState, int]] = set()
            ended = False
            while not ended:
                arrives, ended = self.act(env, paid)
                is_optimal = ended and self.is_optimal()
                if not is_optimal:
                    self.improve()
            num_goals += arrives
            first_goal = first_goal or (episode if arrives else None)
            if is_optimal:
                break
        return Outcome(episode, is_optimal, self.num_steps, num_goals, first_goal)

    def act(self, env: KeyDoorEnv, paid: set[tuple[KeyDoorState, int]]) -> tuple[bool, bool]:
        settings, before = self.settings, env.state
        fallen = min(1, self.num_steps / settings.exploration_steps)
        whim, which = self.acting.random(2, dtype=np.float32).tolist()
        explores = whim < 1 - fallen * (1 - settings.final_exploration)
        action = int(which * 5) if explores else self.best(before)
        _, reward, arrives, truncated, _ = env.step(action)
        earned = float(reward)
        if (before, action) in self.paying and not (self.once and (before, action) in paid):
            earned += settings.sub_reward * (1 - 0.9 * env.step_count / env.max_steps)
        paid.add((before, action))
        self.memory.append((before, action, earned, env.state, arrives))
        self.num_steps += 1
        return arrives, arrives or truncated

    def improve(self) -> None:
        settings = self.settings
        tickets = self.replay.random(settings.batch_size, dtype=np.float32).tolist()
        if self.num_steps % settings.train_interval == 0 and self.num_steps >= settings.warmup_steps:
            self.update([self.remembered(ticket) for ticket in tickets])
        if self.num_steps % settings.target_interval == 0:
            self.target = deepcopy(self.network)

    def remembered(self, ticket: float) -> Transition:
        """Return the transition at a place of a ring that overwrites the oldest."""
        capacity = self.settings.replay_capacity
        place = int(ticket * min(self.num_steps, capacity))
        return self.memory[range(place, self.num_steps, capacity)[-1]]

    def update(self, batch: list[Transition]) -> None:
        before, actions, rewards, after, arrives = zip(*batch, strict=True)
        with torch.no_grad():
            ahead = self.values(self.target, *after).amax(dim=1) * ~torch.tensor(arrives)
        taken = self.values(self.network, *before)[range(len(batch)), actions]
        loss = torch.nn.functional.smooth_l1_loss(taken, torch.tensor(rewards) + self.settings.discount * ahead)
        self.optimizer.zero_grad()
        torch.autograd.backward(loss)
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), self.settings.max_gradient_norm)
        self.optimizer.step()

    def is_optimal(self) -> bool:
        env = KeyDoorEnv(LAYOUT)
        env.reset()
        return [env.step(self.best(env.state))[2] for _ in SHORTEST][-1]


@pytest.fixture(scope="module")
def outcomes() -> tuple[Outcome, ...]:
    return learn(LAYOUT, CLASS, SETTINGS, SEED)


@pytest.mark.parametrize("number", range(len(CLASS)), ids=[agent.name for agent in CLASS])
def test_an_agent_of_a_stack_lives_as_it_would_by_itself_in_minigrid(
    outcomes: tuple[Outcome, ...], number: int
) -> None:
    """Some of these agents arrive, some are truncated, some wait for a slot, and memories overflow."""
    with one_thread():
        assert outcomes[number] == Alone(CLASS[number], SETTINGS, SEED).learn()


@pytest.mark.parametrize(
    "change",
    [{"name": "somebody else"}, {"sub_rewards": (IN_VAIN,)}, {"once": True}],
    ids=["name", "sub-rewards", "once"],
)
def test_what_one_agent_is_told_changes_no_other(outcomes: tuple[Outcome, ...], change: dict[str, Any]) -> None:
    number = next(place for place, agent in enumerate(CLASS) if agent.name == "turns")
    others = [place for place in range(len(CLASS)) if place != number]
    agents = list(CLASS)
    agents[number] = replace(agents[number], **change)
    changed = learn(LAYOUT, agents, SETTINGS, SEED)
    assert changed[number] != outcomes[number]
    assert [changed[place] for place in others] == [outcomes[place] for place in others]


@pytest.mark.parametrize(
    "order", [range(8, -1, -1), (4, 8, 0, 5, 1, 7, 2, 6, 3), (5,), (8, 2, 0)], ids=["reversed", "mixed", "one", "few"]
)
def test_neither_the_company_nor_the_queue_changes_an_agent(
    outcomes: tuple[Outcome, ...], order: Sequence[int]
) -> None:
    assert learn(LAYOUT, [CLASS[place] for place in order], SETTINGS, SEED) == tuple(outcomes[place] for place in order)


def test_a_seed_decides_everything_and_nothing_else_does(outcomes: tuple[Outcome, ...]) -> None:
    torch.manual_seed(5)
    state = torch.get_rng_state()
    assert learn(LAYOUT, CLASS[:4], SETTINGS, SEED) == outcomes[:4]
    other = learn(LAYOUT, CLASS[:4], SETTINGS, SEED + 1)
    assert all(one != another for one, another in zip(other, outcomes[:4], strict=True))
    assert torch.equal(torch.get_rng_state(), state)


def test_torch_has_as_many_threads_afterwards_as_before() -> None:
    before = torch.get_num_threads()
    torch.set_num_threads(before + 1)
    learn(LAYOUT, CLASS[:1], replace(SETTINGS, max_episodes=1), SEED)
    after = torch.get_num_threads()
    torch.set_num_threads(before)
    assert after == before + 1


def test_an_agent_that_does_not_get_there_is_reported_at_the_end_of_its_budget() -> None:
    """Nothing is learned before the budget ends, and random actions do not always find the goal in 640 steps."""
    settings = FreshSettings(num_slots=4, max_episodes=3, warmup_steps=10_000)
    found = learn(LAYOUTS["simulation"], [FreshAgent(f"{number}") for number in range(12)], settings, 2)
    assert len(found) == 12
    for outcome in found:
        assert (outcome.num_episodes, outcome.is_optimal) == (3, False)
        assert outcome.num_steps <= 3 * 640
        assert (outcome.num_steps == 3 * 640) == (outcome.num_goals == 0) == (outcome.first_goal is None)
    assert {outcome.num_goals == 0 for outcome in found} == {True, False}


def test_who_is_done_is_told_when_somebody_is_and_no_one_is_left_out() -> None:
    told: list[int] = []
    learn(LAYOUT, CLASS, replace(SETTINGS, max_episodes=2), SEED, told.append)
    assert told == sorted(set(told))
    assert told[0] > 0
    assert told[-1] == len(CLASS)
    assert len(told) > 2


def test_nobody_learns_in_an_empty_class() -> None:
    assert learn(LAYOUT, [], SETTINGS, SEED) == ()


def a_class(sub_rewards: tuple[tuple[int, int], ...], settings: FreshSettings, *, once: bool) -> tuple[Outcome, ...]:
    agents = [FreshAgent(f"{number}", sub_rewards, once) for number in range(settings.num_slots)]
    return learn(LAYOUT, agents, settings, SEED)


@pytest.mark.slow
def test_an_agent_that_is_paid_again_and_again_for_standing_still_never_leaves_and_one_that_is_paid_once_does() -> None:
    settings = FreshSettings(
        num_slots=8, max_episodes=50, units=24, learning_rate=3e-3, target_interval=60, exploration_steps=1500
    )
    assert not any(outcome.is_optimal for outcome in a_class((IN_VAIN,), settings, once=False))
    assert sum(outcome.is_optimal for outcome in a_class((IN_VAIN,), settings, once=True)) > 4


def test_what_happens_at_most_once_in_an_episode_pays_in_every_episode() -> None:
    always, once = (a_class(ONE_WAY, SETTINGS, once=once) for once in (False, True))
    assert once == always
    assert once != a_class((), SETTINGS, once=True)


def test_a_sub_reward_of_nothing_changes_nothing(outcomes: tuple[Outcome, ...]) -> None:
    agents = [replace(agent, name=CLASS[0].name) for agent in CLASS[4:6]]
    settings = replace(SETTINGS, sub_reward=0)
    assert {learn(LAYOUT, [agent], settings, SEED) for agent in agents} == {outcomes[:1]}


def test_two_agents_of_one_name_are_refused_by_name() -> None:
    with pytest.raises(ValueError, match="two agents are called 'Ann'"):
        learn(LAYOUT, [FreshAgent("Ann"), FreshAgent("Bob"), FreshAgent("Ann", once=True)], SETTINGS, SEED)


@pytest.mark.parametrize("outside", [(-1, 0), (WORLD.num_states, 0), (0, -1), (0, WORLD.num_actions)])
def test_a_pair_outside_the_world_is_refused_with_the_agent_that_was_to_be_paid(outside: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match=rf"'Ann' cannot be paid for \({outside[0]}, {outside[1]}\)"):
        learn(LAYOUT, [FreshAgent("Ann", (IN_VAIN, outside))], SETTINGS, SEED)


def test_a_goal_out_of_reach_is_refused() -> None:
    with pytest.raises(LayoutError, match="cannot be reached"):
        learn(lay_out("########", "#>KD.#G#", "########"), CLASS, SETTINGS, SEED)
