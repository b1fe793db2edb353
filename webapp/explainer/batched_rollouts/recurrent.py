"""Algorithm 1's rollouts through a recurrent world model: many walkers at once, the hidden state carried along.

A walker starts with a zero hidden state in a state of the path, takes random actions and then the policy's. What the
model predicts is what the walker observes next. Sakai et al. 2021, section 4.2.1 and Algorithm 1; `table` does the same
on a table.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import torch
from numpy.typing import NDArray

from webapp.explainer.mdp import DeterministicMDP, Policy, StateAction
from webapp.explainer.solvers import Trajectory
from webapp.explainer.trials import Question, Tally, in_turns

Indices = NDArray[np.int64]
"""`[N]` state indices, one per walker."""

_MAX_WALKERS = 10_000
"""So many rollouts run at once: each takes A copies of its hidden state, some 10 KiB."""


class RecurrentWorldModel(Protocol):
    """A world model with a hidden state, asked for many walkers at once.

    Attributes:
        num_actions: A.
    """

    num_actions: int

    def initial(self, batch: int) -> torch.Tensor:
        """Return the hidden state `[batch, units]` in which an episode begins."""

    def step(
        self, hidden: torch.Tensor, states: torch.Tensor, actions: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Predict one step.

        Args:
            hidden: `[B, units]`.
            states: `[B, components]` int64.
            actions: `[B]` int64.

        Returns:
            The next hidden state `[B, units]`, the most probable next states `[B, components]`, and `[B]` whether the
            episode most probably ends there.
        """


@dataclass(frozen=True, slots=True, eq=False)
class Walkers:
    """Where some walkers are.

    Attributes:
        hidden: `[N, units]`: the model's hidden state of each.
        states: `[N, components]` int64.
    """

    hidden: torch.Tensor
    states: torch.Tensor


