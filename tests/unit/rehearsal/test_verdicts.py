from dataclasses import replace

import pytest

from tests.unit.rehearsal.samples import PLAN, STUDY, effects, ratings
from webapp.analysis.planned_comparisons import Comparison, Comparisons, compare_kinds
from webapp.analysis.planned_model import Effect
from webapp.bots.effects import Effects
from webapp.rehearsal.planting import default_effects, planted_difference, planted_effects, told
from webapp.rehearsal.verdicts import Word, conclusion, judge
from webapp.study.analysis_plan import Contrast, Plan

PAIR = Contrast("1", "subgoals", "random")
PLANTED = Effects({("subgoals", ""): 0.5})
NOTHING = Effects()


def a_test(d: float, p_holm: float, error: float = 0.2) -> Comparisons:
    """One test of a family of one, in a large sample."""
    return Comparisons({}, (Comparison(PAIR, "general", Effect(d, error, 10_000, d, error), "", p_holm, 0.05),))


@pytest.mark.parametrize(
    ("planted", "d", "p_holm", "word"),
    [
        (PLANTED, 0.6, 0.003, "recovered"),
        (PLANTED, 0.3, 0.13, "missed"),
        (PLANTED, 1.1, 0.001, "off"),  # The interval ends above what was planted.
        (PLANTED, -0.6, 0.003, "off"),
        (NOTHING, 0.1, 0.62, "quiet"),
        (NOTHING, 0.6, 0.003, "false alarm"),
    ],
)
def test_a_test_is_judged_by_what_was_planted(planted: Effects, d: float, p_holm: float, word: Word) -> None:
    (verdict,) = judge(a_test(d, p_holm), planted)
    assert verdict.word == word
    assert verdict.is_good == (word in {"recovered", "quiet"})


def test_a_test_without_a_number_is_no_success() -> None:
    missing = Comparisons({}, (Comparison(PAIR, "general", None, "nobody rated it", None, 0.05),))
    (verdict,) = judge(missing, NOTHING)
    assert verdict.word == "not determined"
    assert not verdict.is_good


def test_intervals_are_wider_the_more_tests_there_are() -> None:
    (alone,) = judge(a_test(0.6, 0.003), PLANTED)
    both = Comparisons({}, a_test(0.6, 0.003).tests * 9)
    among = judge(both, PLANTED)[0]
    assert alone.low is not None
    assert among.low is not None
    assert alone.low == pytest.approx(0.6 - 1.96 * 0.2, abs=1e-3)
    assert among.low == pytest.approx(0.6 - 2.773 * 0.2, abs=1e-3)


def test_what_is_planted_in_a_contrast_is_the_difference_of_its_kinds_on_the_item() -> None:
    planted = effects("subgoals=0.5", "subgoals.general=0.2", "random=-0.4")
    assert planted_difference(planted, PAIR, "likeliness") == pytest.approx(0.9)
    assert planted_difference(planted, PAIR, "general") == pytest.approx(0.6)
    assert planted_difference(planted, Contrast("1", "full", "subgoals"), "general") == pytest.approx(-0.2)


def test_if_nothing_is_said_the_first_kind_of_each_experiments_plan_is_rated_higher() -> None:
    assert default_effects(PLAN) == ("subgoals=1", "all_key_points=1")
    assert told(planted_effects((), STUDY, PLAN)) == ("all_key_points=1", "subgoals=1")
    assert default_effects(Plan((), (), {})) == ()


def test_planted_effects_are_recovered_and_nothing_else_is_found() -> None:
    planted = effects("subgoals.general=1.2")
    verdicts = judge(compare_kinds(ratings(planted, 120), PLAN), planted)
    words = {(verdict.contrast.first, verdict.item): verdict.word for verdict in verdicts}
    assert words.pop(("subgoals", "general")) == "recovered"
    assert set(words.values()) == {"quiet"}
    assert "recovered everything" in conclusion(verdicts)


def test_an_analysis_that_mixes_up_two_kinds_is_caught() -> None:
    planted = effects("subgoals=1.2")
    mixed_up = ratings(planted).replace({"kind": {"subgoals": "random", "random": "subgoals"}})
    verdicts = judge(compare_kinds(mixed_up, PLAN), planted)
    words = {str(verdict.contrast): verdict.word for verdict in verdicts}
    assert words["subgoals \N{MINUS SIGN} random"] == "off"
    assert words["subgoals \N{MINUS SIGN} full"] == "missed"
    assert "6 of 9 tests did not come out as planted" in conclusion(verdicts)
    assert "one of twenty" in conclusion(verdicts)


def test_the_plan_decides_what_is_judged() -> None:
    smaller = replace(PLAN, contrasts=PLAN.contrasts[:1], items={"1": ("general",), "2": ()})
    assert len(judge(compare_kinds(ratings(effects()), smaller), effects())) == 1
