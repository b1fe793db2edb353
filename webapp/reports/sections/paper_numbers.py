"""The numbers that Sakai et al. 2021 print in section 6, each with its place, and which experiments they belong to.

Heights of bars, standard deviations, numbers of ratings per cell and the tests behind the figures were never printed.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Literal

PaperExperiment = Literal["1", "2"]

KINDS: Mapping[PaperExperiment, frozenset[str]] = {
    "1": frozenset({"full", "subgoals", "random"}),
    "2": frozenset({"all_key_points", "first_key_point"}),
}
LIKELINESS, LOVELINESS, GENERAL = "likeliness", "loveliness", "general"
ITEMS = (LIKELINESS, LOVELINESS, GENERAL)
NUM_PARTICIPANTS = 60
RATINGS_EACH = 3
"""How many explanations everybody rated in Experiment 1, one of each kind."""


@dataclass(frozen=True, slots=True)
class Printed:
    """Something that the paper prints.

    Attributes:
        text: As it stands in a table of ours.
        place: Where the paper has it.
        value: The number; None for a claim without one.
        is_lower_bound: Whether the paper says that the number is exceeded.
    """

    text: str
    place: str
    value: float | None = None
    is_lower_bound: bool = False


_ABOVE_4 = Printed("> 4", "section 6.2, text", 4.0, is_lower_bound=True)
MEANS: Mapping[tuple[PaperExperiment, str, str], Printed] = {
    ("1", "subgoals", LIKELINESS): Printed("3.38", "section 6.2, text", 3.38),
    ("2", "all_key_points", LIKELINESS): _ABOVE_4,
    ("2", "first_key_point", LIKELINESS): _ABOVE_4,
}
"""Means of ratings, by experiment, kind and item."""

VARIANCES: Mapping[tuple[PaperExperiment, str, str], Printed] = {
    ("2", "all_key_points", GENERAL): Printed("0.93", "section 6.2, text", 0.93),
    ("2", "first_key_point", GENERAL): Printed("1.45", "section 6.2, text", 1.45),
}
"""Variances of ratings, by experiment, kind and item."""

_SUBGOALS_HIGHER = Printed("subgoals higher", "section 6.1, text")
COMPARISONS: Mapping[tuple[PaperExperiment, frozenset[str], str], Printed] = {
    **{("1", frozenset({"subgoals", "random"}), item): _SUBGOALS_HIGHER for item in ITEMS},
    ("1", frozenset({"subgoals", "full"}), LOVELINESS): _SUBGOALS_HIGHER,
    ("2", KINDS["2"], LIKELINESS): Printed("do not differ", "section 6.2, text"),
    ("2", KINDS["2"], LOVELINESS): Printed("differ", "section 6.2, text"),
    ("2", KINDS["2"], GENERAL): Printed("do not differ", "section 6.2, text"),
}
"""What is said of two kinds, by experiment, kinds and item. No test, no statistic and no p value is given."""

CORRELATIONS: Mapping[str, Printed] = {
    LIKELINESS: Printed("0.74", "section 6.1, text", 0.74),
    LOVELINESS: Printed("0.08", "section 6.1, text", 0.08),
}
"""Of Experiment 1, with the general rating."""


@dataclass(frozen=True, slots=True)
class PrintedF:
    """An F test of the analysis of variance of Experiment 1, section 6.1, all digits as printed.

    Attributes:
        effect: `first` is likeliness, `second` is loveliness.
        statistic: F.
        p_value: Of it; where `is_upper_bound`, it is smaller.
        is_upper_bound: Whether the paper gives a bound for p.
    """

    effect: Literal["first", "second", "interaction"]
    statistic: str
    p_value: str
    is_upper_bound: bool = False

    @property
    def text(self) -> str:
        """As it stands in a table of ours."""
        return f"F = {self.statistic}, p {'<' if self.is_upper_bound else '='} {self.p_value}"


PRINTED_F = (
    PrintedF("first", "67.65", ".001", is_upper_bound=True),
    PrintedF("second", "2.20", ".143"),
    PrintedF("interaction", "6.56", ".012"),
)
PRINTED_FREEDOM = "3.98"
"""What stands in brackets after each F, where two numbers belong."""

CELLS: Mapping[tuple[bool, bool], Printed] = {
    (False, False): Printed("2.17", "table 1", 2.17),
    (False, True): Printed("1.98", "table 1", 1.98),
    (True, False): Printed("3.23", "table 1", 3.23),
    (True, True): Printed("4.07", "table 1", 4.07),
}
"""Means of the general rating in Experiment 1, by whether likeliness and whether loveliness is 4 or 5."""

SIMPLE_EFFECTS: Mapping[bool, Printed] = {
    False: Printed("p = .251", "table 1", 0.251),
    True: Printed("p < .001", "table 1"),
}
"""One-sided p values of unpaired t tests, by whether likeliness is 4 or 5."""


def paper_experiment(kinds: Collection[str]) -> PaperExperiment | None:
    """Return the experiment of the paper that has just these kinds, or None.

    An experiment with further kinds has no counterpart: what is computed over all of its ratings is something else.
    """
    return next((name for name, known in KINDS.items() if known == frozenset(kinds)), None)
