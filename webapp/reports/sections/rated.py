"""The ratings of one experiment, as the paper's analysis takes them, and how its sections say what they cannot."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from webapp.analysis.censoring import Undefined
from webapp.analysis.correlation import intraclass
from webapp.analysis.means import row
from webapp.analysis.multiplicity import holm
from webapp.analysis.two_samples import TestResult
from webapp.reports.blocks import Assumption, Statement, Verdict
from webapp.reports.formatting import listed, number, p_clause
from webapp.reports.sections.paper_numbers import ITEMS, PaperExperiment, paper_experiment
from webapp.reports.study_data import StudyData
from webapp.study.analysis_plan import FOCAL_KINDS
from webapp.study.experiments import Experiment

ALPHA = 0.05
_MOST_SUBJECTS = 6
"""A statement names up to so many things that it is about."""

MOST_KINDS = 4
"""Of up to so many kinds all pairs are compared, of more the planned ones."""

_PAPERS_POINTS = 5


@dataclass(frozen=True, slots=True, eq=False)
class Rated:
    """An experiment of which there are ratings, or which the study file declares.

    Attributes:
        id: Of the experiment.
        kinds: As declared, then others that were seen.
        items: Likewise.
        points: `[items]`: how many points the scale of each has.
        frame: Its ratings.
        unasked: Kinds and items that do not go together by design, as where nothing was explained.
        planned: Pairs of kinds that are planned to be compared.
    """

    id: str
    kinds: tuple[str, ...]
    items: tuple[str, ...]
    points: tuple[int, ...]
    frame: pd.DataFrame
    unasked: frozenset[tuple[str, str]] = frozenset()
    planned: tuple[tuple[str, str], ...] = ()

    @property
    def paper(self) -> PaperExperiment | None:
        """The experiment of the paper that it repeats: with the same kinds, rated on five points."""
        asked = [self.points_of(item) for item in ITEMS if item in self.items]
        return paper_experiment(self.kinds) if all(points == _PAPERS_POINTS for points in asked) else None

    @property
    def compares_planned_pairs(self) -> bool:
        """Whether it has so many kinds that only planned pairs are compared."""
        return len(self.kinds) > MOST_KINDS and bool(self.planned)

    def ratings(self, kind: str, item: str) -> NDArray[np.float64]:
        """Return `[N]` the ratings of a kind on an item, by participant and trial."""
        return row(self._rows(item, kind)["rating"])

    def paired(self, first: str, second: str, item: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return `[N]` each: the ratings of whoever rated both kinds, and each once."""
        columns = [self._rows(item, kind).set_index("participant")["rating"] for kind in (first, second)]
        once = [column[~column.index.duplicated(keep=False)] for column in columns]
        both = once[0].index.intersection(once[1].index).sort_values()
        a, b = (column.loc[both].to_numpy(dtype=np.float64) for column in once)
        return a, b

    def wide(self, items: Sequence[str]) -> pd.DataFrame:
        """Return one row per rated trial that has all the items: `participant`, `trial`, `kind`, and a column each."""
        keys = ["participant", "trial", "kind"]
        columns = [
            self.frame[self.frame["item"] == item].drop_duplicates(keys).set_index(keys)["rating"].rename(item)
            for item in items
        ]
        return pd.concat(columns, axis=1, join="inner").sort_index().reset_index()

    def kinds_of(self, item: str) -> tuple[str, ...]:
        """Return the kinds that are rated on an item."""
        return tuple(kind for kind in self.kinds if (kind, item) not in self.unasked)

    def pairs(self, item: str) -> tuple[tuple[str, str], ...]:
        """Return the pairs of the kinds of an item that are compared.

        Of many kinds these are the planned ones. Otherwise they are all, the kind that the paper proposes first, if one
        of the two is.
        """
        if self.compares_planned_pairs:
            return tuple(pair for pair in self.planned if set(pair) <= set(self.kinds_of(item)))
        return tuple(
            (b, a) if b in FOCAL_KINDS and a not in FOCAL_KINDS else (a, b)
            for a, b in combinations(self.kinds_of(item), 2)
        )

    def points_of(self, item: str) -> int:
        """Return how many points the scale of an item has."""
        return self.points[self.items.index(item)]

    def _rows(self, item: str, kind: str) -> pd.DataFrame:
        frame = self.frame
        return frame[(frame["item"] == item) & (frame["kind"] == kind)].sort_values(["participant", "trial"])


@dataclass(slots=True)
class Undecided:
    """Collects what the data do not determine, so that one statement tells of all that fails for one reason."""

    subjects: dict[str, list[str]] = field(default_factory=dict)

    def add(self, subject: str, reason: Undefined) -> None:
        """Note that something could not be computed."""
        self.subjects.setdefault(str(reason), []).append(subject)

    def statements(self, what: str) -> tuple[Statement, ...]:
        """Return a statement per reason, in the order in which they came up.

        Args:
            what: Was to be computed.
        """
        return tuple(Statement(f"{what}: {_listed(subjects)}", why) for why, subjects in self.subjects.items())


def rated_experiments(data: StudyData) -> tuple[Rated, ...]:
    """Return the experiments in the order of the study file, then others of which there are ratings."""
    declared = {experiment.id: experiment for experiment in data.declared.experiments} if data.declared else {}
    names = _first_then_seen(tuple(declared), data.ratings["experiment"])
    return tuple(_rated(data, name, declared.get(name)) for name in names)


