"""Samples for the tests, drawn at random under one budget."""

import numpy as np
from hypothesis import strategies as st

from webapp.analysis.censoring import Sample

BUDGET = 30


@st.composite
def samples(draw: st.DrawFn, min_size: int = 1, max_size: int = 12) -> Sample:
    """Draw runs with many ties; some take the whole budget and get there, some are stopped at it."""
    numbers = draw(st.lists(st.integers(1, BUDGET + 6), min_size=min_size, max_size=max_size))
    return Sample.of(np.minimum(numbers, BUDGET), np.array(numbers) <= BUDGET)


def run_on(sample: Sample, value: float) -> Sample:
    """Return the sample as it had been if the stopped runs had got there at `value`."""
    return Sample.of(np.where(sample.observed, sample.values, value))


def reordered(sample: Sample, rng: np.random.Generator) -> Sample:
    """Return the same runs in another order."""
    order = rng.permutation(sample.size)
    return Sample.of(sample.values[order], sample.observed[order])


def with_one_run_stopped(sample: Sample, run: int) -> Sample:
    """Return the sample as it had been if one run had not got there."""
    stopped = np.arange(sample.size) == run
    return Sample.of(np.where(stopped, BUDGET, sample.values), sample.observed & ~stopped)


def exponential(rng: np.random.Generator, size: int, mean: float = 1.0) -> Sample:
    """Draw from a distribution of which all that is estimated here is known."""
    return Sample.of(rng.exponential(mean, size))
