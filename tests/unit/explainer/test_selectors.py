from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from webapp.explainer.seeding import stream
from webapp.explainer.selectors import random_pair_steps


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
