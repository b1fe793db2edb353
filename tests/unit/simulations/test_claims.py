"""Verdicts on claims, from groups whose truth is known."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from webapp.simulations.claims import Claim, Expectation, compare_groups, overall, sample_of, summed_up
from webapp.simulations.conditions import Condition
from webapp.simulations.settings import SweepSettings
from webapp.simulations.sweeps import as_rows

SETTINGS = SweepSettings(num_resamples=2000)
BUDGET = 200


def group(name: str) -> Condition:
    return Condition(name, "derived", ((0, 0),), (1,), "repeatable", keeps_optimum=True)


def rows(episodes: Mapping[str, Sequence[int]]) -> pd.DataFrame:
    """Return rows in which a run that took the whole budget is censored."""
    return as_rows(
        [
            {
                "run_id": f"repeatable/{name}/{number:03d}",
                "condition": name,
                "kind": "derived",
                "variant": "repeatable",
                "steps": "1",
                "keeps_optimum": 1,
                "number": number,
                "episodes": value,
                "is_optimal": int(value < BUDGET),
                "actions": 1,
                "goals": 1,
                "first_goal": None,
            }
            for name, values in episodes.items()
            for number, value in enumerate(values)
        ]
    )


def around(mean: float, count: int, seed: int) -> list[int]:
    return [round(value) for value in np.random.default_rng(seed).normal(mean, 4, count)]


def judged(expects: Expectation, first: Sequence[int], second: Sequence[int]) -> pd.Series:
    claim = Claim("a claim", "ours", expects, group("first"), group("second"))
    return compare_groups([claim], rows({"first": first, "second": second}), SETTINGS).iloc[0]


FASTER, SLOWER, SAME = around(30, 30, 0), around(80, 30, 1), around(30, 30, 2)
FEW_APART = ([20, 60, 40, 90], [30, 70, 50, 95])


@pytest.mark.parametrize(
    ("expects", "faster", "same", "slower"),
    [
        ("fewer", "holds", "does not hold", "does not hold"),
        ("not more", "holds", "holds", "does not hold"),
        ("no difference", "does not hold", "holds", "does not hold"),
        ("not fewer", "does not hold", "holds", "holds"),
    ],
)
def test_clear_differences_and_clear_equality_decide(expects: Expectation, faster: str, same: str, slower: str) -> None:
    assert judged(expects, FASTER, SLOWER)["verdict"] == faster
    assert judged(expects, FASTER, SAME)["verdict"] == same
    assert judged(expects, SLOWER, FASTER)["verdict"] == slower


@pytest.mark.parametrize("expects", ["fewer", "not more", "no difference", "not fewer"])
def test_too_few_runs_decide_nothing(expects: Expectation) -> None:
    assert judged(expects, *FEW_APART)["verdict"] == "undecided"


def test_what_is_not_significant_is_no_difference_for_the_paper_but_not_for_us() -> None:
    found = judged("no difference", *FEW_APART)
    assert found["paper_test_agrees"]
    assert found["verdict"] == "undecided"


def test_the_paper_s_test_sees_the_first_ten_runs_only() -> None:
    first, second = around(30, 10, 3) + around(100, 20, 4), around(30, 10, 5) + around(30, 20, 6)
    found = judged("no difference", first, second)
    assert found["paper_runs"] == 10
    assert found["paper_p"] > 0.05
    assert found["student_p"] < 0.001
    assert found["verdict"] == "does not hold"


def test_censored_runs_are_counted_and_never_make_a_group_faster() -> None:
    slow = [BUDGET] * 20 + around(30, 10, 7)
    found = judged("fewer", around(60, 30, 8), slow)
    assert found["second_censored"] == 20
    assert found["improvement"] > 0.5
    assert found["verdict"] == "holds"


def test_a_difference_within_the_margin_is_none() -> None:
    slightly = [value + 3 for value in SAME]
    assert judged("no difference", FASTER, slightly)["mann_whitney_p"] < 0.05
    assert judged("no difference", FASTER, slightly)["verdict"] == "holds"
    assert judged("fewer", FASTER, slightly)["verdict"] == "does not hold"


def test_a_ratio_that_censored_runs_enter_is_marked_as_the_bound_it_is() -> None:
    found = judged("fewer", FASTER, [BUDGET] * 30)
    assert (found["ratio_is_bound"], found["ratio_low_is_bound"], found["ratio_high_is_bound"]) == ("<", "<", "<")
    other = judged("fewer", [BUDGET] * 30, FASTER)
    assert (other["ratio_is_bound"], other["ratio_low_is_bound"], other["ratio_high_is_bound"]) == (">", ">", ">")
    assert judged("fewer", [BUDGET] * 30, [BUDGET] * 30)["ratio_is_bound"] == "?"
    assert judged("fewer", FASTER, SLOWER)["ratio_is_bound"] is None


def test_groups_that_never_learned_are_not_called_equal() -> None:
    found = judged("no difference", [BUDGET] * 30, [BUDGET] * 30)
    assert pd.isna(found["paper_test_agrees"])
    assert found["mann_whitney_p"] == 1.0
    assert pd.isna(found["paper_p"])
    assert pd.isna(found["log_rank_p"])
    assert not found["equivalent"]
    assert found["verdict"] == "undecided"


def test_many_comparisons_ask_for_more_of_each() -> None:
    values = {"first": around(30, 12, 9), **{f"other {n}": around(34, 12, 10 + n) for n in range(12)}}
    made = [Claim("a claim", "ours", "fewer", group("first"), group(name)) for name in list(values)[1:]]
    together = compare_groups(made, rows(values), SETTINGS)
    alone = [compare_groups([claim], rows(values), SETTINGS).iloc[0]["holm_p"] for claim in made]
    assert (together["holm_p"] >= together["mann_whitney_p"]).all()
    assert together["mann_whitney_p"].tolist() == pytest.approx(alone)
    assert together["holm_p"].min() == pytest.approx(12 * together["mann_whitney_p"].min())


def test_the_same_rows_give_the_same_numbers_whatever_else_is_compared() -> None:
    values = {"first": FASTER, "second": SLOWER, "third": SAME}
    one = Claim("a claim", "ours", "fewer", group("first"), group("second"))
    two = Claim("a claim", "ours", "fewer", group("first"), group("third"))
    alone, both = (compare_groups(some, rows(values), SETTINGS).iloc[0] for some in ([one], [one, two]))
    assert alone.drop("holm_p").equals(both.drop("holm_p"))


@pytest.mark.parametrize(
    ("verdicts", "expected"),
    [
        (["holds", "holds"], "holds"),
        (["holds", "undecided"], "undecided"),
        (["holds", "undecided", "does not hold"], "does not hold"),
        ([], "undecided"),
    ],
)
def test_a_statement_on_several_groups_needs_all_of_them(verdicts: list[str], expected: str) -> None:
    assert overall(verdicts) == expected


def test_summing_up_counts_every_comparison_once() -> None:
    values = {"first": FASTER, "second": SLOWER, "third": SAME}
    made = [Claim("faster", "5.2", "fewer", group("first"), group(name)) for name in ("second", "third")]
    line = summed_up(compare_groups(made, rows(values), SETTINGS)).iloc[0]
    assert (line["comparisons"], line["holds"], line["does_not_hold"], line["undecided"]) == (2, 1, 1, 0)
    assert line["paper_test_agrees"] == 1
    assert line["verdict"] == "does not hold"


def test_a_test_that_cannot_be_made_neither_agrees_nor_disagrees() -> None:
    values = {"first": [BUDGET] * 10, "second": [BUDGET] * 10, "third": FASTER}
    made = [Claim("as good", "5.3", "no difference", group("first"), group(name)) for name in ("second", "third")]
    line = summed_up(compare_groups(made, rows(values), SETTINGS)).iloc[0]
    assert (line["comparisons"], line["paper_tests"], line["paper_test_agrees"]) == (2, 1, 0)


def test_a_statement_is_also_judged_where_the_path_stays_optimal() -> None:
    values = {"first": FASTER, "second": SLOWER, "third": SAME}
    lost = replace(group("third"), keeps_optimum=False)
    made = [Claim("faster", "5.2", "fewer", group("first"), other) for other in (group("second"), lost)]
    line = summed_up(compare_groups(made, rows(values), SETTINGS)).iloc[0]
    assert (line["verdict"], line["path_optimal"], line["verdict_path_optimal"]) == ("does not hold", 1, "holds")
    alone = summed_up(compare_groups(made[1:], rows(values), SETTINGS)).iloc[0]
    assert (alone["path_optimal"], alone["verdict_path_optimal"]) == (0, None)


def test_a_group_without_runs_is_named() -> None:
    with pytest.raises(ValueError, match=r"there are no runs of 'nobody' \(repeatable\)"):
        sample_of(group("nobody"), rows({"first": FASTER}))
