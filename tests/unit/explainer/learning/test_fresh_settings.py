import dataclasses
import json
import math

import numpy as np
import pytest

from webapp.explainer.learning import FreshSettings

NAMES = [field.name for field in dataclasses.fields(FreshSettings)]
MEASURED = {"learning_rate", "discount", "final_exploration", "max_gradient_norm", "sub_reward"}


def test_settings_come_with_defaults_that_fit_together_and_can_be_written_down() -> None:
    settings = FreshSettings()
    assert FreshSettings(**json.loads(json.dumps(settings.to_dict()))) == settings


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("value", [-1, math.nan, math.inf, True, "many", None])
def test_no_setting_is_negative_endless_or_something_other_than_a_number(name: str, value: object) -> None:
    with pytest.raises((TypeError, ValueError), match=f"{name} must be .*, not {value!r}"):
        FreshSettings(**{name: value})  # type: ignore[arg-type]


@pytest.mark.parametrize("name", sorted(set(NAMES) - MEASURED))
def test_what_is_counted_is_a_whole_number(name: str) -> None:
    with pytest.raises(TypeError, match=f"{name} must be a whole number, not 8.5"):
        FreshSettings(**{name: 8.5})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "value", "wish"),
    [
        ("num_slots", 0, "larger than 0"),
        ("learning_rate", 0.0, "larger than 0"),
        ("discount", -0.1, "at least 0"),
        ("final_exploration", -0.1, "at least 0"),
        ("discount", 1.0, "below 1"),
        ("final_exploration", 1.01, "from 0 to 1"),
        ("sub_reward", 0.51, "at most 0.5"),
        ("target_interval", 501, "a multiple of train_interval, 4"),
    ],
)
def test_a_setting_out_of_range_is_refused_with_the_value_and_the_wish(name: str, value: float, wish: str) -> None:
    with pytest.raises(ValueError, match=f"{name} must be .*{wish}.*, not {value}"):
        FreshSettings(**{name: value})  # type: ignore[arg-type]


def test_what_may_be_nothing_may_be_nothing() -> None:
    settings = FreshSettings(discount=0, final_exploration=0, sub_reward=0)
    assert (settings.discount, settings.final_exploration, settings.sub_reward) == (0, 0, 0)


def test_random_actions_become_rarer_in_a_straight_line_and_then_stay_as_rare() -> None:
    settings = FreshSettings(exploration_steps=1000, final_exploration=0.2)
    shares = settings.exploration(np.array([0, 250, 500, 1000, 1001, 10**9]))
    assert shares == pytest.approx([1.0, 0.8, 0.6, 0.2, 0.2, 0.2])
