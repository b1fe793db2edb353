"""What a power run leaves in its folder: tables, the figure, and a summary that says how all of it was made."""

from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from webapp.explainer.pictures.figure_style import drawn
from webapp.power import figure
from webapp.power.generation import within_sd
from webapp.power.required import STEPS, Step
from webapp.power.settings import PAPER_PARTICIPANTS, PowerSettings
from webapp.power.simulation import Levels
from webapp.runs.markdown import table as markdown_table
from webapp.study.analysis_plan import Plan

_FIGURE = "power"
_DIGITS = "%.10g"
_TABLES = ("power.csv", "required.csv")
_TEXTS = dict.fromkeys(("experiment", "items", "first", "second", "step"), "str")
_KEYS = frozenset({"experiment", "items", "first", "second", "effect", "participants"})
_POWER_NEEDS = _KEYS | {f"{part}_{step}" for part in ("power", "low", "high") for step in STEPS}
_REQUIRED_NEEDS = _KEYS | {"step", "low", "high", "is_smallest"}


def files_of(
    study: str, plan: Plan, settings: PowerSettings, levels: Levels, power: pd.DataFrame, required: pd.DataFrame
) -> dict[str, bytes]:
    """Return all files of a run by name; the same arguments give the same bytes."""
    pictures = {
        f"{_FIGURE}{suffix}": drawn(
            lambda canvas: figure.fill(canvas, power, settings.power), figure.size(power), suffix, _FIGURE
        )
        for suffix in (".svg", ".png")
    }
    return {
        "power.csv": _csv(power),
        "required.csv": _csv(required),
        "summary.md": _summary(study, plan, settings, levels, power, required).encode(),
        **pictures,
    }


