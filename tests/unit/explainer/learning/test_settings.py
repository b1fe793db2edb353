import json
from itertools import pairwise

import pytest

from webapp.explainer.learning import TrainingSettings


def test_settings_come_with_defaults_that_fit_together_and_can_be_written_down() -> None:
    settings = TrainingSettings()
    assert TrainingSettings(**json.loads(json.dumps(settings.to_dict()))) == settings


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("num_environments", 0),
        ("cycle_iterations", -1),
        ("policy_learning_rate", 0.0),
        ("policy_learning_rate", float("nan")),
        ("discount", 1.5),
        ("visited_start_share", 0.6),
        ("num_exploring_environments", 25),
        ("num_borrowed_queries", 129),
        ("sequence_length", 10_000),
        ("constant_share", 0.95),
    ],
)
def test_a_setting_out_of_range_is_refused_by_name(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=name):
        TrainingSettings(**{name: value})  # type: ignore[arg-type]


@pytest.mark.parametrize(("name", "value"), [("policy_batch", 2.5), ("policy_batch", True), ("discount", True)])
def test_a_setting_of_the_wrong_type_is_refused_by_name(name: str, value: float) -> None:
    with pytest.raises(TypeError, match=name):
        TrainingSettings(**{name: value})  # type: ignore[arg-type]


def test_the_learning_rate_is_constant_then_falls_then_is_small_and_starts_anew() -> None:
    settings = TrainingSettings(
        cycle_iterations=100, constant_share=0.25, final_share=0.25, final_rate_share=0.1, num_cycles=2
    )
    shares = [settings.rate_share(iteration) for iteration in range(settings.max_iterations)]
    assert shares[100:] == shares[:100]
    assert set(shares[:26]) == {1.0}
    assert all(earlier > later for earlier, later in pairwise(shares[25:76]))
    assert shares[50] == pytest.approx(0.55)
    assert shares[75:100] == pytest.approx([0.1] * 25)


def test_the_learning_rate_may_fall_at_once() -> None:
    settings = TrainingSettings(cycle_iterations=10, constant_share=0.5, final_share=0.5, final_rate_share=0.0)
    assert [settings.rate_share(iteration) for iteration in range(10)] == [1.0] * 5 + [0.0] * 5
