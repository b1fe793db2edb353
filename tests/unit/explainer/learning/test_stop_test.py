import numpy as np

from webapp.explainer.learning.stop_test import has_flattened


def test_a_loss_has_flattened_when_the_means_of_its_last_two_windows_are_close() -> None:
    noise = np.tile([-0.3, 0.3], 10)
    falling = 1.0 + noise
    assert has_flattened(np.concatenate((falling, 0.995 + noise)), 20, 0.01)
    assert not has_flattened(np.concatenate((falling, 0.98 + noise)), 20, 0.01)
    assert not has_flattened(np.concatenate((falling, 1.02 + noise)), 20, 0.01)


def test_only_the_last_two_windows_count() -> None:
    flat = np.ones(40)
    assert has_flattened(np.concatenate((np.full(100, 50.0), flat)), 20, 0.01)
    assert not has_flattened(np.concatenate((flat, np.full(20, 0.5))), 20, 0.01)


def test_a_loss_has_not_flattened_before_there_are_two_windows() -> None:
    assert not has_flattened(np.ones(39), 20, 0.01)
    assert has_flattened(np.ones(40), 20, 0.01)