def read_tables(folder: Path) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Read the tables of a complete run again: the power, and the required participants.

    Raises:
        ValueError: A table is not as it was written.
        OSError: A table cannot be read.
    """
    power, required = (
        pd.read_csv(folder / name, dtype=_TEXTS, keep_default_na=False, na_values=[""]) for name in _TABLES
    )
    for table, columns in ((power, _POWER_NEEDS), (required, _REQUIRED_NEEDS)):
        if not columns <= set(table.columns):
            raise ValueError(f"the tables in {folder} were changed after the run; give another --run")
    return power, required.astype(dict.fromkeys(("participants", "low", "high"), "Int64"))


def methods(plan: Plan, settings: PowerSettings, levels: Levels) -> str:
    """Return how the power was found, as a paper would say it."""
    effects = ", ".join(f"{effect:g}" for effect in settings.effects)
    within = within_sd(settings.between_sd)
    text = f"""
        Power was simulated with {settings.num_studies} studies of {settings.participants[0]} to
        {settings.participants[-1]} participants for each effect. Participants get arrangements and layout orders of
        the declared design in turn. A latent rating is the effect of the kind, plus the participant's own level
        with a standard deviation of {settings.between_sd:g}, plus noise with one of {within:.3g}, both normal.
        Rounded to the item's points, and cut off at the ends of its scale, it is the rating. The first kind of each
        planned contrast is shifted by d ({effects}), in standard deviations of the latent rating. Layouts and
        positions make no difference. Each study is analysed as planned: a cumulative probit mixed model with kind,
        layout and position as effects and a random intercept per participant, and a two-sided test of each contrast
        (Wald's, by Student's t). A contrast counts as significant if p is at most {levels.first:.4g}, the first
        step of Holm's correction of {plan.num_tests} tests at {plan.alpha:g} and so its worst case, or at most
        {levels.last:g}, the last step and best case. A study whose ratings do not determine the model counts as not
        significant. The studies of all N and all d share their noise. Intervals are Wilson's at 95 % and tell the
        error of simulation alone. The required number of participants is where straight lines between the isotonic
        regression of the shares reach a power of {settings.power:g}; its range comes from the ends of the
        intervals.
    """
    return " ".join(text.split())


def _summary(
    study: str, plan: Plan, settings: PowerSettings, levels: Levels, power: pd.DataFrame, required: pd.DataFrame
) -> str:
    origin = "declared in the study file" if plan.is_declared else "of the default plan: the study file declares none"
    parts = [
        f"# Power of the planned analysis of {study}\n",
        f"{len(plan.contrasts)} contrasts, {origin}; {plan.num_tests} tests with items, at {plan.alpha:g} in all.",
        _STEPS,
        f"## Required participants for a power of {settings.power:g}\n",
        markdown_table(REQUIRED_HEADINGS, required_cells(required, settings)),
        "In brackets: the range that the error of simulation leaves.\n",
        "![Power by participants: a panel for each contrast](power.svg)\n",
        _LEGEND,
        *_at_paper(power),
        "## No effect: false alarms\n",
        markdown_table(
            ("experiment", "items", "contrast", "largest over all N, first step", "last step", "target"),
            _alarms(power, levels),
        ),
        _undetermined(power),
        "## Methods\n",
        methods(plan, settings, levels) + "\n",
        _PAIRED_T,
    ]
    return "\n".join(parts)


_STEPS = "The first step of Holm's correction is the worst case for a contrast, the last step the best.\n"
_LEGEND = """\
Lines: the first step, with the error of simulation as a band; dotted: the last step. Grey: no effect, so that the line
is the share of false alarms.
"""
_PAIRED_T = """\
`paired_t_power` in power.csv is for orientation: the power of a paired t test on the latent ratings, by formula, at the
first step, among those who see both kinds.
"""

REQUIRED_HEADINGS = ("experiment", "items", "contrast", "d", "first step", "last step")


def required_cells(required: pd.DataFrame, settings: PowerSettings) -> list[tuple[str, ...]]:
    """Return the required numbers as text, a row per contrast and effect."""
    cells = []
    for key, rows in required.groupby(["experiment", "items", "first", "second", "effect"], sort=False):
        experiment, items, first, second, effect = key
        found = [_needed(rows[rows["step"] == step].iloc[0], settings) for step in ("first_step", "last_step")]
        cells.append((experiment, _listed(items), _contrast(first, second), f"{effect:g}", *found))
    return cells


def power_cells(power: pd.DataFrame, num_people: int) -> list[tuple[str, ...]]:
    """Return the power with one number of participants as text, a row per contrast and effect."""
    rows = power[(power["participants"] == num_people) & (power["effect"] > 0)]
    return [
        (
            row["experiment"],
            _listed(row["items"]),
            _contrast(row["first"], row["second"]),
            f"{row['effect']:g}",
            _share(row, "first_step"),
            _share(row, "last_step"),
        )
        for row in rows.to_dict("records")
    ]


def _at_paper(power: pd.DataFrame) -> list[str]:
    cells = power_cells(power, PAPER_PARTICIPANTS)
    if not cells:
        return []
    return [f"## With the paper's {PAPER_PARTICIPANTS} participants\n", markdown_table(REQUIRED_HEADINGS, cells)]


def _alarms(power: pd.DataFrame, levels: Levels) -> list[tuple[str, ...]]:
    """Return the largest share over all N of each contrast, with its interval."""
    cells = []
    nothing = power[power["effect"] == 0]
    for key, rows in nothing.groupby(["experiment", "items", "first", "second"], sort=False):
        experiment, items, first, second = key
        worst = [_share(rows.loc[rows[f"power_{step}"].idxmax()], step) for step in ("first_step", "last_step")]
        targets = f"{levels.first:.2g} and {levels.last:g}"
        cells.append((experiment, _listed(items), _contrast(first, second), *worst, targets))
    return cells


def _undetermined(power: pd.DataFrame) -> str:
    rows = power[power["num_undefined"] > 0]
    if rows.empty:
        return "Every simulated study determined the model.\n"
    worst = rows.loc[(rows["num_undefined"] / rows["num_studies"]).idxmax()]
    return (
        f"Some studies did not determine the model, at most {worst['num_undefined']} of {worst['num_studies']}, with "
        f"{worst['participants']} participants and d = {worst['effect']:g}. The most participants with any: "
        f"{rows['participants'].max()}.\n"
    )


def _needed(row: "pd.Series", settings: PowerSettings) -> str:
    most = max(settings.participants)
    number, low, high = (
        f"more than {most}" if pd.isna(row[name]) else str(row[name]) for name in ("participants", "low", "high")
    )
    if pd.isna(row["participants"]):
        return number
    if row["is_smallest"]:
        return f"at most {number}" if high == number else f"at most {number} (up to {high})"
    return number if low == high else f"{number} ({low} to {high})"


def _share(row: "Mapping[str, float] | pd.Series", step: Step | str) -> str:
    share, low, high = (row[f"{part}_{step}"] for part in ("power", "low", "high"))
    digits = 3 if high < _FEW else 2
    return f"{share:.{digits}f} ({low:.{digits}f}\N{EN DASH}{high:.{digits}f})"


_FEW = 0.1
"""Shares below it are written with a digit more."""


def _listed(items: str) -> str:
    return items.replace(" ", ", ")


def _contrast(first: str, second: str) -> str:
    return f"{first} \N{MINUS SIGN} {second}"


def _csv(table: pd.DataFrame) -> bytes:
    text: str = table.to_csv(index=False, float_format=_DIGITS, lineterminator="\n")
    return text.encode()
