"""Each kind of page: what its form says, and what its template shows."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from flask import render_template

from webapp.storage.answers import last_answers, num_attempts
from webapp.study.answers import Answer, PageContent, Prediction
from webapp.study.events import parse_events
from webapp.study.experiments import SATISFACTION_ITEMS, Item
from webapp.study.question_forms import (
    Asked,
    FieldProblem,
    check_answers,
    check_item,
    confidence_item,
    parse_background,
    parse_predictions,
    parse_quiz,
    prediction_field,
    without_checks,
)
from webapp.study.questionnaire import RatingProblem, Ratings, parse_ratings
from webapp.study.sections import MAX_TEXT_LENGTH, AttentionCheck
from webapp.study.session import DRIVEN, Page, PageKind, Trial
from webapp.study.texts import ItemTexts, Texts
from webapp.views.answering import notice
from webapp.views.driving import drive_context, explanation_of
from webapp.views.forms import (
    QuestionField,
    RatingField,
    background_fields,
    question_error,
    question_errors,
    quiz_fields,
    rating_errors,
    rating_field_of,
    rating_reasons,
)
from webapp.views.services import services
from webapp.views.texts import texts
from webapp.views.visit import Visit


@dataclass(frozen=True, slots=True)
class Problems:
    """What is wrong with a sent page.

    Attributes:
        ratings: With the ratings on it.
        questions: With its other questions.
    """

    ratings: Sequence[RatingProblem] = ()
    questions: Sequence[FieldProblem] = ()


_Parser = Callable[[Visit, Page, Mapping[str, str]], PageContent | Problems]
_Context = Callable[[Visit, Page, Mapping[str, str], Problems], dict[str, Any]]


def attempt_at(visit: Visit, page: Page) -> int:
    """Return which attempt at a page is due, from 1; only a quiz may be answered more than once."""
    return 1 + num_attempts(services().database, visit.participant, page.number) if page.kind == "quiz" else 1


def parse_page(visit: Visit, page: Page, form: Mapping[str, str]) -> PageContent | Problems:
    """Read what a page's form says, with the log of the page."""
    parse = _PARSERS.get(page.kind)
    content = PageContent() if parse is None else parse(visit, page, form)
    if isinstance(content, Problems):
        return content
    logs_behaviour = visit.catalogue.study.behaviour_log is not None
    return replace(content, events=parse_events(form.get("events", ""), behaviour=logs_behaviour))


def render_page(
    visit: Visit, page: Page, form: Mapping[str, str] | None = None, problems: Problems | None = None
) -> str:
    """Render a page; after a form with problems, with what the form said and what is to be mended."""
    context = _CONTEXTS.get(page.kind)
    shown = {} if context is None else context(visit, page, form or {}, problems or Problems())
    said = notice()
    facts = {
        "number": page.number,
        "num_pages": len(visit.pages),
        "nonce": visit.nonce(page, attempt_at(visit, page)),
        "kind": page.kind,
    }
    template = "drive" if page.kind in DRIVEN else page.kind
    return render_template(f"participant/{template}.html", page=facts, notice=said, trial=page.trial, **shown)


def _parse_background(visit: Visit, _page: Page, form: Mapping[str, str]) -> PageContent | Problems:
    section = visit.catalogue.study.background
    assert section is not None  # noqa: S101 - for the type checker: without the section there is no such page
    found = parse_background(form, section.questions)
    problems = _problems(found)
    return Problems(questions=problems) if problems else PageContent(answers=_answers(found))


def _parse_quiz(visit: Visit, page: Page, form: Mapping[str, str]) -> PageContent | Problems:
    quiz = visit.catalogue.study.quiz
    assert quiz is not None  # noqa: S101 - for the type checker: without the section there is no such page
    found = parse_quiz(form, quiz.questions)
    problems = _problems(found)
    if problems:
        return Problems(questions=problems)
    answers, attempt = _answers(found), attempt_at(visit, page)
    is_passed = all(answer.is_correct for answer in answers)
    failed = not is_passed and attempt >= quiz.attempts
    return PageContent(
        answers=answers,
        attempt=attempt,
        is_final=is_passed or failed,
        failed=failed,
        screens_out=failed and quiz.on_failure == "screen_out",
    )


