from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from webapp.study.answers import PREFER_NOT_TO_SAY, Answer, Prediction
from webapp.study.question_forms import (
    FieldProblem,
    Reason,
    answer_field,
    check_answers,
    check_item,
    confidence_item,
    parse_background,
    parse_predictions,
    parse_quiz,
    prediction_field,
    refusal_field,
    without_checks,
)
from webapp.study.questionnaire import Ratings, parse_ratings
from webapp.study.sections import MAX_TEXT_LENGTH, AttentionCheck, BackgroundQuestion, QuizQuestion

AGE = BackgroundQuestion(id="age", type="number", minimum=16, maximum=120)
GAMES = BackgroundQuestion(id="games", type="choice", choices=("never", "daily"))
JOB = BackgroundQuestion(id="job", type="text")
QUESTIONS = (AGE, GAMES, JOB)
SAID = {"answer-age": "44", "answer-games": "daily", "answer-job": " Lighthouse keeper "}

GOAL = QuizQuestion(id="goal", choices=("key", "flag"), answer="flag")
DOOR = QuizQuestion(id="door", choices=("key", "wait"), answer="key")

CHECKS = (
    AttentionCheck(id="check-a", experiment="1", trial=1, answer=2),
    AttentionCheck(id="check-b", experiment="1", trial=1, answer=5),
)
ACTIONS = ("forward", "left", "right", "pickup", "toggle")


@dataclass(frozen=True)
class State:
    """One state asked about."""

    state: int
    action: str
    as_good: tuple[str, ...]


ASKED = (State(4, "left", ("left", "right")), State(9, "toggle", ("toggle",)))


def test_background_answers_are_read_in_the_order_of_the_questions() -> None:
    assert parse_background(SAID, QUESTIONS) == (
        Answer("age", "44"),
        Answer("games", "daily"),
        Answer("job", "Lighthouse keeper"),
    )


def test_nobody_has_to_say_anything() -> None:
    refused = {refusal_field("age"): "yes", "answer-games": PREFER_NOT_TO_SAY, refusal_field("job"): "yes"}
    expected = tuple(Answer(question.id, PREFER_NOT_TO_SAY) for question in QUESTIONS)
    assert parse_background(refused, QUESTIONS) == expected
    assert parse_background(SAID | refused, QUESTIONS) == expected


def test_a_question_that_was_passed_over_is_named() -> None:
    for question in QUESTIONS:
        for empty in ({answer_field(question.id): "  "}, {}):
            form = {name: value for name, value in SAID.items() if name != answer_field(question.id)} | empty
            assert parse_background(form, QUESTIONS) == (FieldProblem(answer_field(question.id), "missing"),)


def test_every_problem_is_named_and_nothing_is_kept_meanwhile() -> None:
    problems = parse_background({"answer-age": "old"}, QUESTIONS)
    assert problems == (
        FieldProblem("answer-age", "invalid"),
        FieldProblem("answer-games", "missing"),
        FieldProblem("answer-job", "missing"),
    )


@pytest.mark.parametrize("text", ["15", "121", "-44", "4.4", "44 years", "1e2", "four", "9" * 30, "+44"])
def test_a_number_out_of_bounds_is_invalid(text: str) -> None:
    assert parse_background({"answer-age": text}, [AGE]) == (FieldProblem("answer-age", "invalid"),)


@given(minimum=st.integers(-50, 50), size=st.integers(0, 100), number=st.integers(-200, 200), zeros=st.integers(0, 3))
def test_exactly_the_numbers_from_least_to_largest_are_taken_and_written_plainly(
    minimum: int, size: int, number: int, zeros: int
) -> None:
    question = BackgroundQuestion(id="n", type="number", minimum=minimum, maximum=minimum + size)
    text = f"{'-' if number < 0 else ''}{'0' * zeros}{abs(number)}"
    expected: object = FieldProblem("answer-n", "invalid")
    if minimum <= number <= minimum + size:
        expected = Answer("n", str(number))
    assert parse_background({"answer-n": text}, [question]) == (expected,)


@pytest.mark.parametrize("choice", ["sometimes", "Daily", "never daily", "0"])
def test_a_choice_that_was_not_offered_is_invalid(choice: str) -> None:
    assert parse_background({"answer-games": choice}, [GAMES]) == (FieldProblem("answer-games", "invalid"),)


@pytest.mark.parametrize(("length", "reason"), [(MAX_TEXT_LENGTH, None), (MAX_TEXT_LENGTH + 1, "too_long")])
def test_own_words_have_a_length(length: int, reason: Reason | None) -> None:
    (found,) = parse_background({"answer-job": "語" * length}, [JOB])
    assert found == (Answer("job", "語" * length) if reason is None else FieldProblem("answer-job", reason))


