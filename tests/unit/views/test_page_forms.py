"""What a form says, field by field, and what a page shows of it when it comes back."""

import pytest

from webapp.study.answers import Answer
from webapp.study.experiments import Item
from webapp.study.question_forms import FieldProblem, Reason
from webapp.study.questionnaire import RatingProblem
from webapp.study.sections import BackgroundQuestion, QuizQuestion
from webapp.study.texts import ItemTexts, Texts
from webapp.views.forms import (
    FormError,
    QuestionField,
    RatingField,
    background_fields,
    consent_nonce,
    question_error,
    question_errors,
    quiz_fields,
    rating_errors,
    rating_field_of,
    rating_reasons,
)

TEXTS = Texts(
    "en",
    {
        "errors.rating_missing": "choose: {legend}",
        "errors.rating_invalid": "choose one: {legend}",
        "errors.answer_missing": "answer: {legend}",
        "errors.answer_invalid": "impossible: {legend}",
        "errors.answer_too_long": "too long: {legend}",
        "background.prefer_not_to_say": "rather not",
        "background.age.question": "How old?",
        "background.words.question": "In your words?",
        "background.hand.question": "Which hand?",
        "background.hand.choices.left": "The left",
        "background.hand.choices.right": "The right",
        "quiz.right": "Well done.",
        "quiz.door.question": "What opens the door?",
        "quiz.door.choices.key": "A key",
        "quiz.door.choices.luck": "Luck",
        "quiz.door.feedback": "Not luck.",
    },
)
EASE = Item(id="ease", points=7)
WORDING = ItemTexts("How easy?", "hard", "easy")
QUESTIONS = (
    BackgroundQuestion(id="age", type="number"),
    BackgroundQuestion(id="words", type="text"),
    BackgroundQuestion(id="hand", type="choice", choices=("left", "right")),
)
DOOR = QuizQuestion(id="door", choices=("key", "luck"), answer="key")
NONCE = "0123456789abcdef0123456789abcdef"


@pytest.mark.parametrize("nonce", [NONCE, "f" * 32])
def test_a_nonce_has_thirty_two_hexadecimal_digits(nonce: str) -> None:
    assert consent_nonce({"nonce": nonce}) == nonce


@pytest.mark.parametrize("nonce", ["", NONCE[1:], f"{NONCE}0", NONCE.upper(), f"{NONCE}\n", f" {NONCE[1:]}", "g" * 32])
def test_anything_else_is_none(nonce: str) -> None:
    assert consent_nonce({"nonce": nonce}) is None
    assert consent_nonce({}) is None
    assert consent_nonce({"NONCE": NONCE}) is None


def test_a_rating_is_shown_with_its_scale_and_what_was_chosen() -> None:
    shown = rating_field_of({"rating-ease": " 6 "}, EASE, WORDING, None, TEXTS, ("a", "b"))
    assert shown == RatingField("ease", "How easy?", 7, "hard", "easy", 6, None, ("a", "b"))
    assert rating_field_of({}, EASE, WORDING, None, TEXTS) == RatingField(
        "ease", "How easy?", 7, "hard", "easy", None, None, ()
    )


@pytest.mark.parametrize("given", ["", "x", "-1", "1.5", "\N{ARABIC-INDIC DIGIT THREE}", "\N{SUPERSCRIPT TWO}"])
def test_what_is_no_number_is_not_shown_as_one(given: str) -> None:
    assert rating_field_of({"rating-ease": given}, EASE, WORDING, None, TEXTS).value is None


@pytest.mark.parametrize(("reason", "error"), [("missing", "choose: How easy?"), ("invalid", "choose one: How easy?")])
def test_a_rating_with_a_problem_says_what_to_do_and_shows_nothing_as_chosen(reason: str, error: str) -> None:
    shown = rating_field_of({"rating-ease": "3"}, EASE, WORDING, reason, TEXTS)
    assert (shown.error, shown.value) == (error, None)