def _parse_rating(visit: Visit, page: Page, form: Mapping[str, str]) -> PageContent | Problems:
    trial, checks = _trial(page), _checks(visit, page)
    ratings = parse_ratings(form, (*_items(visit, trial), *map(check_item, checks)))
    if not isinstance(ratings, Ratings):
        return Problems(ratings=ratings)
    return PageContent(ratings=without_checks(ratings, checks), answers=check_answers(ratings, checks))


def _parse_satisfaction(_visit: Visit, _page: Page, form: Mapping[str, str]) -> PageContent | Problems:
    ratings = parse_ratings(form, _SATISFACTION)
    return PageContent(ratings=ratings) if isinstance(ratings, Ratings) else Problems(ratings=ratings)


def _parse_probe(visit: Visit, page: Page, form: Mapping[str, str]) -> PageContent | Problems:
    asked = _asked(visit, page)
    confidence = parse_ratings(form, [confidence_item(number) for number in range(1, len(asked) + 1)])
    values = confidence.values if isinstance(confidence, Ratings) else {}
    actions = visit.catalogue.world(_trial(page).layout).actions
    found = parse_predictions(form, asked, actions, values)
    problems = _problems(found)
    if problems:
        return Problems(() if isinstance(confidence, Ratings) else confidence, problems)
    return PageContent(predictions=[entry for entry in found if isinstance(entry, Prediction)])


def _background_context(visit: Visit, _page: Page, form: Mapping[str, str], problems: Problems) -> dict[str, Any]:
    section = visit.catalogue.study.background
    assert section is not None  # noqa: S101 - for the type checker: without the section there is no such page
    fields = background_fields(form, section.questions, problems.questions, texts())
    return {"questions": fields, "errors": question_errors(fields), "max_text_length": MAX_TEXT_LENGTH}


def _quiz_context(visit: Visit, page: Page, form: Mapping[str, str], problems: Problems) -> dict[str, Any]:
    quiz = visit.catalogue.study.quiz
    assert quiz is not None  # noqa: S101 - for the type checker: without the section there is no such page
    earlier = last_answers(services().database, visit.participant, page.number)
    fields = quiz_fields(form, quiz.questions, problems.questions, earlier, texts())
    left = quiz.attempts - attempt_at(visit, page) + 1
    return {"questions": fields, "errors": question_errors(fields), "attempts_left": left, "is_again": bool(earlier)}


def _situation_context(visit: Visit, page: Page, _form: Mapping[str, str], _problems: Problems) -> dict[str, Any]:
    return {"situation": visit.catalogue.situation(_trial(page), visit.language)}


def _explanation_context(visit: Visit, page: Page, _form: Mapping[str, str], _problems: Problems) -> dict[str, Any]:
    return explanation_of(visit, _trial(page))


def _rating_context(visit: Visit, page: Page, form: Mapping[str, str], problems: Problems) -> dict[str, Any]:
    trial, t = _trial(page), texts()
    reasons = rating_reasons(problems.ratings)
    fields = [
        rating_field_of(form, item, t.item(item.id, trial.experiment), reasons.get(item.id), t)
        for item in _items(visit, trial)
    ]
    fields += [
        rating_field_of(form, check_item(check), _check_wording(check, t), reasons.get(check.id), t)
        for check in _checks(visit, page)
    ]
    return {"items": fields, "errors": rating_errors(fields), **explanation_of(visit, trial)}


