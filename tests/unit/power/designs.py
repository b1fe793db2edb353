"""Studies to simulate: the shipped ones, and experiments of any shape."""

from collections.abc import Sequence
from pathlib import Path

from webapp.power.design import Questions, planned_questions
from webapp.study.analysis_plan import Plan, plan_of
from webapp.study.experiments import Experiment
from webapp.study.protocol import Study, parse_study

STUDIES = Path(__file__).parents[3] / "webapp" / "studies"


def study_and_plan(name: str = "sakai2021") -> tuple[Study, Plan]:
    study = parse_study((STUDIES / name / "study.toml").read_text(encoding="utf-8"))
    return study, plan_of(study)


def questions_of(name: str = "sakai2021") -> tuple[Questions, ...]:
    return planned_questions(*study_and_plan(name))


def an_experiment(kinds: Sequence[str], num_layouts: int, order: str = "fixed") -> Experiment:
    return Experiment.model_validate(
        {
            "id": "1",
            "situation": "current_view",
            "layouts": [f"layout-{number}" for number in range(num_layouts)],
            "kinds": list(kinds),
            "layout_order": order,
            "items": [{"id": "general"}],
        }
    )
