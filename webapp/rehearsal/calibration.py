"""A rehearsal without pages, many times: does the planned analysis err as seldom as it says?

Studies are generated at the level of the data, with the declared design and the ratings of the bots: each person has
one level of their own in all ratings, of all items and experiments. Some studies have no effect, some the planted ones,
and all are analysed as planned. Two promises are counted: of studies without effects, something is found in no more
than the level of the family; of intervals in planted studies, 95 % hold what was planted.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pandas as pd

from webapp.analysis.planned_comparisons import Comparison, compare_kinds
from webapp.bots.effects import Effects
from webapp.explainer.seeding import stream
from webapp.power.design import Trials, trials_of
from webapp.power.generation import BETWEEN_SD, within_sd
from webapp.rehearsal.planting import planted_difference
from webapp.study.analysis_plan import Plan
from webapp.study.experiments import Experiment
from webapp.study.intervals import cluster_interval, wilson_interval
from webapp.study.protocol import Study

Word = Literal["kept", "cautious", "broken", "nothing promised"]

COVERAGE = 0.95
_ALARMS = "null studies with any false alarm"
NO_EFFECTS = Effects()


@dataclass(frozen=True, slots=True)
class Promise:
    """A share that is promised, and the one that was found.

    Attributes:
        name: Of what.
        num: How many studies or tests count.
        total: Of how many.
        low: The lower end of the 95 % interval of the share.
        high: Its upper end.
        promised: The share that was promised; None where nothing is.
        is_most: Whether that is the largest share that keeps the promise; it is the smallest otherwise.
    """

    name: str
    num: int
    total: int
    low: float
    high: float
    promised: float | None = None
    is_most: bool = False

    @property
    def share(self) -> float:
        """The share that was found."""
        return self.num / self.total

    @property
    def word(self) -> Word:
        """What became of the promise: cautious if the interval lies on its safe side, broken if on the other."""
        if self.promised is None:
            return "nothing promised"
        if self.low <= self.promised <= self.high:
            return "kept"
        return "cautious" if (self.high < self.promised) == self.is_most else "broken"


@dataclass(frozen=True, slots=True)
class Calibration:
    """What came of all studies.

    Attributes:
        promises: The shares.
        rows: One per study and planned test: `studies`, `study`, `experiment`, `contrast`, `item`, `planted`, `d`,
            `d_low`, `d_high`, `p_holm`, `is_found`; numbers are missing where the ratings do not determine them.
    """

    promises: tuple[Promise, ...]
    rows: pd.DataFrame

    @property
    def is_kept(self) -> bool:
        """Whether no promise is broken."""
        return all(promise.word != "broken" for promise in self.promises)


def calibrate(
    study: Study,
    plan: Plan,
    effects: Effects,
    num_people: int,
    num_studies: int,
    seed: int,
    report: Callable[[int, int], None] = lambda _done, _total: None,
) -> Calibration:
    """Generate and analyse studies without effects and as many with them.

    Args:
        study: The declared study.
        plan: Its plan.
        effects: What is planted.
        num_people: In each study.
        num_studies: Of each sort, at least 2.
        seed: Of all that is drawn.
        report: Told how many of how many studies are done.

    Raises:
        ValueError: There are too few studies, or nothing is planned.
    """
    if num_studies < 2 or not plan.num_tests:  # noqa: PLR2004 - one study shows no chance
        raise ValueError(f"calibrating needs 2 studies and a planned test, not {num_studies} and {plan.num_tests}")
    rows = []
    for place, (name, planted) in enumerate((("null", NO_EFFECTS), ("planted", effects))):
        for number in range(num_studies):
            rng = stream(seed, "calibration", name, f"study {number}")
            ratings = generate_ratings(study, plan, planted, num_people, rng)
            tests = compare_kinds(ratings, plan).tests
            rows += [_row(name, number, test, planted) for test in tests]
            report(place * num_studies + number + 1, 2 * num_studies)
    table = pd.DataFrame(rows)
    return Calibration(_promises(table, plan), table)


def generate_ratings(
    study: Study, plan: Plan, effects: Effects, num_people: int, rng: np.random.Generator
) -> pd.DataFrame:
    """Return the ratings of one study: `participant, experiment, trial, layout, kind, item, rating`."""
    levels = BETWEEN_SD * rng.standard_normal(num_people)
    parts = []
    for experiment in study.experiments:
        trials = trials_of(experiment, num_people)
        for item in experiment.items:
            noise = within_sd(BETWEEN_SD) * rng.standard_normal(trials.kinds.shape)
            if item.id in plan.items.get(experiment.id, ()):
                latent = levels[:, None] + noise + _shifts(experiment, item.id, effects)[trials.kinds]
                ratings = np.clip(np.floor((item.points + 1) / 2 + latent + 0.5), 1, item.points).astype(np.int64)
                parts.append(_frame(experiment, trials, item.id, ratings))
    return pd.concat(parts, ignore_index=True)


def _shifts(experiment: Experiment, item: str, effects: Effects) -> "np.ndarray[tuple[int], np.dtype[np.float64]]":
    return np.array([effects.on_rating(kind, item) for kind in experiment.kinds])


def _frame(
    experiment: Experiment, trials: Trials, item: str, ratings: "np.ndarray[tuple[int, ...], np.dtype[np.int64]]"
) -> pd.DataFrame:
    num_people, num_trials = trials.kinds.shape
    kinds = np.array(experiment.kinds, dtype=object)[trials.kinds].ravel()
    frame = pd.DataFrame(
        {
            "participant": np.repeat([f"p{number:06d}" for number in range(num_people)], num_trials),
            "experiment": experiment.id,
            "trial": np.tile(np.arange(1, num_trials + 1), num_people),
            "layout": np.array(experiment.layouts, dtype=object)[trials.layouts].ravel(),
            "kind": kinds,
            "item": item,
            "rating": ratings.ravel(),
        }
    )
    asked = {kind for kind in experiment.kinds if item in {each.id for each in experiment.items_for(kind)}}
    return frame[frame["kind"].isin(asked)]


def _row(name: str, number: int, test: Comparison, effects: Effects) -> dict[str, object]:
    effect = test.effect
    numbers = (None, None, None) if effect is None else (effect.d, effect.d_low, effect.d_high)
    return {
        "studies": name,
        "study": number,
        "experiment": test.contrast.experiment,
        "contrast": str(test.contrast),
        "item": test.item,
        "planted": planted_difference(effects, test.contrast, test.item),
        **dict(zip(("d", "d_low", "d_high"), numbers, strict=True)),
        "p_holm": test.p_holm,
        "is_found": test.is_found,
    }


def _promises(table: pd.DataFrame, plan: Plan) -> tuple[Promise, ...]:
    null, planted = (table[table["studies"] == name] for name in ("null", "planted"))
    alarms = null.groupby("study")["is_found"].any()
    low, high = wilson_interval(int(alarms.sum()), len(alarms))
    determined = planted[planted["d"].notna()]
    covered = (determined["d_low"] <= determined["planted"]) & (determined["planted"] <= determined["d_high"])
    there, nothing = planted[planted["planted"] != 0], planted[planted["planted"] == 0]
    promises = [
        Promise(
            "null studies with any false alarm", int(alarms.sum()), len(alarms), low, high, plan.alpha, is_most=True
        ),
        _clustered("95 % intervals that hold the planted d", determined.assign(hit=covered), COVERAGE),
        _clustered("planted differences that are found", there.assign(hit=there["is_found"]), None),
        _clustered("false alarms beside planted differences", nothing.assign(hit=nothing["is_found"]), None),
        _clustered("tests that the ratings do not determine", table.assign(hit=table["d"].isna()), None),
    ]
    return tuple(promise for promise in promises if promise is not None)


def _clustered(name: str, tests: pd.DataFrame, promised: float | None) -> Promise | None:
    """Count tests, whose interval takes into account that those of a study share their people; None without tests."""
    if tests.empty:
        return None
    studies = tests.groupby(["studies", "study"])["hit"].agg(["sum", "count"])
    interval = cluster_interval((float(hits), int(num), 1) for hits, num in studies.itertuples(index=False))
    num = int(tests["hit"].sum())
    low, high = (num / len(tests),) * 2 if interval is None else interval
    return Promise(name, num, len(tests), max(0.0, low), min(1.0, high), promised)