def told_apart(data: StudyData, experiments: Sequence[Rated]) -> str:
    """Say that a study is another than the paper's, and in what; nothing if one of its experiments is the paper's.

    Args:
        data: What is analysed.
        experiments: Its experiments.
    """
    if any(rated.paper for rated in experiments):
        return ""
    kinds = list(dict.fromkeys(kind for rated in experiments for kind in rated.kinds))
    points = sorted({each for rated in experiments for each in rated.points})
    others = [f"of kinds of explanation ({listed(kinds)})"] if not any(map(_has_papers_kinds, experiments)) else []
    if points != [_PAPERS_POINTS]:
        others.append(f"of scales ({listed([str(each) for each in points], 'or')} points and not {_PAPERS_POINTS})")
    return (
        f"{data.study or 'This study'} is not the paper's study: its choice {listed([*others, 'of material'])} is "
        "another one. Nothing here repeats a result of the paper or speaks against one; only the way of computing is "
        "the paper's."
    )


def titled(data: StudyData, what: str) -> str:
    """Return the title of a section of the paper's analysis.

    Args:
        data: What is analysed; only where the paper's own study is repeated is the analysis one that was printed.
        what: The section is about.
    """
    is_papers = any(rated.paper for rated in rated_experiments(data))
    return f"The paper's analysis, as printed: {what}" if is_papers else f"In the paper's way: {what}"


def rejections(test: str, assumes: str, found: Sequence[TestResult], what: str) -> Assumption:
    """Say what tests of an assumption came to: violated where one still rejects after Holm's correction.

    Args:
        test: The test that assumes it.
        assumes: The assumption.
        found: Of the tests that could be made, of one name.
        what: They were made on each of, such as `cells`.
    """
    if not found:
        return Assumption(test, assumes, f"in none of the {what} could it be tested", "not checkable")
    p_values = [one.p_value for one in found]
    smallest = min(found, key=lambda one: one.p_value)
    num = sum(p_value < ALPHA for p_value in p_values)
    told = f"{found[0].name}: p < .05 in {num} of {len(found)} {what}, smallest {p_clause(smallest.p_value)}"
    verdict: Verdict = "doubtful" if num else "holds"
    return Assumption(test, assumes, told, "violated" if holm(p_values).min() < ALPHA else verdict)


def independence(test: str, rated: Rated, items: Sequence[str]) -> Assumption:
    """Say how alike one person's ratings are, kinds apart: they depend wherever somebody rates several times."""
    told, is_repeated = [], False
    for item in items:
        rows = rated.frame[rated.frame["item"] == item]
        is_repeated = is_repeated or bool(rows["participant"].duplicated().any())
        apart = rows["rating"] - rows.groupby("kind")["rating"].transform("mean")
        try:
            found = intraclass(apart.to_numpy(dtype=np.float64), list(rows["participant"]))
        except Undefined:
            continue
        value = found.value
        told.append(f"{item} {number(value.value)} [{number(value.low)}, {number(value.high)}]")
    check = "nobody rates twice"
    if is_repeated:
        numbers = (
            f"ICC(1) of ratings less their kind's mean: {', '.join(told)}" if told else "no ICC(1) can be computed"
        )
        check = f"people rate several explanations each; {numbers}"
    return Assumption(test, "ratings are independent", check, "violated" if is_repeated else "holds")


def interval_scale(test: str, points: Sequence[int]) -> Assumption:
    """Say that means take the steps of a scale for equal."""
    sizes = " or ".join(str(one) for one in sorted(set(points)))
    check = f"single items with {sizes} ordered answers; no number in the data tells whether their steps are equal"
    return Assumption(test, "ratings lie on a scale with equal steps", check, "not checkable")


def _rated(data: StudyData, name: str, declared: Experiment | None) -> Rated:
    frame = data.ratings[data.ratings["experiment"] == name]
    known = tuple(item.id for item in declared.items) if declared else tuple(data.plan.items.get(name, ()))
    items = _first_then_seen(known, frame["item"])
    kinds = _first_then_seen(declared.kinds if declared else (), frame["kind"])
    points = tuple(max(2, data.points.get((name, item), 5)) for item in items)
    asked = {(kind, item.id) for kind in kinds for item in (declared.items_for(kind) if declared else ())}
    seen = set(zip(frame["kind"], frame["item"], strict=True))
    pairs = {(kind, item) for kind in kinds for item in items}
    unasked = frozenset(pairs - asked - seen if declared else ())
    return Rated(name, kinds, items, points, frame, unasked, _planned_pairs(data, name))


def _planned_pairs(data: StudyData, experiment: str) -> tuple[tuple[str, str], ...]:
    """Return the pairs that are planned to be compared or tested for equivalence, each once."""
    pairs: dict[frozenset[str], tuple[str, str]] = {}
    for each in (*data.plan.contrasts, *data.plan.equivalences):
        if each.experiment == experiment:
            pairs.setdefault(frozenset((each.first, each.second)), (each.first, each.second))
    return tuple(pairs.values())


def _first_then_seen(first: Sequence[str], seen: pd.Series) -> tuple[str, ...]:
    return (*first, *sorted(set(seen) - set(first)))


def _has_papers_kinds(rated: Rated) -> bool:
    return paper_experiment(rated.kinds) is not None


def _listed(subjects: Sequence[str]) -> str:
    rest = len(subjects) - _MOST_SUBJECTS
    return "; ".join(subjects[:_MOST_SUBJECTS]) + (f" and {rest} more" if rest > 0 else "")
