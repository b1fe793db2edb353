"""Time batched sampling against a plain loop over the same tables, and fail if it is not 50 times faster.

python -m tests.benchmarks.batched_sampling

Both run on one thread and by turns, and the medians over the turns of the processor's time are compared. Both have
their tables ready: lists of lists for the loop, arrays for the batches. Measure on a quiet machine: on a busy one a
short run finds an undisturbed moment more easily than a long one, which flatters the batches.
"""

import os

os.environ["OMP_NUM_THREADS"] = "1"  # Before NumPy and torch are loaded: the promise is about one thread.

import math
import random
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch

from tests.worlds import LAYOUTS
from webapp.explainer.batched_rollouts import TableRollouts, seeded
from webapp.explainer.importance import PROBABILITY_KINDS, Importance, ProbabilityKind, exact_importance
from webapp.explainer.mdp import DeterministicMDP, Policy
from webapp.explainer.sampling import QUESTIONS, importance_of, sample
from webapp.explainer.solvers import Trajectory, follow, plan
from webapp.explainer.stop_rule import StopRule
from webapp.explainer.worlds.key_door import tabulate

LAYOUT = "simulation"
RANDOM_STEPS = 10
NUM_TRIALS = 1000
PROMISED = 50.0
TURNS, SECONDS = 7, 0.25
"""In each turn each way runs again and again for as long, and its best run counts, as in `timeit`."""
CPU = torch.device("cpu")


@dataclass(frozen=True)
class PlainLoop:
    """Algorithm 1 as one would write it by hand: lists, and no test that the tables have made already."""

    random_next: list[list[int]]
    policy_next: list[int]
    terminal: list[bool]
    path: Trajectory

    @classmethod
    def over(cls, mdp: DeterministicMDP, policy: Policy, path: Trajectory) -> "PlainLoop":
        table, allowed = mdp.next_state.tolist(), mdp.selectable
        random_next = [
            [after for action, after in enumerate(row) if allowed[state, action]] or [state]
            for state, row in enumerate(table)
        ]
        policy_next = [row[action] for row, action in zip(table, policy.tolist(), strict=True)]
        return cls(random_next, policy_next, mdp.terminal.tolist(), path)

    def importance(self, kind: ProbabilityKind, seed: int) -> list[float]:
        draw = random.Random(seed).random
        if kind == "return_probability":
            return [self._returned(featured, draw) / NUM_TRIALS for featured in self.path.states[:-1]]
        return [
            (self._arrived(state, draw) - self._arrived_denied(state, after, draw)) / NUM_TRIALS
            for state, after in zip(self.path.states, self.path.states[1:], strict=False)
        ]

    def _returned(self, featured: int, draw: Callable[[], float]) -> int:
        random_next, policy_next, terminal = self.random_next, self.policy_next, self.terminal
        count = 0
        for _ in range(NUM_TRIALS):
            state = featured
            for _ in range(RANDOM_STEPS):
                choices = random_next[state]
                state = choices[int(draw() * len(choices))]
            while not terminal[state]:
                state = policy_next[state]
                if state == featured:
                    count += 1
                    break
        return count

    def _arrived(self, featured: int, draw: Callable[[], float]) -> int:
        random_next, policy_next, terminal = self.random_next, self.policy_next, self.terminal
        count = 0
        for _ in range(NUM_TRIALS):
            state = featured
            for _ in range(RANDOM_STEPS):
                choices = random_next[state]
                state = choices[int(draw() * len(choices))]
            while not terminal[state]:
                state = policy_next[state]
            count += 1
        return count

    def _arrived_denied(self, featured: int, after: int, draw: Callable[[], float]) -> int:
        """In these maps an action leads to where no other one does, so forbidding it is forbidding its outcome."""
        kept = self.random_next[featured]
        self.random_next[featured] = [state for state in kept if state != after] or [featured]
        random_next, policy_next, terminal = self.random_next, self.policy_next, self.terminal
        count = 0
        for _ in range(NUM_TRIALS):
            state = featured
            for _ in range(RANDOM_STEPS):
                choices = random_next[state]
                state = choices[int(draw() * len(choices))]
            while state != featured:
                if terminal[state]:
                    count += 1
                    break
                state = policy_next[state]
        self.random_next[featured] = kept
        return count


def main() -> int:
    """Print medians and ratios for both kinds of importance, and return 0 if all promises are kept."""
    torch.set_num_threads(1)
    mdp = tabulate(LAYOUTS[LAYOUT])
    policy = plan(mdp)
    path = follow(mdp, policy)
    print(f"{LAYOUT}: {mdp.num_states} states, {path.num_steps} of them sampled, {NUM_TRIALS} trials each, one thread")
    kept = [_compare(kind, mdp, policy, path) for kind in PROBABILITY_KINDS]
    return 0 if all(kept) else 1


def _compare(kind: ProbabilityKind, mdp: DeterministicMDP, policy: Policy, path: Trajectory) -> bool:
    loop, rollouts, generator = PlainLoop.over(mdp, policy, path), TableRollouts(mdp, policy, path, CPU), seeded(0)

    def batched() -> Importance:
        return importance_of([rollouts.count(each, RANDOM_STEPS, NUM_TRIALS, generator) for each in QUESTIONS[kind]])

    exact = exact_importance(kind, mdp, policy, path, RANDOM_STEPS).values
    _check(exact, np.array([*loop.importance(kind, 0), 0.0]))
    _check(exact, batched().values)
    ways: dict[str, Callable[[], object]] = {
        "plain loop over lists": lambda: loop.importance(kind, 1),
        "batched, tables ready": batched,
        "batched, tables and sides included": lambda: sample(
            kind, mdp, policy, path, RANDOM_STEPS, StopRule(NUM_TRIALS), 1, "cpu"
        ),
        "exact solver": lambda: exact_importance(kind, mdp, policy, path, RANDOM_STEPS),
    }
    taken: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(TURNS):
        for name, run in ways.items():
            taken[name].append(_best_milliseconds(run))
    medians = {name: statistics.median(times) for name, times in taken.items()}
    plain, ratio = medians["plain loop over lists"], medians["plain loop over lists"] / medians["batched, tables ready"]
    print(f"{kind}:")
    for name, median in medians.items():
        print(f"  {name:36} {median:9.3f} ms   {plain / median:7.1f} times as fast as the plain loop")
    print(f"  ratio {ratio:.1f}   promised {PROMISED:.0f}   {'kept' if ratio >= PROMISED else 'BROKEN'}")
    return ratio >= PROMISED


def _check(exact: np.ndarray, sampled: np.ndarray) -> None:
    """Nobody is fast with wrong numbers."""
    if np.any(np.abs(sampled - exact) > 5 * np.sqrt(0.5 / NUM_TRIALS)):
        raise AssertionError(f"sampled {sampled}, exact {exact}")


def _best_milliseconds(action: Callable[[], object]) -> float:
    best, ends = math.inf, time.perf_counter() + SECONDS
    while time.perf_counter() < ends:
        began = time.process_time()
        action()
        best = min(best, time.process_time() - began)
    return 1000 * best


if __name__ == "__main__":
    sys.exit(main())
