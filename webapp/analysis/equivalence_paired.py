"""Whether two kinds are rated alike but for a margin: to find no difference does not show it.

Two one-sided t tests on differences within persons (D. J. Schuirmann 1987, A comparison of the two one-sided tests
procedure and the power approach, J. Pharmacokinetics and Biopharmaceutics 15, 657-680). Equivalence at the level alpha
is the same as the interval at 1 - 2 alpha lying within the margin.

Of a one-sided test skewness shifts the level more than of a two-sided one, in which both sides nearly cancel.
"""

import math
from dataclasses import dataclass
from typing import Literal

from numpy.typing import ArrayLike
from scipy import stats

from webapp.analysis.paired import spread

Conclusion = Literal["equivalent", "equivalent though different", "different", "undecided"]


@dataclass(frozen=True, slots=True)
class Tost:
    """Two one-sided tests of a mean difference against a margin.

    Attributes:
        num_people: N.
        mean: Of the differences.
        standard_error: Of the mean.
        low: Lower end of the interval at 1 - 2 alpha.
        high: Upper end.
        t_lower: The statistic against `-margin`.
        t_upper: The statistic against `margin`.
        p_lower: Of the hypothesis that the mean is `-margin` or less: small if the first is as good but for the margin.
        p_upper: Of the hypothesis that the mean is `margin` or more.
        p_difference: Of the hypothesis that the mean is 0, two-sided.
    """

    num_people: int
    mean: float
    standard_error: float
    low: float
    high: float
    t_lower: float
    t_upper: float
    p_lower: float
    p_upper: float
    p_difference: float

    @property
    def p_equivalence(self) -> float:
        """The p-value of equivalence: the larger of the two."""
        return max(self.p_lower, self.p_upper)


def paired_tost(differences: ArrayLike, margin: float, alpha: float = 0.05) -> Tost:
    """Test whether the mean of differences lies within a margin.

    Args:
        differences: `[N]`, one per person.
        margin: Above 0, in the unit of the differences.
        alpha: The level, above 0 and below a half.

    Raises:
        Undefined: There are fewer than two differences, or all are equal.
        ValueError: The margin or the level is out of range.

    Example:
        >>> found = paired_tost([0.5, -0.5, 0, 0.5, -0.5, 0, 0.5, 0], margin=0.5)
        >>> round(found.mean, 4), round(found.p_equivalence, 5)
        (0.0625, 0.01047)
    """
    if not 0 < margin < math.inf:
        raise ValueError(f"a margin must be above 0 and finite, not {margin}")
    if not 0 < alpha < 0.5:  # noqa: PLR2004 - an interval needs a level above 0
        raise ValueError(f"the level must lie between 0 and .5, not at {alpha}")
    mean, sd, n = spread(differences)
    error = sd / math.sqrt(n)
    half = float(stats.t.ppf(1 - alpha, n - 1)) * error
    t_lower, t_upper = (mean + margin) / error, (mean - margin) / error
    return Tost(
        num_people=n,
        mean=mean,
        standard_error=error,
        low=mean - half,
        high=mean + half,
        t_lower=t_lower,
        t_upper=t_upper,
        p_lower=float(stats.t.sf(t_lower, n - 1)),
        p_upper=float(stats.t.cdf(t_upper, n - 1)),
        p_difference=min(1.0, 2 * float(stats.t.sf(abs(mean / error), n - 1))),
    )


def level_with_skewness(skew: float, num_people: int, alpha: float) -> float:
    """Return about how often a one-sided t test at a level errs on the side on which it errs more, given a skewness.

    The first term of the Edgeworth expansion (P. Hall 1992, The Bootstrap and Edgeworth Expansion, section 2.6).

    Args:
        skew: Of the differences.
        num_people: N.
        alpha: The level.

    Example:
        >>> round(level_with_skewness(0, 30, 0.05), 4), round(level_with_skewness(1.0, 100, 0.05), 4)
        (0.05, 0.061)
    """
    z = float(stats.norm.ppf(1 - alpha))
    shift = abs(skew) * (2 * z * z + 1) * float(stats.norm.pdf(z)) / (6 * math.sqrt(num_people))
    return alpha + shift


def conclusion(p_equivalence: float, p_difference: float, alpha: float) -> Conclusion:
    """Put both tests into a word.

    Args:
        p_equivalence: Of the equivalence test, adjusted for the family.
        p_difference: Of the test for a difference, adjusted likewise.
        alpha: The level of the family.

    Example:
        >>> conclusion(0.2, 0.3, 0.05), conclusion(0.01, 0.01, 0.05)
        ('undecided', 'equivalent though different')
    """
    is_equivalent, is_different = p_equivalence < alpha, p_difference < alpha
    if is_equivalent:
        return "equivalent though different" if is_different else "equivalent"
    return "different" if is_different else "undecided"
