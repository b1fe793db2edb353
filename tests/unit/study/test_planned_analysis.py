"""Planned comparisons that do not fit the study: each is told in one line, with its place, its value and a wish."""

import re

import pytest

from tests.unit.study.test_contradictions import FULL, PAPER, problems_of

KINDS = "the kinds of experiment '1' are full, subgoals, random"


def planned(settings: str, text: str = PAPER) -> list[str]:
    """What is wrong with a study file with another planned analysis; of each problem what follows its line."""
    changed, count = re.subn(r"\[analysis\].*?\n\n", f"[analysis]\n{settings}\n\n", text, count=1, flags=re.DOTALL)
    assert count == 1
    return [re.sub(r"^study\.toml, line \d+: analysis\.", "", problem) for problem in problems_of(changed)]


def pair(first: str, second: str, experiment: str = "1") -> str:
    return f'{{ experiment = "{experiment}", first = "{first}", second = "{second}" }}'


@pytest.mark.parametrize(
    ("settings", "problem"),
    [
        (
            f"contrasts = [{pair('subgoals', 'random', '3')}]",
            "contrasts[1].experiment: is '3'; the experiments are 1, 2",
        ),
        (
            f"contrasts = [{pair('subgoal', 'random')}]",
            f"contrasts[1].first: is 'subgoal'; did you mean 'subgoals'? {KINDS}",
        ),
        (f"contrasts = [{pair('subgoals', 'none')}]", f"contrasts[1].second: is 'none'; {KINDS}"),
        (
            f"equivalences = [{pair('subgoals', 'subgoals')}]",
            "equivalences[1].second: is 'subgoals', the first kind too; name two kinds",
        ),
        (
            f"contrasts = [{pair('subgoals', 'random')}, {pair('subgoals', 'random')}]",
            "contrasts[2]: is about 'subgoals' and 'random' of experiment '1' again; keep one",
        ),
        (
            f"equivalences = [{pair('subgoals', 'full')}, {pair('full', 'subgoals')}]",
            "equivalences[2]: is about 'full' and 'subgoals' of experiment '1' again; keep one",
        ),
        (
            'items = ["generl"]',
            "items[1]: is 'generl'; did you mean 'general'? the items are likeliness, loveliness, general",
        ),
        ('items = ["general", "general"]', "items[2]: is 'general', which stands there already; keep one"),
        ("items = []", "items: is empty; list at least one, or leave it out"),
        ("contrasts = []", "contrasts: is empty; list at least one, or leave it out"),
        ("alpha = 0.0", "alpha: is 0.0; use more than 0"),
        ("alpha = nan", "alpha: is nan; use 0.2 or less"),
        ("equivalence_margin = 0", "equivalence_margin: is 0; use more than 0"),
        (
            "equivalence_margin = 4",
            "equivalence_margin: is 4, and 'likeliness' has 5 points, so any two kinds would be alike; use less than 4",
        ),
    ],
)
def test_a_planned_analysis_that_does_not_fit_is_told_in_one_line(settings: str, problem: str) -> None:
    assert planned(settings) == [problem]


def test_a_comparison_on_which_no_item_is_asked_of_both_kinds_is_refused() -> None:
    (problem,) = planned(f'contrasts = [{pair("subgoals", "none")}]\nitems = ["general"]', FULL)
    about, wish = "is about 'subgoals' and 'none' of experiment '1'", "no item that is tested is asked of both"
    assert problem == f"contrasts[1]: {about}, and {wish}; leave it out"
    assert planned(f"contrasts = [{pair('subgoals', 'none')}]", FULL) == []


def test_the_same_pair_may_be_compared_and_tested_for_equivalence_and_in_two_experiments() -> None:
    both = f"contrasts = [{pair('subgoals', 'full')}]\nequivalences = [{pair('subgoals', 'full')}]"
    assert planned(both) == []


def test_a_mistyped_kind_of_an_experiment_is_told_once_and_not_by_its_comparisons_too() -> None:
    problems = problems_of(PAPER.replace('"subgoals", "random"]', '"subgoal", "random"]', 1))
    assert len(problems) == 1
    assert "experiments[1].kinds[2]: is 'subgoal'" in problems[0]


def test_all_that_is_wrong_with_a_plan_is_told_at_once() -> None:
    assert len(planned(f'contrasts = [{pair("a", "b")}, {pair("full", "full")}]\nitems = ["x", "y"]')) == 5
