from collections import Counter

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.power.designs import an_experiment, questions_of, study_and_plan
from webapp.power.design import trials_of
from webapp.study.analysis_plan import plan_of
from webapp.study.counterbalancing import arrangements, layout_orders
from webapp.study.experiments import BUILT_IN_KINDS

SHAPES = {
    "num_kinds": st.integers(1, 5),
    "num_layouts": st.integers(1, 5),
    "order": st.sampled_from(["fixed", "counterbalanced"]),
}


@given(**SHAPES)
def test_everyone_sees_each_layout_once_with_the_kind_that_an_arrangement_gives_it(
    num_kinds: int, num_layouts: int, order: str
) -> None:
    experiment = an_experiment(BUILT_IN_KINDS[:num_kinds], num_layouts, order)
    trials = trials_of(experiment, 30)
    known, orders = set(arrangements(experiment)), set(layout_orders(experiment))
    for kinds, layouts in zip(trials.kinds, trials.layouts, strict=True):
        assert tuple(layouts) in orders
        by_layout = dict(zip(layouts, kinds, strict=True))
        assert tuple(experiment.kinds[by_layout[layout]] for layout in range(num_layouts)) in known


@given(**SHAPES)
def test_each_pair_of_an_arrangement_and_an_order_comes_once_in_a_full_round(
    num_kinds: int, num_layouts: int, order: str
) -> None:
    experiment = an_experiment(BUILT_IN_KINDS[:num_kinds], num_layouts, order)
    num_people = len(arrangements(experiment)) * len(layout_orders(experiment))
    trials = trials_of(experiment, num_people)
    pairs = Counter(zip(map(tuple, trials.kinds), map(tuple, trials.layouts), strict=True))
    assert len(pairs) == num_people


@given(num_people=st.integers(1, 40), more=st.integers(0, 40))
def test_the_first_people_do_the_same_however_many_follow(num_people: int, more: int) -> None:
    experiment = an_experiment(["full", "subgoals", "random"], 4, "counterbalanced")
    few, many = trials_of(experiment, num_people), trials_of(experiment, num_people + more)
    assert np.array_equal(few.kinds, many.kinds[:num_people])
    assert np.array_equal(few.layouts, many.layouts[:num_people])


def test_items_with_the_same_scale_and_kinds_are_simulated_together() -> None:
    assert [questions.name for questions in questions_of()] == [
        "1/likeliness loveliness general",
        "2/likeliness loveliness general",
    ]


def test_an_item_that_is_not_asked_without_an_explanation_has_no_contrast_with_none() -> None:
    study, plan = study_and_plan("understanding")
    found = {each.items: each for each in questions_of("understanding")}
    asked_always, asked_of_the_shown = found[("foresee",)], found[("likeliness", "loveliness", "general")]
    assert "none" in {contrast.second for contrast in asked_always.contrasts}
    assert "none" not in asked_of_the_shown.kinds
    tested = sum(len(each.items) * len(each.contrasts) for each in found.values())
    assert tested == plan.num_tests == plan_of(study).num_tests
