"""What a sweep of learning runs leaves in its folder: rows, tables, figures and a summary to read."""

from collections.abc import Sequence

import pandas as pd

from webapp.analysis.location import iqm_interval, mean_of
from webapp.explainer.seeding import stream
from webapp.simulations.claims import Claim, compare_groups, sample_of, summed_up
from webapp.simulations.conditions import Condition
from webapp.simulations.learning_figures import count_figure, learned_figure, usefulness_figure
from webapp.simulations.learning_summary import summary_of
from webapp.simulations.settings import SweepSettings

_FIGURES = {"usefulness": usefulness_figure, "count": count_figure}


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
        "summary.md": summary_of(experiment, settings, summary, comparisons, verdicts).encode(),
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
        "iqm_low_is_lower_bound": int(middle.low_is_lower_bound),
        "iqm_high_is_lower_bound": int(middle.high_is_lower_bound),
    }


def _as_csv(content: pd.DataFrame) -> bytes:
    return str(content.to_csv(index=False, lineterminator="\n", float_format="%.6g")).encode()
