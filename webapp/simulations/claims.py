"""What is claimed of two groups of learning runs, and what their numbers say to it.

The paper's way (Sakai et al. 2021, sections 5.2 and 5.3): an unpaired two-sample t-test at the level .05 with ten runs
per group, where what is not significant counts as no difference. Beside it ours, with all runs: Mann-Whitney tests
with Holm's correction over all comparisons of one variant, and equivalence by an interval for the ratio of the
interquartile means. Only that can support a claim of no difference; where neither is shown, the claim is undecided.
Where both are shown, the difference is smaller than the margin, and the groups count as equivalent.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import pandas as pd

from webapp.analysis.censoring import Sample, Undefined
from webapp.analysis.equivalence import is_equivalent, ratio_interval
from webapp.analysis.location import mean_of
from webapp.analysis.multiplicity import holm
from webapp.analysis.two_samples import (
    log_rank,
    mann_whitney,
    probability_of_improvement,
    student_t,
    welch_t,
)
from webapp.explainer.seeding import stream
from webapp.simulations.conditions import Condition
from webapp.simulations.settings import SweepSettings

LEVEL = 0.05
PAPER_RUNS = 10

Expectation = Literal["fewer", "not more", "not fewer", "no difference"]
"""Of the episodes of the first group, compared with the second's."""
Verdict = Literal["holds", "does not hold", "undecided"]


@dataclass(frozen=True, slots=True)
class Claim:
    """One claim on two groups.

    Attributes:
        statement: What is claimed, in words that several comparisons may share.
        source: The section of the paper, or `ours`.
        expects: Of the first group.
        first: The group that is spoken of.
        second: What it is compared with.
    """

    statement: str
    source: str
    expects: Expectation
    first: Condition
    second: Condition

    @property
    def variant(self) -> str:
        """The variant whose family of comparisons this belongs to."""
        return self.first.variant if self.first.variant != "none" else self.second.variant


def compare_groups(claims: Sequence[Claim], rows: pd.DataFrame, settings: SweepSettings) -> pd.DataFrame:
    """Test every claim and return one row for each, in their order.

    Args:
        claims: What is claimed.
        rows: Of all runs, as `sweeps.sweep` returns them.
        settings: Of the sweep.
    """
    table = pd.DataFrame([_compared(claim, rows, settings) for claim in claims])
    table["holm_p"] = table.groupby("variant", sort=False)["mann_whitney_p"].transform(
        lambda each: holm(each.to_numpy())
    )
    expected = [claim.expects for claim in claims]
    found = zip(expected, table["holm_p"], table["improvement"], table["equivalent"], strict=True)
    table["verdict"] = [_verdict(*each) for each in found]
    return table.astype({"paper_test_agrees": "boolean"})


def summed_up(comparisons: pd.DataFrame) -> pd.DataFrame:
    """Sum the comparisons up to one row per statement and variant.

    A statement on several pairs of groups holds if it holds for all of them, and does not if it does not for one. The
    same is said of those pairs alone in which both groups' rewards leave the shortest path optimal: where they do not,
    a group fails to learn the path because it is paid not to take it.
    """
    lines = []
    for (statement, source, variant), each in comparisons.groupby(["statement", "source", "variant"], sort=False):
        verdicts, kept = each["verdict"].tolist(), each[(each["first_keeps"] == 1) & (each["second_keeps"] == 1)]
        lines.append(
            {
                "statement": statement,
                "source": source,
                "variant": variant,
                "comparisons": len(each),
                "paper_tests": int(each["paper_test_agrees"].notna().sum()),
                "paper_test_agrees": int(each["paper_test_agrees"].sum()),
                "holds": verdicts.count("holds"),
                "does_not_hold": verdicts.count("does not hold"),
                "undecided": verdicts.count("undecided"),
                "verdict": overall(verdicts),
                "path_optimal": len(kept),
                "verdict_path_optimal": overall(kept["verdict"].tolist()) if len(kept) else None,
            }
        )
    return pd.DataFrame(lines)


def few_runs_note(num_runs: int) -> str:
    """Return what must be said where there are fewer runs than the paper's; empty if there are as many."""
    return "" if num_runs >= PAPER_RUNS else f"{num_runs} runs per condition are too few to conclude anything."


def overall(verdicts: Sequence[str]) -> Verdict:
    """Return the verdict on a statement that is claimed of several things at once."""
    if "does not hold" in verdicts:
        return "does not hold"
    return "holds" if verdicts and set(verdicts) == {"holds"} else "undecided"


