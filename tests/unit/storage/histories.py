"""Histories of a study as chance has them: people arrive, send pages, take breaks, leave; researchers decide."""

import random
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta

from tests.unit.storage.people import DRIVING, NOW, drive, enrol_somebody, pages_of, prediction, ratings_of, send
from webapp.storage.database import Database
from webapp.storage.erasure import erase
from webapp.storage.helping import release_page
from webapp.storage.participants import Participant, withdraw
from webapp.storage.people import exclude, find_person, include
from webapp.storage.scope import Mode, Scope
from webapp.study.answers import Answer, Event, PageContent
from webapp.study.experiments import SATISFACTION_ITEMS
from webapp.study.protocol import Study
from webapp.study.questionnaire import Ratings
from webapp.study.recruitment import Recruit
from webapp.study.sections import Quality
from webapp.study.session import DRIVEN, Page

EVERY_RULE = Quality(
    min_total_minutes=20,
    min_seconds_per_rating_page=30,
    straight_lining=True,
    failed_attention_checks=1,
    failed_quiz=True,
    duplicates=True,
    incomplete=True,
)
_EXPERIMENT = DRIVING.experiments[0].model_copy(update={"satisfaction": True, "layout_order": "counterbalanced"})
EVERYTHING: Study = DRIVING.model_copy(update={"quality": EVERY_RULE, "experiments": (_EXPERIMENT,)})
"""Everything around the trials, and all rules of quality."""


@dataclass(slots=True)
class History:
    """A study under way.

    Attributes:
        database: Where it is stored.
        chooser: What happens next.
        study: The study.
        mode: Who takes part.
        now: The clock.
        people: Who is there, by code, with the number of pages sent.
        excluded: Whom a researcher excluded.
    """

    database: Database
    chooser: random.Random
    study: Study = EVERYTHING
    mode: Mode = "live"
    now: datetime = NOW
    people: dict[str, tuple[Participant, int]] = field(default_factory=dict)
    excluded: set[str] = field(default_factory=set)

    @property
    def scope(self) -> Scope:
        return Scope(self.study.name, "v1", self.mode)

    def happen(self, times: int) -> None:
        """Let something happen, so often."""
        weights = {self._arrive: 4, self._send: 30, self._leave: 1, self._decide: 2, self._erase: 1, self._help: 1}
        for _ in range(times):
            self.now += timedelta(seconds=self.chooser.expovariate(1 / 40))
            (event,) = self.chooser.choices(tuple(weights), tuple(weights.values()))
            event()

    def _arrive(self) -> None:
        number = self.chooser.randrange(10**9)
        recruit = None
        if self.chooser.random() < 0.7:
            session = self.chooser.choice([None, f"s{self.chooser.randrange(9)}"])
            recruit = Recruit("prolific", f"id{number}", "study", session)
        mode: Mode = self.mode if self.chooser.random() < 0.9 else "bot"
        person = enrol_somebody(self.database, mode, study=self.study, recruit=recruit, cookie=str(number))
        if mode == self.mode:
            self.people[person.code] = person, 0

    def _send(self) -> None:
        code = self._somebody()
        if code is None:
            return
        person, num_sent = self.people[code]
        if num_sent == person.num_pages:
            return
        if self.chooser.random() < 0.03:
            self.now += timedelta(minutes=self.study.lease_minutes + 1)
        page = pages_of(self.database, person, self.study)[num_sent]
        content = self.content(page)
        outcome = send(self.database, person, page.number, study=self.study, content=content, now=self.now)
        if outcome == "accept":
            self.people[code] = person, num_sent + content.is_final

    def _leave(self) -> None:
        code = self._somebody()
        if code is not None:
            withdraw(self.database, self.people[code][0], self.now)

    def _decide(self) -> None:
        code = self._somebody()
        if code is None:
            return
        decide = include if code in self.excluded else exclude
        decide(self.database, code, "a reason", "ada", self.now)
        self.excluded ^= {code}

    def _erase(self) -> None:
        code = self._somebody()
        if code is not None:
            erase(self.database, code, "ada", self.now)
            del self.people[code]
            self.excluded.discard(code)

    def _help(self) -> None:
        code = self._somebody()
        if code is None:
            return
        person, num_sent = self.people[code]
        pages = pages_of(self.database, person, self.study)
        if find_person(self.database, code).is_in_progress:
            release_page(self.database, code, pages[num_sent], "was stuck", "ada", self.now)
            self.people[code] = person, num_sent + 1

    def _somebody(self) -> str | None:
        return self.chooser.choice(sorted(self.people)) if self.people else None

    def content(self, page: Page) -> PageContent:
        """Fill a page in as chance has it; a quiz is answered once."""
        left = [Event("focus_lost", "", "", 5), Event("focus_regained", "", "", 905)]
        events = left * self.chooser.choice((0, 0, 0, 1, 2))
        match page.kind:
            case "quiz":
                is_right = self.chooser.random() < 0.6
                answers = [Answer("goal", "flag" if is_right else "key", is_correct=is_right)]
                ends = not is_right and self.chooser.random() < 0.5
                return PageContent(answers=answers, events=events, failed=not is_right, screens_out=ends)
            case "rating":
                assert page.trial is not None
                items = self.study.experiment(page.trial.experiment).items_for(page.trial.kind)
                checks = self.study.checks_of(page.trial.experiment, page.trial.position)
                told = [Answer(check.id, "2", is_correct=self.chooser.random() < 0.7) for check in checks]
                return PageContent(ratings=self._ratings([item.id for item in items]), answers=told, events=events)
            case "satisfaction":
                return PageContent(ratings=self._ratings(SATISFACTION_ITEMS), events=events)
            case "probe":
                words = [(self.chooser.choice(("left", "right")), self.chooser.randint(1, 5)) for _ in range(2)]
                told_by = [prediction(number, *word) for number, word in enumerate(words, start=1)]
                return PageContent(predictions=told_by, events=events)
            case _ if page.kind in DRIVEN:
                return PageContent(drive=drive(page, self.chooser.choice(("reached", "gave_up"))), events=events)
            case _:
                return PageContent(events=events)

    def _ratings(self, items: Sequence[str]) -> Ratings:
        if self.chooser.random() < 0.5:
            return ratings_of(items, 3)
        return Ratings({item: self.chooser.randint(1, 5) for item in items}, dict.fromkeys(items, 1200))
