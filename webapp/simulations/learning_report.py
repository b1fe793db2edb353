"""What a sweep of learning runs leaves in its folder: rows, tables, figures and a summary to read."""

from collections.abc import Sequence

import pandas as pd

from webapp.analysis.location import iqm_interval, mean_of
from webapp.explainer.seeding import stream
from webapp.simulations.claims import LEVEL, PAPER_RUNS, Claim, compare_groups, sample_of, summed_up
from webapp.simulations.conditions import Condition
from webapp.simulations.learning_figures import count_figure, learned_figure, usefulness_figure
from webapp.simulations.markdown import table
from webapp.simulations.settings import SweepSettings

_FIGURES = {"usefulness": usefulness_figure, "count": count_figure}
_TITLES = {
    "usefulness": "How useful the derived subgoals are to a learner (Sakai et al. 2021, section 5.2)",
    "count": "How many subgoals are enough (Sakai et al. 2021, section 5.3)",
}


def report_files(
    experiment: str, settings: SweepSettings, groups: Sequence[Condition], claims: Sequence[Claim], rows: pd.DataFrame
) -> dict[str, bytes]:
    """Return all files of a finished sweep by name; the same rows give the same bytes.

    Args:
        experiment: `usefulness` or `count`.
        settings: Of the sweep.
        groups: Its conditions.
        claims: What is claimed of them.
        rows: Of all runs.
    """
    summary = described(groups, rows, settings)
    comparisons = compare_groups(claims, rows, settings)
    verdicts = summed_up(comparisons)
    files = {
        "rows.csv": _as_csv(rows),
        "conditions.csv": _as_csv(summary),
        "comparisons.csv": _as_csv(comparisons),
        "claims.csv": _as_csv(verdicts),
        "summary.md": _markdown(experiment, settings, summary, comparisons, verdicts).encode(),
    }
    for suffix in (".svg", ".png"):
        files[f"{experiment}{suffix}"] = _FIGURES[experiment](summary, rows, settings, suffix)
        files[f"learned{suffix}"] = learned_figure(groups, rows, settings, suffix)
    return files


def described(groups: Sequence[Condition], rows: pd.DataFrame, settings: SweepSettings) -> pd.DataFrame:
    """Return one row per condition: how many runs, how many censored, and the episodes' mean and interquartile mean.

    A number in which a censored run is counted with the budget is marked as a lower bound.
    """
    return pd.DataFrame([_described(group, rows, settings) for group in groups])


def _described(group: Condition, rows: pd.DataFrame, settings: SweepSettings) -> dict[str, object]:
    sample = sample_of(group, rows)
    mean, mean_is_bound = mean_of(sample)
    rng = stream(settings.seed, "iqm", group.variant, group.name)
    middle = iqm_interval(sample, rng, num_resamples=settings.num_resamples)
    return {
        "variant": group.variant,
        "condition": group.name,
        "kind": group.kind,
        "steps": group.told,
        "keeps_optimum": int(group.keeps_optimum),
        "runs": sample.size,
        "censored": sample.num_censored,
        "mean": mean,
        "mean_is_lower_bound": int(mean_is_bound),
        "iqm": middle.value,
        "iqm_low": middle.low,
        "iqm_high": middle.high,
        "iqm_is_lower_bound": int(middle.is_lower_bound),
        "iqm_high_is_lower_bound": int(middle.high_is_lower_bound),
    }


def _as_csv(content: pd.DataFrame) -> bytes:
    return str(content.to_csv(index=False, lineterminator="\n", float_format="%.6g")).encode()


def _markdown(
    experiment: str,
    settings: SweepSettings,
    summary: pd.DataFrame,
    comparisons: pd.DataFrame,
    verdicts: pd.DataFrame,
) -> str:
    parts = [
        f"# {_TITLES[experiment]}\n",
        _introduction(settings),
        "## What is claimed, and what came out\n",
        _verdict_table(verdicts),
        _how_to_read(settings),
        f"![Episodes by condition]({experiment}.svg)\n",
        "## Conditions\n",
        _condition_table(summary),
        _footnotes(summary, settings),
        "![Share of agents that have learned](learned.svg)\n",
        "## Comparisons\n",
        _comparison_table(comparisons),
    ]
    return "\n".join(parts)


