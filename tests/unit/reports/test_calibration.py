from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure as Canvas

from tests.unit.reports.measured import by_chance, check_sound, data_of, statements, table
from tests.unit.reports.test_drives import CELLS, figures, predictions_of, rows_of
from webapp.reports.sections.calibration import section

TRIALS = st.lists(
    st.tuples(CELLS, st.integers(1, 5), st.booleans(), st.booleans()),
    unique_by=lambda trial: trial[0][:2],
    max_size=8,
)


def test_the_share_that_is_right_is_counted_by_rating() -> None:
    data = by_chance()
    assert data.drives is not None
    rated = data.ratings[data.ratings["item"] == "foresee"].set_index(["participant", "trial"])["rating"]
    after = data.drives[data.drives["phase"] == "after"].set_index(["participant", "trial"])["end"] == "reached"
    rows = [
        row for row in table(section(data), "calibration") if (row["item"], row["measure"]) == ("foresee", "drives")
    ]
    assert [row["rating"] for row in rows] == sorted(rated.unique())
    for row in rows:
        chosen = after[rated[rated == row["rating"]].index]
        assert (row["num"], row["total"]) == (int(chosen.sum()), len(chosen))


def test_people_who_know_how_well_they_understand_are_seen_to() -> None:
    made = section(by_chance(150, seed=5))
    for row in table(made, "calibration_discrimination"):
        assert float(str(row["area_low"])) > 0.5
    odds = {(row["compared"], row["part"]): float(str(row["low"])) for row in table(made, "calibration_odds")}
    assert odds["foresee against drives in experiment 1", "between persons"] > 1
    assert odds["confidence against predictions in experiment 1", "within a person"] > 0.8


def test_felt_minus_measured_is_above_nothing_where_people_feel_more_than_they_can_do() -> None:
    cells = [(f"p{n}", 1, "a", "full") for n in range(12)]
    ratings = [(who, trial, layout, kind, "foresee", 5) for who, trial, layout, kind in cells]
    drives = [(cell, "after", "reached" if n < 3 else "gave_up", 3) for n, cell in enumerate(cells)]
    (row,) = table(section(data_of(ratings, drives=rows_of(drives))), "calibration_gaps")
    assert (row["felt"], row["measured"], row["gap"]) == (1.0, 0.25, 0.75)
    assert float(str(row["low"])) > 0


def test_whether_people_are_enough_for_robust_intervals_is_said() -> None:
    (found,) = [each for each in section(by_chance(12)).assumptions if each.test.startswith("Felt minus measured and")]
    assert found.verdict in ("doubtful", "violated")
    assert "to 12 people per interval" in found.check


def test_likeliness_is_taken_where_nobody_was_asked_what_they_foresee() -> None:
    cells = [(f"p{n}", 1, "a", "full") for n in range(6)]
    ratings = [(*cell, "likeliness", 1 + n % 5) for n, cell in enumerate(cells)]
    drives = [(cell, "after", "reached" if n < 3 else "gave_up", 3) for n, cell in enumerate(cells)]
    assert {row["item"] for row in table(section(data_of(ratings, drives=rows_of(drives))), "calibration")} == {
        "likeliness"
    }


def test_confidence_needs_no_rating() -> None:
    probes = [((f"p{n}", 1, "a", "full"), n % 2 == 0, 1 + n % 5) for n in range(10)]
    made = section(data_of(probes=predictions_of(probes)))
    assert {row["item"] for row in table(made, "calibration")} == {"confidence"}


def test_without_anything_to_compare_there_is_a_statement() -> None:
    (told,) = statements(section(data_of()))
    assert told.startswith(
        "Calibration: there are no ratings of understanding with a drive or a prediction in the same"
    )


def test_where_everybody_is_right_discrimination_is_a_statement() -> None:
    cells = [(f"p{n}", 1, "a", "full") for n in range(5)]
    ratings = [(*cell, "foresee", 1 + n) for n, cell in enumerate(cells)]
    drives = [(cell, "after", "reached", 3) for cell in cells]
    made = section(data_of(ratings, drives=rows_of(drives)))
    assert (
        "The discrimination of foresee against drives in experiment 1: "
        "discrimination needs right and wrong outcomes, and 5 of 5 are right"
    ) in statements(made)
    check_sound(made)


def test_the_figure_has_a_panel_for_each_comparison() -> None:
    canvas = Canvas()
    figures(section(by_chance()))["calibration_curves"].fill(canvas)
    assert [axes.get_title("left") or axes.get_title() for axes in canvas.axes if axes.get_visible()] == [
        "foresee, drives (1)",
        "foresee, predictions (1)",
        "confidence, predictions (1)",
    ]


def test_the_correlation_within_persons_is_that_of_centred_trials() -> None:
    data = by_chance()
    assert data.drives is not None
    rated = data.ratings[data.ratings["item"] == "foresee"].set_index(["participant", "trial"])["rating"].astype(float)
    after = data.drives[data.drives["phase"] == "after"].set_index(["participant", "trial"])["end"] == "reached"
    x, y = rated, after.astype(float).reindex(rated.index)
    x, y = x - x.groupby("participant").transform("mean"), y - y.groupby("participant").transform("mean")
    (row,) = [row for row in table(section(data), "calibration_correlations") if row["measure"] == "drives"]
    assert row["r"] == pytest.approx(float(np.corrcoef(x, y)[0, 1]))


@given(TRIALS)
@settings(max_examples=25, deadline=None)
def test_any_ratings_and_outcomes_give_numbers_or_reasons(trials: list[Any]) -> None:
    ratings = [(*cell, "foresee", rating) for cell, rating, _, _ in trials]
    drives = [(cell, "after", "reached" if reached else "gave_up", 3) for cell, _, reached, _ in trials]
    probes = [(cell, right, rating) for cell, rating, _, right in trials]
    made = section(data_of(ratings, rows_of(drives), predictions_of(probes)))
    check_sound(made)
    for figure in figures(made).values():
        figure.fill(Canvas())
