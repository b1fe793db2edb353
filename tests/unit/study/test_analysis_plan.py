"""What is tested: as a study file declares it, and by one rule where it does not."""

import json
import re
from itertools import combinations

from hypothesis import given
from hypothesis import strategies as st

from tests.unit.study.test_contradictions import FULL, PAPER, without_plan
from webapp.study.analysis_plan import ALPHA, EQUIVALENCE_MARGIN, Contrast, Plan, plan_of, plan_without
from webapp.study.experiments import BUILT_IN_KINDS
from webapp.study.protocol import Study, parse_study

ITEMS = ("likeliness", "loveliness", "general")


def test_the_papers_study_plans_the_papers_comparisons() -> None:
    plan = plan_of(parse_study(PAPER), "in words")
    assert [str(contrast) for contrast in plan.contrasts] == [
        "subgoals \N{MINUS SIGN} random",
        "subgoals \N{MINUS SIGN} full",
        "all_key_points \N{MINUS SIGN} first_key_point",
    ]
    assert plan.equivalences == (
        Contrast("1", "subgoals", "full"),
        Contrast("2", "first_key_point", "all_key_points"),
    )
    assert (plan.items, plan.num_tests) == ({"1": ITEMS, "2": ITEMS}, 9)
    assert (plan.alpha, plan.margin, plan.text) == (ALPHA, EQUIVALENCE_MARGIN, "in words")
    assert plan.is_declared
    assert plan.is_margin_declared


def test_without_a_declaration_the_papers_study_has_the_same_plan_but_for_the_word_declared() -> None:
    declared, plan = plan_of(parse_study(PAPER)), plan_of(parse_study(without_plan(PAPER)))
    assert set(plan.contrasts) == set(declared.contrasts)
    assert set(plan.equivalences) == set(declared.equivalences)
    assert (plan.is_declared, plan.is_margin_declared, plan.num_tests) == (False, False, 9)


def test_a_kind_without_explanation_is_compared_on_what_it_is_asked() -> None:
    plan = plan_of(parse_study(FULL))
    asked = {contrast.second: plan.items_of(contrast) for contrast in plan.contrasts if contrast.first == "subgoals"}
    assert asked["none"] == ("foresee",)
    assert asked["placebic"] == ("foresee", *ITEMS)
    assert plan.num_tests == 4 * 4 + 1


def test_a_kind_that_is_asked_nothing_is_in_no_default_comparison() -> None:
    text = without_plan(FULL).replace("without_explanation = true", "without_explanation = false", 1)
    without_checks = re.sub(r"\[\[attention_checks\]\].*?\n\n", "", text, flags=re.DOTALL)
    plan = plan_of(parse_study(without_checks.replace("failed_attention_checks = 2", "")))
    assert {contrast.second for contrast in plan.contrasts} == {
        "tailored_all",
        "highlights",
        "evenly_spaced",
        "placebic",
    }


def test_a_plan_survives_the_bundle_that_keeps_the_study_as_json() -> None:
    for text in (PAPER, FULL, without_plan(PAPER)):
        study = parse_study(text)
        kept = Study.model_validate_json(json.dumps(study.model_dump(mode="json")))
        assert plan_of(kept) == plan_of(study)


def test_without_a_study_file_items_and_kinds_have_the_papers_order() -> None:
    plan = plan_without(
        {"1": {"random", "full", "subgoals"}}, {"1": {"general", "loveliness", "likeliness", "satisfaction_1"}}
    )
    assert plan.items == {"1": ITEMS}
    assert plan.contrasts == (Contrast("1", "subgoals", "full"), Contrast("1", "subgoals", "random"))
    assert plan.equivalences == (Contrast("1", "subgoals", "full"),)
    assert plan_without({"1": ["full"]}, {"1": ["satisfaction_2"]}).items == {"1": ("satisfaction_2",)}


kinds = st.sets(st.sampled_from([*BUILT_IN_KINDS, "mine", "another"]), max_size=6)
items = st.sets(st.sampled_from([*ITEMS, "zeal", "ease"]), min_size=1, max_size=4)


@given(st.dictionaries(st.sampled_from(["1", "2"]), st.tuples(kinds, items)), st.data())
def test_any_data_have_a_plan_that_compares_what_is_there(
    found: dict[str, tuple[set[str], set[str]]], data: st.DataObject
) -> None:
    asked = {
        (experiment, kind): data.draw(st.sets(st.sampled_from(sorted(of_it))))
        for experiment, (kinds_of_it, of_it) in sorted(found.items())
        for kind in sorted(kinds_of_it)
    }
    plan = plan_without(
        {name: names for name, (names, _) in found.items()}, {name: names for name, (_, names) in found.items()}, asked
    )
    for contrast in (*plan.contrasts, *plan.equivalences):
        assert {contrast.first, contrast.second} <= found[contrast.experiment][0]
        of_both = asked[contrast.experiment, contrast.first] & asked[contrast.experiment, contrast.second]
        assert set(plan.items_of(contrast)) == of_both != set()
    pairs = [(one.experiment, frozenset({one.first, one.second})) for one in plan.contrasts]
    assert len(set(pairs)) == len(pairs)
    assert plan.num_tests <= sum(len(list(combinations(names, 2))) * len(of_it) for names, of_it in found.values())


def test_a_contrast_of_an_experiment_that_has_no_items_is_no_test() -> None:
    assert Plan((Contrast("9", "full", "random"),), (), {}).num_tests == 0
