"""Time the exact importance of a whole path against Algorithm 1 as it is printed, on one thread.

python -m tests.benchmarks.exact_importance

Built beforehand, for all three: the table of the world, the planner's policy and its path; and what each of them
derives from the table once per world, which is for the exact solver the table of one random step that the MDP keeps.
Algorithm 1 takes 1,000 trials per state of the path, in plain Python:

- on lists made from the table;
- through the `step` of the Gymnasium environment. Its trials are alike and many, so 50 per state are timed and the time
  is scaled up to 1,000.

Measured is the processor's time, so that what else the machine does disturbs little.
"""

import os

os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}  # Before NumPy is loaded.

import statistics
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from random import Random

import numpy as np

from tests.worlds import LAYOUTS
from webapp.explainer.importance import exact_importance
from webapp.explainer.mdp import DeterministicMDP, Policy
from webapp.explainer.solvers import Trajectory, follow, plan
from webapp.explainer.worlds.environment import KeyDoorEnv
from webapp.explainer.worlds.key_door import key_door_state, tabulate

LAYOUT = LAYOUTS["simulation"]
RANDOM_STEPS = 10
NUM_TRIALS = 1000
NUM_STEPPED_TRIALS = 50
"""So many trials per state are timed through the environment."""
REPEATS = 7
NUM_CALLS = 200
"""The exact solver is called so often per repeat, and its time divided."""

Sampler = Callable[[int, int], list[float]]
"""Takes a number of trials per state and a seed, and returns an estimate per state of a path but the last."""


def main() -> int:
    """Print milliseconds, ratios and what was promised, one line per peer, and return 0 if all promises are kept."""
    mdp = tabulate(LAYOUT)
    policy = plan(mdp)
    path = follow(mdp, policy)
    sample_tables, sample_steps = table_sampler(mdp, policy, path), step_sampler(mdp, policy, path)
    exact = exact_importance("return_probability", mdp, policy, path, RANDOM_STEPS).values[:-1]
    solving, looping, stepping = [], [], []
    for seed in range(REPEATS):
        solving.append(_seconds(partial(_solve_often, mdp, policy, path)) / NUM_CALLS)
        looping.append(_seconds(partial(_sample, sample_tables, NUM_TRIALS, seed, exact)))
        stepped = _seconds(partial(_sample, sample_steps, NUM_STEPPED_TRIALS, seed, exact))
        stepping.append(stepped * NUM_TRIALS / NUM_STEPPED_TRIALS)
    solver = statistics.median(solving)
    print(f"{path.num_steps} states of a path, {mdp.num_states} of the world, {RANDOM_STEPS} random actions")
    print(f"{'exact':45} {solver * 1e3:10.3f} ms")
    kept = True
    for name, seconds, promise in (
        ("Algorithm 1, the environment's step", statistics.median(stepping), 1000),
        ("Algorithm 1, a plain loop over tables", statistics.median(looping), 100),
    ):
        ratio = seconds / solver
        kept &= ratio >= promise
        verdict = "kept" if ratio >= promise else "BROKEN"
        print(f"{name:45} {seconds * 1e3:10.3f} ms   {ratio:8.0f} times   promised {promise:5} times   {verdict}")
    return 0 if kept else 1


def table_sampler(mdp: DeterministicMDP, policy: Policy, path: Trajectory) -> Sampler:
    """Run Algorithm 1 as a plain loop: a draw is one index into a list, a step of the policy another."""
    choices = [row[allowed].tolist() or [s] for s, (row, allowed) in enumerate(_rows(mdp))]
    after = mdp.next_state[np.arange(mdp.num_states), policy].tolist()
    ended = mdp.terminal.tolist()

    def sample(num_trials: int, seed: int) -> list[float]:
        draw = Random(seed).random
        estimates = []
        for featured in path.states[:-1]:
            num_returns = 0
            for _ in range(num_trials):
                state = featured
                for _ in range(RANDOM_STEPS):
                    options = choices[state]
                    state = options[int(draw() * len(options))]
                while not ended[state]:
                    state = after[state]
                    if state == featured:
                        num_returns += 1
                        break
            estimates.append(num_returns / num_trials)
        return estimates

    return sample


def step_sampler(mdp: DeterministicMDP, policy: Policy, path: Trajectory) -> Sampler:
    """Run Algorithm 1 on the environment; the tables tell what may be drawn and what the policy does."""
    choices = {mdp.states[s]: np.flatnonzero(allowed).tolist() for s, (_, allowed) in enumerate(_rows(mdp))}
    chosen = {mdp.states[s]: int(policy[s]) for s in range(mdp.num_states)}
    env = KeyDoorEnv(LAYOUT)

    def sample(num_trials: int, seed: int) -> list[float]:
        choice = Random(seed).choice
        estimates = []
        for featured in (key_door_state(mdp, state) for state in path.states[:-1]):
            num_returns = 0
            for _ in range(num_trials):
                env.reset(options={"state": featured})
                for _ in range(RANDOM_STEPS):
                    if options := choices[env.state]:
                        env.step(choice(options))
                terminated = False
                while not terminated:
                    _, _, terminated, _, _ = env.step(chosen[env.state])
                    if env.state == featured:
                        num_returns += 1
                        break
            estimates.append(num_returns / num_trials)
        return estimates

    return sample


def _rows(mdp: DeterministicMDP) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    return zip(mdp.next_state, mdp.selectable, strict=True)


def _solve_often(mdp: DeterministicMDP, policy: Policy, path: Trajectory) -> None:
    for _ in range(NUM_CALLS):
        exact_importance("return_probability", mdp, policy, path, RANDOM_STEPS)


def _sample(sampler: Sampler, num_trials: int, seed: int, exact: np.ndarray) -> None:
    """Run Algorithm 1, and make sure that what is timed computes the same numbers."""
    estimates = sampler(num_trials, seed)
    errors = np.sqrt(exact * (1 - exact) / num_trials)
    if np.any(np.abs(np.array(estimates) - exact) > 6 * errors + 1e-9):
        raise ValueError(f"the sampled values {estimates} lie too far from the exact ones {exact.tolist()}")


def _seconds(action: Callable[[], None]) -> float:
    began = time.process_time()
    action()
    return time.process_time() - began


if __name__ == "__main__":
    sys.exit(main())
