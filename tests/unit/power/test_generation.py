import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.power.designs import questions_of
from webapp.bots.opinions import expected_rating
from webapp.power.design import trials_of
from webapp.power.generation import draw_noise, rate, rated_frame, within_sd

FIRST = questions_of()[0]
MANY = 40_000


@given(st.floats(0, 0.99))
def test_the_variances_between_and_within_people_sum_to_one(between: float) -> None:
    assert between**2 + within_sd(between) ** 2 == pytest.approx(1)


@pytest.mark.parametrize("between", [-0.1, 1.0, float("nan")])
def test_people_who_differ_by_the_whole_variance_or_less_than_nothing_are_refused(between: float) -> None:
    with pytest.raises(ValueError, match="from 0 to below 1, not"):
        within_sd(between)


@pytest.mark.parametrize("shift", [-1.2, 0.0, 0.5, 3.0])
def test_ratings_have_the_mean_of_the_bots_and_of_one_person_correlate_as_theirs(shift: float) -> None:
    trials = trials_of(FIRST.experiment, MANY)
    noise = draw_noise(np.random.default_rng(7), MANY, 3)
    ratings = rate(FIRST, trials, noise, {"subgoals": shift})
    subgoals = trials.kinds == FIRST.experiment.kinds.index("subgoals")
    assert ratings[subgoals].mean() == pytest.approx(expected_rating(5, shift), abs=0.02)
    assert ratings[~subgoals].mean() == pytest.approx(3, abs=0.02)
    latent = noise.people[:, None] + noise.ratings
    assert float(np.corrcoef(latent[:, 0], latent[:, 1])[0, 1]) == pytest.approx(0.36, abs=0.02)


@given(num_people=st.integers(1, 12), seed=st.integers(0, 99))
def test_a_frame_holds_a_row_for_each_trial_of_the_first_people(num_people: int, seed: int) -> None:
    trials = trials_of(FIRST.experiment, 12)
    ratings = rate(FIRST, trials, draw_noise(np.random.default_rng(seed), 12, 3), {})
    frame = rated_frame(FIRST, trials, ratings, num_people)
    assert len(frame) == 3 * num_people
    assert frame["rating"].between(1, 5).all()
    assert frame.groupby("participant")["layout"].nunique().eq(3).all()
    assert frame.groupby("participant")["trial"].apply(list).map(lambda trials: trials == [1, 2, 3]).all()


def test_nobody_rates_what_is_not_asked_after_a_kind() -> None:
    questions = questions_of("understanding")[1]
    trials = trials_of(questions.experiment, 24)
    shape = trials.kinds.shape
    frame = rated_frame(questions, trials, np.full(shape, 3), 24)
    assert "none" in questions.experiment.kinds
    assert set(frame["kind"]) == set(questions.kinds)
