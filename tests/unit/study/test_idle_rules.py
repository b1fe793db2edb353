from pathlib import Path

import pytest

from tests.web.studies import one_experiment
from webapp.study.experiments import Experiment
from webapp.study.idle_rules import idle_rules
from webapp.study.protocol import parse_study
from webapp.study.sections import Quality

SHIPPED = Path(__file__).parents[3] / "webapp" / "studies" / "sakai2021" / "study.toml"


def an_experiment(num_layouts: int, num_items: int) -> Experiment:
    (declared,) = one_experiment(["full"], num_layouts, items=[{"id": f"item-{i}"} for i in range(num_items)])
    return Experiment.model_validate(declared)


@pytest.mark.parametrize(("num_layouts", "num_items"), [(1, 3), (3, 1), (1, 1)])
def test_equal_answers_to_a_single_item_or_in_a_single_trial_say_nothing(num_layouts: int, num_items: int) -> None:
    ((path, message),) = idle_rules(
        Quality(straight_lining=True),
        [an_experiment(num_layouts, num_items)],
        num_checks=0,
        has_quiz=False,
        is_recruited=False,
    )
    assert path == ("quality", "straight_lining")
    assert message == "is true, and equal answers would say nothing; it needs at least 2 trials and at least 2 items"


def test_rules_that_can_mark_somebody_are_allowed() -> None:
    every = Quality(straight_lining=True, failed_attention_checks=2, failed_quiz=True, duplicates=True, incomplete=True)
    experiments = [an_experiment(2, 2)]
    assert list(idle_rules(every, experiments, num_checks=2, has_quiz=True, is_recruited=True)) == []


def test_every_rule_that_could_mark_nobody_is_told() -> None:
    every = Quality(straight_lining=True, failed_attention_checks=1, failed_quiz=True, duplicates=True)
    told = {
        path[-1]: message for path, message in idle_rules(every, [], num_checks=0, has_quiz=False, is_recruited=False)
    }
    assert told.keys() == {"straight_lining", "failed_attention_checks", "failed_quiz", "duplicates"}
    assert told["failed_attention_checks"] == "is 1, and there are 0 checks; declare [[attention_checks]]"


def test_the_papers_study_declares_no_rules_no_quota_and_the_default_lease() -> None:
    study = parse_study(SHIPPED.read_text(encoding="utf-8"))
    assert (study.quality, study.quota, study.lease_minutes) == (Quality(), None, 60)
