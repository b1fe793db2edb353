import itertools
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from webapp.study.counterbalancing import arrangements, layout_orders
from webapp.study.experiments import TAILORED_KINDS, Drive, Kind, Probe
from webapp.study.protocol import Study, parse_study
from webapp.study.session import (
    DRIVEN,
    Assignment,
    NoSuchPageError,
    Page,
    PageKind,
    Trial,
    decide,
    pages,
    plan_trials,
)

STUDIES = Path(__file__).parents[3] / "webapp" / "studies"
STUDY = parse_study((STUDIES / "sakai2021/study.toml").read_text(encoding="utf-8"))
UNDERSTANDING = parse_study((STUDIES / "understanding/study.toml").read_text(encoding="utf-8"))
EVERY_PLAN = list(itertools.product(range(6), range(2)))


def no_draw() -> int:
    raise AssertionError("no draw is needed")


def plan(first: int, second: int, draw: int = 0) -> tuple[Trial, ...]:
    return plan_trials(STUDY, {"1": Assignment(first), "2": Assignment(second)}, lambda: draw)


def variant(**changes: object) -> Study:
    """A study with its only experiment changed."""
    (experiment,) = UNDERSTANDING.experiments
    return UNDERSTANDING.model_copy(update={"experiments": (experiment.model_copy(update=changes),)})


def pages_of_a_trial(kind: Kind, **changes: object) -> list[PageKind]:
    """What stands on the pages of a trial in which a kind is shown, in an experiment of that kind alone."""
    study = variant(kinds=(kind,), **changes)
    trials = plan_trials(study, {"1": Assignment(0)}, lambda: 0)
    shown = [[page.kind for page in pages(study, trials) if page.trial == trial] for trial in trials]
    assert all(one == shown[0] for one in shown)
    return shown[0]


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
    trials = plan_trials(STUDY, {"1": Assignment(0), "2": Assignment(1)}, lambda: next(draws))
    assert [trial.draw for trial in trials if trial.kind == "random"] == [4]


@pytest.mark.parametrize("draw", [-1, 10])
def test_a_draw_that_was_not_built_is_refused(draw: int) -> None:
    with pytest.raises(ValueError, match=f"no draw {draw}; there are 10"):
        plan(0, 0, draw)


def test_an_arrangement_that_does_not_exist_is_refused() -> None:
    with pytest.raises(ValueError, match="there are 6 arrangements of experiment '1', from 0, and no 6"):
        plan_trials(STUDY, {"1": Assignment(6), "2": Assignment(0)}, no_draw)
    with pytest.raises(ValueError, match="there are 1 orders of experiment '1', from 0, and no 1"):
        plan_trials(STUDY, {"1": Assignment(0, layout_order=1), "2": Assignment(0)}, no_draw)
    with pytest.raises(ValueError, match="and no -1"):
        plan_trials(STUDY, {"1": Assignment(-1), "2": Assignment(0)}, no_draw)
    with pytest.raises(KeyError):
        plan_trials(STUDY, {"1": Assignment(0)}, lambda: 0)


@pytest.mark.parametrize("order", range(6))
def test_layouts_come_in_the_order_that_was_chosen_and_keep_their_kinds(order: int) -> None:
    (experiment,) = UNDERSTANDING.experiments
    for number, kinds in enumerate(arrangements(experiment)):
        trials = plan_trials(UNDERSTANDING, {"1": Assignment(number, order)}, no_draw)
        places = layout_orders(experiment)[order]
        assert [trial.layout for trial in trials] == [experiment.layouts[place] for place in places]
        assert [trial.position for trial in trials] == [1, 2, 3]
        assert {trial.layout: trial.kind for trial in trials} == dict(zip(experiment.layouts, kinds, strict=True))


@pytest.mark.parametrize(
    "kinds", [("full",), ("full", "subgoals"), ("full", "subgoals", "none", "placebic", "highlights")]
)
def test_there_is_a_trial_for_every_layout_however_many_kinds_there_are(kinds: tuple[Kind, ...]) -> None:
    study = variant(kinds=kinds)
    (experiment,) = study.experiments
    for number in range(len(arrangements(experiment))):
        trials = plan_trials(study, {"1": Assignment(number)}, no_draw)
        assert [trial.layout for trial in trials] == list(experiment.layouts)
        assert {trial.kind for trial in trials} <= set(kinds)


def test_the_pages_are_the_instructions_and_then_situation_and_rating_of_each_trial() -> None:
    trials = plan(3, 1)
    shown = pages(STUDY, trials)
    assert [page.number for page in shown] == list(range(1, 12))
    assert [page.kind for page in shown] == ["instructions", *["situation", "rating"] * 5]
    assert [page.trial for page in shown] == [None, *(trial for trial in trials for _ in range(2))]


def test_everything_around_the_trials_comes_before_them_in_its_order() -> None:
    shown = pages(UNDERSTANDING, plan_trials(UNDERSTANDING, {"1": Assignment(0)}, no_draw))
    before = [page for page in shown if page.trial is None]
    assert shown[: len(before)] == tuple(before)
    assert [page.kind for page in before] == ["background", "instructions", "practice", "quiz"]
    assert [page.number for page in shown] == list(range(1, len(shown) + 1))


