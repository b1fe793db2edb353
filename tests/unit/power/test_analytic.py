import json
from pathlib import Path

import numpy as np
import pytest

from tests.unit.power.designs import questions_of, study_and_plan
from webapp.analysis.censoring import Undefined
from webapp.power.analytic import paired_t_power
from webapp.power.design import planned_questions
from webapp.power.generation import within_sd
from webapp.study.analysis_plan import Contrast, Plan
from webapp.study.protocol import Study

GOLDEN = Path(__file__).parents[2] / "golden" / "analysis" / "pwr.json"
SECOND = questions_of()[1]
KINDS = ("all_key_points", "first_key_point")


def test_power_is_that_of_r() -> None:
    """In the paper's second experiment everyone sees both kinds once, so the difference has the SD within * sqrt(2)."""
    for known in json.loads(GOLDEN.read_text())["t_tests"]:
        effect = known["d"] * within_sd(0.6) * np.sqrt(2)
        found = paired_t_power(SECOND, KINDS, effect, known["n"], 0.6, known["level"])
        assert found == pytest.approx(known["paired"], abs=1e-6)


def test_without_an_effect_it_is_the_level() -> None:
    assert paired_t_power(SECOND, KINDS, 0.0, 20, 0.6, 0.01) == 0.01


def four_kinds_on_two_layouts() -> Study:
    study, _ = study_and_plan()
    kinds = ("full", "subgoals", "random", "highlights")
    first = study.experiments[0].model_copy(update={"kinds": kinds, "layouts": ("experiment1-a", "experiment1-b")})
    return study.model_copy(update={"experiments": (first,)})


def test_only_those_who_see_both_kinds_count() -> None:
    study = four_kinds_on_two_layouts()
    plan = Plan((Contrast("1", "subgoals", "full"),), (), {"1": ("general",)})
    (questions,) = planned_questions(study, plan)
    some = paired_t_power(questions, ("subgoals", "full"), 0.8, 24, 0.6, 0.05)
    assert some == pytest.approx(paired_t_power(SECOND, KINDS, 0.8, 4, 0.6, 0.05))
    with pytest.raises(Undefined, match="of 2 people see both subgoals and full"):
        paired_t_power(questions, ("subgoals", "full"), 0.8, 2, 0.6, 0.05)
