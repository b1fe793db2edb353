from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure as Canvas

from tests.unit.reports.measured import by_chance, check_sound, data_of, plan_of_kinds, statements, table
from webapp.analysis.multiplicity import holm
from webapp.reports.blocks import Figure, Section
from webapp.reports.sections.drives import section
from webapp.study.intervals import wilson_interval

CELLS = st.tuples(
    st.sampled_from(["p1", "p2", "p3"]),
    st.integers(1, 2),
    st.sampled_from(["a", "b"]),
    st.sampled_from(["full", "none", "subgoals"]),
)
DRIVES = st.lists(
    st.tuples(
        CELLS,
        st.sampled_from(["before", "after"]),
        st.sampled_from(["reached", "gave_up", "failed"]),
        st.integers(0, 20),
    ),
    unique_by=lambda drive: (drive[0][0], drive[0][1], drive[1]),
    max_size=12,
)
PROBES = st.lists(st.tuples(CELLS, st.booleans(), st.integers(1, 5)), max_size=16)


def rows_of(drives: list[Any]) -> list[tuple[Any, ...]]:
    return [
        (who, "1", trial, layout, kind, phase, end, steps + 10 if end == "reached" else steps, 10, 30)
        for (who, trial, layout, kind), phase, end, steps in drives
    ]


def predictions_of(probes: list[Any]) -> list[tuple[Any, ...]]:
    return [
        (who, "1", trial, layout, kind, number, right, right, sure)
        for number, ((who, trial, layout, kind), right, sure) in enumerate(probes, 1)
    ]


def figures(made: Section) -> dict[str, Figure]:
    return {block.name: block for block in made.blocks if isinstance(block, Figure)}


def test_shares_are_counted_by_kind_after_the_explanation_alone() -> None:
    data = by_chance()
    assert data.drives is not None
    after = data.drives[data.drives["phase"] == "after"]
    for row in table(section(data), "drives_reached"):
        of_kind = after[after["kind"] == row["kind"]]
        num = int((of_kind["end"] == "reached").sum())
        assert (row["num"], row["total"]) == (num, len(of_kind))
        assert (row["wilson_low"], row["wilson_high"]) == pytest.approx(wilson_interval(num, len(of_kind)))
        assert float(str(row["model_low"])) < float(str(row["model_share"])) < float(str(row["model_high"]))


def test_an_effect_that_was_planted_is_found_in_odds_and_in_hazards() -> None:
    made = section(by_chance(120, seed=3))
    for name in ("drives_odds", "drives_hazards", "probes_odds"):
        rows = table(made, name)
        assert [row["contrast"] for row in rows] == [
            "subgoals \N{MINUS SIGN} full",
            "subgoals \N{MINUS SIGN} none",
        ]
        assert all(float(str(row["low"])) > 1 for row in rows), name


def test_each_measure_is_a_family_of_its_own() -> None:
    made = section(by_chance())
    for name in ("drives_odds", "drives_hazards", "probes_odds"):
        rows = table(made, name)
        assert [row["p_holm"] for row in rows] == pytest.approx(list(holm([float(str(row["p"])) for row in rows])))


def test_a_kind_after_which_everybody_arrives_has_a_share_and_no_odds() -> None:
    data = by_chance()
    assert data.drives is not None
    of_kind = (data.drives["kind"] == "full") & (data.drives["phase"] == "after")
    data.drives.loc[of_kind, "end"] = "reached"
    data.drives.loc[of_kind, "num_steps"] = 12
    made = section(data)
    (row,) = [row for row in table(made, "drives_reached") if row["kind"] == "full"]
    assert (row["share"], row["model_share"], row["cluster_low"]) == (1.0, None, None)
    assert any(
        "Odds ratio of subgoals \N{MINUS SIGN} full" in told and "kind=full: all of 40 yes" in told
        for told in statements(made)
    )
    assert [row["contrast"] for row in table(made, "drives_odds")] == ["subgoals \N{MINUS SIGN} none"]
    assert len(table(made, "drives_hazards")) == 2


def test_a_kind_after_which_nobody_arrives_has_no_hazard() -> None:
    data = by_chance()
    assert data.drives is not None
    data.drives.loc[data.drives["kind"] == "none", "end"] = "gave_up"
    made = section(data)
    assert [row["contrast"] for row in table(made, "drives_hazards")] == ["subgoals \N{MINUS SIGN} full"]
    assert any("kind=none: none of 40 yes" in told and "Hazard ratio" in told for told in statements(made))
    (row,) = [row for row in table(made, "drives_times") if row["kind"] == "none"]
    assert (row["reached"], row["median"], row["restricted_mean"]) == (0, None, 3.0)


def test_whoever_gives_up_early_counts_with_the_limit() -> None:
    rows = rows_of([(("p1", 1, "a", "full"), "after", "reached", 0), (("p2", 1, "a", "full"), "after", "gave_up", 2)])
    (row,) = table(section(data_of(drives=rows)), "drives_times")
    assert row["restricted_mean"] == pytest.approx((1.0 + 3.0) / 2)
    assert row["median"] == 1.0


