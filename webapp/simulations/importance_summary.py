"""The importance experiment told in Markdown: settings, what holds of the paper's statements, every step's numbers."""

from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from webapp.runs.markdown import table
from webapp.simulations.conceptual import MOST_RANDOM_STEPS
from webapp.simulations.importance_claims import NOT_COMPARED, steps_text
from webapp.simulations.importance_figures import IMPORTANCE_NAMES
from webapp.simulations.importance_rows import ESTIMATORS, Series, every_series
from webapp.simulations.importance_settings import ImportanceSettings

_CONCEPT_STEPS = (1, 2, 3, MOST_RANDOM_STEPS)
_LEAST_ERROR = 0.5
"""In trials. Where all trials came out alike, the standard error is 0 and would make any difference infinite."""


def summary(settings: ImportanceSettings, rows: pd.DataFrame, claims: pd.DataFrame, concept: pd.DataFrame) -> str:
    """Return the summary of a run as Markdown, which embeds the figures by their file names.

    Args:
        settings: Of the run.
        rows: What it found.
        claims: What that says of the paper's statements, as `claims_about` returns it.
        concept: The conceptual diagram's values, as `conceptual_rows` returns them.
    """
    parts = [
        "# Importance, subgoals, key points and explanation\n",
        _ABOUT,
        *_settings_part(settings),
        *_claims_part(claims),
        *_steps_part(settings, list(every_series(rows))),
        *_derivation_part(settings),
        *_concept_part(concept),
    ]
    return "\n".join(parts)


_ABOUT = """\
The experiment of Sakai et al. 2021, section 5.1. The importance of each state of the optimal path is computed exactly
and estimated by sampling (their Algorithm 1), on the rules of the world and in the world model that an agent learned.

The paper gives neither the number of random actions, nor that of trials, nor the place of the believed door, nor the
values behind its figure. These numbers, the map and the believed one, the exact values, the intervals, and showing the
average causal effect beside the return probability are ours. So is the reading of "high near": above the mean, and at
most one step away. A sampled statement is undecided where a 95 % interval leaves it open.
"""


def _settings_part(settings: ImportanceSettings) -> Iterator[str]:
    rows = [
        ["map", settings.layout_name],
        ["the questioner's map", "nobody asks" if settings.belief is None else _believed(settings)],
        ["random actions (r)", str(settings.random_steps)],
        ["trials per state and probability", f"{settings.num_trials:,}"],
        ["seed", str(settings.seed)],
        ["learned agent and world model", "yes" if settings.learned else "no"],
    ]
    yield "## Settings\n"
    yield table(["setting", "value"], rows)


def _believed(settings: ImportanceSettings) -> str:
    belief = settings.belief
    if belief is None or belief.layout.door == settings.map.door:
        return "differs from the map, though not in the door's place"
    return f"the door at {belief.layout.door} and not at {settings.map.door}"


def _claims_part(claims: pd.DataFrame) -> Iterator[str]:
    yield "## What the paper says, and what was found\n"
    if set(claims["claim"]) == {NOT_COMPARED}:
        yield f"{NOT_COMPARED}\n"
        return
    yield _verdicts(claims)
    others = claims[claims["verdict"] != "holds"]
    if others.empty:
        yield "Everything holds. The file claims.csv has the numbers of each verdict.\n"
        return
    yield "What does not hold or is undecided, with its numbers (claims.csv has all):\n"
    columns = ["claim", "importance", "estimator", "expected", "found", "verdict", "numbers"]
    yield table(columns, [[_cell(row[name]) for name in columns] for _, row in others.iterrows()])


def _verdicts(claims: pd.DataFrame) -> str:
    """Return one line per claim and importance with every estimator's verdict beside the other."""
    estimators = [name for name in ESTIMATORS if name in set(claims["estimator"])]
    lines = []
    for (claim, kind), group in claims.groupby(["claim", "importance"], sort=False, dropna=False):
        verdicts = dict(zip(group["estimator"], group["verdict"], strict=True))
        lines.append([str(claim), _cell(kind), *(verdicts.get(name, "") for name in estimators)])
    return table(["claim", "importance", *estimators], lines)


def _cell(value: object) -> str:
    return "" if pd.isna(value) else IMPORTANCE_NAMES.get(str(value), str(value))


def _steps_part(settings: ImportanceSettings, found: Sequence[Series]) -> Iterator[str]:
    yield "## Importance of every step\n"
    yield "![Importance of every step](importance.svg)\n"
    yield _HOW_TO_READ
    for kind in settings.importances:
        own = [series for series in found if series.importance == kind]
        first = own[0]
        yield f"### {IMPORTANCE_NAMES[kind].capitalize()}\n"
        aligned = [series for series in own if (series.states, series.actions) == (first.states, first.actions)]
        yield _steps_table(aligned)
        for series in own:
            if series not in aligned:
                yield f"The path of *{series.estimator}* is another one:\n"
                yield _steps_table([series])
        yield "".join(f"- {line}\n" for line in _differences(settings, own))


