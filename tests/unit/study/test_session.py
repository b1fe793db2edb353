import itertools
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from webapp.study.counterbalancing import arrangements
from webapp.study.protocol import parse_study
from webapp.study.session import NoSuchPageError, Page, Trial, decide, pages, plan_trials

STUDY = parse_study((Path(__file__).parents[3] / "webapp/studies/sakai2021/study.toml").read_text(encoding="utf-8"))
EVERY_PLAN = list(itertools.product(range(6), range(2)))


def no_draw() -> int:
    raise AssertionError("no draw is needed")


def plan(first: int, second: int, draw: int = 0) -> tuple[Trial, ...]:
    return plan_trials(STUDY, {"1": first, "2": second}, lambda: draw)


@pytest.mark.parametrize(("first", "second"), EVERY_PLAN)
def test_everybody_sees_each_layout_once_in_the_same_order_and_each_kind_once(first: int, second: int) -> None:
    trials = plan(first, second)
    assert [trial.layout for trial in trials] == [layout for one in STUDY.experiments for layout in one.layouts]
    assert [trial.experiment for trial in trials] == ["1", "1", "1", "2", "2"]
    assert [trial.position for trial in trials] == [1, 2, 3, 1, 2]
    assert [trial.num_trials for trial in trials] == [3, 3, 3, 2, 2]
    for experiment in STUDY.experiments:
        shown = [trial.kind for trial in trials if trial.experiment == experiment.id]
        assert sorted(shown) == sorted(experiment.kinds)


@pytest.mark.parametrize(("first", "second"), EVERY_PLAN)
def test_the_kinds_are_those_of_the_arrangements(first: int, second: int) -> None:
    kinds = tuple(trial.kind for trial in plan(first, second))
    assert kinds == arrangements(STUDY.experiments[0])[first] + arrangements(STUDY.experiments[1])[second]


def test_only_the_random_kind_has_a_draw() -> None:
    for first, second in EVERY_PLAN:
        for trial in plan(first, second, draw=7):
            assert trial.draw == (7 if trial.kind == "random" else None)


def test_a_draw_is_made_once_for_each_random_trial() -> None:
    draws: Iterator[int] = iter([4])
    trials = plan_trials(STUDY, {"1": 0, "2": 1}, lambda: next(draws))
    assert [trial.draw for trial in trials if trial.kind == "random"] == [4]


@pytest.mark.parametrize("draw", [-1, 10])
def test_a_draw_that_was_not_built_is_refused(draw: int) -> None:
    with pytest.raises(ValueError, match=f"no draw {draw}; there are 10"):
        plan(0, 0, draw)


def test_an_arrangement_that_does_not_exist_is_refused() -> None:
    with pytest.raises(ValueError, match="has 6 arrangements, from 0, not 6"):
        plan_trials(STUDY, {"1": 6, "2": 0}, no_draw)
    with pytest.raises(KeyError):
        plan_trials(STUDY, {"1": 0}, lambda: 0)


def test_the_pages_are_the_instructions_and_then_situation_and_rating_of_each_trial() -> None:
    trials = plan(3, 1)
    shown = pages(trials)
    assert [page.number for page in shown] == list(range(1, 12))
    assert [page.kind for page in shown] == ["instructions", *["situation", "rating"] * 5]
    assert [page.trial for page in shown] == [None, *(trial for trial in trials for _ in range(2))]


@given(num_stored=st.integers(0, 30), num_pages=st.integers(1, 30))
def test_only_the_next_page_is_accepted_and_every_other_is_told_apart(num_stored: int, num_pages: int) -> None:
    decisions = [decide(number, num_stored, num_pages) for number in range(1, num_pages + 1)]
    assert decisions == ["already_answered"] * min(num_stored, num_pages) + (
        ["accept"] + ["too_early"] * (num_pages - num_stored - 1) if num_stored < num_pages else []
    )


@pytest.mark.parametrize("number", [-1, 0, 12])
def test_a_page_that_does_not_exist_is_refused(number: int) -> None:
    with pytest.raises(NoSuchPageError, match=f"no page {number}"):
        decide(number, 3, 11)


@pytest.mark.parametrize(
    ("kind", "draw", "position"), [("random", None, 1), ("full", 3, 1), ("random", -1, 1), ("full", None, 4)]
)
def test_a_trial_that_cannot_be_is_refused(kind: str, draw: int | None, position: int) -> None:
    with pytest.raises(ValueError, match=r"draw|position"):
        Trial("1", position, 3, "experiment1-a", kind, draw)  # type: ignore[arg-type]


def test_a_page_of_a_trial_needs_the_trial() -> None:
    with pytest.raises(ValueError, match="'rating'"):
        Page(2, "rating", None)
