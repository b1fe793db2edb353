import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.benchmarks.crowd import write_crowd
from tests.unit.reports.measured import check_sound, data_of, shipped, statements, table
from webapp.reports.reading import read_dataset
from webapp.reports.sections.drives import section as drives_section
from webapp.reports.sections.drop_out import section
from webapp.reports.selection import choose
from webapp.storage.database import open_database
from webapp.storage.dataset import export
from webapp.storage.live import LiveNumbers
from webapp.storage.live_plans import Plans
from webapp.storage.scope import Scope
from webapp.storage.wanted import Wanted
from webapp.study.protocol import Study

VERSION = "ab" * 32
PAPER = shipped("sakai2021")


def somebody(num_pages_sent: int, end: str | None = None, **changes: Any) -> dict[str, Any]:  # noqa: ANN401
    """Return a row of somebody who sent so many pages."""
    now = pd.Timestamp("2031-03-01", tz="UTC")
    row: dict[str, Any] = {
        "participant": "p",
        "consented_at": now,
        "completed_at": now if end == "completed" else pd.NaT,
        "withdrawn_at": now if end == "withdrawn" else pd.NaT,
        "screened_out_at": now if end == "screened_out" else pd.NaT,
        "num_pages_sent": num_pages_sent,
        "assignment": _assignment(),
        "reason": None if end == "completed" else "incomplete",
    }
    return row | changes


def _assignment() -> str:
    kinds = {experiment.id: experiment.kinds for experiment in PAPER.experiments}
    return " ".join(
        f"{experiment.id}/{layout}/{kind}"
        for experiment in PAPER.experiments
        for layout, kind in zip(experiment.layouts, kinds[experiment.id], strict=True)
    )


def made_of(people: list[dict[str, Any]], declared: Study | None = PAPER) -> Any:  # noqa: ANN401 - a StudyData
    return data_of(everybody=pd.DataFrame(people, columns=list(somebody(0))), declared=declared)


@pytest.mark.parametrize(("name", "seed"), [("sakai2021", 1), ("understanding", 2)])
def test_the_numbers_are_those_of_the_dashboard_once_everybody_is_silent(tmp_path: Path, name: str, seed: int) -> None:
    study = shipped(name)
    scope = Scope(study.name, VERSION, "live")
    with open_database(tmp_path / "crowd.sqlite", make=True) as database:
        now = write_crowd(database, study, scope, 120, seed)
        export(database, tmp_path / "export", Wanted(), now)
        shown = LiveNumbers(database).overview(study, scope, now + pd.Timedelta(days=30).to_pytimedelta())
    data = choose(read_dataset(tmp_path / "export"))
    changed = data_of(everybody=data.everybody, declared=study)
    made = section(changed)
    flows = {(row["experiment"], row["kind"]): row for row in table(made, "drop_out")}
    assert {key: (row["started"], row["finished"], row["dropped"]) for key, row in flows.items()} == {
        (flow.experiment, flow.kind): (flow.started, flow.finished, flow.dropped) for flow in shown.arms
    }
    tests = {row["experiment"]: (row["statistic"], row["df"], row["p"]) for row in table(made, "drop_out_tests")}
    assert tests == {test.experiment: (test.statistic, test.df, test.p_value) for test in shown.drop_out}
    assert tests


def test_a_drop_out_is_put_down_to_the_trial_under_way() -> None:
    plans = Plans(PAPER)
    cells = tuple((e, k, w) for e, w, k in (part.split("/") for part in _assignment().split()))
    plan = plans.plan(cells)
    second = plan.first_pages[1]
    made = section(made_of([somebody(second, "withdrawn"), somebody(second - 1), somebody(0, "withdrawn")]))
    dropped = {row["kind"]: (row["withdrawn"], row["silent"]) for row in table(made, "drop_out")}
    assert dropped[PAPER.experiments[0].kinds[1]] == (1, 1)
    assert dropped[PAPER.experiments[0].kinds[0]] == (0, 0)


def test_whoever_was_screened_out_counts_nowhere_and_whoever_left_early_in_no_trial() -> None:
    made = section(made_of([somebody(1, "screened_out"), somebody(20, "screened_out")]))
    assert statements(made) == ["Drop-out by kind: none of 2 people reached a trial"]


@pytest.mark.parametrize(
    ("people", "declared", "message"),
    [
        ([somebody(3)], None, "the data set has no study file, so pages cannot be told from trials; 1 of 1 people"),
        ([somebody(3, assignment="")], PAPER, "no trials are told for the participant p"),
        ([somebody(3, assignment="9/x/y")], PAPER, "the study file has no trial 9/y/x, which was drawn for p"),
    ],
)
def test_what_cannot_be_told_is_said(people: list[dict[str, Any]], declared: Study | None, message: str) -> None:
    (told,) = statements(section(made_of(people, declared)))
    assert message in told


def test_without_participants_nothing_is_known_of_who_left() -> None:
    assert statements(section(data_of())) == [
        "Drop-out by kind: the data set has no participants.csv, so nobody who left is known"
    ]


def test_whoever_left_with_a_drive_before_them_makes_the_share_a_bound(tmp_path: Path) -> None:
    study = shipped("understanding")
    with open_database(tmp_path / "crowd.sqlite", make=True) as database:
        now = write_crowd(database, study, Scope(study.name, VERSION, "live"), 150, 3)
        export(database, tmp_path / "export", Wanted(), now)
    data = replace(choose(read_dataset(tmp_path / "export"), apply_rules=False), declared=study)
    rows = table(drives_section(data), "drives_lower_bounds")
    assert sum(int(str(row["left"])) for row in rows) > 0
    for row in rows:
        num, total, left = (int(str(row[name])) for name in ("num", "total", "left"))
        assert row["lower_bound"] == pytest.approx(num / (total + left))
        assert float(str(row["lower_bound"])) <= float(str(row["share"]))


@given(
    st.lists(
        st.tuples(st.integers(0, 14), st.sampled_from([None, "completed", "withdrawn", "screened_out"])), max_size=12
    )
)
@settings(max_examples=40, deadline=None)
def test_any_people_give_numbers_or_reasons(people: list[tuple[int, str | None]]) -> None:
    made = section(made_of([somebody(*person) for person in people]))
    check_sound(made)
    for row in table(made, "drop_out"):
        assert int(str(row["finished"])) + int(str(row["dropped"])) <= int(str(row["started"]))
    assert not re.search(r"nan", str(made.blocks))
