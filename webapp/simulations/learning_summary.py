"""The summary of a sweep of learning runs, in Markdown."""

from typing import Any

import pandas as pd

from webapp.runs.markdown import table
from webapp.simulations.claims import LEVEL, PAPER_RUNS, few_runs_note
from webapp.simulations.settings import SweepSettings

_TITLES = {
    "usefulness": "How useful the derived subgoals are to a learner (Sakai et al. 2021, section 5.2)",
    "count": "How many subgoals are enough (Sakai et al. 2021, section 5.3)",
}
_OWN_WORDS = {
    "usefulness": """\
Most random steps, paid again and again, make something else pay more than the path. A group that is told such steps
cannot learn the path; the column *path optimal* says which groups these are.
""",
    "count": """\
Fewer subgoals than derived: the least important is left out first, and the other ways stand beside it. More: a step is
added that halves the largest gap between neighbours, among which we count the start and the goal (the earliest of equal
gaps, the earlier of two middles), if by the paper's first requirement the next subgoal pays more than the same again.
""",
}


def summary_of(
    experiment: str,
    settings: SweepSettings,
    conditions: pd.DataFrame,
    comparisons: pd.DataFrame,
    verdicts: pd.DataFrame,
) -> str:
    """Return the summary of a finished sweep, which embeds the figures by their file names.

    Args:
        experiment: `usefulness` or `count`.
        settings: Of the sweep.
        conditions: One row per condition, as `learning_report.described` returns them.
        comparisons: One row per claim, as `claims.compare_groups` returns them.
        verdicts: One row per statement, as `claims.summed_up` returns them.
    """
    parts = [
        f"# {_TITLES[experiment]}\n",
        _introduction(settings),
        _OWN_WORDS[experiment],
        "## What is claimed, and what came out\n",
        *(f"**{note}**\n" for note in filter(None, [few_runs_note(settings.num_runs)])),
        _verdict_table(verdicts),
        _how_to_read(settings),
        f"![Episodes by condition]({experiment}.svg)\n",
        "## Conditions\n",
        _condition_table(conditions),
        _footnotes(conditions, settings),
        "![Share of agents that have learned](learned.svg)\n",
        "## Comparisons\n",
        _comparison_table(comparisons),
    ]
    return "\n".join(parts)


def _introduction(settings: SweepSettings) -> str:
    fresh = settings.fresh
    variants = " and ".join(settings.variants)
    budget = f"{fresh.max_episodes} episode{'' if fresh.max_episodes == 1 else 's'}"
    return (
        f"Map `{settings.layout_name}`, seed {settings.seed}, {settings.num_runs} agents per condition. Every agent "
        "begins with nothing and learns by DQN until its greedy policy takes a shortest path from the start, checked "
        f"after every episode; after {budget} it is censored. A pair pays {fresh.sub_reward:g} at first and less over "
        f"time, as the goal does ({variants}: whenever it is executed, or only the first time in an episode). The "
        f"paper gives no network, learning rate, discount ({fresh.discount:g} here), number of episodes, or which "
        "steps were drawn: all of these are ours, and in `settings.json`.\n"
    )


def _verdict_table(verdicts: pd.DataFrame) -> str:
    rows = [
        [
            row.statement,
            row.source,
            row.variant,
            f"{row.paper_test_agrees} of {row.paper_tests}",
            f"{row.holds} / {row.does_not_hold} / {row.undecided}",
            f"**{row.verdict}**",
            f"{row.verdict_path_optimal} ({row.path_optimal} of {row.comparisons})" if row.path_optimal else "-",
        ]
        for row in verdicts.itertuples()
    ]
    headings = ["claim", "section", "variant", "paper's test agrees", "holds / does not / undecided", "verdict"]
    return table([*headings, "where the path stays optimal"], rows)


