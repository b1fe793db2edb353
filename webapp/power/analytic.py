"""A number to hold the simulated power against: the power of a paired t test, by formula."""

import math
from statistics import NormalDist

import numpy as np

from webapp.analysis.censoring import Undefined
from webapp.power.design import Questions, trials_of
from webapp.power.generation import within_sd
from webapp.study.experiments import Kind
from webapp.study.intervals import t_quantile


def paired_t_power(
    questions: Questions,
    kinds: tuple[Kind, Kind],
    effect: float,
    num_people: int,
    between_sd: float,
    level: float,
) -> float:
    """Return the power of a two-sided paired t test on the latent ratings themselves.

    The test takes those who see both kinds and, where they see one on several layouts, their mean. Their own level
    cancels, so the difference has the standard deviation `within * sqrt(1 / n1 + 1 / n2)`. Nobody observes latent
    ratings: rounding to a few points takes some power away, while ratings of people who see one kind alone, which this
    test leaves out, add some to the planned model's.

    Args:
        questions: Whose design it is.
        kinds: The two that are compared.
        effect: d, in standard deviations of the latent rating.
        num_people: How many take part, whatever they see.
        between_sd: The standard deviation of people's own levels.
        level: Of the test.

    Raises:
        Undefined: Fewer than two people see both kinds.
    """
    from statsmodels.stats.power import TTestPower  # noqa: PLC0415 - takes a second to load.

    names = list(questions.experiment.kinds)
    shown = trials_of(questions.experiment, num_people).kinds
    first, second = ((shown == names.index(kind)).sum(axis=1) for kind in kinds)
    both = (first > 0) & (second > 0)
    if both.sum() < 2:  # noqa: PLR2004 - one difference has no spread
        raise Undefined(f"{both.sum()} of {num_people} people see both {kinds[0]} and {kinds[1]}")
    if effect == 0:
        return level
    spread = within_sd(between_sd) * float(np.sqrt(np.mean(1 / first[both] + 1 / second[both])))
    num_pairs, size = int(both.sum()), effect / spread
    power = float(TTestPower().power(size, num_pairs, level, alternative="two-sided"))
    return power if math.isfinite(power) else _nearly_one(size, num_pairs, level)


def _nearly_one(size: float, num_pairs: int, level: float) -> float:
    """Return the power by the normal distribution: it is nearly 1 where SciPy's noncentral t gives no number."""
    critical = t_quantile(1 - level / 2, num_pairs - 1)
    return NormalDist().cdf(abs(size) * math.sqrt(num_pairs) - critical)