@pytest.mark.parametrize("section", ["background", "practice", "quiz"])
def test_a_section_that_is_left_out_has_no_page(section: str) -> None:
    study = UNDERSTANDING.model_copy(update={section: None})
    before = [page.kind for page in pages(study, ())]
    assert before == [kind for kind in ("background", "instructions", "practice", "quiz") if kind != section]


@pytest.mark.parametrize("kind", ["subgoals", "placebic", "highlights", "landmarks", "evenly_spaced", "full", "random"])
def test_a_trial_is_explained_and_rated_then_predicted_and_driven(kind: Kind) -> None:
    assert pages_of_a_trial(kind) == ["situation", "rating", "probe", "drive"]
    before = pages_of_a_trial(kind, drive=Drive(when="before_ratings"))
    assert before == ["situation", "explanation", "probe", "drive", "rating"]


@pytest.mark.parametrize("kind", sorted(TAILORED_KINDS))
def test_whose_explanation_is_tailored_drives_first(kind: Kind) -> None:
    assert pages_of_a_trial(kind) == ["situation", "first_drive", "rating", "probe", "drive"]
    before = pages_of_a_trial(kind, drive=Drive(when="before_ratings"))
    assert before == ["situation", "first_drive", "explanation", "probe", "drive", "rating"]


def test_with_a_baseline_everybody_drives_first() -> None:
    for kind in ("subgoals", "none", "tailored_all"):
        assert pages_of_a_trial(kind, drive=Drive(baseline=True))[:2] == ["situation", "first_drive"]


def test_who_sees_no_explanation_has_no_page_for_it_and_rates_only_what_needs_none() -> None:
    assert pages_of_a_trial("none") == ["situation", "rating", "probe", "drive"]
    assert pages_of_a_trial("none", drive=Drive(when="before_ratings")) == ["situation", "probe", "drive", "rating"]
    (experiment,) = UNDERSTANDING.experiments
    items = tuple(item.model_copy(update={"without_explanation": False}) for item in experiment.items)
    assert pages_of_a_trial("none", items=items) == ["situation", "probe", "drive"]
    assert pages_of_a_trial("none", items=items, probe=None) == ["situation", "drive"]
    assert pages_of_a_trial("none", items=items, drive=None) == ["situation", "probe"]


def test_the_satisfaction_scale_follows_the_ratings_where_something_was_explained() -> None:
    assert pages_of_a_trial("subgoals", satisfaction=True) == ["situation", "rating", "satisfaction", "probe", "drive"]
    before = pages_of_a_trial("subgoals", satisfaction=True, drive=Drive(when="before_ratings"))
    assert before == ["situation", "explanation", "probe", "drive", "rating", "satisfaction"]
    assert "satisfaction" not in pages_of_a_trial("none", satisfaction=True)


def test_without_drive_and_probe_a_trial_is_what_the_paper_has() -> None:
    assert pages_of_a_trial("subgoals", drive=None, probe=None) == ["situation", "rating"]


@given(
    when=st.sampled_from(["before_ratings", "after_ratings"]),
    baseline=st.booleans(),
    has_probe=st.booleans(),
    satisfaction=st.booleans(),
    kind=st.sampled_from(["subgoals", "none", "tailored_all", "tailored_first", "random"]),
)
def test_no_page_comes_twice_and_the_explanation_is_seen_before_anything_is_measured(
    when: str, baseline: bool, has_probe: bool, satisfaction: bool, kind: Kind
) -> None:
    changes = {"drive": Drive(when=when, baseline=baseline), "probe": Probe() if has_probe else None}  # type: ignore[arg-type]
    shown = pages_of_a_trial(kind, satisfaction=satisfaction, **changes)
    assert len(set(shown)) == len(shown)
    assert shown[0] == "situation"
    assert shown.count("drive") == 1
    if kind != "none":
        explained = min(shown.index(page) for page in ("explanation", "rating") if page in shown)
        measured = [page for page in shown if page in {"probe", "drive", "satisfaction"}]
        assert all(shown.index(page) > explained for page in measured)
    if "probe" in shown:
        assert shown.index("probe") < shown.index("drive")


def test_three_kinds_of_pages_are_driven() -> None:
    assert dict(DRIVEN) == {"practice": "practice", "first_drive": "before", "drive": "after"}


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
        Trial("1", position, 3, "experiment1-a", kind, draw)


def test_a_page_of_a_trial_needs_the_trial() -> None:
    for kind in ("rating", "situation", "first_drive", "drive", "probe", "explanation", "satisfaction"):
        with pytest.raises(ValueError, match=f"'{kind}'"):
            Page(2, kind, None)


def test_a_page_before_the_trials_has_none() -> None:
    for kind in ("background", "instructions", "practice", "quiz"):
        with pytest.raises(ValueError, match=f"'{kind}'"):
            Page(1, kind, plan(0, 0)[0])


def test_a_page_of_a_trial_has_the_number_of_the_trial_and_no_other_page_has_one() -> None:
    with pytest.raises(ValueError, match="a trial and its number or neither, not None"):
        Page(3, "rating", plan(0, 0)[0])
    with pytest.raises(ValueError, match="a trial and its number or neither, not 1"):
        Page(1, "quiz", None, 1)