def sample_of(condition: Condition, rows: pd.DataFrame, most: int | None = None) -> Sample:
    """Return the episodes of one group's runs, the first ones only if `most` is given.

    Raises:
        ValueError: There are no such runs.
    """
    own = rows[(rows["condition"] == condition.name) & (rows["variant"] == condition.variant)].sort_values("number")
    own = own if most is None else own.head(most)
    if own.empty:
        raise ValueError(f"there are no runs of {condition.name!r} ({condition.variant})")
    return Sample.of(own["episodes"].to_numpy(float), own["is_optimal"].to_numpy(bool))


def _compared(claim: Claim, rows: pd.DataFrame, settings: SweepSettings) -> dict[str, object]:
    first, second = sample_of(claim.first, rows), sample_of(claim.second, rows)
    few = [sample_of(group, rows, PAPER_RUNS) for group in (claim.first, claim.second)]
    names = (claim.variant, claim.first.name, claim.second.name)
    better = probability_of_improvement(
        first, second, stream(settings.seed, "improvement", *names), num_resamples=settings.num_resamples
    )
    ratio = ratio_interval(first, second, stream(settings.seed, "ratio", *names), num_resamples=settings.num_resamples)
    paper_t, paper_p = _t_test(*few)
    return {
        "statement": claim.statement,
        "source": claim.source,
        "variant": claim.variant,
        "expects": claim.expects,
        "first": claim.first.name,
        "second": claim.second.name,
        "first_steps": claim.first.told,
        "second_steps": claim.second.told,
        "first_keeps": int(claim.first.keeps_optimum),
        "second_keeps": int(claim.second.keeps_optimum),
        "runs_each": first.size,
        "first_mean": mean_of(first)[0],
        "second_mean": mean_of(second)[0],
        "first_censored": first.num_censored,
        "second_censored": second.num_censored,
        "paper_runs": few[0].size,
        "paper_t": paper_t,
        "paper_p": paper_p,
        "paper_test_agrees": _agrees_with_paper(claim.expects, paper_t, paper_p),
        "student_p": _t_test(first, second)[1],
        "welch_p": _p_value(welch_t, first, second),
        "mann_whitney_p": mann_whitney(first, second).p_value,
        "log_rank_p": _p_value(log_rank, first, second),
        "improvement": better.value,
        "improvement_low": better.low,
        "improvement_high": better.high,
        "ratio": ratio.value,
        "ratio_low": ratio.low,
        "ratio_high": ratio.high,
        "ratio_is_bound": _bound_of(ratio.is_lower_bound, ratio.is_upper_bound),
        "ratio_low_is_bound": _bound_of(ratio.low_is_lower_bound, ratio.low_is_upper_bound),
        "ratio_high_is_bound": _bound_of(ratio.high_is_lower_bound, ratio.high_is_upper_bound),
        "equivalent": is_equivalent(ratio, settings.margin),
    }


def _t_test(first: Sample, second: Sample) -> tuple[float | None, float | None]:
    """Return t and p, or None where all runs of both groups ended alike and there is nothing to test with."""
    try:
        found = student_t(first, second)
    except Undefined:
        return None, None
    return found.statistic, found.p_value


def _p_value(test: object, first: Sample, second: Sample) -> float | None:
    try:
        return float(test(first, second).p_value)  # type: ignore[operator]
    except Undefined:
        return None


def _bound_of(lower: bool, upper: bool) -> str | None:  # noqa: FBT001 - two flags of an interval.
    """Return `>` for a number that censored runs make too small, `<` for one too large, `?` where nothing is known."""
    return {(False, False): None, (True, False): ">", (False, True): "<", (True, True): "?"}[lower, upper]


def _agrees_with_paper(expects: Expectation, t: float | None, p: float | None) -> bool | None:
    """Say whether the paper's test, read as the paper reads it, comes out as claimed; None if it cannot be made."""
    if t is None or p is None:
        return None
    differs = p < LEVEL
    fewer, more = differs and t < 0, differs and t > 0
    return {"fewer": fewer, "not more": not more, "not fewer": not fewer, "no difference": not differs}[expects]


def _verdict(expects: Expectation, holm_p: float, improvement: float, equivalent: bool) -> Verdict:  # noqa: FBT001 - a column.
    shown = _shown(holm_p, improvement, equivalent=equivalent)
    if shown is None:
        return "undecided"
    supports: Mapping[Expectation, Collection[str]] = {
        "fewer": ("fewer",),
        "not more": ("fewer", "equivalent"),
        "not fewer": ("more", "equivalent"),
        "no difference": ("equivalent",),
    }
    return "holds" if shown in supports[expects] else "does not hold"


def _shown(holm_p: float, improvement: float, *, equivalent: bool) -> Literal["fewer", "more", "equivalent"] | None:
    if equivalent:
        return "equivalent"
    if holm_p < LEVEL and improvement != _EVEN:
        return "fewer" if improvement > _EVEN else "more"
    return None


_EVEN = 0.5
