"""Algorithm 1's rollouts on a table: a bank of walkers at once, all states of the path side by side.

The random phase is one draw and one look-up per step, or per several steps where the table of their joint outcomes is
small. What a deterministic policy does then in a deterministic world is no matter of chance: where it stands after `d`
steps is found in `log2(d)` jumps. Where there is chance, walkers are moved until none is on its way, and those that
have ended are left out.
"""

from functools import cached_property

import numpy as np
import torch
from numpy.typing import NDArray

from webapp.explainer.batched_rollouts.draws import Drawer
from webapp.explainer.batched_rollouts.jumps import PolicyJumps
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.reachability import markov_chain, steps_towards
from webapp.explainer.solvers import Trajectory
from webapp.explainer.stochastic import (
    AnyPolicy,
    StochasticMDP,
    StochasticPolicy,
    World,
    action_probabilities,
    from_deterministic,
)
from webapp.explainer.trials import Question, Tally, in_turns
from webapp.explainer.urns import fill_urns, side_by_side, uniform

MAX_POLICY_STEPS = 100_000
"""After so many actions of the policy a walker is broken off where there is chance, and counted as such.

Who can no longer reach the goal is stopped at once, in a loop or not, and everyone else ends surely; so only a policy
that takes this long to find its way is ever broken off. Without chance nobody is: S steps decide, and jumps take them.
"""
_WALKERS = {"cpu": 1 << 15}
"""A bank of so many stays in the processor's cache."""
_WALKERS_ELSEWHERE = 1 << 20
"""An accelerator is busy with so many; they take some 100 MiB, at most 100 bytes each."""
_LARGEST_TABLE = 1 << 20
"""While all copies together have no more actions than this, each path state has a copy of the world to itself."""