def _introduction(settings: SweepSettings) -> str:
    fresh = settings.fresh
    variants = " and ".join(settings.variants)
    return (
        f"Map `{settings.layout_name}`, seed {settings.seed}, {settings.num_runs} agents per condition. Every agent "
        f"begins with nothing and learns by DQN until its greedy policy takes a shortest path from the start, checked "
        f"after every episode; after {fresh.max_episodes} episodes it is censored. A pair pays {fresh.sub_reward:g} at "
        f"first and less over time, as the goal does ({variants}: whenever it is executed, or only the first time in "
        f"an episode). The paper gives no network, learning rate, discount ({fresh.discount:g} here), number of "
        "episodes, or which steps were drawn: all of these are ours, and in `settings.json`.\n"
    )


def _verdict_table(verdicts: pd.DataFrame) -> str:
    rows = [
        [
            row.statement,
            row.source,
            row.variant,
            f"{row.paper_test_agrees} of {row.comparisons}",
            f"{row.holds} / {row.does_not_hold} / {row.undecided}",
            f"**{row.verdict}**",
        ]
        for row in verdicts.itertuples()
    ]
    return table(
        ["claim", "section", "variant", "paper's test agrees", "holds / does not / undecided", "verdict"], rows
    )


def _how_to_read(settings: SweepSettings) -> str:
    ratio = 1 + settings.margin
    return (
        f"*Paper's test*: Student's unpaired t on the first {min(PAPER_RUNS, settings.num_runs)} runs of each group, "
        f"two-sided at {LEVEL}, censored runs counted with the budget; not significant counts as no difference. "
        f"*Verdict*: from all {settings.num_runs} runs. A difference is Mann-Whitney at {LEVEL} after Holm's "
        "correction over all comparisons of the variant, with censored runs ranked last; no difference is a 90 % "
        f"bootstrap interval for the ratio of interquartile means within 1/{ratio:g} and {ratio:g}. Where neither is "
        "shown, the claim is undecided. A statement on several pairs holds if it holds for all, and does not if it "
        "fails for one.\n"
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
            f"{_bound(row.iqm_low, 0)} to {_bound(row.iqm_high, row.iqm_high_is_lower_bound)}",
        ]
        for row in summary.itertuples()
    ]
    headings = ["variant", "condition", "steps", "path optimal", "censored", "mean", "IQM", "95 % interval"]
    return table(headings, rows)


def _bound(value: float, is_lower: int) -> str:
    return f"{'> ' if is_lower else ''}{value:.1f}"


def _footnotes(summary: pd.DataFrame, settings: SweepSettings) -> str:
    lost = summary[(summary["keeps_optimum"] == 0)]
    text = (
        "Episodes until the greedy policy was optimal. *IQM*: mean of the middle half of the runs, with a bootstrap "
        "interval. `>`: censored runs are in it, so the true number is larger. *Path optimal*: whether the shortest "
        f"path still is optimal under these rewards at discount {settings.fresh.discount:g}, computed exactly; where "
        "pairs pay once, for an agent that remembers what it has earned (the learning ones cannot observe it)"
    )
    if lost.empty:
        return f"{text}: it always is.\n"
    return (
        f"{text}. Where it is not, in {len(lost)} of {len(summary)} conditions, something else pays more than the "
        "path, as walking in a circle through a rewarded pair does: an agent that learns well unlearns the path.\n"
    )


def _comparison_table(comparisons: pd.DataFrame) -> str:
    rows = [
        [
            row.variant,
            f"{row.first} : {row.second}",
            row.expects,
            f"{row.first_mean:.1f} : {row.second_mean:.1f}",
            _p(row.paper_p),
            _p(row.student_p),
            _p(row.mann_whitney_p),
            _p(row.holm_p),
            _p(row.log_rank_p),
            f"{row.improvement:.2f} ({row.improvement_low:.2f} to {row.improvement_high:.2f})",
            f"{row.ratio:.2f} ({row.ratio_low:.2f} to {row.ratio_high:.2f})",
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


def _p(value: float | None) -> str:
    if value is None or pd.isna(value):
        return "-"
    return "< .001" if value < _SMALLEST_SHOWN else f"{value:.3f}".removeprefix("0")


_SMALLEST_SHOWN = 0.001
