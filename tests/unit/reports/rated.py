"""Data to analyse, made by hand: people who rate each kind once, from a latent opinion."""

from collections.abc import Mapping, Sequence
from itertools import permutations

import numpy as np
import pandas as pd

from webapp.reports.study_data import StudyData
from webapp.study.analysis_plan import Plan, plan_without

ITEMS = ("likeliness", "loveliness", "general")
KINDS: Mapping[str, tuple[str, ...]] = {
    "1": ("full", "subgoals", "random"),
    "2": ("all_key_points", "first_key_point"),
}


def rated(num_people: int, shifts: Mapping[str, float] | None = None, seed: int = 0) -> pd.DataFrame:
    """Return the ratings of people in the paper's two experiments, each kind shifted by so many SDs of the opinion."""
    rng = np.random.default_rng(seed)
    rows = []
    for person in range(num_people):
        means = {item: rng.normal(0, 0.6) for item in ITEMS}
        for experiment, kinds in KINDS.items():
            orders = list(permutations(kinds))
            for place, kind in enumerate(orders[person % len(orders)], start=1):
                for item in ITEMS:
                    latent = 3 + means[item] + (shifts or {}).get(kind, 0.0) + rng.normal(0, 0.8)
                    rating = int(np.clip(np.round(latent), 1, 5))
                    layout = f"experiment{experiment}-{'abc'[place - 1]}"
                    rows.append((f"person{person:04}", experiment, place, layout, kind, item, rating, 900))
    names = ["participant", "experiment", "trial", "layout", "kind", "item", "rating", "response_time_ms"]
    return pd.DataFrame(rows, columns=names)


def study_data(
    ratings: pd.DataFrame, plan: Plan | None = None, kinds: Mapping[str, Sequence[str]] = KINDS
) -> StudyData:
    """Return data to analyse with nothing but ratings in them."""
    people = pd.DataFrame({"participant": sorted(ratings["participant"].unique())})
    known = plan or plan_without(kinds, dict.fromkeys(kinds, ITEMS))
    points = {(experiment, item): 5 for experiment in kinds for item in ITEMS}
    return StudyData("made", "f" * 64, "live", ratings, people, None, None, None, None, None, {}, points, known)
