import numpy as np
import pytest

from webapp.explainer.learning import TrainingSettings
from webapp.explainer.learning.replay import Experience, Priorities, Replay
from webapp.explainer.seeding import stream

SETTINGS = TrainingSettings(num_environments=2, num_exploring_environments=1, num_warmup_steps=50, cycle_iterations=1)


def remember(replay: Replay, *rows: tuple[int, int]) -> None:
    for pairs in rows:
        flags = np.zeros(2, dtype=np.bool_)
        replay.add(Experience(np.array(pairs), np.array(pairs), np.zeros(2, dtype=np.float32), flags, flags))


def drawn(replay: Replay, priorities: Priorities, length: int = 1) -> tuple[np.ndarray, np.ndarray]:
    places = replay.lottery(priorities, length).draw(20_000, stream(3))
    return replay.at(places.rows, places.environments).pairs, places.evenness


def test_every_pair_is_replayed_equally_often_however_often_it_was_met() -> None:
    replay = Replay(10, SETTINGS)
    remember(replay, (1, 1), (1, 7), (1, 1), (1, 1))
    pairs, evenness = drawn(replay, Priorities(10, 1.0))
    assert set(pairs) == {1, 7}
    assert np.mean(pairs == 7) == pytest.approx(0.5, abs=0.02)
    np.testing.assert_allclose(evenness, 1.0)
    assert replay.counts.ravel()[[1, 7]].tolist() == [7, 1]
    assert replay.num_transitions == 8


def test_pairs_with_a_large_loss_are_replayed_more_and_means_over_even_draws_can_still_be_told() -> None:
    replay, priorities = Replay(10, SETTINGS), Priorities(10, 1.0)
    remember(replay, (1, 2), (3, 4), (1, 2))
    losses = np.array([0.1, 0.2, 0.3, 7.4], dtype=np.float32)
    priorities.update(np.array([1, 2, 3, 4]), losses)
    pairs, evenness = drawn(replay, priorities)
    shares = [np.mean(pairs == pair) for pair in (1, 2, 3, 4)]
    assert shares == sorted(shares)
    assert shares[3] > 0.45
    assert min(shares) > SETTINGS.even_share / 4 - 0.02
    assert np.mean(evenness * losses[pairs - 1]) == pytest.approx(losses.mean(), rel=0.03)


def test_sequences_begin_where_memory_holds_all_of_them() -> None:
    replay = Replay(10, SETTINGS)
    remember(replay, (1, 2), (3, 4), (5, 6), (7, 8))
    assert set(drawn(replay, Priorities(10, 1.0), length=3)[0]) == {1, 2, 3, 4}


def test_the_same_stream_draws_the_same_places() -> None:
    replay = Replay(10, SETTINGS)
    remember(replay, (1, 2), (3, 4), (5, 6))
    np.testing.assert_array_equal(drawn(replay, Priorities(10, 1.0))[0], drawn(replay, Priorities(10, 1.0))[0])
