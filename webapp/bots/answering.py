"""What a bot writes into a form, what will be stored if the server keeps its word, and how long it takes."""

import json
import random
from collections.abc import Mapping
from dataclasses import dataclass, field

from webapp.bots.effects import Effects
from webapp.bots.opinions import happens, latent_rating, response_time_ms
from webapp.bots.page_reading import Form
from webapp.bots.plan import BotPlan
from webapp.stimuli.catalogue import Catalogue
from webapp.storage.read_back import NOT_MEASURED, Entry
from webapp.study.question_forms import CONFIDENCE_POINTS
from webapp.study.session import Page

_TYPICAL_READING_MS = 6000
_TYPICAL_CHOICE_MS = 2500
_OWN_WORDS = "This was written by a program."
_MOST_YEARS = 60
_HIGHEST = 0.6
"""How often one who agrees with everything gives the very highest value rather than the one below."""


@dataclass(slots=True)
class FilledForm:
    """A form that is ready to be sent.

    Attributes:
        fields: What is sent.
        entries: What is stored then; see `storage.read_back`.
        elapsed_ms: The time from the first paint to the last answer.
    """

    fields: dict[str, str]
    entries: list[Entry] = field(default_factory=list)
    elapsed_ms: int = 0


@dataclass(frozen=True, slots=True)
class Answerer:
    """One bot with everything that decides about its answers.

    Attributes:
        plan: The bot.
        effects: What was declared.
        catalogue: What the bot is shown.
    """

    plan: BotPlan
    effects: Effects
    catalogue: Catalogue

    def fill_in(self, form: Form, page: Page, attempt: int) -> FilledForm:
        """Answer everything that stands on a page."""
        rng = self.plan.stream("page", page.number, attempt)
        pace = self.plan.behaviour.pace
        filled = FilledForm(dict(form.hidden), elapsed_ms=response_time_ms(rng, _TYPICAL_READING_MS * pace))
        log: list[list[object]] = [["painted", "", "", 0]]
        for name, options in form.choices.items():
            value = self._choose(name, options, page, rng)
            filled.fields[name] = value
            filled.elapsed_ms += response_time_ms(rng, _TYPICAL_CHOICE_MS * pace)
            item = name.removeprefix("rating-")
            log.append(["changed", item, value, filled.elapsed_ms])
            if f"time-{item}" in form.hidden:
                filled.fields[f"time-{item}"] = str(filled.elapsed_ms)
        for name in form.texts:
            filled.fields[name] = self._write(name, page, rng)
        if "events" in form.hidden:
            filled.fields["events"] = json.dumps(log)
        filled.entries = self._entries(filled.fields, page, attempt)
        return filled

    def passes_quiz(self, entries: list[Entry]) -> bool:
        """Tell whether the answers to a quiz are all right."""
        quiz = self.catalogue.study.quiz
        right = {question.id: question.answer for question in quiz.questions} if quiz else {}
        return all(entry[3] == right.get(entry[2]) for entry in entries if entry[0] == "answer")

    def _choose(self, name: str, options: list[str], page: Page, rng: random.Random) -> str:
        prefix, _, target = name.partition("-")
        if prefix == "predict":
            return self._predict(int(target), options, page, rng)
        if prefix == "answer" and page.kind == "quiz":
            return self._answer_quiz(target, options, rng)
        if prefix == "rating":
            wanted = self._checks(page).get(target)
            if wanted is not None and happens(self.plan.behaviour.attends, rng):
                return str(wanted)
            return str(self._rate(target, len(options), page, rng))
        return rng.choice(options)

    def _rate(self, item: str, points: int, page: Page, rng: random.Random) -> int:
        match self.plan.behaviour.rates:
            case "same":
                return 1 + int(self.plan.favourite * self._shortest_scale())
            case "random":
                return rng.randint(1, points)
            case "high":
                return points if happens(_HIGHEST, rng) else points - 1
            case "opinion":
                shift = 0.0 if page.trial is None else self.effects.on_rating(page.trial.kind, item)
                return latent_rating(points, shift, self.plan.intercept, rng)

    def _predict(self, number: int, options: list[str], page: Page, rng: random.Random) -> str:
        base = self.plan.behaviour.predicts
        if base is None or page.trial is None:
            return rng.choice(options)
        right = self.catalogue.probes(page.trial.experiment, page.trial.layout)[number - 1].action
        shift = self.effects.on_prediction(page.trial.kind) if self.plan.behaviour.follows_effects else 0.0
        if happens(base + shift, rng):
            return right
        return rng.choice([action for action in options if action != right])

    def _answer_quiz(self, question_id: str, options: list[str], rng: random.Random) -> str:
        quiz = self.catalogue.study.quiz
        right = {question.id: question.answer for question in quiz.questions} if quiz else {}
        knows = happens(self.plan.behaviour.knows_quiz, rng)
        return right[question_id] if knows and question_id in right else rng.choice(options)

    def _write(self, name: str, page: Page, rng: random.Random) -> str:
        section = self.catalogue.study.background
        questions = {f"answer-{question.id}": question for question in section.questions} if section else {}
        question = questions.get(name) if page.kind == "background" else None
        if question is None or question.type != "number":
            return _OWN_WORDS
        return str(rng.randint(question.minimum, min(question.maximum, question.minimum + _MOST_YEARS)))

    def _entries(self, fields: Mapping[str, str], page: Page, attempt: int) -> list[Entry]:
        """Return what these fields become when they are stored."""
        checks, entries = self._checks(page), list[Entry]()
        for name, value in fields.items():
            prefix, _, target = name.partition("-")
            if prefix == "answer" or (prefix == "rating" and target in checks):
                entries.append(("answer", str(attempt), target, value))
            elif prefix == "rating" and page.kind != "probe":
                entries.append(("rating", target, value, fields.get(f"time-{target}", NOT_MEASURED)))
            elif prefix == "predict":
                sureness, time = fields[f"rating-confidence-{target}"], fields.get(f"time-{name}", NOT_MEASURED)
                entries.append(("prediction", target, value, sureness, time))
        return entries

    def _checks(self, page: Page) -> dict[str, int]:
        """Return what the attention checks of a page say, by their ids."""
        if page.trial is None or page.kind != "rating":
            return {}
        checks = self.catalogue.study.checks_of(page.trial.experiment, page.trial.position)
        return {check.id: check.answer for check in checks}

    def _shortest_scale(self) -> int:
        """Return the number of values that every question of the rating kind has, the confidence included."""
        experiments = self.catalogue.study.experiments
        return min(CONFIDENCE_POINTS, *(item.points for experiment in experiments for item in experiment.items))


def altered(fields: Mapping[str, str]) -> dict[str, str]:
    """Return an old form with other answers, which must not replace the first ones."""
    return {
        name: "1" if name.startswith("rating-") and value != "1" else "2" if name.startswith("rating-") else value
        for name, value in fields.items()
    }