_HOW_TO_READ = """\
A star marks a subgoal: above the mean, and the next step below it. Sampled values have their standard error; claims.csv
has 95 % intervals where they matter. *agent* is the trained network's own policy on its own path.
"""


def _steps_table(together: Sequence[Series]) -> str:
    first = together[0]
    lines = [
        [str(step), state, action, *(_estimate(series, step) for series in together)]
        for step, state, action in zip(first.steps, first.states, (*first.actions, "(target)"), strict=True)
    ]
    lines.append(["", "mean", "", *(f"{series.threshold:.4f}" for series in together)])
    return table(["step", "state", "action", *(series.estimator for series in together)], lines)


def _estimate(series: Series, step: int) -> str:
    said = f"{series.values[step - 1]:.4f}"
    if series.standard_errors is not None and step < len(series.values):
        said += f" ± {series.standard_errors[step - 1]:.4f}"
    return f"{said} *" if step in series.subgoals else said


def _differences(settings: ImportanceSettings, own: Sequence[Series]) -> Iterator[str]:
    by_name = {series.estimator: series for series in own}
    for estimated, exact in (("sampled", "exact"), ("learned sampled", "learned exact")):
        if estimated in by_name:
            yield _in_errors(by_name[estimated], by_name[exact], settings.num_trials)
    if "learned exact" in by_name:
        yield _in_value(by_name["learned exact"], by_name["exact"])


def _in_errors(estimated: Series, exact: Series, num_trials: int) -> str:
    errors = np.zeros(1) if estimated.standard_errors is None else estimated.standard_errors
    apart = np.abs(estimated.values - exact.values) / np.maximum(errors, _LEAST_ERROR / num_trials)
    step = int(apart.argmax())
    return (
        f"Largest difference between *{estimated.estimator}* and *{exact.estimator}*: {apart[step]:.1f} standard "
        f"errors, at step {step + 1}. A standard error counts as {_LEAST_ERROR / num_trials:g} at least, half a trial."
    )


def _in_value(learned: Series, exact: Series) -> str:
    if learned.states != exact.states:
        return "The learned world model's path is another one than that of the rules, so no step has a counterpart."
    apart = np.abs(learned.values - exact.values)
    step = int(apart.argmax())
    where = f", at step {step + 1}" if apart[step] else ""
    return f"Largest difference between *{learned.estimator}* and *{exact.estimator}*: {apart[step]:.2g}{where}."


def _derivation_part(settings: ImportanceSettings) -> Iterator[str]:
    kind = IMPORTANCE_NAMES[settings.importances[0]]
    yield "## Derivation on the map\n"
    yield "![The derivation on the map](derivation.svg)\n"
    yield f"Subgoals and key points are those of the exact {kind}. Numbers are steps; a way keeps to the right.\n"


def _concept_part(concept: pd.DataFrame) -> Iterator[str]:
    yield "## The conceptual diagram\n"
    yield "![The conceptual diagram and the importance of its nodes](conceptual.svg)\n"
    yield _CONCEPT
    columns = [f"r = {r}" for r in _CONCEPT_STEPS]
    lines = []
    for (world, kind, node), group in concept[concept["way"] == "A"].groupby(
        ["world", "importance", "node"], sort=False
    ):
        values = dict(zip(group["random_steps"], group["value"], strict=True))
        if node != "G":
            name = IMPORTANCE_NAMES[str(kind)]
            lines.append([str(world), name, str(node), *(f"{values[r]:.4f}" for r in _CONCEPT_STEPS)])
    yield table(["world", "importance", "node", *columns], lines)
    most = MOST_RANDOM_STEPS
    yield f"C is above A, and on the way through B above B, for r from 1 to {most}{_exceptions(concept)}.\n"


_CONCEPT = """\
"When considering a route to goal G from start point S, the process will always pass through Node C, and A or B.
Therefore, the most important node is C, followed by A and B" (Sakai et al. 2021, section 4.2). The diagram is built
from these words in two worlds, which are ours: in *joined* there is a way between A and B, in *apart* there is none.
The values are exact and those of the way through A; on the way through B, B has A's.
"""


def _exceptions(concept: pd.DataFrame) -> str:
    """Name where C is not the most important node although there are random actions."""
    place = ["world", "importance", "random_steps"]
    wide = concept[concept["random_steps"] > 0].pivot_table(index=[*place, "way"], columns="node", values="value")
    tied = wide[~(wide["C"] > wide[["A", "B"]].max(axis=1))].reset_index()
    if tied.empty:
        return ""
    cases = tied.groupby(["world", "importance"], sort=False)["random_steps"].unique()
    named = [
        f"{IMPORTANCE_NAMES[kind]} in *{world}* at r = {steps_text(steps)}" for (world, kind), steps in cases.items()
    ]
    return f", but for a tie of the {' and of the '.join(named)}"
