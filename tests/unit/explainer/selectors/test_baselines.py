from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from webapp.explainer.seeding import stream
from webapp.explainer.selectors import evenly_spaced_steps, most_important_steps, random_pair_steps


@given(st.integers(0, 40), st.data())
def test_a_draw_holds_different_steps_in_path_order(num_steps: int, data: st.DataObject) -> None:
    count = data.draw(st.integers(0, num_steps))
    drawn = random_pair_steps(num_steps, count, stream(data.draw(st.integers(0, 99))))
    assert len(drawn) == len(set(drawn)) == count
    assert list(drawn) == sorted(drawn)
    assert all(1 <= step <= num_steps for step in drawn)


def test_every_step_is_drawn_equally_often() -> None:
    rng = stream(0, "draws")
    counts = Counter(step for _ in range(6000) for step in random_pair_steps(5, 2, rng))
    assert sorted(counts) == [1, 2, 3, 4, 5]
    assert all(abs(count - 2400) < 4 * (6000 * 0.4 * 0.6) ** 0.5 for count in counts.values())


def test_the_same_seed_draws_the_same_steps_and_another_does_not() -> None:
    draws = [[random_pair_steps(20, 3, stream(seed, "draw", str(n))) for n in range(10)] for seed in (0, 0, 1)]
    assert draws[0] == draws[1] != draws[2]
    assert len(set(draws[0])) > 1


@pytest.mark.parametrize("count", [-1, 4])
def test_more_steps_than_the_path_has_cannot_be_drawn(count: int) -> None:
    with pytest.raises(ValueError, match=f"{count} different steps cannot be drawn from a path of 3"):
        random_pair_steps(3, count, stream(0))


@given(st.integers(0, 60), st.data())
def test_evenly_spaced_steps_lie_in_the_middle_of_equal_parts(num_steps: int, data: st.DataObject) -> None:
    count = data.draw(st.integers(0, num_steps))
    steps = evenly_spaced_steps(num_steps, count)
    assert len(set(steps)) == count
    assert list(steps) == sorted(steps)
    for part, step in enumerate(steps):
        middle = (part + 0.5) * num_steps / count  # Step t covers the stretch from t - 1 to t.
        assert step - 1 <= middle < step or middle == step


def test_evenly_spaced_steps_of_a_short_path() -> None:
    assert evenly_spaced_steps(20, 1) == (11,)
    assert evenly_spaced_steps(9, 3) == (2, 5, 8)
    assert evenly_spaced_steps(4, 4) == (1, 2, 3, 4)


@pytest.mark.parametrize("count", [-1, 4])
def test_a_budget_that_the_path_cannot_fill_is_refused(count: int) -> None:
    with pytest.raises(ValueError, match=f"{count} different steps cannot be chosen from a path of 3"):
        evenly_spaced_steps(3, count)
    with pytest.raises(ValueError, match=f"{count} different steps cannot be chosen from a path of 3"):
        most_important_steps([0.1, 0.2, 0.3], [1], count)


def test_a_methods_own_steps_come_first_and_then_the_most_important() -> None:
    values = [0.5, 0.9, 0.1, 0.9, 0.7]
    own = [1, 3]
    assert [most_important_steps(values, own, count) for count in range(6)] == [
        (),
        (1,),
        (1, 3),
        (1, 2, 3),
        (1, 2, 3, 4),
        (1, 2, 3, 4, 5),
    ]


@pytest.mark.parametrize("step", [0, 3])
def test_a_preferred_step_must_exist(step: int) -> None:
    with pytest.raises(ValueError, match=f"there is no step {step}; the path has steps 1 to 2"):
        most_important_steps([0.1, 0.2], [step], 1)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_an_importance_without_an_order_is_refused(value: float) -> None:
    with pytest.raises(ValueError, match=f"the importance of step 2 must be a finite number, not {value}"):
        most_important_steps([0.1, value, 0.3], [1], 2)