def _how_to_read(settings: SweepSettings) -> str:
    ratio = 1 + settings.margin
    return (
        f"*Paper's test*: Student's unpaired t on the first {min(PAPER_RUNS, settings.num_runs)} runs of each group, "
        f"two-sided at {LEVEL}, censored runs counted with the budget; not significant counts as no difference. "
        f"*Verdict*: from all {settings.num_runs} runs. A difference is Mann-Whitney at {LEVEL} after Holm's "
        "correction over all comparisons of the variant, with censored runs ranked last; no difference is a 90 % "
        f"bootstrap interval for the ratio of interquartile means within 1/{ratio:g} and {ratio:g}. Where neither is "
        "shown, the claim is undecided; where both are, the difference is within the margin and counts as none. A "
        "statement on several pairs of groups holds if it holds for all, and does not if it fails for one. *Where the "
        "path stays optimal*: the verdict on those pairs alone in which neither group is paid for something better "
        "than the path, and how many these are. Where a group is, that it does not learn the path says nothing of how "
        "well it was told.\n"
    )


def _condition_table(summary: pd.DataFrame) -> str:
    rows = [
        [
            row.variant,
            row.condition,
            row.steps,
            "yes" if row.keeps_optimum else "no",
            f"{row.censored} of {row.runs}",
            _bound(row.mean, row.mean_is_lower_bound),
            _bound(row.iqm, row.iqm_is_lower_bound),
            f"{_bound(row.iqm_low, row.iqm_low_is_lower_bound)} to {_bound(row.iqm_high, row.iqm_high_is_lower_bound)}",
        ]
        for row in summary.itertuples()
    ]
    headings = ["variant", "condition", "steps", "path optimal", "censored", "mean", "IQM", "95 % interval"]
    return table(headings, rows)


def _bound(value: float, is_lower: int) -> str:
    return f"{'> ' if is_lower else ''}{value:.1f}"


def _footnotes(conditions: pd.DataFrame, settings: SweepSettings) -> str:
    lost = conditions[conditions["keeps_optimum"] == 0]
    text = (
        "Episodes until the greedy policy was optimal. *IQM*: mean of the middle half of the runs, with a bootstrap "
        "interval. `>`: censored runs are in it, so the true number is larger. *Path optimal*: whether the shortest "
        f"path still is optimal under these rewards at discount {settings.fresh.discount:g}, computed exactly but for "
        "the fall of rewards over time; where pairs pay once, for an agent that remembers what it has earned, which "
        "the learning ones cannot observe"
    )
    if lost.empty:
        return f"{text}: it always is.\n"
    return (
        f"{text}. Where it is not, in {len(lost)} of {len(conditions)} conditions, something else pays more: walking "
        "in a circle through a pair that pays again, or a way around by pairs off the path. An agent that learns well "
        "then unlearns the path.\n"
    )


def _comparison_table(comparisons: pd.DataFrame) -> str:
    rows = [
        [
            row.variant,
            f"{row.first} : {row.second}",
            row.expects,
            f"{_bound(row.first_mean, row.first_censored)} : {_bound(row.second_mean, row.second_censored)}",
            _p(row.paper_p),
            _p(row.student_p),
            _p(row.mann_whitney_p),
            _p(row.holm_p),
            _p(row.log_rank_p),
            f"{row.improvement:.2f} ({row.improvement_low:.2f} to {row.improvement_high:.2f})",
            _ratio(row),
            row.verdict,
        ]
        for row in comparisons.itertuples()
    ]
    headings = [
        "variant",
        "groups",
        "expected of the first",
        "means",
        "t, first runs",
        "t, all",
        "Mann-Whitney",
        "Holm",
        "log-rank",
        "P(fewer)",
        "ratio of IQMs",
        "verdict",
    ]
    return table(headings, rows)


def _ratio(row: Any) -> str:  # noqa: ANN401 - a row of a table.
    value, low, high = (
        f"{bound} {number:.2f}" if isinstance(bound, str) else f"{number:.2f}"
        for number, bound in (
            (row.ratio, row.ratio_is_bound),
            (row.ratio_low, row.ratio_low_is_bound),
            (row.ratio_high, row.ratio_high_is_bound),
        )
    )
    return f"{value} ({low} to {high})"


def _p(value: float | None) -> str:
    if value is None or pd.isna(value):
        return "-"
    return "< .001" if value < _SMALLEST_SHOWN else f"{value:.3f}".removeprefix("0")


_SMALLEST_SHOWN = 0.001
