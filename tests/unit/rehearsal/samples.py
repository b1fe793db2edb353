"""The shipped study with its plan, effects in it, and data of it that were generated."""

import numpy as np
import pandas as pd

from tests.unit.power.designs import study_and_plan
from webapp.bots.effects import Effects
from webapp.rehearsal.calibration import generate_ratings
from webapp.rehearsal.planting import planted_effects
from webapp.study.analysis_plan import Plan

STUDY, PLAN = study_and_plan()


def effects(*texts: str) -> Effects:
    return planted_effects(texts, STUDY, PLAN)


def ratings(planted: Effects, num_people: int = 60, seed: int = 1, plan: Plan = PLAN) -> pd.DataFrame:
    return generate_ratings(STUDY, plan, planted, num_people, np.random.default_rng(seed))
