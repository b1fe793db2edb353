"""Selectors that know nothing but the length of the path."""

import numpy as np

from webapp.explainer.selectors.ranking import check_count


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

    Example:
        >>> import numpy as np
        >>> from webapp.explainer import random_pair_steps
        >>> random_pair_steps(20, 4, np.random.default_rng(0))
        (6, 10, 12, 15)
    """
    if not 0 <= count <= num_steps:
        raise ValueError(f"{count} different steps cannot be drawn from a path of {num_steps}")
    return tuple(sorted(int(step) + 1 for step in rng.choice(num_steps, size=count, replace=False)))


def evenly_spaced_steps(num_steps: int, count: int) -> tuple[int, ...]:
    """Return the middle steps of `count` equal parts of a path.

    Sampling at a fixed rate is the plainest way to pick key frames (Truong & Venkatesh 2007, "Video abstraction: a
    systematic review and classification", ACM TOMM 3(1)).

    Args:
        num_steps: T.
        count: How many, from 0 to T.

    Raises:
        ValueError: The path does not have so many steps.

    Example:
        >>> from webapp.explainer import evenly_spaced_steps
        >>> evenly_spaced_steps(num_steps=20, count=4)
        (3, 8, 13, 18)
    """
    check_count(num_steps, count)
    return tuple((2 * part + 1) * num_steps // (2 * count) + 1 for part in range(count))
