import dataclasses

import pytest

from webapp.study.answers import Answer, DriveEnd, DriveResult, Event, PageContent, Prediction


def result(end: DriveEnd = "gave_up", num_steps: int = 3, key_points: tuple[int, ...] = ()) -> DriveResult:
    return DriveResult("after", "meadow", end, num_steps, 7, 21, (1,), key_points)


@pytest.mark.parametrize(("predicted", "is_correct"), [("left", True), ("right", False)])
def test_a_prediction_is_right_exactly_if_it_is_what_the_agent_does(predicted: str, is_correct: bool) -> None:
    assert Prediction(1, 0, predicted, "left", is_correct, True, 3, None).is_correct == is_correct
    with pytest.raises(ValueError, match=f"'{predicted}' and 'left' do not fit with is_correct = {not is_correct}"):
        Prediction(1, 0, predicted, "left", not is_correct, True, 3, None)


@pytest.mark.parametrize("num_steps", [0, 1, 21])
def test_a_drive_has_as_many_steps_as_there_are_at_most(num_steps: int) -> None:
    assert result(num_steps=num_steps).num_steps == num_steps


@pytest.mark.parametrize("num_steps", [-1, 22])
def test_a_drive_that_is_too_long_is_refused(num_steps: int) -> None:
    with pytest.raises(ValueError, match=f"from 0 to 21 steps, not {num_steps}"):
        result(num_steps=num_steps)


def test_a_drive_that_arrived_misses_nothing() -> None:
    assert result("reached").key_points == ()
    with pytest.raises(ValueError, match=r"misses nothing, and these are key points: \(5,\)"):
        result("reached", key_points=(5,))
    ends: tuple[DriveEnd, ...] = ("gave_up", "step_limit")
    for end in ends:
        assert result(end, key_points=(5,)).key_points == (5,)


def test_an_empty_page_is_final_and_ends_nothing() -> None:
    content = PageContent()
    assert (content.is_final, content.failed, content.screens_out) == (True, False, False)
    assert (content.ratings, content.drive) == (None, None)
    assert (content.answers, content.predictions, content.events) == ((), (), ())
    assert content.attempt == 1


@pytest.mark.parametrize(
    "value",
    [
        Answer("age", "44"),
        Event("painted", "", "", 0),
        PageContent(),
        result(),
        Prediction(1, 0, "a", "a", True, True, 1, 0),
    ],
    ids=lambda value: type(value).__name__,
)
def test_what_was_parsed_never_changes(value: object) -> None:
    name = dataclasses.fields(value)[0].name  # type: ignore[arg-type]
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(value, name, None)
