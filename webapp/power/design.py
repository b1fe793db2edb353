"""Who sees which kind on which layout at which position, and what is rated: the design that a study file declares."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import lcm

import numpy as np
from numpy.typing import NDArray

from webapp.study.analysis_plan import Contrast, Plan
from webapp.study.counterbalancing import arrangements, layout_orders
from webapp.study.experiments import Experiment, Kind
from webapp.study.protocol import Study


@dataclass(frozen=True, slots=True, eq=False)
class Trials:
    """The trials of N participants in one experiment, T each, in the order in which they come.

    Attributes:
        kinds: `[N, T]`, the kind shown, as an index into the experiment's kinds.
        layouts: `[N, T]`, the layout, as an index into the experiment's layouts.
    """

    kinds: NDArray[np.int64]
    layouts: NDArray[np.int64]


def trials_of(experiment: Experiment, num_people: int) -> Trials:
    """Give each of so many participants an arrangement and a layout order, as evenly as they are declared.

    The first n of them are the same whatever the number is. Arrangements and orders both go round; after each common
    round the order moves on by one, so that every pair comes before one comes twice as often as another.
    """
    kind_index = {kind: index for index, kind in enumerate(experiment.kinds)}
    patterns = np.array([[kind_index[kind] for kind in each] for each in arrangements(experiment)], dtype=np.int64)
    orders = np.array(layout_orders(experiment), dtype=np.int64)
    people = np.arange(num_people)
    arrangement = people % len(patterns)
    order = (people + people // lcm(len(patterns), len(orders))) % len(orders)
    layouts = orders[order]
    return Trials(np.take_along_axis(patterns[arrangement], layouts, axis=1), layouts)


@dataclass(frozen=True, slots=True)
class Questions:
    """Items of an experiment that are alike to a simulation, and the contrasts that are planned on them.

    Attributes:
        experiment: The experiment.
        items: Items with the same scale, asked after the same kinds.
        points: The number of answers of each, at least 2.
        kinds: The kinds after which they are asked.
        contrasts: The planned ones between such kinds.
    """

    experiment: Experiment
    items: tuple[str, ...]
    points: int
    kinds: tuple[Kind, ...]
    contrasts: tuple[Contrast, ...]

    @property
    def name(self) -> str:
        """The experiment and the items."""
        return f"{self.experiment.id}/{' '.join(self.items)}"

    @property
    def first_kinds(self) -> tuple[Kind, ...]:
        """The first kinds of the contrasts, each once."""
        return tuple(dict.fromkeys(contrast.first for contrast in self.contrasts))


def planned_questions(study: Study, plan: Plan) -> tuple[Questions, ...]:
    """Return what the plan tests in each experiment; items that nothing is planned on are left out."""
    return tuple(
        questions
        for experiment in study.experiments
        for questions in _of_experiment(experiment, plan)
        if questions.contrasts
    )


def _of_experiment(experiment: Experiment, plan: Plan) -> Sequence[Questions]:
    alike: dict[tuple[int, bool], list[str]] = {}
    tested = plan.items.get(experiment.id, ())
    for item in experiment.items:
        if item.id in tested:
            is_asked_always = item.without_explanation or "none" not in experiment.kinds
            alike.setdefault((item.points, is_asked_always), []).append(item.id)
    found = []
    for (points, is_asked_always), items in alike.items():
        kinds = tuple(kind for kind in experiment.kinds if is_asked_always or kind != "none")
        contrasts = tuple(
            contrast
            for contrast in plan.contrasts
            if contrast.experiment == experiment.id and set(items) <= set(plan.items_of(contrast))
        )
        found.append(Questions(experiment, tuple(items), points, kinds, contrasts))
    return found
