"""What the paper says of its simulation (Sakai et al. 2021, section 5.1), held against what was found.

The paper's words are: the importance "was high near get key (Step 7), pass through door (Steps 14-16), and reach goal
(Step 20)"; these three "were extracted as the subgoals, and pass through door was extracted as the explanation" for a
questioner who misunderstands where the door is. How "high" and "near" are read here is ours: high is above the mean,
near is at most one step away.

A sampled statement is undecided where an interval leaves it open. Each interval is one of 95 % by itself.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields

import numpy as np
import pandas as pd

from webapp.explainer.key_points import key_point_steps
from webapp.explainer.solvers import Trajectory
from webapp.explainer.worlds.key_door import tabulate
from webapp.simulations.claims import Verdict
from webapp.simulations.importance_rows import Series, every_series
from webapp.simulations.importance_settings import ImportanceSettings
from webapp.simulations.key_door_walks import GET_KEY, PASS_DOOR, REACH_GOAL, Walk, walk_by_name

PAPER_STEPS: Mapping[str, tuple[int, ...]] = {GET_KEY: (7,), PASS_DOOR: (14, 15, 16), REACH_GOAL: (20,)}
"""The steps that the paper names, by what happens there."""

NOT_COMPARED = "None: what the paper says is about its own map only."


@dataclass(frozen=True, slots=True)
class Finding:
    """One statement, for one importance and one estimator.

    Attributes:
        claim: The statement.
        importance: Which importance; None for what is said of the path alone.
        estimator: What estimated it.
        expected: What would be found if the statement held.
        found: What was found.
        verdict: Whether it holds.
        numbers: The numbers behind the verdict.
    """

    claim: str
    importance: str | None = None
    estimator: str | None = None
    expected: str | None = None
    found: str | None = None
    verdict: Verdict | None = None
    numbers: str | None = None


def claims_about(settings: ImportanceSettings, rows: pd.DataFrame) -> pd.DataFrame:
    """Hold the paper's statements against the rows of a run.

    What the paper says of the questioner is left out where another one asks. On another map than the paper's nothing is
    compared; then there is one row, which says so and has no verdict.

    Args:
        settings: Of the run.
        rows: What it found.

    Returns:
        One row per statement, importance and estimator, with the columns of `Finding`.
    """
    findings: Iterable[Finding] = [Finding(NOT_COMPARED)]
    if settings.is_the_papers_map:
        findings = _findings(settings, list(every_series(rows)))
    columns = [field.name for field in fields(Finding)]
    return pd.DataFrame([asdict(finding) for finding in findings], columns=columns)


def missed_steps(settings: ImportanceSettings, way: Walk) -> tuple[int, ...]:
    """Return the steps of a way whose state and action the questioner's route misses; those are key points if subgoals.

    Args:
        settings: Of the run.
        way: From the map's start to the goal.
    """
    if settings.route is None:
        return ()
    mdp = tabulate(settings.map)
    path = Trajectory(tuple(mdp.index[state] for state in way.states), way.actions)
    return key_point_steps(mdp, path, range(1, path.num_steps + 1), settings.route)


def steps_text(steps: Iterable[int]) -> str:
    """List steps as people write them, or say that there are none."""
    return ", ".join(map(str, steps)) or "none"


def _findings(settings: ImportanceSettings, found: Sequence[Series]) -> Iterator[Finding]:
    ways = {series.estimator: walk_by_name(settings.map, series.actions) for series in found}
    for estimator in ("exact", "agent exact"):
        if estimator in ways:
            yield _on_the_path(estimator, ways[estimator])
    for series in found:
        way = ways[series.estimator]
        for judge in (_peak, *_ABOVE_MEAN, _only_near, _subgoals):
            yield judge(series, way)
        if settings.is_the_papers_question:
            missed = missed_steps(settings, way)
            yield _key_points(series, way, missed)
            yield _explanation(series, way, missed)


def _on_the_path(estimator: str, way: Walk) -> Finding:
    found = {GET_KEY: _single(way, GET_KEY), PASS_DOOR: way.door_steps, REACH_GOAL: _single(way, REACH_GOAL)}
    return Finding(
        "The key is taken, the door opened and passed, and the goal reached at the steps that the paper names.",
        None,
        estimator,
        _events_text(PAPER_STEPS),
        _events_text(found),
        "holds" if found == PAPER_STEPS else "does not hold",
        f"{len(way.actions)} steps",
    )


def _events_text(steps: Mapping[str, tuple[int, ...]]) -> str:
    return "; ".join(f"{event}: {steps_text(each)}" for event, each in steps.items())


def _peak(series: Series, way: Walk) -> Finding:
    named = _named(way)
    best = max(named, key=lambda step: series.values[step - 1])
    others = [step for step in series.steps if step not in named]
    rival = max(others, key=lambda step: series.high[step - 1])
    top = series.values.max()
    sure = series.low[best - 1] > series.high[rival - 1]
    lost = series.high[best - 1] < series.low[rival - 1] or (series.standard_errors is None and not sure)
    return Finding(
        "The highest importance of all lies at one of the steps that the paper names.",
        series.importance,
        series.estimator,
        f"one of {steps_text(named)}",
        f"step {steps_text(step for step in series.steps if series.values[step - 1] == top)}",
        "holds" if sure else "does not hold" if lost else "undecided",
        f"{_value(series, best)}; of the other steps at most {_value(series, rival)}",
    )


def _above_mean(steps_of: Callable[[Walk], Sequence[int]], claim: str) -> Callable[[Series, Walk], Finding]:
    def judge(series: Series, way: Walk) -> Finding:
        steps = steps_of(way)
        return Finding(
            claim,
            series.importance,
            series.estimator,
            f"above the mean at {steps_text(steps)}",
            f"above the mean at {steps_text(step for step in steps if _exceeds(series, step))}",
            _all_of([series.side(step) for step in steps]),
            "; ".join([*(_value(series, step) for step in steps), f"mean {series.threshold:.4f}"]),
        )

    return judge


def _only_near(series: Series, way: Walk) -> Finding:
    named = _named(way)
    far = [step for step in series.steps if min(abs(step - near) for near in named) > 1]
    highest = max(far, key=lambda step: series.high[step - 1])
    return Finding(
        "The importance is above the mean only near the steps that the paper names.",
        series.importance,
        series.estimator,
        "above the mean at none of the steps that are further than one step from these",
        f"above the mean there: {steps_text(step for step in far if _exceeds(series, step))}",
        _all_of([-series.side(step) for step in far]),
        f"highest of these {_value(series, highest)}; mean {series.threshold:.4f}",
    )


def _subgoals(series: Series, way: Walk) -> Finding:
    wanted = _ends(way)
    return Finding(
        "The subgoals are get key, pass through door and reach goal.",
        series.importance,
        series.estimator,
        f"subgoals {_named_steps(way, wanted)}",
        f"subgoals {_named_steps(way, series.subgoals)}",
        _as_wanted(series, range(1, len(series.values)), wanted),
        _open_text(series),
    )


def _key_points(series: Series, way: Walk, missed: Sequence[int]) -> Finding:
    wanted = _ends(way)[1:]
    return Finding(
        "For the misunderstood door the key points are pass through door and reach goal.",
        series.importance,
        series.estimator,
        f"key points {_named_steps(way, wanted)}",
        f"key points {_named_steps(way, [step for step in series.subgoals if step in missed])}",
        _as_wanted(series, missed, wanted),
        _open_text(series),
    )


def _explanation(series: Series, way: Walk, missed: Sequence[int]) -> Finding:
    wanted = _ends(way)[1:2]
    first = [step for step in series.subgoals if step in missed][:1]
    upto = [step for step in missed if not wanted or step <= wanted[0]]
    return Finding(
        "For the misunderstood door the explanation is pass through door.",
        series.importance,
        series.estimator,
        f"explanation {_named_steps(way, wanted)}",
        f"explanation {_named_steps(way, first)}",
        _as_wanted(series, upto, wanted),
        _open_text(series),
    )


def _single(way: Walk, event: str) -> tuple[int, ...]:
    found = way.event_step(event)
    return () if found is None else (found,)


def _named(way: Walk) -> tuple[int, ...]:
    """Return the steps that the paper's words name on this way, whatever their numbers."""
    return (*_single(way, GET_KEY), *way.door_steps, *_single(way, REACH_GOAL))