class TableRollouts:
    """Rollouts of one policy from the states of one path of a tabulated world."""

    def __init__(self, world: World, policy: AnyPolicy, path: Trajectory, device: torch.device) -> None:
        """Put the tables where the rollouts will run.

        Args:
            world: The world.
            policy: `[S]` actions or `[S, A]` probabilities. Where it never reaches a goal it neither returns nor
                arrives.
            path: A way to a goal that the policy may take.
            device: Where to run.

        Raises:
            ValueError: The policy does not fit the world, or may not take the path to a goal.
        """
        self._mdp = from_deterministic(world) if isinstance(world, DeterministicMDP) else world
        self._chances = action_probabilities(self._mdp, policy)
        check_way(self._mdp, self._chances, path)
        self._path, self._device = path, device
        distance = steps_towards(markov_chain(self._mdp, policy), self._mdp.goal)
        self._policy = self._drawer(self._chances)
        self._free = self._drawer(uniform(self._mdp.selectable))
        self._featured = torch.tensor(path.states[:-1], dtype=torch.int32, device=device)
        self._small = self._chances.size * path.num_steps <= _LARGEST_TABLE
        self._goal = torch.from_numpy(self._mdp.goal).to(device)
        self._over = torch.from_numpy(self._mdp.terminal | (distance < 0)).to(device)
        successor = self._policy.certain
        self._jumps = None if successor is None else PolicyJumps(successor, distance)
        self._answers: dict[Question, torch.Tensor] = {}

    def count(self, question: Question, random_steps: int, num_trials: int, generator: torch.Generator) -> Tally:
        """Run as many rollouts from each of the path's `T` states but the target, and count.

        Args:
            question: What makes a rollout a success.
            random_steps: r, at least 0: the random actions before the policy's. Each is uniform over the selectable
                ones; where there is none the state stays.
            num_trials: Of each state, at least 0.
            generator: The stream of the draws, on the device.

        Raises:
            ValueError: The number of random actions is negative.
        """
        if random_steps < 0:
            raise ValueError(f"the number of random actions must be 0 or larger, not {random_steps}")
        return in_turns(
            lambda size: self._bank(question, random_steps, size, generator),
            self._path.num_steps,
            num_trials,
            _WALKERS.get(self._device.type, _WALKERS_ELSEWHERE),
        )

    def random_phase(
        self, random_steps: int, size: int, generator: torch.Generator, *, denied: bool = False
    ) -> torch.Tensor:
        """Return `[T * size]` int32: where random actions lead, `size` walkers from each of the path's `T` states.

        Args:
            random_steps: r, at least 0.
            size: Walkers per state.
            generator: The stream of the draws, on the device.
            denied: Whether every action that the policy may take in `s_f` is forbidden there (`do(allow = 0)`).
        """
        featured = self._for_each(self._featured, size)
        if not denied:
            return self._free.walk(featured, random_steps, generator)
        if self._small:
            first = self._for_each(self._copies, size)
            return self._denied_copies.walk(featured.add_(first), random_steps, generator).sub_(first)
        last = torch.arange(self._path.num_steps, dtype=torch.int32, device=self._device) + self._mdp.num_states
        last = self._for_each(last, size)
        states = featured
        for _ in range(random_steps):
            states = self._denied.draw(torch.where(states == featured, last, states), generator)
        return states

    @cached_property
    def _copies(self) -> torch.Tensor:
        """`[T]` int32: the number of the first state in each path state's copy of the world."""
        return torch.arange(self._path.num_steps, dtype=torch.int32, device=self._device) * self._mdp.num_states

    @staticmethod
    def _for_each(values: torch.Tensor, size: int) -> torch.Tensor:
        """Return `[T]` values for `[T * size]` walkers."""
        return values.repeat_interleave(size)

    def _drawer(self, weights: NDArray[np.float64]) -> Drawer:
        return Drawer(fill_urns(self._mdp, np.arange(self._mdp.num_states), weights), self._device)

    @cached_property
    def _denied(self) -> Drawer:
        """The urns of all states, and behind them one for each state of the path, without its optimal actions."""
        featured, without = self._without_optimal
        states = np.concatenate((np.arange(self._mdp.num_states), featured))
        return Drawer(
            fill_urns(self._mdp, states, uniform(np.concatenate((self._mdp.selectable, without)))), self._device
        )

    @cached_property
    def _denied_copies(self) -> Drawer:
        """The urns of `T` copies of the world, each without the optimal actions of one state of the path."""
        num_copies = self._path.num_steps
        featured, without = self._without_optimal
        allowed = np.tile(self._mdp.selectable, (num_copies, 1))
        allowed[np.arange(num_copies) * self._mdp.num_states + featured] = without
        states = np.tile(np.arange(self._mdp.num_states), num_copies)
        urns = side_by_side(fill_urns(self._mdp, states, uniform(allowed)), num_copies)
        return Drawer(urns, self._device, num_blocks=num_copies)

    @property
    def _without_optimal(self) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """The states of the path, `[T]`, and which actions are selectable when the policy's are not, `[T, A]`."""
        featured = np.array(self._path.states[:-1], dtype=np.int64)
        return featured, self._mdp.selectable[featured] & (self._chances[featured] == 0)

    def _bank(self, question: Question, random_steps: int, size: int, generator: torch.Generator) -> Tally:
        states = self.random_phase(random_steps, size, generator, denied=question == "arrives_denied")
        if self._jumps is None:
            succeeded, truncated = self._roll_out(question, states, self._for_each(self._featured, size), generator)
            lost = truncated.view(-1, size).count_nonzero(dim=1).cpu().numpy()
        else:
            succeeded, lost = self._look_up(question, states, size), np.zeros(self._path.num_steps, dtype=np.int64)
        return Tally(size, succeeded.view(-1, size).count_nonzero(dim=1).cpu().numpy(), lost)

    def _look_up(self, question: Question, states: torch.Tensor, size: int) -> torch.Tensor:
        """Return `[N]`: True for the walkers that succeed under a policy without chance."""
        if not self._small:
            return self._foresee(question, states, self._for_each(self._featured, size))
        if question not in self._answers:
            num_states = self._mdp.num_states
            everywhere = torch.arange(num_states, dtype=torch.int32, device=self._device).repeat(self._path.num_steps)
            self._answers[question] = self._foresee(question, everywhere, self._for_each(self._featured, num_states))
        place = states.view(-1, size) + self._copies[:, None]
        return self._answers[question].index_select(0, place.view(-1))

    def _foresee(self, question: Question, states: torch.Tensor, featured: torch.Tensor) -> torch.Tensor:
        if self._jumps is None:
            raise TypeError("where there is chance nothing can be foreseen")
        if question == "returns":
            return self._jumps.meet(states, featured)
        arrived = self._jumps.arrive(states)
        if question == "arrives":
            return arrived
        return arrived & (states != featured) & ~self._jumps.meet(states, featured)

    def _roll_out(
        self, question: Question, states: torch.Tensor, featured: torch.Tensor, generator: torch.Generator
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Return `[N]` and `[N]`: True for the walkers that succeed, and for those that were broken off."""
        if question == "returns":
            # The test for the featured state comes after each action, so the first action is taken before any test.
            states = torch.where(self._over[states], states, self._policy.draw(states, generator))
        ends, truncated = self._follow(states, None if question == "arrives" else featured, generator)
        return (ends == featured if question == "returns" else self._goal[ends]), truncated

    def _follow(
        self, states: torch.Tensor, featured: torch.Tensor | None, generator: torch.Generator
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Follow the policy until the goal is reached or out of reach, or until the featured state.

        Returns:
            `[N]` where the walkers ended, and `[N]` True for those that were broken off.
        """
        ends, who = states.clone(), torch.arange(len(states), device=self._device)
        for _ in range(MAX_POLICY_STEPS + 1):
            stopped = self._over.index_select(0, states)
            if featured is not None:
                stopped |= states == featured.index_select(0, who)
            ends.index_copy_(0, who, states)
            who, states = who[~stopped], states[~stopped]
            if not len(who):
                break
            states = self._policy.draw(states, generator)
        truncated = torch.zeros(len(ends), dtype=torch.bool, device=self._device)
        truncated[who] = True
        return ends, truncated


def check_way(mdp: StochasticMDP, chances: StochasticPolicy, path: Trajectory) -> None:
    """Refuse a path that a policy, `[S, A]`, may not take to a goal.

    Raises:
        ValueError: The message names the first state where it is not.
    """
    if min(path.states) < 0 or max(path.states) >= mdp.num_states:
        raise ValueError(f"a path's states must be indices from 0 to {mdp.num_states - 1}, not {path.states}")
    for (state, action), after in zip(path.pairs, path.states[1:], strict=True):
        row = state * mdp.num_actions + action
        outcomes = mdp.next_state[mdp.row_start[row] : mdp.row_start[row + 1]]
        if not 0 <= action < mdp.num_actions or not chances[state, action] or after not in outcomes:
            raise ValueError(f"the path leaves the policy in {mdp.states[state]!r}")
    if not mdp.goal[path.states[-1]]:
        raise ValueError(f"the path must end in a goal, not in {mdp.states[path.states[-1]]!r}")
