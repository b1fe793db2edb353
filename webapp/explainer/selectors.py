"""Rival ways of choosing the steps that an explanation shows."""

import numpy as np


def random_pair_steps(num_steps: int, count: int, rng: np.random.Generator) -> tuple[int, ...]:
    """Draw state-action pairs of a path at random, each at most once, in path order (Sakai et al. 2021, section 6).

    Args:
        num_steps: T.
        count: How many pairs, from 0 to T; the study shows as many as there are subgoals.
        rng: The stream of the draw.

    Returns:
        `[count]` steps from 1 to T, ascending.

    Raises:
        ValueError: The path does not have so many steps.
    """
    if not 0 <= count <= num_steps:
        raise ValueError(f"{count} different steps cannot be drawn from a path of {num_steps}")
    return tuple(sorted(int(step) + 1 for step in rng.choice(num_steps, size=count, replace=False)))