def _ends(way: Walk) -> tuple[int, ...]:
    return tuple(phase.last for phase in way.phases)


def _exceeds(series: Series, step: int) -> bool:
    return bool(series.values[step - 1] > series.threshold)


def _value(series: Series, step: int) -> str:
    place = step - 1
    said = f"I({step}) = {series.values[place]:.4f}"
    return said if series.standard_errors is None else f"{said} [{series.low[place]:.4f}, {series.high[place]:.4f}]"


def _named_steps(way: Walk, steps: Iterable[int]) -> str:
    return ", ".join(f"{way.name(step)} ({step})" for step in steps) or "none"


def _open_text(series: Series) -> str:
    if series.standard_errors is None:
        gap = np.abs(series.values - series.threshold).min()
        return f"mean {series.threshold:.4f}; the step nearest to it lies {gap:.4f} away"
    unsure = [step for step in series.steps if series.side(step) == 0]
    return f"mean {series.threshold:.4f}; steps whose interval holds it: {steps_text(unsure)}"


def _all_of(sides: Sequence[int]) -> Verdict:
    """Return the verdict on a statement about several steps: 1 where it surely holds, -1 where it surely does not."""
    worst = min(sides, default=-1)
    return "holds" if worst > 0 else "undecided" if worst == 0 else "does not hold"


def _as_wanted(series: Series, steps: Sequence[int], wanted: Sequence[int]) -> Verdict:
    """Return whether, among some steps, the wanted ones are subgoals and the others are none."""
    if not wanted or not set(wanted) <= set(steps):
        return "does not hold"
    return _all_of([series.subgoal_side(step) * (1 if step in wanted else -1) for step in steps])


_ABOVE_MEAN = (
    _above_mean(lambda way: _single(way, GET_KEY), "The importance is above the mean where the key is taken."),
    _above_mean(lambda way: way.door_steps, "The importance is above the mean from opening the door to passing it."),
    _above_mean(lambda way: _single(way, REACH_GOAL), "The importance is above the mean where the goal is reached."),
)