def _satisfaction_context(visit: Visit, page: Page, form: Mapping[str, str], problems: Problems) -> dict[str, Any]:
    t, reasons = texts(), rating_reasons(problems.ratings)
    labels = t.list("satisfaction.labels")
    fields = [
        rating_field_of(form, item, ItemTexts(legend, labels[0], labels[-1]), reasons.get(item.id), t, labels)
        for item, legend in zip(_SATISFACTION, t.list("satisfaction.items"), strict=True)
    ]
    return {"items": fields, "errors": rating_errors(fields), **explanation_of(visit, _trial(page))}


def _probe_context(visit: Visit, page: Page, form: Mapping[str, str], problems: Problems) -> dict[str, Any]:
    t, trial = texts(), _trial(page)
    world = visit.catalogue.world(trial.layout)
    reasons = rating_reasons(problems.ratings)
    probe = visit.catalogue.study.experiment(trial.experiment).probe
    assert probe is not None  # noqa: S101 - for the type checker: without the section there is no such page
    asked: list[dict[str, Any]] = []
    questions: list[QuestionField] = []
    ratings: list[RatingField] = []
    for number, question in enumerate(_asked(visit, page), start=1):
        name, item = prediction_field(number), confidence_item(number)
        names = {action: visit.catalogue.action_name(action, visit.language) for action in world.actions}
        choices = [(action, _capitalised(name)) for action, name in names.items()]
        is_only = probe.num_questions == 1
        legend = t("probe.question") if is_only else t("probe.question_numbered", number=number)
        sure = t("probe.confidence") if is_only else t("probe.confidence_numbered", number=number)
        wording = ItemTexts(sure, t("probe.unsure"), t("probe.sure"))
        error = question_error(name, legend, problems.questions, t)
        questions.append(QuestionField(name, "choice", legend, choices, form.get(name, ""), error=error))
        ratings.append(rating_field_of(form, item, wording, reasons.get(item.id), t))
        view = visit.catalogue.view(trial.layout, question.state, visit.language)
        asked.append({"view": view, "question": questions[-1], "confidence": ratings[-1]})
    return {"asked": asked, "states": probe.states, "errors": question_errors(questions) + rating_errors(ratings)}


_PARSERS: Mapping[PageKind, _Parser] = {
    "background": _parse_background,
    "quiz": _parse_quiz,
    "rating": _parse_rating,
    "satisfaction": _parse_satisfaction,
    "probe": _parse_probe,
}
_CONTEXTS: Mapping[PageKind, _Context] = {
    "background": _background_context,
    "quiz": _quiz_context,
    "situation": _situation_context,
    "explanation": _explanation_context,
    "rating": _rating_context,
    "satisfaction": _satisfaction_context,
    "probe": _probe_context,
    "practice": drive_context,
    "first_drive": drive_context,
    "drive": drive_context,
}
_SATISFACTION = tuple(Item(id=item) for item in SATISFACTION_ITEMS)


def _capitalised(text: str) -> str:
    return text[:1].upper() + text[1:]


def _trial(page: Page) -> Trial:
    assert page.trial is not None  # noqa: S101 - for the type checker: every such page belongs to a trial
    return page.trial


def _items(visit: Visit, trial: Trial) -> Sequence[Item]:
    return visit.catalogue.study.experiment(trial.experiment).items_for(trial.kind)


def _checks(visit: Visit, page: Page) -> tuple[AttentionCheck, ...]:
    trial = _trial(page)
    return visit.catalogue.study.checks_of(trial.experiment, trial.position)


def _check_wording(check: AttentionCheck, t: Texts) -> ItemTexts:
    legend = t("attention.instruction", answer=check.answer)
    return ItemTexts(legend, t("attention.low"), t("attention.high"))


def _asked(visit: Visit, page: Page) -> Sequence[Asked]:
    trial = _trial(page)
    return visit.catalogue.probes(trial.experiment, trial.layout)


def _problems(found: Sequence[object]) -> tuple[FieldProblem, ...]:
    return tuple(entry for entry in found if isinstance(entry, FieldProblem))


def _answers(found: Sequence[object]) -> tuple[Answer, ...]:
    return tuple(entry for entry in found if isinstance(entry, Answer))
