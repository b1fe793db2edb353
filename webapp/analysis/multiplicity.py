"""How to test several hypotheses and still be wrong about any of them with no more than the stated probability."""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def holm(p_values: ArrayLike) -> NDArray[np.float64]:
    """Adjust p values for how many they are, step by step from the smallest (Holm 1979).

    To reject what is adjusted to alpha or less keeps the probability of any false rejection at alpha, however the tests
    depend on each other.

    Args:
        p_values: `[M]`, each in [0, 1]; M may be 0.

    Returns:
        `[M]` in [0, 1], in the given order; never smaller than what was given.

    Raises:
        ValueError: They are not one row, or one is nan or out of range.

    Example:
        >>> holm([0.01, 0.04, 0.03, 0.005]).round(3).tolist()
        [0.03, 0.06, 0.06, 0.02]
    """
    given = np.asarray(p_values, dtype=np.float64)
    if given.ndim != 1:
        raise ValueError(f"p values must be one row, not of shape {given.shape}")
    wrong = ~((given >= 0) & (given <= 1))
    if wrong.any():
        raise ValueError(f"a p value must lie from 0 to 1, not at {given[wrong][0]}")
    order = np.argsort(given, kind="stable")
    stepped = given[order] * np.arange(given.size, 0, -1)
    adjusted = np.empty_like(given)
    adjusted[order] = np.minimum(1.0, np.maximum.accumulate(stepped))
    return adjusted