def test_the_gain_is_the_share_after_less_that_before_and_the_practice_counts_nowhere() -> None:
    cells = [(f"p{n}", 1, "a", "full") for n in range(4)]
    before = [(cell, "before", "reached" if n < 1 else "gave_up", 3) for n, cell in enumerate(cells)]
    after = [(cell, "after", "reached" if n < 3 else "gave_up", 3) for n, cell in enumerate(cells)]
    practice = ("p0", None, None, "practice", None, "practice", "gave_up", 12, 11, 55)
    (row,) = table(section(data_of(drives=[*rows_of([*before, *after]), practice])), "drives_gain")
    assert (row["pairs"], row["before"], row["after"], row["gain"]) == (4, 0.25, 0.75, 0.5)
    assert row["failed"] == 3
    assert row["then_reached"] == pytest.approx(2 / 3)


def test_shares_before_and_after_have_intervals() -> None:
    made = section(by_chance())
    shares = {(row["kind"], row["part"]): row for row in table(made, "drives_gain_shares")}
    for row in table(made, "drives_gain"):
        then = shares[row["kind"], "failed, after"]
        assert (then["share"], then["total"]) == (row["then_reached"], row["failed"])
        for part in ("before", "after"):
            assert shares[row["kind"], part]["share"] == row[part]
            assert float(str(shares[row["kind"], part]["cluster_low"])) < float(str(row[part]))
        assert (then["wilson_low"], then["wilson_high"]) == pytest.approx(
            wilson_interval(int(str(then["num"])), int(str(then["total"])))
        )


def test_the_median_time_has_an_interval() -> None:
    rows = [row for row in table(section(by_chance(seed=4)), "drives_times") if row["median"] is not None]
    assert rows
    for row in rows:
        assert float(str(row["median_low"])) <= float(str(row["median"]))
        assert row["median_high"] is None or float(str(row["median_high"])) >= float(str(row["median"]))


@pytest.mark.parametrize(("num_people", "verdict"), [(6, "violated"), (12, "doubtful"), (24, "holds")])
def test_whether_people_are_enough_for_robust_intervals_is_said(num_people: int, verdict: str) -> None:
    (found,) = [each for each in section(by_chance(num_people)).assumptions if each.test.startswith("Cluster")]
    assert (found.verdict, f"{num_people} people" in found.check) == (verdict, True)


def test_without_drives_and_predictions_there_is_a_statement_for_each() -> None:
    assert statements(section(data_of())) == [
        "The drives: there is no drive after an explanation in the data",
        "The predictions: the data hold no prediction of what the agent does",
    ]


def test_without_contrasts_shares_and_curves_remain() -> None:
    made = section(by_chance(plan=plan_of_kinds(contrasts=())))
    check_sound(made)
    assert table(made, "drives_odds") == []
    assert len(table(made, "drives_reached")) == 3


def test_curves_are_steps_up_to_the_share_that_arrived() -> None:
    data = by_chance()
    made = section(data)
    canvas = Canvas()
    figures(made)["drives_curves_1"].fill(canvas)
    (axes,) = canvas.axes
    shares = {str(row["kind"]): float(str(row["share"])) for row in table(made, "drives_reached")}
    for line in axes.get_lines():
        kind = str(line.get_label()).split(" ")[0]
        heights = np.asarray(line.get_ydata(), dtype=float)
        assert heights[-1] == pytest.approx(100 * shares[kind])
        assert (np.diff(heights) >= 0).all()


def test_figures_show_one_point_per_kind() -> None:
    for name in ("drives_shares", "probes_shares"):
        canvas = Canvas()
        figures(section(by_chance()))[name].fill(canvas)
        points = [line for line in canvas.axes[0].get_lines() if line.get_marker() == "o"]
        assert len(points) == 3


def test_hazards_that_are_not_proportional_are_doubted() -> None:
    data = by_chance(150, seed=2)
    assert data.drives is not None
    rng = np.random.default_rng(1)
    after = (data.drives["phase"] == "after") & (data.drives["end"] == "reached")
    early = after & (data.drives["kind"] == "full")
    data.drives.loc[after, "num_steps"] = 15 + rng.integers(0, 4, int(after.sum()))
    data.drives.loc[early, "num_steps"] = np.where(rng.random(int(early.sum())) < 0.6, 10, 29)
    (found,) = [each for each in section(data).assumptions if "Ratios of hazards" in each.assumes]
    assert found.verdict == "doubtful"


@given(DRIVES, PROBES)
@settings(max_examples=30, deadline=None)
def test_any_drives_and_predictions_give_numbers_or_reasons(drives: list[Any], probes: list[Any]) -> None:
    made = section(data_of(drives=rows_of(drives), probes=predictions_of(probes)))
    check_sound(made)
    for figure in figures(made).values():
        figure.fill(Canvas())