@given(text=st.text())
def test_own_words_are_kept_as_they_are_but_for_blanks_around_them_and_nul(text: str) -> None:
    (found,) = parse_background({"answer-job": text}, [JOB])
    kept = text.replace("\0", "").strip()
    if isinstance(found, Answer):
        assert found.answer == kept
        assert found.is_correct is None
    else:
        assert not kept or len(kept) > MAX_TEXT_LENGTH


def test_a_quiz_is_read_whether_right_or_wrong() -> None:
    assert parse_quiz({"answer-goal": "flag", "answer-door": "wait"}, (GOAL, DOOR)) == (
        Answer("goal", "flag", is_correct=True),
        Answer("door", "wait", is_correct=False),
    )


@pytest.mark.parametrize(("form", "reason"), [({}, "missing"), ({"answer-goal": "door"}, "invalid")])
def test_only_what_a_quiz_offers_is_an_answer(form: dict[str, str], reason: Reason) -> None:
    assert parse_quiz({"answer-door": "key"} | form, (GOAL, DOOR)) == (FieldProblem("answer-goal", reason),)


def test_a_quiz_cannot_be_refused() -> None:
    form = {"answer-goal": PREFER_NOT_TO_SAY, "answer-door": "key", refusal_field("door"): "yes"}
    assert parse_quiz(form, (GOAL, DOOR)) == (FieldProblem("answer-goal", "invalid"),)


def test_attention_checks_look_like_ratings_and_are_taken_out_of_them() -> None:
    items = [check_item(check) for check in CHECKS]
    form = {"rating-general": "3", "time-general": "900", "rating-check-a": "2", "rating-check-b": "4"}
    ratings = parse_ratings(form, [confidence_item(1).model_copy(update={"id": "general"}), *items])
    assert isinstance(ratings, Ratings)
    assert check_answers(ratings, CHECKS) == (
        Answer("check-a", "2", is_correct=True),
        Answer("check-b", "4", is_correct=False),
    )
    assert without_checks(ratings, CHECKS) == Ratings({"general": 3}, {"general": 900})
    assert without_checks(ratings, ()) == ratings


def test_predictions_are_scored_by_what_the_agent_does_and_by_what_would_do_as_well() -> None:
    form = {prediction_field(1): "right", "time-predict-1": "1200", prediction_field(2): "toggle"}
    confidences = {confidence_item(1).id: 2, confidence_item(2).id: 5}
    assert parse_predictions(form, ASKED, ACTIONS, confidences) == (
        Prediction(1, 4, "right", "left", False, True, 2, 1200),
        Prediction(2, 9, "toggle", "toggle", True, True, 5, None),
    )
    form = {prediction_field(1): "pickup", prediction_field(2): "forward"}
    found = parse_predictions(form, ASKED, ACTIONS, confidences)
    assert [(entry.is_correct, entry.is_as_good) for entry in found if isinstance(entry, Prediction)] == [
        (False, False),
        (False, False),
    ]


@pytest.mark.parametrize(("form", "reason"), [({}, "missing"), ({"predict-2": "jump"}, "invalid")])
def test_a_prediction_is_one_of_the_actions(form: dict[str, str], reason: Reason) -> None:
    found = parse_predictions({"predict-1": "left"} | form, ASKED, ACTIONS, {"confidence-1": 1, "confidence-2": 1})
    assert found == (FieldProblem("predict-2", reason),)


@given(first=st.sampled_from(ACTIONS), second=st.sampled_from(ACTIONS), time=st.text(max_size=12))
def test_whatever_is_predicted_is_stored_with_its_score(first: str, second: str, time: str) -> None:
    form = {"predict-1": first, "predict-2": second, "time-predict-2": time}
    found = parse_predictions(form, ASKED, ACTIONS, {"confidence-1": 1, "confidence-2": 5})
    assert [entry.predicted for entry in found if isinstance(entry, Prediction)] == [first, second]
    for entry, question in zip(found, ASKED, strict=True):
        assert isinstance(entry, Prediction)
        assert entry.is_correct == (entry.predicted == question.action)
        assert entry.is_as_good == (entry.predicted in question.as_good)


def test_confidence_goes_from_one_to_five() -> None:
    assert [confidence_item(number).id for number in (1, 2)] == ["confidence-1", "confidence-2"]
    assert confidence_item(1).points == 5