def test_the_summary_leads_to_the_first_button_of_each_rating_with_a_problem() -> None:
    fields = [rating_field_of({}, Item(id=name), WORDING, reason, TEXTS) for name, reason in REASONS]
    assert rating_errors(fields) == [
        FormError("rating-b-1", "choose: How easy?"),
        FormError("rating-c-1", "choose one: How easy?"),
    ]
    assert rating_reasons([RatingProblem("b", "missing"), RatingProblem("c", "invalid")]) == {
        name: reason for name, reason in REASONS if reason is not None
    }


REASONS = [("a", None), ("b", "missing"), ("c", "invalid")]


def test_background_questions_come_with_their_choices_and_a_way_not_to_answer() -> None:
    form = {"answer-age": "44", "refuse-words": "yes", "answer-hand": "left"}
    assert background_fields(form, QUESTIONS, (), TEXTS) == [
        QuestionField("answer-age", "number", "How old?", (), "44", "refuse-age"),
        QuestionField("answer-words", "text", "In your words?", (), "", "refuse-words", is_refused=True),
        QuestionField(
            "answer-hand",
            "choice",
            "Which hand?",
            (("left", "The left"), ("right", "The right"), ("prefer_not_to_say", "rather not")),
            "left",
        ),
    ]


@pytest.mark.parametrize("ticked", ["", "no", "YES", "on"])
def test_only_a_ticked_box_is_a_refusal(ticked: str) -> None:
    (age, *_) = background_fields({"refuse-age": ticked}, QUESTIONS, (), TEXTS)
    assert not age.is_refused


@pytest.mark.parametrize(
    ("reason", "error"),
    [("missing", "answer: How old?"), ("invalid", "impossible: How old?"), ("too_long", "too long: How old?")],
)
def test_a_question_says_what_is_wrong_with_it_and_with_no_other(reason: Reason, error: str) -> None:
    problems = [FieldProblem("answer-nothing", "missing"), FieldProblem("answer-age", reason)]
    age, words, hand = background_fields({}, QUESTIONS, problems, TEXTS)
    assert (age.error, words.error, hand.error) == (error, None, None)
    assert question_errors([age, words, hand]) == [FormError("answer-age", error)]
    assert question_error("answer-age", "How old?", problems, TEXTS) == error
    assert question_error("answer-age", "How old?", problems[:1], TEXTS) is None


def test_the_summary_leads_to_the_field_or_to_the_first_of_its_choices() -> None:
    problems = [FieldProblem(f"answer-{question.id}", "missing") for question in QUESTIONS]
    found = question_errors(background_fields({}, QUESTIONS, problems, TEXTS))
    assert [error.control for error in found] == ["answer-age", "answer-words", "answer-hand-1"]


def test_a_quiz_begins_without_feedback() -> None:
    assert quiz_fields({}, [DOOR], (), {}, TEXTS) == [
        QuestionField("answer-door", "choice", "What opens the door?", [("key", "A key"), ("luck", "Luck")])
    ]


@pytest.mark.parametrize(
    ("answer", "is_correct", "value", "feedback"),
    [("key", True, "key", "Well done."), ("luck", False, "", "Not luck.")],
)
def test_a_quiz_that_was_tried_keeps_what_was_right_and_explains_the_rest(
    answer: str, is_correct: bool, value: str, feedback: str
) -> None:
    (shown,) = quiz_fields({}, [DOOR], (), {"door": Answer("door", answer, is_correct=is_correct)}, TEXTS)
    assert (shown.value, shown.feedback, shown.is_right) == (value, feedback, is_correct)
    (again,) = quiz_fields({"answer-door": "luck"}, [DOOR], (), {"door": Answer("door", answer, is_correct)}, TEXTS)
    assert again.value == "luck"


def test_a_quiz_says_which_question_is_not_answered() -> None:
    (shown,) = quiz_fields({}, [DOOR], [FieldProblem("answer-door", "missing")], {}, TEXTS)
    assert shown.error == "answer: What opens the door?"
    assert shown.control == "answer-door-1"
