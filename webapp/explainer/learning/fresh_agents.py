"""Agents that know nothing learn a world, many of them in lockstep (Sakai et al. 2021, sections 5.2 and 5.3).

What is measured is how many episodes an agent needs until its greedy policy takes a shortest path from the start,
checked after every episode. Sub-rewards for chosen state-action pairs show what knowing these pairs is worth.

The stack has a fixed number of slots. An agent that is done leaves its slot to the next one that waits, and no
arithmetic mixes two slots: who else learns, when a slot became free, or which slot it was changes no agent's outcome.
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch

from webapp.explainer.learning.encoding import Encoding
from webapp.explainer.learning.fresh_settings import FreshSettings
from webapp.explainer.learning.q_stack import QStack
from webapp.explainer.learning.threads import one_thread
from webapp.explainer.mdp import DeterministicMDP, StateAction
from webapp.explainer.seeding import stream
from webapp.explainer.solvers import distances_to_goal
from webapp.explainer.worlds.key_door import tabulate
from webapp.explainer.worlds.layout import Layout


@dataclass(frozen=True, slots=True)
class FreshAgent:
    """An agent that knows nothing yet, and what it is told.

    Attributes:
        name: Names its random streams; agents of one name and seed are the same agent.
        sub_rewards: The state-action pairs that pay a sub-reward, as indices into the world.
        once: Whether a pair pays only the first time in an episode, not whenever it is executed.
    """

    name: str
    sub_rewards: tuple[StateAction, ...] = ()
    once: bool = False


@dataclass(frozen=True, slots=True)
class Outcome:
    """How the learning of one agent ended.

    Attributes:
        num_episodes: Episodes until the greedy policy was optimal, or, if it never was, the budget.
        is_optimal: Whether it was; if not, the run is censored at `num_episodes`.
        num_steps: Actions taken.
        num_goals: Episodes that ended in the goal.
        first_goal: The episode that first did, from 1; None if none did.
    """

    num_episodes: int
    is_optimal: bool
    num_steps: int
    num_goals: int
    first_goal: int | None


def learn(
    layout: Layout,
    agents: Sequence[FreshAgent],
    settings: FreshSettings,
    seed: int,
    report: Callable[[int], None] | None = None,
) -> tuple[Outcome, ...]:
    r"""Let agents learn a map from nothing until their greedy policy is optimal from the start, or the budget ends.

    The reward is the environment's, `1 - 0.9 * t / max_steps` on reaching the goal at step `t`, and
    `sub_reward * (1 - 0.9 * t / max_steps)` for a pair that pays, with `max_steps = 10 * width * height`.

    Args:
        layout: The map.
        agents: Who learns, in the order of the outcomes.
        settings: How.
        seed: Of all streams, at least 0.
        report: Told how many agents are done whenever one is.

    Raises:
        LayoutError: The goal cannot be reached.
        ValueError: Two agents have one name, or a pair that shall pay is none of the world.

    Example:
        >>> from webapp.explainer.learning import FreshAgent, FreshSettings, learn
        >>> from webapp.explainer.worlds.layout import parse_layout
        >>> layout = parse_layout("######\n#>KDG#\n######")
        >>> settings = FreshSettings(num_slots=2, exploration_steps=2000)
        >>> outcomes = learn(layout, [FreshAgent("first"), FreshAgent("second")], settings, seed=0)
        >>> [outcome.is_optimal for outcome in outcomes]
        [True, True]
    """
    mdp = tabulate(layout)
    _check(agents, mdp)
    with one_thread():
        classroom = _Classroom(layout, mdp, agents, settings, seed)
        while classroom.is_busy:
            classroom.advance()
            if report is not None and classroom.has_news:
                report(classroom.num_done)
    return classroom.outcomes


def _check(agents: Sequence[FreshAgent], mdp: DeterministicMDP) -> None:
    names = [agent.name for agent in agents]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"two agents are called {twice!r}; agents of one name would be the same agent")
    for agent in agents:
        for state, action in agent.sub_rewards:
            if not (0 <= state < mdp.num_states and 0 <= action < mdp.num_actions):
                raise ValueError(f"agent {agent.name!r} cannot be paid for {(state, action)}: there is no such pair")


class _Classroom:
    """The slots of a stack, the agents that sit in them, and those that wait."""

    def __init__(
        self, layout: Layout, mdp: DeterministicMDP, agents: Sequence[FreshAgent], settings: FreshSettings, seed: int
    ) -> None:
        self._agents, self._settings, self._seed, self._mdp = agents, settings, seed, mdp
        self._max_steps = 10 * layout.width * layout.height
        self._next_state = mdp.next_state.astype(np.int64).ravel()
        self._shortest = int(distances_to_goal(mdp)[mdp.start])
        states = torch.from_numpy(np.asarray(mdp.states, dtype=np.int64))
        observations = Encoding.of(layout).observe(states).numpy()
        self._stack = QStack(observations, self._next_state, mdp.terminal, settings)
        num_slots, num_pairs = settings.num_slots, len(self._next_state)
        self._waiting = deque(range(len(agents)))
        self._sitting: list[int | None] = [None] * num_slots
        self._streams: list[tuple[np.random.Generator, np.random.Generator] | None] = [None] * num_slots
        self._done: dict[int, Outcome] = {}
        self.has_news = False
        self._every = np.arange(num_slots)
        self._pays = np.zeros((num_slots, num_pairs), dtype=np.float32)
        self._earned = np.zeros((num_slots, num_pairs), dtype=np.bool_)
        self._once = np.zeros(num_slots, dtype=np.bool_)
        self._state = np.full(num_slots, mdp.start, dtype=np.int64)
        self._time = np.zeros(num_slots, dtype=np.int64)
        self._steps = np.zeros(num_slots, dtype=np.int64)
        self._episodes = np.zeros(num_slots, dtype=np.int64)
        self._goals = np.zeros(num_slots, dtype=np.int64)
        self._first_goal: list[int | None] = [None] * num_slots
        self._pairs = np.zeros((num_slots, settings.replay_capacity), dtype=np.int32)
        self._rewards = np.zeros((num_slots, settings.replay_capacity), dtype=np.float32)
        self._whims = np.zeros((num_slots, _BLOCK, 2), dtype=np.float32)
        self._tickets = np.zeros((num_slots, _BLOCK, settings.batch_size), dtype=np.float32)
        self._fill()

    @property
    def is_busy(self) -> bool:
        """Whether somebody still learns."""
        return len(self._done) < len(self._agents)

    @property
    def num_done(self) -> int:
        """How many have ended."""
        return len(self._done)

    @property
    def outcomes(self) -> tuple[Outcome, ...]:
        """Of all agents, in their order."""
        return tuple(self._done[number] for number in range(len(self._agents)))

    def advance(self) -> None:
        """Let every agent take as many actions as there are between two updates, then update the networks."""
        before = len(self._done)
        for _ in range(self._settings.train_interval):
            self._act()
        self._improve()
        if len(self._done) > before:
            self._fill()
        self.has_news = len(self._done) > before

    def _fill(self) -> None:
        """Let those who wait take the free slots."""
        for slot in self._every.tolist():
            if self._sitting[slot] is None and self._waiting:
                self._admit(slot, self._waiting.popleft())

    def _admit(self, slot: int, number: int) -> None:
        agent = self._agents[number]
        self._sitting[slot] = number
        acting, replay, weights = (
            stream(self._seed, "fresh", agent.name, use) for use in ("acting", "replay", "weights")
        )
        self._streams[slot] = acting, replay
        self._stack.admit(slot, weights)
        self._pays[slot] = 0
        for state, action in agent.sub_rewards:
            self._pays[slot, state * self._mdp.num_actions + action] = self._settings.sub_reward
        self._once[slot] = agent.once
        self._first_goal[slot] = None
        for counts in (self._steps, self._episodes, self._goals):
            counts[slot] = 0
        self._begin_episode(slot)

    def _begin_episode(self, slot: int) -> None:
        self._state[slot], self._time[slot] = self._mdp.start, 0
        self._earned[slot] = False

    def _act(self) -> None:
        """Take one action in every slot and remember it. Free slots act, too: nobody looks at what they do."""
        self._draw()
        place = self._steps % _BLOCK
        whims = self._whims[self._every, place]
        exploration = self._settings.exploration(self._steps)
        any_action = (whims[:, 1] * self._mdp.num_actions).astype(np.int64)
        actions = np.where(whims[:, 0] < exploration, any_action, self._stack.greedy(self._state))
        pairs = self._state * self._mdp.num_actions + actions
        after = self._next_state[pairs]
        self._time += 1
        arrives = self._mdp.goal[after]
        pays = self._pays[self._every, pairs] * ~(self._earned[self._every, pairs] & self._once)
        self._earned[self._every, pairs] = True
        row = self._steps % self._settings.replay_capacity
        self._pairs[self._every, row] = pairs
        self._rewards[self._every, row] = (arrives + pays) * (1 - _FALL * self._time / self._max_steps)
        self._state = after
        self._steps += 1
        for slot in np.flatnonzero(self._mdp.terminal[after] | (self._time >= self._max_steps)).tolist():
            self._close_episode(slot, arrives=bool(arrives[slot]))

    def _draw(self) -> None:
        """Draw the random numbers of the next actions of all agents that have used up theirs."""
        for slot in np.flatnonzero(self._steps % _BLOCK == 0).tolist():
            streams = self._streams[slot]
            if streams is not None:
                acting, replay = streams
                acting.random(out=self._whims[slot], dtype=np.float32)
                replay.random(out=self._tickets[slot], dtype=np.float32)

    def _close_episode(self, slot: int, *, arrives: bool) -> None:
        self._begin_episode(slot)
        number = self._sitting[slot]
        if number is None:
            return
        self._episodes[slot] += 1
        episodes = int(self._episodes[slot])
        self._goals[slot] += arrives
        if arrives and self._first_goal[slot] is None:
            self._first_goal[slot] = episodes
        is_optimal = self._takes_a_shortest_path(slot)
        if is_optimal or episodes == self._settings.max_episodes:
            steps, goals = int(self._steps[slot]), int(self._goals[slot])
            self._done[number] = Outcome(episodes, is_optimal, steps, goals, self._first_goal[slot])
            self._sitting[slot] = None

    def _takes_a_shortest_path(self, slot: int) -> bool:
        policy = self._stack.policy(slot)
        state = self._mdp.start
        for _ in range(self._shortest):
            state = int(self._next_state[state * self._mdp.num_actions + policy[state]])
        return bool(self._mdp.goal[state])

    def _improve(self) -> None:
        """Update the agents whose time has come, and their target networks."""
        settings = self._settings
        ready = [
            slot
            for slot, number in enumerate(self._sitting)
            if number is not None and self._steps[slot] >= settings.warmup_steps
        ]
        if not ready:
            return
        kept = np.minimum(self._steps, settings.replay_capacity)
        tickets = self._tickets[self._every, (self._steps - 1) % _BLOCK]
        rows = (tickets * kept[:, None]).astype(np.int64)
        every = self._every[:, None]
        self._stack.update(ready, self._pairs[every, rows], self._rewards[every, rows])
        for slot in ready:
            if self._steps[slot] % settings.target_interval == 0:
                self._stack.renew_target(slot)


_BLOCK = 512
"""Random numbers are drawn for so many actions at once."""
_FALL = 0.9
"""How much of a reward is lost by the last step: MiniGrid's."""