class RecurrentRollouts:
    """Rollouts of one policy from the states of its path in one recurrent world model.

    The policy is that of a table of the world; a walker that the model sends to a state which the table does not have
    is lost: it stays there, and neither returns nor arrives.
    """

    def __init__(self, model: RecurrentWorldModel, mdp: DeterministicMDP, policy: Policy, path: Trajectory) -> None:
        """Prepare rollouts.

        Args:
            model: The world model.
            mdp: The world's table, whose labels are tuples of as many numbers as the model's states have components.
            policy: `[S]` on that table.
            path: The policy's path to the goal.
        """
        labels = torch.from_numpy(np.array(mdp.states, dtype=np.int64))
        self._model, self._mdp, self._path = model, mdp, path
        self._labels = labels
        self._sizes = labels.max(dim=0).values + 1
        self._index_of = torch.full((int(self._sizes.prod()),), mdp.num_states)
        self._index_of[self._number(labels)] = torch.arange(mdp.num_states)
        self._policy = torch.from_numpy(policy.astype(np.int64))

    def count(self, question: Question, random_steps: int, num_trials: int, generator: torch.Generator) -> Tally:
        """Run as many rollouts from each of the path's `T` states but the target, and count.

        A walker that takes S actions of the policy without success counts as broken off: on a table it would move in a
        loop, but a hidden state may lead out of one.

        Args:
            question: What makes a rollout a success.
            random_steps: r, at least 0: the random actions before the policy's.
            num_trials: Of each state, at least 0.
            generator: The stream of the draws.

        Raises:
            ValueError: The number of random actions is negative.
        """

        def run(size: int) -> Tally:
            featured = np.array(self._path.states[:-1], dtype=np.int64).repeat(size)
            forbidden = [pair for pair in self._path.pairs for _ in range(size)]
            denied = question == "arrives_denied"
            walkers = self.walk_randomly(
                self.start(featured), random_steps, generator, forbidden=forbidden if denied else None
            )
            if question == "returns":
                succeeded, truncated = self.returns(walkers, featured)
            else:
                succeeded, truncated = self.arrivals(walkers, blocked=featured if denied else None)
            return Tally(size, succeeded.reshape(-1, size).sum(axis=1), truncated.reshape(-1, size).sum(axis=1))

        return in_turns(run, self._path.num_steps, num_trials, _MAX_WALKERS)

    def start(self, indices: Indices) -> Walkers:
        """Return walkers in some states of the table, `[N]` indices, with the hidden state of an episode's begin."""
        return Walkers(self._model.initial(len(indices)), self._labels[torch.from_numpy(indices)])

    def walk_randomly(
        self,
        walkers: Walkers,
        num_steps: int,
        generator: torch.Generator,
        *,
        forbidden: list[StateAction] | None = None,
    ) -> Walkers:
        """Take random actions, each uniform over the selectable ones; where there is none the walker stays as it is.

        An action is selectable if by the model, with the walker's hidden state, it changes the state and does not end
        the episode.

        Args:
            walkers: N of them.
            num_steps: How many random actions each takes.
            generator: The stream of the draws; one number is drawn per walker and action.
            forbidden: For each walker a state and an action that is not selectable there (`do(allow = 0)`), if any.

        Raises:
            ValueError: The number of actions is negative.
        """
        if num_steps < 0:
            raise ValueError(f"the number of random actions must be 0 or larger, not {num_steps}")
        denied = np.array(forbidden or [], dtype=np.int64).reshape(-1, 2)
        denied_actions = torch.from_numpy(denied[:, 1])
        for _ in range(num_steps):
            hidden, states, allowed = self._look_ahead(walkers)
            if forbidden is not None:
                there = self._is_at(walkers, denied[:, 0])
                allowed[there, denied_actions[there]] = False
            num_allowed = allowed.sum(dim=1)
            rank = (torch.rand(len(allowed), generator=generator, dtype=torch.float64) * num_allowed).long()
            chosen = (allowed.cumsum(dim=1) > rank[:, None]).int().argmax(dim=1)
            moves, place = num_allowed > 0, torch.arange(len(chosen))
            walkers = Walkers(
                torch.where(moves[:, None], hidden[place, chosen], walkers.hidden),
                torch.where(moves[:, None], states[place, chosen], walkers.states),
            )
        return walkers

    def returns(self, walkers: Walkers, featured: Indices) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Follow the policy from each walker until the goal or until the featured state.

        The test for the featured state comes after each action, as in Algorithm 1.

        Args:
            walkers: N of them.
            featured: `[N]`: the index of each one's `s_f`.

        Returns:
            `[N]` and `[N]`: True for the walkers that meet it, and for those still on their way after S actions.
        """
        returned = torch.zeros(len(walkers.states), dtype=torch.bool)
        on_way = torch.arange(len(walkers.states))
        for _ in range(self._mdp.num_states):
            walkers, on_way = self._select(walkers, on_way, self._can_act(walkers))
            if not len(on_way):
                break
            walkers, ended = self._follow(walkers)
            met = self._is_at(walkers, featured[on_way.numpy()])
            returned[on_way[met]] = True
            walkers, on_way = self._select(walkers, on_way, ~met & ~ended)
        return returned.numpy(), self._marked(on_way, len(returned))

    def arrivals(
        self, walkers: Walkers, *, blocked: Indices | None = None
    ) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Follow the policy from each walker until the episode ends.

        Args:
            walkers: N of them.
            blocked: `[N]`: the index of the state in which each one's policy action is forbidden (`do(allow = 0)`):
                whoever stands there is stuck.

        Returns:
            `[N]` and `[N]`: True for the walkers whose episode ends in a goal, and for those still on their way after
            S actions.
        """
        arrived = torch.zeros(len(walkers.states), dtype=torch.bool)
        on_way = torch.arange(len(walkers.states))
        for _ in range(self._mdp.num_states):
            going = self._can_act(walkers)
            if blocked is not None:
                going &= ~self._is_at(walkers, blocked[on_way.numpy()])
            walkers, on_way = self._select(walkers, on_way, going)
            if not len(on_way):
                break
            walkers, ended = self._follow(walkers)
            arrived[on_way[ended & self._holds(self._mdp.goal, walkers)]] = True
            walkers, on_way = self._select(walkers, on_way, ~ended)
        return arrived.numpy(), self._marked(on_way, len(arrived))

    @staticmethod
    def _marked(who: torch.Tensor, num_walkers: int) -> NDArray[np.bool_]:
        """Return `[N]`: True for some walkers."""
        flags = np.zeros(num_walkers, dtype=np.bool_)
        flags[who.numpy()] = True
        return flags

    def _look_ahead(self, walkers: Walkers) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Predict every action: hidden states `[N, A, units]`, states `[N, A, components]`, selectable `[N, A]`."""
        num_walkers, num_actions = len(walkers.states), self._model.num_actions
        hidden, states = (part.repeat_interleave(num_actions, dim=0) for part in (walkers.hidden, walkers.states))
        after, next_states, ended = self._model.step(hidden, states, torch.arange(num_actions).repeat(num_walkers))
        allowed = (next_states != states).any(dim=1) & ~ended
        shape = (num_walkers, num_actions)
        return after.view(*shape, -1), next_states.view(*shape, -1), allowed.view(shape)

    def _is_at(self, walkers: Walkers, indices: Indices) -> torch.Tensor:
        """Return `[N]`: True for the walkers that are each in one state of the table, `[N]` indices."""
        return (walkers.states == self._labels[torch.from_numpy(indices)]).all(dim=1)

    def _can_act(self, walkers: Walkers) -> torch.Tensor:
        """Return `[N]`: True for the walkers whose state the table has and does not end the episode."""
        return self._holds(~self._mdp.terminal, walkers)

    def _holds(self, flags: NDArray[np.bool_], walkers: Walkers) -> torch.Tensor:
        """Return `[N]`: the flag `[S]` of each walker's state, False where the table does not have it."""
        return torch.cat((torch.from_numpy(flags), torch.tensor([False])))[self._indices(walkers.states)]

    @staticmethod
    def _select(walkers: Walkers, who: torch.Tensor, chosen: torch.Tensor) -> tuple[Walkers, torch.Tensor]:
        return Walkers(walkers.hidden[chosen], walkers.states[chosen]), who[chosen]

    def _follow(self, walkers: Walkers) -> tuple[Walkers, torch.Tensor]:
        actions = self._policy[self._indices(walkers.states)]
        hidden, states, ended = self._model.step(walkers.hidden, walkers.states, actions)
        return Walkers(hidden, states), ended

    def _indices(self, states: torch.Tensor) -> torch.Tensor:
        """Return `[N]` table indices, S where the table does not have the state."""
        inside = (states < self._sizes).all(dim=1)
        return torch.where(inside, self._index_of[self._number(states) * inside], self._mdp.num_states)

    def _number(self, states: torch.Tensor) -> torch.Tensor:
        """Number states `[N, components]` by their components, the last counting fastest."""
        number = torch.zeros(len(states), dtype=torch.int64)
        for component, size in enumerate(self._sizes):
            number = number * size + states[:, component]
        return number
